"""The image for a NUCLEO-G474RE in lock-step with a plant: what QEMU does with the images for its boards.

    python -m palpate.machine.lockstep IMAGE act.fifo sen.fifo
    python -m palpate.machine.lockstep IMAGE            # says what the image is

Frames and exit codes are those of boards/lockstep/exchange.hpp. A tick of the exchange is one of the servo's timer; without one, while the
part is in reset or starts, a millisecond. What no link carries is read from the firmware's memory, as a debugger would. Motors are cold at the beginning,
as on the other emulated boards.
"""

import struct
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from palpate.machine.links import link_of
from palpate.machine.nucleo_g474re import TICK_CYCLES, Nucleo
from palpate.machine.part import Image
from palpate.machine.peripheral import MachineError
from palpate.machine.stm32g474 import CLOCK_Hz

_LINK_BYTES = 2048
_SENSORS = struct.Struct(f"<II3i3fII{_LINK_BYTES}s")
# Magic, tick, next tick; set-points, on; then a TickReport without its first two words; length and link.
_ACTUATORS = struct.Struct(f"<III3fI96sI{_LINK_BYTES}s")
_REPORT, _REPORT_HEAD_BYTES, _REPORT_BYTES = "palpate_last_tick_report", 8, 104
_IDENTITY, _IDENTITY_LAYOUT = "palpate_image_identity", struct.Struct("<Q32s32s")
_SENSOR_MAGIC, _ACTUATOR_MAGIC = 0x314E5350, 0x31434150
_EMERGENCY_STOP, _SHUTDOWN, _BURN, _CRASH, _RESET, _SUPPLY_LOW = 1, 2, 4, 8, 16, 32
_EXIT_USAGE, _EXIT_NO_CHANNEL, _EXIT_CLOSED, _EXIT_PROTOCOL, _EXIT_MACHINE = 1, 2, 3, 4, 5
# From power on to the first tick: oscillators, converters, and what is checked.
_LONGEST_START_CYCLES = CLOCK_Hz
_BURN_CYCLES = TICK_CYCLES * 5 // 2


class Exchange:
    """A board beside a plant."""

    def __init__(self, image: Image, actuators: BinaryIO, sensors: BinaryIO) -> None:
        if _REPORT not in image.symbols:
            raise MachineError(f"the image has no {_REPORT}: it is not the firmware for this board")
        self._report_address = image.symbols[_REPORT]
        self._actuators, self._sensors = actuators, sensors
        self._board = Nucleo(image)
        self._board.leave_cold_motors()

    def run(self) -> int:
        """Until the plant ends it; returns the exit code."""
        board = self._board
        if not board.run_to_tick(_LONGEST_START_CYCLES):
            raise MachineError(f"no tick of the servo within {_LONGEST_START_CYCLES / CLOCK_Hz:g} s; resets so far: {board.chip.resets}")
        self._link = link_of(board.chip)
        tick, ticks = 0, True
        while True:
            data = self._sensors.read(_SENSORS.size)
            if len(data) < _SENSORS.size:
                return _EXIT_CLOSED
            magic, number, *values, flags, length, link = _SENSORS.unpack(data)
            if magic != _SENSOR_MAGIC or number != tick or length > _LINK_BYTES:
                return _EXIT_PROTOCOL
            if flags & _RESET:
                board.chip.power_cycle()
                tick, ticks = 0, board.run_to_tick(_LONGEST_START_CYCLES)
                continue
            board.set_encoders(values[:3])
            board.set_monitors(values[3:])
            board.set_emergency_stop(bool(flags & _EMERGENCY_STOP))
            board.set_supply_low(bool(flags & _SUPPLY_LOW))
            self._link.receive(link[:length])
            if flags & _BURN:
                board.chip.core.stall(_BURN_CYCLES)
            if flags & _CRASH:
                board.chip.core.crash()
            if ticks:
                board.run_tick()
            tick += 1
            if not self._answer(tick, bool(flags & _SHUTDOWN)):
                return _EXIT_CLOSED
            if flags & _SHUTDOWN:
                return 0
            ticks = board.run_to_tick(TICK_CYCLES)

    def _answer(self, next_tick: int, is_last: bool) -> bool:
        board = self._board
        enabled = board.amplifiers_on and not is_last
        setpoint_A = board.setpoint_A if enabled else (0.0, 0.0, 0.0)
        report = board.chip.core.load(self._report_address, _REPORT_BYTES)[_REPORT_HEAD_BYTES:]
        link = self._link.take(_LINK_BYTES)
        frame = _ACTUATORS.pack(
            _ACTUATOR_MAGIC, next_tick - 1, next_tick, *setpoint_A, enabled, report, len(link), link.ljust(_LINK_BYTES, b"\0")
        )
        try:
            self._actuators.write(frame)
            self._actuators.flush()
        except BrokenPipeError:
            return False
        return True


def identity(image: Image) -> str:
    """Board, version and hash of the message definitions, in the words of the other boards."""
    address = image.symbols.get(_IDENTITY)
    if address is None:
        raise MachineError(f"the image has no {_IDENTITY}: it is not the firmware for this board")
    schema, board, firmware = _IDENTITY_LAYOUT.unpack(image.read_flash(address, _IDENTITY_LAYOUT.size))
    texts = (text.rstrip(b"\0").decode("ascii", "replace") for text in (board, firmware))
    return f"palpate {' '.join(texts)} schema {schema:016x}"


def main(arguments: Sequence[str]) -> int:
    if len(arguments) not in (1, 3):
        print(__doc__, file=sys.stderr)
        return _EXIT_USAGE
    try:
        image = Image.read(Path(arguments[0]))
        if len(arguments) == 1:
            print(identity(image))
            return 0
        with open(arguments[1], "wb") as actuators, open(arguments[2], "rb") as sensors:
            return Exchange(image, actuators, sensors).run()
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
        return _EXIT_NO_CHANNEL
    except MachineError as error:
        print(error, file=sys.stderr)
        return _EXIT_MACHINE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
