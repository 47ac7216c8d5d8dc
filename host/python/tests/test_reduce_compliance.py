"""Local models against the full body's compliance."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import ROOT, palpate

from palpate import _core
from palpate.reduce.compliance import Comparison, candidates, comparable, compare_builders
from palpate.reduce.system import contact_system, linear_body, middle_of_top
from palpate.scene import Scene, SceneError, load_scene

SMALL = {"body.nodes": [6, 6, 6]}
# Bases are kept in single precision.
ROUNDING = 1e-5


def go_on(done: int, total: int) -> bool:
    return True


def small_scene(**overrides: Any) -> Scene:
    return load_scene(ROOT / "scenes/demo.toml", {**SMALL, **overrides})


def compare(press_m: float = 0.0, **overrides: Any) -> Comparison:
    scene = small_scene(**overrides)
    body = linear_body(_core, scene.to_dict())
    return compare_builders(_core, scene, contact_system(body, middle_of_top(body)), press_m, go_on)


@pytest.fixture(scope="module")
def at_rest() -> dict[str, Any]:
    return {one.name(): one for one in compare().models}


def test_the_bodys_compliance_is_that_of_its_matrices() -> None:
    found = compare()
    body = linear_body(_core, small_scene().to_dict())
    node = middle_of_top(body)
    own = np.flatnonzero(body.node == node)
    for i in range(0, len(found.frequency_Hz), 15):
        w = 2.0 * np.pi * found.frequency_Hz[i]
        dynamic = (body.stiffness_N_m + 1j * w * body.damping_N_s_m).toarray() - w * w * np.diag(body.mass_kg)
        exact = np.linalg.inv(dynamic)[np.ix_(own, own)]
        assert found.body_m_N[i] == pytest.approx(np.linalg.norm(exact, 2), rel=2e-6)


def test_models_of_the_whole_body_are_exact_at_rest_and_better_with_more_frequencies(at_rest: dict[str, Any]) -> None:
    assert at_rest["patch"].at_node[0] > 0.05
    assert at_rest["patch_rescaled"].at_node[0] < at_rest["patch"].at_node[0]
    assert at_rest["condensed"].at_node[0] < ROUNDING
    largest = [at_rest[f"krylov, frame, {shifts} Hz"].at_node.max() for shifts in ("0", "0, 20", "0, 20, 150")]
    assert largest[0] > 3 * largest[1] > 9 * largest[2] > 0
    middle = at_rest["krylov, frame, 0 + 20, 40, 300 Hz"]
    assert (middle.modes, middle.basis) == (84, 4032)
    assert max(middle.at_node.max(), middle.between_nodes.max()) < 0.02
    for name, one in at_rest.items():
        assert one.basis == 3 * (32 if name.startswith("hybrid") else 16) * one.modes, name
        if name.startswith("krylov"):
            assert one.at_node[0] < ROUNDING
            assert one.between_nodes[0] < ROUNDING


def test_pressed_in_the_tangent_of_the_frame_answers_better() -> None:
    models = {one.name(): one for one in compare(0.004).models}
    assert models["krylov, frame, 0 Hz"].at_node[0] < 0.5 * models["krylov, rest, 0 Hz"].at_node[0]
    assert models["krylov, frame, 0 Hz"].damping_coupling > 1e-3
    for one in models.values():
        assert np.all(one.damping_error <= one.damping_bound * (1 + 1e-6) + 1e-9)
    assert models["patch"].damping_error.max() > 0.01


def test_growing_modes_are_counted() -> None:
    """A node pressed in by more than a cell."""
    models = {one.name(): one for one in compare(0.012, **{"body.nodes": [8, 8, 8]}).models}
    assert models["patch"].limited_modes >= 1
    assert models["krylov, rest, 0 Hz"].limited_modes == 0


def test_candidates_fit_the_lattice_and_the_board() -> None:
    own = {"builder": "krylov", "tangent": "rest", "patch_nodes": [5, 5, 2], "shifts_Hz": [0.0, 7.0], "middle_shifts_Hz": [9.0],
           "near_nodes": 4}
    found = candidates(own, (12, 4, 12), 192, pressed=False)
    assert all(one["patch_nodes"] == [5, 4, 2] for one in found)
    assert (found[0]["shifts_Hz"], found[0]["middle_shifts_Hz"]) == ([0.0, 7.0], [9.0])
    assert [0.0, 20.0, 150.0] in [one["shifts_Hz"] for one in found]
    assert all(len(one["shifts_Hz"]) < 3 for one in candidates(own, (12, 12, 12), 192, pressed=False))
    # 25 nodes of a face and 4 below it are too many for a hybrid; 20 are not.
    assert not any(one["builder"] == "hybrid" for one in candidates(own, (12, 12, 12), 192, pressed=False))
    assert any(one["builder"] == "hybrid" for one in found)
    pressed = candidates(own, (12, 12, 12), 192, pressed=True)
    assert {one["tangent"] for one in pressed if one["builder"] == "krylov"} == {"rest", "frame"}
    assert found == [one for i, one in enumerate(found) if one not in found[:i]]


def test_only_a_contact_on_the_surface_of_a_block_has_models() -> None:
    square = linear_body(_core, load_scene(ROOT / "scenes/reproduce/square.toml", {"body.nodes": [5, 5]}).to_dict())
    assert not comparable(contact_system(square, middle_of_top(square)))
    block = linear_body(_core, small_scene().to_dict())
    assert comparable(contact_system(block, middle_of_top(block)))
    assert not comparable(contact_system(block, 2 + 6 * (2 + 6 * 3)))


def test_what_the_core_refuses_names_the_scene() -> None:
    scene = small_scene()
    body = linear_body(_core, scene.to_dict())
    inside = contact_system(body, 2 + 6 * (2 + 6 * 3))
    with pytest.raises(SceneError, match=r"demo\.toml: node: must lie on the surface"):
        compare_builders(_core, scene, inside, 0.0, go_on)


def test_the_command_compares_pressed_builders(tmp_path: Path) -> None:
    small = ("--set", "body.nodes=[6, 6, 6]", "--press", "0.002", "--out", str(tmp_path), "--json")
    done = palpate("reduce", "--check-locality", "scenes/demo.toml", *small)
    values = json.loads(done.stdout)["compliance"]
    assert values["press_m"] == 0.002
    first = values["models"][0]
    assert first["at_node"]["largest"] == max(first["at_node"]["relative"])
    assert first["at_node"]["static"] == first["at_node"]["relative"][0]
    assert (tmp_path / "compliance.png").stat().st_size > 0
    assert "compliance over 0 to 500 Hz, pressed in by 2 mm" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--press", "0.001"), "--press: only with --check-locality"),
        (("--check-locality", "scenes/demo.toml", "--press", "1"), "--press = 1: must be in [0, 0.1] m"),
    ],
)
def test_a_press_that_cannot_be_is_refused(arguments: tuple[str, ...], message: str) -> None:
    done = palpate("reduce", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
