"""palpate.BoardLink, the Python end of a serial line, with both boards on a pseudo-terminal in real time."""

import time

import pytest
from board_peer import serial_terminal
from link_codec import FORM_TIP, LinkCodec

from palpate import BoardLink, BoardLinkError, __version__, _core

NAMES = {"native": "native", "mps2": "mps2_an386"}
# In real time a machine that does other things makes the board miss deadlines: it then refuses to arm, or stops.
PATIENCE_S = 3.0
DEADLINE_MISSED = 1 << 8
# Only a failure waits for it.
DEADLINE_S = 20.0


def arms(link):
    """Arms the board and returns True, or False where it has missed deadlines while it was asked."""
    missed = link.state().missed_deadlines
    try:
        link.arm(PATIENCE_S)
    except BoardLinkError:
        assert link.state().missed_deadlines > missed
        return False
    return True


@pytest.fixture(params=list(NAMES))
def board(request, tmp_path):
    with serial_terminal(request.param, tmp_path) as terminal, BoardLink(terminal) as link:
        yield link, NAMES[request.param]


def test_who_it_is_and_how_it_is(board):
    link, name = board
    info = link.info()
    assert (info.board, info.firmware, info.schema_hash) == (name, __version__, _core.SCHEMA_HASH)
    first, second = link.state(), link.state()
    assert first.tick < second.tick and second.mode == "idle" and second.faults == 0
    assert second.tip_m.shape == second.force_N.shape == (3,)
    assert not second.tip_m.any()  # encoders at zero: the reference pose


def test_the_tip_of_a_board_that_another_program_has_asked_for_tips_alone(board):
    link, _ = board
    link._link.write(LinkCodec.trace_request(0, 0, 0, FORM_TIP, 4))
    deadline_s = time.monotonic() + DEADLINE_S
    while (state := link.state()).tip_m is None or state.force_N is not None:
        assert time.monotonic() < deadline_s, state
    assert not state.tip_m.any()  # the reference pose


def test_arming_and_disarming(board):
    link, _ = board
    while link.state().mode == "boot":
        pass
    link.calibrate()
    if arms(link):
        state = link.state()
        assert state.mode == "render" or (state.mode == "fault" and state.faults == DEADLINE_MISSED)
    link.disarm()
    assert link.state().mode in ("idle", "fault")


def test_refusals_and_faults_are_told(board):
    link, _ = board
    while link.state().mode == "boot":
        pass
    link.stop()
    assert (fault := link.state()).mode == "fault" and fault.faults != 0
    with pytest.raises(BoardLinkError, match="arming: refused in mode fault with status "):
        link.arm()
    link.clear_fault()
    while link.state().mode == "fault":
        pass
    assert link.state().faults == 0


def test_leaving_disarms(tmp_path):
    with serial_terminal("native", tmp_path) as terminal:
        with BoardLink(terminal) as link:
            while link.state().mode == "boot":
                pass
            link.calibrate()
            arms(link)
        with BoardLink(terminal) as link:
            assert link.state().mode in ("idle", "fault")


def test_a_port_that_is_no_board(tmp_path):
    with pytest.raises(BoardLinkError, match="cannot be opened"):
        BoardLink(str(tmp_path / "tty"))
