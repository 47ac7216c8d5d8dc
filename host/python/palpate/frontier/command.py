"""`palpate bench frontier`: from the points to frontier.json, pictures and tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from palpate.experiment import take_folder
from palpate.frontier import pictures, results
from palpate.frontier.bench import KEPT_REFERENCES, RUNS, Measured, OpenBar, program_version, run_points
from palpate.frontier.points import BUILDERS, EXPERIMENTS, SWEEPS, all_points
from palpate.frontier.ram import ram_of

BOARD = "mps2_an386"
RESULTS = "frontier.json"
_OURS = (RUNS, KEPT_REFERENCES, RESULTS)


def check_folder(out: Path) -> None:
    """Makes it. Raises SceneError where that cannot be, or where it holds what this command does not write."""
    take_folder(out, {*_OURS, *(file.name for file in out.glob("frontier_*.png"))}, "palpate bench frontier")


def bench_frontier(core: Any, quick: bool, out: Path, progress: OpenBar) -> tuple[dict[str, Any], list[Measured]]:
    """Runs what is not kept in `out`, writes frontier.json and the pictures there, and returns the file's content with
    `files`, and the points. Raises SceneError, hil.BoardError, or what the core raises."""
    check_folder(out)
    measured = run_points(core, all_points(quick), out, BOARD, progress)
    files = {}
    with progress("pictures", "picture") as bar:
        shown = list(dict.fromkeys(point.point.experiment.name for point in measured))
        for i, experiment in enumerate(shown):
            files[f"frontier_{experiment}.png"] = out / f"frontier_{experiment}.png"
            pictures.draw_costs(measured, experiment, files[f"frontier_{experiment}.png"])
            bar(i + 1, len(shown) + 1)
        if any(point.point.sweep for point in measured):
            files["frontier_sweeps.png"] = out / "frontier_sweeps.png"
            pictures.draw_sweeps(measured, files["frontier_sweeps.png"])
        bar(len(shown) + 1, len(shown) + 1)
    values = results.to_dict(measured, BOARD, program_version(core, BOARD), quick, ram_of(core, BOARD))
    files[RESULTS] = out / RESULTS
    results.write(files[RESULTS], values)
    return {**values, "files": {name: str(file) for name, file in files.items()}}, measured


def _cell(value: float | None, digits: str) -> str:
    return "-" if value is None else format(value, digits)


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in (columns, *rows)) for i in range(len(columns))]
    lines = []
    for first, *others in (columns, *rows):
        cells = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join(["", first.ljust(widths[0]), *cells]))
    return [title, *lines]


def _number(point: Measured, name: str, part: str | None = None) -> float | None:
    value = point.metrics[name]
    found: float | None = value if part is None or value is None else value[part]
    return found


_COLUMNS = ("error %", "same mode %", "jump N", "late ms", "catch-up ms", "down B/s", "host ratio", "compl. %", "tick p99", "tick worst")


def _row(first: str, point: Measured) -> list[str]:
    return [
        first,
        _cell(point.metrics["error_percent"], ".3g"),
        _cell(point.metrics["same_mode_percent"], ".1f"),
        _cell(point.metrics["jump_N"], ".3f"),
        _cell(_number(point, "late_ticks", "median"), ".0f"),
        _cell(_number(point, "catch_up_ticks", "worst"), ".0f"),
        _cell(point.metrics["link_down_bytes_per_s"], ",.0f"),
        _cell(results.host_ratio(point), ".2f"),
        _cell(point.compliance_percent, ".2g"),
        _cell(_number(point, "tick_instructions", "p99"), ",.0f"),
        _cell(_number(point, "tick_instructions", "worst"), ",.0f"),
    ]


def format_tables(values: dict[str, Any], points: Sequence[Measured]) -> str:
    """For a person: a table for each experiment and each sweep, and the numbers to reach."""
    lines: list[str] = []
    for name, experiment in EXPERIMENTS.items():
        own = [p for p in points if p.point.experiment.name == name and p.point.sweep is None]
        if own:
            shift = max((row["difference_percent"] or 0.0 for p in own for row in p.convergence[-1:]), default=0.0)
            title = f"{experiment.title} (reference at 0.05 and 0.025 ms of the reference material: {shift:.2g} % apart)"
            lines += _table(title, ("builder", *_COLUMNS), [_row(p.point.builder.title, p) for p in own])
    for sweep in SWEEPS:
        swept = [p for p in points if p.point.sweep == sweep]
        if swept:
            rows = [_row(f"{p.point.value}, {p.point.builder.name}, {p.point.experiment.name}", p) for p in swept]
            lines += _table(f"sweep of {sweep}", ("point", *_COLUMNS), rows)
    goal_rows = [
        [
            f"{goal['point']}: {goal['metric']}",
            f"{'at least' if goal['at_least'] else 'at most'} {goal['bound']:g}",
            _cell(goal["measured"], ".3g"),
            "reached" if goal["reached"] else "missed",
        ]
        for goal in values["goals"]
    ]
    title = f"Numbers to reach, by the default builder ({BUILDERS[values['default_builder']].title}) and on the larger part"
    lines += _table(title, ("number", "bound", "measured", ""), goal_rows)
    if values["ram"] is not None:
        lines.append(f"RAM: {values['ram']['renderer']:,} bytes for models and tip history, {values['ram']['image']:,} in all")
    return "\n".join(lines)
