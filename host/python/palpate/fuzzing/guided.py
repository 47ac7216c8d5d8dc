"""A target in Python as a program of libFuzzer (atheris), which is guided by what of palpate has run.

    python -m palpate.fuzzing.guided TARGET FOLDER [arguments of libFuzzer]

The file with which something was found stays in FOLDER.
"""

import resource
import shlex
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import atheris

# What makes the inputs is not what is to be covered.
_OURS = [f"palpate.fuzzing.{name}" for name in ("draw", "records", "scenes", "values")]
with atheris.instrument_imports(include=["palpate", "tomllib"], exclude=_OURS):
    from palpate.fuzzing.records import RecordFuzz
    from palpate.fuzzing.scenes import SceneFuzz

# Of the process: what allocates without bound is a finding, before it is the machine's end.
_MOST_BYTES = 8 << 30


class Target(Protocol):
    """One execution after another."""

    def execute(self, data: bytes) -> None:
        """Makes a file by choices from `data` and decodes it; raises what is a finding."""


_TARGETS: dict[str, Callable[[Path], Target]] = {"scene": SceneFuzz, "record": RecordFuzz}


def main() -> None:
    """Ends the process."""
    _, name, folder, *arguments = sys.argv
    target = _TARGETS[name](Path(folder))
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES if hard < 0 else min(_MOST_BYTES, hard), hard))
    warnings.simplefilter("ignore")
    # To merge it starts itself, by the first word of its command line, through a shell.
    itself = shlex.join([sys.executable, "-m", "palpate.fuzzing.guided", name, folder])
    atheris.Setup([itself, *arguments], target.execute)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
