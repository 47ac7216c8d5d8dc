"""`palpate bench stability --zwidth`: zwidth.json and a picture."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from palpate.experiment import Progress, take_folder
from palpate.stability import pictures, zwidth

RESULTS, PICTURE = "zwidth.json", "zwidth.png"


def check_folder(out: Path) -> None:
    """Makes it. Raises SceneError where that cannot be, or where it holds what this command does not write."""
    take_folder(out, (RESULTS, PICTURE), "palpate bench stability")


def bench_zwidth(core: Any, quick: bool, out: Path, progress: Progress) -> dict[str, Any]:
    """Measures, writes zwidth.json and the picture to `out`, and returns the file's content with `files`. Raises SceneError."""
    check_folder(out)
    with progress("zwidth", "walls") as bar:
        rows = zwidth.measure(core, quick, bar)
    values = {"command": "bench stability", "quick": quick, "device": zwidth.DEVICE, "most_J": zwidth.MOST_J, "walls": rows}
    (out / RESULTS).write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    pictures.draw(rows, zwidth.QUICK_SWEEPS if quick else zwidth.SWEEPS, out / PICTURE)
    return {**values, "files": {name: str(out / name) for name in (RESULTS, PICTURE)}}


def format_tables(values: Mapping[str, Any]) -> str:
    """For a person: stiffness by damping, a table for what is varied; with the controller behind the slash."""
    lines = []
    for key, servos in (zwidth.QUICK_SWEEPS if values["quick"] else zwidth.SWEEPS).items():
        dampings = [row["damping_N_s_m"] for row in zwidth.of(values["walls"], servos[0], False)]
        lines.append(f"Stiffest wall [N/m] without / with the controller, by its damping [N s/m]; {key.rpartition('_')[0]} varied")
        lines.append("  " + " " * 10 + "".join(f"{damping:>16g}" for damping in dampings))
        for servo in servos:
            without, controlled = (zwidth.of(values["walls"], servo, on) for on in (False, True))
            cells = [f"{_number(a)} / {_number(b)}" for a, b in zip(without, controlled, strict=True)]
            lines.append(f"  {pictures.label(key, servo):<10}" + "".join(f"{cell:>16}" for cell in cells))
    return "\n".join(lines)


def _number(row: Mapping[str, Any]) -> str:
    return "none" if row["stiffest_N_m"] is None else f"{row['stiffest_N_m']:,.0f}"
