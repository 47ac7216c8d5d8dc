"""Targets of libFuzzer, run from the corpus in the repository: those in C++ (host/fuzz), built with Clang, and those in Python
(guided.py)."""

import base64
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from palpate.fuzzing.outcome import Effort, Outcome, Progress
from palpate.fuzzing.targets import IN_PYTHON
from palpate.paths import BUILD, ROOT

PRESET = "host-fuzz"
_CORPUS = ROOT / "host/fuzz/corpus"
_PYTHON = ROOT / "host/python"
# Of one input: a hang is a finding. The slowest target takes milliseconds.
_LONGEST_S = 20
_LONGEST_INPUT_BYTES = 2048
# Of what `keep` leaves in the repository for a target.
_MOST_CORPUS_BYTES = 16_000


class NotBuilt(RuntimeError):
    """A target that CMake has left out."""


def build() -> None:
    """Configures and builds all targets in C++. Raises RuntimeError with what the tools said."""
    for command in (
        ["cmake", "--preset", PRESET],
        ["cmake", "--build", "--preset", PRESET, "--target", "palpate_fuzz", "-j", str(os.cpu_count() or 1)],
    ):
        done = subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout}")


def run(target: str, effort: Effort, folder: Path, progress: Progress) -> Outcome:
    """To the end of the effort or to the first finding; inputs that reach something new are added to `folder`/corpus. Raises
    NotBuilt."""
    if target not in IN_PYTHON and not Path(_command(target, folder)[0]).is_file():
        raise NotBuilt(f"fuzz {target}: not built, for want of what it links: the crate of TinyUSB (cargo)")
    corpus = unpack(target, folder)
    command = [
        *_command(target, folder),
        f"-runs={-1 if effort.runs is None else effort.runs}",
        f"-max_total_time={effort.time_s or 0}",
        f"-seed={effort.seed}",
        f"-max_len={_LONGEST_INPUT_BYTES}",
        f"-timeout={_LONGEST_S}",
        f"-artifact_prefix={folder}/",
        "-print_final_stats=1",
        str(corpus),
    ]
    said: list[str] = []
    executions = 0
    began_s = time.monotonic()
    with _start(command) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                if match := re.match(r"#(\d+)\s|stat::number_of_executed_units: (\d+)", line):
                    executions = int(match[1] or match[2])
                    progress(executions, _expected(effort, executions, time.monotonic() - began_s))
                else:
                    said.append(line)
        except BaseException:
            process.kill()
            raise
    if process.returncode == 0:
        return Outcome(target, executions, None, None)
    written = [line.split()[-1] for line in said if "Test unit written to" in line]
    return Outcome(target, executions, "".join(said[-40:]), Path(written[-1]) if written else None)


def _expected(effort: Effort, executions: int, time_s: float) -> int:
    """Executions in all, by the rate until now."""
    if effort.runs is not None:
        return max(effort.runs, executions)
    return max(round(executions * (effort.time_s or 0) / max(time_s, 1e-3)), executions)


def _start(command: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**os.environ, "PYTHONPATH": str(_PYTHON)},
    )


def _command(target: str, folder: Path) -> list[str]:
    if target in IN_PYTHON:
        # Slow ones, which would not get to longer inputs by steps.
        return [sys.executable, "-m", "palpate.fuzzing.guided", target, str(folder), "-len_control=0"]
    return [str(BUILD / PRESET / f"host/fuzz/fuzz_{target}")]


def unpack(target: str, folder: Path) -> Path:
    """The repository's corpus as libFuzzer wants it: a folder with a file for each input."""
    corpus = folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    file = _CORPUS / f"{target}.txt"
    for i, line in enumerate(file.read_text(encoding="ascii").split() if file.exists() else []):
        (corpus / f"repository_{i}").write_bytes(base64.b64decode(line))
    return corpus


def keep(target: str, folder: Path) -> int:
    """Takes the smallest inputs of `folder`/corpus that reach all that the others do into the repository, the shortest
    first, 16 kB at most. Returns how many. Raises RuntimeError where libFuzzer cannot merge."""
    merged = folder / "merged"
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    command = [*_command(target, folder), "-merge=1", f"-max_len={_LONGEST_INPUT_BYTES}", str(merged), str(folder / "corpus")]
    with _start(command) as process:
        said, _ = process.communicate()
    if process.returncode != 0 or not any(merged.iterdir()):
        raise RuntimeError(f"{' '.join(command)} failed:\n{said[-2000:]}")
    inputs = sorted((file.read_bytes() for file in merged.iterdir()), key=lambda data: (len(data), data))
    lines: list[str] = []
    for data in inputs:
        lines.append(base64.b64encode(data).decode())
        if sum(map(len, lines)) > _MOST_CORPUS_BYTES:
            lines.pop()
            break
    _CORPUS.mkdir(exist_ok=True)
    (_CORPUS / f"{target}.txt").write_text("".join(f"{line}\n" for line in lines if line), encoding="ascii")
    return len(lines)
