"""palpate.image_budgets reads the tables that the build prints."""

from pathlib import Path

import pytest

from palpate import image_budgets
from palpate.image_budgets import Budget, Table, parse
from palpate.worst_tick import Worst, report, table

# As boards/cmake/check_image.py writes it.
IMAGE = """\
palpate_nucleo_g474re_usb.elf              bytes    budget
  flash                                  106,264   262,144     41%
  RAM, stack included                    114,044   114,688     99%
  deepest stack                            4,448     4,672     95%
    start_up                               1,512
    or something_else
"""


def test_the_table_of_an_image() -> None:
    read = parse(IMAGE.splitlines())
    assert read == Table("palpate_nucleo_g474re_usb.elf", (
        Budget("flash", 106_264, 262_144, "bytes"), Budget("RAM, stack included", 114_044, 114_688, "bytes"), Budget("deepest stack", 4448, 4672, "bytes")))
    assert read.rows[2].share == pytest.approx(0.952, abs=1e-3)


def test_the_table_of_the_longest_tick() -> None:
    read = parse(table("mps2_an386", Worst(70_000, 100_000)))
    assert [(row.used, row.budget, row.unit) for row in read.rows] == [(126_000, 119_000, "cycles"), (126_000, 60_000, "cycles"), (180_000, 170_000, "cycles")]
    assert read.rows[0].share > 1.0 and read.name == "worst tick, slide at 10 cm/s"


def test_what_is_not_measured_is_no_table(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert parse([]).rows == () and parse(report("other", lambda: __import__("palpate.worst_tick").worst_tick.measure("other"))[1]).rows == ()
    monkeypatch.setattr(image_budgets, "BUILD", tmp_path)
    assert image_budgets.tables("some") == []
    folder = image_budgets.folder("some")
    folder.mkdir(parents=True)
    (folder / "palpate_some_can_fd.elf.budget.txt").write_text(IMAGE)
    (folder / image_budgets.WORST_TICK_FILE).write_text("worst tick: not measured: why\n")
    assert image_budgets.tables("some") == []
    assert [one.name for one in image_budgets.tables("some", "canfd")] == ["palpate_nucleo_g474re_usb.elf"]
