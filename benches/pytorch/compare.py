"""The time that `catena train` and `train_pairs.py` take to the same held-out traversability loss.

    python compare.py --catena target/release/catena --preset paper --minutes 30 --out out/pairs DEMOS/sock DEMOS/trash
    python compare.py --out out/pairs

The first trains both, one after the other, and prints the table; the second prints the table of what is there. Runs
made otherwise are named by `--catena-run FOLDER` and `--pairs-csv FILE`."""

import argparse
import csv
import json
import os
import platform
import re
import struct
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

VALIDATED = re.compile(r"step +(\d+): held out")
STATES_PER_SECOND = re.compile(r"\((\d+) states/s\)")
# Losses that the table asks for, as multiples of the best that both have reached.
LEVELS = (1.5, 1.25, 1.1, 1.05, 1.0)


@dataclass
class Course:
    """The validations of a training."""

    # Seconds with validation, seconds without where they are known, loss.
    points: list[tuple[float, float | None, float]]
    states_per_second: float
    steps: int

    def first_at(self, loss: float) -> tuple[float, float | None, bool] | None:
        """When a validation first found this loss or less, and whether an earlier one had found more."""
        for index, (whole, alone, found) in enumerate(self.points):
            if found <= loss:
                return whole, alone, index > 0
        return None

    def best(self) -> float:
        return min(loss for _, _, loss in self.points)


def validated_rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row.get("validation_traversability_loss")]
    if not rows:
        raise SystemExit(f"{path} holds no validation")
    return rows


def catena_course(run: Path, seconds_file: Path, log: Path) -> Course:
    """A run of `catena train`. Its losses carry no times: those of `seconds_file` are taken, or else all steps are
    taken to have been equally fast."""
    with (run / "checkpoint.safetensors").open("rb") as file:
        (length,) = struct.unpack("<Q", file.read(8))
        state = json.loads(json.loads(file.read(length))["__metadata__"]["catena"])
    spent, steps = state["spent_secs"], state["step"]
    seconds = {}
    if seconds_file.exists():
        with seconds_file.open(newline="") as file:
            seconds = {int(row["step"]): float(row["seconds"]) for row in csv.DictReader(file)}
        # The clock of the log began before the training's own; they end together.
        late = seconds.get(steps, spent) - spent
        seconds = {step: second - late for step, second in seconds.items()}
    points = []
    for row in validated_rows(run / "losses.csv"):
        step = int(row["step"])
        if step <= steps:
            points.append((seconds.get(step, spent * step / steps), None, float(row["validation_traversability_loss"])))
    said = STATES_PER_SECOND.search(log.read_text()) if log.exists() else None
    rate = float(said[1]) if said else state["config"]["sampling"]["states"] * steps / spent
    return Course(points, rate, steps)


def pairs_course(path: Path) -> Course:
    points = []
    for row in validated_rows(path):
        alone = float(row["seconds"])
        whole = alone + float(row["validation_seconds"])
        points.append((whole, alone, float(row["validation_traversability_loss"])))
        rate, steps = float(row["states_per_second"]), int(row["step"])
    return Course(points, rate, steps)


def table(catena: Course, pairs: Course, losses: list[float]) -> str:
    common = max(catena.best(), pairs.best())
    lines = [
        "| held-out traversability loss | catena | pair by pair | ratio | pair by pair without validation |",
        "|---|---|---|---|---|",
    ]

    def said(seconds: float | None, is_sharp: bool) -> str:
        return "" if seconds is None else f"{'' if is_sharp else 'at most '}{seconds:.0f} s"

    for loss in losses or [common * level for level in LEVELS]:
        cells = [f"{loss:.3f}"]
        ours, theirs = catena.first_at(loss), pairs.first_at(loss)
        cells += [said(found[0], found[2]) if found else "not reached" for found in (ours, theirs)]
        # A first validation that is at the loss already says nothing of when it was reached.
        is_sharp = ours and theirs and ours[2] and theirs[2]
        cells.append(f"{theirs[0] / ours[0]:.1f}" if is_sharp else "")
        cells.append(said(theirs[1], theirs[2]) if theirs else "not reached")
        lines.append(f"| {' | '.join(cells)} |")
    lines += [
        "",
        "| | steps | validations | best loss | states a second |",
        "|---|---|---|---|---|",
    ]
    for name, course in (("catena", catena), ("pair by pair", pairs)):
        lines.append(
            f"| {name} | {course.steps} | {len(course.points)} | {course.best():.3f} | {course.states_per_second:.0f} |"
        )
    return "\n".join(lines)


