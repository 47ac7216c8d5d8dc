"""The mesh of a scene's body: the keys of [body.mesh], with their units, defaults, ranges and meanings."""

from dataclasses import dataclass

from palpate.scene_schema import ListOf, Number, TablesOf, Text, Vector, key
from palpate.tip_path import MAX_POSITION_M

_COORDINATE = Number(-MAX_POSITION_M, MAX_POSITION_M)
_PLACE = Vector((3,), _COORDINATE)
YOUNG_MODULUS = Number(1.0, 1e9)
DENSITY = Number(1.0, 1e5)
DAMPING_RATIO = Number(0.0, 100.0)
# A thinner tetrahedron's springs hardly resist the motion that flattens it, and its short edges want short steps. Regular: 70.5
# degrees; those of gmsh's fills are above 15.
MIN_ANGLE_DEG = 5.0


@dataclass(frozen=True, kw_only=True)
class MeshRegion:
    """A region of the mesh with a material of its own; what it leaves out is the mesh's."""

    name: str = key(Text(), "of a physical group of tetrahedra (Gmsh), or a number in the cells' data, as text")
    young_modulus_Pa: float | None = key(
        YOUNG_MODULUS, "Young's modulus", unit="Pa", default=None, default_text="the mesh's"
    )
    density_kg_m3: float | None = key(DENSITY, "density", unit="kg/m³", default=None, default_text="the mesh's")
    damping_ratio: float | None = key(
        DAMPING_RATIO, "damping of the springs, as `body.damping_ratio`", default=None, default_text="the body's"
    )


@dataclass(frozen=True, kw_only=True)
class FixedBox:
    """A box whose nodes are fixed."""

    from_m: tuple[float, ...] = key(_PLACE, "lowest corner in the device frame", unit="m")
    to_m: tuple[float, ...] = key(_PLACE, "highest corner; no coordinate less than that of `from_m`", unit="m")


@dataclass(frozen=True, kw_only=True)
class FixedPlane:
    """A plane on and behind which nodes are fixed."""

    point_m: tuple[float, ...] = key(_PLACE, "a point of it in the device frame", unit="m")
    normal: tuple[float, ...] = key(
        Vector((3,), Number(-1.0, 1.0)), "points to the side that stays free; any length but 0"
    )


@dataclass(frozen=True, kw_only=True)
class BodyMesh:
    """A mesh in place of a lattice."""

    file: str = key(
        Text(),
        "tetrahedra (Gmsh's .msh; .vtk, .vtu) or a closed surface (.obj, .stl, .msh, .vtk, .vtu), beside the scene unless the "
        "path is absolute",
    )
    scale_m: float = key(Number(0.0, 1e3, open_low=True), "a unit of the file; 0.001: millimetres", unit="m", default=1.0)
    cell_m: float | None = key(
        Number(0.0, 0.5, open_low=True),
        "of a surface: length of edges with which it is meshed anew and filled; not of tetrahedra",
        unit="m",
        default=None,
        default_text="the surface's own triangles",
    )
    young_modulus_Pa: float = key(
        YOUNG_MODULUS, "Young's modulus; Poisson's ratio is 1/4 in every network of springs", unit="Pa", default=1e4
    )
    density_kg_m3: float = key(DENSITY, "density", unit="kg/m³", default=1000.0)
    regions: tuple[MeshRegion, ...] = key(
        TablesOf(MeshRegion, 1000), "regions of the mesh with materials of their own; each must be in the mesh", default=()
    )
    fixed_regions: tuple[str, ...] = key(
        ListOf(Text(), 1000), "names of regions, of tetrahedra or triangles, whose nodes are fixed", default=()
    )
    fixed_boxes: tuple[FixedBox, ...] = key(TablesOf(FixedBox, 1000), "boxes whose nodes are fixed", default=())
    fixed_planes: tuple[FixedPlane, ...] = key(
        TablesOf(FixedPlane, 1000), "planes on and behind which nodes are fixed", default=()
    )
    min_angle_deg: float = key(
        Number(0.1, 60.0),
        "smallest angle between two faces of a tetrahedron, and from 180 degrees: a sharper one is refused by name",
        unit="°",
        default=MIN_ANGLE_DEG,
    )
