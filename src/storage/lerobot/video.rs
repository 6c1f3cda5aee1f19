//! Frames of a video, through the program `ffmpeg`.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use super::StorageError;
use super::episodes::VideoPart;
use super::frames::missing;
use crate::storage::pixels::MAX_IMAGE_BYTES;
use crate::trajectory::Image;

/// A video of which nothing comes for so long is given up.
const PATIENCE: Duration = Duration::from_mins(1);
/// What is kept of the program's complaints.
const COMPLAINT_BYTES: usize = 2000;

/// Which frames of an episode's video are wanted.
pub(super) struct Wanted<'a> {
    pub root: &'a Path,
    pub camera: &'a str,
    pub part: &'a VideoPart,
    pub fps: f64,
    /// Numbers of frames within the episode, rising.
    pub frames: &'a [u64],
}

/// Hands each wanted frame that is there to `take`; why others are not there.
pub(super) fn read_frames(
    wanted: &Wanted<'_>,
    mut take: impl FnMut(u64, Image),
) -> Result<Option<String>, StorageError> {
    let Some(last) = wanted.frames.last() else {
        return Ok(None);
    };
    let path = wanted.root.join(&wanted.part.path);
    let fault = |reason: String, source| StorageError::Video {
        path: path.clone(),
        camera: wanted.camera.to_owned(),
        reason,
        source,
    };
    std::fs::metadata(&path).map_err(|e| missing(&path, e))?;
    let mut program = command(&path, wanted.part.from_secs, wanted.fps, last + 1);
    let mut child = program.spawn().map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => fault(
            "there is no program `ffmpeg` on the PATH to read it with: install ffmpeg, or have the dataset \
             written with images instead of videos"
                .to_owned(),
            None,
        ),
        _ => fault(format!("ffmpeg cannot be started: {e}"), Some(e)),
    })?;
    let stdout = child.stdout.take();
    let complaints = child
        .stderr
        .take()
        .map(|e| thread::spawn(move || kept_text(e)));
    let watched = Watched::new(child);
    let mut frames = wanted.frames.iter().peekable();
    let mut input =
        BufReader::with_capacity(1 << 18, stdout.into_iter().next().expect("it is piped"));
    let mut number = 0;
    let mut broken = None;
    while frames.peek().is_some() {
        match next_picture(&mut input) {
            Ok(Some(image)) => {
                watched.is_alive();
                if frames.next_if(|f| **f == number).is_some() {
                    take(number, image);
                }
                number += 1;
            }
            Ok(None) => break,
            Err(reason) => {
                broken = Some(reason);
                break;
            }
        }
    }
    drop(input);
    let was_slow = watched.end();
    let said = complaints.and_then(|c| c.join().ok()).unwrap_or_default();
    if was_slow {
        let secs = PATIENCE.as_secs();
        let reason = format!("nothing came of it for {secs} s: is the file whole?");
        return Err(fault(reason, None));
    }
    if frames.peek().is_none() {
        return Ok(None);
    }
    let said = broken.unwrap_or(said);
    if number == 0 {
        let said = if said.is_empty() {
            "it holds no frame there".to_owned()
        } else {
            said
        };
        let reason = format!("no frame of it can be read: {said}. Fetch or write the file again");
        return Err(fault(reason, None));
    }
    Ok(Some(
        format!("the video ends after {number} frames. {said}")
            .trim_end()
            .to_owned(),
    ))
}

