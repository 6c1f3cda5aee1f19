//! Everything of an MCAP file that can still be read, and what cannot.
//!
//! The library's own readers stop at the first error and do not check chunks unless told to. Here a
//! chunk is believed only if its checksum is right; a wrong one is left out and the next one read on.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

use super::digest::hexadecimal;
use super::topic::Channel;
use super::{Loss, StorageError};

/// Opcode and length before each record.
const RECORD_HEAD_BYTES: u64 = 9;
/// A chunk that claims or unpacks to more is damaged; writers make chunks of a few MiB.
const CHUNK_BYTES_LIMIT: usize = 1 << 30;

/// What a file holds besides its messages.
#[derive(Debug, Default)]
pub(super) struct Salvage {
    pub bytes: u64,
    pub profile: String,
    pub library: String,
    /// Metadata records by name.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    pub losses: Vec<Loss>,
}

impl Salvage {
    /// Says of all that is lost in which of several files it is.
    pub(super) fn tell_file(&mut self, file: &Path) {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let losses = std::mem::take(&mut self.losses).into_iter();
        let told = losses.map(|loss| Loss::InFile {
            file: name.to_string(),
            loss: Box::new(loss),
        });
        self.losses = told.collect();
    }

    /// Takes in what the next file of a recording holds.
    pub(super) fn take(&mut self, next: Self) {
        self.bytes += next.bytes;
        for (record, entries) in next.metadata {
            self.metadata.entry(record).or_default().extend(entries);
        }
        self.losses.extend(next.losses);
    }
}

/// Reads a file from its start to its end and hands every complete message to `sink`: its channel,
/// its log time in nanoseconds and its bytes, in the order of the file.
pub(super) fn salvage(
    path: &Path,
    sink: impl FnMut(&Channel, u64, Vec<u8>),
) -> Result<Salvage, StorageError> {
    let file = File::open(path).map_err(StorageError::io("read", path))?;
    let bytes = file
        .metadata()
        .map_err(StorageError::io("read", path))?
        .len();
    let mut input = BufReader::with_capacity(1 << 18, file);
    check_magic(path, &mut input)?;
    let mut salvager = Salvager {
        found: Salvage {
            bytes,
            ..Salvage::default()
        },
        schemas: HashMap::new(),
        channels: HashMap::new(),
        early: BTreeMap::new(),
        sink,
    };
    let stop = salvager
        .read_records(&mut input)
        .map_err(StorageError::io("read", path))?;
    if let Some(stop) = stop {
        salvager
            .salvage_tail(&mut input, &stop)
            .map_err(StorageError::io("read", path))?;
    }
    salvager.finish_early_messages();
    Ok(salvager.found)
}

/// Says what a file is that is no MCAP recording.
///
/// # Errors
/// As of a recording that begins with the wrong bytes.
pub(super) fn check_begins_as_mcap(path: &Path) -> Result<(), StorageError> {
    let mut file = File::open(path).map_err(StorageError::io("read", path))?;
    check_magic(path, &mut file)
}

fn check_magic(path: &Path, input: &mut (impl Read + Seek)) -> Result<(), StorageError> {
    let mut start = Vec::new();
    input
        .take(MAGIC.len() as u64)
        .read_to_end(&mut start)
        .and_then(|_| input.rewind())
        .map_err(StorageError::io("read", path))?;
    if start.is_empty() {
        return Err(StorageError::EmptyFile {
            path: path.to_owned(),
        });
    }
    if start == MAGIC {
        return Ok(());
    }
    let pairs: Vec<_> = start.iter().map(|b| hexadecimal(&[*b])).collect();
    Err(StorageError::NotMcap {
        path: path.to_owned(),
        found: pairs.join(" "),
        way_out: way_out(&start),
    })
}

/// What a file with other first bytes seems to be, and how it becomes a recording.
fn way_out(start: &[u8]) -> &'static str {
    const KNOWN: &[(&[u8], &str)] = &[
        (
            b"SQLite f",
            ". It seems to be a ROS 2 bag of SQLite: write it as MCAP with `ros2 bag convert`",
        ),
        (
            b"#ROSBAG ",
            ". It seems to be a ROS 1 bag: write it as a ROS 2 bag of MCAP with `rosbags-convert`",
        ),
        (
            &[0x28, 0xb5, 0x2f, 0xfd],
            ". It is compressed as a whole: unpack it with `zstd -d`",
        ),
        (
            &[0x1f, 0x8b],
            ". It is compressed as a whole: unpack it with `gzip -d`",
        ),
        (
            b"\x89HDF\r\n\x1a\n",
            ". It is HDF5: write it as a LeRobot dataset, or as MCAP",
        ),
    ];
    let known = KNOWN.iter().find(|(magic, _)| start.starts_with(magic));
    known.map_or("", |(_, way_out)| *way_out)
}

