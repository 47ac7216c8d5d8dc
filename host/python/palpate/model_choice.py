"""Chooses what a scene leaves to "auto": the order of the local model, the size of its patch, and how often it is updated.

The rule, its derivation and its measurement: docs/decisions/model_choice.md. A choice holds when every check of `_checks` does;
of those that hold it is the first in the order of `_preference`. Less bandwidth makes no check hold that did not, and
the preference never goes to a higher rate: so less bandwidth never gives more updates. A faster tool never gives a
smaller patch, for which larger ones are dearer in every way.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate import board_cost, link_rate
from palpate.model_size import ModelSize, model_size
from palpate.scene_schema import AUTO, Reader
from palpate.scene_sections import TICK_S, SceneFile
from palpate.tip_path import TipPath

TICKS_PER_SECOND = 1000
# Of each direction of the link: the rest is for repeats, commands, and what is not known of its framing.
LINK_SHARE = 0.8
# Of the time that the tip takes to cross a cell: in it the next patch's basis must cross, which is wanted early and waits for
# states (measured between 0.2, which does, and 0.7, which does not).
BASIS_SHARE = 0.6
# From here on more updates gain little, and order comes first (docs/frontier.md, "Updates").
ENOUGH_HZ = 30.0
RATES_HZ = (240.0, 200.0, 160.0, 120.0, 100.0, 80.0, 60.0, 50.0, 40.0, 30.0, 25.0, 20.0, 15.0, 12.0, 10.0)
# Nodes below the surface of `hybrid`, and frequencies of `krylov`: what paid in docs/decisions/model_choice.md. The other
# builders' order is their patch's.
NEAR_NODES = (12, 8, 4, 2, 0)
SHIFTS_HZ = (0.0,)
# Nodes along x and y; along z 2. Of `hybrid` 3 have no triangle off the border, where springs of the near field are missing.
# 5 leave `hybrid` room for too few nodes below the surface, gain nothing with `krylov`, and have too many modes with `patch`.
SIDES = {"hybrid": (4,)}
_SIDES = (3, 4)
_DEPTH = 2
# Models are built where the tip is no farther from the surface (docs/architecture.md).
_NEAR_BODY_M = 0.02
_SPEED_OVER_S = 0.01
# The link's rate is the most that crossed in so many ticks on end; a single tick may hold what waited for it.
_BUSY_TICKS = 3
# Frames to the host, framing included, bytes: a report on a model, one on a basis, a status; statuses a second.
_MODEL_REPORT_BYTES, _BASIS_REPORT_BYTES, _STATUS_BYTES, _STATUSES_HZ = 56, 76, 97, 10.0
_FRAMING_BYTES = 32
_AUTO_KEYS = (("rates", "model_update_Hz"), ("model", "patch_nodes"), ("model", "near_nodes"), ("model", "shifts_Hz"))


@dataclass(frozen=True)
class Measured:
    """Of a run: bytes a tick that crossed the link to the board when it was busy; ticks from a model's own to that in
    which it was handed to the link; and to that in which the board took it over."""

    bytes_per_tick: float
    sent_ticks: float
    late_ticks: float


@dataclass(frozen=True)
class Check:
    """need must be at most have. of: "link", "board", "tool" or "host"; cure: what would help."""

    of: str
    name: str
    need: float
    have: float
    unit: str
    cure: str

    @property
    def holds(self) -> bool:
        return self.need <= self.have

    def text(self) -> str:
        """One line."""
        text = f"{self.of}: {self.name}: {_number(self.need)} of {_number(self.have)} {self.unit}"
        return text if self.holds else f"{text}, short by {_number(self.need - self.have)}; {self.cure}"


@dataclass(frozen=True)
class Choice:
    """values: of the keys that were "auto"; checks: of what came out, with the fixed keys; predicted: numbers by name."""

    values: Mapping[str, Any]
    inputs: Mapping[str, Any]
    predicted: Mapping[str, Any]
    checks: tuple[Check, ...]

    def lines(self) -> list[str]:
        """What was chosen, and why, a line each."""
        chosen = ", ".join(f"{key} = {_value(value)}" for key, value in self.values.items())
        lines = [f"chosen: {chosen}" if chosen else "chosen: nothing, every key is fixed"]
        lines += [f"given: {name} {_value(value)}" for name, value in self.inputs.items()]
        lines += [f"expected: {name} {_value(value)}" for name, value in self.predicted.items()]
        return lines + [check.text() for check in self.checks]

    def to_dict(self) -> dict[str, Any]:
        """The key `choice` of summary.json."""
        return {
            "chosen": {key: list(value) if isinstance(value, tuple) else value for key, value in self.values.items()},
            "inputs": dict(self.inputs),
            "expected": dict(self.predicted),
            "reasons": [check.text() for check in self.checks],
        }


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _value(value: Any) -> str:
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return f"{value:,.6g}" if isinstance(value, float) else str(value)


def auto_keys(scene: SceneFile) -> list[str]:
    """Keys that the scene leaves to the rule."""
    return [f"{section}.{name}" for section, name in _AUTO_KEYS if getattr(getattr(scene, section), name) == AUTO]


def without_auto(scene: SceneFile) -> SceneFile:
    """The scene with defaults in place of "auto", to check all else."""
    return _with(scene, {key: _default(scene, key) for key in auto_keys(scene)})


def _default(scene: SceneFile, key: str) -> Any:
    section, name = key.split(".")
    return getattr(type(getattr(scene, section))(), name)


def _with(scene: SceneFile, values: Mapping[str, Any]) -> SceneFile:
    for key, value in values.items():
        section, name = key.split(".")
        scene = replace(scene, **{section: replace(getattr(scene, section), **{name: value})})
    return scene


def path_speed_m_s(scene: SceneFile, path: TipPath | None) -> float:
    """Greatest speed of the path along x or y, over 10 ms, where it is near the body; 0 without a path. The patch has its
    borders across these axes: contact is taken to be from above."""
    if path is None:
        return 0.0
    time_s = np.arange(path.time_s[0], path.time_s[-1] + _SPEED_OVER_S, _SPEED_OVER_S)
    segment = np.clip(np.searchsorted(path.time_s, time_s, side="right") - 1, 0, max(len(path.time_s) - 2, 0))
    if len(path.time_s) < 2:
        return 0.0
    start_s, end_s = path.time_s[segment], path.time_s[segment + 1]
    way = np.clip((time_s - start_s) / (end_s - start_s), 0.0, 1.0)
    if path.interpolation == "minimum_jerk":
        way = way**3 * (10.0 - 15.0 * way + 6.0 * way**2)
    start_m, end_m = path.position_m[segment], path.position_m[segment + 1]
    position_m = start_m + way[:, None] * (end_m - start_m)
    body = scene.body
    low_m = np.array(body.origin_m) - _NEAR_BODY_M
    high_m = low_m + body.spacing_m * (np.array(body.nodes) - 1) + 2.0 * _NEAR_BODY_M
    near = np.all((position_m >= low_m) & (position_m <= high_m), axis=1)
    steps_m = np.abs(np.diff(position_m[:, :2], axis=0)).max(axis=1)
    steps_m = steps_m[near[1:] & near[:-1]]
    return float(steps_m.max() / _SPEED_OVER_S) if len(steps_m) else 0.0


def measured_in(values: Mapping[str, NDArray[Any]]) -> Measured:
    """From the datasets of a run's record. Raises ValueError where no model was taken over."""
    taken = (values["updates/status"] == 0) & (values["updates/swap_tick"] > 0)
    if not np.any(taken):
        raise ValueError("no model was taken over in that run: it says nothing of the link")
    own = values["updates/tick"][taken].astype(np.int64)
    down = np.convolve(values["ticks/link_down_bytes"].astype(np.float64), np.full(_BUSY_TICKS, 1.0 / _BUSY_TICKS), "valid")
    return Measured(
        bytes_per_tick=float(down.max()),
        sent_ticks=float(np.median(values["updates/sent_tick"][taken].astype(np.int64) - own)),
        late_ticks=float(np.median(values["updates/swap_tick"][taken].astype(np.int64) - own)),
    )


