"""The mutation test of the safety supervisor (`palpate bench mutants`): a few mutants of its 1,000, the whole run takes minutes."""

import json
from pathlib import Path

import pytest

from palpate.experiment import no_progress
from palpate.mutants import command
from palpate.mutants.changes import Mutant, mutants
from palpate.mutants.firmware_build import NoBuild
from palpate.mutants.laboratory import CORE, SOURCES, Laboratory, equivalents
from palpate.scene import SceneError

FILES = ["supervisor.cpp", "deadline_monitor.hpp"]
SAMPLE = 6  # one to three seconds each


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
    assert len(keys) > 900
    for key, reason in equivalents().items():
        assert key in keys
        assert len(reason) > 20, key


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """Of a run, its folder and what it returns."""
    out = tmp_path_factory.mktemp("mutants")
    try:
        return out, command.bench_mutants(FILES, SAMPLE, 2, out, no_progress)
    except NoBuild as error:
        pytest.skip(f"{error} (./run does it)")


def test_a_sample_is_killed(sample: tuple[Path, dict]) -> None:
    out, values = sample
    assert sum(row["tried"] for row in values["sources"]) == sum(row["killed"] for row in values["sources"]) == SAMPLE
    assert values["survivors"] == [] and values["known_before"] == 0
    assert json.loads((out / command.RESULTS).read_text())["sources"] == values["sources"]
    assert f"{SAMPLE:>8}{SAMPLE:>8}" in command.format_table(values)


def test_a_run_goes_on_where_it_was_interrupted(sample: tuple[Path, dict]) -> None:
    out, _ = sample
    file = out / command.DONE
    lines = file.read_text().splitlines()
    assert len(lines) == 1 + SAMPLE
    # The last one was being written.
    file.write_text("\n".join([*lines[:-1], lines[-1][:20]]))
    values = command.bench_mutants(FILES, SAMPLE, 2, out, no_progress)
    assert values["known_before"] == SAMPLE - 1 and values["survivors"] == []
    # A line that is broken is passed over, and the next run knows them all; of other sources it knows none.
    fingerprint = json.loads(lines[0])["fingerprint"]
    for known, number in ((fingerprint, SAMPLE), ("another", 0)):
        done = command._Done(file, known)
        done.close()
        assert len(done.killed) == number


def test_a_harmless_change_is_not_killed_nor_one_that_no_test_sees(tmp_path: Path) -> None:
    """Tests do not fail of themselves; of a header, too, whose mutant must be what the tests are compiled with."""
    try:
        laboratory = Laboratory(tmp_path)
    except NoBuild as error:
        pytest.skip(f"{error} (./run does it)")
    for file in ("supervisor.cpp", "deadline_monitor.hpp"):
        harmless = next(m for m in mutants(file, (CORE / file).read_text()) if m.key in equivalents())
        assert not laboratory.is_killed(harmless)
    wrong = next(m for m in mutants("deadline_monitor.hpp", (CORE / "deadline_monitor.hpp").read_text()) if m.after == "return true;")
    assert laboratory.is_killed(wrong)


@pytest.mark.parametrize(("amount", "word"), [((0, 2), "--sample = 0"), ((1, 0), "--jobs = 0"), ((None, 1000), "--jobs = 1000")])
def test_a_bad_amount_is_named(amount: tuple, word: str) -> None:
    with pytest.raises(SceneError, match=word):
        command.check_amount(*amount)
