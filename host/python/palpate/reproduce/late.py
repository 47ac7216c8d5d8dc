"""Results a frame late, on the non-linear body: error of the force for each way to build the local model. A part of what
`palpate bench frontier` runs."""

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from palpate.frontier import points
from palpate.frontier.bench import Measured
from palpate.frontier.metrics import measure
from palpate.frontier.pictures import draw_link
from palpate.frontier.points import DEFAULT, EXPERIMENTS, Point
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Records, Table

# Those that run on any board.
BUILDERS = {name: builder for name, builder in points.BUILDERS.items() if builder.board is None}
POINTS = tuple(points.table_points(points.QUICK, BUILDERS))
_FOLLOWS = "the multi-rate simulation follows the tangent behavior of the system between each global update (section 5.1)"
_UNITS = {"error_percent": "%", "jump_N": "N", "same_mode_percent": "%", "compliance_percent": "%"}
_WORDS = {"error_percent": "force error", "jump_N": "largest jump", "same_mode_percent": "ticks with the same contact mode"}


def _measured(records: Records) -> dict[str, Measured]:
    """By name of the point; the reference is that of the run itself."""
    return {
        point.name: Measured(point, "", measure(records[point.name], records[point.name], None), None, None, [])
        for point in POINTS
    }


def _number(metrics: Mapping[str, Any], *keys: str) -> float:
    """NaN where there is none."""
    value: Any = metrics
    for key in keys:
        value = None if value is None else value[key]
    return math.nan if value is None else float(value)


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    found = _measured(records)
    rows = []
    for name in points.QUICK:
        experiment = EXPERIMENTS[name]
        of = {builder: found[Point(experiment, BUILDERS[builder]).name].metrics for builder in BUILDERS}
        error = {builder: _number(metrics, "error_percent") for builder, metrics in of.items()}
        rows.append(
            Check(
                f"{experiment.title}: force error of the paper’s patch relative to that of the held force",
                _FOLLOWS,
                error["patch"] / error["hold"],
                "",
                f"{NO_NUMBER}: a better force than the held one",
                at_most=1.0,
            )
        )
        rows.append(
            Check(
                f"{experiment.title}: force error of the default relative to that of the paper’s patch",
                NO_NUMBER,
                error[DEFAULT] / error["patch"],
                "",
                "the default is to be better",
                at_most=1.0,
            )
        )
        for metric, bound in asdict(experiment.bounds).items():
            if bound is not None and metric in _WORDS:
                side = "at least" if metric == "same_mode_percent" else "at most"
                rows.append(
                    Check(
                        f"{experiment.title}: {_WORDS[metric]} of the default",
                        NO_NUMBER,
                        _number(of[DEFAULT], metric),
                        _UNITS[metric],
                        f"reported only; to reach: {side} {bound:g} {_UNITS[metric]}",
                    )
                )
    return rows


def tables(records: Records) -> list[Table]:
    """A table for each experiment: a row for each builder."""
    found = _measured(records)
    result = []
    for name in points.QUICK:
        own = [point for point in found.values() if point.point.experiment.name == name]
        result.append(
            Table(
                EXPERIMENTS[name].title,
                ("error [%]", "same mode [%]", "jump [N]", "late [ms]", "worst catch-up [ms]", "to the board [bytes/s]"),
                tuple(
                    (
                        _number(point.metrics, "error_percent"),
                        _number(point.metrics, "same_mode_percent"),
                        _number(point.metrics, "jump_N"),
                        _number(point.metrics, "late_ticks", "median"),
                        _number(point.metrics, "catch_up_ticks", "worst"),
                        _number(point.metrics, "link_down_bytes_per_s"),
                    )
                    for point in own
                ),
                main=True,
                names=tuple(
                    point.point.builder.title + (" (default)" if point.point.builder.name == DEFAULT else "")
                    for point in own
                ),
            )
        )
    return result


def draw(records: Records, file: Path) -> None:
    """Error against bytes on the link."""
    draw_link(list(_measured(records).values()), file)


FIGURE = PaperFigure(
    name="late",
    title="Results a frame late: ways to build the local model",
    claims=(
        ("The multi-rate simulation follows the tangent behavior of the system between each global update.", "5.1"),
        (
            "[…] the computer running the local simulation must continue to provide high fidelity interaction during "
            "unexpected communication delays with another computer running the global simulation.",
            "3",
        ),
    ),
    setting=(
        "The reference body, non-linear, 12x12x12 nodes, 30 global updates a second; the host hands each local model to the link a "
        "frame after it has begun with it. The tip is scripted: 5 mm in and 5 mm sideways while it sticks; and 5 mm in and "
        "3 cm along the surface at 10 cm/s with friction 0.3. Errors are those of the rendered force against the full body "
        "at 0.1 ms, root mean square over the ticks with the same contact mode, relative to the full body’s force.",
        "The paper’s local model is the patch with its border held, rolled forward here by the time that it was under way. Not rolled "
        "forward, it begins as if it were of the present. The others are ours: the patch with its outer springs rescaled or with "
        "the rest of the body condensed, modes of the whole body, and such modes with the exact forces of the springs at the "
        "contact (hybrid). More experiments, sweeps, and what each costs the host and the board: ./run bench frontier "
        "(docs/frontier.md).",
    ),
    caption="Force error against what the link carries to the board, for both motions. Grey: another builder has a smaller "
    "error and needs less.",
    runs=tuple(
        replace(point.run, overrides={**point.run.overrides, "reference.enabled": True}, may_fault=False) for point in POINTS
    ),
    checks=checks,
    draw=draw,
    tables=tables,
)
