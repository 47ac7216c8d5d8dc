"""Results of a figure or table: its checks, those of its runs, and results.json."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from palpate.reproduce.checks import NO_NUMBER, Check, all_passed
from palpate.reproduce.figure import PaperFigure, Records, Table
from palpate.reproduce.runner import Done


# Files of a figure, beside the folders of its runs.
PLOT, RESULTS = "plot.png", "results.json"


@dataclass(frozen=True)
class FigureResult:
    """A figure with what came out. plot: PNG file; summaries: summary.json of each run, by its name."""

    figure: PaperFigure
    checks: list[Check]
    plot: Path
    summaries: Mapping[str, Mapping[str, Any]]
    tables: Sequence[Table] = ()

    @property
    def passed(self) -> bool:
        """No check failed."""
        return all_passed(self.checks)

    def to_dict(self) -> dict[str, Any]:
        """The content of results.json."""
        return {
            "figure": self.figure.name,
            "title": self.figure.title,
            "pass": self.passed,
            "checks": [check.to_dict() for check in self.checks],
            "tables": [table.to_dict() for table in self.tables],
            "runs": [
                {
                    "name": run.name,
                    "scene": run.shown_file,
                    "overrides": dict(run.overrides),
                    "board": self.summaries[run.name]["board"],
                    "record_hash": self.summaries[run.name]["record_hash"],
                    "folder": run.name,
                }
                for run in self.figure.runs
            ],
            "studies": [
                {
                    "name": study.name,
                    "scene": study.shown_file,
                    "overrides": dict(study.overrides),
                    "order": study.order,
                    "dense": study.dense,
                    "tolerance": study.tolerance,
                }
                for study in self.figure.studies
            ],
        }


def run_checks(done: Sequence[Done]) -> list[Check]:
    """What must hold in every run, or its numbers mean nothing. On a board that computes in real time or emulates it, work
    in the background may be left over and a model's frame then be lost: there both are only reported."""
    paced = any(run.summary["board"] != "native" for run in done)
    most = None if paced else 0
    return [
        Check(
            "unexpected faults of the board and missed deadlines in all runs",
            NO_NUMBER,
            sum(
                int(run.summary["faults"] != 0 and not run.job.run.may_fault) + int(run.summary["missed_deadlines"])
                for run in done
            ),
            "",
            "none: the runs must be what their scenes say",
            at_most=0,
        ),
        Check(
            "lost frames in all runs",
            NO_NUMBER,
            sum(int(run.summary["frames_lost"]) for run in done),
            "",
            "reported only: a model that comes while the board is still busy with the one before is lost, and the next one "
            "takes its place"
            if paced
            else "none: this board always has the time",
            at_most=most,
        ),
        Check(
            "ticks whose work in the background was left over, in all runs",
            NO_NUMBER,
            sum(int(run.summary["background_overruns"]) for run in done),
            "",
            "reported only: a model may then be taken over some ticks later than on the native board, and the hashes of the "
            "records may differ; the servo’s deadlines are judged above"
            if paced
            else "none: this board always has the time",
            at_most=most,
        ),
    ]


def evaluate(figure: PaperFigure, done: Sequence[Done], studied: Records, folder: Path) -> FigureResult:
    """Checks and plot of a figure; writes plot.png and, last, results.json to its folder. done: its runs; studied: records
    of its studies."""
    records = {run.job.run.name: run.record for run in done} | dict(studied)
    folder.mkdir(parents=True, exist_ok=True)
    plot = folder / PLOT
    figure.draw(records, plot)
    result = FigureResult(
        figure,
        [*figure.checks(records), *(run_checks(done) if done else [])],
        plot,
        {run.job.run.name: run.summary for run in done},
        figure.tables(records),
    )
    (folder / RESULTS).write_text(
        json.dumps(result.to_dict(), indent=2, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    return result
