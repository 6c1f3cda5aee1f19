"""Trains the network of `catena train` as the paper describes it (Fu & Finn, sections III-C, III-E and III-F): a
mini-batch is made of pairs, and both states of every pair are encoded.

    python train_pairs.py DEMOS/sock DEMOS/trash --preset bedroom --minutes 30 --csv pairs.csv
    python train_pairs.py --check

Network, optimiser, learning rate, averaging of weights, augmentation, held-out demonstrations and validation are the
trainer's; what differs is how states and pairs are drawn."""

import argparse
import copy
import csv
import json
import math
import os
import struct
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path

# Threads that wait are not to spin: another program on one core would slow every step tenfold. OpenMP reads this when
# PyTorch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

import recordings
from network import LatentFlowNetwork, NetworkConfig, take_weights
from recordings import Trajectory
from rust_random import RustRandom, chacha8_words

ENCODED_AT_ONCE = 64
SCORED_AT_ONCE = 4_096
VALIDATION_FAR_PAIRS = 16_384
MEASURED_IMAGES = 256
# Weights that `catena train` reports for two cameras of 90x160 pixels, two frames and 15 primitives.
KNOWN_WEIGHTS = {"paper": 1_010_820, "bedroom": 1_025_412}


@dataclass(frozen=True)
class Config:
    """What a training is; the defaults are the preset `paper`."""

    network: NetworkConfig = NetworkConfig()
    stack: int = 2
    d_max: int = 5
    far_weight: float = 5.0
    policy_weight: float = 5.0
    validation_share: float = 0.1
    missed_grasp_steps: int = 0
    lead_steps: int = 0
    shift_pixels: int = 4
    brightness: float = 0.2
    tint: float = 0.05
    learning_rate: float = 1e-3
    final_share: float = 0.01
    warmup_steps: int = 200
    weight_decay: float = 1e-2
    clip_norm: float = 1.0
    average_decay: float = 0.998

    @classmethod
    def of_json(cls, config: dict) -> "Config":
        """The trainer's own configuration, as its checkpoints hold it."""
        parts = [config, *(config[part] for part in ("imitation", "augmentation", "optimiser"))]
        flat = {key: value for part in parts for key, value in part.items()}
        network = {**config["network"], **config["network"]["encoder"]}
        network["stage_channels"] = tuple(network["stage_channels"])
        known = {field.name for field in fields(NetworkConfig)}
        flat["network"] = NetworkConfig(**{k: v for k, v in network.items() if k in known})
        return cls(**{field.name: flat[field.name] for field in fields(cls)})


# Only what concerns the network, the held-out demonstrations and the imitated actions: the preset's own ways to draw
# pairs are what is compared against.
PRESETS = {
    "paper": Config(),
    "bedroom": Config(network=NetworkConfig(keypoints=32), validation_share=0.067, missed_grasp_steps=6, lead_steps=6),
}


class Data:
    """All states of all demonstrations, numbered one demonstration after another."""

    def __init__(self, trajectories: list[Trajectory], config: Config) -> None:
        self.trajectories = trajectories
        lengths = [len(t.actions) for t in trajectories]
        self.starts = np.cumsum([0, *lengths])
        self.trajectory_of = np.repeat(np.arange(len(lengths)), lengths)
        self.actions = np.concatenate([t.actions for t in trajectories])
        imitated = [t.imitated(config.missed_grasp_steps, config.lead_steps) for t in trajectories]
        self.imitated = np.concatenate(imitated)
        self.cameras = list(trajectories[0].frames)
        # Edges are repeated once and for all, so that a shifted picture is a slice.
        self.margin = config.shift_pixels
        around = ((0, 0), (0, 0), (self.margin,) * 2, (self.margin,) * 2)
        self.frames = []
        for name in self.cameras:
            self.frames.append(np.concatenate([np.pad(t.frames[name], around, mode="edge") for t in trajectories]))
            for trajectory in trajectories:
                del trajectory.frames[name]
        self.sizes = [(f.shape[2] - 2 * self.margin, f.shape[3] - 2 * self.margin) for f in self.frames]

    def states_of(self, trajectories: list[int]) -> np.ndarray:
        """All states of some demonstrations, in order."""
        return np.concatenate([np.arange(self.starts[t], self.starts[t + 1]) for t in trajectories])

    def near_pairs(self, trajectories: list[int], d_max: int) -> list[np.ndarray]:
        """For each near class, counted from 0, all pairs `[pairs, 2]`: a state is one step from itself."""
        by_gap = []
        for gap in range(d_max):
            states = [np.arange(self.starts[t], max(self.starts[t + 1] - gap, self.starts[t])) for t in trajectories]
            first = np.concatenate(states)
            by_gap.append(np.stack([first, first + gap], axis=1))
        return [np.concatenate(by_gap[:2]), *by_gap[2:]]

    def is_far(self, one: np.ndarray, other: np.ndarray, d_max: int) -> np.ndarray:
        """Case 2 of section III-C."""
        same = self.trajectory_of[one] == self.trajectory_of[other]
        return ~same | (other < one) | (other - one >= d_max)


