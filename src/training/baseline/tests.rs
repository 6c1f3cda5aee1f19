use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::WindowBatcher;
use super::objective::loss_of;
use super::sampler::WindowSampler;
use super::source::Source;
use super::trained::{BaselineState, network_of};
use super::*;
use crate::model::{BaselineMethod, FeatureEncoder, FrozenPictures, Latents, ModelError};
use crate::training::evaluation::values;
use crate::training::learner::optimiser;
use crate::training::synthetic::{Counting, sets};
use crate::training::weights::{NamedWeights, collect};
use crate::training::{
    Dataset, Preset, RunFolder, SilentObserver, StateRef, TrainingError, TrainingObserver,
    synthetic,
};
use crate::trajectory::{CameraSpec, State};

/// The mean colour of a picture, as an encoder that was trained elsewhere.
struct MeanColour {
    pictures: FrozenPictures,
    file: &'static [u8],
}

fn mean_colour(file: &'static [u8]) -> MeanColour {
    MeanColour {
        pictures: FrozenPictures {
            input: "image".to_owned(),
            output: "features".to_owned(),
            height: 8,
            width: 8,
            mean: [0.0; 3],
            deviation: [1.0; 3],
            feature_dim: 3,
        },
        file,
    }
}

impl FeatureEncoder for MeanColour {
    fn pictures(&self) -> &FrozenPictures {
        &self.pictures
    }

    fn file(&self) -> &[u8] {
        self.file
    }

    fn features(&self, states: &[State], cameras: &[CameraSpec]) -> Result<Latents, ModelError> {
        let mut table = Latents::new(3 * cameras.len());
        for state in states {
            let mut row = Vec::new();
            for camera in cameras {
                let image = state.newest().image(&camera.name).expect("all cameras");
                let pixels = image.rgb().len() as f32 / 3.0;
                row.extend((0..3).map(|channel| {
                    let of_channel = image.rgb().iter().skip(channel).step_by(3);
                    of_channel.map(|v| f32::from(*v)).sum::<f32>() / pixels
                }));
            }
            table.push(&row);
        }
        Ok(table)
    }
}

fn tiny(method: BaselineMethod, steps: u64) -> BaselineConfig {
    BaselineConfig {
        steps,
        validate_every_steps: 4,
        checkpoint_every_steps: 100,
        windows: 6,
        goals: 2,
        history: match method {
            BaselineMethod::Bc | BaselineMethod::Mvp => 1,
            _ => 3,
        },
        ..BaselineConfig::of(method, Preset::Tiny)
    }
}

fn fit(
    config: &BaselineConfig,
    folder: &Path,
    observer: &mut dyn TrainingObserver,
) -> Result<BaselineReport, TrainingError> {
    let encoder = mean_colour(b"frozen");
    let frozen = (config.method == BaselineMethod::Mvp).then_some(&encoder as &dyn FeatureEncoder);
    let folder = RunFolder::open(folder)?;
    train_baseline_on(&Device::flex(), &sets(), config, frozen, &folder, observer)
}

fn weights_of(report: &BaselineReport) -> Vec<NamedWeights> {
    collect(&report.baseline.network)
}

#[test]
fn the_same_seed_gives_the_same_weights_and_another_seed_others() {
    for (_, method) in BaselineMethod::NAMES {
        let run = |seed| {
            let folder = tempfile::tempdir().unwrap();
            let config = BaselineConfig {
                seed,
                ..tiny(method, 5)
            };
            weights_of(&fit(&config, folder.path(), &mut SilentObserver).unwrap())
        };
        assert_eq!(run(1), run(1), "{method}");
        assert_ne!(run(1), run(2), "{method}");
    }
}

#[test]
fn a_camera_that_is_called_like_the_output_of_its_encoder_is_refused_where_that_is_trained() {
    let shown = sets().map(|set| synthetic::with_wrist_called(&set, "latent"));
    for (_, method) in BaselineMethod::NAMES {
        let checked = check_baseline_training(&shown, &tiny(method, 2));
        if method == BaselineMethod::Mvp {
            checked.unwrap();
            continue;
        }
        let message = checked.unwrap_err().to_string();
        assert!(message.contains("'latent'"), "{method}: {message}");
    }
}

#[test]
fn a_stopped_training_goes_on_to_the_same_weights() {
    for (_, method) in BaselineMethod::NAMES {
        let whole = tempfile::tempdir().unwrap();
        let uninterrupted = fit(&tiny(method, 12), whole.path(), &mut SilentObserver).unwrap();

        let parts = tempfile::tempdir().unwrap();
        let mut stopping = Counting {
            stop_after: Some(5),
            ..Counting::default()
        };
        let stopped = fit(&tiny(method, 12), parts.path(), &mut stopping);
        assert!(matches!(
            stopped,
            Err(TrainingError::Stopped { step: 5, .. })
        ));
        let mut rest = Counting::default();
        let resumed = fit(&tiny(method, 12), parts.path(), &mut rest).unwrap();
        assert_eq!((rest.steps, rest.validations), (7, 2), "{method}");
        assert_eq!(weights_of(&resumed), weights_of(&uninterrupted), "{method}");
        let losses = |folder: &Path| std::fs::read_to_string(folder.join("losses.csv")).unwrap();
        assert_eq!(losses(parts.path()), losses(whole.path()));
        assert_eq!(losses(parts.path()).lines().count(), 13);
        let encoder = mean_colour(b"frozen");
        let of_run = TrainedBaseline::of_run(parts.path(), Some(&encoder)).unwrap();
        let of_run = of_run.unwrap();
        assert_eq!(collect(&of_run.network), weights_of(&uninterrupted));
    }
}

