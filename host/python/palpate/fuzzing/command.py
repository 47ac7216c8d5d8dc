"""`palpate fuzz`."""

import re
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from palpate.fuzzing import libfuzzer
from palpate.fuzzing.outcome import Effort, Outcome, Progress
from palpate.fuzzing.targets import IN_PYTHON, SHORT_RUNS
from palpate.paths import ROOT


def run(
    targets: tuple[str, ...],
    effort: Effort,
    keep: bool,
    progress: Callable[[str, str], AbstractContextManager[Progress]],
) -> list[Outcome]:
    """Fuzzes one target after another, to the first finding of each. effort: of each; without runs and time: SHORT_RUNS.
    keep: what was reached anew goes into the repository's corpus. Raises RuntimeError where Clang cannot build them,
    NotBuilt (libfuzzer.py) where one has been left out."""
    if any(target not in IN_PYTHON for target in targets):
        print("building what is fuzzed; the first time takes minutes", file=sys.stderr, flush=True)
        libfuzzer.build()
    outcomes = []
    for target in targets:
        folder = ROOT / "out/fuzz" / target
        its = effort if effort.runs or effort.time_s else replace(effort, runs=SHORT_RUNS[target])
        with progress(f"fuzz {target}", " executions") as update:
            outcomes.append(libfuzzer.run(target, its, folder, update))
        if keep:
            libfuzzer.keep(target, folder)
    return outcomes


def listed_in_cmake(file: Path = ROOT / "host/fuzz/CMakeLists.txt") -> list[str]:
    """The targets that CMake builds: a test holds TARGETS to them."""
    return re.findall(r"^palpate_fuzz\((\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
