use super::*;
use crate::training::checkpoint::in_old_form;
use crate::training::synthetic::{self, Counting, sets};
use crate::training::weights::{NamedWeights, collect};
use crate::training::{LandmarkConfig, Preset, SilentObserver};
use crate::trajectory::{Action, ActionSpace, Trajectory};

fn tiny(steps: u64) -> TrainingConfig {
    TrainingConfig {
        steps,
        validate_every_steps: 4,
        checkpoint_every_steps: 100,
        ..Preset::Tiny.config()
    }
}

fn on_cpu(
    config: &TrainingConfig,
    folder: &Path,
    observer: &mut dyn TrainingObserver,
) -> Result<TrainingReport, TrainingError> {
    let folder = RunFolder::open(folder)?;
    train_on(&Device::flex(), &sets(), config, &folder, observer)
}

fn weights_of(report: &TrainingReport) -> Vec<NamedWeights> {
    collect(&report.model.network)
}

#[test]
fn the_same_seed_gives_the_same_weights_and_another_seed_others() {
    let run = |seed| {
        let folder = tempfile::tempdir().unwrap();
        let config = TrainingConfig { seed, ..tiny(8) };
        weights_of(&on_cpu(&config, folder.path(), &mut SilentObserver).unwrap())
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_stopped_training_goes_on_to_the_same_weights() {
    let whole = tempfile::tempdir().unwrap();
    let uninterrupted = on_cpu(&tiny(12), whole.path(), &mut SilentObserver).unwrap();

    let parts = tempfile::tempdir().unwrap();
    let mut stopping = Counting {
        stop_after: Some(5),
        ..Counting::default()
    };
    let stopped = on_cpu(&tiny(12), parts.path(), &mut stopping);
    assert!(matches!(
        stopped,
        Err(TrainingError::Stopped { step: 5, .. })
    ));
    let mut rest = Counting::default();
    let resumed = on_cpu(&tiny(12), parts.path(), &mut rest).unwrap();
    assert_eq!(rest.steps, 7);
    assert_eq!(weights_of(&resumed), weights_of(&uninterrupted));

    let losses = |folder: &Path| std::fs::read_to_string(folder.join("losses.csv")).unwrap();
    assert_eq!(losses(parts.path()), losses(whole.path()));
    let finished = on_cpu(&tiny(12), parts.path(), &mut Counting::default()).unwrap();
    assert_eq!(weights_of(&finished), weights_of(&uninterrupted));
    let of_run = TrainedModel::of_run(parts.path()).unwrap().unwrap();
    assert_eq!(collect(&of_run.network), weights_of(&uninterrupted));
}

#[test]
fn a_checkpoint_that_cannot_be_written_leaves_the_older_one_to_go_on_from() {
    let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let uninterrupted = on_cpu(&tiny(12), whole.path(), &mut SilentObserver).unwrap();
    let mut stopping = Counting {
        stop_after: Some(5),
        ..Counting::default()
    };
    on_cpu(&tiny(12), parts.path(), &mut stopping).unwrap_err();
    let path = <Checkpoint>::path(parts.path());
    let older = std::fs::read(&path).unwrap();
    // A folder where the file is drafted cannot be written over.
    let draft = parts.path().join("checkpoint.safetensors.partial");
    std::fs::create_dir(&draft).unwrap();
    let error = on_cpu(&tiny(12), parts.path(), &mut SilentObserver).unwrap_err();
    assert!(
        matches!(error, TrainingError::CheckpointNotReplaced { .. }),
        "{error}"
    );
    let message = error.to_string();
    assert!(
        message.contains("checkpoint.safetensors: ") && message.contains("is still there"),
        "{message}"
    );
    assert_eq!(std::fs::read(&path).unwrap(), older);
    std::fs::remove_dir(&draft).unwrap();
    let resumed = on_cpu(&tiny(12), parts.path(), &mut SilentObserver).unwrap();
    assert_eq!(weights_of(&resumed), weights_of(&uninterrupted));
}

/// The bytes of a checkpoint of a training that was stopped, in the form of an earlier version, whose checksum leaves the
/// header out.
fn stopped_in_old_form(folder: &Path) -> Vec<u8> {
    let mut stopping = Counting {
        stop_after: Some(5),
        ..Counting::default()
    };
    on_cpu(&tiny(6), folder, &mut stopping).unwrap_err();
    in_old_form(&std::fs::read(<Checkpoint>::path(folder)).unwrap())
}

#[test]
fn a_checkpoint_of_an_earlier_version_is_gone_on_from() {
    let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let uninterrupted = on_cpu(&tiny(6), whole.path(), &mut SilentObserver).unwrap();
    let old = stopped_in_old_form(parts.path());
    std::fs::write(<Checkpoint>::path(parts.path()), old).unwrap();
    let mut rest = Counting::default();
    let resumed = on_cpu(&tiny(6), parts.path(), &mut rest).unwrap();
    assert_eq!(rest.steps, 1);
    assert_eq!(weights_of(&resumed), weights_of(&uninterrupted));
}

#[test]
fn a_header_that_does_not_fit_the_network_is_told_before_it_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let old = stopped_in_old_form(folder.path());
    // What comes right after these is changed: names in the network, or the key of the best weights.
    for (mark, told) in [
        ("\"weights.000.", "its weights do not fit"),
        ("\"average.000.", "its averages do not fit"),
        ("\"best.000.", "its best averages do not fit"),
        (
            "\\\"validations_without_gain\\\":0,\\\"",
            "tell of the best weights",
        ),
    ] {
        let mut damaged = old.clone();
        let mut windows = old.windows(mark.len());
        let at = windows.position(|window| window == mark.as_bytes());
        damaged[at.expect(mark) + mark.len()] ^= 1;
        std::fs::write(<Checkpoint>::path(folder.path()), damaged).unwrap();
        let error = on_cpu(&tiny(6), folder.path(), &mut SilentObserver).unwrap_err();
        let message = error.to_string();
        assert!(
            matches!(error, TrainingError::CheckpointUnusable { .. }) && message.contains(told),
            "{mark}: {message}"
        );
    }
}

#[test]
fn no_damage_to_a_header_of_an_earlier_version_is_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let old = stopped_in_old_form(folder.path());
    let header = u64::from_le_bytes(old[..8].try_into().unwrap()) as usize;
    for place in (8..8 + header).step_by(header / 100) {
        let mut damaged = old.clone();
        damaged[place] ^= 1_u8 << (place % 4);
        std::fs::write(<Checkpoint>::path(folder.path()), damaged).unwrap();
        // An error, or what it leaves out is of no weight.
        let _ = on_cpu(&tiny(6), folder.path(), &mut SilentObserver);
    }
}

