"""What must hold in every case of the fault matrix (docs/faults.md has the rules in words)."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.faults.cases import CUT, EXACT, MODULO, RESTART, Case
from palpate.record_layout import BOARD_MODES

BOOT = BOARD_MODES.index("boot")
RENDER = BOARD_MODES.index("render")
# Limits of the firmware, firmware/core/supervisor.hpp; a test holds them against it.
PEAK_FORCE_N = 8.5
MOTOR_CURRENT_A = 7.0
TIP_SPEED_M_S = 2.5
FORCE_STEP_N = 0.5
FADE_TICKS = 200
SILENT_TICKS = 300
DAMPING_TICKS = 1000
DAMPING_FORCE_N = 1.0
# Single precision, and what a record keeps of it.
ROUNDING = 1e-4
# A sign of life goes out this often at least: the newest before a fault may be so old, and models younger.
SIGN_TICKS = 100
# Rule 3: what a late or lost model may add.
FORCE_SLACK_N = 0.5

# Transfers that a CAN bus tells apart: so many lost in a row of one port do not show.
CAN_TRANSFERS = 32
# Status of a model (shared/status.hpp).
SCHEMA_MISMATCH = 18

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """What a run left: datasets by path, counters, frames that its faults removed, and how often the host found that the board had
    started again."""

    values: dict[str, NDArray[Any]]
    counters: dict[str, Any]
    removed: dict[str, int]
    restarts: int = 0
    dropped: dict[str, int] = field(default_factory=lambda: {"down": 0, "up": 0})  # frames for which a full queue had no room
    sent_again: int = 0  # frames that an error on a CAN bus hit
    bus_offs: int = 0

    @property
    def force_N(self) -> Floats:
        """(ticks,): magnitude of the rendered force."""
        force_N: Floats = np.linalg.norm(self.values["ticks/force_N"].astype(np.float64), axis=1)
        return force_N

    @property
    def step_N(self) -> Floats:
        """(ticks,): its change since the tick before, of ticks after which outputs are still on."""
        force_N = self.values["ticks/force_N"].astype(np.float64)
        change_N = np.linalg.norm(np.diff(force_N, axis=0, prepend=force_N[:1]), axis=1)
        return np.where(self.values["ticks/enabled"] == 1, change_N, 0.0)

    @property
    def speed_m_s(self) -> Floats:
        """(ticks - 1,): of the tip."""
        way_m = np.linalg.norm(np.diff(self.values["ticks/true_tip_m"], axis=0), axis=1)
        speed_m_s: Floats = way_m / np.diff(self.values["ticks/tick"]) * 1e3
        return speed_m_s

    @property
    def true_force_N(self) -> Floats:
        """(ticks,): what the full body answers to a tip that has gone this way; zero where it was not asked."""
        known = self.values.get("reference/force_N", np.zeros((len(self.force_N), 3)))
        force_N: Floats = np.linalg.norm(known.astype(np.float64), axis=1)
        return force_N

    @property
    def mode(self) -> NDArray[np.int64]:
        return self.values["ticks/mode"].astype(np.int64)

    def row(self, tick: int) -> int:
        """The first row at or after a tick."""
        return int(np.searchsorted(self.values["ticks/tick"], tick))


@dataclass(frozen=True)
class Result:
    """A case's numbers, and the rules that it breaks, in words."""

    case: Case
    numbers: dict[str, Any]
    broken: tuple[str, ...]
    run: Run
    good: Run


def _same_tick_N(good: Run, run: Run) -> Floats:
    """(ticks of run,): force of the run without faults."""
    rows = np.searchsorted(good.values["ticks/tick"], run.values["ticks/tick"])
    force_N: Floats = good.force_N[np.minimum(rows, len(good.force_N) - 1)]
    return force_N


def has_more_force(good: Run, run: Run) -> bool:
    """Is there more force than rule 3 allows by the same tick alone?"""
    return bool(np.any(run.force_N > _same_tick_N(good, run) + FORCE_SLACK_N))


