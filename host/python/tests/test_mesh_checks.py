"""Checks of meshes name what is wrong and where, and find nothing in good ones."""

import numpy as np
import pytest
from mesh_files import BOX, CUBE, CUBE_POINTS, SIDE_M

from palpate.mesh.checks import Finding, outwards, size_findings, surface_findings, upright, volume_findings
from palpate.mesh.geometry import boundary, dihedral_angles_deg, enclosed_volume, surface_edges, volumes

POINTS_M = SIDE_M * CUBE_POINTS
# A regular tetrahedron and its mirror image below a shared face.
REGULAR = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])


def kinds(findings: list[Finding]) -> list[str]:
    return [finding.kind for finding in findings]


def of_volume(points_m: np.ndarray, tetrahedra: np.ndarray, min_angle_deg: float = 5.0) -> list[Finding]:
    return list(volume_findings(points_m, tetrahedra, min_angle_deg))


def test_geometry_of_known_bodies() -> None:
    np.testing.assert_allclose(volumes(CUBE_POINTS, CUBE), 1.0 / 6.0)
    assert volumes(REGULAR, np.array([[0, 1, 2, 3]]))[0] == pytest.approx(-1.0 / 3.0)
    np.testing.assert_allclose(dihedral_angles_deg(REGULAR, np.array([[0, 1, 2, 3]])), np.degrees(np.arccos(1.0 / 3.0)))
    assert enclosed_volume(CUBE_POINTS, BOX) == pytest.approx(1.0)
    outer = boundary(CUBE)
    assert enclosed_volume(CUBE_POINTS, outer) == pytest.approx(1.0)
    assert sorted(map(sorted, outer.tolist())) != []
    edges = surface_edges(outer)
    assert (edges.forward == 1).all()
    assert (edges.backward == 1).all()


def test_good_meshes_have_no_findings() -> None:
    assert of_volume(POINTS_M, CUBE) == []
    assert list(surface_findings(POINTS_M, BOX)) == []
    assert list(size_findings(POINTS_M, 1.0)) == []


def test_numbered_the_other_way_round_is_turned_over() -> None:
    mirrored = CUBE[:, [0, 2, 1, 3]]
    np.testing.assert_array_equal(upright(POINTS_M, mirrored), CUBE)
    np.testing.assert_array_equal(upright(POINTS_M, CUBE), CUBE)
    np.testing.assert_array_equal(outwards(POINTS_M, BOX[:, [0, 2, 1]]), BOX)


def test_an_inverted_tetrahedron_is_named() -> None:
    inverted = CUBE.copy()
    inverted[4] = inverted[4][[0, 2, 1, 3]]
    first = of_volume(POINTS_M, upright(POINTS_M, inverted))[0]
    assert (first.kind, first.error, first.element) == ("inverted", True, "tetrahedron 4")
    assert "nodes [0, 4, 6, 7] near [0.015, 0.03, 0.045] m: is inverted, its volume is -3.6e-05 m³: must be positive" in str(first)


def test_a_flat_tetrahedron_is_named() -> None:
    flat = POINTS_M.copy()
    flat[4] = 0.5 * (flat[0] + flat[7])  # on the face of others
    found = of_volume(flat, CUBE)
    assert (found[0].kind, found[0].element) == ("degenerate", "tetrahedron 2")
    assert "has the volume" in found[0].text
    assert "(1 more are degenerate)" in found[0].text


def test_slivers_are_found_at_the_threshold() -> None:
    # Four corners of a square of side 1, two opposite ones lifted by h: the edges along the sides have the angles
    # pi - 2 atan(...), the diagonals close to 0 as h goes to 0.
    height = 0.05
    sliver = SIDE_M * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, height], [1.0, 1.0, 0.0], [0.0, 1.0, height]])
    cell = upright(sliver, np.array([[0, 1, 2, 3]]))
    angle_deg = float(dihedral_angles_deg(sliver, cell).min())
    assert angle_deg == pytest.approx(np.degrees(2.0 * height), rel=0.3)  # two planes each tilted by about h over half a diagonal
    assert of_volume(sliver, cell, angle_deg - 0.01) == []
    found = of_volume(sliver, cell, angle_deg + 0.01)
    assert [(finding.kind, finding.element) for finding in found] == [("sliver", "tetrahedron 0")]
    assert f"must be in [{angle_deg + 0.01:g}, {180.0 - angle_deg - 0.01:g}] degrees" in found[0].text


