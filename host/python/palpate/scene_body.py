"""The body of a scene: the keys of [body], with their units, defaults, ranges and meanings."""

from dataclasses import dataclass

from palpate.scene_mesh import BodyMesh
from palpate.scene_schema import Choice, Integer, ListOf, Number, TablesOf, Vector, key, section
from palpate.tip_path import MAX_POSITION_M, MAX_TIME_S

MAX_NODES_PER_AXIS = 64

COORDINATE = Number(-MAX_POSITION_M, MAX_POSITION_M)
_NODES = Vector((2, 3), Integer(2, MAX_NODES_PER_AXIS))
_NODE = Vector((2, 3), Integer(0, MAX_NODES_PER_AXIS - 1))
_FACES = ("x-", "x+", "y-", "y+", "z-", "z+")
_MASS = Number(0.0, 10.0, open_low=True)
_STIFFNESS = Number(0.0, 1e6, open_low=True)
_DAMPING_RATIO = Number(0.0, 100.0)
_DAMPING = Number(0.0, 1e5)


def nodes_requirement() -> str:
    """What `nodes` must be where there is no mesh."""
    return _NODES.requirement("")


@dataclass(frozen=True, kw_only=True)
class InitialDisplacement:
    """One node that starts away from its place of rest, at rest in velocity."""

    node: tuple[int, ...] = key(_NODE, "indices [i, j, k] of the node; [i, k] in two dimensions")
    displacement_m: tuple[float, ...] = key(
        Vector((2, 3), COORDINATE), "displacement [x, y, z]; [x, z] in two dimensions", unit="m"
    )


@dataclass(frozen=True, kw_only=True)
class Drive:
    """One node that is moved, held and released, as by an instrument that pulls it."""

    node: tuple[int, ...] = key(_NODE, "indices [i, j, k] of the node; [i, k] in two dimensions")
    start_s: float = key(
        Number(0.0, MAX_TIME_S), "from here on the node moves, from where it is, with least jerk", unit="s"
    )
    reach_s: float = key(
        Number(0.0, MAX_TIME_S), "it arrives; later than `start_s`; then it is held", unit="s"
    )
    release_s: float = key(
        Number(0.0, MAX_TIME_S), "it is free again, at rest; not before `reach_s`", unit="s"
    )
    displacement_m: tuple[float, ...] = key(
        Vector((2, 3), COORDINATE),
        "where it arrives, from its place of rest: [x, y, z]; [x, z] in two dimensions",
        unit="m",
    )


@dataclass(frozen=True, kw_only=True)
class MaterialRegion:
    """A box of nodes of another material; what it leaves out is the body's."""

    from_node: tuple[int, ...] = key(
        _NODE, "lowest indices [i, j, k] of a box of nodes; [i, k] in two dimensions"
    )
    to_node: tuple[int, ...] = key(
        _NODE, "highest indices, which belong to the box too; none less than that of `from_node`"
    )
    mass_kg: float | None = key(_MASS, "mass of each node", unit="kg", default=None, default_text="the body's")
    stiffness_N_m: float | None = key(
        _STIFFNESS, "stiffness of each spring", unit="N/m", default=None, default_text="the body's"
    )
    damping_ratio: float | None = key(
        _DAMPING_RATIO,
        "damping of each spring as b / sqrt(2 m k) with the region's `mass_kg` and `stiffness_N_m`, given or the "
        "body's; not together with `damping_N_s_m`",
        default=None,
        default_text="the body's, unless this or the body gives `damping_N_s_m`",
    )
    damping_N_s_m: float | None = key(
        _DAMPING,
        "damping b of each spring, along its axis; not together with `damping_ratio`",
        unit="N s/m",
        default=None,
        default_text="the body's where it gives one, else from `damping_ratio`",
    )


@dataclass(frozen=True, kw_only=True)
class Body:
    """The lattice, or mesh, of point masses and of springs with dampers between neighbours."""

    dimension: int = key(
        Integer(2, 3), "3: a block; 2: a sheet in the x-z plane, which cannot be touched", default=3
    )
    nodes: tuple[int, ...] = key(
        _NODES,
        "number of nodes [x, y, z]; [x, z] in two dimensions",
        default=(),
        default_text="required, unless there is [body.mesh]",
    )
    spacing_m: float = key(
        Number(0.0, 1.0, open_low=True), "distance of neighbours along an axis", unit="m", default=0.01
    )
    origin_m: tuple[float, ...] = key(
        Vector((3,), COORDINATE),
        "place of node [0, 0, 0], of a mesh that of the file's origin, in the device frame",
        unit="m",
        default=(0.0, 0.0, 0.0),
    )
    mass_kg: float = key(_MASS, "mass of each node", unit="kg", default=0.001)
    stiffness_N_m: float = key(
        _STIFFNESS, "stiffness of each spring", unit="N/m", default=100.0
    )
    damping_ratio: float | None = key(
        _DAMPING_RATIO,
        "damping of each spring as b / sqrt(2 m k) with `mass_kg` and `stiffness_N_m`; not together with "
        "`damping_N_s_m`",
        default=None,
        default_text="1, unless `damping_N_s_m` is given",
    )
    damping_N_s_m: float | None = key(
        _DAMPING,
        "damping b of each spring, along its axis; not together with `damping_ratio`",
        unit="N s/m",
        default=None,
        default_text="from `damping_ratio`",
    )
    neighbours: str = key(
        Choice(("axis", "edge", "full")),
        "springs from a node to its neighbours: along the axes (6 in three dimensions, 4 in two), with the diagonals "
        "of the cells' faces (18, 8), or with those of the cells too (26, 8)",
        default="full",
    )
    fixed_faces: tuple[str, ...] = key(
        ListOf(Choice(_FACES), 6), "faces of the lattice whose nodes are fixed", default=()
    )
    fixed_nodes: tuple[tuple[int, ...], ...] = key(
        ListOf(_NODE, MAX_NODES_PER_AXIS**3), "further fixed nodes, each [i, j, k] ([i, k])", default=()
    )
    gravity_m_s2: tuple[float, ...] = key(
        Vector((3,), Number(-100.0, 100.0)), "acceleration of free fall", unit="m/s²", default=(0.0, 0.0, 0.0)
    )
    initial_displacements: tuple[InitialDisplacement, ...] = key(
        TablesOf(InitialDisplacement, 100_000), "nodes that start displaced; see below", default=()
    )
    regions: tuple[MaterialRegion, ...] = key(
        TablesOf(MaterialRegion, 1000),
        "parts of another material: a spring takes that of the last region that holds both its end nodes, and a node "
        "the mass of the last region that holds it; see below",
        default=(),
    )
    drives: tuple[Drive, ...] = key(
        TablesOf(Drive, 1000),
        "nodes that are driven for a while, whatever the forces on them; a local model holds them where they are at "
        "its own tick; see below",
        default=(),
    )
    mesh: BodyMesh | None = section(
        BodyMesh,
        "A mesh in place of the lattice ([bodies.md](bodies.md)). Of [body] it takes `origin_m`, `damping_ratio` and `gravity_m_s2`; no other "
        "key may be given.",
        optional=True,
    )