@dataclass(frozen=True)
class _Situation:
    """What the rule goes by. sent_ticks: from a model's own tick to when it is handed to the link; None: as the scene has it."""

    bytes_per_tick: float
    speed_m_s: float
    sent_ticks: float | None


def _trace_bytes(scene: SceneFile) -> int:
    """A frame of a trace (docs/protocol.md)."""
    ticks = scene.link.trace_ticks
    return _FRAMING_BYTES + (12 + 6 * ticks if scene.link.trace == "tip" else 9 + 28 * ticks)


@dataclass(frozen=True)
class _Times:
    """In ticks. lag: by which a model lags when its replay begins; catch_up: of the replay, infinite where it never ends;
    longest: the most that a model may be late, catching up for as long as it may."""

    period: float
    lag: float
    replay_per_tick: float
    catch_up: float
    longest: float


def _times(scene: SceneFile, size: ModelSize, load: board_cost.Load, given: _Situation) -> _Times:
    period = TICKS_PER_SECOND / scene.rates.model_update_Hz
    sent = given.sent_ticks
    if sent is None:
        sent = scene.rates.host_delay_ticks + scene.link.trace_ticks - 1 + math.ceil(_trace_bytes(scene) / given.bytes_per_tick)
    basis = size.basis_bytes if size.basis_each_state else 0
    crossing = math.ceil((size.state_bytes + basis) / given.bytes_per_tick)
    checking = math.ceil(basis / board_cost.CHECKED_BYTES_PER_TICK)
    lag = sent + crossing + checking + board_cost.LOAD_TICKS
    budget = board_cost.BUDGETS[scene.board.name]
    # While bytes arrive the background has less time for the replay.
    left = budget.tick_instructions - load.tick
    receiving = left - board_cost.INSTRUCTIONS_PER_BYTE * given.bytes_per_tick
    busy = min(1.0, crossing / period)
    time = busy * min(budget.replay_instructions, receiving) + (1.0 - busy) * min(budget.replay_instructions, left)
    replay = max(time, 0.0) / load.replay
    catch_up = lag / (replay - 1.0) if replay > 1.0 else math.inf
    return _Times(period, lag, replay, catch_up, lag + min(period, board_cost.CATCH_UP_HORIZON_TICKS))


