"""The steps of a calibration. Each asks the operator for something, watches what the board measures, and writes registers only when all that it
has found is plausible; else it says why not, and the board keeps what it had."""

import contextlib
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from palpate.board_link import BoardLinkError
from palpate.body import Floats
from palpate.calibration import arm
from palpate.calibration.drive import FAR_RAD, Driver, radians
from palpate.calibration.fit import JointFit, fit_joint
from palpate.calibration.session import Calibration, StepError


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
        calibration.ask(name, f"{name.capitalize()}: {how}, and hold it there.", None)
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
    calibration.ask("zero", "Put the arm in its reference pose, upper arm level and forearm straight down, and hold it still.", None)
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

_SETPOINT_NOISE_A = 0.1
_RESIDUAL_SHARE, _RESIDUAL_LEAST_N_M = 0.25, 2e-3


def sweep(calibration: Calibration) -> dict[str, Any]:
    """The motors move one joint after the other, slowly, with nobody holding the tool; set-points are compared with monitors."""
    calibration.require_idle()
    board = calibration.board
    calibration.sweeps.clear()
    calibration.fits.clear()
    calibration.ask("hold", "Hold the tool loosely near the reference pose, so that it can give way. The motors come on next, push each joint to and fro, and hold the arm.", None)
    start = calibration.sample().joint_rad
    if np.any(np.abs(start) > FAR_RAD):
        raise StepError(f"the joints are at {radians(start)}: must be within {FAR_RAD:g} rad of the reference pose")
    try:
        board.arm(patience_s=calibration.patience_s, direct=True)
        _sweep_all(calibration, start)
    except BaseException as error:
        # Motors off without a question: of what fails here nothing leaves an arm that these motors could hold.
        try:
            board.disarm()
        except BoardLinkError as second:
            error.add_note(f"{second}; without forces the board switches its outputs off after a second")
        raise
    board.disarm()
    difference = np.concatenate([one.measured_A - one.setpoint_A for one in calibration.sweeps])
    noise = difference.std(0)
    if np.any(noise > _SETPOINT_NOISE_A):
        raise StepError(f"currents and set-points differ by {_amperes(noise)} rms about their mean: must be at most {_SETPOINT_NOISE_A:g} A; do the amplifiers follow?")
    # Told gain * wanted - offset, the amplifier lets flow wanted + difference: it takes gain * difference more of an offset to have none.
    gain = np.array(board.read_register("setpoint.gain").values)
    offset = np.array(board.read_register("setpoint.offset_a").values) + gain * difference.mean(0)
    _require_range(calibration, "setpoint.offset_a", offset, "A")
    return {"difference_A": difference.mean(0).tolist(), "noise_A": noise.tolist(), "setpoint.offset_a": calibration.write("setpoint.offset_a", offset)}


def _sweep_all(calibration: Calibration, start_rad: Floats) -> None:
    """Armed; from the operator's hand and back into it."""
    driver = Driver(calibration)

    def hold(_: float = 0.0) -> Any:
        return driver.hold(start_rad)

    for joint in range(3):
        driver.require_polarity(joint)
    driver.last(0.5, hold)
    calibration.ask("release", "Let go of the tool.", hold)
    driver.last(1.0, hold)
    sweeps = [driver.sweep(start_rad, joint) for joint in range(3)]
    calibration.ask("take", "Take the tool again: the motors go off.", hold)
    calibration.sweeps += sweeps


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
    old = {name: np.array(calibration.board.read_register(name).values) for name in ("friction.coulomb_n_m", "friction.viscous_n_m_s")}
    try:
        written = {name: calibration.write(name, values) for name, values in zip(old, (coulomb, viscous), strict=True)}
    except BoardLinkError:
        # Both or none; a write whose answer was lost may have been done.
        for name, values in old.items():
            with contextlib.suppress(BoardLinkError):
                calibration.write(name, values)
        raise
    return {"residual_N_m": [fit.residual_N_m for fit in fits], **written}


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
