"""Runs the command line as a user would."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def palpate(*arguments: str, cwd: Path = ROOT, timeout_s: float = 300.0) -> "subprocess.CompletedProcess[str]":
    """`palpate ARGUMENTS` in a process of its own, which must end within timeout_s."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "host/python")}
    return subprocess.run(
        [sys.executable, "-m", "palpate", *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout_s,
    )
