"""Readers of meshes: each format gives the same, and what is none is named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_files import BOX, CUBE, CUBE_POINTS, SIDE_M, UPPER, write_gmsh41, write_surface, write_volume

from palpate.mesh.read import MeshError, read_mesh

PLACE_M = 1e-9  # files in text have 8 digits or more


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("old.msh", {"file_format": "gmsh22", "binary": False}),
        ("binary.msh", {"file_format": "gmsh22", "binary": True}),
        ("mesh.vtk", {"binary": True}),
        ("text.vtk", {"binary": False}),
        ("mesh.vtu", {}),
    ],
)
def test_tetrahedra_and_regions(tmp_path: Path, name: str, options: dict[str, Any]) -> None:
    mesh = read_mesh(write_volume(tmp_path / name, **options))
    assert mesh.is_volume
    np.testing.assert_allclose(mesh.point, SIDE_M * CUBE_POINTS, atol=PLACE_M)
    np.testing.assert_array_equal(mesh.tetrahedra.nodes, CUBE)
    names = [mesh.regions[i] for i in mesh.tetrahedra.region]
    lower, upper = ("lower", "upper") if name.endswith(".msh") else ("1", "2")
    assert names == [upper if is_upper else lower for is_upper in UPPER]
    if name.endswith(".msh"):
        assert {mesh.regions[i] for i in mesh.triangles.region} == {"base"}
        np.testing.assert_array_equal(mesh.triangles.nodes, BOX[:2])


@pytest.mark.parametrize("binary", [False, True])
def test_files_of_gmsh_itself(tmp_path: Path, binary: bool) -> None:
    mesh = read_mesh(write_gmsh41(tmp_path / "cube.msh", binary=binary))
    np.testing.assert_allclose(mesh.point, SIDE_M * CUBE_POINTS, atol=PLACE_M)
    named = {(tuple(cell), mesh.regions[i]) for cell, i in zip(mesh.tetrahedra.nodes.tolist(), mesh.tetrahedra.region, strict=True)}
    assert named == {(tuple(cell), "upper" if is_upper else "lower") for cell, is_upper in zip(CUBE.tolist(), UPPER, strict=True)}
    assert [mesh.regions[i] for i in mesh.triangles.region] == ["base", "base"]


@pytest.mark.parametrize(
    ("name", "options"), [("box.obj", {}), ("box.stl", {"binary": False}), ("binary.stl", {"binary": True}), ("box.vtk", {}), ("box.msh", {"file_format": "gmsh22"})]
)
def test_surfaces(tmp_path: Path, name: str, options: dict[str, Any]) -> None:
    mesh = read_mesh(write_surface(tmp_path / name, CUBE_POINTS, BOX, **options))
    assert not mesh.is_volume
    assert len(mesh.point) == 8  # STL repeats corners
    np.testing.assert_allclose(mesh.point[mesh.triangles.nodes], CUBE_POINTS[BOX], atol=1e-6)


def test_what_is_no_mesh_is_named(tmp_path: Path) -> None:
    def message(name: str, text: str | None) -> str:
        file = tmp_path / name
        if text is not None:
            file.write_text(text)
        with pytest.raises(MeshError) as raised:
            read_mesh(file)
        assert str(raised.value).startswith(str(file))
        assert "\n" not in str(raised.value)
        return str(raised.value).removeprefix(f"{file}: ")

    assert message("a.ply", "ply") == "its name must end in one of .msh, .vtk, .vtu, .obj, .stl"
    assert message("none.msh", None).startswith("no such file: must be a mesh")
    assert message("torn.msh", "$MeshFormat\n4.1 0 8\n").startswith("not a mesh that can be read: ")
    assert message("text.vtu", "hello").startswith("not a mesh that can be read: ")
    assert message("empty.obj", "v 0 0 0\n").startswith("has neither tetrahedra nor triangles")
    assert message("quads.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n").startswith("has cells of type quad: ")
    assert message("nan.obj", "v 0 0 nan\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").startswith("node 0 is at [0.0, 0.0, nan]: ")
    assert message("far.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n").startswith("triangle 0 has the nodes [0, 1, 8]: must be in [0, 2]")
