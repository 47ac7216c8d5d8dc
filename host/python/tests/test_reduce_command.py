"""`palpate reduce`: results, verdicts and refusals."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import ROOT, palpate

from palpate import _core
from palpate.reduce.command import Request, describe_locality, describe_reduction
from palpate.reduce.locality import GOOD_ERROR, KRYLOV_MODES, Locality, check_locality
from palpate.reduce.system import contact_system, linear_body, middle_of_top
from palpate.scene import load_scene

SCENES = ROOT / "scenes/reduce"
# Keys of docs/reduction.md.
REDUCTION_KEYS = {
    "scene", "contact_node", "converged", "states", "order", "method", "hankel_singular_values_N_m", "norm_N_m", "error",
    "projected_states", "shifts_rad_s", "time_s", "system_time_s", "files",
}  # fmt: skip
LOCALITY_KEYS = {
    "scene", "contact_node", "local", "verdict", "good_error", "band_Hz", "state_share_in_first_patch", "recommended", "balanced",
    "patches", "frequency_Hz", "response_N_m", "reduced_error", "states", "compliance", "files",
}  # fmt: skip


def reduce_json(tmp_path: Path, *arguments: str) -> tuple[int, dict[str, Any]]:
    done = palpate("reduce", *arguments, "--json", "--out", str(tmp_path))
    return done.returncode, json.loads(done.stdout)


def test_the_papers_square(tmp_path: Path) -> None:
    code, values = reduce_json(tmp_path, "--dim", "2", "--n", "12", "--damping", "1.0", "--order", "20")
    assert code == 0
    assert set(values) == REDUCTION_KEYS
    assert (values["states"], values["order"], values["method"]) == (524, 20, "krylov")
    assert values["contact_node"] == [5, 0, 11]
    assert values["error"]["relative_h_infinity"] <= values["error"]["certified"] <= values["error"]["a_priori_bound"]
    for file in values["files"].values():
        assert Path(file).stat().st_size > 0
    written = json.loads((tmp_path / "reduction.json").read_text())
    assert written == {name: value for name, value in values.items() if name != "files"}

    code, dense = reduce_json(tmp_path, "--dim", "2", "--n", "12", "--damping", "1.0", "--order", "20", "--dense")
    assert (code, dense["method"]) == (0, "dense")
    kept = values["hankel_singular_values_N_m"]
    np.testing.assert_allclose(kept, dense["hankel_singular_values_N_m"][: len(kept)], atol=1e-8 * kept[0])


def test_a_projection_that_misses_its_tolerance_fails(tmp_path: Path) -> None:
    code, values = reduce_json(tmp_path, "--n", "20", "--damping", "0.001", "--order", "20")
    assert (code, values["converged"]) == (1, False)
    assert values["error"]["projection"] is None or values["error"]["projection"] > 1e-6


def test_a_folder_that_cannot_be_written_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = palpate("reduce", "--n", "5", "--out", str(tmp_path / "file/out"))
    assert done.returncode == 2
    assert "must be a folder that can be written" in done.stderr


def test_order_and_node_follow_what_is_asked(tmp_path: Path) -> None:
    _, values = reduce_json(tmp_path, "--dim", "3", "--n", "4", "--node", "3", "2", "3")
    assert values["contact_node"] == [3, 2, 3]
    assert values["error"]["certified"] <= 0.01  # chosen by the program
    _, coarse = reduce_json(tmp_path, "--dim", "3", "--n", "4", "--node", "3", "2", "3", "--order", "3")
    assert coarse["order"] == 3
    assert coarse["error"]["certified"] > values["error"]["certified"]
    scene = ("--scene", str(SCENES / "soft_core.toml"), "--set", "body.neighbours='edge'", "--damping", "2")
    code, softer = reduce_json(tmp_path, *scene)
    assert (code, softer["states"]) == (0, 8706)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scene", "scenes/demo.toml", "--n", "4"), "--n: only for the paper's bodies"),
        (("--n", "1"), "body.nodes = [1, 1]: must be"),
        (("--node", "5"), "--node = 5: must be I K in [0, 11] [0, 11]"),
        (("--node", "5", "12"), "--node = 5 12: must be I K in [0, 11] [0, 11]"),
        (("--node", "5", "0"), "node (5, 0, 0): is fixed"),
        (("--order", "0"), "--order = 0: must be in [1, 524]"),
        (("--order", "525"), "--order = 525: must be in [1, 524]"),
        (("--tolerance", "0"), "--tolerance = 0: must be in [1e-12, 0.1]"),
        (("--damping", "0"), "no damper resists"),
        (("--dense", "--dim", "3"), "--dense: 8,706 states: must be at most 1,600"),
        (("--set", 'body.neighbours="axis"'), "no spring resists"),
        (("--check-locality", "scenes/demo.toml", "--order", "8"), "--order: not with --check-locality"),
        (("--check-locality", "scenes/demo.toml", "--dense"), "--dense: not with --check-locality"),
        (("--check-locality", "scenes/demo.toml", "--tolerance", "1e-5"), "--tolerance: not with --check-locality"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_bad_input_is_refused_on_one_line(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    done = palpate("reduce", *arguments, "--out", str(tmp_path))
    assert done.returncode == 2
    assert done.stdout == ""
    assert message in done.stderr.splitlines()[-1]
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def verdicts() -> dict[str, Locality]:
    """Of the three bodies, at 30 Hz and with the board's capacity."""
    found = {}
    for name in ("homogeneous", "soft_core", "stiff_skin"):
        body = linear_body(_core, load_scene(SCENES / f"{name}.toml").to_dict())
        found[name] = check_locality(contact_system(body, middle_of_top(body)), 30.0, _core.MAX_MODES)
    return found


