"""All boards in lock-step with a minimal plant: what a board must do, tick by tick."""

import dataclasses
import pathlib
import struct

import numpy as np
import pytest
from board_peer import (
    ACTUATOR_FRAME, ARM_CONFIRM, ARM_REQUEST, BoardInfo, CLEAR_FAULT, CRASH, DISARM, EMERGENCY_STOP,
    EXIT_PEER_CLOSED, EXIT_PROCESSOR_FAULT, EXIT_PROTOCOL_ERROR, EXIT_SHUTDOWN, FAULT_EMERGENCY_STOP,
    FAULT_ENCODER_JUMP, FAULT_STOP_COMMAND, FAULT_SUPPLY_LOW, FORM_FULL, FORM_TIP, LinkCodec, LinkFrame, LinkReader, Lockstep, MODE_BOOT,
    MODE_FAULT, MODE_IDLE, MODE_RENDER, OK, PORT_UNKNOWN, SCHEMA_MISMATCH, STOP, SUPPLY_LOW, TOKEN_WRONG, lockstep, parse_status,
    parse_tips, parse_trace, square_model,
)

BOARDS = ["native", "mps2", "nucleo"]
BOOT_TICKS = 25  # a few more than the firmware's 20
MODEL_TICKS = 40  # until a small model is in use, at 921,600 baud
# Fields of ActuatorFrame that tell time: the native board has no clock in lock-step.
TIMING_FIELDS = ("tick_count", "busy_count", "clock_Hz")


@pytest.fixture(params=BOARDS)
def board(request, tmp_path):
    with lockstep(request.param, tmp_path / "board") as running:
        yield running


def arm(board: Lockstep) -> None:
    board.run(BOOT_TICKS)
    challenge = board.answer(LinkCodec.command(1, ARM_REQUEST), LinkCodec.COMMAND)
    status, mode, token = struct.unpack("<BBxxI", challenge.payload)
    assert (status, mode) == (OK, MODE_IDLE) and token != 0
    confirmed = board.answer(LinkCodec.command(2, ARM_CONFIRM, token), LinkCodec.COMMAND)
    assert struct.unpack_from("<BB", confirmed.payload) == (OK, MODE_RENDER)


def test_boots_with_outputs_off(board):
    for _ in range(300):
        frame = board.tick()
        assert frame["enabled"] == 0 and not frame["setpoint_A"].any()
    assert frame["mode"] == MODE_IDLE
    assert frame["missed_deadlines"] == 0 and frame["background_overruns"] == 0


def test_ticks_count_from_zero(board):
    for tick in range(100):
        frame = board.tick()
        assert (frame["tick"], frame["next_tick"]) == (tick, tick + 1)


def test_tip_follows_the_encoders(board):
    assert not board.tick()["tip_m"].any()  # the reference pose
    # Joint 1 turns the arm about the vertical through the base: the tip, at a distance of l1 = 0.215 m, goes sideways.
    counts_per_rad = 4 * 1024 * 13.3 / (2 * np.pi)
    for count in range(0, 2000, 20):
        frame = board.tick(encoder=(count, 0, 0))
    angle_rad = count / counts_per_rad
    # float32 against double, on 0.2 m
    np.testing.assert_allclose(frame["tip_m"], [0.215 * np.sin(angle_rad), 0.215 * (1 - np.cos(angle_rad)), 0],
                               atol=1e-7)


def test_trace_tells_every_tip_position(board):
    tips = []
    for i in range(200):
        tips.append(board.tick(encoder=(3 * i, -2 * i, i))["tip_m"])
    board.run(5)
    sequences, next_tick = [], 0
    for frame in board.take(LinkCodec.SERVO_TRACE):
        sequence, first_tick, samples = parse_trace(frame.payload)
        assert first_tick == next_tick
        next_tick += len(samples)
        sequences.append(sequence)
        for tick, sample in enumerate(samples, first_tick):
            if tick < 200:
                assert (sample["tip_m"] == tips[tick]).all()
    assert next_tick >= 200 and sequences == list(range(len(sequences)))


