"""Demonstrations that `catena record` wrote, read as the trainer reads them."""

import bisect
import io
import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from PIL import Image

IMAGES = "/image_raw/compressed"


@dataclass
class Trajectory:
    """One demonstration."""

    name: str
    # Which of the given folders it is from.
    task: int
    # For each camera, sorted by name: uint8 `[steps, 3, rows, columns]`.
    frames: dict[str, np.ndarray]
    primitives: list[str]
    actions: list[int]
    # Steps at which subgoals were reached, in order of time.
    markers: list[int]

    def imitated(self, missed_grasp_steps: int, lead_steps: int) -> np.ndarray:
        """Which actions the policy learns: all but those of grasps that were missed and taken back."""
        learnt = np.ones(len(self.actions), dtype=bool)
        events = self._gripper_events()
        for place, (closed, closes) in enumerate(events):
            if not closes or place + 1 == len(events):
                continue
            # Events alternate, so the next one opens.
            opened = events[place + 1][0]
            reached = any(closed < step <= opened for step in self.markers)
            if reached or opened - closed > missed_grasp_steps:
                continue
            after_event = events[place - 1][0] + 1 if place else 0
            marked = max((step for step in self.markers if step <= closed), default=0)
            learnt[max(closed - lead_steps, after_event, marked, 0) : opened] = False
        return learnt

    def _gripper_events(self) -> list[tuple[int, bool]]:
        """Steps at which the gripper was told something new, and whether it was to close."""
        if not {"gripper_close", "gripper_open"} <= set(self.primitives):
            return []
        told = {self.primitives.index("gripper_close"): True, self.primitives.index("gripper_open"): False}
        events: list[tuple[int, bool]] = []
        for step, action in enumerate(self.actions):
            if action in told and (not events or events[-1][1] != told[action]):
                events.append((step, told[action]))
        return events


def load(folders: list[Path]) -> list[Trajectory]:
    """All demonstrations of all folders, in the trainer's order. Those that say that they failed are left out."""
    trajectories: list[Trajectory] = []
    for task, folder in enumerate(folders):
        files = [f for f in folder.rglob("*.mcap") if not any(p.startswith(".") for p in f.relative_to(folder).parts)]
        if not files:
            raise SystemExit(f"no recordings in {folder}")
        read = (_read(path, task) for path in sorted(files))
        trajectories += [trajectory for trajectory in read if trajectory is not None]
    shapes = {tuple((n, f.shape[1:]) for n, f in t.frames.items()) + (tuple(t.primitives),) for t in trajectories}
    if len(shapes) != 1:
        raise SystemExit("the recordings differ in their cameras, sizes of images or primitives")
    return trajectories


def _read(path: Path, task: int) -> Trajectory | None:
    images: dict[str, list[tuple[int, bytes]]] = {}
    actions: list[tuple[int, dict]] = []
    markers: list[int] = []
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        if metadata.get("catena_episode", {}).get("success") == "false":
            return None
        for _, channel, message in reader.iter_messages():
            if channel.topic.endswith(IMAGES):
                name = channel.topic.removesuffix(IMAGES).rsplit("/", 1)[1]
                images.setdefault(name, []).append((message.log_time, message.data))
            elif channel.topic == "/action":
                actions.append((message.log_time, json.loads(message.data)))
            elif channel.topic == "/subgoal":
                markers.append(message.log_time)
    space = json.loads(metadata.get("catena", {}).get("action_space", "{}"))
    if space.get("kind") != "primitives" or not images:
        raise SystemExit(f"{path} has no motion primitives or no images: only recordings of `catena record` are read")
    first_seen = max(times[0][0] for times in images.values())
    actions = [(time, action) for time, action in actions if time >= first_seen]
    times = [time for time, _ in actions]
    return Trajectory(
        name=path.stem,
        task=task,
        frames={name: _film(images[name], times) for name in sorted(images)},
        primitives=space["names"],
        actions=[action["index"] for _, action in actions],
        markers=sorted(step for step in (bisect.bisect_left(times, m) for m in markers) if step < len(times)),
    )


def _film(images: list[tuple[int, bytes]], times: list[int]) -> np.ndarray:
    """The latest image at or before each time."""
    stamps = [stamp for stamp, _ in images]
    chosen = (images[bisect.bisect_right(stamps, time) - 1][1] for time in times)
    return np.stack([_decode(message).transpose(2, 0, 1) for message in chosen])


def _decode(message: bytes) -> np.ndarray:
    """A `sensor_msgs/CompressedImage` as ROS 2 packs it: stamp, frame, format, data, all aligned to 4 bytes."""
    order = "<" if message[1] == 1 else ">"
    body, place = message[4:], 8
    for _ in range(2):
        (length,) = struct.unpack_from(order + "I", body, place)
        place += 4 + (length + 3) // 4 * 4
    (length,) = struct.unpack_from(order + "I", body, place)
    return np.asarray(Image.open(io.BytesIO(body[place + 4 : place + 4 + length])).convert("RGB"))