def test_a_homogeneous_body_is_local_and_the_others_are_not(verdicts: dict[str, Locality]) -> None:
    assert {name: verdict.local for name, verdict in verdicts.items()} == {
        "homogeneous": True, "soft_core": False, "stiff_skin": False,
    }  # fmt: skip
    best = verdicts["homogeneous"].recommended
    assert best is not None
    assert (best.along, best.depth, best.modes) == (4, 2, 96)
    assert verdicts["stiff_skin"].recommended is None
    skin = verdicts["stiff_skin"].to_dict()
    assert skin["recommended"] == {"builder": "krylov", "patch_nodes": None, "modes": 48}
    assert skin["balanced"]["order"] == verdicts["stiff_skin"].reduction.order
    assert 'builder "krylov", 48 modes' in skin["verdict"]
    assert verdicts["homogeneous"].to_dict()["recommended"] == {
        "builder": "patch", "patch_nodes": [4, 4, 2], "modes": 96,
    }  # fmt: skip


def test_what_is_recommended_is_a_scene() -> None:
    """The modes are those of the scene's defaults."""
    scene = load_scene(SCENES / "stiff_skin.toml", {"model.builder": "krylov"}).sections
    assert scene.model.builder == "krylov"
    along, across, _ = scene.model.patch_nodes
    assert 3 * along * across * len(scene.model.shifts_Hz) == KRYLOV_MODES


def test_a_bound_that_says_nothing_is_none(verdicts: dict[str, Locality]) -> None:
    """In JSON there is no infinity; for a person it is no bound."""
    locality = verdicts["soft_core"]
    nothing = replace(locality, reduction=replace(locality.reduction, projection_error=2.0))
    assert nothing.to_dict()["balanced"]["certified_error"] is None
    request = Request(load_scene(SCENES / "soft_core.toml"), None, None, dense=False, tolerance=1e-6)
    assert "no bound" in describe_locality(request, nothing)
    assert "no bound" in describe_reduction(request, nothing.reduction)


@pytest.mark.parametrize("name", ["homogeneous", "soft_core", "stiff_skin"])
def test_the_numbers_behind_a_verdict(name: str, verdicts: dict[str, Locality]) -> None:
    verdict = verdicts[name]
    assert set(verdict.to_dict()) | {"scene", "contact_node", "compliance", "files"} == LOCALITY_KEYS
    in_band = [patch.error_in_band for patch in verdict.patches]
    by_volume = {patch.along * patch.along * patch.depth: patch.error_in_band for patch in verdict.patches}
    assert verdict.local == (in_band[0] <= GOOD_ERROR)
    assert by_volume[max(by_volume)] < by_volume[min(by_volume)]  # a larger patch misses less
    assert all(patch.fits == (patch.modes <= 192) for patch in verdict.patches)
    # The reduction of the whole body is certified against the largest of the strictly proper part; its measured error
    # cannot exceed it, at any frequency shown.
    allowed = verdict.reduction.certified_error * verdict.reduction.norm_N_m
    assert np.all(verdict.reduced_error * verdict.response_N_m <= allowed)
    assert verdict.node_share.sum() == pytest.approx(1.0)
    assert verdict.node_share[verdict.reduction.system.contact_node] == 0.0


def test_a_body_that_is_not_local_fails_the_check(tmp_path: Path) -> None:
    code, values = reduce_json(tmp_path, "--check-locality", str(SCENES / "soft_core.toml"))
    assert code == 1
    assert set(values) == LOCALITY_KEYS
    assert values["local"] is False
    assert values["verdict"].startswith("Not local.")
    assert (tmp_path / "locality.png").stat().st_size > 0
