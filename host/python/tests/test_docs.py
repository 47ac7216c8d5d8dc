"""The documentation agrees with the code."""

import json
import re
import sys
from pathlib import Path

import pytest
from command import ROOT

from palpate import docs
from palpate.scene import load_scene
from palpate.testing import build_site


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


def test_a_page_is_whole_where_it_is_read_as_it_is() -> None:
    """A forge shows a page as the file has it: nothing is included only when the site is built."""
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        assert "--8<--" not in page.read_text("utf-8"), page
    assert docs.rewrite("<!-- begin touch_a_body -->\n<!-- end touch_a_body -->").count((ROOT / docs.LISTINGS["touch_a_body"]).read_text().rstrip()) == 1


def test_the_example_in_the_scene_documentation_is_a_scene(tmp_path: Path) -> None:
    text = (ROOT / "docs/scenes.md").read_text("utf-8")
    examples = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert examples
    for example in examples:
        (tmp_path / "example.toml").write_text(example)
        load_scene(tmp_path / "example.toml")


def test_the_measured_numbers_are_those_of_a_run() -> None:
    sys.path.insert(0, str(ROOT / "host/bench"))
    try:
        from scene_numbers import measure
    finally:
        sys.path.pop(0)
    runs = json.loads(docs.NUMBERS.read_text("utf-8"))["runs"]
    (kept,) = [run for run in runs if (run["scene"], run["builder"]) == ("stick", "krylov")]
    # A process gives the record that QEMU gives, but for times (docs/architecture.md, "Lock-step").
    now = measure("stick", "krylov", board="native")
    again = "measure again: python host/bench/scene_numbers.py, then python -m palpate.docs"
    for key in ("ticks", "model_updates", "faults"):
        assert now[key] == kept[key], again
    # Other machines' mathematical functions round otherwise; the page shows three digits.
    for key in ("link_bytes_per_s", "peak_force_N", "rms_force_error_percent"):
        assert now[key] == pytest.approx(kept[key], rel=1e-4), again


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    with (tmp_path / "log").open("w") as log:
        assert build_site(log).failures == [], (tmp_path / "log").read_text()
    for page in (ROOT / "out/site").rglob("*.html"):
        fetched = re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=\"(?:https?:)?//[^\"]+", page.read_text("utf-8"))
        assert fetched == [], page
