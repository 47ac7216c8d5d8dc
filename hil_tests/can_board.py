"""A board in lock-step with a plant, on the bus of a CAN adapter that a guest (linux_guest.py) has in its USB port: records of
CAN frames (docs/protocol.md) on the board's side, candleLight's frames on the other.

The board's ticks come as the guest takes them: never faster than one in `tick_s`, later where it is busy; such a run does not repeat.
"""

import struct
import time
from dataclasses import dataclass

import numpy as np
from board_peer import Lockstep
from gs_usb_adapter import GsUsbAdapter
from kernel_session import TICK_s, pressing_plant
from link_codec import LinkCodec

LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_EXTENDED = 1 << 31
_RECORD_FD = 1 << 30
_FLAG_FD, _FLAG_BIT_RATE_SWITCH = 1 << 1, 1 << 2
_NO_ECHO = 0xFFFFFFFF
_FRAME = struct.Struct("<IIBBBB")
_MODE, _MODE_FD = 2, 1 << 8


@dataclass(frozen=True)
class CanFrame:
    identifier: int
    code: int  # of the length
    is_fd: bool
    data: bytes

    def record(self) -> bytes:
        word = self.identifier | _EXTENDED | (_RECORD_FD if self.is_fd else 0)
        content = struct.pack("<IB", word, self.code | (15 - self.code) << 4) + self.data
        return content + struct.pack(">H", LinkCodec.crc16(content))


class RecordReader:
    """Bytes from the board in, frames out; every record must be good."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> list[CanFrame]:
        self._buffer += data
        frames = []
        while len(self._buffer) >= 5:
            word, code = struct.unpack_from("<IB", self._buffer)
            end = 5 + LENGTHS[code & 15]
            if len(self._buffer) < end + 2:
                break
            content, check = self._buffer[:end], self._buffer[end:end + 2]
            assert word & _EXTENDED and code >> 4 == 15 - (code & 15) and LinkCodec.crc16(content) == int.from_bytes(check, "big")
            frames.append(CanFrame(word & 0x1FFFFFFF, code & 15, bool(word & _RECORD_FD), content[5:]))
            self._buffer = self._buffer[end + 2:]
        return frames


class CanBoard(GsUsbAdapter):
    """Takes the place of the adapter's own answering node: a board that speaks classic CAN, and one that speaks CAN FD. As the interface
    is brought up, the one or the other is on the bus. `tip_m` has by tick what the board on each knew of its tip."""

    def __init__(self, classic: Lockstep, fd: Lockstep, tick_s: float = TICK_s) -> None:
        super().__init__()
        self._tick_s = tick_s
        self._boards = {False: (classic, pressing_plant()), True: (fd, pressing_plant())}
        for board, _ in self._boards.values():
            board.reader = RecordReader()
        self._board, self._plant = self._boards[False]
        self._to_board = b""
        self._is_up = self._is_fd = False
        self.largest_force_N = {"can_classic": 0.0, "can_fd": 0.0}
        self.tip_m: dict[str, dict[int, list[float]]] = {"can_classic": {}, "can_fd": {}}

    def serve(self, channel: object) -> bool:
        self._channel = channel
        self._requests.clear()
        self._messages.clear()
        channel.send_hello()
        due_s = time.monotonic()
        while True:
            if not channel.handle_until(due_s, self._take_packet):
                return False
            due_s = max(due_s + self._tick_s, time.monotonic())
            # What the guest has not fetched holds the board up, not the bus.
            if self._is_up and len(self._messages) < 64:
                self._tick()
                self._answer_requests()

    def _take_packet(self, kind: int, identifier: int, body: bytes) -> None:
        self._handle(kind, identifier, body)
        self._answer_requests()

    def _tick(self) -> None:
        link, self._to_board = self._to_board[:2048], self._to_board[2048:]
        counts, currents = self._plant.encoder_counts, self._plant.measured_current_A
        actuators = self._board.tick(encoder=tuple(map(int, counts)), current_A=tuple(map(float, currents)), link=link)
        name = "can_fd" if self._is_fd else "can_classic"
        self.largest_force_N[name] = max(self.largest_force_N[name], float(np.linalg.norm(actuators["force_N"])))
        self.tip_m[name][int(actuators["tick"])] = actuators["tip_m"].tolist()
        self._plant.advance(np.asarray(actuators["setpoint_A"], dtype=np.float64), bool(actuators["enabled"]))
        for frame in self._board.frames:
            flags = _FLAG_FD | _FLAG_BIT_RATE_SWITCH if frame.is_fd else 0
            head = _FRAME.pack(_NO_ECHO, frame.identifier | _EXTENDED, frame.code, 0, flags, 0)
            self.send(head + frame.data.ljust(64 if frame.is_fd else 8, b"\0"))
        self._board.frames.clear()

    def on_vendor_out(self, request: int, value: int, data: bytes) -> bool:
        if request == _MODE:
            mode, flags = struct.unpack_from("<II", data)
            self._is_up, self._is_fd = mode == 1, bool(flags & _MODE_FD)
            self._board, self._plant = self._boards[self._is_fd]
            self._to_board = b""
        return super().on_vendor_out(request, value, data)

    def on_bulk_out(self, data: bytes) -> None:
        if not data:
            return
        _, identifier, code, _, flags, _ = _FRAME.unpack_from(data)
        self.send(data)  # to the driver: sent
        payload = data[_FRAME.size:_FRAME.size + LENGTHS[code]]
        if identifier & _EXTENDED:
            self._to_board += CanFrame(identifier & ~_EXTENDED, code, bool(flags & _FLAG_FD), payload).record()
