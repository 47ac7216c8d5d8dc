"""FDCAN2 and its message memory (RM0440, 44): two receive FIFOs of three frames, a transmit FIFO of three, classic CAN and CAN FD."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_INIT, _CCE, _FDOE, _BRSE = 1 << 0, 1 << 1, 1 << 8, 1 << 9
_RF0N, _RF0L, _RF1N, _RF1L, _TC = 1 << 0, 1 << 2, 1 << 3, 1 << 5, 1 << 7
_EINT0 = 1 << 0
_FIFO_FRAMES, _ELEMENT_BYTES = 3, 72
_EXTENDED_FILTERS, _RX_FIFO, _TX_FIFO = 0x70, (0xB0, 0x188), 0x278
_XTD, _FDF, _BRS = 1 << 30, 1 << 21, 1 << 20
# Bytes of data by their length code.
LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
# Registers whose writing wants INIT and CCE.
_PROTECTED = ("DBTP", "NBTP", "RXGFC", "TXBC", "TDCR", "CKDIV", "XIDAM")


@dataclass(frozen=True)
class CanFrame:
    """identifier: 29 bits. data: a length that CAN has."""

    identifier: int
    data: bytes
    is_fd: bool


def frame_bits(frame: CanFrame) -> tuple[int, int]:
    """Bits of a frame with a 29-bit identifier at the nominal rate and, in FD format with a switch of rate, at that of the data; without stuff
    bits, which depend on the contents, but for the fixed ones of FD."""
    if not frame.is_fd:
        return 67 + 8 * len(frame.data), 0
    crc = 17 if len(frame.data) <= 16 else 21
    return 36 + 12, 5 + 8 * len(frame.data) + 4 + crc + (crc + 4) // 4 + 1


class MessageMemory(Peripheral):
    """Words of the controllers' memory; that of FDCAN2 is the second third."""

    REGISTERS = {f"W{i}": (4 * i, 0) for i in range(3 * 0x350 // 4)}
    BYTES = 0xA00

    def word(self, offset: int) -> int:
        return self.value[f"W{offset // 4}"]

    def put(self, offset: int, word: int) -> None:
        self.value[f"W{offset // 4}"] = word


class Fdcan(Peripheral):
    """One controller. kernel_Hz and clock_Hz: of the clock it divides, and of the processor in whose cycles time is
    counted. on_frame is called with each frame that it has put on the bus."""

    REGISTERS = {
        "CREL": (0x00, 0x32141218),
        "ENDN": (0x04, 0x87654321),
        "DBTP": (0x0C, 0xA33),
        "CCCR": (0x18, 1),
        "NBTP": (0x1C, 0x06000A03),
        "ECR": (0x40, 0),
        "PSR": (0x44, 0x707),
        "TDCR": (0x48, 0),
        "IR": (0x50, 0),
        "IE": (0x54, 0),
        "ILS": (0x58, 0),
        "ILE": (0x5C, 0),
        "RXGFC": (0x80, 0),
        "XIDAM": (0x84, 0x1FFFFFFF),
        "RXF0S": (0x90, 0),
        "RXF0A": (0x94, 0),
        "RXF1S": (0x98, 0),
        "RXF1A": (0x9C, 0),
        "TXBC": (0xC0, 0),
        "TXFQS": (0xC4, 3),
        "TXBRP": (0xC8, 0),
        "TXBAR": (0xCC, 0),
        "TXBTO": (0xD4, 0),
        "TXBTIE": (0xDC, 0),
        "TXBCIE": (0xE0, 0),
        "CKDIV": (0x100, 0),
    }

    def __init__(
        self, chip: Chip, name: str, base: int, memory: MessageMemory, offset: int, interrupt: int, kernel_Hz: Callable[[], int], clock_Hz: int
    ) -> None:
        self._memory, self._offset, self._interrupt = memory, offset, interrupt
        self._kernel_Hz, self._clock_Hz = kernel_Hz, clock_Hz
        self.on_frame: Callable[[CanFrame], None] = lambda frame: None
        self.frames_lost = 0  # that found a FIFO full
        super().__init__(chip, name, base)
        for register in _PROTECTED:
            self.writers[register] = lambda value, register=register: self._write_protected(register, value)

    def reset(self) -> None:
        super().reset()
        self._filled = [0, 0]  # frames in the receive FIFOs
        self._get, self._put = [0, 0], [0, 0]
        self._to_send: deque[int] = deque()
        self._free = _FIFO_FRAMES
        self._next = 0  # transmit buffer that is filled next
        self._incoming: deque[CanFrame] = deque()
        self._is_busy = False  # the bus, with a frame to or from here
        self._request()

    def _write_protected(self, register: str, value: int) -> None:
        if self.value["CCCR"] & (_INIT | _CCE) != (_INIT | _CCE):
            raise MachineError(f"FDCAN_{register} is written without INIT and CCE")
        self.value[register] = value

    def write_CCCR(self, value: int) -> None:
        old = self.value["CCCR"]
        if not value & _INIT:
            value &= ~_CCE
        if (value ^ old) & (_FDOE | _BRSE) and not old & _CCE:
            raise MachineError("FDCAN_CCCR: the format is changed without CCE")
        self.value["CCCR"] = value
        if not value & _INIT:
            self.value["PSR"] &= ~(1 << 7)
            self._serve()

    @property
    def is_on(self) -> bool:
        return not self.value["CCCR"] & _INIT

    @property
    def bit_rate_Hz(self) -> tuple[float, float]:
        """Nominal, and of the data."""
        n, d = self.value["NBTP"], self.value["DBTP"]
        kernel_Hz = self._kernel_Hz()
        nominal = ((n >> 16 & 0x1FF) + 1) * (1 + (n >> 8 & 0xFF) + 1 + (n & 0x7F) + 1)
        data = ((d >> 16 & 0x1F) + 1) * (1 + (d >> 8 & 0x1F) + 1 + (d >> 4 & 15) + 1)
        return kernel_Hz / nominal, kernel_Hz / data

    def frame_cycles(self, frame: CanFrame) -> int:
        nominal_Hz, data_Hz = self.bit_rate_Hz
        nominal, data = frame_bits(frame)
        return round(self._clock_Hz * (nominal / nominal_Hz + data / data_Hz))

    # From the bus

    def receive(self, frames: list[CanFrame]) -> None:
        """Frames of other nodes, one behind the other; in a mode that cannot take them they are errors on the bus, and lost."""
        self._incoming.extend(frames)
        self._serve()

    def _serve(self) -> None:
        if self._is_busy or not self.is_on:
            return
        if self._incoming:
            frame, then = self._incoming.popleft(), self._store
        elif self._to_send:
            frame, then = self._read(self._to_send[0]), self._sent
        else:
            return
        self._is_busy = True
        self.chip.after(self.frame_cycles(frame), lambda: self._over(frame, then))

    def _over(self, frame: CanFrame, then: Callable[[CanFrame], None]) -> None:
        self._is_busy = False
        if self.is_on:
            then(frame)
        self._serve()

    def _fifo_of(self, identifier: int) -> int | None:
        """The FIFO that a frame with a 29-bit identifier goes to; None: it is refused."""
        settings = self.value["RXGFC"]
        for i in range(settings >> 24 & 15):
            first = self._memory.word(self._offset + _EXTENDED_FILTERS + 8 * i)
            second = self._memory.word(self._offset + _EXTENDED_FILTERS + 8 * i + 4)
            low, high, kind = first & 0x1FFFFFFF, second & 0x1FFFFFFF, second >> 30
            if kind == 1:
                hit = identifier in (low, high)
            elif kind == 2:
                hit = (identifier ^ low) & high == 0
            else:
                hit = low <= identifier <= high
            if hit:
                return {1: 0, 2: 1}.get(first >> 29)
        return {0: 0, 1: 1}.get(settings >> 2 & 3)

    def _store(self, frame: CanFrame) -> None:
        if frame.is_fd and not self.value["CCCR"] & _FDOE:
            self.frames_lost += 1
            return
        fifo = self._fifo_of(frame.identifier)
        if fifo is None:
            return
        if self._filled[fifo] == _FIFO_FRAMES:
            self.frames_lost += 1
            self._raise((_RF0L, _RF1L)[fifo])
            return
        at = self._offset + _RX_FIFO[fifo] + _ELEMENT_BYTES * self._put[fifo]
        self._put[fifo] = (self._put[fifo] + 1) % _FIFO_FRAMES
        self._filled[fifo] += 1
        self._memory.put(at, frame.identifier | _XTD)
        flags = _FDF | _BRS if frame.is_fd else 0
        self._memory.put(at + 4, LENGTHS.index(len(frame.data)) << 16 | flags)
        padded = frame.data + bytes(-len(frame.data) % 4)
        for i in range(0, len(padded), 4):
            self._memory.put(at + 8 + i, int.from_bytes(padded[i : i + 4], "little"))
        self._raise((_RF0N, _RF1N)[fifo])

    def _status(self, fifo: int) -> int:
        full = 1 << 24 if self._filled[fifo] == _FIFO_FRAMES else 0
        return self._filled[fifo] | self._get[fifo] << 8 | self._put[fifo] << 16 | full

    def read_RXF0S(self) -> int:
        return self._status(0)

    def read_RXF1S(self) -> int:
        return self._status(1)

    def _acknowledge(self, fifo: int, index: int) -> None:
        if not self._filled[fifo] or index != self._get[fifo]:
            raise MachineError(f"FDCAN_RXF{fifo}A = {index}: the frame at the front is {self._get[fifo]}, of {self._filled[fifo]}")
        self._get[fifo] = (index + 1) % _FIFO_FRAMES
        self._filled[fifo] -= 1

    def write_RXF0A(self, value: int) -> None:
        self._acknowledge(0, value)

    def write_RXF1A(self, value: int) -> None:
        self._acknowledge(1, value)

    # To the bus

    def read_TXFQS(self) -> int:
        full = 1 << 21 if not self._free else 0
        return self._free | self._next << 16 | full

    def write_TXBAR(self, value: int) -> None:
        if not self.is_on:
            raise MachineError("FDCAN_TXBAR is written while INIT is set")
        for index in range(_FIFO_FRAMES):
            if value >> index & 1:
                if index != self._next or not self._free:
                    raise MachineError(f"FDCAN_TXBAR: buffer {index} is not the next one of the FIFO ({self._next})")
                self._next = (index + 1) % _FIFO_FRAMES
                self._free -= 1
                self._to_send.append(index)
        self._serve()

    def _read(self, index: int) -> CanFrame:
        at = self._offset + _TX_FIFO + _ELEMENT_BYTES * index
        first, second = self._memory.word(at), self._memory.word(at + 4)
        if not first & _XTD:
            raise MachineError("FDCAN sends a frame with an identifier of 11 bits: not modelled")
        length = LENGTHS[second >> 16 & 15]
        is_fd = bool(second & _FDF and self.value["CCCR"] & _FDOE)
        if not is_fd:
            length = min(length, 8)
        words = (self._memory.word(at + 8 + 4 * i) for i in range(-(-length // 4)))
        data = b"".join(word.to_bytes(4, "little") for word in words)[:length]
        return CanFrame(first & 0x1FFFFFFF, data, is_fd)

    def _sent(self, frame: CanFrame) -> None:
        index = self._to_send.popleft()
        self._free += 1
        self.on_frame(frame)
        if self.value["TXBTIE"] >> index & 1:
            self._raise(_TC)

    # Interrupts

    def _raise(self, flag: int) -> None:
        self.value["IR"] |= flag
        self._request()

    def write_IR(self, value: int) -> None:
        self.value["IR"] &= ~value
        self._request()

    def write_IE(self, value: int) -> None:
        self.value["IE"] = value
        self._request()

    def write_ILE(self, value: int) -> None:
        self.value["ILE"] = value
        self._request()

    def _request(self) -> None:
        wanted = self.value["IR"] & self.value["IE"] and self.value["ILE"] & _EINT0
        self.chip.set_line(self._interrupt, bool(wanted))
