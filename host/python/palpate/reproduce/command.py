"""`palpate reproduce`: from names of figures to results and the report."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

from palpate.reproduce.catalogue import FIGURES
from palpate.reproduce.figure import PaperFigure, Record
from palpate.reproduce.folders import REPORT, clear
from palpate.reproduce.report import format_number, format_tolerance, write_report
from palpate.reproduce.results import FigureResult, evaluate
from palpate.reproduce.runner import Done, Job, jobs, run_all
from palpate.reproduce.studies import OpenBar, study_all
from palpate.scene import SceneError

NATIVE, HIL = "native", "mps2_an386"


def select(names: Sequence[str]) -> list[PaperFigure]:
    """The named figures in the paper's order; none, or `all`: every one. Raises SceneError for an unknown name."""
    for name in names:
        if name not in FIGURES and name != "all":
            raise SceneError(f"palpate reproduce: {name}: unknown figure; must be one of {', '.join(FIGURES)}, all")
    if not names or "all" in names:
        return list(FIGURES.values())
    return [figure for name, figure in FIGURES.items() if name in names]


def reproduce(
    core: Any,
    figures: Sequence[PaperFigure],
    out: Path,
    hil: bool,
    progress: OpenBar,
) -> tuple[list[FigureResult], Path]:
    """Runs the figures' scenes, reduces their bodies, evaluates both, and writes a folder of each and the report to `out`;
    returns the results and the report's file. What an earlier run left of these figures goes. hil: for the runs; studies
    have no board. Raises SceneError (also where other files are in their place), hil.BoardError, or what the core
    raises."""
    board = HIL if hil else NATIVE
    planned = jobs(figures, out, board)
    clear(out, figures)
    figures, done = _run_all(core, figures, planned, out, board, progress)
    studied = study_all(core, figures, progress)
    results = []
    with progress("figures", "figure") as bar:
        for i, figure in enumerate(figures):
            own = [run for run in done if run.job.figure == figure.name]
            results.append(evaluate(figure, own, studied[figure.name], out / figure.name))
            bar(i + 1, len(figures))
    return results, write_report(out / REPORT, results, hil)


def _run_all(
    core: Any, figures: Sequence[PaperFigure], planned: Sequence[Job], out: Path, board: str, progress: OpenBar
) -> tuple[list[PaperFigure], list[Done]]:
    """Runs the planned jobs, and those that follow from them, which the figures returned then have too."""
    figures = list(figures)
    done: list[Done] = []
    if not planned:
        return figures, done
    total, counted, lock = 0, 0, Lock()
    with progress(f"{len(planned)} runs on {board}", "tick") as bar:

        def count(ticks: int) -> None:
            nonlocal counted
            with lock:
                counted += ticks
                bar(counted, total)

        while planned:
            total += sum(job.ticks for job in planned)
            done += run_all(core, planned, max(1, len(os.sched_getaffinity(0))), count)
            more = [replace(figure, runs=figure.more(_records(done, figure))) for figure in figures]
            planned = jobs(more, out, board)
            figures = [
                replace(figure, runs=figure.runs + further.runs) for figure, further in zip(figures, more, strict=True)
            ]
    return figures, done


def _records(done: Sequence[Done], figure: PaperFigure) -> dict[str, Record]:
    return {run.job.run.name: run.record for run in done if run.job.figure == figure.name}


def format_results(results: Sequence[FigureResult]) -> str:
    """The checks for a person: a line for each figure, and one for each of its numbers."""
    lines = []
    for result in results:
        lines.append(f"{result.figure.name}  {result.figure.title}: {'pass' if result.passed else 'FAIL'}")
        for check in result.checks:
            verdict = {True: "pass", False: "FAIL", None: "-"}[check.passed]
            tolerance = format_tolerance(check)
            value = f"{format_number(check.measured)}{f' {check.unit}' if check.unit else ''}"
            lines.append(f"  {verdict:<5}{check.name}: {value}{f' ({tolerance})' if tolerance else ''}")
    return "\n".join(lines)


def to_dict(results: Sequence[FigureResult], report: Path) -> dict[str, Any]:
    """What `--json` prints: the results of the figures by name, whether all passed, and the report's file."""
    return {
        "pass": all(result.passed for result in results),
        "figures": {result.figure.name: result.to_dict() for result in results},
        "report": str(report),
    }
