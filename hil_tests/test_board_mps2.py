"""What is particular to the emulated microcontroller: its timer, its faults, its memory."""

import subprocess

import pytest
from board_peer import (
    BUILD_MPS2, BURN_CYCLES, BoardInfo, CRASH, EXIT_PROCESSOR_FAULT, LinkCodec, lockstep, parse_status, parse_trace,
    square_model,
)

CLOCK_HZ = 25_000_000


@pytest.fixture
def board(tmp_path):
    with lockstep("mps2", tmp_path / "board") as running:
        yield running


def test_says_who_it_is_on_the_console(board, tmp_path):
    frame = board.answer(LinkCodec.request(LinkCodec.GET_INFO, 0), LinkCodec.GET_INFO)
    info = BoardInfo.parse(frame.payload)
    assert info.board == "mps2_an386"
    board.shut_down()
    console = (tmp_path / "board/console.txt").read_text()
    assert console.startswith(f"palpate mps2_an386 {info.firmware} schema {info.schema_hash:016x} link lock-step")


def test_measures_its_ticks(board):
    frame = board.run(20)
    assert frame["clock_Hz"] == CLOCK_HZ
    # An idle tick costs some thousand instructions, 5 to a count; its deadline is at 25,000 counts.
    assert 100 < frame["tick_count"] < 2_000
    assert frame["tick_count"] < frame["busy_count"] < 10_000


def test_an_overlong_tick_misses_deadlines_and_time_goes_on(board):
    board.run(10)
    frame = board.tick(flags=BURN_CYCLES)  # 2.5 ticks more
    assert (frame["tick"], frame["missed_deadlines"], frame["next_tick"]) == (10, 2, 12)
    frame = board.tick()
    assert (frame["tick"], frame["missed_deadlines"], frame["next_tick"]) == (12, 2, 13)
    assert frame["tick_count"] == pytest.approx(2.5e-3 * CLOCK_HZ, rel=0.05)
    frame = board.run(100)
    assert (frame["missed_deadlines"], frame["next_tick"]) == (2, 113)
    status = parse_status(board.take(LinkCodec.BOARD_STATUS)[-1].payload)
    assert status["missed_deadlines"] == 2 and status["worst_tick_count"] > 2.5e-3 * CLOCK_HZ


def test_the_trace_has_no_hole_after_lost_ticks(board):
    board.run(10)
    board.tick(flags=BURN_CYCLES)
    board.run(50)
    next_tick = 0
    for frame in board.take(LinkCodec.SERVO_TRACE):
        _, first_tick, samples = parse_trace(frame.payload)
        assert first_tick == next_tick
        next_tick += len(samples)
    assert next_tick >= 60


def test_a_processor_fault_is_reported_on_the_console(board, tmp_path):
    board.run(3)
    board.send(flags=CRASH)
    board.receive()
    assert board.process.wait(20) == EXIT_PROCESSOR_FAULT
    # Precise bus fault with a valid address (CFSR, Armv7-M B3.2.15).
    assert "CFSR 00008200 HFSR 40000000 BFAR b0000000" in (tmp_path / "board/console.txt").read_text()


def test_the_largest_model_leaves_time_in_every_tick(board):
    info = BoardInfo.parse(board.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO).payload)
    model = square_model(1, board.next_tick - 1, info.schema_hash, copies=info.max_modes // 3)
    pending = model.frames(0)
    while pending:
        board.tick(link=pending[:1200])  # 12 Mbaud
        pending = pending[1200:]
    worst_count = 0
    for i in range(300):
        frame = board.tick(encoder=(i // 4, -min(i, 140), 0))
        worst_count = max(worst_count, int(frame["tick_count"]))
    assert frame["model_sequence"] == 1 and frame["contact_mode"] != 0
    assert frame["missed_deadlines"] == 0
    assert worst_count < 25_000


@pytest.mark.parametrize(("wish", "missing"), [("malloc", "_sbrk"), ("new", "operator new")])
def test_whatever_needs_a_heap_does_not_link(wish, missing):
    build = subprocess.run(["cmake", "--build", str(BUILD_MPS2), "--target", f"palpate_heap_{wish}"],
                           capture_output=True, text=True, check=False)
    assert build.returncode != 0
    assert "undefined reference" in build.stdout and missing in build.stdout
