"""Both boards on a serial line, in real time and without a plant: a host with pyserial talks to them."""

import struct

import pytest
from board_peer import (
    BoardInfo, FAULT_STOP_COMMAND, LinkCodec, MODE_BOOT, MODE_FAULT, MODE_IDLE, OK, STOP, on_serial_line,
    parse_status, parse_trace,
)

from palpate.hil import BOARDS
from palpate.versions import identify

NAMES = {"native": "native", "mps2": "mps2_an386"}


@pytest.fixture(params=list(NAMES))
def line(request, tmp_path):
    with on_serial_line(request.param, tmp_path) as host:
        host.name = NAMES[request.param]
        yield host


def test_answers_who_it_is(line):
    line.port.write(LinkCodec.request(LinkCodec.GET_INFO, 17))
    frame = line.wait_for(LinkCodec.GET_INFO)
    assert frame.is_response and frame.transfer_id == 17
    assert BoardInfo.parse(frame.payload).board == line.name


def test_the_image_says_of_itself_what_the_board_answers(line):
    line.port.write(LinkCodec.request(LinkCodec.GET_INFO, 3))
    info = BoardInfo.parse(line.wait_for(LinkCodec.GET_INFO).payload)
    said = identify(BOARDS[line.name])
    assert (said.version, said.schema, said.problem) == (info.firmware, info.schema_hash, "")


def test_status_and_trace_come_by_themselves(line):
    status = parse_status(line.wait_for(LinkCodec.BOARD_STATUS).payload)
    assert status["mode"] in (MODE_BOOT, MODE_IDLE)
    later = parse_status(line.wait_for(LinkCodec.BOARD_STATUS).payload)
    assert later["tick"] > status["tick"] and later["sequence"] > status["sequence"]
    _, _, samples = parse_trace(line.wait_for(LinkCodec.SERVO_TRACE).payload)
    assert len(samples) == 4 and not samples["tip_m"].any()  # encoders at zero


def test_a_corrupt_frame_is_counted_and_the_next_one_works(line):
    bad = bytearray(LinkCodec.request(LinkCodec.GET_INFO, 1))
    bad[-6] ^= 0x01
    line.port.write(bytes(bad) + LinkCodec.request(LinkCodec.GET_INFO, 2))
    assert line.wait_for(LinkCodec.GET_INFO).transfer_id == 2
    status = parse_status(line.wait_for(
        LinkCodec.BOARD_STATUS, lambda frame: parse_status(frame.payload)["frames_received"] > 0).payload)
    assert (status["frames_received"], status["frames_refused"]) == (1, 1)


def test_stop_is_answered_and_latched(line):
    line.port.write(LinkCodec.command(5, STOP))
    assert line.wait_for(LinkCodec.COMMAND).payload[:2] == bytes([OK, MODE_FAULT])
    status = parse_status(line.wait_for(
        LinkCodec.BOARD_STATUS, lambda frame: parse_status(frame.payload)["mode"] == MODE_FAULT).payload)
    assert status["faults"] == FAULT_STOP_COMMAND


def test_many_requests_in_a_row_are_all_answered(line):
    for number in range(50):
        line.port.write(LinkCodec.request(LinkCodec.GET_INFO, number))
        assert line.wait_for(LinkCodec.GET_INFO).transfer_id == number
    line.port.write(LinkCodec.trace_request(0, 0, 8))
    status = parse_status(line.wait_for(
        LinkCodec.BOARD_STATUS, lambda frame: parse_status(frame.payload)["frames_received"] >= 51).payload)
    assert (status["frames_refused"], status["frames_lost"]) == (0, 0)
