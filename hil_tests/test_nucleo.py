"""The image for the NUCLEO-G474RE, as it is flashed, on register models of the part (palpate.machine): from power on to a running servo,
and what happens when clock, tick, power or flash fail. Nothing here has run on silicon."""

import itertools
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest
from board_peer import LINK_BYTES_PER_TICK, NUCLEO_IMAGE, REPOSITORY
from link_codec import LinkCodec, LinkReader
from loop_scene import run, scene
from test_board_lockstep import scripted_run

pytest.importorskip("unicorn", reason="Unicorn is not installed: ./run does it")
pytestmark = pytest.mark.skipif(not NUCLEO_IMAGE.exists(), reason="the image for nucleo_g474re is not built: ./run does it")

from palpate.machine.clock import BROWN_OUT_RESET, PIN_RESET, SOFTWARE_RESET, WATCHDOG_RESET
from palpate.machine.gpio import ALTERNATE, ANALOG
from palpate.machine.links import link_of
from palpate.machine.nucleo_g474re import TICK_CYCLES, Nucleo
from palpate.machine.part import Image
from palpate.machine.stm32g474 import CLOCK_Hz
from palpate.reset_record import REGISTER as RESET_RECORD
from palpate.reset_record import ResetRecord

SECOND = CLOCK_Hz
# A step of the DAC is 16 A / 4096.
SETPOINT_STEP_A = 16.0 / 4096
FAULT_CLOCK_LOST, FAULT_PROCESSOR, FAULT_BACKGROUND_STUCK = 3, 1, 5


@pytest.fixture(scope="module")
def image() -> Image:
    return Image.read(NUCLEO_IMAGE)


@pytest.fixture
def board(image) -> Nucleo:
    return Nucleo(image)


def word(board: Nucleo, symbol: str, index: int = 0) -> int:
    return int.from_bytes(board.chip.core.load(board.chip.image.symbols[symbol] + 4 * index, 4), "little")


def ticks(board: Nucleo) -> int:
    return word(board, "palpate_last_tick_report")


def run_ticks(board: Nucleo, count: int) -> None:
    for _ in range(count):
        assert board.run_to_tick(2 * TICK_CYCLES)
        assert board.run_tick()


def start(board: Nucleo, count: int = 5) -> None:
    assert board.run_to_tick(SECOND)
    assert board.run_tick()
    run_ticks(board, count - 1)


def reset_flags(board: Nucleo) -> int:
    return word(board, "palpate_boot_report")


def test_starts_at_170_MHz_from_the_crystal(board):
    start(board)
    assert board.chip.rcc.system_Hz == 170_000_000
    assert board.chip.rcc.value["PLLCFGR"] & 3 == 3
    assert board.chip.resets == 0 and ticks(board) == 4
    assert reset_flags(board) & (BROWN_OUT_RESET | PIN_RESET) == BROWN_OUT_RESET | PIN_RESET


def test_starts_without_a_crystal(board):
    board.chip.rcc.has_crystal = False
    start(board)
    assert board.chip.rcc.system_Hz == 170_000_000
    assert board.chip.rcc.value["PLLCFGR"] & 3 == 2


def test_ticks_come_each_millisecond(board):
    start(board)
    begin = board.chip.cycle
    run_ticks(board, 100)
    assert abs(board.chip.cycle - begin - 100 * TICK_CYCLES) < TICK_CYCLES // 2
    assert ticks(board) == 104


def test_setpoints_are_at_mid_scale_and_the_amplifiers_off_until_somebody_arms(board):
    seen = set()

    def look() -> None:
        codes = (board.chip.dac["DAC1"].code(1), board.chip.dac["DAC1"].code(2), board.chip.dac["DAC2"].code(1))
        seen.add((board.amplifiers_on, codes))

    for source in (*board.chip.dac.values(), board.chip.gpio["B"]):
        source.changed = look
    start(board, 50)
    assert seen and not any(on for on, _ in seen)
    # A channel that comes on does so at mid-scale.
    assert {code for _, codes in seen for code in codes} == {None, 2048}


@pytest.mark.parametrize("joint", range(3))
def test_encoders_count_beyond_16_bits_both_ways(board, joint):
    start(board)
    tip = []
    for count in (*range(0, 90_000, 30_000), *range(90_000, -90_000, -30_000), *range(-90_000, 1, 30_000)):
        counts = [0, 0, 0]
        counts[joint] = count
        board.set_encoders(counts)
        run_ticks(board, 1)
        tip.append(board.chip.core.load(board.chip.image.symbols["palpate_last_tick_report"] + 8, 12))
    # Back where it was, the tip is, too: no wrap was lost.
    assert tip[-1] == tip[0] != tip[1]


