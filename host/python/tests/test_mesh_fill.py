"""Surfaces are filled with sound tetrahedra that keep their shape."""

import builtins
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_files import BOX, CUBE_POINTS, SIDE_M

from palpate.mesh.checks import volume_findings
from palpate.mesh.fill import MAX_TETRAHEDRA, fill
from palpate.mesh.geometry import boundary, dihedral_angles_deg, enclosed_volume, volumes
from palpate.mesh.read import MeshError
from palpate.mesh.shapes import sphere

RADIUS_M = 0.03
CELL_M = 0.01
# Edges of cell_m on a sphere: triangles cut the ball short, by about (cell / radius)^2 / 4 of its volume, here 3 %.
CUT_SHORT = 0.05
# Worse than any fill measured (docs/decisions/mesh_fill.md: 15 to 26 degrees).
SOUND_DEG = 12.0


def test_a_write_to_a_process_that_has_ended_is_an_error_as_before() -> None:
    """gmsh would have it end this one. In a process of its own: there the test's failure is the death of pytest's."""
    program = (
        "import os\n"
        "from palpate.mesh.fill import fill\n"
        "from palpate.mesh.shapes import sphere\n"
        "ball = sphere(0.03, 1)\n"
        "fill(ball.point_m, ball.triangles, 0.02)\n"
        "out, into = os.pipe()\n"
        "os.close(out)\n"
        "try:\n"
        "    os.write(into, b'x')\n"
        "except BrokenPipeError:\n"
        "    print('told')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "told\n"), done.stderr


def test_a_ball_is_filled_anew() -> None:
    ball = sphere(RADIUS_M, 3)
    point_m, tetrahedra = fill(ball.point_m, ball.triangles, CELL_M)
    assert list(volume_findings(point_m, tetrahedra)) == []
    assert dihedral_angles_deg(point_m, tetrahedra).min() > SOUND_DEG
    full_m3 = enclosed_volume(ball.point_m, ball.triangles)
    assert 1.0 - CUT_SHORT < volumes(point_m, tetrahedra).sum() / full_m3 < 1.0 + 1e-6
    surface = boundary(tetrahedra)
    np.testing.assert_allclose(np.linalg.norm(point_m[np.unique(surface)], axis=1), RADIUS_M, rtol=0.02)
    edges_m = np.linalg.norm(point_m[surface[:, 0]] - point_m[surface[:, 1]], axis=1)
    assert np.median(edges_m) == pytest.approx(CELL_M, rel=0.2)
    again_m, same = fill(ball.point_m, ball.triangles, CELL_M)
    np.testing.assert_array_equal(again_m, point_m)
    np.testing.assert_array_equal(same, tetrahedra)


def test_without_a_size_the_surfaces_own_triangles_stay() -> None:
    ball = sphere(RADIUS_M, 2)
    point_m, tetrahedra = fill(ball.point_m, ball.triangles, None)
    assert list(volume_findings(point_m, tetrahedra)) == []
    assert len(boundary(tetrahedra)) == len(ball.triangles)
    assert volumes(point_m, tetrahedra).sum() == pytest.approx(enclosed_volume(ball.point_m, ball.triangles), rel=1e-6)


def test_creases_stay() -> None:
    point_m, tetrahedra = fill(SIDE_M * CUBE_POINTS, BOX, 0.25 * SIDE_M)
    assert volumes(point_m, tetrahedra).sum() == pytest.approx(SIDE_M**3, rel=1e-6)
    for corner in SIDE_M * CUBE_POINTS:
        assert np.linalg.norm(point_m - corner, axis=1).min() < 1e-6


def test_what_gmsh_cannot_fill_is_an_error_on_one_line() -> None:
    with pytest.raises(MeshError, match="^gmsh ") as raised:
        fill(SIDE_M * CUBE_POINTS, BOX[:6], None)
    assert "\n" not in str(raised.value)


def test_without_gmsh_there_is_a_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    imported = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name == "gmsh":
            raise OSError("libGLU.so.1: cannot open shared object file")
        return imported(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MeshError, match=r"filled by the library gmsh, which cannot be loaded \(libGLU.so.1: cannot open"):
        fill(SIDE_M * CUBE_POINTS, BOX, None)


def test_the_examples_meshes_are_those_of_the_code(tmp_path: Path) -> None:
    import importlib.util

    from command import ROOT

    spec = importlib.util.spec_from_file_location("example_meshes", ROOT / "host/bench/example_meshes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.write_surface(tmp_path / "sphere.obj", sphere(0.04))
    assert (tmp_path / "sphere.obj").read_bytes() == (ROOT / "scenes/meshes/sphere.obj").read_bytes()
    module.write_vtu(tmp_path / "skin.vtu", module.skin())
    from palpate.mesh.read import read_mesh

    # The bytes are those of the machine's zlib; what they stand for is compared.
    made, kept = read_mesh(tmp_path / "skin.vtu"), read_mesh(ROOT / "scenes/meshes/skin.vtu")
    np.testing.assert_allclose(made.point, kept.point, atol=1e-9)
    np.testing.assert_array_equal(made.tetrahedra.nodes, kept.tetrahedra.nodes)
    np.testing.assert_array_equal(made.tetrahedra.region, kept.tetrahedra.region)


@pytest.mark.parametrize("scale", [1.0, 1.03, 1.06, 1.09])
def test_a_cell_that_makes_too_many_is_refused_before_any_is_made_and_the_least_that_is_named_is_enough(scale: float) -> None:
    ball = sphere(scale * RADIUS_M, 2)
    regular_m3 = 1.0 / (6.0 * np.sqrt(2.0))
    least_m = (abs(enclosed_volume(ball.point_m, ball.triangles)) / (MAX_TETRAHEDRA * regular_m3)) ** (1.0 / 3.0)
    for cell_m in (0.99 * least_m, 1e-9):
        with pytest.raises(MeshError, match=rf"makes more than {MAX_TETRAHEDRA:,} tetrahedra of .* cm³: must be at least") as refusal:
            fill(ball.point_m, ball.triangles, cell_m)
        named = re.search(r"at least (\S+) m", str(refusal.value))
        assert named is not None
        assert least_m <= float(named[1]) < 1.11 * least_m