def test_tips_alone_tell_every_tip_position_within_their_bound(board):
    tips = [board.tick(link=LinkCodec.trace_request(0, 0, 0, FORM_TIP, 8))["tip_m"]]
    for i in range(1, 200):
        tips.append(board.tick(encoder=(3 * i, -2 * i, i))["tip_m"])
    board.run(10)
    assert not board.take(LinkCodec.SERVO_TRACE)
    next_tick = 0
    for frame in board.take(LinkCodec.TIP_TRACE):
        first_tick, exponent, tip_m = parse_tips(frame.payload)
        assert first_tick == next_tick and len(tip_m) == 8
        next_tick += len(tip_m)
        for at_m, true_m in zip(tip_m, tips[first_tick:next_tick], strict=False):
            np.testing.assert_allclose(at_m, true_m.astype(float), rtol=0.0, atol=0.502 * 2.0**exponent)
    assert next_tick >= 200
    # What cannot be asked for is refused, and all goes on as before.
    refused = b"".join(LinkCodec.trace_request(1 + i, 0, 0, form, ticks) for i, (form, ticks) in enumerate([(3, 8), (1, 0), (1, 33)]))
    board.tick(link=refused)
    board.run(100)
    status = parse_status(board.take(LinkCodec.BOARD_STATUS)[-1].payload)
    assert (status["trace_form"], status["trace_ticks"], status["frames_refused"]) == (FORM_TIP, 8, 3)


def test_status_comes_every_100_ticks_and_with_each_mode(board):
    board.run(250)
    statuses = [parse_status(frame.payload) for frame in board.take(LinkCodec.BOARD_STATUS)]
    assert [status["tick"] for status in statuses] == [0, 19, 100, 200]
    assert [status["mode"] for status in statuses] == [MODE_BOOT, MODE_IDLE, MODE_IDLE, MODE_IDLE]


def test_arms_in_two_steps_and_carries_the_arm(board):
    arm(board)
    frame = board.run(50)
    assert frame["enabled"] == 1 and frame["mode"] == MODE_RENDER
    assert np.abs(frame["setpoint_A"]).max() > 0.01
    board.answer(LinkCodec.command(3, DISARM), LinkCodec.COMMAND)
    frame = board.tick()
    assert frame["enabled"] == 0 and not frame["setpoint_A"].any()


@pytest.mark.parametrize("wrong", [1, 0xFFFFFFFF])
def test_a_wrong_token_arms_nothing(board, wrong):
    board.run(BOOT_TICKS)
    token = struct.unpack("<BBxxI", board.answer(LinkCodec.command(1, ARM_REQUEST), LinkCodec.COMMAND).payload)[2]
    reply = board.answer(LinkCodec.command(2, ARM_CONFIRM, token ^ wrong), LinkCodec.COMMAND)
    assert reply.payload[0] == TOKEN_WRONG
    assert board.tick()["enabled"] == 0


def test_a_late_token_arms_nothing(board):
    board.run(BOOT_TICKS)
    token = struct.unpack("<BBxxI", board.answer(LinkCodec.command(1, ARM_REQUEST), LinkCodec.COMMAND).payload)[2]
    board.run(1000)
    assert board.answer(LinkCodec.command(2, ARM_CONFIRM, token), LinkCodec.COMMAND).payload[0] == TOKEN_WRONG
    assert board.tick()["enabled"] == 0


def test_emergency_stop_acts_in_its_tick_and_latches(board):
    arm(board)
    frame = board.tick(flags=EMERGENCY_STOP)
    assert frame["enabled"] == 0 and not frame["setpoint_A"].any()
    frame = board.run(50)
    assert (frame["mode"], frame["faults"]) == (MODE_FAULT, FAULT_EMERGENCY_STOP)
    assert board.answer(LinkCodec.command(3, CLEAR_FAULT), LinkCodec.COMMAND).payload[:2] == bytes([OK, MODE_IDLE])