def _basis_check(scene: SceneFile, size: ModelSize, given: _Situation) -> list[Check]:
    """Of bases that serve many states: is the next one there when the tip comes to its patch?"""
    if size.basis_each_state or given.speed_m_s == 0.0:
        return []
    states = scene.rates.model_update_Hz * size.state_bytes / TICKS_PER_SECOND
    left = given.bytes_per_tick - states
    need = size.basis_bytes / left if left > 0.0 else math.inf
    have = BASIS_SHARE * scene.body.spacing_m / given.speed_m_s * TICKS_PER_SECOND
    baud = 10.0 * TICKS_PER_SECOND * (size.basis_bytes / have + states)
    slower_m_s = given.speed_m_s * have / need
    link = f"link of {baud:,.0f} baud" if scene.link.medium == "uart" else "faster link"
    cure = f"a {link} or a tool of {slower_m_s:.3g} m/s would do"
    return [Check("link", "a basis crossing, of the time for a cell of the body", need, have, "ticks", cure)]


def _checks(scene: SceneFile, given: _Situation) -> tuple[_Times, list[Check]]:
    """Everything that must hold of a scene without "auto"."""
    size = model_size(scene)
    load = board_cost.predict(size, scene.board.name)
    times = _times(scene, size, load, given)
    rate_Hz = scene.rates.model_update_Hz
    cells_Hz = given.speed_m_s / scene.body.spacing_m
    down = rate_Hz * size.state_bytes + (rate_Hz if size.basis_each_state else cells_Hz) * size.basis_bytes
    up = (
        TICKS_PER_SECOND / scene.link.trace_ticks * _trace_bytes(scene)
        + rate_Hz * (_MODEL_REPORT_BYTES + (_BASIS_REPORT_BYTES if size.basis_each_state else 0))
        + _STATUSES_HZ * _STATUS_BYTES
    )
    have = LINK_SHARE * given.bytes_per_tick * TICKS_PER_SECOND

    def faster_link(need: float) -> str:
        return f"a link of {10.0 * need / LINK_SHARE:,.0f} baud would do" if scene.link.medium == "uart" else "a faster link would do"

    if link_rate.is_shared(scene.link):
        down = up = down + up
    budget = board_cost.BUDGETS[scene.board.name]
    # Contact stays on the patch from the model's own tick on (docs/decisions/model_choice.md).
    reach = (min(scene.model.patch_nodes[:2]) - 2) / 2.0 * scene.body.spacing_m
    use = times.longest + (times.period / 2.0 if scene.model.patch_ahead else times.period)
    fastest = reach / (use * TICK_S)
    checks = [
        Check("link", "states and bases to the board", down, have, "bytes/s", faster_link(down)),
        *_basis_check(scene, size, given),
        Check("link", "traces and reports to the host", up, have, "bytes/s", f"{faster_link(up)}, or link.trace = \"tip\""),
        Check(
            "link",
            "ticks that a model is late, of the tip's history",
            times.longest,
            min(board_cost.TIP_HISTORY_TICKS - 1, scene.model.valid_ticks - times.period),
            "ticks",
            "a faster link, a smaller rates.host_delay_ticks or a greater model.valid_ticks would help",
        ),
        Check("board", "servo tick", load.tick, budget.tick_instructions, "instructions", "a larger part or a smaller order would help"),
        Check(
            "board",
            "catching up, of an update's period",
            times.catch_up,
            min(times.period, board_cost.CATCH_UP_HORIZON_TICKS),
            "ticks",
            "a larger part, a smaller order or a smaller rates.host_delay_ticks would help",
        ),
        Check(
            "tool",
            "speed for which the contact stays on the patch",
            given.speed_m_s,
            fastest,
            "m/s",
            f"a tool of at most {fastest:.3g} m/s, or models that are less late (rates.host_delay_ticks, a faster link or board)",
        ),
        Check(
            "host",
            "models that it computes at a time",
            rate_Hz * scene.rates.host_delay_ticks / TICKS_PER_SECOND,
            scene.rates.models_under_way,
            "models",
            "a greater rates.models_under_way or a smaller rates.host_delay_ticks would help",
        ),
    ]
    return times, checks


