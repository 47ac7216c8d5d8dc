"""The cost model of the rule that chooses order, patch and rate, against models in QEMU that are not in its fit
(host/bench/board_cost.py): never below what they take, and not far above."""

from typing import Any

import pytest

from palpate import _core, board_cost, hil, record, record_layout
from palpate.model_size import model_size
from palpate.paths import SCENES
from palpate.scene import load_scene

# A budget that counts on too much only wastes some of it: with 30 % the order is one step of four nodes too low at most (12
# modes of 72 take 12 % of a tick).
MOST_ABOVE = 1.3
# The replay goes by whole ticks: of a model that catches up in 8, each is an eighth.
MOST_ABOVE_IN_REPLAY = 1.45
HELD_OUT: dict[str, dict[str, Any]] = {
    "hybrid, 78 modes": {"model.builder": "hybrid", "model.near_nodes": 6},
    "hybrid, 57 modes": {"model.builder": "hybrid", "model.patch_nodes": [3, 3, 2], "model.near_nodes": 6},
    "krylov, 72 modes": {"model.builder": "krylov", "model.middle_shifts_Hz": [20.0, 200.0]},
    "patch, 72 modes": {"model.builder": "patch", "model.patch_nodes": [4, 3, 2]},
}
SLIDE = {"path.csv": "drag_10cm_s.csv", "duration_s": 1.65, "contact.friction": 0.3}


@pytest.mark.parametrize("board", ["mps2_an386", "mps2_an500"])
@pytest.mark.parametrize("name", HELD_OUT)
def test_no_model_takes_more_than_predicted(board, name):
    scene = load_scene(SCENES / "frontier/reference.toml", {**SLIDE, **HELD_OUT[name]}, board)
    results, _ = hil.run_closed_loop(_core, scene.to_dict(), hil.BOARDS[board], lambda done, total: True)
    values = record.conform(
        record_layout.RUN, {d.path: results[d.path] for d in record_layout.RUN if d.path in results}
    )
    size = model_size(scene.sections)
    assert size.modes == int(name.split()[1])
    assert (size.modes, size.nodes) == (values["updates/modes"].max(), values["updates/nodes"].max())
    assert size.state_bytes == values["updates/bytes"].max()
    # Its framing is an upper bound; pieces that are sent again come on top.
    bases = values["updates/basis_bytes"][values["updates/basis_bytes"] > 0]
    assert bases.min() <= size.basis_bytes <= 1.05 * bases.min()
    measured, predicted = board_cost.measure(values, board), board_cost.predict(size, board)
    assert measured.tick <= predicted.tick <= MOST_ABOVE * measured.tick
    assert measured.replay <= predicted.replay <= MOST_ABOVE_IN_REPLAY * measured.replay