def _rises(case: Case, good: Run, run: Run, valid_ticks: int) -> dict[str, float]:
    """Of force above that of the run without faults: rise_N, in the same tick; excess_N, over what rule 3 allows where there is
    more than its slack to feel, so that what is negative is left of it."""
    tick = run.values["ticks/tick"]
    same_N = _same_tick_N(good, run)
    most_N = np.maximum(same_N, run.true_force_N) + FORCE_SLACK_N
    # The tip is damped once its model has faded.
    damped = (run.values["ticks/model_age_ticks"] >= valid_ticks + FADE_TICKS) & (run.mode == RENDER)
    most_N = np.where(damped, np.maximum(most_N, DAMPING_FORCE_N), most_N)
    excess_N = run.force_N - most_N
    felt = run.force_N > FORCE_SLACK_N
    # Once the model's force was gone the contact is found anew, where the tip is by then, and has another history of friction.
    within = (tick >= case.first_s * 1000) & (tick < case.end_s * 1000)
    if np.any(within & (run.values["ticks/model_age_ticks"] > valid_ticks + FADE_TICKS)):
        felt &= tick < case.end_s * 1000
    return {"rise_N": float((run.force_N - same_N).max()), "excess_N": float(excess_N[felt].max()) if felt.any() else -FORCE_SLACK_N}


def judge(case: Case, good: Run, run: Run, valid_ticks: int) -> Result:
    """Holds a run against the rules, and against the run without faults."""
    values, broken = run.values, []
    first_tick, end_tick = round(case.first_s * 1000), round(case.end_s * 1000)
    at = run.row(first_tick)

    setpoint_A = np.abs(values["ticks/setpoint_A"])
    off = values["ticks/enabled"] == 0
    numbers: dict[str, Any] = {
        "force_N": float(run.force_N.max()),
        "current_A": float(setpoint_A.max()),
        "speed_m_s": float(run.speed_m_s.max()),
        "step_N": float(run.step_N.max()),
        **_rises(case, good, run, valid_ticks),
    }
    for name, limit in (("force_N", PEAK_FORCE_N), ("current_A", MOTOR_CURRENT_A), ("speed_m_s", TIP_SPEED_M_S)):
        if not numbers[name] <= limit + ROUNDING:
            broken.append(f"{name} = {numbers[name]:.3g}: must be at most {limit:g}")
    if np.any(setpoint_A[off]) or np.any(run.force_N[off]):
        broken.append("set-points while outputs are off")
    step_limit_N = numbers["step_limit_N"] = float(good.step_N.max()) + FORCE_STEP_N
    if not numbers["step_N"] <= step_limit_N + ROUNDING:
        broken.append(f"step_N = {numbers['step_N']:.3g}: must be at most {step_limit_N:.3g}")
    if not numbers["excess_N"] <= ROUNDING:
        broken.append(f"force {numbers['excess_N']:.3g} N above that of the body, and of the run without the fault in the same tick")

    numbers.update(_times(case, run, at, end_tick, valid_ticks, broken))
    numbers.update(_losses(case, run, broken))
    numbers.update(_counted(case, run, broken))
    _judge_end(case, run, end_tick, valid_ticks, numbers, broken)
    return Result(case, numbers, tuple(broken), run, good)


def _first(condition: NDArray[np.bool_], tick: NDArray[Any], since_tick: int) -> int | None:
    found = np.flatnonzero(condition)
    return int(tick[found[0]]) - since_tick if len(found) else None


def _last(condition: NDArray[np.bool_], tick: NDArray[Any], since_tick: int) -> int | None:
    """Ticks from then on until the condition no longer holds, and does not again; None where it holds to the end."""
    found = np.flatnonzero(condition)
    if not len(found):
        return 0
    return None if found[-1] == len(tick) - 1 else int(tick[found[-1] + 1]) - since_tick


def _times(case: Case, run: Run, at: int, end_tick: int, valid_ticks: int, broken: list[str]) -> dict[str, Any]:
    """Ticks from the beginning of the fault to the end of the model's force, and to outputs that are off."""
    tick = run.values["ticks/tick"][at:]
    since = int(round(case.first_s * 1000))
    off = _first(run.values["ticks/enabled"][at:] == 0, tick, since)
    times: dict[str, Any] = {"force_gone_ticks": None, "outputs_off_ticks": off}
    if case.kind == CUT:
        # A board that starts again has no fault: it boots.
        shows = run.values["ticks/faults"][at:] != 0 if case.faults else run.mode[at:] == BOOT
        wanted = _first(shows, tick, since)
        times["force_gone_ticks"] = off
        if off is None or off != wanted or off > end_tick - since:
            broken.append(f"outputs off after {off} ticks, fault or boot after {wanted}: must be the same, at most at the fault's end")
        elif np.any(run.values["ticks/enabled"][at:][tick - since >= off]):
            broken.append("outputs on again, though nobody has armed")
        return times
    if not (case.silent or case.refused):
        return times
    # What is gone must stay so to the end of the fault. Of the model: the damper is not counted.
    span = slice(at, run.row(end_tick))
    tick = run.values["ticks/tick"][span]
    faded = run.values["ticks/model_age_ticks"][span] > valid_ticks + FADE_TICKS
    gone = times["force_gone_ticks"] = _last(run.force_N[span] > DAMPING_FORCE_N * faded, tick, since)
    off = times["outputs_off_ticks"] = _last(run.values["ticks/enabled"][span] == 1, tick, since)
    length = end_tick - since
    gone_limit, off_limit = valid_ticks + FADE_TICKS, valid_ticks + FADE_TICKS + DAMPING_TICKS + SIGN_TICKS
    if length > gone_limit and (gone is None or gone > gone_limit):
        broken.append(f"force gone after {gone} ticks: must be at most {gone_limit}")
    if length > off_limit and (off is None or off > off_limit):
        broken.append(f"outputs off after {off} ticks: must be at most {off_limit}")
    return times


