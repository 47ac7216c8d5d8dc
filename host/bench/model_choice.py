"""The rule that chooses order, patch and rate against a sweep: force error of what it chooses beside the best of the sweep.
All in QEMU, slides 5 mm deep with mu = 0.3, results one frame late. Prints the table of docs/decisions/model_choice.md.

    python host/bench/model_choice.py [--kept FILE]

--kept keeps what has been measured.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

from palpate import _core, hil, record, record_layout
from palpate.frontier.metrics import measure
from palpate.frontier.references import References
from palpate.paths import SCENES
from palpate.scene import SceneError, load_scene

FILE = SCENES / "frontier/reference.toml"
BOARDS = ("mps2_an386", "mps2_an500")
# 12 Mbaud; a serial line as fast as CAN FD with 5 Mbit/s data; a slow UART.
BAUDS = {"hybrid": (12_000_000, 2_600_000, 921_600), "krylov": (12_000_000,), "patch": (12_000_000,)}
SLIDES = {
    "3 cm/s": {"path.csv": "drag_3cm_s.csv", "duration_s": 2.35, "contact.friction": 0.3},
    "10 cm/s": {"path.csv": "drag_10cm_s.csv", "duration_s": 1.65, "contact.friction": 0.3},
}
RATES_HZ = (15.0, 30.0, 60.0)
RATE, PATCH, NEAR = "rates.model_update_Hz", "model.patch_nodes", "model.near_nodes"
AUTO = {RATE: "auto", PATCH: "auto", NEAR: "auto", "model.shifts_Hz": "auto"}
_REFERENCE_STEP_S = 5e-5

Keys = dict[str, Any]


def conditions() -> Iterator[tuple[str, str, int, str]]:
    """Builder, board, baud, slide."""
    for builder, bauds in BAUDS.items():
        yield from product((builder,), BOARDS, bauds, SLIDES)


def swept(builder: str) -> Iterator[Keys]:
    """What the sweep sets."""
    orders = {3: (0, 4, 8), 4: (0, 4, 12)} if builder == "hybrid" else {3: (None,), 4: (None,)}
    for side, rate_Hz in product(orders, RATES_HZ):
        for near in orders[side]:
            yield {PATCH: [side, side, 2], RATE: rate_Hz, **({} if near is None else {NEAR: near})}


def run(references: References, board: str, keys: Keys) -> dict[str, Any]:
    """Error over all ticks in percent, and models that were not taken over."""
    scene = load_scene(FILE, keys, board)
    results, _ = hil.run_closed_loop(_core, scene.to_dict(), hil.BOARDS[board], lambda done, total: True)
    values = record.conform(record_layout.RUN, {d.path: results[d.path] for d in record_layout.RUN if d.path in results})
    reference = references.along(scene, values["ticks/tick"], values["ticks/tip_m"], _REFERENCE_STEP_S, lambda: None)
    metrics = measure(values, reference, hil.BOARDS[board].instructions_per_count)
    return {"error": metrics["error_all_percent"], "not_taken": metrics["models_not_taken"]}


def described(keys: Keys) -> str:
    """As in the table."""
    near = f", {keys[NEAR]} below" if NEAR in keys else ""
    return f"{'x'.join(map(str, keys[PATCH]))}{near}, {keys[RATE]:g} Hz"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kept", type=Path)
    arguments = parser.parse_args()
    kept = json.loads(arguments.kept.read_text()) if arguments.kept and arguments.kept.exists() else {}
    print("| builder | board | link, baud | slide | rule | error, % | best of the sweep | error, % |\n" + "| --- " * 8 + "|")
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        references = References(_core, Path(folder), "")

        def measured(board: str, keys: Keys) -> dict[str, Any]:
            name = json.dumps([board, keys], sort_keys=True)
            if name not in kept:
                kept[name] = run(references, board, keys)
            return dict(kept[name])

        for builder, board, baud, slide in conditions():
            given = {**SLIDES[slide], "model.builder": builder, "link.baud": baud}
            sweep = list(swept(builder))
            found = list(pool.map(lambda keys, g=given, b=board: measured(b, {**g, **keys}), sweep))
            best, keys = min(zip(found, sweep, strict=True), key=lambda pair: float(pair[0]["error"]))
            try:
                choice = load_scene(FILE, {**given, **AUTO}, board).judge()
            except SceneError as refusal:
                rule, error = f"refused: {str(refusal).split('; ')[1].split(':')[0]}", "-"
            else:
                chosen = {k: list(v) if isinstance(v, tuple) else v for k, v in choice.values.items() if builder == "hybrid" or k != NEAR}
                chosen.pop("model.shifts_Hz")
                rule, error = described(chosen), f"{measured(board, {**given, **chosen})['error']:.3g}"
            print(f"| `{builder}` | `{board}` | {baud:,} | {slide} | {rule} | {error} | {described(keys)} | {best['error']:.3g} |", flush=True)
            if arguments.kept:
                arguments.kept.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