/// The same demonstrations, whose actions go by other names.
fn renamed() -> [DemonstrationSet; 2] {
    sets().map(|set| {
        let mut trajectories = set.trajectories().to_vec();
        for trajectory in &mut trajectories {
            let names = ["back", "ahead", "right", "left"];
            trajectory.action_space = ActionSpace::Primitives {
                names: names.map(String::from).to_vec(),
            };
        }
        DemonstrationSet::new(set.task(), trajectories).expect("they are alike")
    })
}

#[test]
fn a_checkpoint_of_another_training_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    on_cpu(&tiny(2), folder.path(), &mut SilentObserver).unwrap();
    let error = on_cpu(&tiny(3), folder.path(), &mut SilentObserver).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("configurations (steps is 2 there and 3 here) differ")
            && message.contains("the learning rate falls over all steps"),
        "{message}"
    );
    let again = on_cpu(&tiny(2), folder.path(), &mut SilentObserver).unwrap();
    assert_eq!(again.states_per_sec, 0.0, "the finished one is still there");
    let other = [synthetic::demonstrations("c", 4, 12, 9)];
    let error = train_on(
        &Device::flex(),
        &other,
        &tiny(2),
        &RunFolder::open(folder.path()).unwrap(),
        &mut SilentObserver,
    );
    let message = error.unwrap_err().to_string();
    assert!(message.contains("its demonstrations differ"), "{message}");

    let error = train_on(
        &Device::flex(),
        &renamed(),
        &tiny(2),
        &RunFolder::open(folder.path()).unwrap(),
        &mut SilentObserver,
    );
    let message = error.unwrap_err().to_string();
    assert!(
        message.contains("its actions or cameras differ"),
        "{message}"
    );
}

