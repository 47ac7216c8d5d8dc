"""Runs a scene from beginning to end: closed loop or simulation, reference, record, summary and pictures."""

import json
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from palpate import __version__, hil, injected, record, record_layout, summary
from palpate.record_layout import Dataset
from palpate.scene import Scene, SceneError
from palpate.scene_sections import SceneFile

if TYPE_CHECKING:
    from palpate import figures

OUTPUTS = (
    "summary.json", "record.h5", "tip.csv", "nodes.csv", "forces.png", "body.png", "replay.png", "console.txt"
)
_TICK_S = 1e-3


class ProgressBar(Protocol):
    """Called with (done, total); True goes on."""

    def __call__(self, done: int, total: int) -> bool: ...


class Progress(Protocol):
    """Opens a progress bar for one phase of the work."""

    def __call__(self, label: str, unit: str) -> AbstractContextManager[ProgressBar]: ...


def take_folder(out: Path, own: Collection[str], command: str) -> None:
    """Makes the folder `out`, before anything is computed for it. Raises SceneError where that cannot be, or where it holds other
    files than `own`."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        entries = sorted(out.iterdir())
    except OSError as error:
        raise SceneError(f"--out = {out}: {error.strerror}: must be a folder that can be made or written") from None
    for entry in entries:
        if entry.name not in own:
            raise SceneError(f"--out = {out}: holds {entry.name}, which {command} does not write; choose another")


def no_progress(label: str, unit: str) -> AbstractContextManager[ProgressBar]:
    """A Progress that shows nothing: for one run of many, which have a bar of their own."""
    return nullcontext(lambda done, total: True)


@dataclass(frozen=True)
class Outcome:
    """Numbers of an experiment, the files that were written, by name, and its datasets by path (`record_layout`)."""

    summary: dict[str, Any]
    files: dict[str, Path]
    warnings: tuple[str, ...] = ()
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class LoopRun:
    """What came out of a run of the firmware: datasets of RUN with the reference, and RUN_COUNTERS."""

    values: dict[str, NDArray[Any]]
    counters: dict[str, int | float]
    console: str
    basis_problem: str
    wall_clock_s: dict[str, float]
    link: dict[str, Any]  # counters of the medium {down, up}, bytes_per_tick, heard_ticks (ticks,): when the host had each tick

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(ticks,): of each row of /ticks."""
        time_s: NDArray[np.float64] = self.values["ticks/tick"] * _TICK_S
        return time_s


def run_firmware(core: Any, scene: Scene, given: dict[str, Any], start_m: NDArray[Any], progress: Progress) -> LoopRun:
    """The closed loop on the scene's board, then the reference if the scene wants one.

    given: `Scene.to_dict`, with what else the core is to be told. start_m: (3,), where the tip is at first.
    """
    board = hil.BOARDS[scene.sections.board.name].of(scene.sections)
    if scene.sections.reference.enabled:
        # One tick of it now: a step that is not stable is refused before the run, not after it.
        with _naming(scene, "reference"):
            core.reference(given, np.array([0.0, _TICK_S]), np.array([start_m, start_m]), lambda done, total: True)
    started_s = time.monotonic()
    with progress(f"closed loop on {board.name}", "tick") as bar, _naming(scene, "integrator"):
        results, console = hil.run_closed_loop(core, given, board, bar)
    wall_clock_s = {"run_s": round(time.monotonic() - started_s, 3)}
    counters = {name: results.pop(name) for name in record_layout.RUN_COUNTERS}
    basis_problem, link = results.pop("basis_problem"), results.pop("link")
    if scene.sections.reference.enabled:
        started_s = time.monotonic()
        with progress("reference", "tick") as bar, _naming(scene, "reference"):
            results.update(follow(core, given, results, bar))
        wall_clock_s["reference_s"] = round(time.monotonic() - started_s, 3)
    values = record.conform(record_layout.RUN, results)
    return LoopRun(values, counters, console, basis_problem, wall_clock_s, link)


