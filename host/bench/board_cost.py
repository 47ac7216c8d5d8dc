"""What local models cost the board: runs builders, patches and orders in QEMU, and fits the coefficients of
palpate.board_cost. Prints them, and every point with what the fit says of it.

    python host/bench/board_cost.py [--board mps2_an386] [--kept FILE]

--kept keeps what has been measured. Each fit is from above: of all a + b modes + c springs + d nodes with coefficients of at
least 0 that are nowhere below a measured point, the one with the least sum over the points (a linear program).
"""

import argparse
import json
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

from palpate import _core, board_cost, hil, record, record_layout
from palpate.model_size import model_size
from palpate.paths import SCENES
from palpate.scene import load_scene

# Poke 5 mm and pull, and a slide at 10 cm/s: the dearest motions of docs/frontier.md.
MOTIONS = (
    {"path.csv": "poke_5mm.csv", "duration_s": 1.5},
    {"path.csv": "drag_10cm_s.csv", "duration_s": 1.65, "contact.friction": 0.3},
)
# With more ticks than this over their end, the replay was not limited by its policy, and says nothing of its work.
MOST_OVERRUNS = 80
_ROUND_UP = 1e-6


def points() -> Iterator[dict[str, Any]]:
    """Keys of the scene of each point of the fit."""
    for side, near_nodes in ((3, 0), (3, 4), (3, 8), (4, 0), (4, 2), (4, 4), (4, 8), (4, 12)):
        yield {"model.builder": "hybrid", "model.patch_nodes": [side, side, 2], "model.near_nodes": near_nodes}
    yield {"model.builder": "hybrid", "body.neighbours": "edge"}
    for side in (3, 4, 5):
        yield {"model.builder": "krylov", "model.patch_nodes": [side, side, 2]}
    yield {"model.builder": "krylov", "model.middle_shifts_Hz": [20.0]}
    yield {"model.builder": "krylov", "model.shifts_Hz": [0.0, 20.0]}
    for patch in ([3, 3, 2], [3, 3, 3], [4, 4, 2], [4, 4, 3], [4, 4, 4]):
        yield {"model.builder": "patch", "model.patch_nodes": patch}


def measure(overrides: dict[str, Any], board: str) -> dict[str, Any]:
    """One point: its size, and the dearest of its motions."""
    found: dict[str, Any] = {"tick": 0.0, "replay": 0.0}
    for motion in MOTIONS:
        scene = load_scene(SCENES / "frontier/reference.toml", {**motion, **overrides}).with_board(board)
        results, _ = hil.run_closed_loop(_core, scene.to_dict(), hil.BOARDS[board], lambda done, total: True)
        values = record.conform(record_layout.RUN, {d.path: results[d.path] for d in record_layout.RUN if d.path in results})
        measured = board_cost.measure(values, board)
        found["tick"] = max(found["tick"], measured.tick)
        if values["ticks/background_overruns"][-1] <= MOST_OVERRUNS:
            found["replay"] = max(found["replay"], measured.replay)
        size = model_size(scene.sections)
        found |= {"modes": size.modes, "springs": size.evaluated_springs, "nodes": size.nodes}
    return found


def fit(rows: list[dict[str, Any]], what: str) -> tuple[int, int, int, int]:
    """The coefficients, rounded up, so that they stay above the points."""
    used = [row for row in rows if row[what] > 0.0]
    terms = np.array([[1.0, row["modes"], row["springs"], row["nodes"]] for row in used])
    measured = np.array([row[what] for row in used])
    solved = linprog(terms.sum(axis=0), A_ub=-terms, b_ub=-measured, bounds=[(0.0, None)] * 4)
    a, b, c, d = np.ceil(solved.x - _ROUND_UP).astype(int).tolist()
    return a, b, c, d


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--board", choices=tuple(board_cost.BUDGETS), action="append")
    parser.add_argument("--kept", type=Path)
    arguments = parser.parse_args()
    kept = json.loads(arguments.kept.read_text()) if arguments.kept and arguments.kept.exists() else {}
    for board in arguments.board or ("mps2_an386", "mps2_an500"):
        wanted = {json.dumps([board, overrides]): overrides for overrides in points()}
        missing = {key: overrides for key, overrides in wanted.items() if key not in kept}
        with ThreadPoolExecutor(2) as pool:
            kept |= zip(missing, pool.map(lambda overrides: measure(overrides, board), missing.values()), strict=True)
        if arguments.kept:
            arguments.kept.write_text(json.dumps(kept, indent=1) + "\n")
        rows = [{"name": key, **kept[key]} for key in wanted]
        for near in (True, False):
            chosen = [row for row in rows if (row["springs"] > 0) == near]
            for what in ("tick", "replay"):
                coefficients = fit(chosen, what)
                print(f"{board} {'with' if near else 'without'} near field, {what}: {coefficients}")
                for row in chosen:
                    above = board_cost.Cost(*coefficients).of(row["modes"], row["springs"], row["nodes"])
                    ratio = f"{above / row[what]:.3f}" if row[what] else "not used"
                    print(f"    {row['modes']:4} {row['springs']:3} {row['nodes']:3} {row[what]:9,.0f} {above:9,.0f} {ratio}  {row['name']}")


if __name__ == "__main__":
    main()
