"""Compiles a mutant and runs the supervisor's tests on it."""

import hashlib
import subprocess
import tempfile
import tomllib
from pathlib import Path

from palpate.mutants.changes import Key, Mutant
from palpate.mutants.firmware_build import FirmwareTest
from palpate.paths import ROOT

CORE = ROOT / "firmware/core"
EQUIVALENT = ROOT / "host/bench/supervisor_mutants.toml"
_DECISIONS = "Arming.*:Calibration.*:Currents.*:Damping.*:DirectForce.*:Faults.*:Force.*:LinkLoss.*:PassivityControl.*:Supervisor.*:SupervisorEdges.*"
_LONG_WALK = "AllStates.*"  # for those that nothing else has killed
# Mutated file -> what is compiled with it, and the tests that are to notice; further tests, with more compiled, for those that these have not killed. All
# that holds limits and latches of the supervisor.
SOURCES: dict[str, tuple[tuple[tuple[str, ...], str], ...]] = {
    "supervisor.cpp": ((("supervisor.cpp",), _DECISIONS), ((), _LONG_WALK)),
    "supervisor.hpp": ((("supervisor_defaults_test.cpp",), "SupervisorDefaults.*"), (("supervisor.cpp",), _DECISIONS), ((), _LONG_WALK)),
    "passivity.hpp": ((("passivity_test.cpp",), "Passivity.*"), (("supervisor.cpp",), "PassivityControl.*")),
    "motor_heat.hpp": ((("motor_heat_test.cpp",), "MotorHeat.*"),),
    "kept_tick.hpp": ((("kept_tick_test.cpp",), "KeptTick.*"),),
    "limit_ranges.hpp": ((("limit_ranges_test.cpp",), "LimitRanges.*"),),
    "deadline_monitor.hpp": ((("deadline_monitor_test.cpp",), "DeadlineMonitor.*"),),
    "outputs.hpp": ((("outputs_test.cpp",), "Outputs.*"),),
}
# With the standard library's own checks: an index beyond an array ends the test.
FLAGS = ("-O0", "-g0", "-D_GLIBCXX_ASSERTIONS")
# What all tests include, compiled once.
_TESTS_INCLUDE = "#include <gtest/gtest.h>\n#include <algorithm>\n#include <array>\n#include <cmath>\n#include <random>\n"
# A mutant that runs longer than this does not end: the tests take 2 s.
LONGEST_S = 60.0


def equivalents() -> dict[Key, str]:
    """Mutants that change nothing, with the reason of each."""
    listed = tomllib.loads(EQUIVALENT.read_text("utf-8"))["equivalent"]
    return {(entry["file"], entry["before"], entry["after"]): entry["reason"] for entry in listed}


class Laboratory:
    """Works in a folder of its own. Raises NoBuild where the host or the test has not been built."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._build = FirmwareTest()
        self._source = {name: (CORE / name).read_text("utf-8") for name in SOURCES}
        self._included: Path | None = None

    def expect_many(self) -> None:
        """What all tests include is compiled beforehand, which takes as long as a few of them."""
        self._included = self._folder / "included.hpp"
        self._included.write_text(_TESTS_INCLUDE, encoding="utf-8")
        flags = (*FLAGS, "-x", "c++-header")
        if trouble := self._build.compile(self._included, self._folder / "included.hpp.gch", flags, CORE / "outputs_test.cpp"):
            raise RuntimeError(trouble)

    @property
    def fingerprint(self) -> str:
        """Of all that a result depends on."""
        compiled = sorted({name for trials in SOURCES.values() for sources, _ in trials for name in sources})
        files = [*(CORE / name for name in (*SOURCES, *compiled)), self._build.program]
        known = hashlib.sha256(repr((FLAGS, SOURCES)).encode())
        for file in files:
            known.update(file.read_bytes())
        return known.hexdigest()

    def is_killed(self, mutant: Mutant | None, file: str = "supervisor.cpp") -> bool:
        """By the compiler, which refuses it, or by a test; None: the source `file` as it is."""
        with tempfile.TemporaryDirectory(dir=self._folder) as name:
            folder = Path(name)
            overlay = folder / "firmware/core"
            overlay.mkdir(parents=True)
            if mutant is not None:
                file = mutant.file
                (overlay / file).write_text(mutant.apply(self._source[file]), encoding="utf-8")
            objects: list[Path] = []
            program = folder / "mutant"
            for compiled, suite in SOURCES[file]:
                for source in compiled:
                    changed = overlay / source
                    target = folder / f"{source}.o"
                    if self._build.compile(changed if changed.exists() else CORE / source, target, self._flags(source, folder), CORE / source):
                        return True
                    objects.append(target)
                if compiled and (trouble := self._build.link(objects, program)):
                    raise RuntimeError(trouble)
                if self._fails(program, suite):
                    return True
            return False

    def _flags(self, source: str, folder: Path) -> tuple[str, ...]:
        """The mutant is looked for before the source tree's own headers."""
        included = ("-include", str(self._included)) if self._included is not None and source.endswith("_test.cpp") else ()
        return (*included, "-iquote", str(folder), *FLAGS)

    @staticmethod
    def _fails(program: Path, suite: str) -> bool:
        try:
            done = subprocess.run([program, f"--gtest_filter={suite}", "--gtest_fail_fast", "--gtest_brief=1"], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL, timeout=LONGEST_S)  # fmt: skip
        except subprocess.TimeoutExpired:
            return True
        return done.returncode != 0
