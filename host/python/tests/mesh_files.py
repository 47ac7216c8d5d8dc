"""Small meshes for tests, in every format that is read."""

from pathlib import Path

import meshio
import numpy as np

from palpate.mesh.shapes import sphere

# A cube of 6 tetrahedra around its space diagonal, and one tetrahedron by itself.
CUBE_POINTS = np.array([[(c >> axis) & 1 for axis in range(3)] for c in range(8)], dtype=np.float64)
CUBE = np.array([(0, 1, 3, 7), (0, 5, 1, 7), (0, 4, 5, 7), (0, 3, 2, 7), (0, 6, 4, 7), (0, 2, 6, 7)])
UPPER = np.array([0, 0, 1, 0, 1, 1])  # region of each: 1 those that hold one of the corners 4 and 6
# The cube's surface, counter-clockwise seen from outside.
BOX = np.array(
    [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]
)
SIDE_M = 0.06


def write_volume(file: Path, points: np.ndarray = SIDE_M * CUBE_POINTS, tetrahedra: np.ndarray = CUBE, **options: object) -> Path:
    """Two regions, "lower" and "upper" (Gmsh) or 1 and 2; in Gmsh's the underside as "base", too."""
    cells: list[tuple[str, np.ndarray]] = [("tetra", tetrahedra)]
    region = [(1 + UPPER[: len(tetrahedra)]).astype(np.int32)]
    if file.suffix == ".msh":
        cells.append(("triangle", BOX[:2]))
        region.append(np.array([3, 3], dtype=np.int32))
        mesh = meshio.Mesh(points, cells, cell_data={"gmsh:physical": region, "gmsh:geometrical": region})
        mesh.field_data = {"lower": np.array([1, 3]), "upper": np.array([2, 3]), "base": np.array([3, 2])}
    else:
        mesh = meshio.Mesh(points, cells, cell_data={"region": region})
    mesh.write(file, **options)
    return file


def write_surface(file: Path, points: np.ndarray, triangles: np.ndarray, **options: object) -> Path:
    """Triangles only."""
    meshio.Mesh(points, [("triangle", triangles)]).write(file, **options)
    return file


def write_sphere(file: Path, radius: float, halvings: int = 2) -> Path:
    """A surface."""
    ball = sphere(radius, halvings)
    return write_surface(file, ball.point_m, ball.triangles)


def write_gmsh41(file: Path, *, binary: bool) -> Path:
    """The cube as gmsh itself writes it: format 4.1, an entity for each region."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Binary", int(binary))
        mesh, number = gmsh.model.mesh, 1
        for name, dimension, kind, cells in (
            ("lower", 3, 4, CUBE[UPPER == 0]), ("upper", 3, 4, CUBE[UPPER == 1]), ("base", 2, 2, BOX[:2])
        ):  # fmt: skip
            entity = gmsh.model.addDiscreteEntity(dimension)
            if number == 1:
                mesh.addNodes(3, entity, np.arange(1, 9), (SIDE_M * CUBE_POINTS).ravel())
            mesh.addElementsByType(entity, kind, np.arange(number, number + len(cells)), (cells + 1).ravel())
            number += len(cells)
            gmsh.model.addPhysicalGroup(dimension, [entity], name=name)
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    return file
