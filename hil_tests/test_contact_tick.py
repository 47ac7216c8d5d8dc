"""The contact tick on the emulated Cortex-M4F keeps its budget of instructions: a short run of the benchmark."""

import json
import subprocess
import sys

import pytest
from board_peer import BUILD_MPS2, REPOSITORY

_SITUATIONS = 500
# Of the 125,000 instructions of a servo tick: a fifth is for the rest of its work (encoders, kinematics, supervision,
# currents, trace; less than 10,000) and for situations that the short run does not contain (10,000 reach 101,110).
_BUDGET = 100_000
_KINDS = {"free", "first_contact", "stick", "slip", "edge_crossing", "separation"}
_SEARCHES = {"free", "first_contact"}
# Far above the second that it takes: a run that needs it has hung.
_WATCHDOG_S = 60


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    out = tmp_path_factory.mktemp("contact_tick") / "report.json"
    image = BUILD_MPS2 / "boards/mps2_an386/contact_tick_mps2_an386.elf"
    subprocess.run([sys.executable, str(REPOSITORY / "host/bench/contact_tick.py"), "--situations", str(_SITUATIONS),
                    "--image", str(image), "--out", str(out)], check=True, timeout=_WATCHDOG_S)
    return json.loads(out.read_text())


def test_every_kind_of_tick_is_measured(report):
    assert report["situations"] == _SITUATIONS
    for size, kinds in report["instructions"].items():
        assert set(kinds) == _KINDS, size
        assert sum(of["ticks"] for kind in kinds.values() for of in kind.values()) == 2 * _SITUATIONS


def over_budget(report, chosen):
    return {(size, kind, state): of["worst"] for size, kinds in report["instructions"].items()
            for kind in chosen for state, of in kinds[kind].items() if of["worst"] > _BUDGET}


def test_the_worst_tick_in_contact_keeps_the_budget(report):
    assert over_budget(report, _KINDS - _SEARCHES) == {}


def test_the_worst_search_for_a_contact_keeps_the_budget(report):
    assert over_budget(report, _SEARCHES) == {}


def test_instructions_are_counted_not_timed(report):
    # A tick touches every mode several times, and cannot be cheaper than that.
    for kinds in report["instructions"].values():
        assert all(of["median"] > 2_000 for kind in kinds.values() for of in kind.values())
