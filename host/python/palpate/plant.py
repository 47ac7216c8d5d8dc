"""The simulated device in Python: arm, amplifiers and the hand that holds the tool."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.body import Floats, Ints, vector3
from palpate.scene import Scene, load_scene, make_scene

_TICK_S = 1e-3
# A plant needs no body; a scene does.
_SOME_BODY = {"nodes": [2, 2, 2], "fixed_faces": ["z-"]}


class Plant:
    """What the firmware finds at its encoders and amplifiers: an arm of three joints in a hand that follows a path.

    `Plant([(0.0, (0, 0, 0.02)), (1.0, (0, 0, 0))])` moves between waypoints (time in s, place in the device frame in m) with
    least jerk; hand and device are the keys of those sections of a scene (docs/scenes.md). One thread. Equal calls give equal
    bits on one machine. Raises SceneError for keys out of range, ValueError for places that the arm cannot reach.
    """

    def __init__(
        self,
        path: Sequence[tuple[float, Sequence[float]]] | Scene,
        *,
        hand: Mapping[str, Any] | None = None,
        device: Mapping[str, Any] | None = None,
    ) -> None:
        if isinstance(path, Scene):
            self.scene = path
        else:
            points = [{"time_s": float(time_s), "position_m": list(place)} for time_s, place in path]
            given = {"body": _SOME_BODY, "path": {"waypoints": points}, "hand": dict(hand or {}), "device": dict(device or {})}
            self.scene = make_scene(given, name="Plant")
        self.scene.require_path()
        self._core = _core.Plant(self.scene.to_dict())

    @classmethod
    def from_scene(cls, file: str | Path, overrides: Mapping[str, Any] | None = None) -> Self:
        """Of a scene file's [path], [hand] and [device]."""
        return cls(load_scene(Path(file), overrides))

    def advance(self, setpoint_A: ArrayLike, enabled: bool = True, duration_s: float = _TICK_S) -> None:
        """Lets duration_s pass (a servo tick by default) with constant currents (3,) wanted of the amplifiers; enabled False
        means no current. Raises ValueError for what is not finite or out of range, and where a scripted path leaves the
        arm's workspace."""
        self._core.advance(vector3("setpoint_A", setpoint_A).tolist(), enabled, duration_s)

    def set_grip(self, grip: float) -> None:
        """How firmly the hand holds the tool from now on, in [0, 1]."""
        self._core.set_grip(grip)

    def guide(self, target_m: ArrayLike) -> None:
        """From now on the hand means to be there (3,), device frame, whatever the path is. Raises ValueError for what is not finite and
        for a hand that is none (of another kind than impedance)."""
        self._core.guide(vector3("target_m", target_m).tolist())

    @property
    def time_s(self) -> float:
        """How long it has been advanced."""
        return self._core.time_s

    @property
    def encoder_counts(self) -> Ints:
        """(3,): what the board reads; docs/units_and_frames.md has the sign of each joint."""
        return self._core.encoder_counts

    @property
    def measured_current_A(self) -> NDArray[np.float32]:
        """(3,): what the board measures at the motors."""
        return self._core.measured_current_A

    @property
    def joint_rad(self) -> Floats:
        """(3,): true angles of the joints."""
        return self._core.joint_rad

    @property
    def joint_rad_s(self) -> Floats:
        """(3,): true angular velocities."""
        return self._core.joint_rad_s

    @property
    def tip_m(self) -> Floats:
        """(3,): where the tip truly is, device frame."""
        return self._core.tip_m

    @property
    def tip_velocity_m_s(self) -> Floats:
        """(3,): its velocity, device frame."""
        return self._core.tip_velocity_m_s

    @property
    def intended_m(self) -> Floats:
        """(3,): where the hand means it to be now, device frame."""
        return self._core.intended_m

    @property
    def hand_force_N(self) -> Floats:
        """(3,): of the hand on the tool, device frame."""
        return self._core.hand_force_N
