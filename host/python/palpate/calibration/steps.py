"""The steps of a calibration. Each asks the operator for something, watches what the board measures, and writes registers only when all that it
has found is plausible; else it says why not, and the board keeps what it had."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate.board_link import BoardLink, BoardLinkError
from palpate.body import Floats
from palpate.calibration import arm
from palpate.calibration.fit import JointFit, fit_joint


class StepError(RuntimeError):
    """Why a step has failed."""


@dataclass(frozen=True)
class Sample:
    """Of one tick (the register arm.sample), each (3,)."""

    time_s: float
    joint_rad: Floats
    joint_rad_s: Floats
    setpoint_A: Floats
    measured_A: Floats


@dataclass
class Sweep:
    """One joint moved by its motor, the others held. (n,) and (n, 3)."""

    joint: int
    time_s: Floats
    joint_rad: Floats
    setpoint_A: Floats
    measured_A: Floats


@dataclass
class Calibration:
    """A calibration under way: the board, and how the operator is asked. `ask(key, text)` returns when the operator has been told, and is
    ready; keys are those of PROMPTS and the joints' names."""

    board: BoardLink
    ask: Callable[[str, str], None]
    patience_s: float = 30.0
    sweeps: list[Sweep] = field(default_factory=list)
    fits: list[JointFit] = field(default_factory=list)

    def sample(self) -> Sample:
        register = self.board.read_register("arm.sample")
        rows = np.array(register.values).reshape(4, 3)
        return Sample(register.time_s, *rows)

    def counts(self) -> Floats:
        return np.array(self.board.read_register("encoder.count").values, np.float64)

    def require_idle(self) -> None:
        state = self.board.state()
        if state.mode != "idle":
            raise StepError(f"the board is in mode {state.mode} with faults {state.faults:#x}: must be idle (docs/safety.md)")

    def write(self, name: str, values: Floats) -> list[float]:
        """Writes and reads back."""
        self.board.write_register(name, values)
        return list(self.board.read_register(name).values)


# Encoder direction

# 60 mrad, 1.3 cm at the tip by the upper arm: no jitter, and within every limit.
_MOVED_RAD = 0.06
_OTHERS_SHARE = 0.5
_DIRECTIONS = (
    ("base", "swing the tip to the right (+x), by some 2 cm"),
    ("upper arm", "lift the elbow: the upper arm up, the forearm as it hangs"),
    ("forearm", "swing the forearm towards you, the upper arm still"),
)


def direction(calibration: Calibration) -> dict[str, Any]:
    """Each joint is moved as asked; its count must follow upwards, or its sign turns."""
    calibration.require_idle()
    board = calibration.board
    signs = np.ones(3)
    moved_counts = []
    for joint, (name, how) in enumerate(_DIRECTIONS):
        before = calibration.counts()
        calibration.ask(name, f"{name.capitalize()}: {how}, and hold it there.")
        least = _MOVED_RAD * arm.COUNTS_RAD
        deadline_s = board.clock() + calibration.patience_s
        moved = calibration.counts() - before
        while np.all(np.abs(moved) < least) and board.clock() < deadline_s:
            moved = calibration.counts() - before
        shares = np.abs(moved) / arm.COUNTS_RAD
        told = ", ".join(f"{other} {count:+.0f}" for other, count in zip(arm.JOINTS, moved, strict=True))
        if np.all(np.abs(moved) < least):
            raise StepError(f"{name} did not move: counts {told} in {calibration.patience_s:g} s, must be at least {least[joint]:.0f} either way; is its encoder connected?")
        largest = int(np.argmax(shares))
        if largest != joint:
            raise StepError(f"{name} was asked for, but {arm.JOINTS[largest]} moved: counts {told}; are the encoders exchanged?")
        others = max(share for other, share in enumerate(shares) if other != joint)
        if others > _OTHERS_SHARE * shares[joint]:
            raise StepError(f"more than {name} moved: counts {told}; the others may move by at most {100 * _OTHERS_SHARE:g} % of its angle")
        signs[joint] = math.copysign(1.0, moved[joint])
        moved_counts.append(moved.tolist())
    return {"moved_counts": moved_counts, "encoder.sign": calibration.write("encoder.sign", signs)}


# Zero

_ZERO_COUNTS = 1.5


def zero(calibration: Calibration) -> dict[str, Any]:
    """The reference pose becomes the origin (CALIBRATE; not kept over a start: the encoders are incremental)."""
    calibration.require_idle()
    calibration.ask("zero", "Put the arm in its reference pose, upper arm level and forearm straight down, and hold it still.")
    try:
        calibration.board.calibrate()
    except BoardLinkError as error:
        raise StepError(f"{error}; hold the arm still for 0.1 s") from None
    angles = calibration.sample().joint_rad
    counts = angles * arm.COUNTS_RAD
    if np.any(np.abs(counts) > _ZERO_COUNTS):
        raise StepError(
            f"the joints are {', '.join(f'{count:+.0f}' for count in counts)} counts off their zero: must be at most {_ZERO_COUNTS:g}; the arm moved while the board watched"
        )
    return {"joint_rad": angles.tolist()}


