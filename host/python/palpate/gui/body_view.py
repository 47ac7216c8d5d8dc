"""The body, the patch, the tool and its contact in Polyscope's scene."""

from typing import Any, Literal

import numpy as np
import polyscope as ps
from numpy.typing import NDArray

from palpate.body import Body
from palpate.live import Contact, Picture
from palpate.stress import NodalStress

Floats = NDArray[np.float64]
Colouring = Literal["displacement", "stress", "activity", "nothing"]
COLOURINGS: tuple[Colouring, ...] = ("displacement", "stress", "activity", "nothing")
# (unit shown, shown per SI unit, smallest range in SI units, colour map)
UNITS: dict[str, tuple[str, float, float, str]] = {
    "displacement": ("mm", 1e3, 1e-3, "viridis"),
    "stress": ("kPa", 1e-3, 100.0, "plasma"),
    "activity": ("mm/s", 1e3, 1e-2, "magma"),
}
MODE_COLOURS = {"free": (0.55, 0.55, 0.55), "stick": (0.13, 0.62, 0.34), "slip": (0.93, 0.49, 0.10)}
_BODY = (0.80, 0.72, 0.66)
_PATCH = (0.95, 0.26, 0.40)
_NORMAL = (0.16, 0.40, 0.85)
_HAND = (0.35, 0.30, 0.55)
_FORCE_SCALE_m_N = 0.008
_CONE_CORNERS = 24
_COLOUR_BAR = (300.0, 20.0)  # pixels from the window's upper left corner
# Out of sight without a change of the scene's structures, which costs milliseconds.
_NOWHERE = np.array([0.0, 0.0, 1e3])


