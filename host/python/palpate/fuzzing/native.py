"""Targets of libFuzzer (host/fuzz): built with Clang, run from the corpus in the repository."""

import base64
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from palpate.fuzzing.outcome import Outcome, Progress
from palpate.paths import BUILD, ROOT

PRESET = "host-fuzz"
_CORPUS = ROOT / "host/fuzz/corpus"
# Of one input: a hang is a finding. The slowest target takes milliseconds.
_LONGEST_S = 20
_LONGEST_INPUT_BYTES = 2048
# Of what `keep` leaves in the repository for a target.
_MOST_CORPUS_BYTES = 16_000


class NotBuilt(RuntimeError):
    """A target that CMake has left out."""


def build() -> None:
    """Configures and builds all targets. Raises RuntimeError with what the tools said."""
    for command in (
        ["cmake", "--preset", PRESET],
        ["cmake", "--build", "--preset", PRESET, "--target", "palpate_fuzz", "-j", str(os.cpu_count() or 1)],
    ):
        done = subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout}")


def run(target: str, runs: int, seed: int, folder: Path, progress: Progress) -> Outcome:
    """So many executions of a target; inputs that reach something new are added to `folder`/corpus. Runs to the end or to
    the first finding. Raises NotBuilt."""
    if not Path(_command(target)[0]).is_file():
        raise NotBuilt(f"fuzz {target}: not built, for want of what it links: the crate of TinyUSB (cargo)")
    corpus = unpack(target, folder)
    command = [
        *_command(target),
        f"-runs={runs}",
        f"-seed={seed}",
        f"-max_len={_LONGEST_INPUT_BYTES}",
        f"-timeout={_LONGEST_S}",
        f"-artifact_prefix={folder}/",
        "-print_final_stats=1",
        str(corpus),
    ]
    said: list[str] = []
    executions = 0
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                if match := re.match(r"#(\d+)\s|stat::number_of_executed_units: (\d+)", line):
                    executions = int(match[1] or match[2])
                    progress(min(executions, runs), runs)
                else:
                    said.append(line)
        except BaseException:
            process.kill()
            raise
    if process.returncode == 0:
        return Outcome(target, executions, None, None)
    written = [line.split()[-1] for line in said if "Test unit written to" in line]
    return Outcome(target, executions, "".join(said[-40:]), Path(written[-1]) if written else None)


def _command(target: str) -> list[str]:
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
    command: Sequence[str] = [*_command(target), "-merge=1", f"-max_len={_LONGEST_INPUT_BYTES}", str(merged), str(folder / "corpus")]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout[-2000:]}")
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
