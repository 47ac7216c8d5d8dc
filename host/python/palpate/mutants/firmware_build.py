"""Parts of firmware_test compiled once more, with other flags or other sources, and linked with what the build has made of the rest."""

import json
import os
import shlex
import subprocess
from collections.abc import Sequence
from pathlib import Path

from palpate.paths import ROOT

BUILD = ROOT / os.environ.get("PALPATE_BUILD_HOST", "build/host")
_TEST = "firmware/firmware_test"


class NoBuild(RuntimeError):
    """The host has not been built, or without this test."""


def _run(command: Sequence[str], cwd: Path = BUILD) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=600)


def _commands() -> dict[str, list[str]]:
    """Compilers' command lines, by source."""
    file = BUILD / "compile_commands.json"
    if not file.exists():
        raise NoBuild(f"{file} is missing: cmake --preset host, and build its target firmware_test")
    return {entry["file"]: shlex.split(entry["command"]) for entry in json.loads(file.read_text())}


class FirmwareTest:
    """The test of the firmware as the host's preset builds it."""

    def __init__(self) -> None:
        self._compilers = _commands()
        (self._library,) = [c for f, c in self._compilers.items() if f == str(ROOT / "firmware/core/supervisor.cpp")]
        link = _run(["ninja", "-t", "commands", _TEST]).stdout.strip().splitlines()
        if not link or not (BUILD / _TEST).exists():
            raise NoBuild(f"{BUILD / _TEST} is missing: build the target firmware_test of the host's preset")
        self._link = [part for part in shlex.split(link[-1]) if part not in (":", "&&")]

    @property
    def program(self) -> Path:
        """As the build has it."""
        return BUILD / _TEST

    def compiler(self, source: Path, flags: Sequence[str], instead_of: Path | None = None) -> list[str]:
        """Command line without -c, -o and the source; as of another source where this one is not in the build."""
        known = self._compilers.get(str(instead_of or source), self._library)
        kept = known[: known.index("-o")]
        return [part for part in kept if not part.startswith(("-O", "-W"))] + ["-w", *flags]

    def compile(self, source: Path, target: Path, flags: Sequence[str], instead_of: Path | None = None) -> str:
        """Empty, or what the compiler says against it."""
        done = _run([*self.compiler(source, flags, instead_of), "-c", str(source), "-o", str(target)], target.parent)
        return "" if done.returncode == 0 else done.stderr

    def link(self, objects: Sequence[Path], target: Path, flags: Sequence[str] = ()) -> str:
        """With these objects in place of those of the same name; empty, or what the linker says against it."""
        replaced = {o.name for o in objects}
        command = [part for part in self._link if Path(part).name not in replaced]
        command[command.index("-o") + 1] = str(target)
        # Before the libraries: what these objects define is not taken from there.
        done = _run([command[0], *flags, *map(str, objects), *command[1:]])
        return "" if done.returncode == 0 else done.stderr
