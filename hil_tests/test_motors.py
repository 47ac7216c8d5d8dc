"""What motors and their supply do to a run: heat folds the currents, an amplifier that does not follow and a low supply switch off (docs/safety.md)."""

import numpy as np
import pytest
from loop_scene import Run, run, scene

MODE_FAULT = 4
CURRENT_TRACKING, SUPPLY_LOW = 1 << 12, 1 << 13
FOLD_BEGINS, PEAK_A, CONTINUOUS_A = 0.8, 7.0, 1.24  # firmware/core/supervisor.hpp, as what follows
WINDING_SHARE, WINDING_S, HOUSING_S, TRACKING_A, TRACKING_TICKS = 0.25, 12.0, 900.0, 1.5, 10
# A force of 8 N, held: of a body that is as stiff as that of the fault matrix.
STIFF = """
[body]
nodes = [6, 6, 6]
origin_m = [-0.025, -0.025, -0.07]
fixed_faces = ["z-"]
stiffness_N_m = 450.0
"""
PRESS = """
[path]
waypoints = [
  { time_s = 0.1, position_m = [0.0, 0.002, -0.0195] },
  { time_s = 0.6, position_m = [0.0, 0.002, -0.029] },
]
[model]
builder = "hybrid"
"""


def press(tmp_path, extra: str = "", *, duration_s: float) -> Run:
    return run(tmp_path, scene(extra, duration_s=duration_s, body=STIFF, path=PRESS, board="native"))


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return press(tmp_path_factory.mktemp("held"), duration_s=3.5)


def heat(current_A: np.ndarray) -> np.ndarray:
    """(ticks,) of the hottest motor at the start of each tick, by the equations of firmware/core/motor_heat.hpp in double precision."""
    winding, housing, out = np.zeros(3), np.zeros(3), []
    for square in (current_A / CONTINUOUS_A) ** 2:
        winding = winding + (square - winding) * 1e-3 / WINDING_S
        housing = housing + (winding - housing) * 1e-3 / HOUSING_S
        out.append((WINDING_SHARE * winding + (1 - WINDING_SHARE) * housing).max())
    return np.array([0.0, *out[:-1]])


def test_a_held_peak_folds_back(held):
    assert held.summary["faults"] == 0 and np.all(held["ticks/enabled"][100:] == 1)
    current_A = np.abs(held["ticks/setpoint_A"])
    at_start = heat(current_A)
    assert at_start.max() > FOLD_BEGINS + 0.05
    largest_A = PEAK_A - (PEAK_A - CONTINUOUS_A) * np.clip((at_start - FOLD_BEGINS) / (1 - FOLD_BEGINS), 0, 1)
    # Housings are told every 64 ticks: heat is off by 2e-4 at most, of 0.2 between the ends.
    assert np.all(current_A.max(axis=1) <= largest_A + 0.01)
    folded = current_A.max(axis=1) > largest_A - 0.01
    assert np.count_nonzero(folded) > 300
    # The force weakens; it is never cut.
    assert np.abs(np.diff(current_A[folded].max(axis=1))).max() < 0.05
    assert current_A[-1].max() < 0.6 * current_A.max()


def test_an_amplifier_that_does_not_follow_is_a_fault(tmp_path, held):
    stuck = press(tmp_path, "[device]\namplifier_peak_A = 0.5", duration_s=0.6)
    on = stuck["ticks/enabled"] == 1
    error_A = np.zeros(len(on))
    error_A[1:] = np.abs(stuck["ticks/measured_current_A"][1:] - stuck["ticks/setpoint_A"][:-1]).max(axis=1) * on[:-1]
    (first, *_) = np.flatnonzero(error_A > TRACKING_A)
    assert np.all(error_A[first : first + TRACKING_TICKS] > TRACKING_A)
    assert not np.any(on[first + TRACKING_TICKS - 1 :]) and on[first + TRACKING_TICKS - 2]
    assert np.all(stuck["ticks/faults"][first + TRACKING_TICKS - 1 :] == CURRENT_TRACKING)
    # With amplifiers that do, the difference is far from that, though the same force is asked for.
    good_A = np.abs(held["ticks/measured_current_A"][1:] - held["ticks/setpoint_A"][:-1])[held["ticks/enabled"][:-1] == 1]
    assert good_A.max() < 0.01


def test_a_low_supply_cuts_in_its_tick_and_latches(tmp_path):
    low = press(tmp_path, "[board.faults]\nsupply_low_ticks = [200]", duration_s=0.3)
    assert low["ticks/enabled"][199] == 1 and not np.any(low["ticks/enabled"][200:])
    assert not np.any(low["ticks/setpoint_A"][200:])
    assert np.all(low["ticks/faults"][200:] == SUPPLY_LOW) and np.all(low["ticks/mode"][200:] == MODE_FAULT)
