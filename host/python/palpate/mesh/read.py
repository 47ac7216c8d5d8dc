"""Mesh files as arrays, by the library meshio: Gmsh, VTK and VTU, OBJ and STL."""

from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SUFFIXES = (".msh", ".vtk", ".vtu", ".obj", ".stl")
# Cell data that say which region a cell is of, the first that a file has; Gmsh's are physical groups.
REGION_DATA = ("gmsh:physical", "region", "material", "medit:ref", "cell_tags")
# Files of surfaces repeat the corners of each triangle, rounded: those as near as this part of the mesh's size are one.
_SAME_PLACE = 1e-7
_KNOWN_CELLS = ("vertex", "line", "triangle", "tetra")


class MeshError(ValueError):
    """A mesh is not usable: one line that names what, where, and what is allowed. key: of [body.mesh], where one is at fault."""

    def __init__(self, text: str, key: str = "") -> None:
        super().__init__(text)
        self.key = key


@dataclass(frozen=True)
class Cells:
    """Triangles or tetrahedra of a file: nodes (c, 3 or 4); region (c,): index into the mesh's `regions`, -1 of none."""

    nodes: Ints
    region: Ints


@dataclass(frozen=True)
class Mesh:
    """What a file has, in its own unit of length. point (n, 3). regions: names, of Gmsh's physical groups or numbers as text."""

    point: Floats
    tetrahedra: Cells
    triangles: Cells
    regions: tuple[str, ...] = field(default=())

    @property
    def is_volume(self) -> bool:
        """Has tetrahedra; else it is a surface to be filled."""
        return len(self.tetrahedra.nodes) > 0


def read_mesh(file: Path) -> Mesh:
    """Reads a mesh by its suffix. Raises MeshError for what cannot be read, or has neither tetrahedra nor triangles."""
    if file.suffix.lower() not in SUFFIXES:
        raise MeshError(f"{file}: its name must end in one of {', '.join(SUFFIXES)}")
    if not file.is_file():
        raise MeshError(f"{file}: no such file: must be a mesh ({', '.join(SUFFIXES)})")
    import meshio  # takes its time: only where a mesh is read

    try:
        # Its reader of STL multiplies in 32 bits before it knows whether the file is binary.
        # Others print; standard output belongs to the commands.
        with np.errstate(over="ignore"), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            data = meshio.read(file)
    except (MemoryError, RecursionError):
        raise MeshError(f"{file}: too large to read") from None
    except (Exception, SystemExit) as error:  # meshio's readers raise whatever they meet, and exit on some
        raise MeshError(f"{file}: not a mesh that can be read: {_one_line(error)}") from None
    return _from_meshio(file, data)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _from_meshio(file: Path, data: Any) -> Mesh:
    point = np.asarray(data.points, dtype=np.float64)
    if point.ndim != 2 or point.shape[1] not in (2, 3):
        raise MeshError(f"{file}: has points of {point.shape}: must be (n, 3)")
    if point.shape[1] == 2:
        point = np.column_stack([point, np.zeros(len(point))])
    other = sorted({block.type for block in data.cells} - set(_KNOWN_CELLS))
    if other:
        raise MeshError(f"{file}: has cells of type {', '.join(other)}: must be tetra or triangle, straight-edged")
    if not np.isfinite(point).all():
        row = int(np.flatnonzero(~np.isfinite(point).all(axis=1))[0])
        raise MeshError(f"{file}: node {row} is at {point[row].tolist()}: must be finite numbers")
    names: dict[tuple[int, int], str] = {
        (int(number), int(dimension)): str(name) for name, (number, dimension) in _field_data(data)
    }
    labels = next((data.cell_data[name] for name in REGION_DATA if name in data.cell_data), None)
    regions: list[str] = []
    mesh = Mesh(
        point,
        _cells(file, data, labels, "tetra", 3, names, regions),
        _cells(file, data, labels, "triangle", 2, names, regions),
        tuple(regions),
    )
    if not mesh.is_volume:
        if not len(mesh.triangles.nodes):
            raise MeshError(f"{file}: has neither tetrahedra nor triangles: must have one of them")
        mesh = _merged(mesh)
    return mesh


def _field_data(data: Any) -> Sequence[tuple[str, Any]]:
    return [(name, value) for name, value in data.field_data.items() if np.size(value) == 2]


def _cells(
    file: Path,
    data: Any,
    labels: Any,
    kind: str,
    dimension: int,
    names: dict[tuple[int, int], str],
    regions: list[str],
) -> Cells:
    nodes, region = [np.zeros((0, dimension + 1), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for i, block in enumerate(data.cells):
        if block.type != kind:
            continue
        nodes.append(np.asarray(block.data, dtype=np.int64).reshape(-1, dimension + 1))
        given = None if labels is None else np.asarray(labels[i]).astype(np.int64).ravel()
        index = np.full(len(nodes[-1]), -1, dtype=np.int64)
        for number in [] if given is None else np.unique(given).tolist():
            name = names.get((number, dimension), str(number))
            if name not in regions:
                regions.append(name)
            index[given == number] = regions.index(name)
        region.append(index)
    all_nodes = np.concatenate(nodes)
    bad = np.flatnonzero(((all_nodes < 0) | (all_nodes >= len(data.points))).any(axis=1))
    if len(bad):
        raise MeshError(
            f"{file}: {kind} {bad[0]} has the nodes {all_nodes[bad[0]].tolist()}: must be in [0, {len(data.points) - 1}]"
        )
    return Cells(all_nodes, np.concatenate(region))


def _merged(mesh: Mesh) -> Mesh:
    """With equal places as one node, and without nodes of no triangle."""
    size = float(np.ptp(mesh.point, axis=0).max())
    places = np.round(mesh.point / (_SAME_PLACE * size)) if size > 0.0 else mesh.point
    _, first, same = np.unique(places, axis=0, return_index=True, return_inverse=True)
    # In the order of the file, so that numbers stay those of the file where nothing is repeated.
    order = np.argsort(first)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    nodes = number[same.ravel()][mesh.triangles.nodes]
    return Mesh(mesh.point[first[order]], mesh.tetrahedra, Cells(nodes, mesh.triangles.region), mesh.regions)
