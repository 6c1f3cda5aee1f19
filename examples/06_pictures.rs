//! Draws the room, and what both cameras show when each task's first thing is grasped, into
//! `out/pictures/`: the pictures of the README.
//!
//! `cargo run --release --example 06_pictures`

use std::error::Error;
use std::path::Path;

use catena::simulator::{Bedroom, BedroomConfig, BedroomTask, Habits, demonstrate_on};
use catena::trajectory::{Image, Observation};
use image::{RgbImage, imageops};

fn main() -> Result<(), Box<dyn Error>> {
    let out = Path::new(env!("CARGO_MANIFEST_DIR")).join("out/pictures");
    std::fs::create_dir_all(&out)?;

    let mut bedroom = Bedroom::new(BedroomConfig::paper(BedroomTask::Trash));
    bedroom.arrange(3);
    picture(&bedroom.render_overview(600, 1066)).save(out.join("room.png"))?;

    let mut strip = RgbImage::new(3 * 320 + 20, 2 * 180 + 10);
    for (column, task) in BedroomTask::ALL.into_iter().enumerate() {
        let mut bedroom = Bedroom::new(BedroomConfig::paper(task));
        bedroom.arrange(5);
        let sure = Habits {
            missed_grasp: 0.0,
            missed_from_above: 0.0,
            ..Habits::default()
        };
        let trajectory = demonstrate_on(&mut bedroom, task, sure, 5)?.trajectory;
        let grasped = format!("{}_grasped", ["sock", "can", "tissue"][column]);
        let step = trajectory
            .marker_step(&grasped)
            .ok_or("nothing was grasped")?;
        paste(&mut strip, &trajectory.steps[step - 1].observation, column)?;
    }
    strip.save(out.join("cameras.png"))?;
    println!("drawn in {}", out.display());
    Ok(())
}

/// Puts the head camera's image above the wrist camera's, each twice as large.
fn paste(strip: &mut RgbImage, seen: &Observation, column: usize) -> Result<(), Box<dyn Error>> {
    for (row, camera) in ["head", "wrist"].into_iter().enumerate() {
        let large = imageops::resize(
            &picture(seen.image(camera)?),
            320,
            180,
            imageops::FilterType::CatmullRom,
        );
        imageops::replace(strip, &large, (column * 330) as i64, (row * 190) as i64);
    }
    Ok(())
}

fn picture(image: &Image) -> RgbImage {
    RgbImage::from_raw(image.width(), image.height(), image.rgb().to_vec())
        .expect("an image has three bytes a pixel")
}