def test_pins_have_the_functions_of_the_wiring(board):
    """docs/hardware.md, boards/nucleo_g474re/pins.hpp; the serial image."""
    start(board)
    gpio = board.chip.gpio
    for port, pin, function in (("A", 0, 1), ("A", 1, 1), ("B", 10, 1), ("C", 6, 2), ("C", 7, 2), ("C", 8, 2),
                                ("B", 6, 2), ("B", 7, 2), ("B", 9, 2), ("A", 2, 12), ("A", 3, 12)):
        assert (gpio[port].mode(pin), gpio[port].alternate(pin)) == (ALTERNATE, function), f"P{port}{pin}"
    for port, pin in (("A", 4), ("A", 5), ("A", 6), ("C", 0), ("C", 1), ("C", 2)):
        assert gpio[port].mode(pin) == ANALOG, f"P{port}{pin}"
    assert gpio["B"].driven(1) is False
    board.set_emergency_stop(True)  # or a broken wire
    assert gpio["B"].level(14)


@pytest.mark.parametrize(("joint", "timer", "channel"), [(0, "TIM2", 3), (1, "TIM3", 3), (2, "TIM4", 4)])
def test_the_index_latches_its_count(board, joint, timer, channel):
    start(board)
    counts = [0, 0, 0]
    counts[joint] = -70_000
    for part in (-30_000, -60_000, -70_000):  # a tick moves by less than half of 16 bits
        counts[joint] = part
        board.set_encoders(counts)
        run_ticks(board, 1)
    board.chip.timer[timer].index(channel)
    counts[joint] = -69_000
    board.set_encoders(counts)
    run_ticks(board, 1)
    at = board.chip.image.symbols["palpate_encoder_index"] + 8 * joint
    assert struct.unpack("<Ii", board.chip.core.load(at, 8)) == (1, -70_000)