def split(data: Data, share: float, seed: int) -> tuple[list[int], list[int]]:
    """Demonstrations to train on and those held out: the same as the trainer's."""
    rng = RustRandom(seed)
    tasks = [t.task for t in data.trajectories]
    held_out: list[int] = []
    for task in sorted(set(tasks)):
        members = [index for index, of in enumerate(tasks) if of == task]
        rng.shuffle(members)
        held_out += members[: min(math.floor(len(members) * share + 0.5), len(members) - 1)]
    if not held_out:
        members = list(range(len(tasks)))
        rng.shuffle(members)
        held_out = members[:1]
    return [index for index in range(len(tasks)) if index not in held_out], sorted(held_out)


def named_split(data: Data, file: Path) -> tuple[list[int], list[int]]:
    """Holds out the demonstrations whose names a JSON file lists."""
    names = json.loads(file.read_text())
    held_out = [index for index, t in enumerate(data.trajectories) if t.name in names]
    if len(held_out) != len(names):
        raise SystemExit(f"{file} names {len(names)} demonstrations, of which {len(held_out)} are there")
    return [index for index in range(len(data.trajectories)) if index not in held_out], held_out


class Pictures:
    """Turns states into what the network takes."""

    def __init__(self, data: Data, training: list[int], config: Config) -> None:
        self.data, self.config = data, config
        self.normalisation = []
        states = data.states_of(training)
        states = states[:: max(-(-len(states) // MEASURED_IMAGES), 1)]
        m = data.margin
        for frames, (rows, columns) in zip(data.frames, data.sizes):
            pixels = frames[states, :, m : m + rows, m : m + columns].transpose(1, 0, 2, 3).reshape(3, -1)
            mean = pixels.mean(axis=1, dtype=np.float64)
            squares = np.array([np.mean(np.square(p, dtype=np.float64)) for p in pixels])
            deviation = np.sqrt(np.maximum(squares - mean**2, 1.0))
            self.normalisation.append((mean.astype(np.float32), deviation.astype(np.float32)))

    def of(self, states: np.ndarray, variations: np.ndarray | None = None) -> list[Tensor]:
        """`[states, frames * 3, rows, columns]` of each camera, oldest frame first. A variation of a state and a
        camera is the shift down, the shift to the right and a factor for each colour."""
        data, stack = self.data, self.config.stack
        first = data.starts[data.trajectory_of[states]]
        pictures = []
        for camera, (rows, columns) in enumerate(data.sizes):
            mean, deviation = (np.tile(v, stack)[:, None, None] for v in self.normalisation[camera])
            out = np.empty((len(states), 3 * stack, rows, columns), dtype=np.float32)
            for row, state in enumerate(states):
                down, right, gain = 0, 0, None
                if variations is not None:
                    down, right = (int(v) for v in variations[row, camera, :2])
                    gain = variations[row, camera, 2:].astype(np.float32)[:, None, None]
                y, x = data.margin - down, data.margin - right
                picture = out[row]
                for frame in range(stack):
                    seen = data.frames[camera][max(state - (stack - 1 - frame), first[row])]
                    part = picture[3 * frame : 3 * frame + 3]
                    if gain is None:
                        part[...] = seen[:, y : y + rows, x : x + columns]
                    else:
                        np.multiply(seen[:, y : y + rows, x : x + columns], gain, out=part)
                        np.minimum(part, 255.0, out=part)
                picture -= mean
                picture /= deviation
            pictures.append(torch.from_numpy(out))
        return pictures

    def variations(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """`[count, cameras, 5]`, drawn at random."""
        shape, config = (count, len(self.data.cameras)), self.config
        shifts = rng.integers(-config.shift_pixels, config.shift_pixels, (*shape, 2), endpoint=True)
        brightness = 1 + config.brightness * rng.uniform(-1, 1, (*shape, 1))
        tint = 1 + config.tint * rng.uniform(-1, 1, (*shape, 3))
        return np.concatenate([shifts, brightness * tint], axis=2)


@dataclass
class Batch:
    """A mini-batch of pairs, near ones first."""

    # First states of all pairs, then second states.
    pictures: list[Tensor]
    near: int
    # Of all pairs, counted from 0.
    classes: Tensor
    # Near pairs that the policy learns, and their actions.
    learnt: Tensor
    actions: Tensor


class Sampler:
    """The paper's mini-batches: one half near pairs, every class as often as the others, one half far pairs drawn
    uniformly."""

    def __init__(self, data: Data, pictures: Pictures, training: list[int], pairs: int, seed: int) -> None:
        self.data, self.pictures, self.config = data, pictures, pictures.config
        self.states = data.states_of(training)
        self.by_class = [pairs for pairs in data.near_pairs(training, self.config.d_max) if len(pairs)]
        self.near, self.far = pairs // 2, pairs - pairs // 2
        self.rng = np.random.default_rng(seed)

    def draw(self, varied: bool = True) -> Batch:
        rng, d_max = self.rng, self.config.d_max
        # Classes in turn, from a random one on where the half cannot be divided among them.
        turn = (np.arange(self.near) + rng.integers(len(self.by_class))) % len(self.by_class)
        near = np.array([self.by_class[c][rng.integers(len(self.by_class[c]))] for c in turn]).reshape(-1, 2)
        far = np.empty((0, 2), dtype=near.dtype)
        while len(far) < self.far:
            drawn = self.states[rng.integers(len(self.states), size=(self.far, 2))]
            far = np.concatenate([far, drawn[self.data.is_far(drawn[:, 0], drawn[:, 1], d_max)]])
        far = far[: self.far]
        variations = None
        if varied:
            # Neighbours are varied alike, as in the trainer: they must differ by what the robot did alone.
            same = self.pictures.variations(self.near, rng)
            first, second = self.pictures.variations(2 * self.far, rng).reshape(2, self.far, *same.shape[1:])
            variations = np.concatenate([same, first, same, second])
        states = np.concatenate([near[:, 0], far[:, 0], near[:, 1], far[:, 1]])
        gaps = near[:, 1] - near[:, 0]
        classes = np.concatenate([np.maximum(gaps, 1) - 1, np.full(self.far, d_max - 1)])
        learnt = np.flatnonzero((gaps > 0) & self.data.imitated[near[:, 0]])
        return Batch(
            pictures=self.pictures.of(states, variations),
            near=self.near,
            classes=torch.from_numpy(classes),
            learnt=torch.from_numpy(learnt),
            actions=torch.from_numpy(self.data.actions[near[learnt, 0]]),
        )


@dataclass
class Losses:
    """Losses of a step, without the weights of policy and far pairs, except in `total`."""

    total: float
    near: float
    far: float
    policy: float


def objective(network: LatentFlowNetwork, batch: Batch, config: Config) -> tuple[Tensor, Losses]:
    """`J_traversability + alpha * J_policy`, both as means over the mini-batch."""
    z, goal = network.encode(batch.pictures).chunk(2)
    pairs = len(z)
    entropies = F.cross_entropy(network.traversability(z, goal), batch.classes, reduction="none")
    near, far = entropies[: batch.near].sum(), entropies[batch.near :].sum()
    logits = network.policy(z[batch.learnt], goal[batch.learnt])
    policy = F.cross_entropy(logits, batch.actions, reduction="sum")
    total = (near + config.far_weight * far + config.policy_weight * policy) / pairs
    return total, Losses(
        total.item(),
        near.item() / max(batch.near, 1),
        far.item() / max(pairs - batch.near, 1),
        policy.item() / max(len(batch.learnt), 1),
    )


@dataclass
class Validation:
    """How the averaged weights do on held-out demonstrations."""

    traversability_loss: float
    traversability_accuracy: float
    wormhole_rate: float
    policy_loss: float
    policy_accuracy: float


class ValidationSet:
    """All near pairs of the held-out demonstrations and far pairs drawn uniformly: those of the trainer."""

    def __init__(self, data: Data, pictures: Pictures, held_out: list[int], seed: int) -> None:
        self.pictures, self.config = pictures, pictures.config
        self.states = data.states_of(held_out)
        # Rows of the held-out states.
        row_of = np.full(len(data.actions), -1)
        row_of[self.states] = np.arange(len(self.states))
        by_class = [row_of[pairs] for pairs in data.near_pairs(held_out, self.config.d_max)]
        present = sum(len(pairs) > 0 for pairs in by_class)
        far = self._far_pairs(data, seed)
        weights = [np.full(len(p), 0.5 / (present * max(len(p), 1))) for p in by_class]
        weights.append(np.full(len(far), 0.5 * self.config.far_weight / max(len(far), 1)))
        # As the trainer keeps them, so that the sums agree.
        self.weights = torch.from_numpy(np.concatenate(weights).astype(np.float32)).double()
        parts = [*by_class, far]
        self.pairs = torch.from_numpy(np.concatenate(parts))
        self.classes = torch.cat([torch.full((len(pairs),), c) for c, pairs in enumerate(parts)])
        self.near = len(self.pairs) - len(far)
        near = self.pairs[: self.near]
        learnt = (near[:, 0] != near[:, 1]) & torch.from_numpy(data.imitated[self.states])[near[:, 0]]
        self.policy = near[learnt]
        self.actions = torch.from_numpy(data.actions[self.states])[self.policy[:, 0]]
        if len(self.policy) == 0:
            raise SystemExit("no held-out demonstration has two steps")

    def _far_pairs(self, data: Data, seed: int) -> np.ndarray:
        rng, count = RustRandom(seed), len(self.states)
        pairs: list[tuple[int, int]] = []
        for _ in range(4 * VALIDATION_FAR_PAIRS):
            if len(pairs) == VALIDATION_FAR_PAIRS:
                break
            one, other = rng.below(count), rng.below(count)
            if data.is_far(self.states[one], self.states[other], self.config.d_max):
                pairs.append((one, other))
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    @torch.inference_mode()
    def evaluate(self, network: LatentFlowNetwork) -> Validation:
        """Tries a network that does not train."""
        network.eval()
        chunks = np.split(self.states, range(ENCODED_AT_ONCE, len(self.states), ENCODED_AT_ONCE))
        latents = torch.cat([network.encode(self.pictures.of(states)) for states in chunks])

        def score(head: torch.nn.Module, pairs: Tensor) -> Tensor:
            parts = [head(latents[p[:, 0]], latents[p[:, 1]]) for p in pairs.split(SCORED_AT_ONCE)]
            return torch.cat(parts).double()

        logits = score(network.traversability, self.pairs)
        entropies = F.cross_entropy(logits, self.classes, reduction="none")
        right = (logits.argmax(1) == self.classes).double()
        near, far = right[: self.near].mean().item(), right[self.near :].mean().item()
        logits = score(network.policy, self.policy)
        return Validation(
            traversability_loss=(entropies * self.weights).sum().item(),
            traversability_accuracy=(near + far) / 2,
            wormhole_rate=1 - far,
            policy_loss=F.cross_entropy(logits, self.actions).item(),
            policy_accuracy=(logits.argmax(1) == self.actions).double().mean().item(),
        )


def learning_rate(config: Config, step: int, progress: float) -> float:
    """A rise over the first steps, then half a cosine down to a share of the largest rate."""
    rise = min((step + 1) / max(config.warmup_steps, 1), 1.0)
    cosine = 0.5 * (1 + math.cos(math.pi * min(max(progress, 0.0), 1.0)))
    return config.learning_rate * rise * (config.final_share + (1 - config.final_share) * cosine)


class Trainer:
    """A network with its optimiser and the averages of its weights."""

    def __init__(self, network: LatentFlowNetwork, config: Config) -> None:
        self.network, self.config = network, config
        self.average = copy.deepcopy(network).requires_grad_(False)
        self.optimiser = torch.optim.AdamW(
            network.parameters(), lr=0.0, eps=1e-8, weight_decay=config.weight_decay, fused=True
        )
        self.steps = 0

    def step(self, batch: Batch, rate: float) -> Losses:
        self.network.train()
        self.optimiser.zero_grad()
        total, losses = objective(self.network, batch, self.config)
        if not math.isfinite(losses.total):
            raise SystemExit(f"the loss of step {self.steps + 1} is {losses.total}")
        total.backward()
        tiny = torch.finfo(torch.float32).tiny
        for weight in self.network.parameters():
            # Every tensor by itself.
            weight.grad.mul_((self.config.clip_norm / (weight.grad.norm() + tiny)).clamp(max=1.0))
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.optimiser.step()
        self.steps += 1
        # Early averages forget faster.
        keep = min(self.config.average_decay, (1 + self.steps) / (10 + self.steps))
        with torch.no_grad():
            for mean, weight in zip(self.average.parameters(), self.network.parameters()):
                mean.lerp_(weight, 1 - keep)
        return losses


class Table:
    """The CSV file, a row a step."""

    COLUMNS = ("step", "seconds", "validation_seconds", "states_per_second", "learning_rate")

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.file = path.open("w", newline="")
        self.writer = csv.writer(self.file)
        losses = [field.name for field in fields(Losses)]
        self.validated = [f"validation_{field.name}" for field in fields(Validation)]
        self.writer.writerow([*self.COLUMNS, *losses, *self.validated])

    def add(self, numbers: list[float], losses: Losses, found: Validation | None) -> None:
        tail = asdict(found).values() if found else [""] * len(self.validated)
        cells = [*numbers, *asdict(losses).values(), *tail]
        self.writer.writerow(f"{cell:.6g}" if isinstance(cell, float) else cell for cell in cells)
        if found:
            self.file.flush()


def network_for(data: Data, config: Config, seed: int) -> LatentFlowNetwork:
    torch.manual_seed(seed)
    actions = len(data.trajectories[0].primitives)
    network = LatentFlowNetwork(data.sizes, config.stack, config.d_max, actions, config.network)
    # On CPUs a fifth faster than channels first.
    return network.to(memory_format=torch.channels_last)


def load_data(demos: list[Path], config: Config) -> Data:
    started = time.perf_counter()
    data = Data(recordings.load(demos), config)
    print(
        f"{len(data.trajectories)} demonstrations, {len(data.actions)} states of {len(demos)} tasks, "
        f"read in {time.perf_counter() - started:.0f} s"
    )
    return data


def train(arguments: argparse.Namespace) -> None:
    config = PRESETS[arguments.preset]
    data = load_data(arguments.demos, config)
    if arguments.held_out:
        training, held_out = named_split(data, arguments.held_out)
        print(f"held out as {arguments.held_out} says: ", end="")
    else:
        training, held_out = split(data, config.validation_share, arguments.seed)
        print("held out by the trainer's own rule: ", end="")
    print(", ".join(data.trajectories[t].name for t in held_out))
    pictures = Pictures(data, training, config)
    validation = ValidationSet(data, pictures, held_out, arguments.seed)
    sampler = Sampler(data, pictures, training, arguments.pairs, arguments.seed)
    trainer = Trainer(network_for(data, config, arguments.seed), config)
    print(
        f"{len(sampler.states)} states to train on, {len(validation.states)} held out, "
        f"{trainer.network.count()} weights; {arguments.pairs} pairs, so {2 * arguments.pairs} states, a step; "
        f"{torch.get_num_threads()} threads, PyTorch {torch.__version__}",
        flush=True,
    )
    # The next batch is made while the network computes, as in the trainer.
    with ThreadPoolExecutor(1) as ahead:
        run_steps(arguments, trainer, validation, lambda: ahead.submit(sampler.draw))


def run_steps(
    arguments: argparse.Namespace,
    trainer: Trainer,
    validation: ValidationSet,
    order_batch: Callable[[], Future[Batch]],
) -> None:
    """Trains until steps, minutes or the target loss are reached; the clock stands still while it validates."""
    states, target = 2 * arguments.pairs, arguments.target_loss
    limit = arguments.minutes * 60 if arguments.minutes else math.inf
    table = Table(arguments.csv)
    seconds, validating, done = 0.0, 0.0, False
    started = time.perf_counter()
    upcoming = order_batch()
    while not done:
        batch = upcoming.result()
        upcoming = order_batch()
        progress = max(trainer.steps / arguments.steps, seconds / limit)
        rate = learning_rate(trainer.config, trainer.steps, progress)
        losses = trainer.step(batch, rate)
        now = time.perf_counter()
        seconds, started = seconds + now - started, now
        per_second = states * trainer.steps / seconds
        done = trainer.steps == arguments.steps or seconds >= limit
        found = None
        if done or trainer.steps % arguments.validate_every == 0:
            found = validation.evaluate(trainer.average)
            started = time.perf_counter()
            validating += started - now
            print(
                f"step {trainer.steps:>6}, {seconds:7.1f} s, {per_second:5.0f} states/s: loss {losses.total:.3f}; "
                f"held out: traversability loss {found.traversability_loss:.3f}, "
                f"{100 * found.traversability_accuracy:.1f} % right; policy loss {found.policy_loss:.3f}, "
                f"{100 * found.policy_accuracy:.1f} % right",
                flush=True,
            )
        table.add([trainer.steps, seconds, validating, per_second, rate], losses, found)
        if found and found.traversability_loss <= target:
            print(f"held-out traversability loss at or below {target} after {seconds:.1f} s")
            done = True
        elif done and target > 0:
            print(f"held-out traversability loss {target} was not reached")
    table.file.close()
    print(
        f"{trainer.steps} steps in {seconds:.0f} s ({per_second:.0f} states/s), "
        f"and {validating:.0f} s of validation beside it; losses in {arguments.csv}"
    )


def read_checkpoint(run: Path) -> tuple[dict, dict[str, Tensor]]:
    """The state of a run of `catena train`, and the averages of its weights by name."""
    raw = (run / "checkpoint.safetensors").read_bytes()
    (length,) = struct.unpack_from("<Q", raw)
    header = json.loads(raw[8 : 8 + length])
    weights = {}
    for name, entry in header.items():
        if name.startswith("average."):
            start, end = entry["data_offsets"]
            values = np.frombuffer(raw[8 + length + start : 8 + length + end], dtype="<f4")
            weights[name.split(".", 2)[2]] = torch.from_numpy(values.reshape(entry["shape"]).copy())
    return json.loads(header["__metadata__"]["catena"]), weights


def check_against(run: Path, demos: list[Path]) -> bool:
    """Puts the weights of a run into this network: they must give the validation losses that the run wrote down."""
    state, weights = read_checkpoint(run)
    config, seed = Config.of_json(state["config"]), state["config"]["seed"]
    data = load_data(demos, config)
    training, held_out = split(data, config.validation_share, seed)
    pictures = Pictures(data, training, config)
    for camera, (mean, deviation), theirs in zip(data.cameras, pictures.normalisation, state["normalisation"]):
        apart = max(np.abs(mean - theirs["mean"]).max(), np.abs(deviation - theirs["deviation"]).max())
        print(f"normalisation of camera '{camera}': {apart:.4f} of 255 apart at most")
    network = network_for(data, config, seed)
    expected = sum(values.numel() for values in weights.values())
    same = verdict(f"{network.count()} weights, {expected} in {run}", network.count() == expected)
    take_weights(network, weights)
    found = asdict(ValidationSet(data, pictures, held_out, seed).evaluate(network))
    with (run / "losses.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if int(row["step"]) == state["step"]]
    if not rows or not rows[0]["validation_policy_loss"]:
        raise SystemExit(f"{run} was not validated at its last checkpoint, step {state['step']}")
    for name, value in found.items():
        theirs = float(rows[0][f"validation_{name}"])
        # JPEG decoders differ by a level or two.
        same &= verdict(f"{name} {value:.5f}, catena {theirs:.5f}", abs(value - theirs) < 2e-3)
    return same


def verdict(text: str, holds: bool) -> bool:
    print(f"{'ok' if holds else 'WRONG'}: {text}")
    return holds


def noise(steps: int, seed: int) -> Trajectory:
    """A demonstration whose pictures are noise and whose actions are drawn by lot."""
    rng = np.random.default_rng(seed)
    frames = {name: rng.integers(0, 256, (steps, 3, 90, 160), dtype=np.uint8) for name in ("head", "wrist")}
    names = [f"primitive_{index}" for index in range(15)]
    return Trajectory(f"noise_{seed}", 0, frames, names, rng.integers(15, size=steps).tolist(), [])


def check(arguments: argparse.Namespace) -> bool:
    """The self-test; what it prints begins with `ok` or `WRONG`."""
    words = chacha8_words([0] * 8)
    first = [next(words) for _ in range(4)]
    # The first bytes of the key stream of ChaCha8 for a key and a stream of zeros.
    known = [0x2FEF003E, 0xD6405F89, 0xE8B85B7F, 0xA1A5091F]
    same = verdict("the generator draws what it should", first == known)
    for preset, config in PRESETS.items():
        data = Data([noise(20, seed) for seed in range(2)], config)
        count = network_for(data, config, 1).count()
        same &= verdict(f"{preset}: {count} weights, catena {KNOWN_WEIGHTS[preset]}", count == KNOWN_WEIGHTS[preset])
    same &= overfit(PRESETS[arguments.preset])
    if arguments.catena_run:
        same &= check_against(arguments.catena_run, arguments.demos)
    return same


def overfit(config: Config, steps: int = 60) -> bool:
    """One batch, with nothing left out, must be learnt by heart."""
    data = Data([noise(20, seed) for seed in range(2)], config)
    pictures = Pictures(data, [0, 1], config)
    batch = Sampler(data, pictures, [0, 1], 16, 1).draw(varied=False)
    network = network_for(data, config, 1)
    for module in network.modules():
        for name in ("dropout", "skip"):
            if hasattr(module, name):
                setattr(module, name, 0.0)
    trainer = Trainer(network, config)
    losses = [trainer.step(batch, config.learning_rate).total for _ in range(steps)]
    text = f"one batch of 16 pairs: loss {losses[0]:.3f} before, {losses[-1]:.3f} after {steps} steps"
    return verdict(text, losses[-1] < 0.1 * losses[0])


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("demos", nargs="*", type=Path, help="folders of recordings, one a task, in catena's order")
    parser.add_argument("--preset", choices=PRESETS, default="paper")
    parser.add_argument("--seed", type=int, default=1, help="also of the split, so the same as catena's")
    parser.add_argument("--steps", type=int, default=5_000)
    parser.add_argument("--minutes", type=float, help="stop after so many minutes of training, validation not counted")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--pairs", type=int, default=48, help="a step; 48 encode 96 states, as catena's steps do")
    parser.add_argument("--validate-every", type=int, default=250, metavar="STEPS")
    parser.add_argument("--target-loss", type=float, default=0.0, help="stop at this held-out traversability loss")
    parser.add_argument("--held-out", type=Path, metavar="JSON", help="a list of names of recordings to hold out")
    parser.add_argument("--csv", type=Path, default=Path("pairs.csv"))
    parser.add_argument("--check", action="store_true", help="test this script, without demonstrations")
    parser.add_argument("--catena-run", type=Path, help="with --check and DEMOS: compare with its losses")
    arguments = parser.parse_args()
    if not arguments.demos and (arguments.catena_run or not arguments.check):
        parser.error("name the folders of the demonstrations")
    if min(arguments.steps, arguments.validate_every, arguments.threads) < 1 or arguments.pairs < 2:
        parser.error("steps, threads and intervals must be 1 or more, pairs 2 or more")
    return arguments


def main() -> None:
    arguments = parsed()
    torch.set_num_threads(arguments.threads)
    if arguments.check:
        sys.exit(0 if check(arguments) else 1)
    train(arguments)


if __name__ == "__main__":
    main()
