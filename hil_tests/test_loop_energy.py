"""The energy that corrections account for in the closed loop: the host finds the same from its record."""

import numpy as np
import pytest
from loop_scene import Run, run, scene

FLOAT32 = 2.0**-24  # half a step, relative
HYBRID = '[model]\nbuilder = "hybrid"\n'
LOST = "[board.faults]\noverlong_ticks = [520]\n"


def with_probe(extra: str, board: str) -> str:
    return scene(extra, board=board).replace("[outputs]\n", "[outputs]\nprobe_node = [2, 2, 5]\n")


def check_account(result: Run) -> np.ndarray:
    """Board and replay agree for every model that was taken over; their energies (models,), J."""
    # The replay is the board's rendering, to the bit, where no limit comes in between (the force rises when outputs come on).
    passed_on = (result["ticks/enabled"] > 0) & (result["ticks/tick"] > 200)
    assert result["probe/force_N"][passed_on].tobytes() == result["ticks/force_N"][passed_on].tobytes()
    taken = result["updates/status"] == 0
    board_J = result["updates/correction_energy_J"].astype(np.float64)
    replay_J = result["probe/correction_energy_J"]
    np.testing.assert_array_equal(np.isfinite(replay_J), taken)
    assert np.all(board_J[~taken] == 0.0)
    # The board's places are rounded where its model's origin, within 6 cm, is taken off; so are its sums, after as many
    # ticks as were replayed.
    ticks = (result["updates/swap_tick"] - result["updates/tick"])[taken].astype(float)
    force_N = 2.0 * np.linalg.norm(result["probe/force_N"], axis=1).max()
    move_m = np.linalg.norm(np.diff(result["ticks/tip_m"], axis=0), axis=1).max()
    rounding_J = ticks * force_N * FLOAT32 * (np.sqrt(3.0) * 2.0 * 0.06 + 4.0 * move_m + 0.5 * ticks * move_m)
    error_J = np.abs(board_J[taken] - replay_J[taken])
    assert np.all(error_J <= rounding_J), (error_J / rounding_J).max()
    # It is more than rounding that they agree on.
    assert np.abs(board_J[taken]).max() > 10.0 * rounding_J.max()
    return board_J[taken]


@pytest.mark.parametrize("board", ["native", "mps2_an386"])
def test_board_and_replay_account_for_the_same_energy(tmp_path, board):
    result = run(tmp_path, with_probe("", board))
    energy_J = check_account(result)
    given_J = np.maximum(energy_J, 0.0)
    assert result.summary["correction_energy_J"] == pytest.approx(
        {"sum": energy_J.sum(), "injected": given_J.sum(), "largest": given_J.max()}, rel=1e-12
    )
    assert given_J.max() > 0.0 > energy_J.min()


def test_models_that_overlap_and_lost_ticks_are_accounted_too(tmp_path):
    # At 60 updates a second a model begins before the take-over of the one before.
    result = run(tmp_path, with_probe(HYBRID + "[rates]\nmodel_update_Hz = 60.0\n" + LOST, "mps2_an386"))
    assert result.summary["missed_deadlines"] >= 2
    check_account(result)
    taken = result["updates/status"] == 0
    swap_tick, tick = result["updates/swap_tick"][taken].astype(int), result["updates/tick"][taken].astype(int)
    assert np.any(tick[1:] < swap_tick[:-1] - 1)