def test_a_low_supply_acts_in_its_tick_and_latches(board):
    arm(board)
    frame = board.tick(flags=SUPPLY_LOW)
    assert frame["enabled"] == 0 and not frame["setpoint_A"].any()
    frame = board.run(50)
    assert (frame["mode"], frame["faults"]) == (MODE_FAULT, FAULT_SUPPLY_LOW)
    assert board.answer(LinkCodec.command(3, CLEAR_FAULT), LinkCodec.COMMAND).payload[:2] == bytes([OK, MODE_IDLE])


def test_stop_command_latches(board):
    arm(board)
    board.answer(LinkCodec.command(3, STOP), LinkCodec.COMMAND)
    frame = board.tick()
    assert (frame["enabled"], frame["faults"]) == (0, FAULT_STOP_COMMAND)


def test_encoder_jump_switches_off_in_its_tick(board):
    arm(board)
    frame = board.tick(encoder=(0, 5000, 0))
    assert (frame["enabled"], frame["faults"] & FAULT_ENCODER_JUMP) == (0, FAULT_ENCODER_JUMP)


def test_corrupt_and_lost_frames_are_counted(board):
    board.run(BOOT_TICKS)
    bad = bytearray(LinkCodec.request(LinkCodec.GET_INFO, 1))
    bad[10] ^= 0x40
    board.tick(link=bytes(bad))
    board.answer(LinkCodec.request(LinkCodec.GET_INFO, 2), LinkCodec.GET_INFO)
    board.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO)
    board.tick(link=LinkCodec.encode(1234, 0, b"?"))  # no such subject here
    board.run(100)
    status = parse_status(board.take(LinkCodec.BOARD_STATUS)[-1].payload)
    assert (status["frames_received"], status["frames_refused"], status["frames_lost"]) == (3, 2, 2)
    assert status["last_status"] == PORT_UNKNOWN


def test_shutdown_answers_with_outputs_off_and_exits(board):
    arm(board)
    frame, code = board.shut_down()
    assert frame["enabled"] == 0 and not frame["setpoint_A"].any()
    assert code == EXIT_SHUTDOWN


def test_a_wrong_tick_ends_the_run(board):
    board.run(3)
    board.send(tick=77)
    assert board.receive() is None
    assert board.process.wait(20) == EXIT_PROTOCOL_ERROR


def test_a_plant_that_has_gone_ends_the_run(board):
    board.run(3)
    board.hang_up()
    assert board.receive() is None
    assert board.process.wait(20) == EXIT_PEER_CLOSED


@pytest.mark.parametrize("board", ["native", "mps2"], indirect=True)
def test_a_processor_fault_ends_with_outputs_off(board):
    """nucleo_g474re starts again instead: test_nucleo.py."""
    arm(board)
    board.send(flags=CRASH)
    frame = board.receive()
    assert frame["enabled"] == 0 and not frame["setpoint_A"].any()
    assert board.process.wait(20) == EXIT_PROCESSOR_FAULT


