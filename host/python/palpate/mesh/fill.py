"""Fills a closed surface with tetrahedra, by the library gmsh (docs/decisions/mesh_fill.md)."""

import ctypes
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.mesh.geometry import enclosed_volume
from palpate.mesh.read import MeshError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Edges where triangles meet at more than this stay edges when the surface is meshed anew.
_CREASE_DEG = 40.0
_SEED = 1
MAX_TETRAHEDRA = 2_000_000
_KEPT = 2  # fills in memory
_TRIANGLE, _TETRAHEDRON = 2, 4  # gmsh's numbers of element types
_DELAUNAY = 1


def fill(point_m: Floats, triangles: Ints, cell_m: float | None) -> tuple[Floats, Ints]:
    """Nodes (n, 3) and tetrahedra (t, 4) within a closed surface that is counter-clockwise seen from outside.

    cell_m: length of edges; the surface is meshed anew with it. None: the surface's own triangles stay. The same bits for the
    same version of gmsh; read-only, for the latest are kept. Raises MeshError where gmsh cannot, is not there, or would make more
    than about MAX_TETRAHEDRA of regular shape.
    """
    if cell_m is not None:
        volume_m3 = abs(enclosed_volume(point_m, triangles))
        if volume_m3 > MAX_TETRAHEDRA * _regular_m3(cell_m):
            least_m = _rounded_up((volume_m3 / (MAX_TETRAHEDRA * _regular_m3(1.0))) ** (1.0 / 3.0))
            raise MeshError(
                f"{cell_m:g} m: makes more than {MAX_TETRAHEDRA:,} tetrahedra of {1e6 * volume_m3:.4g} cm³: must be at least {least_m:g} m",
                "cell_m",
            )
    return _kept_fill(point_m.tobytes(), triangles.astype(np.int64).tobytes(), cell_m)


def _regular_m3(edge_m: float) -> float:
    """Volume of a regular tetrahedron."""
    return float(edge_m**3 / (6.0 * np.sqrt(2.0)))


def _rounded_up(value: float) -> float:
    """The next number of two digits that is not less: a bound that is named is one that is allowed."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(np.ceil(value / unit) * unit)


@lru_cache(maxsize=_KEPT)
def _kept_fill(point_m: bytes, triangles: bytes, cell_m: float | None) -> tuple[Floats, Ints]:
    gmsh = _load()
    with _session(gmsh), _translated("fill the surface"):
        filled = _filled(gmsh, np.frombuffer(point_m).reshape(-1, 3), np.frombuffer(triangles, np.int64).reshape(-1, 3), cell_m)
    for values in filled:
        values.flags.writeable = False
    return filled


def _load() -> Any:
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise MeshError(f"a surface is filled by the library gmsh, which cannot be loaded ({' '.join(str(error).split())})") from None
    return gmsh


@contextmanager
def _translated(what: str) -> Iterator[None]:
    try:
        yield
    except MeshError:
        raise
    except Exception as error:  # gmsh raises plain Exception
        raise MeshError(f"gmsh cannot {what}: {' '.join(str(error).split())}") from None


@contextmanager
def _sigpipe_kept() -> Iterator[None]:
    """gmsh gives SIGPIPE back its default, by which a write to a process that has ended (the recorder's, a board's) ends this one.
    Python's own signal.signal() is for the main thread alone."""
    set_handler = ctypes.CDLL(None).signal
    set_handler.argtypes, set_handler.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_void_p
    before = set_handler(signal.SIGPIPE, int(signal.SIG_IGN))
    try:
        yield
    finally:
        set_handler(signal.SIGPIPE, before)


@contextmanager
def _session(gmsh: Any) -> Iterator[None]:
    with _sigpipe_kept():
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in (
            ("General.Terminal", 0),
            ("General.NumThreads", 1),
            ("Mesh.RandomSeed", _SEED),
            ("Mesh.Algorithm3D", _DELAUNAY),
            ("Mesh.Optimize", 1),
            ("Mesh.OptimizeNetgen", 1),
        ):
            gmsh.option.setNumber(name, value)
        yield
    finally:
        gmsh.finalize()


def _filled(gmsh: Any, point_m: Floats, triangles: Ints, cell_m: float | None) -> tuple[Floats, Ints]:
    # gmsh's tolerances are for sizes near 1.
    low_m, size_m = point_m.min(axis=0), float(np.ptp(point_m, axis=0).max())
    mesh = gmsh.model.mesh
    surface = gmsh.model.addDiscreteEntity(2)
    mesh.addNodes(2, surface, np.arange(1, len(point_m) + 1), ((point_m - low_m) / size_m).ravel())
    mesh.addElementsByType(surface, _TRIANGLE, [], (triangles + 1).ravel())
    if cell_m is not None:
        mesh.classifySurfaces(np.radians(_CREASE_DEG), True, True, np.pi)
        mesh.createGeometry()
        gmsh.option.setNumber("Mesh.MeshSizeMin", cell_m / size_m)
        gmsh.option.setNumber("Mesh.MeshSizeMax", cell_m / size_m)
    loop = gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])
    gmsh.model.geo.addVolume([loop])
    gmsh.model.geo.synchronize()
    mesh.generate(3)
    nodes, tetrahedra = _tetrahedra(gmsh)
    return low_m + size_m * nodes, tetrahedra


def fill_layers(side_m: float, thickness_m: Sequence[float], cell_m: float) -> tuple[Floats, Ints, Ints]:
    """Boxes of side_m by side_m on top of each other, from below, the top in z = 0 and their middle in x = y = 0: nodes (n, 3),
    tetrahedra (t, 4) and the layer of each (t,). Raises as `fill`."""
    gmsh = _load()
    with _session(gmsh), _translated("mesh the layers"):
        occ = gmsh.model.occ
        low, boxes = -sum(thickness_m) / side_m, []
        for thickness in thickness_m:
            boxes.append((3, occ.addBox(-0.5, -0.5, low, 1.0, 1.0, thickness / side_m)))
            low += thickness / side_m
        occ.fragment(boxes[:1], boxes[1:])
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", cell_m / side_m)
        gmsh.option.setNumber("Mesh.MeshSizeMax", cell_m / side_m)
        gmsh.model.mesh.generate(3)
        nodes, tetrahedra = _tetrahedra(gmsh)
        point_m = side_m * nodes
        tops_m = np.cumsum(thickness_m)[:-1] - sum(thickness_m)
        return point_m, tetrahedra, np.searchsorted(tops_m, point_m[tetrahedra][:, :, 2].mean(axis=1))


def _tetrahedra(gmsh: Any) -> tuple[Floats, Ints]:
    """Nodes and tetrahedra of the model, without nodes of none."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, corners = gmsh.model.mesh.getElementsByType(_TETRAHEDRON)
    if not len(corners):
        raise MeshError("gmsh made no tetrahedra")
    row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    row[tags.astype(np.int64)] = np.arange(len(tags))
    used, packed = np.unique(row[corners.astype(np.int64)], return_inverse=True)
    return coordinates.reshape(-1, 3)[used], packed.reshape(-1, 4).astype(np.int64)