/// Where and why reading stopped before the end of the file.
struct Stop {
    at_byte: u64,
    error: McapError,
}

struct Salvager<F> {
    found: Salvage,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Arc<Channel>>,
    /// Messages whose channel was not described yet: its description was in a damaged chunk and may
    /// come again, at the latest in the summary.
    early: BTreeMap<u16, Vec<(u64, Vec<u8>)>>,
    sink: F,
}

impl<F: FnMut(&Channel, u64, Vec<u8>)> Salvager<F> {
    /// Reads records until the footer; `Some` when the file ends or breaks before it.
    fn read_records(&mut self, input: &mut (impl Read + Seek)) -> std::io::Result<Option<Stop>> {
        let mut at_byte = MAGIC.len() as u64;
        let mut reader = self.record_reader(false);
        loop {
            match reader.next_event() {
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let count = input.read(reader.insert(wanted))?;
                    reader.notify_read(count);
                }
                Some(Ok(LinearReadEvent::Record {
                    opcode: op::FOOTER, ..
                })) => return Ok(None),
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    self.take_record(at_byte, opcode, data);
                    at_byte += RECORD_HEAD_BYTES + data.len() as u64;
                }
                Some(Err(McapError::BadDataCrc { saved, calculated })) => {
                    // A damaged chunk is reported already and makes this checksum wrong as well.
                    if self.found.losses.is_empty() {
                        self.found
                            .losses
                            .push(Loss::DataChecksum { saved, calculated });
                    }
                    // The summary behind it may describe channels that were lost.
                    input.seek(SeekFrom::Start(at_byte))?;
                    reader = self.record_reader(true);
                }
                Some(Err(error)) => return Ok(Some(Stop { at_byte, error })),
                None => {
                    let error = McapError::UnexpectedEof;
                    return Ok(Some(Stop { at_byte, error }));
                }
            }
        }
    }

    /// A reader of whole chunks; one that goes on inside the file cannot check the file's checksum.
    fn record_reader(&self, goes_on: bool) -> LinearReader {
        LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_emit_chunks(true)
                .with_skip_start_magic(goes_on)
                .with_skip_end_magic(true)
                .with_validate_data_section_crc(!goes_on)
                .with_record_length_limit(usize::try_from(self.found.bytes).unwrap_or(usize::MAX)),
        )
    }

    fn take_record(&mut self, at_byte: u64, opcode: u8, data: &[u8]) {
        if opcode != op::CHUNK {
            if let Err(error) = self.take_flat_record(opcode, data) {
                self.found.losses.push(Loss::UnreadableRecord {
                    at_byte,
                    reason: error.to_string(),
                });
            }
            return;
        }
        let mut head = vec![op::CHUNK];
        head.extend((data.len() as u64).to_le_bytes());
        let (records, error) = chunk_records(&mut head.chain(data), true, CHUNK_BYTES_LIMIT);
        let error = error.or_else(|| {
            records
                .into_iter()
                .find_map(|(opcode, data)| self.take_flat_record(opcode, &data).err())
        });
        if let Some(error) = error {
            self.found.losses.push(Loss::DamagedChunk {
                at_byte,
                bytes: RECORD_HEAD_BYTES + data.len() as u64,
                reason: error.to_string(),
            });
        }
    }

    /// Takes a record that is no chunk; those that say nothing of messages are passed over.
    fn take_flat_record(&mut self, opcode: u8, data: &[u8]) -> Result<(), McapError> {
        // Others are not parsed at all: some of them the parser does not survive when damaged.
        if !matches!(
            opcode,
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA
        ) {
            return Ok(());
        }
        match mcap::parse_record(opcode, data)? {
            Record::Header(header) => {
                self.found.profile = header.profile;
                self.found.library = header.library;
            }
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => self.take_channel(channel),
            Record::Message { header, data } => match self.channels.get(&header.channel_id) {
                Some(channel) => (self.sink)(channel, header.log_time, data.into_owned()),
                None => self
                    .early
                    .entry(header.channel_id)
                    .or_default()
                    .push((header.log_time, data.into_owned())),
            },
            Record::Metadata(metadata) => {
                self.found
                    .metadata
                    .entry(metadata.name)
                    .or_default()
                    .extend(metadata.metadata);
            }
            _ => {}
        }
        Ok(())
    }

    fn take_channel(&mut self, channel: mcap::records::Channel) {
        let id = channel.id;
        let described = Arc::new(Channel {
            topic: channel.topic,
            type_name: self
                .schemas
                .get(&channel.schema_id)
                .cloned()
                .unwrap_or_default(),
            encoding: channel.message_encoding,
        });
        for (nanos, data) in self.early.remove(&id).unwrap_or_default() {
            (self.sink)(&described, nanos, data);
        }
        self.channels.insert(id, described);
    }

    /// Notes why reading stopped; of a chunk that is cut off, takes the messages that are complete.
    fn salvage_tail(&mut self, input: &mut (impl Read + Seek), stop: &Stop) -> std::io::Result<()> {
        let of_bytes = self.found.bytes;
        // No record may be longer than the file, so one that claims to be is incomplete as well.
        if !matches!(
            stop.error,
            McapError::UnexpectedEof | McapError::RecordTooLarge { .. }
        ) {
            self.found.losses.push(Loss::UnreadableRest {
                at_byte: stop.at_byte,
                bytes: of_bytes.saturating_sub(stop.at_byte),
                reason: stop.error.to_string(),
            });
            return Ok(());
        }
        input.seek(SeekFrom::Start(stop.at_byte))?;
        let mut head = [0u8];
        let is_chunk = input.read(&mut head)? == 1 && head[0] == op::CHUNK;
        let mut unchecked_messages = 0;
        if is_chunk {
            input.seek(SeekFrom::Start(stop.at_byte))?;
            for (opcode, data) in chunk_records(input, false, CHUNK_BYTES_LIMIT).0 {
                if self.take_flat_record(opcode, &data).is_err() {
                    break;
                }
                unchecked_messages += usize::from(opcode == op::MESSAGE);
            }
        }
        self.found.losses.push(Loss::CutOff {
            at_byte: stop.at_byte,
            of_bytes,
            unchecked_messages,
        });
        Ok(())
    }

    fn finish_early_messages(&mut self) {
        let messages = self.early.values().map(Vec::len).sum();
        if messages > 0 {
            self.found.losses.push(Loss::UnknownChannel { messages });
        }
    }
}

