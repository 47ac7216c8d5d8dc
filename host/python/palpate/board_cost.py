"""What a local model costs the board: instructions of a servo tick and of a replayed step, from the size of the model.

The one place of the coefficients. They are fitted to runs in QEMU by host/bench/board_cost.py, from above, and MARGIN is
added to them; hil_tests/test_board_cost.py runs models that are not in the fit and holds the prediction against them
(docs/decisions/model_choice.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.hil import BOARDS
from palpate.model_size import ModelSize

# A model that is not in the fit may lie above a plane that touches the highest of the fitted ones. 2026-11-22: of the eight of
# hil_tests/test_board_cost.py the highest is 4 % above it (a replayed step of 78 modes on mps2_an386).
MARGIN = 1.05
# A byte that arrives: unframed, its CRCs, its block of a basis (docs/protocol.md, "Cost on the board").
INSTRUCTIONS_PER_BYTE = 31
# Bytes of a basis whose identifier is checked in one tick (kCheckedBytesPerRun in firmware/core/basis_store.hpp).
CHECKED_BYTES_PER_TICK = 4096
# A model that has not caught up by then gives way (kCatchUpHorizon_ticks in firmware/core/renderer.hpp).
CATCH_UP_HORIZON_TICKS = 50
# Ticks of the tip's path that can be replayed (kTipHistory there).
TIP_HISTORY_TICKS = 256
# Ticks between the arrival of a state and the first replayed one: decoded in one, loaded in one.
LOAD_TICKS = 2


@dataclass(frozen=True)
class Cost:
    """Instructions: a + b modes + c springs + d nodes."""

    a: float
    b: float
    c: float
    d: float

    def of(self, modes: int, springs: int, nodes: int) -> float:
        return self.a + self.b * modes + self.c * springs + self.d * nodes


@dataclass(frozen=True)
class Budget:
    """Of a servo tick of 1 ms. tick_instructions: servo and background together; replay_instructions: of catching up, as the
    board counts them (CatchUpPolicy in firmware/core/renderer.hpp)."""

    tick_instructions: float
    replay_instructions: float


# mps2_an386: what QEMU gives it. mps2_an500: 600,000 cycles at 1.8 an instruction (docs/decisions/larger_part.md), less than
# QEMU's 500,000.
BUDGETS: dict[str, Budget] = {
    "mps2_an386": Budget(125_000, 70_000),
    "mps2_an500": Budget(333_000, 200_000),
}
# The firmware as a Linux process catches up as the Cortex-M4F does, and nucleo_g474re has that processor: 1 ms of 170 MHz, at
# most 1.8 cycles an instruction.
BUDGETS["native"] = BUDGETS["mps2_an386"]
BUDGETS["nucleo_g474re"] = Budget(94_000, 70_000)

# By board and whether there is a near field: of a servo tick in contact (99 of 100 take no more), and of a replayed step (of
# nine in ten models that are replayed in contact, the mean). Measured 2026-11-22 at 64370e7 by `python host/bench/board_cost.py`:
# per board 19 models, each while it sticks 5 mm deep and in a slide at 10 cm/s.
_TICK: dict[tuple[str, bool], Cost] = {
    ("mps2_an386", True): Cost(0, 511, 168, 239),
    ("mps2_an386", False): Cost(14_009, 226, 0, 254),
    ("mps2_an500", True): Cost(0, 384, 192, 466),
    ("mps2_an500", False): Cost(13_850, 228, 0, 306),
}
_REPLAY: dict[tuple[str, bool], Cost] = {
    ("mps2_an386", True): Cost(4_891, 213, 0, 283),
    ("mps2_an386", False): Cost(22_950, 0, 0, 207),
    ("mps2_an500", True): Cost(0, 511, 104, 69),
    ("mps2_an500", False): Cost(22_528, 0, 0, 275),
}


@dataclass(frozen=True)
class Load:
    """Instructions that a model takes: of a servo tick in contact, and of a step that is replayed."""

    tick: float
    replay: float


def predict(size: ModelSize, board: str) -> Load:
    """With MARGIN."""
    key = (board if (board, True) in _TICK else "mps2_an386", size.evaluated_springs > 0)
    of = (size.modes, size.evaluated_springs, size.nodes)
    return Load(MARGIN * _TICK[key].of(*of), MARGIN * _REPLAY[key].of(*of))


def measure(values: Mapping[str, NDArray[Any]], board: str) -> Load:
    """What a run in QEMU took: the 99th percentile of ticks in contact; the replay's work per tick over the ticks that the
    slowest tenth of its models replayed in one. values: datasets of a record."""
    per_count = BOARDS[board].instructions_per_count
    assert per_count is not None, board
    touching = values["ticks/contact_mode"] != 0
    tick = float(np.percentile(values["ticks/tick_count"][1:][touching[:-1]], 99.0)) * per_count
    taken = (values["updates/status"] == 0) & (values["updates/swap_tick"] > 0)
    steps = []
    lag_ticks = values["ticks/catch_up_ticks"]
    for own, swap in zip(values["updates/tick"][taken], values["updates/swap_tick"][taken], strict=True):
        first, row = np.searchsorted(values["ticks/tick"], (own, swap)).tolist()
        idle = np.flatnonzero(lag_ticks[:row] == 0)
        caught_up_in = row - 1 - (int(idle[-1]) if len(idle) else -1)
        if np.all(touching[first:row]):
            steps.append((int(swap) - int(own)) / max(caught_up_in, 1))
    return Load(tick, BUDGETS[board].replay_instructions / float(np.percentile(steps, 10.0)))
