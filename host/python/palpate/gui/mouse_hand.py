"""The mouse as the hand: moving it moves the hand level, with the left button or the wheel up and down."""

import numpy as np
import polyscope as ps
import polyscope.imgui as psim
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_WHEEL_m = 0.001  # a notch
_DRAG_m_pixel = 1e-4


def on_level(origin_m: Floats, direction: Floats, z_m: float) -> Floats | None:
    """Where a ray meets the plane of that height; None where it does not, or behind the eye."""
    if abs(direction[2]) < 1e-6:
        return None
    distance_m = (z_m - origin_m[2]) / direction[2]
    if distance_m <= 0.0:
        return None
    return np.asarray(origin_m + distance_m * direction)


class MouseHand:
    """Follows the mouse while `enabled`; the camera follows it otherwise."""

    def __init__(self) -> None:
        self.enabled = False
        self.target_m: Floats = np.zeros(3)

    def begin(self, target_m: Floats) -> None:
        """The hand is there."""
        self.target_m = np.array(target_m, dtype=np.float64)

    def enable(self, enabled: bool) -> None:
        """The camera does not move with a mouse that is the hand."""
        self.enabled = enabled
        ps.set_do_default_mouse_interaction(not enabled)

    def moved(self) -> Floats | None:
        """A new target, or None."""
        io = psim.GetIO()
        if not self.enabled or io.WantCaptureMouse:
            return None
        dx, dy = io.MouseDelta
        target_m = self.target_m.copy()
        if io.MouseWheel:
            target_m[2] += io.MouseWheel * _WHEEL_m
        elif psim.IsMouseDown(0):
            target_m[2] -= dy * _DRAG_m_pixel
        elif dx or dy:
            # Differences of rays, not the ray itself: the hand does not jump to the mouse.
            x, y = io.MousePos
            here, before = (self._on_level(x, y), self._on_level(x - dx, y - dy))
            if here is None or before is None:
                return None
            target_m[:2] += (here - before)[:2]
        else:
            return None
        return target_m

    def _on_level(self, x: float, y: float) -> Floats | None:
        direction = np.asarray(ps.screen_coords_to_world_ray((x, y)), dtype=np.float64)
        eye_m = np.asarray(ps.get_view_camera_parameters().get_position(), dtype=np.float64)
        return on_level(eye_m, direction, float(self.target_m[2]))