/// `ffmpeg` from half a frame before the first one, so that rounding leaves none out, with times that it
/// can neither double nor drop a frame for.
fn command(path: &Path, from_secs: f64, fps: f64, count: u64) -> Command {
    let mut command = Command::new("ffmpeg");
    command.args(["-nostdin", "-v", "error"]);
    let start = from_secs - 0.5 / fps;
    if start > 0.0 {
        command.args(["-ss", &format!("{start:.6}")]);
    }
    let mut file = std::ffi::OsString::from("file:");
    file.push(path);
    command.arg("-i").arg(file);
    command.args(["-map", "0:v:0", "-an", "-sn", "-dn"]);
    command.args([
        "-vf",
        &format!("setpts=N/({fps}*TB)"),
        "-r",
        &fps.to_string(),
    ]);
    command.args(["-frames:v", &count.to_string()]);
    command.args([
        "-f",
        "image2pipe",
        "-c:v",
        "ppm",
        "-pix_fmt",
        "rgb24",
        "pipe:1",
    ]);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// A running program that is ended when nothing is heard of it for long.
struct Watched {
    child: Arc<Mutex<Child>>,
    alive: mpsc::Sender<()>,
    watcher: thread::JoinHandle<bool>,
}

impl Watched {
    fn new(child: Child) -> Self {
        let child = Arc::new(Mutex::new(child));
        let (alive, heard) = mpsc::channel();
        let watched = Arc::clone(&child);
        let watcher = thread::spawn(move || {
            loop {
                match heard.recv_timeout(PATIENCE) {
                    Ok(()) => {}
                    Err(RecvTimeoutError::Disconnected) => return false,
                    Err(RecvTimeoutError::Timeout) => {
                        kill(&watched);
                        return true;
                    }
                }
            }
        });
        Self {
            child,
            alive,
            watcher,
        }
    }

    fn is_alive(&self) {
        // Nobody listens any more once the program was ended.
        let _ = self.alive.send(());
    }

    /// Ends the program; whether it had to be ended before for its silence.
    fn end(self) -> bool {
        drop(self.alive);
        let was_slow = self.watcher.join().unwrap_or(false);
        kill(&self.child);
        was_slow
    }
}

fn kill(child: &Mutex<Child>) {
    if let Ok(mut child) = child.lock() {
        // It may have ended by itself.
        let _ = child.kill();
        let _ = child.wait();
    }
}

/// The start of a text, as one line; the rest is read and forgotten.
fn kept_text(mut input: impl Read) -> String {
    const SHOWN: usize = 300;
    let mut kept = Vec::new();
    let mut part = [0; 4096];
    while let Ok(count @ 1..) = input.read(&mut part) {
        let room = COMPLAINT_BYTES.saturating_sub(kept.len()).min(count);
        kept.extend_from_slice(&part[..room]);
    }
    let text = String::from_utf8_lossy(&kept).into_owned();
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.chars().take(SHOWN).collect()
}

/// The next picture of a stream of PPM files; none at its end.
fn next_picture(input: &mut impl BufRead) -> Result<Option<Image>, String> {
    let mut word = || -> Result<String, String> {
        const LONGEST_LINE: u64 = 64;
        let mut line = String::new();
        let mut limited = (&mut *input).take(LONGEST_LINE);
        limited.read_line(&mut line).map_err(|e| e.to_string())?;
        Ok(line.trim_end().to_owned())
    };
    let magic = word()?;
    if magic.is_empty() {
        return Ok(None);
    }
    let (size, depth) = (word()?, word()?);
    let wrong = || format!("ffmpeg gave no picture but '{magic}', '{size}', '{depth}'");
    let (width, height) = size.split_once(' ').ok_or_else(wrong)?;
    let side = |text: &str| {
        text.parse::<u32>()
            .ok()
            .filter(|n| (1..=Image::LONGEST_SIDE).contains(n))
    };
    let (width, height) = side(width).zip(side(height)).ok_or_else(wrong)?;
    let bytes = u64::from(width) * u64::from(height) * 3;
    if magic != "P6" || depth != "255" || bytes > MAX_IMAGE_BYTES {
        return Err(wrong());
    }
    let mut rgb = vec![0; bytes as usize];
    input
        .read_exact(&mut rgb)
        .map_err(|_| "the last picture is incomplete".to_owned())?;
    Image::new(height, width, rgb)
        .map(Some)
        .map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_a_stream_are_read_and_damage_is_told() {
        let mut stream = b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06P6\n1 1\n255\n\x07\x08".to_vec();
        let mut input = &stream[..];
        let first = next_picture(&mut input).unwrap().unwrap();
        assert_eq!((first.height(), first.width()), (1, 2));
        assert_eq!(first.rgb(), [1, 2, 3, 4, 5, 6]);
        assert!(next_picture(&mut input).unwrap_err().contains("incomplete"));
        stream.push(9);
        let mut input = &stream[17..];
        assert_eq!(next_picture(&mut input).unwrap().unwrap().rgb(), [7, 8, 9]);
        assert_eq!(next_picture(&mut input).unwrap(), None);
        let mut huge: &[u8] = b"P6\n60000 60000\n255\nxx";
        assert!(next_picture(&mut huge).is_err());
        let endless = vec![b'x'; 100_000];
        let mut endless = endless.as_slice();
        assert!(next_picture(&mut endless).is_err());
    }
}
