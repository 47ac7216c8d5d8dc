#!/usr/bin/env python3
"""Lines and branches of the safety supervisor that its unit tests reach, counted by gcov; exit code 1 when one is missing.

The sources are compiled once more, without optimization and, as for a board, without exceptions. Every branch counts.

    python host/bench/supervisor_coverage.py
"""

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host/python"))

from palpate.mutants.firmware_build import FirmwareTest, NoBuild  # noqa: E402

CORE = ROOT / "firmware/core"
GUARDED = ("supervisor.cpp", "supervisor.hpp", "passivity.hpp", "motor_heat.hpp", "kept_tick.hpp", "outputs.hpp", "deadline_monitor.hpp", "limit_ranges.hpp")
# Headers are counted in the tests that call them; those of the supervisor itself need only be linked.
COMPILED = ("supervisor.cpp", "passivity_test.cpp", "motor_heat_test.cpp", "kept_tick_test.cpp", "outputs_test.cpp", "deadline_monitor_test.cpp", "limit_ranges_test.cpp")
# As the firmware is: calls have no second way out.
FLAGS = ("-O0", "-g0", "--coverage", "-fno-exceptions", "-DGTEST_HAS_EXCEPTIONS=0")
# Its own tests: those of other parts would reach it through the servo.
SUITES = ":".join(f"{name}.*" for name in (
    "AllStates", "Arming", "Calibration", "Currents", "Damping", "DeadlineMonitor", "DirectForce", "Faults", "Force", "KeptTick",
    "LimitRanges", "LinkLoss",
    "MotorHeat", "Outputs", "Passivity", "PassivityControl", "Supervisor", "SupervisorEdges",
))  # fmt: skip


@dataclass
class File:
    """How often each line, and each branch of a line, was taken."""

    line: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    branch: dict[tuple[int, int], int] = field(default_factory=lambda: defaultdict(int))

    def missing_lines(self) -> list[int]:
        return sorted(number for number, count in self.line.items() if count == 0)

    def missing_branches(self) -> list[int]:
        """The lines of branches that were never taken."""
        return sorted(number for (number, _), count in self.branch.items() if count == 0)


def _count(folder: Path, files: dict[str, File]) -> None:
    for data in sorted(folder.glob("*.gcda")):
        done = subprocess.run(["gcov", "--json-format", "--stdout", "--branch-probabilities", data.name], cwd=folder, capture_output=True, text=True,
                              timeout=120, check=True)  # fmt: skip
        for report in done.stdout.splitlines():
            for entry in json.loads(report)["files"]:
                path = Path(entry["file"])
                if path.parent != CORE or path.name not in GUARDED:
                    continue
                file = files[path.name]
                for line in entry["lines"]:
                    number = line["line_number"]
                    file.line[number] += line["count"]
                    for index, branch in enumerate(line["branches"]):
                        file.branch[(number, index)] += branch["count"]


def measure(folder: Path) -> dict[str, File]:
    """By name of the guarded file. Raises NoBuild, and RuntimeError where something cannot be compiled or a test fails."""
    build = FirmwareTest()
    sources = [CORE / name for name in COMPILED]
    # Emits every inline function, called or not, so that one without a test is seen.
    all_inline = folder / "all_inline.cpp"
    all_inline.write_text("".join(f'#include "firmware/core/{name}"\n' for name in GUARDED if name.endswith(".hpp")))
    jobs = [(source, folder / f"{source.name}.o", FLAGS) for source in sources]
    jobs.append((all_inline, folder / "all_inline.cpp.o", (*FLAGS, "-fkeep-inline-functions")))
    with ThreadPoolExecutor(2) as pool:
        for trouble in pool.map(lambda job: build.compile(*job), jobs):
            if trouble:
                raise RuntimeError(trouble)
    program = folder / "supervisor_coverage"
    if trouble := build.link([target for _, target, _ in jobs], program, ["--coverage"]):
        raise RuntimeError(trouble)
    done = subprocess.run([program, f"--gtest_filter={SUITES}", "--gtest_brief=1"], cwd=folder, capture_output=True, text=True, timeout=300)
    if done.returncode != 0:
        raise RuntimeError(done.stdout + done.stderr)
    files: dict[str, File] = {name: File() for name in GUARDED}
    _count(folder, files)
    return files


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        try:
            files = measure(Path(folder))
        except (NoBuild, RuntimeError) as error:
            print(f"supervisor_coverage: {error}", file=sys.stderr)
            return 2
    whole = True
    for name, file in files.items():
        lines, branches = file.missing_lines(), file.missing_branches()
        whole = whole and not lines and not branches
        print(f"{name:20} lines {len(file.line) - len(lines):4} of {len(file.line):4}  branches {len(file.branch) - len(branches):4} of {len(file.branch):4}"
              + (f"  missing: lines {lines}, branches on lines {branches}" if lines or branches else ""))  # fmt: skip
    return 0 if whole else 1


if __name__ == "__main__":
    sys.exit(main())
