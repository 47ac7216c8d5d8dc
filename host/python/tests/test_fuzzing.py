"""Fuzzing: what it writes is what it says, a finding is one, and what it has found stays mended."""

import base64
import csv
import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import ROOT

from palpate.fuzzing import command, ledger, libfuzzer
from palpate.fuzzing.draw import Draw
from palpate.fuzzing.outcome import Effort, Outcome
from palpate.fuzzing.records import RecordFuzz
from palpate.fuzzing.scenes import SceneFuzz
from palpate.fuzzing.targets import IN_PYTHON, TARGETS
from palpate.fuzzing.values import mutate_tree
from palpate.record import BadRecord, load
from palpate.replay import load_source


def quiet(done: int, total: int) -> None:
    pass


def test_every_target_is_run_and_has_a_corpus() -> None:
    assert sorted(command.listed_in_cmake()) == sorted(set(TARGETS) - set(IN_PYTHON))
    for target in TARGETS:
        lines = (ROOT / f"host/fuzz/corpus/{target}.txt").read_text().split()
        assert lines and all(base64.b64decode(line, validate=True) for line in lines)


def test_the_corpus_is_unpacked(tmp_path: Path) -> None:
    lines = (ROOT / "host/fuzz/corpus/board.txt").read_text().split()
    assert sorted(file.read_bytes() for file in libfuzzer.unpack("board", tmp_path).iterdir()) == sorted(
        base64.b64decode(line) for line in lines
    )


@pytest.mark.parametrize("target", [SceneFuzz, RecordFuzz])
def test_the_same_bytes_make_the_same_file(target: type[SceneFuzz | RecordFuzz], tmp_path: Path) -> None:
    def files(name: str) -> list[bytes]:
        (tmp_path / name).mkdir()
        fuzz = target(tmp_path / name)
        return [(fuzz.execute(data), fuzz.file.read_bytes())[1] for data in (b"", bytes(range(40, 80)), bytes(range(200, 256)))]

    first = files("a")
    assert len(set(first)) == 3
    if target is SceneFuzz:  # HDF5 files hold the time
        assert first == files("b")


def test_choices_reach_the_ends_of_their_ranges() -> None:
    assert [Draw(bytes([byte])).randrange(3) for byte in (0, 1, 2, 3)] == [0, 1, 2, 0]
    assert Draw(b"\xff\xff").randrange(65_536) == 65_535
    assert {Draw(bytes([byte])).randint(-2, 5) for byte in range(256)} == set(range(-2, 6))
    assert sum(Draw(bytes([byte])).chance(0.25) for byte in range(256)) == 64
    empty = Draw(b"")
    assert (empty.randrange(1), empty.randint(4, 9), empty.choice("ab"), empty.chance(0.9), empty.rest()) == (0, 4, "a", False, b"")


@pytest.mark.parametrize("target, runs", [("scene", 100), ("record", 20)])
def test_nothing_is_found(target: str, runs: int, tmp_path: Path) -> None:
    outcome = libfuzzer.run(target, Effort(runs, None, 5), tmp_path / target, quiet)
    assert (outcome.executions >= runs, outcome.finding) == (True, None)


def test_a_finding_is_told_with_its_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "broken.py"
    broken.write_text(
        "import palpate.fuzzing.guided as guided, palpate.fuzzing.scenes as scenes\n"
        "def load_scene(*_): raise KeyError('broken')\n"
        "scenes.load_scene = load_scene\n"
        "guided.main()\n"
    )
    monkeypatch.setattr(libfuzzer, "_command", lambda target, folder: [sys.executable, str(broken), target, str(folder)])
    outcome = libfuzzer.run("scene", Effort(100, None, 1), tmp_path / "out", quiet)
    assert outcome.finding is not None and "KeyError: 'broken'" in outcome.finding
    assert outcome.file is not None and outcome.file.exists()
    assert (tmp_path / "out/scene.toml").exists()


def test_a_target_that_fails_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "fuzz"
    program.write_text("#!/bin/sh\necho '#7 NEW cov: 3'\necho does not hold: this\nexit 77\n")
    program.chmod(0o755)
    monkeypatch.setattr(libfuzzer, "_command", lambda target, folder: [str(program)])
    outcome = libfuzzer.run("board", Effort(100, None, 1), tmp_path / "out", quiet)
    assert outcome.executions == 7
    assert outcome.finding == "does not hold: this\n"


