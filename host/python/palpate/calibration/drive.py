"""The motors hold or move the arm, joint by joint, from here: as a spring and a damper would draw each joint to its place."""

import math
from collections.abc import Callable

import numpy as np

from palpate.body import Floats
from palpate.calibration import arm
from palpate.calibration.session import Calibration, Sample, StepError, Sweep

_AMPLITUDE_RAD = 0.3
# Of a sweep at one rate the angle goes with its acceleration, so that weight and inertia look alike; at two they do not.
_PERIODS_S = (4.0, 2.0, 2.0)
# A joint as a spring and a damper about its place: 15 rad/s and 0.7 of the critical damping with the arm's moments of inertia
# (0.004, 0.0024, 0.001 kg m2), slow against the link's delay of some ms.
_STIFFNESS_N_M_RAD = np.array([0.9, 0.54, 0.22])
_DAMPING_N_M_S_RAD = np.array([0.08, 0.05, 0.02])
FAR_RAD = 0.35  # from the reference pose at the start; from the path while it sweeps
# Of the check of a motor's polarity: 20 mN m beyond the arm's friction, 0.14 N at the tip; 10 counts, 0.3 mm at the tip.
_PUSH_N_M = 0.03
_PUSH_S, _REST_S, _PUSH_TIMES = 0.5, 0.2, 2
_GIVES_RAD, _ENOUGH_RAD = 1.5e-3, 0.01
# A board says its mode ten times a second.
_SILENT_S = 1.0
# By how much a loop may outlast its time by the board's clock: no clock is that slow.
_CLOCKS_APART_S = 5.0


class Driver:
    """From arming to disarming. Every sample looks at the board's clock and at its newest status."""

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._first_s: float | None = None
        self._last_s = 0.0

    def sample(self) -> Sample:
        """Raises StepError where the board has started again, is in another mode than direct, or has not said for 1 s in which."""
        now = self._calibration.sample()
        if self._first_s is None:
            self._first_s = self._last_s = now.time_s
        if now.time_s < self._last_s:
            raise StepError(f"the board has started again: its clock went from {self._last_s:.3f} s back to {now.time_s:.3f} s")
        self._last_s = now.time_s
        status = self._calibration.board.newest_state
        # What it said before it was armed says nothing.
        said_s = self._first_s if status is None else max(self._first_s, 1e-3 * status.tick)
        if status is not None and said_s > self._first_s and status.mode != "direct":
            raise StepError(f"the board went to mode {status.mode} with faults {status.faults:#x}: must be direct until the sweeps are done (docs/safety.md)")
        if now.time_s > said_s + _SILENT_S:
            raise StepError(f"the board has not said its mode for {now.time_s - said_s:.1f} s: must say it once in {_SILENT_S:g} s")
        return now

    def draw(self, wanted_rad: Floats, wanted_rad_s: Floats) -> Sample:
        """One sample, and the force that draws the joints to where they shall be."""
        now = self.sample()
        if np.any(np.abs(now.joint_rad - wanted_rad) > FAR_RAD):
            raise StepError(f"the arm does not follow: joints {radians(now.joint_rad)}, wanted {radians(wanted_rad)}")
        self._push(now, _STIFFNESS_N_M_RAD * (wanted_rad - now.joint_rad) + _DAMPING_N_M_S_RAD * (wanted_rad_s - now.joint_rad_s))
        return now

    def hold(self, place_rad: Floats) -> Sample:
        return self.draw(place_rad, np.zeros(3))

    def last(self, duration_s: float, step: Callable[[float], Sample]) -> list[Sample]:
        """Calls step with the time since its first sample until duration_s have passed on the board's clock. Raises StepError where they pass on
        this computer's, and not on the board's."""
        clock = self._calibration.board.clock
        deadline_s = clock() + duration_s + _CLOCKS_APART_S
        rows = [step(0.0)]
        while (passed_s := rows[-1].time_s - rows[0].time_s) < duration_s:
            if clock() > deadline_s:
                raise StepError(f"the board's clock has gone on by {passed_s:.3f} s while {duration_s + _CLOCKS_APART_S:g} s passed here")
            rows.append(step(passed_s))
        return rows

    def sweep(self, start_rad: Floats, joint: int) -> Sweep:
        """One joint to and fro, the others held."""
        def step(passed_s: float) -> Sample:
            offset_rad, speed_rad_s = sweep_at(passed_s)
            wanted, speed = start_rad.copy(), np.zeros(3)
            wanted[joint] += offset_rad
            speed[joint] = speed_rad_s
            return self.draw(wanted, speed)

        rows = self.last(sum(_PERIODS_S), step)
        return Sweep(
            joint,
            np.array([row.time_s for row in rows]),
            np.array([row.joint_rad for row in rows]),
            np.array([row.setpoint_A for row in rows]),
            np.array([row.measured_A for row in rows]),
        )

    def require_polarity(self, joint: int) -> None:
        """Pushes one joint, which gives way in a loose hand, both ways and twice: it must go where it is pushed. Raises StepError."""
        name = arm.JOINTS[joint]
        for _ in range(_PUSH_TIMES):
            ways = [sign * self._give_rad(joint, sign * _PUSH_N_M) for sign in (1.0, -1.0)]
            told = f"it went {1e3 * ways[0]:+.1f} and {1e3 * ways[1]:+.1f} mrad along pushes of {1e3 * _PUSH_N_M:g} mN m either way"
            if max(ways) < -_GIVES_RAD:
                raise StepError(f"motor of the {name} is reversed: {told}")
            if min(ways) < _GIVES_RAD:
                raise StepError(f"the {name} does not move as its motor pushes: {told}, must be at least {1e3 * _GIVES_RAD:g}; hold the tool loosely and still; is the motor connected?")

    def _give_rad(self, joint: int, most_N_m: float) -> float:
        """How far a joint has gone when the torque, growing from nothing, has moved it far enough, or is at its most."""
        before_rad = self.last(_REST_S, lambda _: self._exert(joint, 0.0))[-1].joint_rad[joint]
        gone_rad = 0.0

        def step(passed_s: float) -> Sample:
            nonlocal gone_rad
            now = self._exert(joint, most_N_m * min(1.0, passed_s / _PUSH_S) if abs(gone_rad) < _ENOUGH_RAD else 0.0)
            if abs(gone_rad) < _ENOUGH_RAD:
                gone_rad = float(now.joint_rad[joint] - before_rad)
            return now

        self.last(_PUSH_S, step)
        return gone_rad

    def _exert(self, joint: int, torque_N_m: float) -> Sample:
        """One sample, and the tip force that is this torque of one joint and none of the others."""
        now = self.sample()
        self._push(now, torque_N_m * np.eye(3)[joint])
        return now

    def _push(self, now: Sample, torque_N_m: Floats) -> None:
        self._calibration.board.push(np.linalg.solve(arm.jacobian_m(now.joint_rad).T, torque_N_m))


def sweep_at(passed_s: float) -> tuple[float, float]:
    """Where a joint shall be since its sweep's beginning, and how fast it shall go there: whole periods one after the other."""
    for period_s in _PERIODS_S:
        if passed_s < period_s:
            break
        passed_s -= period_s
    else:
        return 0.0, 0.0
    rate = 2 * math.pi / period_s
    return _AMPLITUDE_RAD * math.sin(rate * passed_s), _AMPLITUDE_RAD * rate * math.cos(rate * passed_s)


def radians(values: Floats) -> str:
    return ", ".join(f"{value:+.3f}" for value in values) + " rad"
