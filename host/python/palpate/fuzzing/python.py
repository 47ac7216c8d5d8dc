"""Targets in Python: seeded mutations, one execution after another in this process."""

import resource
import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Protocol

from palpate.fuzzing.outcome import Outcome, Progress
from palpate.fuzzing.records import RecordFuzz
from palpate.fuzzing.scenes import SceneFuzz

# Of one input: a hang is a finding. A slow machine takes a second for the largest.
_LONGEST_S = 30
# Of the process: what allocates without bound is a finding, before it is the machine's end.
_MOST_BYTES = 8 << 30


class Target(Protocol):
    """One execution after another, from a seed."""

    file: Path

    def next(self) -> None:
        """Writes the next input to `file`."""

    def execute(self) -> None:
        """Decodes it; raises what is a finding."""


TARGETS: dict[str, Callable[[Path, int], Target]] = {"scene": SceneFuzz, "record": RecordFuzz}


def run(target: str, runs: int, seed: int, folder: Path, progress: Progress) -> Outcome:
    """So many executions, or up to the first finding, whose input stays in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    fuzz = TARGETS[target](folder, seed)
    with _limits(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for i in range(runs):
            fuzz.next()
            try:
                signal.alarm(_LONGEST_S)
                fuzz.execute()
            except Exception:  # any that is not the target's own refusal
                return Outcome(target, i + 1, traceback.format_exc(), fuzz.file)
            finally:
                signal.alarm(0)
            progress(i + 1, runs)
    return Outcome(target, runs, None, None)


def _too_long(_: int, __: FrameType | None) -> None:
    raise TimeoutError(f"an input took longer than {_LONGEST_S} s")


@contextmanager
def _limits() -> Iterator[None]:
    handler = signal.signal(signal.SIGALRM, _too_long)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES if hard < 0 else min(_MOST_BYTES, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.signal(signal.SIGALRM, handler)
