"""The documentation agrees with the code."""

import re
from pathlib import Path

from command import ROOT

from palpate import docs
from palpate.scene import load_scene


def test_generated_tables_are_up_to_date() -> None:
    assert docs.outdated() == [], "run: python -m palpate.docs"


def test_outdated_tables_are_noticed(tmp_path: Path) -> None:
    file = tmp_path / "scenes.md"
    file.write_text("before\n<!-- begin scene_keys -->\nold\n<!-- end scene_keys -->\nafter\n")
    assert docs.outdated([file]) == [file]
    file.write_text(docs.rewrite(file.read_text()))
    assert docs.outdated([file]) == []
    assert file.read_text().startswith("before\n")
    assert file.read_text().endswith("\nafter\n")


def test_the_example_in_the_scene_documentation_is_a_scene(tmp_path: Path) -> None:
    text = (ROOT / "docs/scenes.md").read_text("utf-8")
    examples = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert examples
    for example in examples:
        (tmp_path / "example.toml").write_text(example)
        load_scene(tmp_path / "example.toml")