def follow(core: Any, given: dict[str, Any], values: Mapping[str, Any], bar: Callable[[int, int], bool]) -> dict[str, NDArray[Any]]:
    """The full body along the tip's way in a run: datasets of /reference. given: `Scene.to_dict`."""
    time_s = np.asarray(values["ticks/tick"], dtype=np.float64) * _TICK_S
    tip_m = np.asarray(values["ticks/tip_m"], dtype=np.float64)
    datasets: dict[str, NDArray[Any]] = core.reference(given, time_s, tip_m, bar)
    return datasets


def summarize(scene: Scene, command: str, done: LoopRun) -> dict[str, Any]:
    """RUN_KEYS of a run."""
    board = hil.BOARDS[scene.sections.board.name].of(scene.sections)
    return summary.summarize_run(
        done.values,
        done.counters,
        command=command,
        title=scene.sections.title,
        board=board.name,
        instructions_per_count=board.instructions_per_count,
        wall_clock_s=done.wall_clock_s,
        record_hash=record.record_hash(record_layout.RUN, done.values),
        choice=scene.choice.to_dict() if scene.choice else None,
        medium=scene.sections.link.medium,
        busy_ticks={way: done.link[way]["busy_ticks"] for way in ("up", "down")},
        link_faults=injected.counts(scene.sections, done.link, done.counters),
        fault_spans=injected.fault_spans(scene.sections),
    )


def write_run(
    folder: Path, scene: Scene, numbers: Mapping[str, Any], done: LoopRun, attributes: Mapping[str, str | int | float]
) -> "Output":
    """Record, CSV and pictures of a run, as the scene wants them. attributes: more of them, for the record."""
    files = begin_output(folder)
    values = done.values
    all_attributes: dict[str, str | int | float] = {**done.counters}
    all_attributes.update(attributes)
    _write_record(files, record_layout.RUN, values, scene, numbers, all_attributes)
    if done.console.strip():
        files.write_text("console.txt", done.console)
    if scene.sections.outputs.csv:
        record.write_tip_csv(
            files.add("tip.csv"),
            done.time_s,
            values["ticks/tip_m"],
            values["ticks/force_N"],
            values["ticks/contact_mode"],
        )
    if scene.sections.outputs.pictures:
        hit_s = {way: np.asarray(done.link.get(f"hit_ticks_{way}", ())) * _TICK_S for way in injected.WAYS}
        _draw_run(files, scene, values, done.time_s, hit_s)
    return files


def run(core: Any, scene: Scene, command: str, folder: Path | None, progress: Progress) -> Outcome:
    """`palpate run` and `palpate demo`: the firmware on its board, in the loop with plant, hand and host. No folder: no
    files.

    Raises SceneError, hil.BoardError, or what the core raises.
    """
    path = scene.require_path()
    done = run_firmware(core, scene, scene.to_dict(), path.position_m[0], progress)
    numbers = summarize(scene, command, done)
    files = {} if folder is None else write_run(folder, scene, numbers, done, {}).finish(numbers)
    return Outcome(numbers, files, (done.basis_problem,) if done.basis_problem else (), done.values)


def simulate(core: Any, scene: Scene, folder: Path | None, progress: Progress) -> Outcome:
    """`palpate simulate`: the full body alone, with the tip on its path if there is one. No folder: no files.

    Raises SceneError, or what the core raises.
    """
    started_s = time.monotonic()
    with progress("simulation", "tick") as bar, _naming(scene, "integrator"):
        results = core.simulate(scene.to_dict(), bar)
    wall_clock_s = {"simulate_s": round(time.monotonic() - started_s, 3)}
    values = record.conform(record_layout.SIMULATE, results)
    numbers = summary.summarize_simulation(
        values,
        title=scene.sections.title,
        ticks=scene.duration_ticks,
        wall_clock_s=wall_clock_s,
        record_hash=record.record_hash(record_layout.SIMULATE, values),
    )
    if folder is None:
        return Outcome(numbers, {}, (), values)
    files = begin_output(folder)
    _write_record(files, record_layout.SIMULATE, values, scene, numbers, {})
    outputs = scene.sections.outputs
    touched = "tip/force_N" in values
    if outputs.csv and touched:
        record.write_tip_csv(
            files.add("tip.csv"),
            values["tip/time_s"],
            values["tip/position_m"],
            values["tip/force_N"],
            values["tip/contact_mode"],
        )
    if outputs.csv and len(values["nodes/time_s"]):
        record.write_nodes_csv(
            files.add("nodes.csv"),
            values["nodes/time_s"],
            values["nodes/position_m"],
            values["nodes/velocity_m_s"],
        )
    if outputs.pictures:
        _draw_simulation(files, scene, values)
    return Outcome(numbers, files.finish(numbers), (), values)


class _naming:
    """Puts the scene's file in front of the core's complaint about the scene; the core does not know which section
    it has its step from."""

    def __init__(self, scene: Scene, step_section: str) -> None:
        self._file = scene.file
        self._step_section = step_section

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, ValueError) and not isinstance(error, SceneError):
            message = " ".join(str(error).split())
            section = f"{self._step_section}." if message.startswith("step_s ") else ""
            raise SceneError(f"{self._file}: {section}{message}") from None


class Output:
    """The files of one experiment."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: dict[str, Path] = {}

    def add(self, name: str) -> Path:
        self._files[name] = self._folder / name
        return self._files[name]

    def write_text(self, name: str, text: str) -> None:
        self.add(name).write_text(text, encoding="utf-8")

    def finish(self, numbers: Mapping[str, Any]) -> dict[str, Path]:
        """Writes summary.json last: where it stands, the others are complete."""
        self.write_text("summary.json", json.dumps(numbers, indent=2, allow_nan=False) + "\n")
        return self._files


def begin_output(folder: Path) -> Output:
    """An empty place for the files: those of an earlier experiment go."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in OUTPUTS:
        (folder / name).unlink(missing_ok=True)
    return Output(folder)


def _write_record(
    files: Output,
    layout: tuple[Dataset, ...],
    values: Mapping[str, Any],
    scene: Scene,
    numbers: Mapping[str, Any],
    more: Mapping[str, str | int | float],
) -> None:
    file = files.add("record.h5")
    if (mesh := scene.keep_mesh(file.parent)) is not None:
        files.add(mesh.name)
    attributes: dict[str, str | int | float] = {
        "palpate_version": __version__,
        "record_hash": numbers["record_hash"],
        "command": numbers["command"],
        **more,
    }
    if "board" in numbers:
        attributes["board"] = numbers["board"]
    record.write_record(file, layout, values, scene.text, attributes)


def _title(scene: Scene, what: str) -> str:
    return f"{scene.sections.title or scene.file.stem}: {what}"


def touched_friction(
    values: Mapping[str, NDArray[Any]], mode: NDArray[Any], triangle: NDArray[Any]
) -> NDArray[np.float64]:
    """Static and kinetic coefficients (n, 2) of the triangles that are touched; 0 when free."""
    touching = mode != 0
    friction = np.zeros((len(mode), 2))
    friction[touching] = values["body/triangle_friction"][triangle[touching]]
    return friction


