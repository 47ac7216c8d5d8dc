"""`palpate bench faults`: runs the matrix, writes faults.json, pictures and a page, and says what broke a rule."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from palpate import __version__, experiment
from palpate.experiment import Progress, take_folder
from palpate.faults import picture, report
from palpate.faults.cases import MEDIA, Case, all_cases, chosen
from palpate.faults.margins import smallest_margins
from palpate.faults.rules import Result, Run, has_more_force, judge
from palpate.paths import SCENES
from palpate.scene import SceneError, load_scene

SCENE = SCENES / "faults.toml"
RESULTS, PICTURE, FORCES, REPORT = FILES = ("faults.json", "faults.png", "forces.png", "index.html")


def check_folder(out: Path) -> None:
    """Makes it. Raises SceneError where that cannot be, or where it holds what this command does not write."""
    take_folder(out, FILES, "palpate bench faults")


def choose(names: Sequence[str] | None, quick: bool, medium: str = "uart") -> tuple[Case, ...]:
    """The cases that are asked for. Raises SceneError for a name that is none."""
    every = all_cases(medium)
    known = dict.fromkeys(name for case in every for name in (case.group, case.name))
    for name in names or ():
        if name not in known:
            groups = ", ".join(dict.fromkeys(case.group for case in every))
            names_of = ", ".join(case.name for case in every)
            raise SceneError(f"--only {name}: must be a group ({groups}) or the name of a case ({names_of})")
    cases = chosen(names, quick, medium)
    if not cases:
        stand = ", ".join(case.name for case in every if case.quick)
        raise SceneError(f"--only {' '.join(names or ())} --quick: none of these is a quick case; those are {stand}")
    return cases


def _run(core: Any, case: Case | None, board: str, medium: str, good: Run | None = None) -> tuple[Run, int]:
    """A run, and the models' horizon in ticks. good: the run without faults; where this one has more force, the full body follows it."""
    overrides: dict[str, Any] = {**MEDIA[medium], **(case.keys if case else {})}
    if case and case.duration_s is not None:
        overrides["duration_s"] = case.duration_s
    scene = load_scene(SCENE, overrides, case.board if case and case.board else board)
    done = experiment.run_firmware(core, scene, scene.to_dict(), scene.require_path().position_m[0], experiment.no_progress)
    removed = {way: int(done.link[f"frames_removed_{way}"]) for way in ("down", "up")}
    dropped = {way: int(done.link[way]["submissions_dropped"]) for way in ("down", "up")}
    restarts, sent_again, bus_offs = (int(done.link[name]) for name in ("board_restarts", "attempts_failed", "bus_offs"))
    run = Run(done.values, done.counters, removed, restarts, dropped, sent_again, bus_offs)
    if good is not None and has_more_force(good, run):
        run.values.update(experiment.follow(core, scene.to_dict(), done.values, lambda done, total: True))
    return run, scene.sections.model.valid_ticks


def run_matrix(core: Any, cases: Sequence[Case], board: str, medium: str, progress: Progress) -> tuple[Run, list[Result], int]:
    """The run without faults, every case held against it, and the models' horizon in ticks. Raises what `experiment.run` does."""
    results = []
    with progress(f"fault matrix on {board}, {medium}", "run") as bar:
        good, valid_ticks = _run(core, None, board, medium)
        bar(1, len(cases) + 1)
        for i, case in enumerate(cases):
            results.append(judge(case, good, _run(core, case, board, medium, good)[0], valid_ticks))
            bar(i + 2, len(cases) + 1)
    return good, results, valid_ticks


def to_dict(good: Run, results: Sequence[Result], valid_ticks: int, board: str, medium: str, quick: bool) -> dict[str, Any]:
    """faults.json: docs/faults.md has its keys."""
    return {
        "palpate": __version__,
        "board": board,
        "medium": medium,
        "quick": quick,
        "passed": all(not result.broken for result in results),
        "fault_free": {
            "force_N": float(good.force_N.max()),
            "step_N": float(good.step_N.max()),
        },
        "margins": [asdict(margin) for margin in smallest_margins(results, valid_ticks)],
        "cases": [
            {
                **{key: value for key, value in asdict(result.case).items() if key not in ("quick", "duration_s", "loss", "unseen", "rare", "displaces")},
                **result.numbers,
                "broken": list(result.broken),
            }
            for result in results
        ],
    }


def bench_faults(
    core: Any, names: Sequence[str] | None, quick: bool, board: str, medium: str, out: Path, progress: Progress
) -> tuple[dict[str, Any], list[Result]]:
    """Runs the matrix, writes faults.json, two pictures and a page there, and returns the file's content with `files`, and the results.

    Raises SceneError, hil.BoardError, or what the core raises.
    """
    cases = choose(names, quick, medium)
    check_folder(out)
    good, results, valid_ticks = run_matrix(core, cases, board, medium, progress)
    values = to_dict(good, results, valid_ticks, board, medium, quick)
    (out / RESULTS).write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    picture.draw(results, out / PICTURE)
    picture.draw_forces(results, out / FORCES)
    report.write_report(out / REPORT, values, (out / PICTURE, out / FORCES))
    return {**values, "files": {name: str(out / name) for name in FILES}}, results


_COLUMNS = ("case", "step N", "rise N", "left N", "force gone ms", "off ms", "again ms", "lost/removed", "ends in")


def format_table(results: Sequence[Result], paint: Callable[[str, bool], str]) -> str:
    """A line a case. paint: gives the verdict its colour, by whether it holds."""
    rows = [_row(result) for result in results]
    widths = [max(len(row[i]) for row in (_COLUMNS, *rows)) for i in range(len(_COLUMNS))]

    def line(cells: Sequence[str]) -> str:
        first, *others = cells
        return "  ".join([first.ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))])

    lines = [f"      {line(_COLUMNS)}"]
    for result, row in zip(results, rows, strict=True):
        verdict = paint("FAIL" if result.broken else "pass", not result.broken)
        lines.append(f"{verdict}  {line(row)}")
        lines += [f"      {text}" for text in result.broken]
    return "\n".join(lines)


def _row(result: Result) -> tuple[str, ...]:
    numbers = result.numbers

    def ticks(name: str) -> str:
        return "-" if numbers[name] is None else str(numbers[name])

    lost = "+".join(str(numbers[f"lost_{way}"]) for way in ("down", "up"))
    removed = "+".join(str(numbers[f"removed_{way}"]) for way in ("down", "up"))
    return (
        result.case.name, f"{numbers['step_N']:.3f}", f"{numbers['rise_N']:.2f}", f"{-numbers['excess_N']:.2f}", ticks("force_gone_ticks"),
        ticks("outputs_off_ticks"), ticks("recovery_ticks"), f"{lost}/{removed}", numbers["ends_in"],
    )  # fmt: skip
