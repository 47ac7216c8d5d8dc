"""Keys of a scene that are set from the command line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import ROOT, palpate

from palpate.scene import SceneError, load_recorded_scene, load_scene
from palpate.scene_overrides import (
    OVERRIDE_COMMENT,
    apply_overrides,
    exact_override,
    format_override,
    parse_override,
    split_overrides,
)
from palpate.tip_path import TipPath

SCENE = ROOT / "scenes/press.toml"


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("contact.friction=0.5", "contact.friction", 0.5),
        ("duration_s = 2.0", "duration_s", 2.0),
        ("model.patch_nodes=[4, 4, 2]", "model.patch_nodes", [4, 4, 2]),
        ("board.name=native", "board.name", "native"),
        ('path.csv="a.csv"', "path.csv", "a.csv"),
        ("outputs.csv=false", "outputs.csv", False),
        ("hand.grip_changes=[{ time_s = 1.0, grip = 0.0 }]", "hand.grip_changes", [{"time_s": 1.0, "grip": 0.0}]),
    ],
)
def test_values_are_toml_and_bare_words_are_strings(text: str, name: str, value: Any) -> None:
    assert parse_override(text) == (name, value)
    assert parse_override(format_override(name, value)) == (name, value)


@pytest.mark.parametrize("text", ["contact.friction", "=1", "a..b=1", "contact.friction=", "contact.friction=[1,", "a b=1"])
def test_what_is_not_key_and_value_is_refused(text: str) -> None:
    with pytest.raises(SceneError, match="--set"):
        parse_override(text)


def test_sections_are_made_where_they_are_missing() -> None:
    table: dict[str, Any] = {"body": {"nodes": [2, 2, 2]}}
    apply_overrides(table, {"body.spacing_m": 0.02, "contact.friction": 1.0, "title": "x"})
    assert table == {
        "body": {"nodes": [2, 2, 2], "spacing_m": 0.02},
        "contact": {"friction": 1.0},
        "title": "x",
    }
    with pytest.raises(SceneError, match="title is not a section"):
        apply_overrides(table, {"title.size": 1})


def test_a_scene_takes_overrides_and_its_text_tells_them() -> None:
    scene = load_scene(SCENE, {"contact.friction": 0.25, "board.name": "native"})
    assert scene.sections.contact.friction == 0.25
    assert scene.sections.board.name == "native"
    assert scene.text.startswith(load_scene(SCENE).text)
    assert "\n# --set contact.friction=0.25" in scene.text
    path = TipPath(np.array([0.0, 1.0]), np.full((2, 3), 0.01), "linear")
    again = load_recorded_scene(SCENE, scene.text, {"contact.friction": 0.5}, path)
    assert again.sections.contact.friction == 0.5
    assert again.sections.board.name == "native"
    assert again.path is path
    assert again.text == load_scene(SCENE, {"contact.friction": 0.5, "board.name": "native"}).text


@pytest.mark.parametrize(
    "value",
    [0.1 + 0.2, 1e-300, -3, 10**15, True, "two words", "ein \"é\"\n\x7f\\", "native", [1.0, [2, "x"]], [{"time_s": 0.1, "a b": 1}]],
    ids=str,
)
def test_the_text_of_a_scene_gives_its_overrides_back_to_the_last_digit(value: Any) -> None:
    text = f"title = 'x'\n# --set not.at.the.end=1\n\n{OVERRIDE_COMMENT}a.b=1{OVERRIDE_COMMENT}{exact_override('c.d', value)}"
    own, overrides = split_overrides(text)
    assert own == "title = 'x'\n# --set not.at.the.end=1\n\n"
    assert overrides == {"a.b": 1, "c.d": value}
    assert type(overrides["c.d"]) is type(value)


def test_overrides_are_checked_like_the_file() -> None:
    with pytest.raises(SceneError, match=r"contact\.friction = -1"):
        load_scene(SCENE, {"contact.friction": -1.0})
    with pytest.raises(SceneError, match="unknown key"):
        load_scene(SCENE, {"contact.frction": 1.0})


def test_the_command_line_refuses_on_one_line(tmp_path: Path) -> None:
    done = palpate("run", str(SCENE), "--set", "contact.friction", "--out", str(tmp_path / "out"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "--set contact.friction: must be section.key=value, as in contact.friction=0.5\n"
