"""palpate.calibration.arm has the numbers and the kinematics of the simulated arm, which are those of shared/device."""

import re

import numpy as np
import pytest

from palpate import Plant
from palpate.calibration import arm
from palpate.paths import ROOT


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
    joint_rad, step_rad = np.array([0.2, -0.3, 0.4]), 1e-6
    for joint in range(3):
        step = step_rad * np.eye(3)[joint]
        slope_m = (arm.tip_m(joint_rad + step) - arm.tip_m(joint_rad - step)) / (2 * step_rad)
        np.testing.assert_allclose(arm.jacobian_m(joint_rad)[:, joint], slope_m, atol=1e-9)


def test_the_numbers_are_those_of_the_firmware() -> None:
    text = (ROOT / "shared/device/parameters.hpp").read_text("utf-8")
    ratios = [float(ratio) for ratio in re.findall(r"\{([\d.]+)f, counts_per_rad\(1024\.0f", text)]
    torque_N_m_A = arm.TORQUE_N_M_A / np.array(ratios)
    assert len(ratios) == 3
    np.testing.assert_allclose(arm.COUNTS_RAD, 4 * 1024 * np.array(ratios) / (2 * np.pi))
    assert np.ptp(torque_N_m_A) < 1e-12 and re.search(rf"\b{torque_N_m_A[0]:.4f}f", text), torque_N_m_A