def test_nodes_of_nothing_are_a_note() -> None:
    found = of_volume(np.vstack([POINTS_M, [[0.1, 0.2, 0.3]]]), CUBE)
    assert [(finding.kind, finding.error, finding.element) for finding in found] == [("unreferenced", False, "node 8")]
    assert "at [0.1, 0.2, 0.3] m" in found[0].text


def test_parts_that_do_not_hang_together_are_named() -> None:
    far = np.vstack([POINTS_M, POINTS_M + [0.1, 0.0, 0.0]])
    found = of_volume(far, np.vstack([CUBE, 8 + CUBE]))
    assert kinds(found) == ["parts"]
    assert "2 parts that do not hang together over faces, the smallest of 6 tetrahedra" in found[0].text
    surfaces = list(surface_findings(far, np.vstack([BOX, 8 + BOX])))
    assert kinds(surfaces) == ["parts"]


def test_parts_that_share_an_edge_only_are_hinged() -> None:
    # Two tetrahedra along the edge 0-1: they would turn around it.
    points_m = SIDE_M * np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 0.5, 1], [0.5, -1, 0], [0.5, -0.5, -1.0]])
    found = of_volume(points_m, np.array([[0, 1, 2, 3], [0, 1, 4, 5]]))
    assert "parts" in kinds(found)
    hinge = [finding for finding in found if finding.kind == "non-manifold"]
    assert [finding.element for finding in hinge] == ["edge 0-1"]
    assert "is of 4 triangles: must be of two" in hinge[0].text


def test_a_repeated_tetrahedron_is_named() -> None:
    found = of_volume(POINTS_M, np.vstack([CUBE, CUBE[:1], CUBE[:1]]))
    repeated = [finding for finding in found if finding.kind == "repeated"]
    assert len(repeated) == 1
    assert "tetrahedra: must be of at most 2" in repeated[0].text


def test_open_and_non_manifold_surfaces_name_the_edge() -> None:
    found = list(surface_findings(POINTS_M, BOX[:-1]))
    assert kinds(found) == ["open"]
    assert found[0].element == "edge 3-5"
    assert "is open, of one triangle: must be of two (2 more)" in found[0].text
    fin = np.vstack([BOX, [[0, 1, 7], [1, 0, 7]]])
    assert [(finding.kind, finding.element) for finding in surface_findings(POINTS_M, fin)][:1] == [("non-manifold", "edge 0-1")]


def test_a_turned_triangle_and_a_flat_one_are_named() -> None:
    turned = BOX.copy()
    turned[5] = turned[5][::-1]
    found = list(surface_findings(POINTS_M, turned))
    assert kinds(found) == ["orientation"]
    assert set(found[0].element.removeprefix("edge ").split("-")) <= set("154")
    line = POINTS_M.copy()
    line[1] = 0.5 * (line[0] + line[2])
    assert [(f.kind, f.element) for f in surface_findings(line, BOX)][0] == ("degenerate", "triangle 0")


@pytest.mark.parametrize(("factor", "hint"), [(1e3, "0.001 (millimetres) it would be 0.06 m"), (1e6, "1e-06 (micrometres) it would be 0.06 m")])
def test_the_wrong_unit_is_named(factor: float, hint: str) -> None:
    found = list(size_findings(factor * POINTS_M, 1.0))
    assert kinds(found) == ["size"]
    assert f"the longest side is {factor * SIDE_M:.4g} m: must be in [0.002, 0.5] m; with scale_m = {hint}" in found[0].text
