"""What every modelled part has: an image in its flash, a processor, peripherals that answer while their clock is on, resets."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

from elftools.elf.elffile import ELFFile

from palpate.machine.core import Core
from palpate.machine.nvic import SystemReset
from palpate.machine.peripheral import MachineError, Peripheral

FLASH_BASE = 0x08000000
# Upper bound of the cycles of an instruction, docs/decisions/cycles.md.
CYCLES_PER_INSTRUCTION = Fraction(9, 5)


@dataclass(frozen=True)
class Image:
    """What is flashed: bytes by address, and the addresses of its objects."""

    segments: tuple[tuple[int, bytes], ...]
    symbols: dict[str, int]

    def read_flash(self, address: int, length: int) -> bytes:
        """Bytes of it. Raises MachineError where there are none."""
        for first, data in self.segments:
            if first <= address and address + length <= first + len(data):
                return data[address - first : address - first + length]
        raise MachineError(f"the image has no {length} bytes at {address:#010x}")

    @classmethod
    def read(cls, file: Path, flash_bytes: int = 512 * 1024) -> "Image":
        """flash_bytes: of the part it is for, an STM32G474 unless said otherwise. Raises MachineError where the file is no image for this part."""
        try:
            with file.open("rb") as stream:
                elf = ELFFile(stream)
                segments = tuple(
                    (segment["p_paddr"], segment.data())
                    for segment in elf.iter_segments()
                    if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]
                )
                table: Any = elf.get_section_by_name(".symtab")
                symbols = {symbol.name: symbol["st_value"] for symbol in table.iter_symbols()} if table else {}
        except Exception as error:  # the library has many
            raise MachineError(f"{file}: not an ELF file: {error}") from None
        for address, data in segments:
            if not FLASH_BASE <= address <= address + len(data) <= FLASH_BASE + flash_bytes:
                raise MachineError(
                    f"{file}: {len(data)} bytes at {address:#010x} are outside of the flash "
                    f"({FLASH_BASE:#010x} to {FLASH_BASE + flash_bytes:#010x})"
                )
        return cls(segments, symbols)


class _Clocks(Protocol):
    """The RCC: its registers by name."""

    value: dict[str, int]


class _Clocked:
    """A peripheral that answers only while its clock is on: without, silicon reads zeros and forgets, which is a
    fault of the firmware here."""

    def __init__(self, inner: Peripheral, rcc: _Clocks, register: str, bit: int) -> None:
        self._inner, self._rcc, self._register, self._bit = inner, rcc, register, bit
        self.name, self.base, self.BYTES = inner.name, inner.base, inner.BYTES

    def _check(self) -> None:
        if not self._rcc.value[self._register] >> self._bit & 1:
            raise MachineError(f"access to {self.name} while its clock is off (RCC_{self._register}, bit {self._bit})")

    def read(self, offset: int, size: int) -> int:
        self._check()
        return self._inner.read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        self._check()
        self._inner.write(offset, size, value)


class Part:
    """A subclass makes its peripherals, the RCC among them, and calls attach(). software_reset: that cause in the RCC's register."""

    def __init__(
        self, image: Image, flash_bytes: int, data_bytes: int, ram: Mapping[int, int], software_reset: int
    ) -> None:
        self.image, self.ram, self._software_reset = image, dict(ram), software_reset
        self.flash_memory = bytearray(b"\xff" * flash_bytes)
        for address, data in image.segments:
            self.flash_memory[address - FLASH_BASE : address - FLASH_BASE + len(data)] = data
        self.core = Core(FLASH_BASE, self.flash_memory, data_bytes, self.ram, CYCLES_PER_INSTRUCTION)
        self.resets = 0
        self.cycle_of_reset = 0
        self.peripherals: tuple[Peripheral, ...] = ()
        self._clocks: dict[str, tuple[str, int]] = {}

    def attach(self, peripherals: tuple[Peripheral, ...], rcc: _Clocks, clocks: Mapping[str, tuple[str, int]]) -> None:
        """clocks: the RCC's register and bit that switch a peripheral on, by name."""
        self.peripherals, self._rcc, self._clocks = peripherals, rcc, dict(clocks)
        for peripheral in peripherals:
            clock = clocks.get(peripheral.name)
            self.core.attach(_Clocked(peripheral, rcc, *clock) if clock else peripheral)
        self.core.attach(self.core.nvic)

    def has_clock(self, peripheral: str) -> bool:
        """Has the firmware switched its clock on?"""
        register, bit = self._clocks[peripheral]
        return bool(self._rcc.value[register] >> bit & 1)

    # Chip

    @property
    def cycle(self) -> int:
        return self.core.cycle

    def after(self, cycles: int, action: Callable[[], None]) -> None:
        self.core.after(cycles, action)

    def set_line(self, interrupt: int, level: bool) -> None:
        self.core.nvic.set_line(interrupt, level)

    # Running

    def note_cause(self, cause: int) -> None:
        """The RCC shall say so after the reset that follows."""
        raise NotImplementedError

    def reset(self, cause: int) -> None:
        """Everything but memory as after a reset; the cause is in RCC_CSR."""
        self.resets += 1
        self.cycle_of_reset = self.core.cycle
        self.note_cause(cause)
        for peripheral in self.peripherals:
            peripheral.reset()
        self.core.reset()

    def run(self, until: Callable[[], bool], limit_cycles: int) -> bool:
        """As Core.run; resets happen, and are counted."""
        end = self.core.cycle + limit_cycles
        while True:
            try:
                return self.core.run(until, end - self.core.cycle)
            except SystemReset as reset:
                self.reset(getattr(reset, "cause", self._software_reset))