def test_time_bounds_a_run(tmp_path: Path) -> None:
    outcome = libfuzzer.run("scene", Effort(None, 2, 1), tmp_path, quiet)
    assert outcome.executions > 0 and outcome.finding is None


def test_what_was_executed_is_added_up(tmp_path: Path) -> None:
    file = tmp_path / "ledger.csv"
    file.write_text(",".join(ledger.COLUMNS) + "\n")
    ledger.add([Outcome("board", 5, None, None), Outcome("can", 7, "found", None)], 3, "89abcde", file)
    ledger.add([Outcome("board", 6, None, None)], 4, "1234567", file)
    assert ledger.totals(file) == {"board": 11, "can": 7}
    assert [row[1] for row in csv.reader(file.read_text().splitlines()[1:])] == ["89abcde", "89abcde", "1234567"]
    assert [row[2:] for row in csv.reader(file.read_text().splitlines()[1:])] == [
        ["board", "3", "5", "0"], ["can", "3", "7", "1"], ["board", "4", "6", "0"],
    ]
    file.write_text("a,b\n")
    with pytest.raises(ValueError, match=r"ledger.csv: its columns are \['a', 'b'\]: must be date, commit"):
        ledger.totals(file)


def test_the_ledger_wants_a_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger, "ROOT", tmp_path)
    with pytest.raises(RuntimeError, match="the ledger wants the commit that was fuzzed: .*not a git repository"):
        ledger.commit()


def test_the_page_says_what_the_ledger_holds() -> None:
    page = (ROOT / "docs/fuzzing.md").read_text()
    stated = {name: int(number.replace(",", "")) for name, number in re.findall(r"^\| `(\w+)` \|.*\| ([\d,]+) \|$", page, re.MULTILINE)}
    assert stated == ledger.totals()
    assert set(stated) == set(TARGETS)
    assert f"**{sum(stated.values()):,}**" in page


def test_mutations_leave_their_source_alone() -> None:
    source = tomllib.loads((ROOT / "scenes/press.toml").read_text())
    changed = [mutate_tree(source, Draw(bytes(range(start, start + 30)))) != source for start in range(100)]
    assert sum(changed) > 50
    assert source == tomllib.loads((ROOT / "scenes/press.toml").read_text())


def text_attribute(h5: h5py.File) -> None:
    h5.attrs["closed"] = "x"


def infinite_rows(h5: h5py.File) -> None:
    h5.attrs["ticks"] = float("inf")


def text_for_numbers(h5: h5py.File) -> None:
    del h5["ticks/force_N"]
    h5["ticks/force_N"] = "x"


def no_text(h5: h5py.File) -> None:
    del h5["scene"]
    h5["scene"] = np.bytes_(b"\xa7")


def a_leap(h5: h5py.File) -> None:
    h5["ticks/tick"][5] = 2**32 - 1


@pytest.mark.parametrize(
    "change, message",
    [
        (text_attribute, "attribute closed is 'x'"),
        (infinite_rows, "attribute ticks is .*inf.*: must be a whole number"),
        (text_for_numbers, "ticks/force_N cannot be read"),
        (no_text, "/scene is no text"),
        (a_leap, "leaps by 4294967291"),
    ],
)
def test_damaged_records_are_refused(change: Callable[[h5py.File], None], message: str, tmp_path: Path) -> None:
    whole = RecordFuzz(tmp_path)
    whole.file.write_bytes((tmp_path / "whole.h5").read_bytes())
    with h5py.File(whole.file, "r+") as h5:
        change(h5)
    with pytest.raises(BadRecord, match=message):
        load_source(whole.file, {}, None)


def test_a_damaged_structure_is_refused(tmp_path: Path) -> None:
    RecordFuzz(tmp_path)
    whole = (tmp_path / "whole.h5").read_bytes()
    damaged = tmp_path / "damaged.h5"
    refused = 0
    for mark in (b"SNOD", b"TREE", b"HEAP"):  # symbol table, B-tree, names
        damaged.write_bytes(whole.replace(mark, b"XXXX"))
        with pytest.raises(BadRecord):
            load(damaged)
        refused += mark in whole
    assert refused > 0
