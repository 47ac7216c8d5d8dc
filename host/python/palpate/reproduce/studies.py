"""Reduces the bodies of the studies, one after the other: their times are to be those of one core."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from palpate.experiment import ProgressBar
from palpate.reduce.study import reduce_system
from palpate.reduce.system import contact_system, linear_body, middle_of_top
from palpate.reproduce.figure import PaperFigure, Record, Records, Study
from palpate.scene import load_scene

OpenBar = Callable[[str, str], AbstractContextManager[ProgressBar]]


def study(core: Any, case: Study) -> Record:
    """Reduces one body; the record has `processor_s` too, the processor time from the body to the reduction. Raises
    SceneError, and ValueError where the body has no reduction."""
    body = linear_body(core, load_scene(case.file, case.overrides).to_dict())
    with threadpool_limits(1):
        start_s = time.process_time()
        system = contact_system(body, middle_of_top(body))
        reduction = reduce_system(system, case.order, dense=case.dense, tolerance=case.tolerance)
        processor_s = time.process_time() - start_s
        return {**case.collect(reduction), "processor_s": np.array(processor_s)}


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