def model_age_ticks(values: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """(ticks,): NaN where no model was rendered."""
    age = values["ticks/model_age_ticks"].astype(np.float64)
    age[values["ticks/model_sequence"] == 0] = np.nan
    return age


def rendered_normal(values: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Normals (n, 3) for splitting the rendered forces. A held force comes without one: in its ticks that of the
    reference, or else of the triangle at rest; zero where there is no body either."""
    normal = values["ticks/normal"].astype(np.float64)
    touching = values["ticks/contact_mode"] != 0
    if "reference/normal" in values:
        unknown = touching & ~np.any(normal, axis=1) & np.all(np.isfinite(values["reference/normal"]), axis=1)
        normal[unknown] = values["reference/normal"][unknown]
    unknown = touching & ~np.any(normal, axis=1)
    if "body/rest_m" not in values:
        return normal
    a, b, c = np.moveaxis(values["body/rest_m"][values["body/triangles"][values["ticks/triangle"][unknown]]], 1, 0)
    at_rest = np.cross(b - a, c - a)
    normal[unknown] = at_rest / np.linalg.norm(at_rest, axis=1, keepdims=True)
    return normal


def fault_marks(
    scene: SceneFile, values: Mapping[str, NDArray[Any]], hit_s: Mapping[str, NDArray[Any]]
) -> "figures.Marks":
    """What forces.png marks of a run: faults in time, ticks in which a frame was hit, outputs off."""
    from palpate import figures

    rows: dict[str, list[tuple[float, float]]] = {}
    for span in injected.fault_spans(scene):
        rows.setdefault(span.what, []).append((span.from_s, span.to_s))
    for way in injected.WAYS:
        if len(hit_s.get(way, ())):
            rows[f"frames hit, {way}"] = [(float(t), float(t) + _TICK_S) for t in hit_s[way]]
    causes = tuple(rows)
    off = [(span.from_s, span.to_s) for span in injected.off_spans(values["ticks/tick"], values["ticks/enabled"])]
    if off:
        rows["outputs off"] = off
    return figures.Marks(rows, causes)


def _draw_run(
    files: Output, scene: Scene, values: Mapping[str, NDArray[Any]], time_s: NDArray[Any], hit_s: Mapping[str, NDArray[Any]]
) -> None:
    from palpate import figures  # Matplotlib takes its time: only where something is drawn

    mode = values["ticks/contact_mode"]
    reference = None
    if "reference/force_N" in values:
        reference = figures.ForceTrace(
            values["reference/force_N"], values["reference/contact_mode"], values["reference/normal"]
        )
    figures.save_forces(
        files.add("forces.png"),
        title=_title(scene, f"firmware on {scene.sections.board.name}"),
        time_s=time_s,
        rendered=figures.ForceTrace(values["ticks/force_N"], mode, rendered_normal(values)),
        friction=touched_friction(values, mode, values["ticks/triangle"]),
        reference=reference,
        model_age_ticks=model_age_ticks(values),
        marks=fault_marks(scene.sections, values, hit_s),
    )
    _draw_body(files, scene, values, values["ticks/tip_m"])


def _draw_simulation(files: Output, scene: Scene, values: Mapping[str, NDArray[Any]]) -> None:
    from palpate import figures

    if "tip/force_N" in values:
        figures.save_forces(
            files.add("forces.png"),
            title=_title(scene, "full body"),
            time_s=values["tip/time_s"],
            rendered=figures.ForceTrace(values["tip/force_N"], values["tip/contact_mode"], values["tip/normal"]),
            friction=touched_friction(values, values["tip/contact_mode"], values["tip/triangle"]),
            rendered_name="full body",
        )
    _draw_body(files, scene, values, values.get("tip/position_m"))


def _draw_body(
    files: Output, scene: Scene, values: Mapping[str, NDArray[Any]], path_m: NDArray[Any] | None
) -> None:
    from palpate import figures

    nodes = scene.sections.body.nodes
    lattice = None
    if nodes:
        lattice = (nodes[0], nodes[1], nodes[2]) if len(nodes) == 3 else (nodes[0], 1, nodes[1])
    tip_m = values["body/tip_m"]
    figures.save_body(
        files.add("body.png"),
        title=_title(scene, f"t = {float(values['body/time_s']):.3f} s"),
        body=figures.BodyShape(
            values["body/rest_m"],
            values["body/position_m"],
            values["body/triangles"],
            lattice,
            values["body/patch_nodes"],
        ),
        tip_m=tip_m if np.isfinite(tip_m).all() else None,
        tip_radius_m=scene.sections.tool.radius_m,
        path_m=path_m,
    )