/// The records in a chunk, given the chunk record from its opcode on, and the error that ended it.
///
/// With `checked` no record is given unless the checksum of all of them is right; a chunk without a
/// checksum is believed. No more than `limit` bytes are unpacked, with a checksum or without.
fn chunk_records(
    input: &mut impl Read,
    checked: bool,
    limit: usize,
) -> (Vec<(u8, Vec<u8>)>, Option<McapError>) {
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(checked)
            .with_record_length_limit(limit),
    );
    let mut records = Vec::new();
    let mut unpacked: u64 = 0;
    loop {
        match reader.next_event() {
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                match input.read(reader.insert(wanted)) {
                    Ok(count) => reader.notify_read(count),
                    Err(error) => return (records, Some(error.into())),
                }
            }
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                unpacked += RECORD_HEAD_BYTES + data.len() as u64;
                // The reader holds the whole to the limit only where there is a checksum.
                if unpacked > limit as u64 {
                    if checked {
                        records.clear();
                    }
                    return (records, Some(McapError::ChunkTooLarge(unpacked)));
                }
                records.push((opcode, data.to_vec()));
            }
            Some(Err(error)) if checked => return (Vec::new(), Some(error)),
            Some(Err(error)) => return (records, Some(error)),
            None => return (records, None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chunk that is not compressed, with two records of 100 bytes; it has no checksum where that is 0.
    fn chunk(checksum: u32) -> Vec<u8> {
        const RECORDS_BYTES: u64 = 2 * (RECORD_HEAD_BYTES + 100);
        let mut fields: Vec<u8> = Vec::new();
        for number in [0, 1, RECORDS_BYTES] {
            fields.extend(number.to_le_bytes());
        }
        fields.extend(checksum.to_le_bytes());
        fields.extend(0_u32.to_le_bytes());
        fields.extend(RECORDS_BYTES.to_le_bytes());
        for content in [1_u8, 2] {
            fields.push(op::MESSAGE);
            fields.extend(100_u64.to_le_bytes());
            fields.extend([content; 100]);
        }
        let mut chunk = vec![op::CHUNK];
        chunk.extend((fields.len() as u64).to_le_bytes());
        chunk.extend(fields);
        chunk
    }

    #[test]
    fn a_chunk_without_a_checksum_unpacks_to_no_more_than_one_with_it() {
        let read = |checksum, checked, limit| {
            let (records, error) = chunk_records(&mut chunk(checksum).as_slice(), checked, limit);
            (records.len(), error.map(|e| e.to_string()))
        };
        assert_eq!(read(0, true, 218), (2, None));
        assert_eq!(read(0, false, 218), (2, None));
        let too_large = "chunk (de)compressed length exceeds limit: `218`".to_owned();
        for checksum in [0, 7] {
            assert_eq!(
                read(checksum, true, 217),
                (0, Some(too_large.clone())),
                "checksum {checksum}"
            );
        }
        // Of a chunk that is cut off what was complete is kept.
        assert_eq!(read(0, false, 217), (1, Some(too_large)));
    }
}