#[test]
fn a_checkpoint_of_another_training_or_method_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fit(
        &tiny(BaselineMethod::Mvp, 2),
        folder.path(),
        &mut SilentObserver,
    )
    .unwrap();
    let other = tiny(BaselineMethod::Bc, 2);
    let error = fit(&other, folder.path(), &mut SilentObserver).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("method is \"mvp\" there and \"bc\" here"),
        "{error}"
    );
    let encoder = mean_colour(b"another");
    let error = train_baseline_on(
        &Device::flex(),
        &sets(),
        &tiny(BaselineMethod::Mvp, 2),
        Some(&encoder),
        &RunFolder::open(folder.path()).unwrap(),
        &mut SilentObserver,
    )
    .unwrap_err();
    assert!(error.to_string().contains("frozen encoders"), "{error}");

    let ours = tempfile::tempdir().unwrap();
    let mut config = Preset::Tiny.config();
    config.steps = 1;
    let (device, run) = (Device::flex(), RunFolder::open(ours.path()).unwrap());
    crate::training::train_on(&device, &sets(), &config, &run, &mut SilentObserver).unwrap();
    drop(run);
    let error = fit(&other, ours.path(), &mut SilentObserver).unwrap_err();
    assert!(error.to_string().contains("another method"), "{error}");
}

#[test]
fn a_frozen_encoder_belongs_to_mvp_alone() {
    let folder = tempfile::tempdir().unwrap();
    let encoder = mean_colour(b"frozen");
    let run = |method, frozen| {
        let config = tiny(method, 1);
        let device = Device::flex();
        let run = RunFolder::open(folder.path()).unwrap();
        train_baseline_on(&device, &sets(), &config, frozen, &run, &mut SilentObserver)
    };
    assert!(matches!(
        run(BaselineMethod::Mvp, None),
        Err(TrainingError::FrozenEncoderNeeded { .. })
    ));
    assert!(matches!(
        run(BaselineMethod::Bc, Some(&encoder)),
        Err(TrainingError::FrozenEncoderUnused { .. })
    ));
}

#[test]
fn patience_ends_a_training_whose_held_out_loss_rises() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = tiny(BaselineMethod::Bc, 400);
    config.patience_validations = Some(2);
    config.optimiser.learning_rate = 1.0;
    let mut observer = Counting::default();
    let report = fit(&config, folder.path(), &mut observer).unwrap();
    assert!(report.steps < 400, "{}", report.steps);
    assert_eq!(report.baseline.step + 2 * 4, report.steps);
}

#[test]
fn one_batch_can_be_learnt_by_heart() {
    for method in [
        BaselineMethod::Bc,
        BaselineMethod::BcRnn,
        BaselineMethod::Rt1,
    ] {
        let config = tiny(method, 1);
        let data = Dataset::new(&sets()).unwrap();
        let all: Vec<u32> = (0..6).collect();
        let device = Device::flex().autodiff();
        let state = BaselineState::new(&data, &config, &all, None);
        let source = Source::pictures(&state.spec, &config, state.normalisation);
        let batcher = WindowBatcher {
            data: &data,
            sampler: WindowSampler::new(&data, &all, &config).unwrap(),
            source: &source,
            config: &config,
        };
        let input = batcher.step_input(0);
        let mut network = network_of(&state.spec, &config, &device);
        let mut optimiser = optimiser(&config.optimiser);
        let mut losses = Vec::new();
        for _ in 0..150 {
            let (loss, _) = loss_of(input.clone(), &network, &source, &[4], None, &device);
            losses.push(loss.clone().into_scalar::<f32>());
            let gradients = burn::optim::GradientsParams::from_grads(loss.backward(), &network);
            network = optimiser.step(5e-3, network, gradients);
        }
        let (first, last) = (losses[0], losses[149]);
        assert!((first - 4.0_f32.ln()).abs() < 0.4, "{method}: {first}");
        assert!(last < 0.1 * first, "{method}: {first} to {last}");
    }
}

