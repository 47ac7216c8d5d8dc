"""`palpate bench mutants`: small wrong changes of the safety supervisor, one at a time, each of which a unit test must notice.

Each is compiled, linked with the tests that the build has made, and run; it is killed when that fails. Those that do not change what the code does
are listed with a reason each in host/bench/supervisor_mutants.toml.
"""

import json
import random
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from palpate.experiment import Progress, take_folder
from palpate.mutants.changes import Key, Mutant, mutants
from palpate.mutants.laboratory import CORE, EQUIVALENT, SOURCES, Laboratory, equivalents
from palpate.scene import SceneError

RESULTS, DONE = "mutants.json", "done.jsonl"
SEED = 1
MOST_JOBS = 256
_MANY = 10


def check_folder(out: Path) -> None:
    """Makes it. Raises SceneError where that cannot be, or where it holds what this command does not write."""
    take_folder(out, (RESULTS, DONE), "palpate bench mutants")


def check_amount(sample: int | None, jobs: int) -> None:
    """Raises SceneError."""
    if sample is not None and not 1 <= sample <= 1_000_000:
        raise SceneError(f"--sample = {sample}: must be in [1, 1000000]")
    if not 1 <= jobs <= MOST_JOBS:
        raise SceneError(f"--jobs = {jobs}: must be in [1, {MOST_JOBS}]")


class _Done:
    """What a run before this one has found of the same sources, tests and compiler's flags; each result is written when it is there."""

    def __init__(self, file: Path, fingerprint: str) -> None:
        self.killed: dict[Mutant, bool] = {}
        lines = file.read_text("utf-8").splitlines() if file.exists() else []
        is_same = bool(lines) and lines[0] == json.dumps({"fingerprint": fingerprint})
        for line in lines[1:] if is_same else ():
            try:
                one = json.loads(line)
            except ValueError:  # was being written when the run ended
                continue
            killed = one.pop("killed")
            self.killed[Mutant(**one)] = killed
        self._file: TextIO = file.open("a" if is_same else "w", encoding="utf-8")
        self._file.write("\n" if is_same else json.dumps({"fingerprint": fingerprint}) + "\n")

    def add(self, mutant: Mutant, killed: bool) -> None:
        self.killed[mutant] = killed
        self._file.write(json.dumps({**asdict(mutant), "killed": killed}) + "\n")
        self._file.flush()

    def close(self) -> None:
        self._file.close()


def bench_mutants(files: Sequence[str], sample: int | None, jobs: int, out: Path, progress: Progress) -> dict[str, Any]:
    """Tries the mutants of these files (of `SOURCES`), or so many of them, the same each time; goes on where a run into the same folder has ended
    before. Writes `out`/mutants.json and returns its content with `files`. Raises SceneError, NoBuild, and RuntimeError where the sources as they
    are do not pass, or something is listed as equivalent that is no mutant any more."""
    check_folder(out)
    check_amount(sample, jobs)
    begin_s = time.monotonic()
    harmless = equivalents()
    every = [mutant for file in files for mutant in mutants(file, (CORE / file).read_text("utf-8"))]
    known = {mutant.key for mutant in every}
    stale = [entry for entry in harmless if entry[0] in files and entry not in known]
    if stale:
        raise RuntimeError(f"{EQUIVALENT.name} lists what is no mutant any more: {stale}")
    wanted = [mutant for mutant in every if mutant.key not in harmless]
    if sample is not None:
        wanted = random.Random(SEED).sample(wanted, min(sample, len(wanted)))
    with tempfile.TemporaryDirectory() as name:
        laboratory = Laboratory(Path(name))
        done = _Done(out / DONE, laboratory.fingerprint)
        before = len([mutant for mutant in wanted if mutant in done.killed])
        try:
            _try_all(laboratory, files, wanted, done, jobs, progress)
        finally:
            done.close()
    tables = [_of_file(file, [m for m in every if m.file == file], [m for m in wanted if m.file == file], harmless, done.killed) for file in files]
    values: dict[str, Any] = {
        "command": "bench mutants", "sample": sample, "elapsed_s": round(time.monotonic() - begin_s, 1), "known_before": before,
        "sources": tables, "survivors": [asdict(mutant) for mutant in wanted if not done.killed[mutant]],
    }  # fmt: skip
    (out / RESULTS).write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
    return {**values, "files": {RESULTS: str(out / RESULTS)}}


def _try_all(laboratory: Laboratory, files: Sequence[str], wanted: Sequence[Mutant], done: _Done, jobs: int, progress: Progress) -> None:
    left = [mutant for mutant in wanted if mutant not in done.killed]
    if len(left) > _MANY:
        laboratory.expect_many()
    for file in sorted({mutant.file for mutant in left}, key=list(files).index):
        if laboratory.is_killed(None, file):
            raise RuntimeError(f"the tests fail without a mutant in {file}")
    with progress("mutants", "mutant") as bar:
        bar(len(wanted) - len(left), len(wanted))
        pool = ThreadPoolExecutor(jobs)
        try:
            futures = {pool.submit(laboratory.is_killed, mutant): mutant for mutant in left}
            for count, future in enumerate(as_completed(futures), 1):
                done.add(futures[future], future.result())
                bar(len(wanted) - len(left) + count, len(wanted))
        finally:
            pool.shutdown(cancel_futures=True)


def _of_file(file: str, every: Sequence[Mutant], tried: Sequence[Mutant], harmless: Mapping[Key, str], killed: Mapping[Mutant, bool]) -> dict[str, Any]:
    return {
        "file": file,
        "mutants": len(every),
        "equivalent": len([mutant for mutant in every if mutant.key in harmless]),
        "tried": len(tried),
        "killed": len([mutant for mutant in tried if killed[mutant]]),
    }


def format_table(values: Mapping[str, Any]) -> str:
    """For a person: a row for each file, then the survivors."""
    lines = [f"{'firmware/core':<24}{'mutants':>9}{'equivalent':>12}{'tried':>8}{'killed':>8}"]
    for row in (*values["sources"], _sum(values["sources"])):
        lines.append(f"{row['file']:<24}{row['mutants']:>9}{row['equivalent']:>12}{row['tried']:>8}{row['killed']:>8}")
    lines += [f"survives: {one['file']}:{one['line']}: {one['before']}  ->  {one['after']}" for one in values["survivors"]]
    before = f", {values['known_before']} of them known from a run before" if values["known_before"] else ""
    lines.append(f"{values['elapsed_s']:,.0f} s{before}; the equivalent ones have their reasons in {EQUIVALENT.name}")
    return "\n".join(lines)


def _sum(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {"file": "all", **{name: sum(row[name] for row in rows) for name in ("mutants", "equivalent", "tried", "killed")}}
