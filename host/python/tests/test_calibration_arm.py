"""palpate.calibration.arm: the arm of shared/device through the core, held against the simulated one."""

import numpy as np
import pytest

from palpate import Plant
from palpate.calibration import arm


@pytest.mark.parametrize("place_m", [(0.02, 0.01, -0.03), (-0.05, 0.04, 0.02), (0.0, -0.03, 0.04)])
def test_the_tip_is_where_the_simulated_arm_has_it(place_m: tuple[float, float, float]) -> None:
    plant = Plant([(0.0, (0.0, 0.0, 0.0)), (0.5, place_m)], hand={"kind": "scripted"})
    for _ in range(600):
        plant.advance(np.zeros(3), False)
    assert np.linalg.norm(plant.tip_m - np.array(place_m)) < 1e-3
    # Half a count of each joint is 15 um at the tip.
    joint_rad = plant.encoder_counts / arm.COUNTS_RAD
    np.testing.assert_allclose(arm.tip_m(joint_rad), plant.tip_m, atol=60e-6)


def test_the_jacobian_is_the_derivative_of_the_tip() -> None:
    joint_rad, step_rad = np.array([0.2, -0.3, 0.4]), 1e-2
    for joint in range(3):
        step = step_rad * np.eye(3)[joint]
        slope_m = (arm.tip_m(joint_rad + step) - arm.tip_m(joint_rad - step)) / (2 * step_rad)
        # A sixth of the third derivative, 0.4 m at most, times the step squared; rounding in single precision is below 3 um.
        np.testing.assert_allclose(arm.jacobian_m(joint_rad)[:, joint], slope_m, atol=1e-5)


def test_the_numbers_are_of_the_parts() -> None:
    """docs/sources.md: 1,024 lines and the ratios of a Premium; a Maxon RE 25."""
    ratio = np.array([13.3, 11.2, 11.2])
    np.testing.assert_allclose(arm.COUNTS_RAD, 4 * 1024 * ratio / (2 * np.pi), rtol=1e-6)
    np.testing.assert_allclose(arm.TORQUE_N_M_A, 0.0234 * ratio, rtol=1e-6)


def test_an_angle_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="joint_rad: must be three finite angles"):
        arm.tip_m(np.array([0.0, float("nan"), 0.0]))
