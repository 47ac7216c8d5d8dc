"""`./run`: says that it builds only when it does, and shows a build that fails."""

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from command import ROOT

NOTHING = "[0/2] Re-checking globbed directories...\nninja: no work to do.\n"
SOMETHING = "[0/2] Re-checking globbed directories...\n[1/2] Building CXX object a.o\n[2/2] Linking CXX executable a\n"
FAILING = "[1/2] Building CXX object a.o\nFAILED: a.o\na.cpp:1:1: error: no\nninja: build stopped: subcommand failed.\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder that looks configured and installed, with programs that only say what they are told to."""
    shutil.copy(ROOT / "run", tmp_path / "run")
    listed = "# nothing\n"
    (tmp_path / "dependencies.txt").write_text(listed)
    (tmp_path / ".venv/bin").mkdir(parents=True)
    (tmp_path / ".venv/dependencies.sha256").write_text(f"{hashlib.sha256(listed.encode()).hexdigest()}  dependencies.txt\n")
    for preset in ("host", "mps2_an386", "mps2_an500"):
        (tmp_path / f"build/{preset}").mkdir(parents=True)
        (tmp_path / f"build/{preset}/build.ninja").write_text("")
    program(tmp_path / ".venv/bin/python", 'echo "palpate ${*:3}"')
    return tmp_path


def program(file: Path, body: str) -> None:
    file.parent.mkdir(exist_ok=True)
    file.write_text(f"#!/bin/bash\n{body}\n")
    file.chmod(0o755)


def run(folder: Path, said: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    """./run plot x.h5, with builds of board mps2_an386 that say and end so; of the others there is nothing to do."""
    (folder / "said").write_text(said)
    (folder / "nothing").write_text(NOTHING)
    program(folder / "tools/cmake", f'if [[ "$*" == *mps2_an386* ]]; then cat "{folder}/said"; exit {code}; fi\ncat "{folder}/nothing"')
    environment = {**os.environ, "PATH": f"{folder}/tools:{os.environ['PATH']}"}
    return subprocess.run([folder / "run", "plot", "x.h5"], env=environment, capture_output=True, text=True, timeout=60, check=False)


def test_nothing_is_said_where_nothing_is_built(folder: Path) -> None:
    done = run(folder, NOTHING)
    assert (done.returncode, done.stdout, done.stderr) == (0, "palpate plot x.h5\n", "")


def test_a_build_is_told_once(folder: Path) -> None:
    done = run(folder, SOMETHING)
    assert (done.returncode, done.stdout, done.stderr) == (0, "palpate plot x.h5\n", "building mps2_an386\n")


def test_a_build_that_fails_is_shown_and_ends_it(folder: Path) -> None:
    done = run(folder, FAILING, 1)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("building mps2_an386\n") and "a.cpp:1:1: error: no" in done.stderr
