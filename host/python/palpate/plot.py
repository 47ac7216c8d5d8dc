"""`palpate plot`: pictures of any record, whole or interrupted."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate import experiment, hil, record
from palpate.record import BadRecord, Record
from palpate.scene import Scene, load_recorded_scene
from palpate.scene_checks import friction
from palpate.scene_schema import SceneError
from palpate.tip_path import TipPath

if TYPE_CHECKING:
    from palpate import figures

Array = NDArray[Any]

# Pictures by the kind of record that has what they show.
PICTURES = {"run": ("forces", "path", "link", "timing"), "simulate": ("forces", "path")}
_TICK_S = 1e-3


@dataclass(frozen=True)
class Cut:
    """The part of a record that is drawn. time_s: (n,); values: its datasets, with the same rows; updates: (u,) of the
    rows of /updates whose models were sent in it."""

    time_s: Array
    values: Mapping[str, Array]
    updates: Array


def plot(
    file: Path, what: Sequence[str] | None, from_s: float | None, to_s: float | None, folder: Path
) -> dict[str, Any]:
    """Draws a record; `what` of PICTURES, all that it has by default. Returns summary.PLOT_KEYS.

    Raises BadRecord, or SceneError for a choice that the record does not allow.
    """
    loaded = record.load(file)
    names = _choose(loaded, what)
    cut = _cut(loaded, from_s, to_s)
    folder.mkdir(parents=True, exist_ok=True)
    title = _title(loaded)
    files = {}
    for name in names:
        picture = folder / f"{name}.png"
        _DRAW[name](picture, loaded, cut, title)
        files[picture.name] = str(picture)
    return {
        "command": "plot",
        "source": str(file),
        "kind": loaded.kind,
        "closed": loaded.closed,
        "ticks": len(cut.time_s),
        "from_s": float(cut.time_s[0]),
        "to_s": float(cut.time_s[-1]),
        "dropped_ticks": loaded.dropped_rows.get("ticks", 0),
        "files": files,
    }


def format_table(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Rows (label, text) for a person."""
    rows = [
        ("record", values["source"]),
        ("ticks drawn", f"{values['ticks']:,} from {values['from_s']:g} to {values['to_s']:g} s"),
    ]
    if not values["closed"]:
        rows.append(("interrupted", "all rows up to the last commit"))
    if values["dropped_ticks"]:
        rows.append(("ticks lost while recording", f"{values['dropped_ticks']:,}"))
    return rows


def _choose(loaded: Record, what: Sequence[str] | None) -> Sequence[str]:
    has = PICTURES[loaded.kind]
    if loaded.kind == "simulate" and "tip/time_s" not in loaded.values:
        raise BadRecord(f"{loaded.file}: a simulation without a tip: has nothing to draw over time")
    for name in what or ():
        if name not in PICTURES["run"]:
            raise SceneError(f"--what {name}: must be some of {', '.join(PICTURES['run'])}, with commas between them")
        if name not in has:
            raise SceneError(f"--what {name}: a record of `{loaded.kind}` has {', '.join(has)} only")
    return what or has


def _cut(loaded: Record, from_s: float | None, to_s: float | None) -> Cut:
    table = "ticks" if loaded.kind == "run" else "tip"
    time_s = loaded.values["ticks/tick"] * _TICK_S if loaded.kind == "run" else loaded.values["tip/time_s"]
    if len(time_s) == 0:
        raise BadRecord(f"{loaded.file}: has no ticks: nothing to draw")
    begin_s, end_s = time_s[0] if from_s is None else from_s, time_s[-1] if to_s is None else to_s
    half_s = 0.5 * _TICK_S
    chosen = (time_s >= begin_s - half_s) & (time_s <= end_s + half_s)
    if np.count_nonzero(chosen) < 2:
        raise SceneError(
            f"--from {begin_s:g} --to {end_s:g}: has {np.count_nonzero(chosen)} ticks of {loaded.file}, which goes from "
            f"{time_s[0]:g} to {time_s[-1]:g} s: must have at least 2"
        )
    values = {
        path: array[chosen]
        for path, array in loaded.values.items()
        if path.split("/")[0] in (table, "reference") and len(array) == len(chosen)
    }
    updates = np.zeros(0, dtype=np.intp)
    if loaded.kind == "run":
        sent_s = loaded.values["updates/sent_tick"] * _TICK_S
        updates = np.flatnonzero((sent_s >= begin_s - half_s) & (sent_s <= end_s + half_s))
    return Cut(time_s[chosen], values, updates)


def _title(loaded: Record) -> str:
    try:
        title = str(tomllib.loads(loaded.scene_text).get("title", ""))
    except (ValueError, RecursionError):
        title = ""
    where = f"firmware on {loaded.attributes.get('board', 'an unknown board')}" if loaded.kind == "run" else "full body"
    return f"{title or loaded.file.stem}: {where}" + ("" if loaded.closed else " (interrupted)")


def _friction(loaded: Record, mode: Array, triangle: Array) -> Array:
    """(n, 2): static and kinetic coefficients where the tip touches; of an interrupted recording, which may have no body,
    those of the scene."""
    if "body/triangle_friction" in loaded.values:
        return experiment.touched_friction(loaded.values, mode, triangle)
    coefficients = np.zeros((len(mode), 2))
    scene = _recorded_scene(loaded)
    if scene is None:  # the picture does without the cone
        return coefficients
    if not scene.sections.contact.regions:
        coefficients[mode != 0] = friction(scene.sections.contact)
    return coefficients


def _recorded_scene(loaded: Record) -> Scene | None:
    try:
        return load_recorded_scene(loaded.file, loaded.scene_text, {}, TipPath(np.zeros(1), np.zeros((1, 3)), "linear"))
    except SceneError:
        return None


def _marks(loaded: Record, cut: Cut) -> "figures.Marks | None":
    """Of the faults that the record's scene asks for: which frames were hit it does not have."""
    scene = _recorded_scene(loaded)
    return None if scene is None else experiment.fault_marks(scene.sections, cut.values, {})


def _draw_forces(file: Path, loaded: Record, cut: Cut, title: str) -> None:
    from palpate import figures

    values = cut.values
    if loaded.kind == "simulate":
        figures.save_forces(
            file,
            title=title,
            time_s=cut.time_s,
            rendered=figures.ForceTrace(values["tip/force_N"], values["tip/contact_mode"], values["tip/normal"]),
            friction=_friction(loaded, values["tip/contact_mode"], values["tip/triangle"]),
            rendered_name="full body",
        )
        return
    mode = values["ticks/contact_mode"]
    reference = None
    if "reference/force_N" in values:
        reference = figures.ForceTrace(
            values["reference/force_N"], values["reference/contact_mode"], values["reference/normal"]
        )
    body = {path: array for path, array in loaded.values.items() if path.startswith("body/")}
    figures.save_forces(
        file,
        title=title,
        time_s=cut.time_s,
        rendered=figures.ForceTrace(
            values["ticks/force_N"], mode, experiment.rendered_normal({**values, **body})
        ),
        friction=_friction(loaded, mode, values["ticks/triangle"]),
        reference=reference,
        model_age_ticks=experiment.model_age_ticks(values),
        marks=_marks(loaded, cut),
    )


def _draw_path(file: Path, loaded: Record, cut: Cut, title: str) -> None:
    from palpate import record_figures

    values = cut.values
    is_run = loaded.kind == "run"
    record_figures.save_path(
        file,
        title=title,
        trace=record_figures.PathTrace(
            cut.time_s,
            values["ticks/tip_m" if is_run else "tip/position_m"].astype(np.float64),
            values["ticks/contact_mode" if is_run else "tip/contact_mode"],
            values["ticks/hand_target_m"] if is_run else None,
            loaded.values.get("body/rest_m"),
        ),
    )


def _draw_link(file: Path, loaded: Record, cut: Cut, title: str) -> None:
    from palpate import record_figures

    updates = {path: array[cut.updates] for path, array in loaded.values.items() if path.startswith("updates/")}
    known = [name for name in ("frames_lost_down", "frames_lost_up") if name in loaded.attributes]
    losses = "frames lost: " + (
        ", ".join(f"{int(loaded.attributes[name])} {name.removeprefix('frames_lost_')}" for name in known) if known else "not known"
    )
    record_figures.save_link(
        file,
        title=title,
        trace=record_figures.LinkTrace(
            cut.time_s,
            cut.values["ticks/link_up_bytes"],
            cut.values["ticks/link_down_bytes"],
            updates["updates/sent_tick"] * _TICK_S,
            updates["updates/status"],
            updates["updates/bytes"],
            updates["updates/basis_bytes"],
            updates["updates/interpolated_ticks"],
            updates["updates/correction_energy_J"],
            f"{losses} (in the whole record)" if known else losses,
        ),
    )


def _draw_timing(file: Path, loaded: Record, cut: Cut, title: str) -> None:
    from palpate import record_figures

    values = cut.values
    board = hil.BOARDS.get(str(loaded.attributes.get("board")))
    clock_Hz = int(loaded.attributes.get("clock_Hz", 0))
    unit, scale, budget = "", 0.0, None
    if board is not None and board.instructions_per_count is not None and clock_Hz:
        unit, scale = "10³ instructions", 1e-3 * board.instructions_per_count
        budget = scale * clock_Hz * _TICK_S
    elif clock_Hz:
        unit, scale, budget = "µs", 1e6 / clock_Hz, 1e6 * _TICK_S
    missed, left = (
        int(values[f"ticks/{name}"][-1]) - int(values[f"ticks/{name}"][0])
        for name in ("missed_deadlines", "background_overruns")
    )
    record_figures.save_timing(
        file,
        title=title,
        trace=record_figures.TimingTrace(
            cut.time_s,
            experiment.model_age_ticks(values),
            values["ticks/tick_count"] * scale if scale else None,
            values["ticks/busy_count"] * scale if scale else None,
            unit,
            budget,
            f"missed deadlines: {missed}, ticks with background work left over: {left}",
        ),
    )


_DRAW = {"forces": _draw_forces, "path": _draw_path, "link": _draw_link, "timing": _draw_timing}
