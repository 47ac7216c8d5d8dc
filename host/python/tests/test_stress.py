"""Stress at the nodes against closed forms."""

import numpy as np
import pytest

from palpate.body import Body
from palpate.stress import NodalStress

SPACING_M, STIFFNESS_N_m = 0.01, 100.0


@pytest.fixture(scope="module")
def body() -> Body:
    return Body(
        nodes=(5, 5, 5), spacing_m=SPACING_M, mass_kg=0.001, stiffness_N_m=STIFFNESS_N_m, neighbours="full",
        fixed_faces=["z-"],
    )  # fmt: skip


def test_nothing_at_rest(body: Body) -> None:
    assert NodalStress(body, SPACING_M**3).von_mises_Pa(body.rest_m).max() < 1e-9


def test_the_same_in_every_direction_has_no_von_mises_stress(body: Body) -> None:
    stress = NodalStress(body, SPACING_M**3).von_mises_Pa(1.02 * body.rest_m)
    assert stress[body.node(2, 2, 2)] < 1e-9  # inside; borders pull to one side


def test_small_stretch_along_one_axis_inside(body: Body) -> None:
    # Each of the 26 springs of a node inside, of length l and direction c, is stretched by e l c_x^2 at a small
    # stretch e, and pulls with k e l c_x^2 along c: sigma_ij = k e / (2 V) sum l^2 c_x^2 c_i c_j. Of second order in e: 1e-5.
    strain = 1e-5
    neighbours = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) != (0, 0, 0)])
    length = np.linalg.norm(neighbours, axis=1)
    c = neighbours / length[:, None]
    factor = STIFFNESS_N_m * strain / (2.0 * SPACING_M)  # l^2 / V = 1 / spacing for a length of one cell
    sigma = factor * np.einsum("n,n,ni,nj->ij", length**2, c[:, 0] ** 2, c, c)
    expected = abs(sigma[0, 0] - sigma[1, 1])  # yy = zz, no shear
    stress = NodalStress(body, SPACING_M**3).von_mises_Pa(body.rest_m * [1.0 + strain, 1.0, 1.0])
    assert stress[body.node(2, 2, 2)] == pytest.approx(expected, rel=10.0 * strain)


def test_a_turn_has_no_stress(body: Body) -> None:
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    assert NodalStress(body, SPACING_M**3).von_mises_Pa(body.rest_m @ turn.T).max() < 1e-6
