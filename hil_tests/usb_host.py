"""A USB host controller in Python for boards in lock-step whose link is a USB bus (boards/lockstep/usb_record.hpp).

Time is the board's: one tick is one frame of the bus (1 ms). Transfers are submitted and come back done in a later tick; with
the same transfers in the same ticks a run repeats to the byte.
"""

import contextlib
import pathlib
import struct
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from board_peer import Lockstep, lockstep

import palpate

# boards/lockstep/usb_record.hpp
RESET, FRAME, SUSPEND, RESUME, UNPLUG = 1, 2, 3, 4, 5
SETUP, OUT_DATA0, OUT_DATA1, IN = 0x10, 0x11, 0x12, 0x13
AGAIN = 0x40  # of the address of a packet to the board: from here on those that it has refused
ATTACH, DETACH, WAKE = 0x81, 0x82, 0x83
ACK, NAK, STALL, DATA0, DATA1, SILENCE, REFUSED = 0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x9F
PACKET_BYTES = 64
DIRECTION_IN = 0x80
VENDOR_OUT, VENDOR_IN, SERIAL_OUT, SERIAL_IN = 0x01, 0x81, 0x02, 0x82

# What a full-speed bus carries in a frame (USB 2.0, table 5-9), and with an eye on it, of one endpoint at a time.
_TOKENS_PER_TICK = 19
_PACKETS_AT_ONCE = 16
_EAGER, _LAZY = 8, 2  # IN tokens in a tick after data, and after none
# A device that does not answer at all is asked as often as this.
_TRIES = 3
# A transfer that takes longer than this many ticks has hung: what waits for a reader is the caller's to bound.
_WATCHDOG_TICKS = 2000


class Status(Enum):
    DONE = "done"
    STALLED = "stalled"
    SILENT = "not answered"
    CANCELLED = "cancelled"


class UsbError(RuntimeError):
    """A transfer that did not end well."""

    def __init__(self, status: Status):
        super().__init__(f"USB transfer {status.value}")
        self.status = status


@dataclass(frozen=True)
class Record:
    kind: int
    endpoint: int
    data: bytes

    @staticmethod
    def encode(kind: int, endpoint: int = 0, data: bytes = b"") -> bytes:
        return bytes((kind, endpoint, len(data))) + data


