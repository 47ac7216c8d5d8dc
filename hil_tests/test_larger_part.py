"""The board with a larger part, mps2_an500: the same firmware on a Cortex-M7, with more time in a tick."""

import numpy as np
import pytest
from board_peer import CRASH, EXIT_PROCESSOR_FAULT, BoardInfo, LinkCodec, lockstep
from loop_scene import Run, run, scene

# The most modes that a board can take: 3 for each of 28 nodes of the near field, and 12.
HYBRID = '[model]\nbuilder = "hybrid"\nnear_nodes = 12\n'
# QEMU gives a tick 500,000 instructions; these have time on a part with 600,000 cycles at the 1.8 cycles each of
# docs/decisions/cycles.md.
TICK_INSTRUCTIONS = 333_000


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    folder = tmp_path_factory.mktemp("larger_part")
    texts = {
        board: scene(HYBRID, board=board).replace("[outputs]\n", "[outputs]\nprobe_node = [2, 2, 5]\n")
        for board in ("mps2_an386", "mps2_an500")
    }
    return {board: run(folder / board, text) for board, text in texts.items()}


def test_says_who_it_is(tmp_path):
    with lockstep("mps2_an500", tmp_path / "board") as board:
        frame = board.answer(LinkCodec.request(LinkCodec.GET_INFO, 0), LinkCodec.GET_INFO)
        assert BoardInfo.parse(frame.payload).board == "mps2_an500"
        board.shut_down()
    assert (tmp_path / "board/console.txt").read_text().startswith("palpate mps2_an500 ")


def test_a_processor_fault_ends_with_outputs_off(tmp_path):
    with lockstep("mps2_an500", tmp_path / "board") as board:
        board.run(3)
        board.send(flags=CRASH)
        frame = board.receive()
        assert frame["enabled"] == 0 and not np.any(frame["setpoint_A"])
        assert board.process.wait(20) == EXIT_PROCESSOR_FAULT
    assert "BFAR b0000000" in (tmp_path / "board/console.txt").read_text()


def test_every_tick_has_time_for_its_background(runs):
    summary = runs["mps2_an500"].summary
    assert summary["missed_deadlines"] == summary["background_overruns"] == summary["faults"] == 0
    assert summary["worst_busy_instructions"] < TICK_INSTRUCTIONS


def test_models_are_taken_over_sooner(runs):
    late = {}
    for board, result in runs.items():
        taken = result["updates/status"] == 0
        assert np.count_nonzero(taken) > 10
        late[board] = np.median((result["updates/swap_tick"] - result["updates/tick"])[taken].astype(int))
    assert late["mps2_an500"] < late["mps2_an386"]


def test_the_host_computes_the_same_bits(runs):
    # Replayed on the host with the board's own policy of catching up. Not while the force rises after outputs came on.
    for board, result in runs.items():
        passed_on = (result["ticks/enabled"] > 0) & (result["ticks/tick"] > 200)
        assert result["probe/force_N"][passed_on].tobytes() == result["ticks/force_N"][passed_on].tobytes(), board
        assert np.abs(result["ticks/force_N"][passed_on]).max() > 1.0