# Monitors and set-points

_MONITOR_SAMPLES = 100
_MONITOR_NOISE_A = 0.1
# Of a mean of 100: what remains is noise.
_MONITOR_LEFT_A = 0.03


def monitors(calibration: Calibration) -> dict[str, Any]:
    """With the amplifiers off no current flows, so what the monitors say is their offset. Their gain needs an ammeter."""
    calibration.require_idle()
    board = calibration.board
    gain = np.array(board.read_register("monitor.gain").values)
    old = np.array(board.read_register("monitor.offset_a").values)

    def read() -> tuple[Floats, Floats]:
        rows = np.array([calibration.sample().measured_A for _ in range(_MONITOR_SAMPLES)])
        return rows.mean(0), rows.std(0)

    mean, noise = read()
    if not np.all(np.isfinite(mean)):
        raise StepError("a monitor gives no number: is its converter running?")
    if np.any(noise > _MONITOR_NOISE_A):
        raise StepError(f"noise of the monitors {_amperes(noise)}: must be at most {_MONITOR_NOISE_A:g} A; look at grounds and shields")
    offset = old + mean / gain
    _require_range(calibration, "monitor.offset_a", offset, "A")
    written = calibration.write("monitor.offset_a", offset)
    left = read()[0]
    if np.any(np.abs(left) > _MONITOR_LEFT_A):
        calibration.write("monitor.offset_a", old)
        raise StepError(f"the monitors still say {_amperes(left)} of no current: must be at most {_MONITOR_LEFT_A:g} A; the offset drifts")
    return {"noise_A": noise.tolist(), "left_A": left.tolist(), "monitor.offset_a": written}


def _amperes(values: Floats) -> str:
    return ", ".join(f"{value:+.3f}" for value in values) + " A"


def _require_range(calibration: Calibration, name: str, values: Floats, unit: str) -> None:
    least, most = (np.array(calibration.board.read_register(name + suffix).values) for suffix in (">", "<"))
    for joint, value, low, high in zip(arm.JOINTS, values, least, most, strict=True):
        if not low <= value <= high:
            raise StepError(f"{name} of the {joint} would be {value:.4g} {unit}: must be from {low:g} to {high:g} {unit}")


# Sweeps, friction and weight

_AMPLITUDE_RAD = 0.3
_PERIOD_S = 4.0
_PERIODS = 2
# A joint as a spring and a damper about its place: 15 rad/s and 0.7 of the critical damping with the arm's moments of inertia
# (0.004, 0.0024, 0.001 kg m2), slow against the link's delay of some ms.
_STIFFNESS_N_M_RAD = np.array([0.9, 0.54, 0.22])
_DAMPING_N_M_S_RAD = np.array([0.08, 0.05, 0.02])
_FAR_RAD = 0.35  # from the reference pose at the start; from the path while it sweeps
_SETPOINT_NOISE_A = 0.1
_RESIDUAL_SHARE, _RESIDUAL_LEAST_N_M = 0.25, 2e-3


def sweep(calibration: Calibration) -> dict[str, Any]:
    """The motors move one joint after the other, slowly, with nobody holding the tool; set-points are compared with monitors."""
    calibration.require_idle()
    board = calibration.board
    calibration.sweeps.clear()
    calibration.fits.clear()
    calibration.ask("hold", "Hold the tool near the reference pose. The motors come on next and hold the arm themselves.")
    start = calibration.sample().joint_rad
    if np.any(np.abs(start) > _FAR_RAD):
        raise StepError(f"the joints are at {_radians(start)}: must be within {_FAR_RAD:g} rad of the reference pose")
    try:
        board.arm(patience_s=calibration.patience_s, direct=True)
        _settle(calibration, start, 0.5)
        calibration.ask("release", "Let go of the tool.")
        _settle(calibration, start, 1.0)
        calibration.sweeps += [_sweep_joint(calibration, start, joint) for joint in range(3)]
    finally:
        try:
            calibration.ask("take", "Take the tool again: the motors go off.")
        finally:
            board.disarm()
    difference = np.concatenate([one.measured_A - one.setpoint_A for one in calibration.sweeps])
    noise = difference.std(0)
    if np.any(noise > _SETPOINT_NOISE_A):
        raise StepError(f"currents and set-points differ by {_amperes(noise)} rms about their mean: must be at most {_SETPOINT_NOISE_A:g} A; do the amplifiers follow?")
    offset = np.array(board.read_register("setpoint.offset_a").values) + difference.mean(0)
    _require_range(calibration, "setpoint.offset_a", offset, "A")
    return {"difference_A": difference.mean(0).tolist(), "noise_A": noise.tolist(), "setpoint.offset_a": calibration.write("setpoint.offset_a", offset)}


def _radians(values: Floats) -> str:
    return ", ".join(f"{value:+.3f}" for value in values) + " rad"


