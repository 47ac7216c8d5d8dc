"""Measures what docs/numbers.md shows: every example scene with three builders, those of meshes with two, the firmware in QEMU.

`python host/bench/scene_numbers.py` (some minutes) writes docs/numbers/scenes.json; `python -m palpate.docs` then renews the page.
All numbers are of virtual time or counts: a second run gives the same, on any machine.
"""

import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host/python"))

import palpate  # noqa: E402

BUILDERS = ("patch", "krylov", "hybrid")
# hybrid is for lattices (palpate.scene_checks).
SCENES = {
    **dict.fromkeys(("demo", "frictionless", "press", "stick"), BUILDERS),
    **dict.fromkeys(("sphere", "liver", "skin"), BUILDERS[:2]),
}
BOARD = "mps2_an386"
KEPT = (
    "record_hash", "ticks", "missed_deadlines", "background_overruns", "worst_tick_instructions", "model_updates",
    "models_refused", "link_bytes_per_s", "peak_force_N", "rms_force_error_percent", "faults",
)


def measure(scene: str, builder: str, board: str = BOARD) -> dict[str, Any]:
    """The numbers of one run that the page has."""
    quiet = {"outputs.pictures": False, "outputs.csv": False, "model.builder": builder}
    summary = palpate.run(ROOT / f"scenes/{scene}.toml", quiet, board=board).summary
    return {"scene": scene, "builder": builder, **{key: summary[key] for key in KEPT}}


if __name__ == "__main__":
    runs = []
    for scene, builders in SCENES.items():
        for builder in builders:
            runs.append(measure(scene, builder))
            print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    measured = {"board": BOARD, "version": palpate.__version__, "runs": runs}
    (ROOT / "docs/numbers/scenes.json").write_text(json.dumps(measured, indent=1) + "\n")
