"""frontier.json: every point with its numbers, which of them are dominated, and the numbers to reach."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from palpate import __version__
from palpate.frontier.bench import Measured
from palpate.frontier.metrics import METRICS
from palpate.frontier.pareto import dominated
from palpate.frontier.points import BUILDERS, DEFAULT, LARGER_PART, Bounds
from palpate.frontier.ram import Ram
from palpate.reproduce.checks import number_or_none


@dataclass(frozen=True)
class Cost:
    """One way to count what a point costs. label: of a picture's axis, with the unit after drawn_scale; path: where the
    number stands."""

    name: str
    label: str
    path: tuple[str, ...]
    drawn_scale: float = 1.0

    def of(self, point: Measured) -> float | None:
        """The number of this point; None where it has none."""
        value: Any = {"metrics": point.metrics, "host_ratio": host_ratio(point)}
        for part in self.path:
            value = None if value is None else value[part]
        return None if value is None else float(value)


LINK = Cost("link", "link to the board [kB/s]", ("metrics", "link_down_bytes_per_s"), 1e-3)
COSTS = (
    Cost("host", "host: model / kernel", ("host_ratio",)),
    LINK,
    Cost("tick", "worst tick [1000 instructions]", ("metrics", "tick_instructions", "worst"), 1e-3),
)


@dataclass(frozen=True)
class Goal:
    """One number to reach, with what was measured."""

    point: str
    metric: str
    bound: float
    at_least: bool
    measured: float | None

    @property
    def reached(self) -> bool:
        """None is not."""
        if self.measured is None or not math.isfinite(self.measured):
            return False
        return self.measured >= self.bound if self.at_least else self.measured <= self.bound


def host_ratio(point: Measured) -> float | None:
    """Median time of a model over that of the reference kernel; 0 where none is built."""
    if point.host is None:
        return 0.0
    return point.host["model_s"] / point.host["kernel_s"]


def is_choice(point: Measured) -> bool:
    """Whether it is one of several ways to do the same; a delay is none that anybody chooses."""
    return point.point.sweep != "delay_frames"


def on_frontier(points: Sequence[Measured], costs: Sequence[Cost] = COSTS) -> dict[str, bool]:
    """By name, of points that are choices: does no other one of the same experiment have a smaller or equal error and smaller
    or equal costs, one of them smaller?"""
    result: dict[str, bool] = {}
    for experiment in dict.fromkeys(point.point.experiment.name for point in points):
        own = [point for point in points if point.point.experiment.name == experiment and is_choice(point)]
        beaten = dominated([(point.metrics["error_percent"], *(cost.of(point) for cost in costs)) for point in own])
        result |= {point.point.name: not flag for point, flag in zip(own, beaten, strict=True)}
    return result


def goals(points: Sequence[Measured]) -> list[Goal]:
    """The numbers to reach, of the default builder and of that on the larger part, in the experiments that were run."""
    rows = []
    for point in points:
        if point.point.builder.name not in (DEFAULT, LARGER_PART) or point.point.sweep is not None:
            continue
        bounds: Bounds = point.point.experiment.bounds
        for metric, bound in asdict(bounds).items():
            if bound is not None:
                measured = {**point.metrics, "compliance_percent": point.compliance_percent}[metric]
                rows.append(Goal(point.point.name, metric, bound, metric == "same_mode_percent", measured))
    return rows


def to_dict(points: Sequence[Measured], board: str, version: str, quick: bool, ram: Ram | None) -> dict[str, Any]:
    """The content of frontier.json."""
    best = on_frontier(points)
    return {
        "palpate_version": __version__,
        "program": version,
        "board": board,
        "quick": quick,
        "default_builder": DEFAULT,
        "metrics": {metric.name: {"unit": metric.unit, "definition": metric.definition} for metric in METRICS},
        "builders": {
            name: {"title": builder.title, "overrides": dict(builder.overrides), "board": builder.board}
            for name, builder in BUILDERS.items()
        },
        "ram": None if ram is None else asdict(ram),
        "goals": [{**asdict(goal), "measured": _plain(goal.measured), "reached": goal.reached} for goal in goals(points)],
        "points": [_point(point, best.get(point.point.name)) for point in points],
    }


def _point(measured: Measured, is_best: bool | None) -> dict[str, Any]:
    point = measured.point
    return {
        "name": point.name,
        "experiment": point.experiment.name,
        "builder": point.builder.name,
        "sweep": point.sweep,
        "value": point.value or None,
        "scene": point.run.shown_file,
        "overrides": dict(point.run.overrides),
        "record_hash": measured.record_hash,
        "metrics": _plain(dict(measured.metrics)),
        "host": None if measured.host is None else {**measured.host, "ratio": host_ratio(measured)},
        "compliance_percent": measured.compliance_percent,
        "convergence": [dict(row) for row in measured.convergence],
        "on_frontier": is_best,
    }


def _plain(value: Any) -> Any:
    """Numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return number_or_none(value) if isinstance(value, float) else value


def write(file: Path, values: Mapping[str, Any]) -> None:
    """Writes frontier.json."""
    file.write_text(json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8")