def _losses(case: Case, run: Run, broken: list[str]) -> dict[str, Any]:
    numbers: dict[str, Any] = {}
    for way in ("down", "up"):
        removed, lost = run.removed[way] + run.dropped[way], int(run.counters[f"frames_lost_{way}"])
        if case.displaces and way == "down":
            removed += int(run.counters["models_sent"] - run.counters["models_taken"] - run.counters["models_refused"])
        numbers[f"removed_{way}"], numbers[f"lost_{way}"] = removed, lost
        unseen = min(case.unseen, run.dropped[way]) + case.rare
        # A board that has started again counts what the host sends from there; the host has counted all the time.
        exact = case.loss == EXACT or (case.loss == RESTART and way == "up")
        if exact and not removed - unseen <= lost <= removed:
            broken.append(f"frames_lost_{way} = {lost}: {removed} were removed")
        if case.loss == RESTART and way == "down" and lost > removed:
            broken.append(f"frames_lost_{way} = {lost}: {removed} were removed")
        if case.loss == MODULO and not (0 < lost <= removed and (removed - lost) % CAN_TRANSFERS == 0):
            broken.append(f"frames_lost_{way} = {lost}: {removed} were removed, all must show but for multiples of {CAN_TRANSFERS}")
    return numbers


def _counted(case: Case, run: Run, broken: list[str]) -> dict[str, Any]:
    """What the two ends must have noticed."""
    sent_s = run.values["updates/sent_tick"] * 1e-3
    told = run.values["updates/status"][(sent_s >= case.first_s) & (sent_s < case.end_s)]
    refused = int(np.count_nonzero(told == SCHEMA_MISMATCH))
    if case.refused and (refused == 0 or refused != len(told)):
        broken.append(f"{refused} of {len(told)} models of another schema were refused for it: must be all, at least one")
    if case.group == "flip" and run.sent_again == 0 and sum(run.removed.values()) == 0:
        broken.append("no bit has flipped")
    if run.restarts != case.restarts:
        broken.append(f"the host found {run.restarts} restarts of the board: there were {case.restarts}")
    return {"refused_models": refused, "board_restarts": run.restarts, "sent_again": run.sent_again, "bus_offs": run.bus_offs}


def _recovery_ticks(run: Run, end_tick: int) -> int | None:
    """From then to the first model that is taken over; None: there is none."""
    swaps = run.values["updates/swap_tick"].astype(np.int64)
    after = swaps[swaps >= end_tick]
    return int(after.min()) - end_tick if len(after) else None


def _judge_end(case: Case, run: Run, end_tick: int, valid_ticks: int, numbers: dict[str, Any], broken: list[str]) -> None:
    mode = BOARD_MODES[int(run.mode[-1])]
    faults = int(run.values["ticks/faults"][-1])
    numbers["ends_in"] = mode
    if mode != case.ends_mode or faults != case.faults:
        broken.append(f"ends in mode {mode}, faults 0x{faults:x}: must be {case.ends_mode}, 0x{case.faults:x}")
    numbers["recovery_ticks"] = None
    if case.ends_mode == "render":
        numbers["recovery_ticks"] = _recovery_ticks(run, end_tick)
        if numbers["recovery_ticks"] is None:
            broken.append("no model was taken over after the fault")
        if int(run.values["ticks/model_age_ticks"][-1]) > valid_ticks:
            broken.append("the model at the end is too old")