def test_the_watchdog_bites_when_the_tick_stops(board):
    start(board)
    board.chip.timer["TIM7"].write_CR1(0)
    begin = board.chip.cycle
    assert not board.run_to_tick(SECOND // 2) or board.chip.resets
    assert board.chip.resets == 1
    timeout = board.chip.cycle_of_reset - begin
    assert timeout <= board_timeout_cycles()
    assert not board.amplifiers_on
    start(board)
    assert reset_flags(board) & WATCHDOG_RESET


def board_timeout_cycles() -> int:
    """50 ms: boards/stm32/watchdog.hpp has less, of a clock that is 5 % slow."""
    return CLOCK_Hz // 20


def test_a_processor_fault_resets_and_leaves_a_record(board):
    start(board)
    board.chip.core.crash()
    assert board.run_to_tick(SECOND)
    while not board.chip.resets:
        board.run_tick()
        assert board.run_to_tick(SECOND)
    assert board.chip.resets == 1
    before = kept_tick(board)
    start(board)
    assert reset_flags(board) & SOFTWARE_RESET
    assert word(board, "palpate_boot_report", 2) == FAULT_PROCESSOR
    # As a host reads it.
    record = reset_record(board)
    assert "software" in record.cause and record.failed_starts == 0
    assert record.fault.startswith(f"processor fault at {word(board, 'palpate_boot_report', 4):#010x}, CFSR 0x8200")  # a precise bus error
    assert (record.tick, record.faults) == (before, 0) and f"last tick {before}" in record.before


def test_power_that_comes_on_leaves_no_record(board):
    start(board)
    record = reset_record(board)
    assert "power was low or off" in record.cause and record.fault == "" and "without power" in record.before


def kept_tick(board: Nucleo) -> int:
    """The last one that has ended."""
    return word(board, "palpate_kept_tick", 1)


def kept_heat(board: Nucleo) -> tuple[float, ...]:
    """Windings and housings, of the last tick (firmware/core/kept_tick.hpp)."""
    return struct.unpack("<6f", board.chip.core.load(board.chip.image.symbols["palpate_kept_tick"] + 12, 24))


def faults(board: Nucleo) -> int:
    return word(board, "palpate_last_tick_report", 17)


def test_hot_motors_are_hot_after_a_reset_and_taken_for_hot_after_a_loss_of_power(board):
    start(board)
    # Nobody knows what was before: as warm as the continuous current makes them, which 12 s of a winding have hardly changed.
    np.testing.assert_allclose(kept_heat(board), 1.0, rtol=1e-3)
    board.set_monitors([7.0, 0.0, 0.0])  # somebody else drives it, beyond what the account lets be
    while not faults(board):
        run_ticks(board, 1)
    assert faults(board) == MOTOR_HEAT
    hot = kept_heat(board)
    assert 0.25 * hot[0] + 0.75 * hot[3] > 1.1
    board.set_monitors([0.0, 0.0, 0.0])
    board.chip.core.crash()
    while not board.chip.resets:
        board.run_tick()
        assert board.run_to_tick(SECOND)
    before, last = kept_heat(board), kept_tick(board)
    start(board)
    # As it was, but for the cooling of five ticks; so the fault is there again.
    np.testing.assert_allclose(kept_heat(board), before, rtol=1e-3)
    assert faults(board) == MOTOR_HEAT
    record = reset_record(board)
    assert (record.tick, record.faults) == (last, MOTOR_HEAT) and "latched: motor heat" in record.before
    board.chip.power_cycle()
    start(board)
    np.testing.assert_allclose(kept_heat(board), 1.0, rtol=1e-3)
    assert faults(board) == 0


def test_the_watchdogs_reset_keeps_the_heat_too(board):
    board.leave_cold_motors()
    start(board)
    board.set_monitors([0.0, 7.0, 0.0])
    run_ticks(board, 50)
    board.set_monitors([0.0, 0.0, 0.0])
    board.chip.timer["TIM7"].write_CR1(0)
    board.run_to_tick(SECOND // 2)
    assert board.chip.resets == 1
    before = kept_heat(board)
    assert before[1] > 0.05 and before[0] < 1e-3
    start(board)
    np.testing.assert_allclose(kept_heat(board)[1], before[1], rtol=2e-3)
    assert "watchdog" in reset_record(board).cause


REGISTER_ACCESS, INTEGER32 = 384, 5
MOTOR_HEAT = 1 << 11
# A number of the version, then nine registers of three float32; the third is setpoint.gain.
TUNING_BYTES, SETPOINT_GAIN_AT = 4 + 9 * 12, 4 + 2 * 12


def access(board: Nucleo, transfer_id: int, name: bytes, value: bytes = b"\0") -> bytes | None:
    """Reads a register over the link, or writes it; its value then, with its type and number before it. None: the board has started again meanwhile."""
    resets, link = board.chip.resets, link_of(board.chip)
    link.take(1 << 20)  # of before, cut off where the board was reset
    reader = LinkReader(synchronized=False)
    link.receive(LinkCodec.request(REGISTER_ACCESS, transfer_id, bytes([len(name)]) + name + value))
    for _ in range(200):
        if not board.run_to_tick(SECOND) or board.chip.resets != resets:
            return None
        board.run_tick()
        for frame in reader.feed(link.take(LINK_BYTES_PER_TICK)):
            if frame.port == REGISTER_ACCESS and frame.is_response:
                return frame.payload[8:]
    raise TimeoutError("the request is not answered")


def store(board: Nucleo, transfer_id: int, gain: float) -> float | None:
    """Writes the register setpoint.gain over the link; what it is then. None: the board has started again meanwhile."""
    answer = access(board, transfer_id, b"setpoint.gain", struct.pack("<BB3f", 13, 3, gain, gain, gain))
    return None if answer is None else struct.unpack_from("<f", answer, 2)[0]


def reset_record(board: Nucleo) -> ResetRecord:
    answer = access(board, 0, RESET_RECORD.encode())
    assert answer is not None and answer[:2] == bytes([INTEGER32, 10])
    return ResetRecord.of("nucleo_g474re", struct.unpack_from("<10i", answer, 2))


@pytest.mark.parametrize("unreadable", [False, True])
def test_power_lost_at_any_step_of_storing_leaves_the_old_or_the_new(board, unreadable):
    """Each step in which the flash changes, in turn: what was being written is half done, or can't be read."""
    flash = board.chip.flash
    flash.erase_cycles = 20_000  # the firmware asks all the while, each time through Python
    flash.fails_unreadable = unreadable
    start(board)
    old, new, later = (float(np.float32(gain)) for gain in (1.05, 1.1, 1.15))
    transfers = itertools.count()
    assert store(board, next(transfers), old) == old
    before = flash.steps
    assert store(board, next(transfers), new) == new
    steps = flash.steps - before
    assert steps > 8  # a page and its double words
    assert store(board, next(transfers), old) == old
    for step in range(1, steps + 1):
        flash.power_fails_at = flash.steps + step
        assert store(board, next(transfers), later) is None
        flash.power_fails_at = None
        board.chip.power_cycle()
        start(board)
        assert stored_gain(board) == old, step
        # And it can be stored again, which is what the next step finds.
        old = float(np.float32(1.05 + 0.001 * step))
        assert store(board, next(transfers), old) == old


def stored_gain(board: Nucleo) -> float:
    """Of the first set-point, in the newest whole record: read as boards/stm32g4/parameter_store.hpp and firmware/core/tuning.hpp lay it down."""
    newest = None
    for slot in range(2):
        at = 0x7F000 + 2048 * slot
        data = bytes(board.chip.flash_memory[at : at + 2048])
        magic, length, sequence, inverse = struct.unpack_from("<4I", data)
        if magic != 0x31504C50 or length != TUNING_BYTES or sequence != inverse ^ 0xFFFFFFFF:
            continue
        crc, complement = struct.unpack_from("<2I", data, 16 + length)
        if crc == complement ^ 0xFFFFFFFF and (newest is None or sequence > newest[0]):
            newest = sequence, struct.unpack_from("<f", data, 16 + SETPOINT_GAIN_AT)[0]
    return float("nan") if newest is None else newest[1]


def test_parameters_are_used_at_once_and_after_the_next_start(board):
    """A gain that no amplifier has is refused; one that is kept survives a loss of power."""
    start(board)
    assert store(board, 0, 2.0) == 1.0 and store(board, 1, float("nan")) == 1.0
    assert store(board, 2, 1.125) == 1.125
    board.chip.power_cycle()
    start(board)
    assert store(board, 0, 2.0) == 1.125  # refused, and what was kept is there


CALIBRATE = 4


def test_the_zero_is_set_where_the_arm_rests(board):
    """By CALIBRATE over the link: the counts of now become those of the reference pose, where the tip is the origin."""
    start(board)
    # As fast as a hand: a jump would ask for the calibration, too.
    for share in range(0, 101, 2):
        board.set_encoders([9 * share, -7 * share, 4 * share])
        run_ticks(board, 1)

    def tip_m() -> np.ndarray:
        return np.frombuffer(board.chip.core.load(board.chip.image.symbols["palpate_last_tick_report"] + 8, 12), np.float32)

    assert np.linalg.norm(tip_m()) > 0.01 and faults(board) == 0
    link_of(board.chip).receive(LinkCodec.command(7, CALIBRATE))
    run_ticks(board, 200)
    assert np.linalg.norm(tip_m()) < 1e-6 and faults(board) == 0


# In place of many boards that start: one run of each, in which a model is taken over and pressed into (test_board_lockstep.py).
@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> dict:
    return {name: scripted_run(name, tmp_path_factory.mktemp(name) / "run") for name in ("mps2", "nucleo")}


def test_forces_are_those_of_the_board_in_qemu_to_the_bit(runs):
    """Each is given the same counts; over its slower line the model comes later, and is rolled forward to the same state."""
    frames = [run[-501:-1] for run in runs.values()]  # from where both are armed to the end
    together = (frames[0]["model_sequence"] == 9) & (frames[1]["model_sequence"] == 9)
    assert together.sum() > 400 and np.abs(frames[0]["force_N"][together]).max() > 0.5
    for name in ("tip_m", "force_N", "contact_mode", "triangle", "normal", "mode", "faults"):
        np.testing.assert_array_equal(frames[0][name][together], frames[1][name][together], err_msg=name)


def test_setpoints_are_those_of_the_board_in_qemu_but_for_the_converters_steps(runs):
    frames = [run[-501:-1] for run in runs.values()]
    together = (frames[0]["model_sequence"] == 9) & (frames[1]["model_sequence"] == 9)
    error_A = np.abs(frames[0]["setpoint_A"] - frames[1]["setpoint_A"])[together]
    assert error_A.max() <= 0.5 * SETPOINT_STEP_A * (1 + 1e-5)  # float32
    assert np.abs(frames[0]["setpoint_A"]).max() > 100 * SETPOINT_STEP_A


def test_a_scene_over_can_fd(tmp_path):
    """A press that sticks: 30 models a second through the model of the FDCAN, against the full body."""
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, "-m", "palpate", "run", "scenes/stick.toml", "--board", "nucleo_g474re", "--medium", "canfd",
         "--set", "model.builder=hybrid", "--set", "duration_s=0.8", "--json", "--out", str(out)],
        cwd=REPOSITORY, env={**os.environ, "PYTHONPATH": str(REPOSITORY / "host/python")}, capture_output=True, text=True,
        check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["missed_deadlines"] == 0 and summary["frames_lost"] == 0
    assert summary["models_refused"] == 0 and summary["model_updates"] >= 15
    assert summary["peak_force_N"] > 1.0
    assert summary["rms_force_error_percent"] < 1.0  # 0.5 of mps2_an386 (docs/links.md)
    # The servo tick's bound (docs/decisions/cycles.md).
    assert summary["worst_tick_instructions"] * 1.8 < 110_000


def test_a_scene_over_usb(tmp_path):
    """The part's own USB device and TinyUSB, enumerated by the host's controller: states at 30 Hz, and nothing is lost."""
    done = run(tmp_path / "usb", scene('[model]\nbuilder = "hybrid"\n[link]\nmedium = "usb"\ntrace = "tip"\n', board="nucleo_g474re", duration_s=0.5))
    assert done.summary["frames_lost"] == done.summary["models_refused"] == done.summary["missed_deadlines"] == done.summary["faults"] == 0
    assert done.summary["model_updates"] >= 5 and done.summary["peak_force_N"] > 0.5
