"""The body of a scene that names a mesh: read, checked, filled where it is a surface, and made a network."""

import shutil
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from palpate.mesh.checks import Finding, outwards, size_findings, surface_findings, upright, volume_findings
from palpate.mesh.fill import MAX_TETRAHEDRA, fill
from palpate.mesh.network import Material, Network, make_network
from palpate.mesh.read import Mesh, MeshError, read_mesh

if TYPE_CHECKING:
    from palpate.scene_body import Body
    from palpate.scene_mesh import BodyMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A surface triangle has a number of 16 bits on the link.
MAX_TRIANGLES = 65_535
_KEPT = 4  # networks in memory


@dataclass(frozen=True)
class Solid:
    """Tetrahedra in SI units, in the device frame: point_m (n, 3), nodes (t, 4), region (t,): index into `regions` or -1.
    region_nodes: nodes of each region, of tetrahedra and of triangles."""

    point_m: Floats
    nodes: Ints
    region: Ints
    regions: tuple[str, ...]
    region_nodes: dict[str, Ints]
    is_filled: bool


def examine(mesh: Mesh, scale_m: float, origin_m: tuple[float, ...], min_angle_deg: float) -> tuple[Floats, Ints, list[Finding]]:
    """Places in m, tetrahedra or triangles the right way round, and what is wrong with them."""
    point_m = scale_m * mesh.point + np.array(origin_m)
    findings = list(size_findings(point_m, scale_m))
    if mesh.is_volume:
        nodes = upright(point_m, mesh.tetrahedra.nodes)
        findings += volume_findings(point_m, nodes, min_angle_deg)
    else:
        nodes = mesh.triangles.nodes
        findings += surface_findings(point_m, nodes)
        if not any(finding.error for finding in findings):
            nodes = outwards(point_m, nodes)
    return point_m, nodes, findings


def first_error(findings: list[Finding]) -> Finding | None:
    """Of findings, the first that a scene refuses."""
    return next((finding for finding in findings if finding.error), None)


def make_solid(
    mesh: Mesh, scale_m: float, origin_m: tuple[float, ...], cell_m: float | None, min_angle_deg: float
) -> Solid:
    """Raises MeshError, which names element, place and range, for a mesh that is no body."""
    point_m, nodes, findings = examine(mesh, scale_m, origin_m, min_angle_deg)
    if (error := first_error(findings)) is not None:
        raise MeshError(str(error))
    if mesh.is_volume:
        if cell_m is not None:
            raise MeshError(f"{cell_m:g}: given for tetrahedra; must be left out, for nothing is filled", "cell_m")
        of_triangles = mesh.triangles
        region_nodes = {
            name: np.union1d(
                nodes[mesh.tetrahedra.region == i].ravel(), of_triangles.nodes[of_triangles.region == i].ravel()
            )
            for i, name in enumerate(mesh.regions)
        }
        return _packed(point_m, nodes, mesh.tetrahedra.region, mesh.regions, region_nodes)
    point_m, nodes = fill(point_m, nodes, cell_m)
    if (error := first_error(list(volume_findings(point_m, nodes, min_angle_deg)))) is not None:
        raise MeshError(f"filled by gmsh: {error}; another cell_m may do")
    return Solid(point_m, nodes, np.full(len(nodes), -1, dtype=np.int64), (), {}, True)


