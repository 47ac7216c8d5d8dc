"""Friction and weight of a joint from a slow sweep of it alone: least squares on torque = C sign(v) + V v + I a + G w(angle), V not negative."""

from dataclasses import dataclass

import numpy as np
import scipy.signal  # type: ignore[import-untyped, unused-ignore]

from palpate.body import Floats

_GRID_s = 5e-3
_WINDOW = 21  # points of the grid, 0.1 s: a count is 0.14 mrad, and the sweep's shortest period 2 s
_ORDER = 3
# Slower, a joint may stick, and friction is not what it is in motion.
SLOWEST_rad_s = 0.1


@dataclass(frozen=True)
class JointFit:
    """coulomb_N_m, viscous_N_m_s (per rad/s), inertia_kg_m2, gravity_N_m: largest torque of the weight, NaN where it was not asked for. residual_N_m:
    root mean square of what the fit leaves; fastest_rad_s; samples: used."""

    coulomb_N_m: float
    viscous_N_m_s: float
    inertia_kg_m2: float
    gravity_N_m: float
    residual_N_m: float
    fastest_rad_s: float
    samples: int


def fit_joint(time_s: Floats, angle_rad: Floats, torque_N_m: Floats, weight: Floats | None) -> JointFit:
    """Of one joint's sweep, all (n,): the motor's torque, and by what its weight goes with the pose (None: it has none).

    Angle and torque go through the same smoothing polynomial, so neither lags behind the other. Raises ValueError where too little of
    the sweep was in motion.
    """
    grid_s = np.arange(time_s[0], time_s[-1], _GRID_s)
    if len(grid_s) < 4 * _WINDOW:
        raise ValueError(f"{time_s[-1] - time_s[0]:.2f} s of samples: must be at least {4 * _WINDOW * _GRID_s:.2f} s")

    def smooth(values: Floats, derivative: int = 0) -> Floats:
        on_grid = np.interp(grid_s, time_s, values)
        return np.asarray(scipy.signal.savgol_filter(on_grid, _WINDOW, _ORDER, deriv=derivative, delta=_GRID_s), np.float64)

    speed_rad_s = smooth(angle_rad, 1)
    inner = np.zeros(len(grid_s), bool)
    inner[_WINDOW:-_WINDOW] = True  # the filter's ends extrapolate
    moves = inner & (np.abs(speed_rad_s) > SLOWEST_rad_s)
    # No window over a reversal, where friction jumps.
    reverses = np.convolve(np.abs(speed_rad_s) <= SLOWEST_rad_s / 2, np.ones(_WINDOW), "same") > 0
    used = moves & ~reverses
    columns = [np.sign(speed_rad_s), speed_rad_s, smooth(angle_rad, 2)]
    if weight is not None:
        columns.append(smooth(weight))
    if used.sum() < 100:
        raise ValueError(f"only {used.sum() * _GRID_s:.2f} s of motion above {SLOWEST_rad_s:g} rad/s: must be at least {100 * _GRID_s:g} s")
    matrix, torques = np.stack(columns, 1)[used], smooth(torque_N_m)[used]
    solution = np.linalg.lstsq(matrix, torques, rcond=None)[0]
    if solution[1] < 0.0:  # no friction drives: noise, which Coulomb's part would have to make good
        kept = [column for column in range(matrix.shape[1]) if column != 1]
        solution[1], solution[kept] = 0.0, np.linalg.lstsq(matrix[:, kept], torques, rcond=None)[0]
    residual = float(np.sqrt(np.mean((matrix @ solution - torques) ** 2)))
    gravity = float(solution[3]) if weight is not None else float("nan")
    coulomb, viscous, inertia = (float(value) for value in solution[:3])
    return JointFit(coulomb, viscous, inertia, gravity, residual, float(np.abs(speed_rad_s[used]).max()), int(used.sum()))
