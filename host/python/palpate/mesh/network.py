"""From tetrahedra to masses, springs and dampers.

A quarter of the mass of each tetrahedron goes to each of its corners. Each of its six edges gets a spring of E V / L^2, E being
Young's modulus, V its volume, L the edge's length; springs of several tetrahedra along one edge add up to one (Van Gelder, "Approximate
simulation of elastic membranes by triangulated spring meshes", Journal of Graphics Tools 3(2), 1998, the rule for tetrahedra).

The factor is 1 for Poisson's ratio 1/4, the only one that such a network has: under a strain e a tetrahedron of volume V stores
sum over edges of k L^2 (n . e n)^2 / 2; with k = c E V / L^2 and edges in all directions alike that is
c E V 6 (tr(e)^2 + 2 e : e) / 30, which is the isotropic material with lambda = mu = 2 c E / 5, so with Poisson's ratio 1/4 and Young's
modulus c E. A regular tetrahedron's springs are E L / (6 sqrt 2) = 0.118 E L; the fit of Lloyd, Szekely and Harders ("Identification
of spring parameters for deformable object simulation", IEEE TVCG 13(5), 2007) gives 2 sqrt(2) / 25 E L = 0.113 E L.

The network's small motions are those of linear finite elements, each with a tensor of its own (`tensors`): six edge forces of a
tetrahedron are those of a uniform stress and the reverse. So its modulus is bounded by the means of stiffness and of compliance of
its tetrahedra (`modulus_bounds`).
"""

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.mesh.geometry import EDGES, boundary, volumes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Material:
    """Of each tetrahedron, (t,)."""

    young_modulus_Pa: Floats
    density_kg_m3: Floats
    damping_ratio: Floats


@dataclass(frozen=True)
class Network:
    """A body of n nodes, s springs and t surface triangles, in the device frame.

    rest_position_m (n, 3); mass_kg (n,); volume_m3 (n,): the part of the body that is each node's; fixed (n,); springs (s, 2): nodes;
    stiffness_N_m, damping_N_s_m, rest_length_m (s,); triangles (t, 3): counter-clockwise seen from outside.
    """

    rest_position_m: Floats
    mass_kg: Floats
    volume_m3: Floats
    fixed: NDArray[np.bool_]
    springs: Ints
    stiffness_N_m: Floats
    damping_N_s_m: Floats
    rest_length_m: Floats
    triangles: Ints

    @property
    def digest(self) -> str:
        """SHA-256 of everything."""
        sha = hashlib.sha256()
        for values in vars(self).values():
            sha.update(str(values.shape).encode() + np.ascontiguousarray(values).tobytes())
        return sha.hexdigest()


def make_network(point_m: Floats, tetrahedra: Ints, material: Material, fixed: NDArray[np.bool_]) -> Network:
    """The body. All volumes must be positive, and every node one of a tetrahedron's. fixed (n,).

    A damper's constant is ratio * 2 sqrt(k m), with m = m_i m_j / (m_i + m_j) the reduced mass of its ends: for equal ends that is
    ratio * sqrt(2 m_i k), as in lattices. Along an edge the ratios of the tetrahedra count by their springs.
    """
    volume_m3 = volumes(point_m, tetrahedra)
    corner = tetrahedra.ravel()
    nodes = len(point_m)
    mass_kg = _sums(corner, np.repeat(0.25 * material.density_kg_m3 * volume_m3, 4), nodes)
    own_m3 = _sums(corner, np.repeat(0.25 * volume_m3, 4), nodes)

    ends = np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1)
    springs, spring = np.unique(ends, axis=0, return_inverse=True)
    length_m = np.linalg.norm(point_m[springs[:, 1]] - point_m[springs[:, 0]], axis=1)
    part_N_m = np.repeat(material.young_modulus_Pa * volume_m3, 6) / length_m[spring.ravel()] ** 2
    stiffness_N_m = _sums(spring.ravel(), part_N_m, len(springs))
    ratio = _sums(spring.ravel(), part_N_m * np.repeat(material.damping_ratio, 6), len(springs)) / stiffness_N_m
    first_kg, second_kg = mass_kg[springs[:, 0]], mass_kg[springs[:, 1]]
    reduced_kg = first_kg * second_kg / (first_kg + second_kg)
    return Network(
        rest_position_m=point_m,
        mass_kg=mass_kg,
        volume_m3=own_m3,
        fixed=fixed,
        springs=springs,
        stiffness_N_m=stiffness_N_m,
        damping_N_s_m=2.0 * ratio * np.sqrt(stiffness_N_m * reduced_kg),
        rest_length_m=length_m,
        triangles=boundary(tetrahedra),
    )


def _sums(index: Ints, values: Floats, count: int) -> Floats:
    """(count,): of the values of each index."""
    return np.bincount(index, values, count).astype(np.float64)


def tensors(point_m: Floats, tetrahedra: Ints, young_modulus_Pa: Floats) -> Floats:
    """(t, 6, 6): elasticity of each tetrahedron of springs, in Mandel's notation (xx, yy, zz, sqrt 2 times yz, xz, xy)."""
    edge_m = point_m[tetrahedra[:, EDGES[:, 1]]] - point_m[tetrahedra[:, EDGES[:, 0]]]
    x, y, z = np.moveaxis(edge_m / np.linalg.norm(edge_m, axis=2)[..., None], 2, 0)
    root = np.sqrt(2.0)
    dyad = np.stack([x * x, y * y, z * z, root * y * z, root * x * z, root * x * y], axis=-1)
    return np.asarray(young_modulus_Pa[:, None, None] * np.einsum("tea,teb->tab", dyad, dyad))


def modulus_bounds(point_m: Floats, tetrahedra: Ints, young_modulus_Pa: Floats) -> tuple[Floats, Floats]:
    """Of the apparent Young's modulus of a block along x, y and z, (3,) each: the lower one from the mean compliance (Reuss), the
    upper one from the mean stiffness (Voigt); both hold for a block whose ends are pulled apart and free to slide."""
    share = volumes(point_m, tetrahedra)
    share = share / share.sum()
    every = tensors(point_m, tetrahedra, young_modulus_Pa)
    stiff = np.linalg.inv(np.einsum("t,tab->ab", share, every))
    yielding = np.einsum("t,tab->ab", share, np.linalg.inv(every))
    return 1.0 / np.diag(yielding)[:3], 1.0 / np.diag(stiff)[:3]
