"""What servo rate the longest tick of each model leaves room for: the slide of palpate.worst_tick with smaller models.

    python host/bench/servo_rate.py [--json]

Instructions of the firmware on mps2_an386 (QEMU), in cycles by the bound of docs/decisions/cycles.md, against the 170 MHz of an STM32G474 of which the
servo may take 70 %. Only the tick's length is asked for: the firmware itself runs at 1 kHz.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host/python"))

from palpate import experiments, worst_tick  # noqa: E402
from palpate.cli import _progress  # noqa: E402

BOARD = "mps2_an386"
CLOCK_HZ = 1000 * worst_tick.PARTS[BOARD].tick_cycles
# The larger model of each builder is the default of a scene that names it, but for its path.
MODELS: dict[str, dict[str, Any]] = {
    "patch, 2 x 2 x 2 nodes": {"model.builder": "patch", "model.patch_nodes": [2, 2, 2]},
    "patch, 3 x 3 x 2 nodes": {"model.builder": "patch", "model.patch_nodes": [3, 3, 2]},
    "patch": {"model.builder": "patch"},
    "krylov": {"model.builder": "krylov"},
    "hybrid, 3 x 3 x 2 nodes": {"model.builder": "hybrid", "model.patch_nodes": [3, 3, 2]},
    "hybrid": {"model.builder": "hybrid"},
}


def measure(overrides: dict[str, Any]) -> dict[str, Any]:
    """The longest and the median servo tick of a run, cycles, and the rate that the longest leaves room for, Hz."""
    quiet = {"outputs.pictures": False, "outputs.csv": False}
    run = experiments.run(worst_tick.SCENE, {**worst_tick.SLIDE, **overrides, **quiet}, board=BOARD, progress=_progress)
    instructions = run.summary["worst_tick_instructions"]
    if run.summary["contact_ticks"] == 0 or run.summary["faults"]:
        raise SystemExit(f"{overrides}: the slide was not rendered: faults {run.summary['faults']}")
    cycles = instructions * worst_tick.CYCLES_PER_INSTRUCTION
    rows = run.arrays["updates/modes"], run.arrays["updates/nodes"]
    return {
        "modes": int(max(rows[0])),
        "nodes": int(max(rows[1])),
        "worst_tick_instructions": instructions,
        "worst_tick_cycles": round(cycles),
        "highest_rate_Hz": round(CLOCK_HZ * worst_tick.SERVO_SHARE / cycles),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="one object on standard output")
    as_json = parser.parse_args().json
    measured = {name: measure(overrides) for name, overrides in MODELS.items()}
    if as_json:
        print(json.dumps(measured, indent=1))
        return
    print(f"{'model':<26}{'modes':>6}{'nodes':>6}{'cycles':>9}{'rate, Hz':>10}")
    for name, one in measured.items():
        print(f"{name:<26}{one['modes']:>6}{one['nodes']:>6}{one['worst_tick_cycles']:>9,}{one['highest_rate_Hz']:>10,}")


if __name__ == "__main__":
    main()