def _orders(scene: SceneFile) -> list[dict[str, Any]]:
    """Values of the keys of the order that are "auto", the highest first."""
    fixed = {"model.shifts_Hz": SHIFTS_HZ} if scene.model.shifts_Hz == AUTO else {}  # type: ignore[comparison-overlap]
    if scene.model.near_nodes != AUTO:  # type: ignore[comparison-overlap]
        return [fixed]
    if scene.model.builder != "hybrid":
        return [{**fixed, "model.near_nodes": _default(scene, "model.near_nodes")}]
    return [{**fixed, "model.near_nodes": count} for count in NEAR_NODES]


def _preference(scene: SceneFile) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Rates and orders, the best first: the highest order with the highest rate; down to ENOUGH_HZ the rate gives way, then
    the order, then the rate again."""
    orders = _orders(scene)
    if scene.rates.model_update_Hz != AUTO:  # type: ignore[comparison-overlap]
        yield from (({}, order) for order in orders)
        return
    for rate_Hz in RATES_HZ:
        for order in orders if rate_Hz == ENOUGH_HZ else orders[:1] if rate_Hz > ENOUGH_HZ else orders[-1:]:
            yield {"rates.model_update_Hz": rate_Hz}, order


def _patches(scene: SceneFile) -> list[dict[str, Any]]:
    """The smallest first."""
    if scene.model.patch_nodes != AUTO:  # type: ignore[comparison-overlap]
        return [{}]
    return [{"model.patch_nodes": (side, side, _DEPTH)} for side in SIDES.get(scene.model.builder, _SIDES)]


def choose(
    reader: Reader, requested: SceneFile, path: TipPath | None, measured: Measured | None = None
) -> tuple[SceneFile, Choice]:
    """The scene with numbers in place of "auto", and why. measured: of a run, in place of what the scene says of the link and of
    how late the host is. Raises SceneError where something is "auto" and nothing fits; a fixed value is never changed."""
    if requested.body.mesh is not None:
        raise reader.problem("body.mesh", f'given; must be left out, with body.nodes in its place: the rule of "{AUTO}" is for lattices only')
    if requested.body.dimension != 3:
        raise reader.error("body.dimension", requested.body.dimension, f'3 where a key is "{AUTO}": a sheet cannot be touched')
    speed_m_s = requested.tool.speed_m_s
    if speed_m_s is None:
        speed_m_s = path_speed_m_s(requested, path)
    given = _Situation(
        measured.bytes_per_tick if measured else link_rate.bytes_per_tick(requested.link),
        speed_m_s,
        measured.sent_ticks if measured else None,
    )
    keys = auto_keys(requested)
    nearest: list[Check] = []
    least = math.inf
    for (rate, order), patch in product(_preference(requested), _patches(requested)):
        values = {**rate, **patch, **order}
        scene = _with(requested, values)
        if not model_size(scene).fits_the_board() and keys:
            continue
        times, checks = _checks(scene, given)
        if not keys or all(check.holds for check in checks):
            return scene, Choice(
                {key: values[key] for key in keys}, _inputs(scene, given, measured), _predicted(scene, times), tuple(checks)
            )
        short = [check for check in checks if not check.holds]
        factor = max(check.need / check.have if check.have > 0.0 else math.inf for check in short)
        if not nearest or factor < least:
            nearest, least = short, factor
    problem = "; ".join(check.text() for check in nearest) if nearest else "no such model has room on the board"
    raise reader.problem(keys[0], f'"{AUTO}" finds nothing that fits; {problem}')


def _inputs(scene: SceneFile, given: _Situation, measured: Measured | None) -> dict[str, Any]:
    inputs: dict[str, Any] = {
        "builder": scene.model.builder,
        "board": scene.board.name,
        "link_bytes_per_s": given.bytes_per_tick * TICKS_PER_SECOND,
        "speed_m_s": given.speed_m_s,
    }
    if measured:
        inputs |= {"measured_sent_ticks": measured.sent_ticks, "measured_late_ticks": measured.late_ticks}
    return inputs


def _predicted(scene: SceneFile, times: _Times) -> dict[str, Any]:
    size = model_size(scene)
    load = board_cost.predict(size, scene.board.name)
    return {
        "modes": size.modes,
        "state_bytes": size.state_bytes,
        "basis_bytes": size.basis_bytes,
        "tick_instructions": round(load.tick),
        "replayed_ticks_per_tick": round(times.replay_per_tick, 3),
        "late_ticks": round(times.lag + times.catch_up, 1) if math.isfinite(times.catch_up) else None,
    }