def _drive(calibration: Calibration, wanted_rad: Floats, wanted_rad_s: Floats) -> Sample:
    """One sample, and the force that draws the joints to where they shall be."""
    now = calibration.sample()
    if np.any(np.abs(now.joint_rad - wanted_rad) > _FAR_RAD):
        state = calibration.board.state()
        raise StepError(f"the arm does not follow: joints {_radians(now.joint_rad)}, wanted {_radians(wanted_rad)}; mode {state.mode}, faults {state.faults:#x}")
    torque_N_m = _STIFFNESS_N_M_RAD * (wanted_rad - now.joint_rad) + _DAMPING_N_M_S_RAD * (wanted_rad_s - now.joint_rad_s)
    calibration.board.push(np.linalg.solve(arm.jacobian_m(now.joint_rad).T, torque_N_m))
    return now


def _settle(calibration: Calibration, place_rad: Floats, duration_s: float) -> None:
    first = _drive(calibration, place_rad, np.zeros(3))
    while _drive(calibration, place_rad, np.zeros(3)).time_s < first.time_s + duration_s:
        pass


def _sweep_joint(calibration: Calibration, start_rad: Floats, joint: int) -> Sweep:
    rows: list[Sample] = []
    first_s = _drive(calibration, start_rad, np.zeros(3)).time_s
    rate = 2 * math.pi / _PERIOD_S
    passed_s = 0.0
    while passed_s < _PERIODS * _PERIOD_S:
        wanted, speed = start_rad.copy(), np.zeros(3)
        wanted[joint] += _AMPLITUDE_RAD * math.sin(rate * passed_s)
        speed[joint] = _AMPLITUDE_RAD * rate * math.cos(rate * passed_s)
        rows.append(_drive(calibration, wanted, speed))
        passed_s = rows[-1].time_s - first_s
    state = calibration.board.state()
    if state.mode != "direct":
        raise StepError(f"the board went to mode {state.mode} with faults {state.faults:#x} while the {arm.JOINTS[joint]} was swept")
    return Sweep(
        joint,
        np.array([row.time_s for row in rows]),
        np.array([row.joint_rad for row in rows]),
        np.array([row.setpoint_A for row in rows]),
        np.array([row.measured_A for row in rows]),
    )


def _fit_all(calibration: Calibration) -> list[JointFit]:
    if calibration.fits:
        return calibration.fits
    if not calibration.sweeps:
        raise StepError("there are no sweeps: the step sweep comes before, and must not have failed")
    weights = (None, np.cos, np.sin)
    fits = []
    for one, weight in zip(calibration.sweeps, weights, strict=True):
        angle = one.joint_rad[:, one.joint]
        torque = one.measured_A[:, one.joint] * arm.TORQUE_N_M_A[one.joint]
        name = arm.JOINTS[one.joint]
        try:
            fit = fit_joint(one.time_s, angle, torque, None if weight is None else weight(angle))
        except ValueError as error:
            raise StepError(f"{name}: {error}; is the tool held, or does the joint stick?") from None
        most = max(_RESIDUAL_LEAST_N_M, _RESIDUAL_SHARE * abs(fit.coulomb_N_m))
        if fit.residual_N_m > most:
            raise StepError(f"{name}: the fit leaves {1e3 * fit.residual_N_m:.2f} mN m rms: must be at most {1e3 * most:.2f} mN m; was the tool touched, or does a cable drag?")
        fits.append(fit)
    calibration.fits += fits
    return fits


def friction(calibration: Calibration) -> dict[str, Any]:
    """Coulomb and viscous friction of the sweeps. What share of it is compensated stays as it is."""
    calibration.require_idle()
    fits = _fit_all(calibration)
    coulomb = np.array([fit.coulomb_N_m for fit in fits])
    viscous = np.array([fit.viscous_N_m_s for fit in fits])
    _require_range(calibration, "friction.coulomb_n_m", coulomb, "N m")
    _require_range(calibration, "friction.viscous_n_m_s", viscous, "N m s/rad")
    return {
        "residual_N_m": [fit.residual_N_m for fit in fits],
        "friction.coulomb_n_m": calibration.write("friction.coulomb_n_m", coulomb),
        "friction.viscous_n_m_s": calibration.write("friction.viscous_n_m_s", viscous),
    }


def gravity(calibration: Calibration) -> dict[str, Any]:
    """The weight's torque of the sweeps."""
    calibration.require_idle()
    fits = _fit_all(calibration)
    torque = np.array([0.0, fits[1].gravity_N_m, fits[2].gravity_N_m])
    _require_range(calibration, "gravity.torque_n_m", torque, "N m")
    return {"gravity.torque_n_m": calibration.write("gravity.torque_n_m", torque)}


STEPS: dict[str, Callable[[Calibration], dict[str, Any]]] = {
    "direction": direction,
    "zero": zero,
    "monitors": monitors,
    "sweep": sweep,
    "friction": friction,
    "gravity": gravity,
}