def scripted_run(board: str, folder: pathlib.Path) -> np.ndarray:
    """Arms, sends a model and other frames, good and bad, presses into the body and drags. Returns every frame."""
    random = np.random.default_rng(3)
    with lockstep(board, folder) as running:
        arm(running)
        info = BoardInfo.parse(running.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO).payload)
        model = square_model(9, running.next_tick - 1, info.schema_hash, copies=8)
        pending = model.frames(0)
        for i in range(500):
            if i % 50 == 10:
                pending += LinkCodec.request(LinkCodec.GET_INFO, 100 + i)
            if i % 70 == 20:
                pending += random.bytes(60)
            if i % 90 == 30:
                pending += LinkCodec.trace_request(i, i // 2, 40, form=(FORM_TIP, FORM_FULL)[i // 90 % 2], ticks=3 + i // 90)
            # 4 mm down, 7 mm to and fro, up again (0.03 mm a count).
            count = (round(300 * np.sin(i / 60)), -min(i // 2, 140, max(0, 460 - i)), 0)
            running.tick(encoder=count, current_A=tuple(random.normal(size=3)), link=pending[:500])
            pending = pending[500:]
        _, code = running.shut_down()
        assert code == EXIT_SHUTDOWN
        return np.frombuffer(bytes(running.sent), ACTUATOR_FRAME)


@pytest.mark.parametrize("board", BOARDS)
def test_two_runs_give_the_same_bytes(board, tmp_path):
    first, second = (scripted_run(board, tmp_path / name) for name in "ab")
    assert first.tobytes() == second.tobytes()


def test_an_old_model_goes_on_when_a_corrupt_one_comes(board):
    arm(board)
    info = BoardInfo.parse(board.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO).payload)
    good = square_model(9, board.next_tick - 1, info.schema_hash)
    board.tick(link=good.frames(0))
    assert board.run(MODEL_TICKS)["model_sequence"] == 9
    better = square_model(10, board.next_tick - 1, info.schema_hash)
    corrupt = bytearray(better.frames(1))
    corrupt[-20] ^= 0x80  # of the state; the byte is 1 there: turned into 0, it would end the frame
    board.tick(link=bytes(corrupt))
    other = square_model(11, board.next_tick - 1, info.schema_hash ^ 1)
    board.tick(link=other.frames(2))
    frame = board.run(110)
    assert (frame["model_sequence"], frame["mode"], frame["faults"]) == (9, MODE_RENDER, 0)
    status = parse_status(board.take(LinkCodec.BOARD_STATUS)[-1].payload)
    assert (status["models_taken"], status["models_refused"], status["frames_refused"]) == (1, 1, 1)
    assert status["frames_lost"] == 1  # the corrupt one left a gap
    reports = [struct.unpack("<IB3xIIf", frame.payload)[:2] for frame in board.take(LinkCodec.MODEL_REPORT)]
    assert reports == [(9, OK), (11, SCHEMA_MISMATCH)]


def link_messages(frames: np.ndarray) -> list[tuple[int, LinkFrame]]:
    """Every link frame with the tick that it came in, without what tells the board's name and time."""
    reader, messages = LinkReader(), []
    for frame in frames:
        for message in reader.feed(bytes(frame["link"][:frame["link_length"]])):
            payload = message.payload
            if message.port == LinkCodec.GET_INFO:
                info = BoardInfo.parse(payload)
                payload = repr(dataclasses.replace(info, board="")).encode()
            if message.port == LinkCodec.BOARD_STATUS:
                status = parse_status(payload).copy()
                status["worst_tick_count"] = status["clock_Hz"] = 0
                payload = status.tobytes()
            messages.append((int(frame["tick"]), dataclasses.replace(message, payload=payload)))
    return messages


def test_native_and_emulated_board_compute_the_same_bits(tmp_path):
    native, emulated = (scripted_run(board, tmp_path / board) for board in ("native", "mps2"))
    # The run has what it takes to differ: all contact modes, forces and currents, and time enough in each tick.
    assert set(native["contact_mode"]) == {0, 1, 2}
    assert np.abs(native["force_N"]).max() > 0.5 and np.abs(native["setpoint_A"]).max() > 0.5
    assert emulated["background_overruns"][-1] == emulated["missed_deadlines"][-1] == 0
    fields = [name for name in ACTUATOR_FRAME.names if name not in (*TIMING_FIELDS, "link", "link_length")]
    for name in fields:
        assert native[name].tobytes() == emulated[name].tobytes(), name
    assert link_messages(native) == link_messages(emulated)
