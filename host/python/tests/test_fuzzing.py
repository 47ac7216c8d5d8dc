"""Fuzzing: what it writes is what it says, a finding is one, and what it has found stays mended."""

import base64
import random
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import ROOT

from palpate.fuzzing import command, native, python
from palpate.fuzzing.records import RecordFuzz
from palpate.fuzzing.targets import TARGETS
from palpate.fuzzing.values import mutate_tree
from palpate.record import BadRecord, load
from palpate.replay import load_source


def quiet(done: int, total: int) -> None:
    pass


def test_every_target_is_run_and_has_a_corpus() -> None:
    assert sorted(command.listed_in_cmake()) == sorted(set(TARGETS) - set(python.TARGETS))
    for target in command.listed_in_cmake():
        lines = (ROOT / f"host/fuzz/corpus/{target}.txt").read_text().split()
        assert lines and all(base64.b64decode(line, validate=True) for line in lines)


def test_the_corpus_is_unpacked(tmp_path: Path) -> None:
    lines = (ROOT / "host/fuzz/corpus/board.txt").read_text().split()
    assert sorted(file.read_bytes() for file in native.unpack("board", tmp_path).iterdir()) == sorted(
        base64.b64decode(line) for line in lines
    )


@pytest.mark.parametrize("target", sorted(python.TARGETS))
def test_the_same_seed_gives_the_same_inputs(target: str, tmp_path: Path) -> None:
    def inputs(name: str) -> list[bytes]:
        (tmp_path / name).mkdir()
        fuzz = python.TARGETS[target](tmp_path / name, 3)
        return [(fuzz.next(), fuzz.file.read_bytes())[1] for _ in range(5)]

    first = inputs("a")
    assert len(set(first)) > 1
    if target == "scene":  # HDF5 files hold the time
        assert first == inputs("b")


def test_nothing_is_found(tmp_path: Path) -> None:
    for target, runs in (("scene", 100), ("record", 20)):
        outcome = python.run(target, runs, 5, tmp_path / target, quiet)
        assert (outcome.executions, outcome.finding) == (runs, None)


def test_a_finding_is_told_with_its_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> None:
        raise KeyError("broken")

    monkeypatch.setattr("palpate.fuzzing.scenes.load_scene", broken)
    outcome = python.run("scene", 10, 1, tmp_path, quiet)
    assert outcome.executions == 1
    assert outcome.finding is not None and "KeyError: 'broken'" in outcome.finding
    assert outcome.file is not None and outcome.file.exists()


def test_a_target_that_fails_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "fuzz"
    program.write_text("#!/bin/sh\necho '#7 NEW cov: 3'\necho does not hold: this\nexit 77\n")
    program.chmod(0o755)
    monkeypatch.setattr(native, "_command", lambda target: [str(program)])
    outcome = native.run("board", 100, 1, tmp_path / "out", quiet)
    assert outcome.executions == 7
    assert outcome.finding == "does not hold: this\n"


def test_mutations_leave_their_source_alone() -> None:
    source = tomllib.loads((ROOT / "scenes/press.toml").read_text())
    draw = random.Random(1)
    changed = [mutate_tree(source, draw) != source for _ in range(100)]
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
    whole = RecordFuzz(tmp_path, 1)
    whole.file.write_bytes((tmp_path / "whole.h5").read_bytes())
    with h5py.File(whole.file, "r+") as h5:
        change(h5)
    with pytest.raises(BadRecord, match=message):
        load_source(whole.file, {}, None)


def test_a_damaged_structure_is_refused(tmp_path: Path) -> None:
    RecordFuzz(tmp_path, 1)
    whole = (tmp_path / "whole.h5").read_bytes()
    damaged = tmp_path / "damaged.h5"
    refused = 0
    for mark in (b"SNOD", b"TREE", b"HEAP"):  # symbol table, B-tree, names
        damaged.write_bytes(whole.replace(mark, b"XXXX"))
        with pytest.raises(BadRecord):
            load(damaged)
        refused += mark in whole
    assert refused > 0
