"""The USB full-speed device controller and its packet memory (RM0440, 45), on the bus of the lock-step exchange (boards/lockstep/usb_record.hpp).

Endpoint registers are toggled and cleared by what is written, and buffers are described by a table in packet memory. A transaction takes its time
on the bus; tokens that come meanwhile wait, as on a bus on which the host waits for the answer.
"""

from collections import deque
from collections.abc import Callable
from functools import partial

from palpate.machine.peripheral import Chip, MachineError, Peripheral

ENDPOINTS = 8
MEMORY_BYTES = 1024
# Of EPnR
_EA, _STAT_TX, _DTOG_TX, _CTR_TX = 0xF, 3 << 4, 1 << 6, 1 << 7
_KIND, _TYPE, _SETUP, _STAT_RX, _DTOG_RX, _CTR_RX = 1 << 8, 3 << 9, 1 << 11, 3 << 12, 1 << 14, 1 << 15
_TOGGLES = _STAT_TX | _DTOG_TX | _STAT_RX | _DTOG_RX
_DISABLED, _STALL, _NAK, _VALID = range(4)
_CONTROL = 1
# Of CNTR and ISTR
_FORCE_RESET, _POWER_DOWN, _RESUME = 1 << 0, 1 << 1, 1 << 4
_CTR, _WAKEUP, _SUSPEND, _RESET, _SOF = 1 << 15, 1 << 12, 1 << 11, 1 << 10, 1 << 9
_PULL_UP = 1 << 15
_ENABLED = 1 << 7
_CYCLES_PER_BIT, _OVERHEAD_BITS = 170 / 12, 150  # token, handshake, gaps, checks
# Records
RESET, FRAME, SUSPEND, RESUME, UNPLUG, SETUP, OUT_DATA0, OUT_DATA1, IN = 1, 2, 3, 4, 5, 0x10, 0x11, 0x12, 0x13
ATTACH, DETACH, WAKE, ACK, NAK, STALL, DATA0, DATA1, SILENCE, REFUSED = 0x81, 0x82, 0x83, 0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x9F
_FLAG = 0x40  # of an address: the far end begins again, or does not acknowledge
_HEADER_BYTES, _TOKENS = 3, (SETUP, OUT_DATA0, OUT_DATA1, IN)


class PacketMemory(Peripheral):
    """1 KiB that the processor reaches by half-words (a word would be two of them)."""

    def __init__(self, chip: Chip, name: str, base: int) -> None:
        self.data = bytearray(MEMORY_BYTES)
        super().__init__(chip, name, base)

    def read(self, offset: int, size: int) -> int:
        if size == 4:
            raise MachineError(f"load of a word from {self.name} + {offset:#x}: by half-words only")
        return int.from_bytes(self.data[offset : offset + size], "little")

    def write(self, offset: int, size: int, value: int) -> None:
        if size != 2 or offset % 2:
            raise MachineError(f"store of {size} bytes to {self.name} + {offset:#x}: by half-words only")
        self.data[offset : offset + 2] = value.to_bytes(2, "little")

    def half(self, offset: int) -> int:
        return int.from_bytes(self.data[offset : offset + 2], "little")

    def put_half(self, offset: int, value: int) -> None:
        self.data[offset : offset + 2] = value.to_bytes(2, "little")


