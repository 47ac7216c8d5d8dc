"""Measures what docs/faults.md shows: the fault matrix of every medium, by groups, the firmware as a process.

`python host/bench/fault_numbers.py` (some minutes) writes docs/numbers/faults.json; `python -m palpate.docs` then renews the page. The
pictures there are those of `./run bench faults`. All numbers are of virtual time: a second run gives the same.
"""

import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host/python"))

from palpate import _core, cli  # noqa: E402
from palpate.faults import cases, command, groups  # noqa: E402

BOARD = "native"


def measure(medium: str) -> dict[str, Any]:
    """The numbers that the page has of one medium."""
    good, results, valid_ticks = command.run_matrix(_core, cases.all_cases(medium), BOARD, medium, cli._progress)
    values = command.to_dict(good, results, valid_ticks, BOARD, medium, quick=False)
    return kept(values)


def kept(values: dict[str, Any]) -> dict[str, Any]:
    """Of the content of a faults.json."""
    closest = groups.closest(values["cases"])
    return {
        "passed": values["passed"],
        "fault_free": values["fault_free"],
        "closest": {"case": closest["name"], "left_N": -closest["excess_N"]},
        "groups": groups.by_group(values["cases"]),
    }


if __name__ == "__main__":
    measured = {"board": BOARD, "media": {medium: measure(medium) for medium in cases.MEDIA}}
    (ROOT / "docs/numbers/faults.json").write_text(json.dumps(measured, indent=1) + "\n")
