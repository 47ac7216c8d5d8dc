"""docs/porting.md: a new board is a folder of boards/ and a preset, and nothing else names it."""

import json
import subprocess
from pathlib import Path

import pytest

from palpate.paths import ROOT

BOARDS = ROOT / "boards"
SKELETONS = sorted(file.parent.name for file in BOARDS.glob("*/skeleton.txt"))
# What is built or run; not documentation, and not the tests of that very board.
PROGRAMS = ("boards", "firmware", "shared", "host", "run", "CMakeLists.txt", "pyproject.toml")
TESTS = ("_test.cpp", "test_", "documented_commands.py")


def presets(kind: str) -> dict[str, dict]:
    return {one["name"]: one for one in json.loads((ROOT / "CMakePresets.json").read_text())[kind]}


def test_there_is_a_skeleton() -> None:
    assert SKELETONS


@pytest.mark.parametrize("board", SKELETONS)
def test_no_program_names_it_but_its_preset(board: str) -> None:
    """Its own folder does not either: a copy of it is another board."""
    found = subprocess.run(
        ["grep", "-rlI", "--include=*.*pp", "--include=*.py", "--include=*.cmake", "--include=CMakeLists.txt", "--include=*.in",
         "--include=run", "--include=*.toml", board, *PROGRAMS],
        cwd=ROOT, capture_output=True, text=True, check=False,
    ).stdout.splitlines()  # fmt: skip
    assert [name for name in found if not Path(name).name.startswith(TESTS) and not name.endswith(TESTS)] == []


@pytest.mark.parametrize("board", SKELETONS)
def test_its_preset_is_complete(board: str) -> None:
    variables = presets("configurePresets")[board]["cacheVariables"]
    assert variables["PALPATE_BOARD"] == board
    assert {"PALPATE_CPU", "PALPATE_FPU"} <= set(variables)
    assert presets("buildPresets")[board]["configurePreset"] == board


@pytest.mark.parametrize("board", SKELETONS)
def test_hosts_do_not_arm_it(board: str) -> None:
    core = pytest.importorskip("palpate._core")
    assert board not in core.KNOWN_BOARDS
    assert not (BOARDS / board / "limits.hpp").exists()
    assert all(line.strip() for line in (BOARDS / board / "skeleton.txt").read_text().splitlines())
