"""`palpate mesh`: exit codes, JSON, results."""

import json
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from command import ROOT
from mesh_files import CUBE, CUBE_POINTS, SIDE_M, write_sphere, write_volume

from palpate import cli


def mesh(capsys: pytest.CaptureFixture[str], *arguments: Any) -> tuple[int, dict[str, Any], str]:
    """Exit code, JSON, and what a person reads."""
    code = cli.main(["mesh", *map(str, arguments), "--json"])
    said = capsys.readouterr()
    return code, json.loads(said.out), said.err


def test_a_scene_is_checked_and_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, values, said = mesh(capsys, ROOT / "scenes/liver.toml", "--out", tmp_path / "out")
    assert code == 0
    assert values["ok"] is True
    assert values["findings"] == []
    assert values["regions"].keys() == {"capsule", "parenchyma", "ligament"}
    assert values["fixed_nodes"] > 50
    assert values["smallest_angle_deg"] > 15.0
    assert 5e-5 < values["longest_stable_step_s"] < 1e-3
    assert all(low < 1.0 < high * 1.1 for low, high in zip(values["modulus_from"], values["modulus_to"], strict=True))
    assert "a scene takes it            yes" in said
    assert [Path(file).name for file in values["files"]] == ["mesh.json", "mesh.png"]
    pixels = matplotlib.image.imread(tmp_path / "out/mesh.png")[..., :3]
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50
    kept = json.loads((tmp_path / "out/mesh.json").read_text())
    assert kept == {name: value for name, value in values.items() if name != "files"}


def test_a_surface_is_filled(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = write_sphere(tmp_path / "ball.obj", 25.0)
    code, values, _ = mesh(capsys, file, "--scale", 0.001, "--cell", 0.012, "--young", 5e4, "--density", 1100, "--damping-ratio", 0.5)
    assert code == 0
    assert values["kind"] == "surface"
    assert values["tetrahedra"] > 100
    assert values["mass_kg"] == pytest.approx(1100.0 * values["volume_m3"])
    _, softer, _ = mesh(capsys, file, "--scale", 0.001, "--cell", 0.012, "--young", 1e4, "--density", 1100, "--damping-ratio", 0.5)
    np.testing.assert_allclose(values["stiffness_N_m"], 5.0 * np.array(softer["stiffness_N_m"]))
    # Frequencies go with the root of the modulus, and so does the step.
    assert softer["longest_stable_step_s"] == pytest.approx(np.sqrt(5.0) * values["longest_stable_step_s"])


def test_a_bad_mesh_is_a_failure_with_its_findings(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    inverted = CUBE.copy()
    inverted[4] = inverted[4][[0, 2, 1, 3]]
    file = write_volume(tmp_path / "bad.vtu", np.vstack([SIDE_M * CUBE_POINTS, [[0.1, 0.1, 0.1]]]), inverted)
    code, values, said = mesh(capsys, file, "--out", tmp_path / "out")
    assert code == 1
    assert values["ok"] is False
    first = values["findings"][0]
    assert (first["kind"], first["element"], first["error"]) == ("inverted", "tetrahedron 4", True)
    assert {"kind": "unreferenced", "error": False, "element": "node 8"}.items() <= values["findings"][1].items()
    assert "problem                     tetrahedron 4: nodes [0, 4, 6, 7] near" in said
    assert "note                        node 8: " in said
    assert (tmp_path / "out/mesh.png").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["none.msh"], "none.msh: no such file: must be a mesh"),
        (["scenes/press.toml"], "body.mesh: missing; must be a table [body.mesh] with at least file"),
        (["scenes/liver.toml", "--young", "3"], "--young = 3: not with a scene: set it there, or with --set body.mesh.young_modulus_Pa=..."),
        (["scenes/liver.toml", "--set", "body.mesh.fixed_regions=[]"], "body.mesh: no node is fixed: must be at least three"),
        (["scenes/meshes/liver.msh", "--set", "body.mesh.scale_m=1"], "--set: only with a scene (.toml)"),
        (["scenes/meshes/liver.msh", "--scale", "0"], "--scale = 0: must be in (0, 1000] m"),
        (["scenes/meshes/liver.msh", "--damping-ratio", "-1"], "--damping-ratio = -1: must be in [0, 100]"),
        (["README.md"], "README.md: its name must end in one of .msh, .vtk, .vtu, .obj, .stl"),
    ],
)
def test_bad_input(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, arguments: list[str], expected: str) -> None:
    monkeypatch.chdir(ROOT)
    code, values, said = mesh(capsys, *arguments)
    assert code == 2
    assert expected in values["error"]
    assert said.count("\n") == 1