class RecordReader:
    """In place of board_peer.LinkReader: records in place of Cyphal's frames."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> list[Record]:
        self._buffer += data
        records, at = [], 0
        while len(self._buffer) - at >= 3 and len(self._buffer) - at >= 3 + self._buffer[at + 2]:
            kind, endpoint, length = self._buffer[at:at + 3]
            records.append(Record(kind, endpoint, self._buffer[at + 3:at + 3 + length]))
            at += 3 + length
        self._buffer = self._buffer[at:]
        return records


@dataclass
class Transfer:
    """endpoint: address; 0 is a control transfer with `setup`. data: to the board. length: at most from it. zero_packet: a
    packet without bytes behind a full last one. interval_ticks: between two tries of an interrupt endpoint."""

    endpoint: int
    data: bytes = b""
    length: int = 0
    setup: bytes = b""
    zero_packet: bool = False
    interval_ticks: int = 0
    on_done: Callable[["Transfer"], None] = lambda transfer: None
    status: Status | None = None
    received: bytes = b""
    sent: int = 0

    def finish(self, status: Status) -> None:
        self.status = status
        self.on_done(self)


class _BulkOut:
    def __init__(self, address: int):
        self.address = address
        self.queue: deque[Transfer] = deque()
        self.toggle = 0
        self._waiting = 0  # tokens that are not answered yet
        self._packets: deque[bytes] = deque()
        self._silent = 0

    def tokens(self, room: int) -> list[bytes]:
        if self._waiting:
            return []
        if not self._packets and self.queue:
            head = self.queue[0]
            self._packets += [head.data[at:at + PACKET_BYTES] for at in range(0, len(head.data), PACKET_BYTES)]
            if not head.data or (head.zero_packet and len(head.data) % PACKET_BYTES == 0):
                self._packets.append(b"")
        packets = list(self._packets)[:min(room, _PACKETS_AT_ONCE)]
        self._waiting = len(packets)
        return [Record.encode(OUT_DATA0 + (self.toggle ^ (i & 1)), self.address | (AGAIN if i == 0 else 0), packet)
                for i, packet in enumerate(packets)]

    def answer(self, record: Record) -> None:
        self._waiting -= 1
        if not self._packets:  # of a transfer that is over
            return
        head = self.queue[0]
        if record.kind == ACK:
            self._silent = 0
            self.toggle ^= 1
            head.sent += len(self._packets.popleft())
            if not self._packets:
                self.queue.popleft().finish(Status.DONE)
        elif record.kind != NAK:
            self._silent += record.kind == SILENCE
            if record.kind == STALL or self._silent >= _TRIES:
                self.end(head, Status.STALLED if record.kind == STALL else Status.SILENT)

    def end(self, transfer: Transfer, status: Status) -> None:
        if transfer is self.queue[0]:
            self._packets.clear()
        self._silent = 0
        self.queue.remove(transfer)
        transfer.finish(status)


class _BulkIn:
    """Also of an interrupt endpoint. What the board has said to a transfer that is over belongs to the next."""

    def __init__(self, address: int):
        self.address = address
        self.queue: deque[Transfer] = deque()
        self.toggle = 0
        self._waiting = 0
        self._early: deque[bytes] = deque()
        self._eager = _LAZY
        self._silent = 0
        self._rested = 0

    def tokens(self, room: int) -> list[bytes]:
        while self.queue and self._early:
            self._take(self._early.popleft())
        count = min(room, self._eager, 2 * _EAGER - self._waiting) if self.queue else 0
        if self.queue and self.queue[0].interval_ticks:
            self._rested += 1
            count = 1 if self._rested % self.queue[0].interval_ticks == 0 else 0
        self._waiting += count
        return [Record.encode(IN, self.address)] * count

    def answer(self, record: Record) -> None:
        self._waiting -= 1
        if record.kind in (DATA0, DATA1):
            assert record.kind == DATA0 + self.toggle, f"endpoint {self.address:#x}: data toggle"
            self.toggle ^= 1
            self._silent, self._eager = 0, _EAGER
            if self.queue and not self._early:
                self._take(record.data)
            else:
                self._early.append(record.data)
            return
        self._eager = _LAZY
        self._silent = self._silent + 1 if record.kind == SILENCE else 0
        if self.queue and (record.kind == STALL or self._silent >= _TRIES):
            self.end(self.queue[0], Status.STALLED if record.kind == STALL else Status.SILENT)

    def _take(self, data: bytes) -> None:
        head = self.queue[0]
        head.received += data
        assert len(head.received) <= head.length, f"endpoint {self.address:#x}: more than was asked for"
        if len(data) < PACKET_BYTES or len(head.received) == head.length:
            self.queue.popleft().finish(Status.DONE)

    def end(self, transfer: Transfer, status: Status) -> None:
        self._silent = 0
        self.queue.remove(transfer)
        transfer.finish(status)


class _Control:
    """Endpoint 0: one token at a time."""

    address = 0

    def __init__(self) -> None:
        self.queue: deque[Transfer] = deque()
        self._stage = "setup"
        self._waiting = False
        self._over = False  # the transfer that waits for an answer has ended
        self._silent = 0

    def tokens(self, room: int) -> list[bytes]:
        if self._waiting or not self.queue or not room:
            return []
        head = self.queue[0]
        self._waiting = True
        if self._stage == "setup":
            return [Record.encode(SETUP, 0, head.setup)]
        if self._stage in ("data in", "status in"):
            return [Record.encode(IN, DIRECTION_IN)]
        if self._stage == "data out":
            kind = OUT_DATA1 if head.sent // PACKET_BYTES % 2 == 0 else OUT_DATA0
            return [Record.encode(kind, AGAIN, head.data[head.sent:head.sent + PACKET_BYTES])]
        return [Record.encode(OUT_DATA1, AGAIN)]

    def answer(self, record: Record) -> None:
        self._waiting = False
        if self._over or not self.queue:
            self._over = False
            return
        head = self.queue[0]
        if record.kind == NAK:
            return
        if record.kind in (STALL, SILENCE):
            self._silent += record.kind == SILENCE
            if record.kind == STALL or self._silent >= _TRIES:
                self.end(head, Status.STALLED if record.kind == STALL else Status.SILENT)
            return
        self._silent = 0
        to_host, length = bool(head.setup[0] & DIRECTION_IN), int.from_bytes(head.setup[6:8], "little")
        if self._stage == "setup":
            self._stage = "status in" if length == 0 else "data in" if to_host else "data out"
        elif self._stage == "data in":
            head.received += record.data
            if len(record.data) < PACKET_BYTES or len(head.received) >= length:
                self._stage = "status out"
        elif self._stage == "data out":
            head.sent += min(PACKET_BYTES, len(head.data) - head.sent)
            if head.sent == len(head.data):
                self._stage = "status in"
        else:
            self.end(head, Status.DONE)

    def end(self, transfer: Transfer, status: Status) -> None:
        if transfer is self.queue[0]:
            self._stage, self._silent, self._over = "setup", 0, self._waiting
        self.queue.remove(transfer)
        transfer.finish(status)


_Pipe = _BulkOut | _BulkIn | _Control


@dataclass
class UsbHost:
    """The board behind a bus. `inputs(tick)` are the arguments of Lockstep.send(): what the device's sensors say."""

    board: Lockstep
    inputs: Callable[[int], dict] = lambda tick: {}
    attached: bool = False
    _pipes: dict[int, _Pipe] = field(default_factory=dict)
    _unanswered: deque[_Pipe] = field(default_factory=deque)
    _signals: list[bytes] = field(default_factory=list)
    _first: int = 0

    def __post_init__(self) -> None:
        self.board.reader = RecordReader()
        self._begin_anew()

    def _begin_anew(self) -> None:
        for pipe in list(self._pipes.values()):
            for transfer in list(pipe.queue):
                pipe.end(transfer, Status.CANCELLED)
        self._pipes = {0: _Control()}
        # What is still unanswered belongs to pipes that are gone.

    # Bus

    def reset(self) -> None:
        """Also plugs in. The board has no address and no configuration."""
        self._signals.append(Record.encode(RESET))
        self._begin_anew()

    def unplug(self) -> None:
        self._signals.append(Record.encode(UNPLUG))
        self._begin_anew()

    def signal(self, kind: int) -> None:
        """SUSPEND or RESUME."""
        self._signals.append(Record.encode(kind))

    def submit(self, transfer: Transfer) -> Transfer:
        address = transfer.endpoint
        if address not in self._pipes:
            self._pipes[address] = _BulkIn(address) if address & DIRECTION_IN else _BulkOut(address)
        self._pipes[address].queue.append(transfer)
        return transfer

    def cancel(self, transfer: Transfer) -> None:
        self._pipes[transfer.endpoint].end(transfer, Status.CANCELLED)

    def restart_toggle(self, address: int) -> None:
        """After CLEAR_FEATURE(ENDPOINT_HALT)."""
        pipe = self._pipes.get(address)
        if isinstance(pipe, _BulkOut | _BulkIn):
            pipe.toggle = 0

    def tick(self) -> np.void:
        """One tick of the board; transfers that end in it have ended."""
        records = self._signals + [Record.encode(FRAME)]
        self._signals = []
        room = _TOKENS_PER_TICK
        pipes = list(self._pipes.values())
        self._first += 1
        for i in range(len(pipes)):  # in turn, so that none starves the others
            pipe = pipes[(self._first + i) % len(pipes)]
            tokens = pipe.tokens(room)
            room -= len(tokens)
            records += tokens
            self._unanswered += [pipe] * len(tokens)
        frame = self.board.tick(link=b"".join(records), **self.inputs(self.board.next_tick))
        for record in self.board.frames:
            if record.kind in (ATTACH, DETACH):
                self.attached = record.kind == ATTACH
            else:
                assert record.kind not in (WAKE, REFUSED), f"record {record.kind:#x}"
                self._unanswered.popleft().answer(record)
        self.board.frames.clear()
        return frame

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick()

    # Whole transfers

    def wait(self, transfer: Transfer, ticks: int = _WATCHDOG_TICKS) -> Transfer:
        for _ in range(ticks):
            if transfer.status is not None:
                break
            self.tick()
        if transfer.status is None:
            self.cancel(transfer)
        if transfer.status is not Status.DONE:
            raise UsbError(transfer.status)
        return transfer

    def control(self, kind: int, request: int, value: int = 0, index: int = 0, length: int = 0, data: bytes = b"") -> bytes:
        setup = struct.pack("<BBHHH", kind, request, value, index, length or len(data))
        return self.wait(self.submit(Transfer(0, setup=setup, data=data))).received

    def send(self, endpoint: int, data: bytes, zero_packet: bool = True) -> None:
        self.wait(self.submit(Transfer(endpoint, data=data, zero_packet=zero_packet)))

    def receive(self, endpoint: int, length: int = 16384, ticks: int = _WATCHDOG_TICKS) -> bytes:
        return self.wait(self.submit(Transfer(endpoint, length=length)), ticks).received

    def descriptor(self, kind: int, index: int = 0, length: int = 255) -> bytes:
        return self.control(0x80, 6, kind << 8 | index, 0x0409 if kind == 3 and index else 0, length)

    def configure(self) -> None:
        """Reset, address and configuration, as a host does it with a device that has come."""
        self.reset()
        self.control(0x00, 5, 1)
        self.control(0x00, 9, 1)

    def set_line_state(self, is_open: bool) -> None:
        """DTR and RTS of the serial line."""
        self.control(0x21, 0x22, 3 if is_open else 0, 1)


@contextlib.contextmanager
def usb_board(board: str, folder: pathlib.Path, plant: palpate.Plant | None = None) -> Iterator[UsbHost]:
    """Runs a board with USB ("native_usb", "mps2_usb", "nucleo_usb") up to where it has pulled the bus up. With a `plant` it reads that
    one's sensors from the first tick on."""
    with lockstep(board, folder) as one:
        host = UsbHost(one) if plant is None else UsbHost(one, lambda tick: {
            "encoder": tuple(map(int, plant.encoder_counts)), "current_A": tuple(map(float, plant.measured_current_A))})
        for _ in range(10):
            if host.attached:
                break
            host.tick()
        assert host.attached
        yield host