class BodyView:
    """Structures for one body; made anew for another. Lengths in m, device frame, z up. volume_m3: as for NodalStress."""

    def __init__(self, body: Body, volume_m3: float | Floats, tip_radius_m: float) -> None:
        ps.remove_all_structures()
        ps.set_automatically_compute_scene_extents(False)
        rest_m = body.rest_m
        low_m, high_m = rest_m.min(axis=0), rest_m.max(axis=0)
        size_m = float(np.linalg.norm(high_m - low_m))
        ps.set_length_scale(size_m)
        ps.set_bounding_box(low_m, high_m)
        self._rest_m = rest_m
        self._on_surface, corners = np.unique(body.triangles, return_inverse=True)
        self._stress = NodalStress(body, volume_m3)
        self._range = 0.0
        self._coloured_as = ""
        self.colouring: Colouring = "displacement"
        self._coloured: Colouring | None = None
        self._values: Floats = np.zeros(len(self._on_surface))
        self._mesh = ps.register_surface_mesh(
            "body", rest_m[self._on_surface], corners.reshape(-1, 3), color=_BODY, edge_width=1.0, smooth_shade=False
        )
        self._patch_nodes: NDArray[np.uint32] = np.zeros(0, dtype=np.uint32)
        self._patch: Any = None
        self._position_m = rest_m
        ball = {"material": "wax", "enabled": True}
        self._tip = ps.register_point_cloud("tip", _NOWHERE[None], color=MODE_COLOURS["free"], **ball)
        self._tip.set_radius(max(tip_radius_m, 0.0016), relative=False)
        self._hand = ps.register_point_cloud("hand", _NOWHERE[None], color=_HAND, **ball)
        self._hand.set_radius(0.004, relative=False)
        line = np.array([[0, 1]])
        two = np.vstack([_NOWHERE, _NOWHERE + 1e-6])
        self._grip = ps.register_curve_network("grip", two, line, color=_HAND)
        self._grip.set_radius(0.0005, relative=False)
        self._normal = ps.register_curve_network("normal force", two, line, color=_NORMAL)
        self._normal.set_radius(0.0008, relative=False)
        self._tangential = ps.register_curve_network("tangential force", two, line, color=MODE_COLOURS["slip"])
        self._tangential.set_radius(0.0008, relative=False)
        self._cone_shape = _cone()
        # Lines: a transparent surface makes Polyscope draw everything several times, which takes 20 times as long in
        # software.
        self._cone = ps.register_curve_network(
            "friction cone", self._cone_shape[0] + _NOWHERE, self._cone_shape[1], color=MODE_COLOURS["free"]
        )
        self._cone.set_radius(0.0003, relative=False)
        self._mode = "free"
        centre_m = 0.5 * (low_m + high_m) + [0.0, 0.0, 0.12 * (high_m[2] - low_m[2])]
        ps.look_at(centre_m + size_m * np.array([0.42, -1.30, 0.62]), centre_m)

    @property
    def top_m(self) -> float:
        """z of the body's highest node at rest."""
        return float(self._rest_m[:, 2].max())

    @property
    def range(self) -> tuple[float, str]:
        """Top of the colour scale, and its unit; 0 and none before anything is coloured like that."""
        if self.colouring == "nothing" or self.recolour:
            return 0.0, ""
        return self._range, UNITS[self.colouring][0]

    @property
    def recolour(self) -> bool:
        """The colouring has changed since `show`."""
        return self.colouring != self._coloured

    def show(self, picture: Picture) -> None:
        """The body of a picture."""
        self._position_m = picture.position_m
        self._mesh.update_vertex_positions(picture.position_m[self._on_surface])
        self._show_patch(picture.patch_nodes)
        if self.colouring != "nothing":
            self._values = self._measure(picture)[self._on_surface]
        self._colour()

    def _measure(self, picture: Picture) -> Floats:
        if self.colouring == "stress":
            return self._stress.von_mises_Pa(picture.position_m)
        of = picture.velocity_m_s if self.colouring == "activity" else picture.position_m - self._rest_m
        return np.asarray(np.linalg.norm(of, axis=1))

    def _colour(self) -> None:
        if self.colouring == "nothing":
            if self._coloured != "nothing":
                self._mesh.remove_all_quantities()
            self._coloured = "nothing"
            return
        unit, factor, smallest, cmap = UNITS[self.colouring]
        values = self._values * factor
        largest = float(values.max(initial=0.0))
        # A new range compiles a shader, which takes tens of milliseconds: only where it no longer fits.
        fits = 0.3 * self._range < largest <= self._range or largest <= self._range <= smallest * factor
        if self.colouring == self._coloured and fits:
            self._mesh.get_quantity_buffer(self._coloured_as, "values").update_data(values)
            return
        self._range = _round_up(max(largest, smallest * factor))
        if self._coloured is not None and self.colouring != self._coloured:
            self._mesh.remove_all_quantities()
        self._coloured, self._coloured_as = self.colouring, f"{self.colouring} ({unit})"
        self._mesh.add_scalar_quantity(
            self._coloured_as,
            values,
            enabled=True,
            vminmax=(0.0, self._range),
            cmap=cmap,
            onscreen_colorbar_enabled=True,
            onscreen_colorbar_location=_COLOUR_BAR,
        )

    def _show_patch(self, nodes: NDArray[np.uint32]) -> None:
        if len(nodes) != len(self._patch_nodes):
            # Another number of points is another structure.
            self._patch = None
            if len(nodes):
                self._patch = ps.register_point_cloud("patch", self._position_m[nodes], color=_PATCH)
                self._patch.set_radius(0.0011, relative=False)
            elif ps.has_point_cloud("patch"):
                ps.remove_point_cloud("patch")
        elif self._patch is not None:
            self._patch.update_point_positions(self._position_m[nodes])
        self._patch_nodes = nodes

    def touch(self, contact: Contact, show_cone: bool) -> None:
        """Tool, hand and the body's force on the tool: blue its part along the normal, in the mode's colour that along the
        surface; the friction cone around the normal, as high as its part."""
        tip_m, hand_m = contact.tip_m, contact.hand_m
        self._tip.update_point_positions(tip_m[None])
        self._hand.update_point_positions(hand_m[None])
        self._grip.update_node_positions(np.vstack([hand_m, tip_m]))
        pressing_N = -float(contact.force_N @ contact.normal)
        if contact.mode == "free" or pressing_N <= 0.0:
            hidden = np.vstack([_NOWHERE, _NOWHERE + 1e-6])
            self._normal.update_node_positions(hidden)
            self._tangential.update_node_positions(hidden)
        else:
            along_m = contact.normal * (pressing_N * _FORCE_SCALE_m_N)
            across_m = (contact.force_N + contact.normal * pressing_N) * -_FORCE_SCALE_m_N
            self._normal.update_node_positions(np.vstack([tip_m, tip_m + along_m]))
            # At the end of the other: inside the cone the contact sticks.
            self._tangential.update_node_positions(np.vstack([tip_m + along_m, tip_m + along_m + across_m + 1e-9]))
        if contact.mode != self._mode:
            colour = MODE_COLOURS[contact.mode]
            self._tip.set_color(colour)
            self._tangential.set_color(colour)
            self._cone.set_color(colour)
            self._mode = contact.mode
        if show_cone and contact.mode != "free" and pressing_N > 0.0 and contact.friction > 0.0:
            length_m = pressing_N * _FORCE_SCALE_m_N
            radius_m = contact.friction * length_m
            shape_m = self._cone_shape[0] * [radius_m, radius_m, length_m]
            self._cone.update_node_positions(tip_m + _turned(shape_m, contact.normal))
        else:
            self._cone.update_node_positions(self._cone_shape[0] * 1e-6 + _NOWHERE)


def _round_up(value: float) -> float:
    """To 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * (1.0 - 1e-9)))


def _cone() -> tuple[Floats, NDArray[np.int64]]:
    """The rim of a cone of height 1 and radius 1 around z, its point in the origin, and some lines from there: points and
    pairs of them."""
    angle = np.linspace(0.0, 2.0 * np.pi, _CONE_CORNERS, endpoint=False)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.ones(_CONE_CORNERS)])
    first = np.arange(1, _CONE_CORNERS + 1)
    around = np.column_stack([first, np.roll(first, -1)])
    up = np.column_stack([np.zeros_like(first), first])[::3]
    return np.vstack([np.zeros(3), rim]), np.vstack([around, up])


def _turned(points: Floats, z_axis: Floats) -> Floats:
    """The points in a frame whose z axis is that unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(z_axis)))]
    x_axis = np.cross(helper, z_axis)
    x_axis /= np.linalg.norm(x_axis)
    return np.asarray(points @ np.vstack([x_axis, np.cross(z_axis, x_axis), z_axis]))
