"""The low-power UART (RM0440, 38), whose bytes DMA moves: each takes its time on the line."""

from collections import deque
from collections.abc import Callable

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_UE, _RE, _TE, _IDLEIE = 1 << 0, 1 << 2, 1 << 3, 1 << 4
_DMAR, _DMAT, _OVRDIS = 1 << 6, 1 << 7, 1 << 12
_IDLE, _TC, _TXE = 1 << 4, 1 << 6, 1 << 7
_BITS_PER_BYTE = 10


class Lpuart(Peripheral):
    """receive(bytes) is the line towards the part; `sent` what it has put on the line. take_byte and give_byte are
    DMA's: the latter returns None where there is nothing to send."""

    REGISTERS = {
        "CR1": (0x00, 0),
        "CR2": (0x04, 0),
        "CR3": (0x08, 0),
        "BRR": (0x0C, 0),
        "RQR": (0x18, 0),
        "ISR": (0x1C, _TC | _TXE),
        "ICR": (0x20, 0),
        "RDR": (0x24, 0),
        "TDR": (0x28, 0),
        "PRESC": (0x2C, 0),
    }

    def __init__(self, chip: Chip, name: str, base: int, interrupt: int) -> None:
        self._interrupt = interrupt
        self.take_byte: Callable[[int], bool] = lambda byte: False
        self.give_byte: Callable[[], int | None] = lambda: None
        self.sent = bytearray()
        self.lost = 0  # bytes that came while nothing took them
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        self._line: deque[int] = deque()
        self._is_receiving = self._is_sending = False
        self.chip.set_line(self._interrupt, False)

    @property
    def byte_cycles(self) -> int:
        """What a byte takes: BRR counts 256ths of the kernel clock, which is the processor's."""
        if self.value["BRR"] < 0x300:
            raise MachineError(f"LPUART_BRR = {self.value['BRR']:#x}: at least 0x300")
        return _BITS_PER_BYTE * self.value["BRR"] // 256

    def receive(self, data: bytes) -> None:
        """Bytes on the line, one behind the other; those that come while the receiver is off are gone."""
        if self.value["CR1"] & (_UE | _RE) != (_UE | _RE):
            self.lost += len(data)
            return
        self._line.extend(data)
        if self._line and not self._is_receiving:
            self._is_receiving = True
            self.chip.after(self.byte_cycles, self._received)

    def _received(self) -> None:
        if not self._line:  # a byte's time without one
            self._is_receiving = False
            self.value["ISR"] |= _IDLE
            self._request()
            return
        byte = self._line.popleft()
        self.value["RDR"] = byte
        if not (self.value["CR3"] & _DMAR and self.take_byte(byte)):
            self.lost += 1
        self.chip.after(self.byte_cycles, self._received)

    def kick(self) -> None:
        """DMA has something to send."""
        ready = self.value["CR1"] & (_UE | _TE) == (_UE | _TE) and self.value["CR3"] & _DMAT
        if ready and not self._is_sending:
            self._send_next()

    def _send_next(self) -> None:
        byte = self.give_byte()
        self._is_sending = byte is not None
        if byte is None:
            self.value["ISR"] |= _TC
            return
        self.value["ISR"] &= ~_TC
        self.sent.append(byte)
        self.chip.after(self.byte_cycles, self._send_next)

    def write_CR1(self, value: int) -> None:
        self.value["CR1"] = value
        self.value["ISR"] |= (value & _TE) << 18 | (value & _RE) << 20  # TEACK, REACK
        self._request()
        self.kick()

    def write_CR3(self, value: int) -> None:
        self.value["CR3"] = value
        self.kick()

    def write_BRR(self, value: int) -> None:
        if self.value["CR1"] & _UE:
            raise MachineError("LPUART_BRR is written while it is on")
        self.value["BRR"] = value

    def write_ICR(self, value: int) -> None:
        self.value["ISR"] &= ~(value & 0x1F | value & _TC)
        self._request()

    def write_TDR(self, value: int) -> None:
        raise MachineError("LPUART_TDR is written by the processor: only DMA is modelled")

    def _request(self) -> None:
        self.chip.set_line(self._interrupt, bool(self.value["ISR"] & _IDLE and self.value["CR1"] & _IDLEIE))
