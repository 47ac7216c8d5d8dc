"""Runs the firmware again on what an earlier run recorded, with another model, rate, friction or board, and compares.

The board reads the recorded encoder counts, tick by tick, whatever its motors do; so does everything behind it. What else
it reads, motor currents and the link's bytes, is simulated afresh. With nothing changed all of it comes out to the bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate import experiment, hil, record, summary
from palpate.experiment import LoopRun, Outcome, Progress
from palpate.record import BadRecord, Record
from palpate.scene import Scene, load_recorded_scene
from palpate.scene_overrides import Overrides, exact_override
from palpate.scene_schema import SceneError
from palpate.scene_sections import SceneFile
from palpate.tip_path import TipPath

Array = NDArray[Any]

_TICK_S = 1e-3
# Overlong ticks leave out some; a minute without any is no motion to go on with.
_LONGEST_GAP_TICKS = 60_000
_TITLE_WIDTH = 100
# What moves the tip, and how long: the record says it.
_OF_THE_RECORD = ("duration_s", "hand", "path")
# Sections that decide what force a body gives to a tip path.
_BODY_SECTIONS = ("body", "contact", "coupling", "tool", "reference")


@dataclass(frozen=True)
class Source:
    """A record, the scene that it was made with, and that scene with what the replay changes."""

    record: Record
    recorded_scene: Scene
    scene: Scene
    changes: tuple[str, ...]

    @property
    def recorded_board(self) -> str:
        return str(self.record.attributes.get("board", self.recorded_scene.sections.board.name))


@dataclass(frozen=True)
class Motion:
    """What the board read in each tick of the replay, from 0 on. encoder_count: (n, 3) int32; tip_m: (n, 3), device
    frame; first_tick: the record's tick that is tick 0; known: (n,), False where the record skips a tick and the
    motion is interpolated."""

    encoder_count: NDArray[np.int32]
    tip_m: NDArray[np.float64]
    first_tick: int
    known: NDArray[np.bool_]


def load_source(file: Path, overrides: Overrides, board: str | None) -> Source:
    """Reads a record for a replay. Raises BadRecord, and SceneError for overrides that are not allowed."""
    loaded = record.load(file)
    if loaded.kind != "run":
        raise BadRecord(f"{file}: a record of `simulate`, without encoder counts: must be one with a board in the loop")
    ticks = loaded.values["ticks/tick"]
    if len(ticks) < 2:
        raise BadRecord(f"{file}: /ticks has {len(ticks)} rows: must be at least 2")
    if not np.all(np.diff(ticks.astype(np.int64)) > 0):
        raise BadRecord(f"{file}: /ticks/tick does not increase: damaged")
    gap = int(np.max(np.diff(ticks.astype(np.int64))))
    if gap > _LONGEST_GAP_TICKS:
        raise BadRecord(f"{file}: /ticks/tick leaps by {gap}: must be at most {_LONGEST_GAP_TICKS}")
    for path in ("ticks/true_tip_m", "ticks/force_N", "ticks/tip_m"):
        if not np.all(np.isfinite(loaded.values[path])):
            raise BadRecord(f"{file}: /{path} has numbers that are not finite")
    for name in overrides:
        if name.split(".")[0] in _OF_THE_RECORD:
            raise SceneError(f"--set {exact_override(name, overrides[name])}: not in a replay, which has the tip path of its record")
    time_s = (ticks - ticks[0]) * _TICK_S
    tip_path = TipPath(time_s, loaded.values["ticks/true_tip_m"], "linear")
    recorded_scene = load_recorded_scene(file, loaded.scene_text, {}, tip_path)
    recorded_board = str(loaded.attributes.get("board", recorded_scene.sections.board.name))
    if recorded_board in hil.BOARDS:
        recorded_scene = recorded_scene.with_board(recorded_board)
    scene = load_recorded_scene(file, loaded.scene_text, overrides, tip_path)
    if board is None and "board.name" not in overrides and recorded_board in hil.BOARDS:
        board = recorded_board
    if board is not None:
        scene = scene.with_board(board)
    changes: list[str] = []
    if _without_board(scene) != _without_board(recorded_scene):
        changes += [exact_override(*item) for item in overrides.items() if item[0] != "board.name"]
    if scene.sections.board.name != recorded_board:
        changes.append(exact_override("board.name", scene.sections.board.name))
    return Source(loaded, recorded_scene, scene, tuple(changes))


def _without_board(scene: Scene) -> SceneFile:
    return replace(scene.sections, board=replace(scene.sections.board, name=""))


def motion_of(values: Mapping[str, Array]) -> Motion:
    """The recorded motion, tick by tick. Between rows that are not neighbours it goes straight. Counters wrap around."""
    ticks = values["ticks/tick"].astype(np.int64)
    wanted = np.arange(ticks[0], ticks[-1] + 1)
    wrapped = values["ticks/encoder_count"].astype(np.int64)
    steps = (np.diff(wrapped, axis=0) + 2**31) % 2**32 - 2**31
    counts = np.concatenate([wrapped[:1], wrapped[:1] + np.cumsum(steps, axis=0)])
    dense = np.stack([np.rint(np.interp(wanted, ticks, column)) for column in counts.T], axis=1).astype(np.int64)
    tip_m = np.stack([np.interp(wanted, ticks, column) for column in values["ticks/true_tip_m"].T], axis=1)
    return Motion(
        np.ascontiguousarray((dense + 2**31) % 2**32 - 2**31, dtype=np.int32),
        np.ascontiguousarray(tip_m),
        int(ticks[0]),
        np.isin(wanted, ticks),
    )


def check_folder(source: Source, folder: Path) -> None:
    """Raises SceneError where the results would take the place of the record."""
    if (folder / "record.h5").resolve() == source.record.file.resolve():
        raise SceneError(f"--out = {folder}: has the record that is replayed: must be another folder")


def replay(core: Any, source: Source, folder: Path, progress: Progress) -> Outcome:
    """Runs the replay and writes what `run` writes, with `replay.png`.

    Raises SceneError, hil.BoardError, or what the core raises.
    """
    scene, motion = source.scene, motion_of(source.record.values)
    given = {
        **scene.to_dict(),
        "duration_ticks": len(motion.tip_m),
        "recorded": {"encoder_count": motion.encoder_count, "tip_m": motion.tip_m},
    }
    done = experiment.run_firmware(core, scene, given, motion.tip_m[0], progress)
    numbers = {**experiment.summarize(scene, "replay", done), **_compare(source, motion, done)}
    files = experiment.write_run(
        folder, scene, numbers, done, {"replay_of": numbers["source_record_hash"] or source.record.file.name}
    )
    if scene.sections.outputs.pictures:
        _draw(files.add("replay.png"), source, motion, done)
    return Outcome(numbers, files.finish(numbers), tuple(_warnings(source, motion, numbers, done)))


def _warnings(source: Source, motion: Motion, numbers: Mapping[str, Any], done: LoopRun) -> list[str]:
    found = [done.basis_problem] if done.basis_problem else []
    if not source.record.closed:
        found.append(f"{source.record.file}: was not closed: {len(source.record.values['ticks/tick'])} ticks are whole")
    if motion.first_tick != 0:
        found.append(
            f"{source.record.file}: begins at tick {motion.first_tick}: the replay begins there with the body at rest and a "
            "board that has just been switched on"
        )
    if numbers["interpolated_inputs"]:
        found.append(f"{source.record.file}: {numbers['interpolated_inputs']} ticks are missing: interpolated")
    return found


def _common_rows(source: Source, motion: Motion, done: LoopRun) -> tuple[Array, Array]:
    """Rows of the record and of the replay that belong to the same tick."""
    recorded = source.record.values["ticks/tick"].astype(np.int64) - motion.first_tick
    _, rows, rows_again = np.intersect1d(
        recorded, done.values["ticks/tick"].astype(np.int64), assume_unique=True, return_indices=True
    )
    return rows, rows_again


def _compare(source: Source, motion: Motion, done: LoopRun) -> dict[str, Any]:
    rows, rows_again = _common_rows(source, motion, done)
    old = {path: array[rows] for path, array in source.record.values.items() if path.startswith(("ticks/", "reference/"))}
    new = {path: array[rows_again] for path, array in done.values.items() if path.startswith(("ticks/", "reference/"))}
    visited = done.values["ticks/tick"]
    comparison = summary.compare_runs(old, new)
    if not len(rows) == len(source.record.values["ticks/tick"]) == len(visited):
        comparison["identical"] = False
    return {
        "source": str(source.record.file),
        "source_record_hash": source.record.attributes.get("record_hash"),
        "source_board": source.recorded_board,
        "changes": list(source.changes),
        "interpolated_inputs": int(np.count_nonzero(~motion.known[visited[visited < len(motion.known)]])),
        **comparison,
        "source_rms_force_error_percent": _source_error_percent(source, old, new),
    }


def _source_error_percent(source: Source, old: Mapping[str, Array], new: Mapping[str, Array]) -> float | None:
    """Of the recorded force against the full body that it was meant for: the record's own reference, or else the
    replay's, where nothing that it depends on has changed."""
    if "reference/force_N" in old:
        return summary.relative_rms_percent(old["ticks/force_N"], old["reference/force_N"])
    before, after = source.recorded_scene.to_dict(), source.scene.to_dict()
    before["reference"]["enabled"] = after["reference"]["enabled"]
    if "reference/force_N" in new and all(before[name] == after[name] for name in _BODY_SECTIONS):
        return summary.relative_rms_percent(old["ticks/force_N"], new["reference/force_N"])
    return None


def _draw(file: Path, source: Source, motion: Motion, done: LoopRun) -> None:
    from palpate import figures  # Matplotlib takes its time: only where something is drawn

    rows, rows_again = _common_rows(source, motion, done)
    old, new = source.record.values, done.values
    if not len(rows):
        return

    def trace(values: Mapping[str, Array], where: Array) -> figures.ForceTrace:
        normal = values["ticks/normal"][where].astype(np.float64)
        return figures.ForceTrace(values["ticks/force_N"][where], values["ticks/contact_mode"][where], normal)

    title = f"{source.scene.sections.title or source.record.file.stem}: replay"
    changes = f" with {', '.join(source.changes)}" if source.changes else ", nothing changed"
    figures.save_forces(
        file,
        title=fill(title + changes, _TITLE_WIDTH),
        time_s=new["ticks/tick"][rows_again] * _TICK_S,
        rendered=trace(new, rows_again),
        friction=experiment.touched_friction(
            new, new["ticks/contact_mode"][rows_again], new["ticks/triangle"][rows_again]
        ),
        reference=trace(old, rows),
        model_age_ticks=experiment.model_age_ticks(new)[rows_again],
        rendered_name="replay",
        reference_name="record",
        error_name="difference",
    )