#[test]
fn a_learning_rate_beyond_reason_is_told_as_divergence() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = tiny(40);
    config.optimiser.learning_rate = 1e30;
    config.checkpoint_every_steps = 1;
    let error = on_cpu(&config, folder.path(), &mut SilentObserver).unwrap_err();
    assert!(matches!(error, TrainingError::Diverged { .. }), "{error}");
    let way_out = "begin anew in another run folder, with a lower optimiser.learning_rate";
    assert!(error.to_string().ends_with(way_out), "{error}");
    config.optimiser.learning_rate = 1e-3;
    let refused = on_cpu(&config, folder.path(), &mut SilentObserver).unwrap_err();
    let refused = refused.to_string();
    assert!(
        refused.contains("configurations (optimiser.learning_rate is"),
        "another rate does not go on from a checkpoint: {refused}"
    );
}

/// Makes the first batch of a training, as often as it is called.
fn first_batch<'a>(run: &Run<'a>) -> impl Fn() -> StepInput + use<'a> {
    let (data, pictures) = (run.data, run.pictures.clone());
    let (sampler, motion) = (run.batches.clone(), run.motion.clone());
    let landmarks = run.landmarks.clone();
    let config = run.state.config.clone();
    move || {
        let batcher = Batcher {
            data,
            sampler: sampler.clone(),
            motion: motion.clone(),
            landmarks: landmarks.clone(),
            pictures: &pictures,
            config: &config,
        };
        batcher.step_input(0)
    }
}

#[test]
fn one_batch_can_be_learnt_by_heart() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = tiny(150);
    config.network.dropout = 0.0;
    config.network.encoder.stochastic_depth = 0.0;
    config.augmentation.shift_pixels = 0;
    config.augmentation.brightness = 0.0;
    config.augmentation.tint = 0.0;
    let data = Dataset::new(&sets()).unwrap();
    let device = Device::flex();
    let mut run = Run::prepare(&data, &config, folder.path(), &device).unwrap();
    let batch = first_batch(&run);
    let first = run.step(batch(), 3e-3).unwrap();
    let mut last = first;
    for _ in 0..150 {
        last = run.step(batch(), 3e-3).unwrap();
    }
    assert!(last.total < 0.1 * first.total, "{first:?} {last:?}");
}

#[test]
fn losses_fall_and_validations_come_when_they_are_due() {
    let folder = tempfile::tempdir().unwrap();
    let mut observer = Counting::default();
    let report = on_cpu(&tiny(60), folder.path(), &mut observer).unwrap();
    assert_eq!((observer.steps, observer.validations), (60, 15));
    assert!(observer.last < observer.first);
    assert_eq!(report.steps, 60);
}

#[test]
fn a_camera_that_is_called_like_the_output_of_its_encoder_is_refused_with_the_way_out() {
    let seen = |name: &str| sets().map(|set| synthetic::with_wrist_called(&set, name));
    let shown = seen("latent");
    let message = check_training(&shown, &tiny(2)).unwrap_err().to_string();
    assert!(
        message.contains("'latent'") && message.contains("mapping file"),
        "{message}"
    );
    let folder = tempfile::tempdir().unwrap();
    let run = RunFolder::open(folder.path()).unwrap();
    let refused = train_on(&Device::flex(), &shown, &tiny(2), &run, &mut SilentObserver);
    assert!(matches!(
        refused,
        Err(TrainingError::CameraNameTaken { .. })
    ));
    // Where the network does not see it, and with any other name, it may stay.
    let config = TrainingConfig {
        cameras: vec!["head".to_owned()],
        ..tiny(2)
    };
    check_training(&shown, &config).unwrap();
    check_training(&seen("logits"), &tiny(2)).unwrap();
}

/// Demonstrations that end with a gripper that closes.
fn grasping() -> [DemonstrationSet; 2] {
    sets().map(|set| {
        let mut trajectories = set.trajectories().to_vec();
        for trajectory in &mut trajectories {
            let names = [
                "down",
                "up",
                "right",
                "left",
                "gripper_close",
                "gripper_open",
            ];
            trajectory.action_space = ActionSpace::Primitives {
                names: names.map(String::from).to_vec(),
            };
            let last = trajectory.steps.last_mut().expect("it has steps");
            last.action = Action::Primitive(4);
        }
        DemonstrationSet::new(set.task(), trajectories).expect("they are alike")
    })
}

/// The losses and validations before and after eighty steps on one batch.
fn trained_on_one_batch(config: &TrainingConfig) -> [(StepLosses, ValidationMetrics); 2] {
    let folder = tempfile::tempdir().unwrap();
    let data = Dataset::new(&grasping()).unwrap();
    let mut run = Run::prepare(&data, config, folder.path(), &Device::flex()).unwrap();
    let batch = first_batch(&run);
    let untold = run.validate(&mut SilentObserver);
    let first = run.step(batch(), 3e-3).unwrap();
    for step in 1..=80 {
        run.step(batch(), 3e-3).unwrap();
        run.learner.note_step(step);
    }
    let last = run.step(batch(), 3e-3).unwrap();
    [(first, untold), (last, run.validate(&mut SilentObserver))]
}

#[test]
fn the_motion_to_go_is_learnt_and_told_of_held_out_states() {
    let mut config = tiny(120);
    config.motion_weight = 2.0;
    config.augmentation.mirror_share = 0.4;
    let [(first, untold), (last, told)] = trained_on_one_batch(&config);
    assert!(last.motion < 0.5 * first.motion, "{first:?} {last:?}");
    let (untold, told) = (untold.motion_explained, told.motion_explained);
    assert!(untold.is_some() && told != untold);
}

/// Learns the landmarks of a robot that goes to the left by the name that demonstrations have for it.
fn seeing(steps: u64) -> TrainingConfig {
    let mut config = tiny(steps);
    config.landmarks = Some(LandmarkConfig::bedroom());
    let robot = &mut config.landmarks.as_mut().unwrap().robot;
    let moves = robot.primitives["end_effector_left"];
    robot.primitives.insert("left".to_owned(), moves);
    config
}

#[test]
fn landmarks_are_learnt_and_their_error_is_told() {
    let mut config = seeing(120);
    config.augmentation.mirror_share = 0.4;
    let [(first, untold), (last, told)] = trained_on_one_batch(&config);
    assert!(last.landmarks < 0.8 * first.landmarks, "{first:?} {last:?}");
    let (untold, told) = (untold.landmark_error_pixels, told.landmark_error_pixels);
    assert!(untold.is_some() && told != untold);
}

#[test]
fn a_model_comes_of_a_training_that_holds_out_all_events_of_the_gripper() {
    let config = seeing(2);
    let [shown, _] = grasping();
    let mut two = shown.trajectories()[..2].to_vec();
    let set = |of: &[Trajectory]| DemonstrationSet::new("a", of.to_vec()).expect("they are alike");
    let data = Dataset::new(&[set(&two)]).unwrap();
    let split = data.split(config.validation_share, config.seed);
    let trained = &mut two[split.training[0] as usize].steps;
    trained.last_mut().expect("it has steps").action = Action::Primitive(0);
    let (folder, sets) = (tempfile::tempdir().unwrap(), [set(&two)]);
    let (device, run) = (Device::flex(), RunFolder::open(folder.path()).unwrap());
    let report = train_on(&device, &sets, &config, &run, &mut SilentObserver).unwrap();
    let book = report.model.landmarks.expect("landmarks are learnt");
    let errors: Vec<f32> = book.landmarks.iter().map(|l| l.error_pixels).collect();
    assert_eq!(
        errors,
        [f32::MAX],
        "no picture that was trained on shows it"
    );
}

#[test]
fn a_motion_to_go_of_actions_without_a_gripper_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = tiny(2);
    config.motion_weight = 1.0;
    let error = on_cpu(&config, folder.path(), &mut SilentObserver).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("motion_weight is 1"), "{message}");
    assert!(message.contains("gripper_close"), "{message}");
}
