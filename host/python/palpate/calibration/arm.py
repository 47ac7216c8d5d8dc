"""The arm's nominal numbers and kinematics that a calibration needs: those of shared/device, by the core."""

import numpy as np

from palpate import _core
from palpate.body import Floats

JOINTS = ("base", "upper arm", "forearm")
TORQUE_N_M_A: Floats = _core.arm_torque_N_m_A()  # of a joint, by its motor's current
COUNTS_RAD: Floats = _core.arm_counts_rad()


def tip_m(joint_rad: Floats) -> Floats:
    """Where the tip is, device frame, at joint angles (3,)."""
    return _core.arm_tip_m(np.asarray(joint_rad, np.float64).tolist())


def jacobian_m(joint_rad: Floats) -> Floats:
    """d tip / d joint angle, (3, 3)."""
    return _core.arm_jacobian_m(np.asarray(joint_rad, np.float64).tolist())