def _packed(
    point_m: Floats, nodes: Ints, region: Ints, regions: tuple[str, ...], region_nodes: dict[str, Ints]
) -> Solid:
    """Without nodes of no tetrahedron."""
    used, packed = np.unique(nodes, return_inverse=True)
    number = np.full(len(point_m), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    kept = {name: number[each][number[each] >= 0] for name, each in region_nodes.items()}
    return Solid(point_m[used], packed.reshape(-1, 4), region, regions, kept, False)


def _named(names: tuple[str, ...]) -> str:
    return ", ".join(f'"{name}"' for name in names) if names else "none"


def _material(solid: Solid, mesh: "BodyMesh", damping_ratio: float) -> Material:
    count = len(solid.nodes)
    material = Material(
        np.full(count, mesh.young_modulus_Pa), np.full(count, mesh.density_kg_m3), np.full(count, damping_ratio)
    )
    of_tetrahedra = tuple(name for i, name in enumerate(solid.regions) if np.any(solid.region == i))
    for i, given in enumerate(mesh.regions):
        if given.name not in of_tetrahedra:
            raise MeshError(
                f'"{given.name}": is no region of tetrahedra in the mesh, which has {_named(of_tetrahedra)}', f"regions[{i}].name"
            )
        rows = solid.region == solid.regions.index(given.name)
        for value, of_all in (
            (given.young_modulus_Pa, material.young_modulus_Pa),
            (given.density_kg_m3, material.density_kg_m3),
            (given.damping_ratio, material.damping_ratio),
        ):
            if value is not None:
                of_all[rows] = value
    return material


def _fixed(solid: Solid, mesh: "BodyMesh") -> NDArray[np.bool_]:
    fixed = np.zeros(len(solid.point_m), dtype=bool)
    low_m, high_m = solid.point_m.min(axis=0), solid.point_m.max(axis=0)
    span = f"the body is in {_corner(low_m)} to {_corner(high_m)} m"

    def fix(key: str, rows: NDArray[np.bool_]) -> None:
        if not rows.any():
            raise MeshError(f"holds no node: must hold at least one; {span}", key)
        fixed[rows] = True

    for i, name in enumerate(mesh.fixed_regions):
        if name not in solid.region_nodes:
            raise MeshError(f'"{name}": is no region of the mesh, which has {_named(solid.regions)}', f"fixed_regions[{i}]")
        fix(f"fixed_regions[{i}]", np.isin(np.arange(len(fixed)), solid.region_nodes[name]))
    for i, box in enumerate(mesh.fixed_boxes):
        inside = np.all((solid.point_m >= box.from_m) & (solid.point_m <= box.to_m), axis=1)
        fix(f"fixed_boxes[{i}]", inside)
    for i, plane in enumerate(mesh.fixed_planes):
        fix(f"fixed_planes[{i}]", (solid.point_m - np.array(plane.point_m)) @ np.array(plane.normal) <= 0.0)
    if not fixed.any():
        raise MeshError(f"no node is fixed: must be at least three, by fixed_regions, fixed_boxes or fixed_planes; {span}")
    if fixed.all():
        raise MeshError("fixed_regions, fixed_boxes and fixed_planes hold every node: at least one must be free")
    if not _holds(solid.point_m[fixed]):
        raise MeshError(
            f"{np.count_nonzero(fixed)} fixed nodes lie on a point or a line, around which the body turns: must be at least three that do not"
        )
    return fixed


def _holds(point_m: Floats) -> bool:
    """Three of them span a plane."""
    extents = np.linalg.svd(point_m - point_m.mean(axis=0), compute_uv=False)
    return len(extents) > 1 and bool(extents[1] > 1e-6 * max(extents[0], 1e-12))


def _corner(point_m: Floats) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in point_m)}]"


def mesh_file(folder: Path, mesh: "BodyMesh") -> Path:
    """Where the mesh of a scene in `folder` is: as the scene says, or right beside it, where records have theirs (`keep_mesh`).
    Raises MeshError."""
    if "\0" in mesh.file:
        raise MeshError("must be the name of a file", "file")
    file = folder / mesh.file
    beside = folder / file.name
    return beside if not file.is_file() and beside.is_file() else file


def keep_mesh(folder: Path, mesh: "BodyMesh", results: Path) -> Path | None:
    """Copies the mesh of a scene in `folder` into the folder of its results, so that a record there can be replayed. The copy; None
    where it is there already."""
    file = mesh_file(folder, mesh)
    kept = results / file.name
    if kept.exists() and kept.samefile(file):
        return None
    shutil.copyfile(file, kept)
    return kept


def load_network(folder: Path, body: "Body") -> Network:
    """The network of a scene's [body] with a mesh, whose file is relative to `folder`. Raises MeshError."""
    assert body.mesh is not None
    file = mesh_file(folder, body.mesh)
    try:
        status = file.stat()
        stamp = (status.st_mtime_ns, status.st_size)
    except OSError:
        stamp = (0, 0)  # read_mesh says what is wrong
    return _network(file, stamp, body.mesh, body.origin_m, 1.0 if body.damping_ratio is None else body.damping_ratio)


@lru_cache(maxsize=_KEPT)
def _solid(
    file: Path, stamp: tuple[int, int], scale_m: float, origin_m: tuple[float, ...], cell_m: float | None, min_angle_deg: float
) -> Solid:
    return make_solid(read_mesh(file), scale_m, origin_m, cell_m, min_angle_deg)


@lru_cache(maxsize=_KEPT)
def _network(
    file: Path, stamp: tuple[int, int], mesh: "BodyMesh", origin_m: tuple[float, ...], damping_ratio: float
) -> Network:
    solid = _solid(file, stamp, mesh.scale_m, origin_m, mesh.cell_m, mesh.min_angle_deg)
    if len(solid.nodes) > MAX_TETRAHEDRA:
        raise MeshError(f"{len(solid.nodes):,} tetrahedra: must be at most {MAX_TETRAHEDRA:,}; a coarser mesh, or a greater cell_m")
    network = make_network(solid.point_m, solid.nodes, _material(solid, mesh, damping_ratio), _fixed(solid, mesh))
    if len(network.triangles) > MAX_TRIANGLES:
        raise MeshError(
            f"{len(network.triangles):,} triangles on the surface: must be at most {MAX_TRIANGLES:,}; a coarser mesh, or a greater cell_m"
        )
    return network
