"""The arm's nominal numbers that a calibration needs: shared/device/parameters.hpp, and the kinematics of shared/device/arm.cpp."""

import numpy as np

from palpate.body import Floats

JOINTS = ("base", "upper arm", "forearm")
UPPER_ARM_M, FOREARM_M = 0.215, 0.170
_RATIO = np.array([13.3, 11.2, 11.2])
_TORQUE_CONSTANT_N_M_A = 0.0234
TORQUE_N_M_A = _RATIO * _TORQUE_CONSTANT_N_M_A  # of a joint, by its motor's current
COUNTS_RAD = 4 * 1024 * _RATIO / (2 * np.pi)


def tip_m(joint_rad: Floats) -> Floats:
    """Where the tip is, device frame, at joint angles (3,)."""
    (s1, s2, s3), (c1, c2, c3) = np.sin(joint_rad), np.cos(joint_rad)
    reach = UPPER_ARM_M * c2 + FOREARM_M * s3
    return np.array([s1 * reach, UPPER_ARM_M - c1 * reach, FOREARM_M * (1 - c3) + UPPER_ARM_M * s2])


def jacobian_m(joint_rad: Floats) -> Floats:
    """d tip / d joint angle, (3, 3)."""
    (s1, s2, s3), (c1, c2, c3) = np.sin(joint_rad), np.cos(joint_rad)
    reach = UPPER_ARM_M * c2 + FOREARM_M * s3
    radial_2, radial_3 = -UPPER_ARM_M * s2, FOREARM_M * c3
    return np.array([
        [c1 * reach, s1 * radial_2, s1 * radial_3],
        [s1 * reach, -c1 * radial_2, -c1 * radial_3],
        [0.0, UPPER_ARM_M * c2, FOREARM_M * s3],
    ])  # fmt: skip
