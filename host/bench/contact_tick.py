#!/usr/bin/env python3
"""Instructions of the contact tick on the emulated Cortex-M4F, by kind of tick, in JSON.

Runs boards/mps2_an386/contact_tick_main.cpp in QEMU, which counts 125 million instructions a second, over random
situations (shared/bench/contact_situations.hpp). `cold` are ticks right after a local model has been taken over, when
nothing of it has been computed; `warm` are the ticks that follow them.
"""

import argparse
import json
import statistics
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
IMAGE = ROOT / "build/mps2_an386/boards/mps2_an386/contact_tick_mps2_an386.elf"

SITUATIONS = 10_000
INSTRUCTIONS_PER_COUNT = 5  # 125 MIPS (-icount shift=3: 8 ns) at a clock of 25 MHz
INSTRUCTIONS_PER_TICK = 125_000  # of the servo, 1 ms

SIZES = ("96 modes, 32 nodes", "192 modes, 16 nodes", "96 modes, near field")  # ModelSize
SURFACES = ("smooth", "flat")  # SurfaceKind
KINDS = ("free", "first_contact", "stick", "slip", "edge_crossing", "separation")  # TickKind
TICKS = ("cold", "warm")

# The full benchmark takes some ten seconds; what needs this has hung.
_WATCHDOG_S = 300


def run(situations: int, image: Path) -> list[str]:
    """Lines "size surface tick kind counts" of `situations` random situations of each size and surface."""
    command = ["qemu-system-arm", "-M", "mps2-an386", "-icount", "shift=3,sleep=off", "-display", "none", "-monitor",
               "none", "-serial", "stdio", "-semihosting-config", f"enable=on,target=native,arg={situations}",
               "-kernel", str(image)]
    result = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=_WATCHDOG_S,
                            check=True)
    return result.stdout.splitlines()


def _statistics(instructions: list[int]) -> dict[str, int]:
    return {
        "ticks": len(instructions),
        "median": round(statistics.median(instructions)),
        "worst": max(instructions),
    }


def summarize(lines: Iterable[str]) -> dict[str, dict[str, dict[str, dict[str, dict[str, int]]]]]:
    """Per surface, size, kind of tick, and cold or warm: number of ticks, median and worst number of instructions."""
    samples: dict[tuple[int, int, int, int], list[int]] = defaultdict(list)
    for line in lines:
        size, surface, tick, kind, counts = line.split()
        samples[int(surface), int(size), int(kind), int(tick)].append(INSTRUCTIONS_PER_COUNT * int(counts, 16))
    result: dict[str, dict[str, dict[str, dict[str, dict[str, int]]]]] = {}
    for (surface, size, kind, tick), instructions in sorted(samples.items()):
        of_size = result.setdefault(SURFACES[surface], {}).setdefault(SIZES[size], {})
        of_size.setdefault(KINDS[kind], {})[TICKS[tick]] = _statistics(instructions)
    return result


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--situations", type=int, default=SITUATIONS, help="of each size of model and each surface")
    parser.add_argument("--image", type=Path, default=IMAGE, help="of target contact_tick_mps2_an386")
    parser.add_argument("--out", type=Path, help="JSON file; default: standard output")
    options = parser.parse_args()
    if options.situations < 1:
        parser.error(f"--situations is {options.situations}, allowed: at least 1")
    if not options.image.exists():
        parser.error(f"{options.image} is missing: cmake --preset mps2_an386 && "
                     "cmake --build --preset mps2_an386 --target contact_tick_mps2_an386")
    report = {
        "situations": options.situations,
        "instructions_per_servo_tick": INSTRUCTIONS_PER_TICK,
        "instructions": summarize(run(options.situations, options.image)),
    }
    text = json.dumps(report, indent=2) + "\n"
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(text)
    else:
        sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
