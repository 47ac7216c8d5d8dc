"""DMA controller and request multiplexer (RM0440, 12 and 13): a peripheral asks, and an item moves."""

from collections.abc import Callable
from typing import Protocol

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_ENABLE, _FROM_MEMORY, _CIRCULAR, _INCREMENT = 1 << 0, 1 << 4, 1 << 5, 1 << 7
_COMPLETE, _HALF = 1 << 1, 1 << 2  # of CCR: interrupt enables; of ISR: flags
_CHANNELS = 8


class Memory(Protocol):
    def load(self, address: int, length: int) -> bytes: ...
    def store(self, address: int, data: bytes) -> None: ...


class Dmamux(Peripheral):
    REGISTERS = {f"C{i}CR": (4 * i, 0) for i in range(16)}

    def __init__(self, chip: Chip, name: str, base: int) -> None:
        self.routed: Callable[[], None] = lambda: None
        super().__init__(chip, name, base)

    def channel_of(self, request: int) -> int | None:
        """Channel of DMA1 (1 to 8) that takes a peripheral's request."""
        return next((i + 1 for i in range(_CHANNELS) if self.value[f"C{i}CR"] & 127 == request), None)


class Dma(Peripheral):
    """first_interrupt: of channel 1; the others follow. bus: what reads and writes a peripheral's register."""

    REGISTERS = {"ISR": (0x00, 0), "IFCR": (0x04, 0)} | {
        f"{register}{n}": (offset + 0x14 * (n - 1), 0)
        for n in range(1, _CHANNELS + 1)
        for register, offset in (("CCR", 0x08), ("CNDTR", 0x0C), ("CPAR", 0x10), ("CMAR", 0x14))
    }

    def __init__(self, chip: Chip, name: str, base: int, first_interrupt: int, memory: Memory) -> None:
        self._first_interrupt, self._memory = first_interrupt, memory
        self.enabled: Callable[[int], None] = lambda channel: None  # a channel has come on
        super().__init__(chip, name, base)
        for n in range(1, _CHANNELS + 1):
            self.writers[f"CCR{n}"] = lambda value, n=n: self._write_control(n, value)
            self.writers[f"CNDTR{n}"] = lambda value, n=n: self._write_count(n, value)

    def reset(self) -> None:
        super().reset()
        self._whole = [0] * (_CHANNELS + 1)
        for n in range(1, _CHANNELS + 1):
            self._request(n)

    def _write_control(self, channel: int, value: int) -> None:
        was_on = self.value[f"CCR{channel}"] & _ENABLE
        self.value[f"CCR{channel}"] = value
        if value & _ENABLE and not was_on:
            self._whole[channel] = self.value[f"CNDTR{channel}"]
            self.enabled(channel)
        self._request(channel)

    def _write_count(self, channel: int, value: int) -> None:
        if self.value[f"CCR{channel}"] & _ENABLE:
            raise MachineError(f"{self.name}_CNDTR{channel} is written while the channel is on")
        self.value[f"CNDTR{channel}"] = value & 0xFFFF

    def write_IFCR(self, value: int) -> None:
        for channel in range(1, _CHANNELS + 1):
            shift = 4 * (channel - 1)
            bits = value >> shift & 15
            self.value["ISR"] &= ~((15 if bits & 1 else bits) << shift)
            self._request(channel)

    def wants(self, channel: int) -> bool:
        """Is a channel on, with something left to move?"""
        return bool(self.value[f"CCR{channel}"] & _ENABLE and self.value[f"CNDTR{channel}"])

    def _item(self, channel: int) -> tuple[int, int]:
        """Address and bytes of the next item in memory."""
        control = self.value[f"CCR{channel}"]
        size = 1 << (control >> 10 & 3)
        done = self._whole[channel] - self.value[f"CNDTR{channel}"] if control & _INCREMENT else 0
        return self.value[f"CMAR{channel}"] + size * done, size

    def to_memory(self, channel: int, value: int) -> bool:
        """A peripheral's item goes to memory; false: the channel is off or done."""
        if not self.wants(channel) or self.value[f"CCR{channel}"] & _FROM_MEMORY:
            return False
        address, size = self._item(channel)
        self._memory.store(address, (value & (1 << 8 * size) - 1).to_bytes(size, "little"))
        self._moved(channel)
        return True

    def from_memory(self, channel: int) -> int | None:
        """The next item for a peripheral; None: the channel is off or done."""
        if not self.wants(channel) or not self.value[f"CCR{channel}"] & _FROM_MEMORY:
            return None
        address, size = self._item(channel)
        value = int.from_bytes(self._memory.load(address, size), "little")
        self._moved(channel)
        return value

    def _moved(self, channel: int) -> None:
        left = self.value[f"CNDTR{channel}"] - 1
        flags = 0
        if left == self._whole[channel] // 2:
            flags |= _HALF
        if left == 0:
            flags |= _COMPLETE
            if self.value[f"CCR{channel}"] & _CIRCULAR:
                left = self._whole[channel]
        self.value[f"CNDTR{channel}"] = left
        if flags:
            self.value["ISR"] |= (flags | 1) << 4 * (channel - 1)
            self._request(channel)

    def _request(self, channel: int) -> None:
        flags = self.value["ISR"] >> 4 * (channel - 1)
        wanted = self.value[f"CCR{channel}"] & (_COMPLETE | _HALF)
        # Channel 8 has an interrupt elsewhere (96).
        interrupt = self._first_interrupt + channel - 1 if channel < _CHANNELS else 96
        self.chip.set_line(interrupt, bool(flags & wanted))
