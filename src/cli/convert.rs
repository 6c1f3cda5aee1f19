use super::arguments::{ConvertArguments, FormatArgument, PicturesArgument};
use super::demonstrations::read_options;
use super::error::CliError;
use crate::storage::{PictureFormat, Recordings, convert_to_lerobot, convert_to_mcap};
use crate::wording::counted;

/// `catena convert`: recordings of any kind as a LeRobot dataset or as MCAP files.
pub(super) fn convert(arguments: &ConvertArguments) -> Result<(), CliError> {
    let recordings = Recordings::open(&arguments.paths, &read_options(&arguments.read))?;
    let pictures = match arguments.images {
        PicturesArgument::Png => PictureFormat::Png,
        PicturesArgument::Jpeg => PictureFormat::Jpeg,
    };
    let conversion = match arguments.to {
        FormatArgument::Lerobot => convert_to_lerobot(&recordings, &arguments.out, pictures)?,
        FormatArgument::Mcap => convert_to_mcap(&recordings, &arguments.out, pictures)?,
    };
    for reason in &conversion.left_out {
        eprintln!("warning: left out: {reason}");
    }
    let rate = conversion
        .fps
        .map_or_else(String::new, |fps| format!(" at {fps} frames a second"));
    println!(
        "{}, {}{rate}, of {}: {}\nin {}",
        counted(conversion.episodes, "episode"),
        counted(conversion.steps, "step"),
        if conversion.tasks.len() == 1 {
            "one task"
        } else {
            "several tasks"
        },
        conversion.tasks.join("; "),
        arguments.out.display()
    );
    for lost in &conversion.lost {
        println!("not converted: {lost}");
    }
    Ok(())
}
