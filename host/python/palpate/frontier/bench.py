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

import numpy as np

from palpate import hil
from palpate.experiment import ProgressBar
from palpate.frontier import references
from palpate.frontier.metrics import measure
from palpate.frontier.points import CONTACT_NODE, Point
from palpate.frontier.references import References, differences, digest
from palpate.reproduce.runner import Done, Finish, Job, run_all
from palpate.scene import Scene, load_scene

_KEPT_OF_MEASURED = ("record_hash", "metrics", "host", "compliance_percent", "convergence")
# The cost of a model on the host: rounds over all states of a path.
_ROUNDS = 5
RUNS, KEPT_REFERENCES, METRICS_FILE = "runs", "references", "metrics.json"


class OpenBar(Protocol):
    """Opens a progress bar for one phase of the work."""

    def __call__(self, label: str, unit: str) -> AbstractContextManager[ProgressBar]: ...


@dataclass(frozen=True)
class Measured:
    """A point with its numbers: those of METRICS; `host`, what a model costs the host, and `compliance_percent`, its largest
    error at the contact over 0 to 500 Hz, both None where none is built; `convergence`, of its reference."""

    point: Point
    record_hash: str
    metrics: Mapping[str, Any]
    host: Mapping[str, float] | None
    compliance_percent: float | None
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
    """Measures every point, in the order given, on `board` where its builder names no other. What an earlier call left in `out` is taken where the scene and the program
    are the same. Raises SceneError, hil.BoardError, or what the core raises; what was measured until then is kept."""
    boards = {point.name: point.builder.board or board for point in points}
    versions = {name: program_version(core, name) for name in {board, *boards.values()}}
    scenes = {
        point.name: load_scene(point.run.file, point.run.overrides).with_board(boards[point.name]) for point in points
    }
    keys = {name: digest([scene.to_dict(), versions[boards[name]]]) for name, scene in scenes.items()}
    planned = [
        Job("frontier", point.run, scenes[point.name], out / RUNS / point.name)
        for point in points
        if _kept(out, point, keys[point.name]) is None
    ]
    by_name = {point.name: point for point in points}
    kept_references = References(core, out / KEPT_REFERENCES, versions[board])

    def finish(done: Done, go_on: Callable[[], None]) -> None:
        name = done.job.run.name
        values = _measure(kept_references, scenes[name], done, go_on)
        _write(out, by_name[name], {"key": keys[name], **values})

    _run(core, planned, board, progress, finish)
    measured = []
    _measure_models(core, points, scenes, out, keys, progress)
    for point in points:
        kept = _kept(out, point, keys[point.name])
        assert kept is not None
        measured.append(Measured(point, **{name: kept[name] for name in _KEPT_OF_MEASURED}))
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


def _measure_models(
    core: Any,
    points: Sequence[Point],
    scenes: Mapping[str, Scene],
    out: Path,
    keys: Mapping[str, str],
    progress: OpenBar,
) -> None:
    """What models cost and how they answer at the contact: once for each builder on a body, when nothing else of this program
    runs."""
    builders: dict[str, list[tuple[Point, dict[str, Any]]]] = {}
    bodies: dict[str, dict[str, dict[str, Any]]] = {}  # scenes by builder, on each body
    for point in points:
        kept = _kept(out, point, keys[point.name])
        if kept is None or "host" in kept:
            continue
        given = scenes[point.name].to_dict()
        builder = digest([given["body"], given["model"]])
        builders.setdefault(builder, []).append((point, kept))
        bodies.setdefault(digest(given["body"]), {})[builder] = given
    if not builders:
        return
    with progress("models on the host", "builder") as bar:
        done = 0
        for of_builder in bodies.values():
            # A held force is no model.
            built = {name: given for name, given in of_builder.items() if given["model"]["feedback"] != "hold"}
            error_percent = _compliance(core, list(built.values()))
            compliance = dict(zip(built, error_percent, strict=True))
            for name in of_builder:
                cost = core.model_cost(built[name], _ROUNDS) if name in built else None
                for point, kept in builders[name]:
                    _write(out, point, {**kept, "host": cost, "compliance_percent": compliance.get(name)})
                done += 1
                bar(done, len(builders))


def _compliance(core: Any, scenes: Sequence[dict[str, Any]]) -> list[float]:
    """Largest relative error of each scene's model at the contact node, at rest, in percent. All have the same body."""
    if not scenes:
        return []
    nodes = scenes[0]["body"]["nodes"]
    i, j, k = CONTACT_NODE
    models = [given["model"] for given in scenes]
    node = i + nodes[0] * (j + nodes[1] * k)
    found = core.compliance_errors(scenes[0], node, models, 0.0, lambda done, total: True)
    return [100.0 * float(np.max(model["at_node"])) for model in found["models"]]


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
