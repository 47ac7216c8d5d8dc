"""`palpate bench links`: from the runs to links.json, a picture and tables."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.experiment import Progress, ProgressBar, take_folder
from palpate.link_bench import costs, pictures, runs
from palpate.link_bench.runs import LinkRun
from palpate.paths import SCENES

SCENE = SCENES / "links.toml"
RESULTS, PICTURE = "links.json", "links_latency.png"
_LIMIT_TICKS = 2000
# Bases of each state: on these the highest rate is asked for; over USB, 30 Hz as well.
_BASES_ON = ("can 1M", "canfd 1M/5M", "usb full speed")
# --quick: two media, a small body, a short run, rates up to 40 Hz.
QUICK_MEDIA = ("canfd 1M/5M", "usb full speed")
QUICK: dict[str, Any] = {"body.nodes": [6, 6, 6], "body.origin_m": [-0.025, -0.025, -0.07], "duration_s": 1.0}
_QUICK_MOST_HZ = 40
# Of a search for the highest rate: halvings of 250 Hz down to 1.
_MOST_RUNS = 8


def check_folder(out: Path) -> None:
    """Makes it. Raises SceneError where that cannot be, or where it holds what this command does not write."""
    take_folder(out, (RESULTS, PICTURE), "palpate bench links")


def bench_links(core: Any, quick: bool, out: Path, progress: Progress) -> dict[str, Any]:
    """Measures, writes links.json and the picture to `out`, and returns the file's content with `files`. Raises SceneError,
    hil.BoardError, or what the core raises."""
    check_folder(out)
    media = QUICK_MEDIA if quick else tuple(runs.MEDIA)
    overrides = QUICK if quick else {}
    most_Hz = _QUICK_MOST_HZ if quick else runs.MOST_HZ
    with progress("links", "run") as bar:
        usual, highest = _measure(core, media, overrides, most_Hz, bar)
    limits = {medium: core.medium_limit(_scene(medium, overrides), _LIMIT_TICKS) for medium in media}
    values: dict[str, Any] = {
        "command": "bench links",
        "quick": quick,
        "usual": [runs.to_dict(one) for one in usual],
        "highest": [
            {"medium": medium, "model": model, "held": None if one is None else runs.to_dict(one)}
            for (medium, model), one in highest.items()
        ],
        "limits": limits,
        "host": costs.host_costs(core),
        "board": costs.board_costs(core),
    }
    (out / RESULTS).write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    pictures.draw_latencies([one for one in usual if one.model == "hybrid"], out / PICTURE)
    return {**values, "files": {name: str(out / name) for name in (RESULTS, PICTURE)}}


def _scene(medium: str, overrides: Mapping[str, Any]) -> dict[str, Any]:
    return runs.scene_of(SCENE, medium, "hybrid", runs.USUAL_HZ, overrides, None).to_dict()


def _measure(
    core: Any, media: Sequence[str], overrides: Mapping[str, Any], most_Hz: int, bar: ProgressBar
) -> tuple[list[LinkRun], dict[tuple[str, str], LinkRun | None]]:
    """At 30 Hz; and the highest rates by medium and model."""
    done: dict[tuple[str, str, int], LinkRun] = {}
    asked = [(medium, "hybrid") for medium in media]
    asked += [(medium, model) for medium in media if medium in _BASES_ON for model in ("patch", "krylov")]
    most = len(media) + 2 + _MOST_RUNS * len(asked)

    def measure(medium: str, model: str, rate_Hz: int) -> LinkRun:
        key = medium, model, rate_Hz
        if key not in done:
            scene = runs.scene_of(SCENE, medium, model, rate_Hz, overrides, None)
            done[key] = runs.run(core, scene, medium, model, rate_Hz)
            bar(min(len(done), most), most)
        return done[key]

    usual = [measure(medium, "hybrid", runs.USUAL_HZ) for medium in media]
    usual += [measure("usb full speed", model, runs.USUAL_HZ) for model in ("patch", "krylov")]
    highest = {
        (medium, model): runs.highest_held(lambda rate_Hz, m=medium, b=model: measure(m, b, rate_Hz), most_Hz)  # type: ignore[misc]
        for medium, model in asked
    }
    bar(most, most)
    return usual, highest


def _spread(counts: Mapping[str, int]) -> str:
    """Least, median and most of a histogram."""
    if not counts:
        return "-"
    ticks: NDArray[np.int64] = np.repeat([int(tick) for tick in counts], list(counts.values()))
    return f"{ticks.min()} / {np.median(ticks):.0f} / {ticks.max()}"


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in (columns, *rows)) for i in range(len(columns))]
    lines = ["  " + "  ".join(cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))) for row in (columns, *rows)]
    return [title, *lines]


_RUN_COLUMNS = ("medium, model", "rate Hz", "held", "state B", "basis B", "busy %", "tip to host ms", "host to model ms")


def _run_row(one: Mapping[str, Any]) -> list[str]:
    return [
        f"{one['medium']}, {one['model']}",
        str(one["rate_Hz"]),
        "yes" if one["held"] else "; ".join(one["problems"]),
        f"{one['state_bytes']:,.0f}",
        f"{one['basis_bytes']:,.0f}",
        f"{100.0 * one['busy_share']:.1f}",
        _spread(one["tip_to_host_ticks"]),
        _spread(one["host_to_model_active_ticks"]),
    ]


def format_tables(values: Mapping[str, Any]) -> str:
    """For a person."""
    lines = _table("At 30 Hz (latencies: least / median / most)", _RUN_COLUMNS, [_run_row(one) for one in values["usual"]])
    rows = []
    for entry in values["highest"]:
        none = [f"{entry['medium']}, {entry['model']}", "-", "none", *["-"] * 5]
        rows.append(none if entry["held"] is None else _run_row(entry["held"]))
    lines += _table("The highest rate that is held", _RUN_COLUMNS, rows)
    lines += _table(
        "The medium's own limit: the largest message behind itself, to the board",
        ("medium", "messages kB/s", "link kB/s", "busy %"),
        [
            [medium, f"{limit['message_bytes_per_s'] / 1e3:.1f}", f"{limit['link_bytes_per_s'] / 1e3:.1f}", f"{100.0 * limit['busy_share']:.1f}"]
            for medium, limit in values["limits"].items()
        ],
    )
    lines += _table(
        "Processor time of the host",
        ("framing, message", "message B", "link B", "us", "of a memcpy"),
        [
            [f"{row['framing']}, {row['message']}", str(row["message_bytes"]), str(row["link_bytes"]), f"{row['us']:.2f}", f"{row['of_a_copy']:.0f}"]
            for row in values["host"]
        ],
    )
    lines += _table(
        f"Instructions of the firmware ({costs.BOARD} in QEMU)",
        ("framing, message", "message B", "link B", "instructions", "per byte on the link"),
        [
            [f"{row['framing']}, {row['message']}", str(row["message_bytes"]), str(row["link_bytes"]), f"{row['instructions']:,.0f}", f"{row['per_link_byte']:.1f}"]
            for row in values["board"]
        ],
    )
    return "\n".join(lines)
