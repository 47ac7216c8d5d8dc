"""The system control space of a Cortex-M4F: NVIC, system control block, FPU control (Armv7-M manual, B3)."""

from typing import Protocol

from palpate.machine.peripheral import MachineError

NMI, HARD_FAULT, SVCALL = 2, 3, 11
_FIRST_INTERRUPT = 16
_RESET_KEY = 0x05FA
_SYSTEM_RESET_REQUEST = 1 << 2
_LOWEST = 256  # priority of thread mode
_FIXED = {HARD_FAULT: -1, NMI: -2}
_PRIORITY_BITS = 0xF0  # an STM32 has four


class SystemReset(Exception):
    """The firmware has asked for a reset, or its watchdog has bitten."""


class _Core(Protocol):
    def look_again(self) -> None: ...
    @property
    def cycle(self) -> int: ...


class Nvic:
    """Which exceptions wait and run. Interrupt n is exception 16 + n. Answers loads and stores of the system control space as a
    peripheral does, word by word, and of priorities byte by byte."""

    name, base, BYTES = "SCS", 0xE000E000, 0x1000

    def __init__(self, core: _Core) -> None:
        self._core = core
        self.reset()

    def reset(self) -> None:
        self.enabled: set[int] = set()
        self.pending: set[int] = set()
        self.lines: set[int] = set()  # interrupts that a peripheral requests
        self.active: list[int] = []  # exceptions, the innermost last
        self.priority: dict[int, int] = {}
        self.vector_table = 0
        self.default_fpscr = 0
        self._words = {0xD14: 0x200, 0xD24: 0, 0xD28: 0, 0xD2C: 0, 0xD34: 0, 0xD38: 0, 0xD88: 0, 0xF34: 0xC0000000, 0xD10: 0, 0xDF0: 0, 0xDFC: 0}

    # Exceptions

    def set_line(self, interrupt: int, level: bool) -> None:
        """A peripheral's request: it stays pending while the level does."""
        if not level:
            self.lines.discard(interrupt)
        elif interrupt not in self.lines:
            self.lines.add(interrupt)
            self.pending.add(_FIRST_INTERRUPT + interrupt)
            self._core.look_again()

    def raise_nmi(self) -> None:
        self.pending.add(NMI)
        self._core.look_again()

    def acknowledge(self, number: int) -> None:
        self.pending.discard(number)

    def returned(self, number: int) -> None:
        """Its handler has ended: a level that is still there asks again."""
        if number - _FIRST_INTERRUPT in self.lines:
            self.pending.add(number)

    def _priority(self, number: int) -> int:
        return _FIXED.get(number, self.priority.get(number, 0))

    def highest_pending(self) -> int | None:
        if not self.pending:
            return None
        ready = [n for n in self.pending if n < _FIRST_INTERRUPT or n - _FIRST_INTERRUPT in self.enabled]
        return min(ready, key=lambda n: (self._priority(n), n), default=None)

    def preempts(self, number: int, base_priority: int) -> bool:
        """Does it interrupt what runs now?"""
        present = min((self._priority(n) for n in self.active), default=_LOWEST)
        if base_priority & _PRIORITY_BITS:
            present = min(present, base_priority & _PRIORITY_BITS)
        return self._priority(number) < present

    def note_bus_fault(self, address: int) -> None:
        """What the fault registers say of a precise data bus error."""
        self._words[0xD28] |= 1 << 9 | 1 << 15  # CFSR: PRECISERR, BFARVALID
        self._words[0xD2C] |= 1 << 30  # HFSR: FORCED
        self._words[0xD38] = address

    # Registers

    def read(self, offset: int, size: int) -> int:
        if size != 4:
            return self.read(offset & ~3, 4) >> 8 * (offset & 3) & (1 << 8 * size) - 1
        if 0x100 <= offset < 0x180:
            return self._mask(offset & 0x7F, {16 + n for n in self.enabled})
        if 0x180 <= offset < 0x200:
            return self._mask(offset & 0x7F, {16 + n for n in self.enabled})
        if 0x200 <= offset < 0x300:
            return self._mask(offset & 0x7F, self.pending)
        if 0x300 <= offset < 0x380:
            return self._mask(offset & 0x7F, set(self.active))
        if 0x400 <= offset < 0x500:
            return sum(self.priority.get(16 + offset - 0x400 + i, 0) << 8 * i for i in range(4))
        if 0xD18 <= offset < 0xD24:
            return sum(self.priority.get(4 + offset - 0xD18 + i, 0) << 8 * i for i in range(4))
        if offset == 0xD00:
            return 0x410FC241  # CPUID: Cortex-M4 r0p1
        if offset == 0xD04:
            return (self.active[-1] if self.active else 0) | (1 << 22 if self.pending else 0)
        if offset == 0xD08:
            return self.vector_table
        if offset == 0xD0C:
            return 0xFA050000
        if offset == 0xF3C:
            return self.default_fpscr
        if offset in self._words:
            return self._words[offset]
        raise MachineError(f"load from SCS + {offset:#x}: no model has this register")

    def write(self, offset: int, size: int, value: int) -> None:
        if 0x400 <= offset < 0x500 or 0xD18 <= offset < 0xD24:
            first = 16 + offset - 0x400 if offset < 0x500 else 4 + offset - 0xD18
            for i in range(size):
                self.priority[first + i] = value >> 8 * i & _PRIORITY_BITS
        elif size != 4:
            raise MachineError(f"store of {size} bytes to SCS + {offset:#x}: not modelled")
        elif 0x100 <= offset < 0x180:
            self.enabled |= self._numbers(offset & 0x7F, value)
        elif 0x180 <= offset < 0x200:
            self.enabled -= self._numbers(offset & 0x7F, value)
        elif 0x200 <= offset < 0x280:
            self.pending |= {16 + n for n in self._numbers(offset & 0x7F, value)}
        elif 0x280 <= offset < 0x300:
            self.pending -= {16 + n for n in self._numbers(offset & 0x7F, value)}
        elif offset == 0xD08:
            self.vector_table = value & ~0x7F
        elif offset == 0xD0C:
            if value >> 16 != _RESET_KEY:
                raise MachineError(f"store of {value:#x} to AIRCR: wrong key")
            if value & _SYSTEM_RESET_REQUEST:
                raise SystemReset("asked for by the firmware")
        elif offset in (0xD28, 0xD2C):
            self._words[offset] &= ~value  # cleared by ones
        elif offset == 0xF3C:
            self.default_fpscr = value & 0x07C00000
        elif offset in self._words:
            self._words[offset] = value
        else:
            raise MachineError(f"store to SCS + {offset:#x}: no model has this register")
        self._core.look_again()

    @staticmethod
    def _mask(byte: int, exceptions: set[int]) -> int:
        return sum(1 << bit for bit in range(32) if _FIRST_INTERRUPT + 8 * byte + bit in exceptions)

    @staticmethod
    def _numbers(byte: int, value: int) -> set[int]:
        return {8 * byte + bit for bit in range(32) if value >> bit & 1}
