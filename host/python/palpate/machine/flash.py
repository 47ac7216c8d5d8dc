"""The flash memory and its interface (RM0440, 3.3): programmed by double words, erased by pages of 2 KiB (dual bank).

Power may go away at any of the steps in which its contents change (`power_fails_at`); what was being written then is half done, or cannot
be read any more, which the processor hears of by an NMI."""

from collections.abc import Callable

from palpate.machine.clock import BROWN_OUT_RESET
from palpate.machine.nvic import SystemReset
from palpate.machine.peripheral import Chip, MachineError, Peripheral

BASE, BYTES = 0x08000000, 512 * 1024
PAGE_BYTES, _BANK_BYTES = 2048, 256 * 1024
_KEYS = (0x45670123, 0xCDEF89AB)
_PG, _PER, _STRT, _LOCK, _BUSY = 1 << 0, 1 << 1, 1 << 16, 1 << 31, 1 << 16
_CYCLES_TO_PROGRAM, CYCLES_TO_ERASE = 14_000, 3_740_000  # 82 us and 22 ms at 170 MHz (data sheet, table 52)
_ERASED = b"\xff"
_TWO_ERRORS = 1 << 31  # ECCR: more than can be corrected


class PowerFailure(SystemReset):
    """Power has gone away while the flash was written."""

    cause = BROWN_OUT_RESET


class Flash(Peripheral):
    REGISTERS = {
        "ACR": (0x00, 0x00040601),
        "KEYR": (0x08, 0),
        "SR": (0x10, 0),
        "CR": (0x14, 0xC0000000),
        "ECCR": (0x18, 0),
        "OPTR": (0x20, 0xFFEFF8AA),  # dual bank, boots from bank 1
    }

    def __init__(self, chip: Chip, name: str, base: int, memory: bytearray) -> None:
        self.memory = memory
        self.power_fails_at: int | None = None  # steps until then; a step is a double word or a page
        self.steps = 0
        self.erase_cycles = CYCLES_TO_ERASE
        self.fails_unreadable = False  # what is left when power fails
        self.raise_nmi: Callable[[], None] = lambda: None
        self._unreadable: set[int] = set()  # offsets of double words
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        self._key = 0
        self._first_word: tuple[int, bytes] | None = None

    @property
    def wait_states(self) -> int:
        return self.value["ACR"] & 15

    def write_KEYR(self, value: int) -> None:
        if self._key > 1 or value != _KEYS[self._key]:
            raise MachineError(f"FLASH_KEYR = {value:#x}: not the key that is expected; the flash stays locked until a reset")
        self._key += 1
        if self._key == 2:
            self.value["CR"] &= ~_LOCK
            self._key = 0

    def load(self, address: int, length: int) -> bytes:
        """The processor reads."""
        offset = address - BASE
        if offset & ~7 in self._unreadable:
            self.value["ECCR"] = _TWO_ERRORS | offset >> 3 & 0x7FFFF
            self.raise_nmi()
        return bytes(self.memory[offset : offset + length])

    def write_ECCR(self, value: int) -> None:
        self.value["ECCR"] &= ~(value & _TWO_ERRORS)

    def write_SR(self, value: int) -> None:
        self.value["SR"] &= ~(value & 0xC3FB)

    def write_CR(self, value: int) -> None:
        if self.value["CR"] & _LOCK and value & (_PG | _PER | _STRT):
            raise MachineError(f"FLASH_CR = {value:#x} while it is locked")
        if self.value["SR"] & _BUSY:
            raise MachineError("FLASH_CR is written while the flash is busy")
        self.value["CR"] = value & ~_STRT
        if value & _STRT:
            if not value & _PER:
                raise MachineError(f"FLASH_CR = {value:#x}: only pages are erased")
            page = (value >> 3 & 127) * PAGE_BYTES + (_BANK_BYTES if value >> 11 & 1 else 0)
            self._change(page, _ERASED * PAGE_BYTES, self.erase_cycles)

    def program(self, address: int, data: bytes) -> None:
        """The firmware stores to the flash: two words make one that is written."""
        offset = address - BASE
        if self.value["CR"] & _LOCK or not self.value["CR"] & _PG:
            raise MachineError(f"store to flash at {address:#010x} while it is locked")
        if len(data) != 4:
            raise MachineError(f"store of {len(data)} bytes to flash at {address:#010x}: by words only")
        if self._first_word is None:
            if offset % 8:
                raise MachineError(f"store to flash at {address:#010x}: a double word begins at a multiple of 8")
            self._first_word = (offset, data)
            return
        first, low = self._first_word
        self._first_word = None
        if offset != first + 4:
            raise MachineError(f"store to flash at {address:#010x}: the second word of another double word")
        both = low + data
        if self.memory[first : first + 8] != _ERASED * 8 and both != bytes(8):
            self.value["SR"] |= 1 << 3  # PROGERR
            return
        self._change(first, both, _CYCLES_TO_PROGRAM)

    def _change(self, offset: int, data: bytes, cycles: int) -> None:
        self.steps += 1
        if self.power_fails_at is not None and self.steps >= self.power_fails_at:
            # Half of it is done: some of the bits have changed.
            old = self.memory[offset : offset + len(data)]
            half = len(data) // 2
            self.memory[offset : offset + len(data)] = data[:half] + old[half:]
            if self.fails_unreadable:
                self._unreadable |= set(range(offset, offset + len(data), 8))
            raise PowerFailure("power has failed while the flash was written")
        self.memory[offset : offset + len(data)] = data
        self._unreadable -= set(range(offset, offset + len(data), 8))
        self.value["SR"] |= _BUSY
        self.chip.after(cycles, self._done)

    def _done(self) -> None:
        self.value["SR"] &= ~_BUSY
        self.value["SR"] |= 1 if self.value["CR"] >> 24 & 1 else 0
