"""Reduces the bodies of the studies, one after the other: their times are to be those of one core."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any

from threadpoolctl import threadpool_limits

from palpate.experiment import ProgressBar
from palpate.reduce.study import reduce_system
from palpate.reduce.system import contact_system, linear_body, middle_of_top
from palpate.reproduce.figure import PaperFigure, Record, Records, Study
from palpate.scene import load_scene

OpenBar = Callable[[str, str], AbstractContextManager[ProgressBar]]


def study(core: Any, case: Study) -> Record:
    """Reduces one body. Raises SceneError, and ValueError where the body has no reduction."""
    body = linear_body(core, load_scene(case.file, case.overrides).to_dict())
    with threadpool_limits(1):
        system = contact_system(body, middle_of_top(body))
        return case.collect(reduce_system(system, case.order, dense=case.dense, tolerance=case.tolerance))


def study_all(core: Any, figures: Sequence[PaperFigure], progress: OpenBar) -> dict[str, Records]:
    """Records of the figures' studies, by the figures' names; empty for a figure without any."""
    records: dict[str, dict[str, Record]] = {figure.name: {} for figure in figures}
    cases = [(figure.name, case) for figure in figures for case in figure.studies]
    if cases:
        with progress(f"{len(cases)} reductions", "body") as bar:
            for i, (name, case) in enumerate(cases):
                records[name][case.name] = study(core, case)
                bar(i + 1, len(cases))
    return dict(records)
