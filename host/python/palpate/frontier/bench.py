"""Runs the points of the frontier, several at a time, measures them, and keeps what has been measured."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Protocol

from palpate import hil
from palpate.experiment import ProgressBar
from palpate.frontier import references
from palpate.frontier.metrics import measure
from palpate.frontier.points import Point
from palpate.frontier.references import References, differences, digest
from palpate.reproduce.runner import Done, Finish, Job, run_all
from palpate.scene import Scene, load_scene

# The cost of a model on the host: rounds over all states of a path.
_ROUNDS = 5
RUNS, KEPT_REFERENCES, METRICS_FILE = "runs", "references", "metrics.json"


class OpenBar(Protocol):
    """Opens a progress bar for one phase of the work."""

    def __call__(self, label: str, unit: str) -> AbstractContextManager[ProgressBar]: ...


@dataclass(frozen=True)
class Measured:
    """A point with its numbers: those of METRICS; `host`, what a model costs the host; `convergence`, of its reference."""

    point: Point
    record_hash: str
    metrics: Mapping[str, Any]
    host: Mapping[str, float] | None
    convergence: Sequence[Mapping[str, float | None]]


def program_version(core: Any, board: str) -> str:
    """Digest of the core and of the board's firmware: equal ones give equal records."""
    sha = hashlib.sha256()
    for file in (Path(core.__file__), hil.BOARDS[board].image):
        if not file.exists():
            raise hil.BoardError(f"board {board}: {file} does not exist: ./run builds it")
        sha.update(file.read_bytes())
    return sha.hexdigest()


def run_points(core: Any, points: Sequence[Point], out: Path, board: str, progress: OpenBar) -> list[Measured]:
    """Measures every point, in the order given. What an earlier call left in `out` is taken where the scene and the program
    are the same. Raises SceneError, hil.BoardError, or what the core raises; what was measured until then is kept."""
    version = program_version(core, board)
    scenes = {point.name: load_scene(point.run.file, point.run.overrides).with_board(board) for point in points}
    keys = {name: digest([scene.to_dict(), version]) for name, scene in scenes.items()}
    planned = [
        Job("frontier", point.run, scenes[point.name], out / RUNS / point.name)
        for point in points
        if _kept(out, point, keys[point.name]) is None
    ]
    by_name = {point.name: point for point in points}
    kept_references = References(core, out / KEPT_REFERENCES, version)

    def finish(done: Done, go_on: Callable[[], None]) -> None:
        name = done.job.run.name
        values = _measure(kept_references, scenes[name], done, go_on)
        _write(out, by_name[name], {"key": keys[name], **values})

    _run(core, planned, board, progress, finish)
    _measure_host(core, points, scenes, out, keys, progress)
    measured = []
    for point in points:
        kept = _kept(out, point, keys[point.name])
        assert kept is not None
        measured.append(Measured(point, kept["record_hash"], kept["metrics"], kept.get("host"), kept["convergence"]))
    return measured


def _run(
    core: Any,
    planned: list[Job],
    board: str,
    progress: OpenBar,
    finish: Finish,
) -> None:
    if not planned:
        return
    counted, lock = 0, Lock()
    total = sum(job.ticks for job in planned)
    with progress(f"{len(planned)} points on {board}", "tick") as bar:

        def count(ticks: int) -> None:
            nonlocal counted
            with lock:
                counted += ticks
                bar(counted, total)

        planned.sort(key=lambda job: -job.ticks)
        run_all(core, planned, max(1, len(os.sched_getaffinity(0))), count, finish)


def _measure(kept: References, scene: Scene, done: Done, go_on: Callable[[], None]) -> dict[str, Any]:
    tick, tip_m = done.record["ticks/tick"], done.record["ticks/tip_m"]
    along = {step: kept.along(scene, tick, tip_m, step, go_on) for step in references.steps_s(scene)}
    per_count = hil.BOARDS[scene.sections.board.name].instructions_per_count
    return {
        "record_hash": done.summary["record_hash"],
        "metrics": measure(done.record, along[min(along)], per_count),
        "convergence": differences(along),
    }


def _measure_host(
    core: Any,
    points: Sequence[Point],
    scenes: Mapping[str, Scene],
    out: Path,
    keys: Mapping[str, str],
    progress: OpenBar,
) -> None:
    """What models cost, one point after the other, when nothing else of this program runs."""
    todo = [
        (point, kept)
        for point in points
        if (kept := _kept(out, point, keys[point.name])) is not None and "host" not in kept
    ]
    if not todo:
        return
    costs: dict[str, Any] = {}  # points that differ in nothing but the path, rates and delays share it
    with progress("time of models on the host", "point") as bar:
        for i, (point, kept) in enumerate(todo):
            scene = scenes[point.name]
            given = scene.to_dict()
            key = digest([given[name] for name in ("body", "model")])
            if scene.sections.model.feedback == "hold":  # builds none
                costs[key] = None
            elif key not in costs:
                costs[key] = core.model_cost(given, _ROUNDS)
            _write(out, point, {**kept, "host": costs[key]})
            bar(i + 1, len(todo))


def _file(out: Path, point: Point) -> Path:
    return out / RUNS / point.name / METRICS_FILE


def _kept(out: Path, point: Point, key: str) -> dict[str, Any] | None:
    """What stands there of this point, if it is of this scene and program."""
    try:
        kept = json.loads(_file(out, point).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return kept if isinstance(kept, dict) and kept.get("key") == key else None


def _write(out: Path, point: Point, values: Mapping[str, Any]) -> None:
    """Whole, or not at all."""
    file = _file(out, point)
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".part")
    partial.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    partial.rename(file)
