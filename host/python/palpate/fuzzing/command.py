"""`palpate fuzz`."""

import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from palpate.fuzzing import native, python
from palpate.fuzzing.outcome import Outcome, Progress
from palpate.fuzzing.targets import SHORT_RUNS
from palpate.paths import ROOT


def run(
    targets: tuple[str, ...],
    runs: int | None,
    seed: int,
    keep: bool,
    progress: Callable[[str, str], AbstractContextManager[Progress]],
) -> list[Outcome]:
    """Fuzzes one target after another, to the first finding of each. runs: of each; None: SHORT_RUNS. keep: what was reached
    anew goes into the repository's corpus. Raises RuntimeError where Clang cannot build them, NotBuilt (native.py) where one
    has been left out."""
    if any(target not in python.TARGETS for target in targets):
        native.build()
    outcomes = []
    for target in targets:
        folder = ROOT / "out/fuzz" / target
        one = python.run if target in python.TARGETS else native.run
        with progress(f"fuzz {target}", " executions") as update:
            outcomes.append(one(target, runs or SHORT_RUNS[target], seed, folder, update))
        if keep and target not in python.TARGETS:
            native.keep(target, folder)
    return outcomes


def listed_in_cmake(file: Path = ROOT / "host/fuzz/CMakeLists.txt") -> list[str]:
    """The targets that CMake builds: a test holds TARGETS to them."""
    return re.findall(r"^palpate_fuzz\((\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
