"""The mutation test of the safety supervisor (host/bench/supervisor_mutants.py): a few mutants of its 550, the whole run takes minutes."""

import sys
from pathlib import Path

import pytest

from palpate.paths import ROOT

sys.path.insert(0, str(ROOT / "host/bench"))
import supervisor_mutants
from firmware_build import NoBuild
from supervisor_mutants import CORE, GUARDED, SOURCES, Laboratory, Mutant, equivalents, mutants

SAMPLE = 10  # a second or two each


def after(code: str) -> set[str]:
    return {mutant.after for mutant in mutants("supervisor.cpp", code)}


def test_changes_of_a_line() -> None:
    assert after("if (a < b) faults |= bit(Fault::x);") == {
        "if (a <= b) faults |= bit(Fault::x);", "if (a >= b) faults |= bit(Fault::x);", "if (a < b) faults = bit(Fault::x);",
        "if (true) faults |= bit(Fault::x);", "if (false) faults |= bit(Fault::x);",
    }  # fmt: skip
    assert after("state.token = 0;") == {"state.token = 1;", ";"}
    assert after("  return !a ? 1.5f : b;") == {"return a ? 1.5f : b;", "return !a ? 2.5f : b;", "return !a ? 3.0f : b;", "return !a ? b : 1.5f;"}
    for untouched in ("// a < b", "#include <array>", "std::array<float, 3> x;", "}"):
        assert after(untouched) == set()


def test_a_change_is_made_in_its_line_only() -> None:
    source = "a = 1;\n  b = 1;\na = 1;\n"
    assert Mutant("x", 2, "b = 1;", "b = 2;").apply(source) == "a = 1;\n  b = 2;\na = 1;\n"


def test_what_is_listed_as_equivalent_is_a_mutant_with_a_reason() -> None:
    keys = {mutant.key for name in SOURCES for mutant in mutants(name, (CORE / name).read_text())}
    assert len(keys) > 500
    for key, reason in equivalents().items():
        assert key in keys
        assert len(reason) > 20, key


def test_a_sample_is_killed_and_a_harmless_change_is_not(tmp_path: Path) -> None:
    try:
        laboratory = Laboratory(tmp_path)
    except NoBuild as error:
        pytest.skip(f"{error} (./run does it)")
    # One that is listed as equivalent survives: tests do not fail of themselves.
    harmless = next(m for m in mutants("supervisor.cpp", (CORE / "supervisor.cpp").read_text()) if m.key in equivalents())
    assert not laboratory.is_killed(harmless)
    done = supervisor_mutants.run(list(GUARDED), SAMPLE, 2)
    assert done["tried"] == SAMPLE
    assert done["survivors"] == []
