"""The scripts in docs/examples run, say what they should, and are typed."""

import os
import re
import subprocess
import sys

from command import ROOT

from palpate.hil import BOARDS

FOLDER = ROOT / "docs/examples"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "host/python")}


def output_of(name: str, *arguments: str) -> str:
    """What an example prints."""
    done = subprocess.run(
        [sys.executable, str(FOLDER / name), *arguments], env=ENVIRONMENT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_example_is_run() -> None:
    here = set(globals())
    assert {f"test_{file.stem}" for file in FOLDER.glob("*.py")} <= here


def test_touch_a_body() -> None:
    match = re.fullmatch(r"(stick|slip) at 4\.0 mm: (\d\.\d\d) N up into the hand\n", output_of("touch_a_body.py"))
    assert match is not None and 0.5 < float(match[2]) < 5.0
    code = (FOLDER / "touch_a_body.py").read_text().split('"""')[2]
    assert len([line for line in code.splitlines() if line.strip()]) <= 10


def test_compare_builders() -> None:
    rows = output_of("compare_builders.py").splitlines()[1:-1]
    error = {row.split()[0]: float(row.split()[5]) for row in rows}
    assert set(error) == {"patch", "patch_rescaled", "condensed", "krylov", "hybrid"}
    assert error["krylov"] < 5.0 < error["patch"]


def test_connect_to_a_board() -> None:
    lines = output_of("connect_to_a_board.py").splitlines()
    assert lines[0].startswith("native, firmware ")
    # On a busy machine the board misses deadlines: it is not armed then, or has stopped.
    modes = ("render", "fault")
    if lines[1].startswith("not armed: "):
        modes = ("idle", "idle")
        del lines[1]
    told = [re.fullmatch(r"tick \d+: (\w+), tip at \[.*\] mm, \d+ deadlines missed", line) for line in lines[1:]]
    assert len(told) == 10 and all(one is not None and one[1] in modes for one in told)


def test_connecting_to_no_board_is_told_on_one_line() -> None:
    done = subprocess.run(
        [sys.executable, str(FOLDER / "connect_to_a_board.py"), "serial:/dev/nothing"], env=ENVIRONMENT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "/dev/nothing" in done.stderr


def test_listen_with_pycyphal() -> None:
    with subprocess.Popen([str(BOARDS["native"].image), "--pty"], stdout=subprocess.PIPE, text=True) as firmware:
        assert firmware.stdout is not None
        try:
            lines = output_of("listen_with_pycyphal.py", firmware.stdout.readline().strip()).splitlines()
        finally:
            firmware.kill()
    told = [re.fullmatch(r"node 42, tick (\d+): tip at z = -?0\.00 mm", line) for line in lines]  # encoders at zero
    ticks = [int(one[1]) for one in told if one is not None]
    assert len(ticks) == 10 and ticks == sorted(set(ticks))


def test_examples_hold_under_mypy() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir=/dev/null", *map(str, sorted(FOLDER.glob("*.py")))],
        cwd=ROOT, env={**ENVIRONMENT, "MYPYPATH": "host/python"}, capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout
