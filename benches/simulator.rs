//! How fast the simulator is: one primitive with pictures from both cameras, and its parts.

use catena::environment::Environment;
use catena::simulator::{Bedroom, BedroomConfig, BedroomTask, Primitive};
use divan::Bencher;
use divan::counter::ItemsCount;

fn main() {
    divan::main();
}

fn bedroom() -> Bedroom {
    let mut bedroom = Bedroom::new(BedroomConfig::paper(BedroomTask::Sock));
    bedroom.arrange(1);
    bedroom
}

/// Turns forth and back, so that the robot stays where there is something to see.
const WAYS: [Primitive; 2] = [Primitive::BaseTurnLeft, Primitive::BaseTurnRight];

#[divan::bench]
fn step_with_both_cameras(bencher: Bencher) {
    let mut bedroom = bedroom();
    let mut turn = WAYS.iter().cycle();
    bencher.counter(ItemsCount::new(1_usize)).bench_local(|| {
        let primitive = turn.next().expect("a cycle never ends");
        bedroom.step(&primitive.action())
    });
}

#[divan::bench]
fn physics_of_a_primitive(bencher: Bencher) {
    let mut bedroom = bedroom();
    let mut turn = WAYS.iter().cycle();
    bencher.counter(ItemsCount::new(1_usize)).bench_local(|| {
        bedroom.act(*turn.next().expect("a cycle never ends"));
    });
}

#[divan::bench]
fn both_pictures(bencher: Bencher) {
    let mut bedroom = bedroom();
    bencher
        .counter(ItemsCount::new(2_usize))
        .bench_local(|| bedroom.observe());
}
