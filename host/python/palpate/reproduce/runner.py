"""Runs the scenes of the figures, several at a time: the core computes without Python's lock."""

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from palpate import experiment, record, record_layout
from palpate.experiment import ProgressBar
from palpate.reproduce.figure import PaperFigure, Record, Run
from palpate.scene import Scene, load_scene


class RunProgress(Protocol):
    """Told of progress: (ticks more). May be called from several threads at once."""

    def __call__(self, ticks: int) -> None: ...


@dataclass(frozen=True)
class Job:
    """A run with its scene read, and where its results go."""

    figure: str
    run: Run
    scene: Scene
    folder: Path

    @property
    def ticks(self) -> int:
        """Servo ticks to compute, those of the reference included."""
        phases = 2 if self.scene.sections.reference.enabled else 1
        return phases * self.scene.duration_ticks


@dataclass(frozen=True)
class Done:
    """A run that has ended: its record, and its summary.json."""

    job: Job
    record: Record
    summary: Mapping[str, Any]


def jobs(figures: Sequence[PaperFigure], out: Path, board: str) -> list[Job]:
    """All runs of the figures, longest first, so that none is left over at the end. Raises SceneError."""
    planned = [
        Job(
            figure.name,
            run,
            load_scene(run.file, run.overrides).with_board(board),
            out / figure.name / run.name,
        )
        for figure in figures
        for run in figure.runs
    ]
    return sorted(planned, key=lambda job: -job.ticks)


class Finish(Protocol):
    """Does what is left to do with a run that has ended, in its thread; go_on, called now and then, raises where the work is
    to be left."""

    def __call__(self, done: Done, go_on: Callable[[], None]) -> None: ...


def run_all(
    core: Any, planned: Sequence[Job], workers: int, progress: RunProgress, finish: Finish | None = None
) -> list[Done]:
    """Runs the jobs, `workers` at a time, and finishes each. The first that fails ends the others; its error is raised."""
    stop = threading.Event()
    with ThreadPoolExecutor(max_workers=workers) as pool:
        futures = [pool.submit(_run, core, job, stop, progress, finish) for job in planned]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)
    return [_result(future, futures) for future in futures]


def _result(future: "Future[Done]", futures: Sequence["Future[Done]"]) -> Done:
    for other in futures:  # not the one that was only stopped
        error = None if other.cancelled() else other.exception()
        if error is not None and not isinstance(error, _StoppedError):
            raise error
    return future.result()


class _StoppedError(RuntimeError):
    """Another run has failed, or the user has interrupted."""


def _run(core: Any, job: Job, stop: threading.Event, progress: RunProgress, finish: Finish | None) -> Done:
    def go_on() -> None:
        if stop.is_set():
            raise _StoppedError("stopped")

    def open_bar(label: str, unit: str) -> AbstractContextManager[ProgressBar]:
        counted = 0

        def update(done: int, total: int) -> bool:
            nonlocal counted
            go_on()
            progress(done - counted)
            counted = done
            return True

        return nullcontext(update)

    go_on()
    outcome = experiment.run(core, job.scene, "run", job.folder, open_bar)
    values, _, _ = record.read_record(outcome.files["record.h5"], record_layout.RUN)
    done = Done(job, values, outcome.summary)
    if finish is not None:
        finish(done, go_on)
    return done