def keep(path: Path, run: Path, catena: Course, pairs: Course) -> None:
    """Writes both courses, what catena's run says of itself, and the machine that this runs on."""
    made = json.loads((run / "run.json").read_text())
    processors = Path("/proc/cpuinfo")
    names = re.findall(r"model name\s*: (.+)", processors.read_text()) if processors.exists() else []
    kept = {
        "machine": {"processor": names[0] if names else platform.processor(), "count": os.cpu_count()},
        "run": {key: made.get(key) for key in ("version", "commit", "seed", "device")},
        "catena": asdict(catena),
        "pair_by_pair": asdict(pairs),
    }
    draft = path.with_name(path.name + ".partial")
    draft.write_text(json.dumps(kept, indent=1) + "\n")
    draft.replace(path)


def run_catena(arguments: argparse.Namespace) -> None:
    """Trains with catena and writes down when each validation was done."""
    # As many threads as the other side has.
    environment = {**os.environ, "RAYON_NUM_THREADS": str(arguments.threads)}
    command = [arguments.catena.resolve(), "train", *arguments.demos, "--preset", arguments.preset]
    command += ["--seed", str(arguments.seed), "--minutes", str(arguments.minutes)]
    command += ["--steps", str(arguments.steps)] if arguments.steps else []
    command += ["--run", arguments.out / "catena.run", "--out", arguments.out / "model"]
    # JSON is YAML.
    config = arguments.out / "catena.yaml"
    config.write_text(json.dumps({"validate_every_steps": arguments.validate_every}))
    command += ["--config", config]
    seconds, started = [], time.perf_counter()
    with (arguments.out / "catena.log").open("w") as log:
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        assert process.stdout
        for line in process.stdout:
            now = time.perf_counter() - started
            print(line, end="", flush=True)
            log.write(line)
            if found := VALIDATED.search(line):
                seconds.append((int(found[1]), f"{now:.2f}"))
    if process.wait():
        raise SystemExit(f"catena ended with {process.returncode}")
    with (arguments.out / "catena_seconds.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("step", "seconds"), *seconds])


def run_pairs(arguments: argparse.Namespace) -> None:
    command = [sys.executable, Path(__file__).with_name("train_pairs.py"), *arguments.demos]
    command += ["--preset", arguments.preset, "--seed", str(arguments.seed), "--threads", str(arguments.threads)]
    command += ["--minutes", str(arguments.pairs_minutes or arguments.minutes), "--pairs", str(arguments.pairs)]
    command += ["--validate-every", str(arguments.validate_every)]
    command += ["--steps", str(arguments.steps)] if arguments.steps else []
    command += ["--csv", arguments.out / "pairs.csv"]
    subprocess.run(command, check=True)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("demos", nargs="*", type=Path, help="folders of recordings, one a task")
    parser.add_argument("--catena", type=Path, help="the catena program; with it both are trained")
    parser.add_argument("--out", type=Path, default=Path("out/pairs"), help="where runs, losses and logs lie")
    parser.add_argument("--preset", choices=("paper",), default="paper")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int)
    parser.add_argument("--minutes", type=float, default=30.0, help="of each training")
    parser.add_argument("--pairs-minutes", type=float, help="of the training pair by pair, where it is to have more")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--validate-every", type=int, default=250, metavar="STEPS")
    parser.add_argument("--pairs", type=int, default=48)
    parser.add_argument("--at", type=float, nargs="+", default=[], metavar="LOSS", help="losses of the table")
    parser.add_argument("--catena-run", type=Path, help="run folder of catena train instead of OUT/catena.run")
    parser.add_argument("--catena-log", type=Path, help="what catena train printed instead of OUT/catena.log")
    parser.add_argument("--pairs-csv", type=Path, help="losses of train_pairs.py instead of OUT/pairs.csv")
    parser.add_argument("--json", type=Path, help="where both courses are kept, with the machine")
    arguments = parser.parse_args()
    if bool(arguments.catena) != bool(arguments.demos):
        parser.error("to train, name both the catena program and the folders of the demonstrations")
    return arguments


def main() -> None:
    arguments = parsed()
    out: Path = arguments.out
    if arguments.catena:
        out.mkdir(parents=True, exist_ok=True)
        run_catena(arguments)
        run_pairs(arguments)
    run = arguments.catena_run or out / "catena.run"
    # Times and log of one run say nothing of another.
    folder = run if arguments.catena_run else out
    catena = catena_course(run, folder / "catena_seconds.csv", arguments.catena_log or folder / "catena.log")
    pairs = pairs_course(arguments.pairs_csv or out / "pairs.csv")
    print(table(catena, pairs, arguments.at))
    if arguments.json:
        keep(arguments.json, run, catena, pairs)


if __name__ == "__main__":
    main()