class UsbDevice(Peripheral):
    """`answers` are the records for the far end. has_clock: are there 48 MHz?"""

    REGISTERS = {f"EP{n}R": (4 * n, 0) for n in range(ENDPOINTS)} | {
        "CNTR": (0x40, _FORCE_RESET | _POWER_DOWN),
        "ISTR": (0x44, 0),
        "FNR": (0x48, 0),
        "DADDR": (0x4C, 0),
        "BTABLE": (0x50, 0),
        "LPMCSR": (0x54, 0),
        "BCDR": (0x58, 0),
    }

    def __init__(self, chip: Chip, name: str, base: int, memory: PacketMemory, interrupt: int) -> None:
        self._memory, self._interrupt = memory, interrupt
        self.answers = bytearray()
        self.has_clock: Callable[[], bool] = lambda: True
        self.attached = False
        super().__init__(chip, name, base)
        for n in range(ENDPOINTS):
            self.writers[f"EP{n}R"] = lambda value, n=n: self._write_endpoint(n, value)

    def reset(self) -> None:
        super().reset()
        self._records: deque[tuple[int, int, bytes]] = deque()
        self._is_busy = False
        self._refusing: set[int] = set()
        if self.attached:
            self._answer(DETACH, 0)
        self.attached = False
        self._request()

    # The processor's side

    def _write_endpoint(self, n: int, value: int) -> None:
        old = self.value[f"EP{n}R"]
        kept = value & (_EA | _KIND | _TYPE)
        toggled = (old ^ value) & _TOGGLES
        cleared = old & value & (_CTR_RX | _CTR_TX)  # cleared by zeros
        self.value[f"EP{n}R"] = kept | toggled | cleared | old & _SETUP
        self._request()

    def write_ISTR(self, value: int) -> None:
        self.value["ISTR"] &= value | ~0x7F80
        self._request()

    def read_ISTR(self) -> int:
        word = self.value["ISTR"] & 0x7F80
        for n in range(ENDPOINTS):
            register = self.value[f"EP{n}R"]
            if register & (_CTR_RX | _CTR_TX):
                return word | _CTR | n | (1 << 4 if register & _CTR_RX else 0)
        return word

    def write_CNTR(self, value: int) -> None:
        old = self.value["CNTR"]
        self.value["CNTR"] = value
        if value & _FORCE_RESET and not old & _FORCE_RESET:
            self._bus_reset()
        if value & _RESUME and not old & _RESUME:
            self._answer(WAKE, 0)
        self._request()

    def write_BCDR(self, value: int) -> None:
        if value & _PULL_UP and not self.has_clock():
            raise MachineError("USB_BCDR: the bus is pulled up without a clock of 48 MHz")
        self.value["BCDR"] = value
        if bool(value & _PULL_UP) != self.attached:
            self.attached = bool(value & _PULL_UP)
            self._answer(ATTACH if self.attached else DETACH, 0)

    def _request(self) -> None:
        self.chip.set_line(self._interrupt, bool(self.read_ISTR() & self.value["CNTR"] & 0xFF80))

    def _flag(self, flag: int) -> None:
        self.value["ISTR"] |= flag
        self._request()

    # The bus

    def _answer(self, kind: int, address: int, data: bytes = b"") -> None:
        self.answers += bytes((kind, address, len(data))) + data

    def receive(self, records: bytes) -> None:
        """The records of one tick. A damaged one costs those behind it."""
        at = 0
        while at < len(records):
            head = records[at : at + _HEADER_BYTES]
            if len(head) < _HEADER_BYTES or at + _HEADER_BYTES + head[2] > len(records):
                self._answer(REFUSED, 0)
                break
            kind, address, length = head
            self._records.append((kind, address, records[at + _HEADER_BYTES : at + _HEADER_BYTES + length]))
            at += _HEADER_BYTES + length
        self._next()

    def _next(self) -> None:
        while self._records and not self._is_busy:
            kind, address, data = self._records.popleft()
            if kind in _TOKENS:
                self._is_busy = True
                bits = _OVERHEAD_BITS + 8 * (len(data) or 64) * 7 // 6
                self.chip.after(round(bits * _CYCLES_PER_BIT), partial(self._transaction, kind, address, data))
            else:
                self._signal(kind)

    def _signal(self, kind: int) -> None:
        if kind == FRAME:
            self.value["FNR"] = (self.value["FNR"] & 0x7FF) + 1 & 0x7FF
            self._flag(_SOF)
        elif kind == RESET:
            self._bus_reset()
        elif kind == SUSPEND or kind == UNPLUG:
            self._flag(_SUSPEND)
        elif kind == RESUME:
            self._flag(_WAKEUP)
        else:
            self._answer(REFUSED, 0)

    def _bus_reset(self) -> None:
        for n in range(ENDPOINTS):
            self.value[f"EP{n}R"] = 0
        self.value["DADDR"] = 0
        self._refusing.clear()
        self._flag(_RESET)

    def _transaction(self, kind: int, address: int, data: bytes) -> None:
        self._is_busy = False
        self._perform(kind, address, data)
        self._next()

    def _perform(self, kind: int, flagged: int, data: bytes) -> None:
        address = flagged & ~_FLAG
        n = self._endpoint_of(address & 15)
        powered = not self.value["CNTR"] & (_FORCE_RESET | _POWER_DOWN) and self.value["DADDR"] & _ENABLED
        if n is None or not powered or not self.attached:
            self._answer(SILENCE, address)
        elif kind == IN:
            self._give(n, address, is_heard=address == flagged)
        else:
            if address != flagged:
                self._refusing.discard(address)
            self._take(n, kind, address, data)

    def _endpoint_of(self, number: int) -> int | None:
        for n in range(ENDPOINTS):
            register = self.value[f"EP{n}R"]
            if register & _EA == number and register & (_STAT_RX | _STAT_TX):
                return n
        return None

    def _table(self, n: int) -> int:
        return (self.value["BTABLE"] & 0xFFF8) + 8 * n

    def _give(self, n: int, address: int, is_heard: bool) -> None:
        register = self.value[f"EP{n}R"]
        state = register >> 4 & 3
        if state == _VALID:
            at, count = self._memory.half(self._table(n)), self._memory.half(self._table(n) + 2) & 0x3FF
            self._answer(DATA1 if register & _DTOG_TX else DATA0, address, bytes(self._memory.data[at : at + count]))
            if not is_heard:  # it stays valid, for the next token
                return
            self.value[f"EP{n}R"] = (register & ~_STAT_TX | _NAK << 4 | _CTR_TX) ^ _DTOG_TX
            self._request()
        else:
            self._answer({_NAK: NAK, _STALL: STALL}.get(state, SILENCE), address)

    def _take(self, n: int, kind: int, address: int, data: bytes) -> None:
        register = self.value[f"EP{n}R"]
        state = register >> 12 & 3
        is_setup = kind == SETUP
        if is_setup and register >> 9 & 3 != _CONTROL or state == _DISABLED:
            self._answer(SILENCE, address)
            return
        if not is_setup:
            if state == _STALL:
                self._answer(STALL, address)
                return
            if state == _NAK or address in self._refusing or register & _CTR_RX:
                self._refusing.add(address)
                self._answer(NAK, address)
                return
            if (kind == OUT_DATA1) != bool(register & _DTOG_RX):
                self._answer(ACK, address)  # comes a second time: its acknowledgement was lost
                return
        at = self._memory.half(self._table(n) + 4)
        size = self._memory.half(self._table(n) + 6)
        blocks = size >> 10 & 31
        room = 32 * (blocks + 1) if size >> 15 else 2 * blocks
        if len(data) > room:
            if is_setup:
                self._answer(SILENCE, address)  # the controller has no buffer for it
                return
            self._answer(STALL, address)
            return
        padded = data + bytes(len(data) % 2)
        if at + len(padded) > MEMORY_BYTES:
            raise MachineError(f"USB: the buffer of endpoint {n} at {at:#x} ends behind the packet memory")
        self._memory.data[at : at + len(padded)] = padded
        self._memory.put_half(self._table(n) + 6, size & ~0x3FF | len(data))
        if is_setup:
            register = register & ~(_STAT_TX | _STAT_RX) | _NAK << 4 | _NAK << 12 | _SETUP | _CTR_RX | _DTOG_TX | _DTOG_RX
        else:
            register = (register & ~(_STAT_RX | _SETUP) | _NAK << 12 | _CTR_RX) ^ _DTOG_RX
        self.value[f"EP{n}R"] = register
        self._answer(ACK, address)
        self._request()
