"""Volumes, angles, faces and edges of tetrahedra and triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Of a tetrahedron: the corners of its edges, those across them, and its faces, counter-clockwise seen from outside.
EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
ACROSS = np.array([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])


def volumes(point: Floats, tetrahedra: Ints) -> Floats:
    """(t,): positive where nodes 1, 2, 3 run counter-clockwise seen from the side away from node 0, as in Gmsh and VTK."""
    a, b, c, d = (point[tetrahedra[:, i]] for i in range(4))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def dihedral_angles_deg(point: Floats, tetrahedra: Ints) -> Floats:
    """(t, 6): between the two faces at each edge; NaN where one has no area."""
    angles = np.empty((len(tetrahedra), 6))
    with np.errstate(invalid="ignore", divide="ignore"):
        for e, ((i, j), (k, m)) in enumerate(zip(EDGES, ACROSS, strict=True)):
            from_m = point[tetrahedra[:, i]]
            along = point[tetrahedra[:, j]] - from_m
            along /= np.linalg.norm(along, axis=1)[:, None]
            sides = []
            for corner in (k, m):
                side = point[tetrahedra[:, corner]] - from_m
                side -= np.einsum("ij,ij->i", side, along)[:, None] * along
                sides.append(side / np.linalg.norm(side, axis=1)[:, None])
            angles[:, e] = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", *sides), -1.0, 1.0)))
    return angles


def longest_edges(point: Floats, cells: Ints) -> Floats:
    """(c,): of each triangle or tetrahedron."""
    corners = cells.shape[1]
    pairs = [(i, j) for i in range(corners) for j in range(i)]
    lengths = [np.linalg.norm(point[cells[:, i]] - point[cells[:, j]], axis=1) for i, j in pairs]
    return np.asarray(np.max(lengths, axis=0))


def areas(point: Floats, triangles: Ints) -> Floats:
    """(t,): of each triangle."""
    a, b, c = (point[triangles[:, i]] for i in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def enclosed_volume(point: Floats, triangles: Ints) -> float:
    """Of a closed surface; negative where its triangles are counter-clockwise seen from inside."""
    a, b, c = (point[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6.0)


def neighbours_of(tetrahedra: Ints) -> Ints:
    """(p, 2): pairs of tetrahedra that share a face."""
    faces = np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = np.all(faces[order[1:]] == faces[order[:-1]], axis=1)
    return np.column_stack([order[:-1][same] // 4, order[1:][same] // 4])


def boundary(tetrahedra: Ints) -> Ints:
    """(t, 3): faces of one tetrahedron only, counter-clockwise seen from outside, in the order of the tetrahedra."""
    faces = tetrahedra[:, FACES].reshape(-1, 3)
    _, index, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[np.sort(index[count == 1])])


def most_shared_face(tetrahedra: Ints) -> tuple[Ints, int]:
    """The face that most tetrahedra have, (3,), and how many those are."""
    faces, count = np.unique(np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1), axis=0, return_counts=True)
    worst = int(np.argmax(count))
    return faces[worst], int(count[worst])


@dataclass(frozen=True)
class Edges:
    """Edges of a surface: node (e, 2), the lower number first; forward, backward (e,): how many triangles run along it from the
    first to the second node, and back."""

    node: Ints
    forward: Ints
    backward: Ints


def surface_edges(triangles: Ints) -> Edges:
    """All edges of a surface."""
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    node, edge = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    is_forward = directed[:, 0] < directed[:, 1]
    forward = np.bincount(edge.ravel(), is_forward, len(node)).astype(np.int64)
    return Edges(node, forward, np.bincount(edge.ravel(), minlength=len(node)) - forward)
