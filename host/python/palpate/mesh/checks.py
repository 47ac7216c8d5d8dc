"""What is wrong with a mesh, element by element."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from palpate.mesh.geometry import (
    areas,
    boundary,
    dihedral_angles_deg,
    enclosed_volume,
    longest_edges,
    most_shared_face,
    neighbours_of,
    surface_edges,
    volumes,
)
from palpate.scene_mesh import MIN_ANGLE_DEG

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Below this part of its longest edge cubed a volume is none, below this part of the edge squared an area: 1e-9 of a centimetre is
# 10 pm, rounding of a file with 8 digits 100 pm.
FLAT = 1e-9
# A body that the arm can reach: its longest side.
SIZE_M = (0.002, 0.5)
_UNITS = {"metres": 1.0, "decimetres": 0.1, "centimetres": 0.01, "millimetres": 1e-3, "micrometres": 1e-6}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong. error: a scene refuses it. element: "tetrahedron 12", "edge 3-9" and the like."""

    kind: Literal[
        "size", "inverted", "degenerate", "sliver", "open", "non-manifold", "orientation", "unreferenced", "parts", "repeated"
    ]
    error: bool
    element: str
    text: str

    def __str__(self) -> str:
        return f"{self.element}: {self.text}" if self.element else self.text


def _at(point_m: Floats, nodes: Ints) -> str:
    """Where an element's middle is."""
    return f"[{', '.join(f'{x:.4g}' for x in point_m[nodes].mean(axis=0))}] m"


def size_findings(point_m: Floats, scale_m: float) -> Iterator[Finding]:
    """The magnitude of the whole; scale_m: of the file's unit, for a better one."""
    side_m = float(np.ptp(point_m, axis=0).max()) if len(point_m) else 0.0
    low_m, high_m = SIZE_M
    if low_m <= side_m <= high_m:
        return
    better = [
        f"{value:g} ({name}) it would be {side_m / scale_m * value:.3g} m"
        for name, value in _UNITS.items()
        if low_m <= side_m / scale_m * value <= high_m
    ]
    hint = f"; with scale_m = {better[0]}" if better else ""
    yield Finding("size", True, "", f"the longest side is {side_m:.4g} m: must be in [{low_m:g}, {high_m:g}] m{hint}")


def upright(point_m: Floats, tetrahedra: Ints) -> Ints:
    """The same, turned over where all are numbered the other way round, as some programs do."""
    if len(tetrahedra) and volumes(point_m, tetrahedra).max() < 0.0:
        return tetrahedra[:, [0, 2, 1, 3]]
    return tetrahedra


def _each(
    kind: Literal["inverted", "degenerate", "sliver"], rows: Ints, text: Callable[[int], str], element: str = "tetrahedron"
) -> Iterator[Finding]:
    """The first of the rows by name, the others by their number."""
    if len(rows):
        more = f" ({len(rows) - 1} more are {'slivers' if kind == 'sliver' else kind})" if len(rows) > 1 else ""
        yield Finding(kind, True, f"{element} {rows[0]}", text(int(rows[0])) + more)


