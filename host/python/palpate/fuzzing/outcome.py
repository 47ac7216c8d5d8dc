"""What came of fuzzing a target."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Outcome:
    """executions: of inputs, those of the corpus among them. finding: what went wrong, None: nothing did; file: the
    input with which it does, where there is one."""

    target: str
    executions: int
    finding: str | None
    file: Path | None
