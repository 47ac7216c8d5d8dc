"""How long a target is fuzzed, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Effort:
    """One of the two: so many executions, or as many as there are in a time; and the seed of the mutations."""

    runs: int | None
    time_s: int | None
    seed: int


@dataclass(frozen=True)
class Outcome:
    """executions: of inputs, those of the corpus among them. finding: what went wrong, None: nothing did; file: the
    input with which it does, where there is one."""

    target: str
    executions: int
    finding: str | None
    file: Path | None