def volume_findings(point_m: Floats, tetrahedra: Ints, min_angle_deg: float = MIN_ANGLE_DEG) -> Iterator[Finding]:
    """Of tetrahedra that are `upright`."""

    def named(row: int) -> str:
        return f"nodes {tetrahedra[row].tolist()} near {_at(point_m, tetrahedra[row])}"

    volume_m3 = volumes(point_m, tetrahedra)
    least_m3 = FLAT * longest_edges(point_m, tetrahedra) ** 3
    flat = np.abs(volume_m3) <= least_m3
    yield from _each(
        "degenerate",
        np.flatnonzero(flat),
        lambda row: f"{named(row)}: has the volume {volume_m3[row]:.3g} m³: must be more than {least_m3[row]:.3g} m³",
    )
    yield from _each(
        "inverted",
        np.flatnonzero(~flat & (volume_m3 < 0.0)),
        lambda row: f"{named(row)}: is inverted, its volume is {volume_m3[row]:.3g} m³: must be positive, as those of others are",
    )
    angle_deg = dihedral_angles_deg(point_m, tetrahedra)
    sharp = np.minimum(angle_deg.min(axis=1), 180.0 - angle_deg.max(axis=1))
    thin = np.flatnonzero(~flat & (sharp < min_angle_deg))
    yield from _each(
        "sliver",
        thin[np.argsort(sharp[thin], kind="stable")],
        lambda row: f"{named(row)}: is a sliver, with angles of {angle_deg[row].min():.2f} to {angle_deg[row].max():.2f} degrees "
        f"between its faces: must be in [{min_angle_deg:g}, {180.0 - min_angle_deg:g}] degrees",
    )
    face, count = most_shared_face(tetrahedra)
    if count > 2:
        yield Finding(
            "repeated", True, f"face {face.tolist()}", f"near {_at(point_m, face)}: is one of {count} tetrahedra: must be of at most 2"
        )
    unused = np.setdiff1d(np.arange(len(point_m)), tetrahedra)
    if len(unused):
        more = f" ({len(unused) - 1} more)" if len(unused) > 1 else ""
        yield Finding(
            "unreferenced", False, f"node {unused[0]}", f"at {_at(point_m, unused[:1])}: is of no tetrahedron, and left out{more}"
        )
    yield from _part_findings(point_m, tetrahedra, neighbours_of(tetrahedra), "tetrahedra", "faces")
    yield from surface_findings(point_m, boundary(tetrahedra), named="surface of the tetrahedra: ")


def _part_findings(point_m: Floats, cells: Ints, pairs: Ints, name: str, over: str) -> Iterator[Finding]:
    count = len(cells)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    if parts > 1:
        sizes = np.bincount(part)
        smallest = int(np.argmin(sizes))
        row = int(np.flatnonzero(part == smallest)[0])
        yield Finding(
            "parts",
            True,
            f"{name} {row}" if sizes[smallest] > 1 else f"{name} {row} alone",
            f"near {_at(point_m, cells[row])}: the mesh has {parts} parts that do not hang together over {over}, the smallest of "
            f"{sizes[smallest]} {name}: must be one",
        )


def surface_findings(point_m: Floats, triangles: Ints, named: str = "") -> Iterator[Finding]:
    """Of a surface that is to enclose a body."""
    area_m2 = areas(point_m, triangles)
    least_m2 = FLAT * longest_edges(point_m, triangles) ** 2
    flat = np.flatnonzero(area_m2 <= least_m2)
    yield from _each(
        "degenerate",
        flat,
        lambda row: f"{named}nodes {triangles[row].tolist()} near {_at(point_m, triangles[row])}: has the area {area_m2[row]:.3g} m²: "
        f"must be more than {least_m2[row]:.3g} m²",
        "triangle",
    )
    edges = surface_edges(triangles)
    total = edges.forward + edges.backward

    def edge_finding(kind: Literal["open", "non-manifold", "orientation"], rows: Ints, text: str) -> Iterator[Finding]:
        if len(rows):
            ends = edges.node[rows[0]]
            more = f" ({len(rows) - 1} more)" if len(rows) > 1 else ""
            counted = text.format(total[rows[0]])
            yield Finding(kind, True, f"edge {ends[0]}-{ends[1]}", f"{named}near {_at(point_m, ends)}: {counted}{more}")

    yield from edge_finding("open", np.flatnonzero(total == 1), "is open, of one triangle: must be of two")
    yield from edge_finding("non-manifold", np.flatnonzero(total > 2), "is of {} triangles: must be of two")
    yield from edge_finding(
        "orientation",
        np.flatnonzero((total == 2) & (edges.forward != 1)),
        "its two triangles run along it the same way, one is turned over: must be opposite ways",
    )
    if named or np.any(total != 2):
        return
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    row = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort(np.sort(directed, axis=1).T)
    yield from _part_findings(point_m, triangles, row[order].reshape(-1, 2), "triangles", "edges")


def outwards(point_m: Floats, triangles: Ints) -> Ints:
    """The same closed surface with its triangles counter-clockwise seen from outside."""
    return triangles[:, [0, 2, 1]] if enclosed_volume(point_m, triangles) < 0.0 else triangles
