"""Executions over time: host/fuzz/ledger.csv, a row for each target of a long run."""

import csv
import subprocess
from datetime import date
from pathlib import Path

from palpate.fuzzing.outcome import Outcome
from palpate.paths import ROOT

LEDGER = ROOT / "host/fuzz/ledger.csv"
COLUMNS = ("date", "commit", "target", "seed", "executions", "findings")


def commit() -> str:
    """That is fuzzed. Raises RuntimeError outside of a repository of git: to be asked before hours are spent."""
    done = subprocess.run(["git", "rev-parse", "--short=7", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"the ledger wants the commit that was fuzzed: {done.stderr.strip()}")
    return done.stdout.strip()


def add(outcomes: list[Outcome], seed: int, of_commit: str, file: Path = LEDGER) -> None:
    """Appends what has been executed."""
    with file.open("a", encoding="ascii", newline="") as out:
        for one in outcomes:
            row = (date.today(), of_commit, one.target, seed, one.executions, int(one.finding is not None))
            csv.writer(out, lineterminator="\n").writerow(row)


def totals(file: Path = LEDGER) -> dict[str, int]:
    """Executions of each target in all. Raises ValueError for a row that is none."""
    sums: dict[str, int] = {}
    with file.open(encoding="ascii", newline="") as rows:
        reader = csv.DictReader(rows)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise ValueError(f"{file.name}: its columns are {reader.fieldnames}: must be {', '.join(COLUMNS)}")
        for row in reader:
            sums[row["target"]] = sums.get(row["target"], 0) + int(row["executions"])
    return sums