#[test]
fn windows_repeat_the_first_state_and_goals_are_ends_of_the_same_task() {
    let data = Dataset::new(&sets()).unwrap();
    let config = BaselineConfig {
        windows: 200,
        history: 4,
        ..tiny(BaselineMethod::BcRnn, 1)
    };
    let all: Vec<u32> = (0..6).collect();
    let sampler = WindowSampler::new(&data, &all, &config).unwrap();
    let draw = sampler.draw(&data, &mut ChaCha8Rng::seed_from_u64(1));
    assert_eq!((draw.rows.len(), draw.goals.len()), (800, 200));
    assert_eq!(draw.states.len() - draw.of_windows, 2, "a goal a task");
    let mut early = 0;
    for (window, goal) in draw.rows.chunks_exact(4).zip(&draw.goals) {
        let states: Vec<StateRef> = window.iter().map(|row| draw.states[*row]).collect();
        let end = states[3];
        for (back, state) in states.iter().rev().enumerate() {
            assert_eq!(state.trajectory, end.trajectory);
            assert_eq!(state.step, end.step.saturating_sub(back as u32));
        }
        early += usize::from(end.step < 3);
        let goal = draw.states[*goal];
        assert_eq!(goal.step, 11);
        assert_eq!(data.set_of(goal.trajectory), data.set_of(end.trajectory));
    }
    assert!(early > 10, "{early} windows begin before the start");
}

#[test]
fn each_state_of_a_window_is_scored_once_with_its_own_action() {
    let data = Dataset::new(&sets()).unwrap();
    let config = BaselineConfig {
        windows: 50,
        ..tiny(BaselineMethod::Rt1, 1)
    };
    let all: Vec<u32> = (0..6).collect();
    let state = BaselineState::new(&data, &config, &all, None);
    let source = Source::pictures(&state.spec, &config, state.normalisation);
    let sampler = WindowSampler::new(&data, &all, &config).unwrap();
    let batcher = WindowBatcher {
        data: &data,
        sampler: sampler.clone(),
        source: &source,
        config: &config,
    };
    let input = batcher.step_input(3);
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    rng.set_stream(4);
    let draw = sampler.draw(&data, &mut rng);
    assert_eq!(input.scored.len(), draw.of_windows);
    for (place, class) in input.scored.iter().zip(&input.classes[0]) {
        let at = draw.states[draw.rows[*place as usize]];
        assert_eq!(*class as usize, data.classes(at)[0]);
    }
    let ends = (0..50).map(|window| window * 3 + 2);
    assert!(ends.into_iter().all(|end| input.scored.contains(&end)));
}

#[test]
fn every_state_is_learnt_from_alike_the_last_of_a_demonstration_too() {
    let data = Dataset::new(&sets()).unwrap();
    let all: Vec<u32> = (0..6).collect();
    for history in [1, 4] {
        let config = BaselineConfig {
            windows: 6_000,
            history,
            ..tiny(BaselineMethod::BcRnn, 1)
        };
        let sampler = WindowSampler::new(&data, &all, &config).unwrap();
        let draw = sampler.draw(&data, &mut ChaCha8Rng::seed_from_u64(1));
        let mut counts = [0.0; 12];
        for at in &draw.states[..draw.of_windows] {
            counts[at.step as usize] += f64::from(sampler.weight(*at));
        }
        let expected = config.windows as f64 / counts.len() as f64;
        for (step, count) in counts.iter().enumerate() {
            let ratio = count / expected;
            assert!((0.85..1.15).contains(&ratio), "step {step}: {ratio}");
        }
    }
}

#[test]
fn no_action_depends_on_what_comes_after_it() {
    let data = Dataset::new(&sets()).unwrap();
    for method in [BaselineMethod::BcRnn, BaselineMethod::Rt1] {
        let config = tiny(method, 1);
        let baseline = TrainedBaseline::untrained(&data, &config, None).unwrap();
        let dim = baseline.spec.latent_dim;
        let logits = |last: f32| {
            let seen: Vec<f32> = (0..3 * dim)
                .map(|i| if i < 2 * dim { (i % 7) as f32 } else { last })
                .collect();
            let history: Tensor<3> =
                Tensor::from_data(TensorData::new(seen, [1, 3, dim]), &Device::flex());
            let goal = Tensor::ones([1, dim], &Device::flex());
            values(baseline.network.policy.forward(history, goal, None))
        };
        let (one, other) = (logits(1.0), logits(-2.0));
        assert_eq!(one[..8], other[..8], "{method}");
        assert_ne!(one[8..], other[8..], "{method}");
    }
}

/// Run with `--nocapture` for the numbers.
#[test]
fn baselines_are_about_as_large_as_our_network() {
    let data = Dataset::new(&[synthetic::demonstrations_sized("a", 2, 8, 3, (90, 160))]).unwrap();
    for preset in [Preset::Paper, Preset::Bedroom] {
        let ours = crate::training::TrainedModel::untrained(&data, &preset.config());
        let ours: usize = collect(&ours.network).iter().map(|w| w.values.len()).sum();
        for method in [
            BaselineMethod::Bc,
            BaselineMethod::BcRnn,
            BaselineMethod::Rt1,
        ] {
            let config = BaselineConfig::of(method, preset);
            let baseline = TrainedBaseline::untrained(&data, &config, None).unwrap();
            let count = baseline.parameter_count();
            println!("{preset:?}: {method} {count}, ours {ours}");
            assert!(count * 4 > ours && count < 4 * ours, "{method}: {count}");
        }
    }
}
