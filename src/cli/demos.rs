use super::arguments::DemosArguments;
use super::demonstrations::read_options;
use super::error::CliError;
use crate::storage::Recordings;

/// `catena demos`: what is in recordings, one block each; those that cannot be read are named, and
/// the others are still shown.
pub(super) fn demos(arguments: &DemosArguments) -> Result<(), CliError> {
    let recordings = Recordings::open(&arguments.paths, &read_options(&arguments.read))?;
    let looked = recordings.inspect();
    let failed = looked.iter().filter(|r| r.is_err()).count();
    if arguments.json {
        let reports: Vec<_> = looked.iter().filter_map(|r| r.as_ref().ok()).collect();
        println!("{}", serde_json::to_string_pretty(&reports)?);
    }
    for report in looked {
        match report {
            Ok(_) if arguments.json => {}
            Ok(report) => println!("{report}\n"),
            Err(error) => eprintln!("error: {error}\n"),
        }
    }
    match failed {
        0 => Ok(()),
        _ => Err(CliError::RecordingsFailed {
            failed,
            all: recordings.count(),
        }),
    }
}
