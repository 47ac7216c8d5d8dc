"""Meshes of the example scenes, made in code; lengths in m. `host/bench/example_meshes.py` writes them to scenes/meshes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.mesh.fill import fill, fill_layers
from palpate.mesh.geometry import boundary, neighbours_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# An icosahedron: triangles counter-clockwise seen from outside.
_GOLDEN = 0.5 * (1.0 + 5.0**0.5)
_CORNERS = (
    (-1, _GOLDEN, 0), (1, _GOLDEN, 0), (-1, -_GOLDEN, 0), (1, -_GOLDEN, 0), (0, -1, _GOLDEN), (0, 1, _GOLDEN),
    (0, -1, -_GOLDEN), (0, 1, -_GOLDEN), (_GOLDEN, 0, -1), (_GOLDEN, 0, 1), (-_GOLDEN, 0, -1), (-_GOLDEN, 0, 1),
)  # fmt: skip
_TRIANGLES = (
    (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8),
    (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1),
)  # fmt: skip


@dataclass(frozen=True)
class Surface:
    """point_m (n, 3); triangles (t, 3), counter-clockwise seen from outside."""

    point_m: Floats
    triangles: Ints


@dataclass(frozen=True)
class Regions:
    """point_m (n, 3); tetrahedra (t, 4) with the region of each (t,), a number; triangles (s, 3) with theirs; names: of numbers,
    for tetrahedra and for triangles."""

    point_m: Floats
    tetrahedra: Ints
    region: Ints
    triangles: Ints
    triangle_region: Ints
    names: dict[int, str]
    triangle_names: dict[int, str]


def sphere(radius_m: float, halvings: int = 3) -> Surface:
    """An icosahedron, each edge halved so many times and put on the sphere."""
    point = np.array(_CORNERS) / np.linalg.norm(_CORNERS[0])
    triangles = np.array(_TRIANGLES, dtype=np.int64)
    for _ in range(halvings):
        edges, number = np.unique(
            np.sort(triangles[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
        )
        middle = point[edges].sum(axis=1)
        ab, bc, ca = (number.reshape(-1, 3) + len(point)).T
        a, b, c = triangles.T
        point = np.vstack([point, middle / np.linalg.norm(middle, axis=1)[:, None]])
        triangles = np.vstack([np.column_stack(t) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return Surface(radius_m * point, triangles)


def liver_surface() -> Surface:
    """A blob like a liver, 150 mm long: a thick lobe at -x that tapers to a thin one at +x, a notch in the front edge, and a flat
    underside. Nobody's in particular."""
    ball = sphere(1.0, 4)
    x, y, z = ball.point_m.T
    taper = 1.0 - 0.35 * np.clip(x, -0.4, 1.0)
    notch = 1.0 - 0.25 * np.exp(-12.0 * ((x - 0.25) ** 2 + (y + 1.0) ** 2))
    point_m = np.column_stack([0.075 * x, 0.045 * y * taper**0.5 * notch, 0.032 * z * taper])
    point_m[:, 2] = np.where(z < 0.0, 0.55, 1.0) * point_m[:, 2]
    return Surface(point_m, ball.triangles)


def liver(cell_m: float = 0.01) -> Regions:
    """The blob filled: region 1, "capsule", of the tetrahedra with a face on the surface; 2, "parenchyma", of those within; of
    triangles 3, "ligament", the middle of the underside."""
    surface = liver_surface()
    point_m, tetrahedra = fill(surface.point_m, surface.triangles, cell_m)
    shared = np.bincount(neighbours_of(tetrahedra).ravel(), minlength=len(tetrahedra))
    outer = boundary(tetrahedra)
    middle_m = point_m[outer].mean(axis=1)
    held = outer[(middle_m[:, 2] < -0.012) & (np.hypot(middle_m[:, 0], middle_m[:, 1]) < 0.04)]
    return Regions(
        point_m,
        tetrahedra,
        np.where(shared < 4, 1, 2),
        held,
        np.full(len(held), 3),
        {1: "capsule", 2: "parenchyma"},
        {3: "ligament"},
    )


# Of the layered block, from below: thickness and the region's number.
SKIN_LAYERS = ((0.016, 1), (0.012, 2), (0.006, 3))


def skin(side_m: float = 0.08, cell_m: float = 0.009) -> Regions:
    """A block of layers, its top in the plane z = 0 and its middle in x = y = 0: 1, "muscle", 2, "fat" and 3, "skin". Meshed by
    gmsh: of cells cut into six tetrahedra each, springs by the rule are up to 1.4 times too stiff along the cells' edges."""
    layers = [(thickness_m, number) for thickness_m, number in SKIN_LAYERS]
    point_m, tetrahedra, layer = fill_layers(side_m, [thickness_m for thickness_m, _ in layers], cell_m)
    region = np.array([number for _, number in layers])[layer]
    none = np.zeros((0, 3), dtype=np.int64)
    return Regions(point_m, tetrahedra, region, none, none[:, 0], {1: "muscle", 2: "fat", 3: "skin"}, {})
