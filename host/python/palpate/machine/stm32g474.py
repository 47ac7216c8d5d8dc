"""An STM32G474: processor, memory, and models of the peripherals that the firmware uses."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

from elftools.elf.elffile import ELFFile

from palpate.machine.analog import Adc, AdcCommon, Dac
from palpate.machine.clock import BROWN_OUT_RESET, PIN_RESET, SOFTWARE_RESET, WATCHDOG_RESET, Crs, Pwr, Rcc
from palpate.machine.core import Core
from palpate.machine.dma import Dma, Dmamux
from palpate.machine.fdcan import Fdcan, MessageMemory
from palpate.machine.flash import BASE as FLASH_BASE
from palpate.machine.flash import BYTES as FLASH_BYTES
from palpate.machine.flash import Flash
from palpate.machine.gpio import Gpio, Syscfg
from palpate.machine.lpuart import Lpuart
from palpate.machine.nvic import SystemReset
from palpate.machine.peripheral import MachineError, Peripheral
from palpate.machine.timer import BasicTimer, Timer
from palpate.machine.usb import PacketMemory, UsbDevice
from palpate.machine.watchdog import Watchdog

CLOCK_Hz = 170_000_000
# Upper bound of the cycles of an instruction, docs/decisions/cycles.md.
CYCLES_PER_INSTRUCTION = Fraction(9, 5)
RAM = {0x20000000: 128 * 1024}
UNIQUE_ID = (0x004E0042, 0x34335105, 0x20333951)
# Requests of the multiplexer (RM0440, table 91) and triggers of the ADC (table 163).
_REQUEST_ADC1, _REQUEST_LPUART_RX, _REQUEST_LPUART_TX = 5, 34, 35
_TRIGGERS = {13: "TIM6"}
# Bits of the registers that switch a peripheral's clock on.
_CLOCKS = {
    "DMA1": ("AHB1ENR", 0),
    "DMAMUX": ("AHB1ENR", 2),
    "FLASH": ("AHB1ENR", 8),
    "GPIOA": ("AHB2ENR", 0),
    "GPIOB": ("AHB2ENR", 1),
    "GPIOC": ("AHB2ENR", 2),
    "GPIOF": ("AHB2ENR", 5),
    "ADC1": ("AHB2ENR", 13),
    "ADC12_Common": ("AHB2ENR", 13),
    "DAC1": ("AHB2ENR", 16),
    "DAC2": ("AHB2ENR", 17),
    "TIM2": ("APB1ENR1", 0),
    "TIM3": ("APB1ENR1", 1),
    "TIM4": ("APB1ENR1", 2),
    "TIM5": ("APB1ENR1", 3),
    "TIM6": ("APB1ENR1", 4),
    "TIM7": ("APB1ENR1", 5),
    "CRS": ("APB1ENR1", 8),
    "USB": ("APB1ENR1", 23),
    "USB_memory": ("APB1ENR1", 23),
    "FDCAN2": ("APB1ENR1", 25),
    "FDCAN_memory": ("APB1ENR1", 25),
    "PWR": ("APB1ENR1", 28),
    "LPUART1": ("APB1ENR2", 0),
    "SYSCFG": ("APB2ENR", 0),
}


class _Identity(Peripheral):
    """The part's 96-bit number."""

    REGISTERS = {f"WORD{i}": (0x90 + 4 * i, word) for i, word in enumerate(UNIQUE_ID)}
    BYTES = 0x100

    def write(self, offset: int, size: int, value: int) -> None:
        raise MachineError(f"store to {self.name} + {offset:#x}: it can only be read")


class _Clocked:
    """A peripheral that answers only while its clock is on: without, silicon reads zeros and forgets, which is a
    fault of the firmware here."""

    def __init__(self, inner: Peripheral, rcc: Rcc, register: str, bit: int) -> None:
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
    def read(cls, file: Path) -> "Image":
        """Raises MachineError where the file is no image for this part."""
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
            if not FLASH_BASE <= address <= address + len(data) <= FLASH_BASE + FLASH_BYTES:
                raise MachineError(
                    f"{file}: {len(data)} bytes at {address:#010x} are outside of the flash "
                    f"({FLASH_BASE:#010x} to {FLASH_BASE + FLASH_BYTES:#010x})"
                )
        return cls(segments, symbols)


class Stm32g474:
    """The part. data_bytes: at the end of the flash, which the firmware writes."""

    def __init__(self, image: Image, data_bytes: int = 8192) -> None:
        self.image = image
        self.flash_memory = bytearray(b"\xff" * FLASH_BYTES)
        for address, data in image.segments:
            self.flash_memory[address - FLASH_BASE : address - FLASH_BASE + len(data)] = data
        self.core = core = Core(FLASH_BASE, self.flash_memory, data_bytes, RAM, CYCLES_PER_INSTRUCTION)
        self.resets = 0
        self.cycle_of_reset = 0

        for base, size in ((0x40000000, 0x30000), (0x48000000, 0x2000), (0x50000000, 0x1000), (0xE000E000, 0x1000), (0x1FFF7000, 0x1000)):
            core.map_bus(base, size)
        self.pwr = Pwr(self, "PWR", 0x40007000)
        self.flash = Flash(self, "FLASH", 0x40022000, self.flash_memory)
        self.rcc = Rcc(self, "RCC", 0x40021000, lambda: self.flash.wait_states, lambda: self.pwr.boost)
        self.gpio = {port: Gpio(self, f"GPIO{port}", 0x48000000 + 0x400 * (ord(port) - ord("A"))) for port in "ABCF"}
        self.timer = {
            name: kind(self, name, base, interrupt, bits)
            for kind, name, base, interrupt, bits in (
                (Timer, "TIM2", 0x40000000, 28, 32),
                (Timer, "TIM3", 0x40000400, 29, 16),
                (Timer, "TIM4", 0x40000800, 30, 16),
                (Timer, "TIM5", 0x40000C00, 50, 32),
                (BasicTimer, "TIM6", 0x40001000, 54, 16),
                (BasicTimer, "TIM7", 0x40001400, 55, 16),
            )
        }
        self.dac = {"DAC1": Dac(self, "DAC1", 0x50000800), "DAC2": Dac(self, "DAC2", 0x50000C00)}
        self.adc = Adc(self, "ADC1", 0x50000000)
        self.dmamux = Dmamux(self, "DMAMUX", 0x40020800)
        self.dma = Dma(self, "DMA1", 0x40020000, 11, core)
        self.lpuart = Lpuart(self, "LPUART1", 0x40008000, 91)
        can_memory = MessageMemory(self, "FDCAN_memory", 0x4000A400)
        self.fdcan = Fdcan(self, "FDCAN2", 0x40006800, can_memory, 0x350, 86, lambda: self.rcc.fdcan_Hz, CLOCK_Hz)
        usb_memory = PacketMemory(self, "USB_memory", 0x40006000)
        self.usb = UsbDevice(self, "USB", 0x40005C00, usb_memory, 20)
        self.watchdog = Watchdog(self, "IWDG", 0x40003000, CLOCK_Hz)
        self.peripherals: tuple[Peripheral, ...] = (
            self.pwr,
            self.rcc,
            self.flash,
            Crs(self, "CRS", 0x40002000),
            *self.gpio.values(),
            Syscfg(self, "SYSCFG", 0x40010000),
            *self.timer.values(),
            *self.dac.values(),
            self.adc,
            AdcCommon(self, "ADC12_Common", 0x50000300),
            self.dma,
            self.dmamux,
            self.lpuart,
            can_memory,
            self.fdcan,
            usb_memory,
            self.usb,
            self.watchdog,
            _Identity(self, "UID", 0x1FFF7500),
        )
        for peripheral in self.peripherals:
            clock = _CLOCKS.get(peripheral.name)
            core.attach(_Clocked(peripheral, self.rcc, *clock) if clock else peripheral)
        core.attach(core.nvic)
        self._connect()
        core.reset()

    def _connect(self) -> None:
        self.core.program_flash, self.core.load_flash = self.flash.program, self.flash.load
        self.flash.raise_nmi = self.core.nvic.raise_nmi
        for select, name in _TRIGGERS.items():
            self.timer[name].on_trigger = partial(self._triggered, select)
        self.adc.request_dma = self._adc_to_dma
        self.usb.has_clock = lambda: self.rcc.usb_ready
        self.lpuart.take_byte = self._lpuart_to_dma
        self.lpuart.give_byte = self._dma_to_lpuart
        self.dma.enabled = lambda channel: self.lpuart.kick()
        self.watchdog.bite = self._bite

    def _triggered(self, select: int) -> None:
        if self.adc.trigger == select:
            self.adc.convert()

    def _adc_to_dma(self) -> None:
        channel = self.dmamux.channel_of(_REQUEST_ADC1)
        if channel is None or not self.dma.to_memory(channel, self.adc.value["DR"]):
            self.adc.overrun()

    def _lpuart_to_dma(self, byte: int) -> bool:
        channel = self.dmamux.channel_of(_REQUEST_LPUART_RX)
        return channel is not None and self.dma.to_memory(channel, byte)

    def _dma_to_lpuart(self) -> int | None:
        channel = self.dmamux.channel_of(_REQUEST_LPUART_TX)
        return None if channel is None else self.dma.from_memory(channel)

    def _bite(self) -> None:
        raise WatchdogReset("the watchdog was not fed")

    def has_clock(self, peripheral: str) -> bool:
        """Has the firmware switched its clock on?"""
        register, bit = _CLOCKS[peripheral]
        return bool(self.rcc.value[register] >> bit & 1)

    # Chip

    @property
    def cycle(self) -> int:
        return self.core.cycle

    def after(self, cycles: int, action: Callable[[], None]) -> None:
        self.core.after(cycles, action)

    def set_line(self, interrupt: int, level: bool) -> None:
        self.core.nvic.set_line(interrupt, level)

    # Running

    def reset(self, cause: int) -> None:
        """Everything but memory as after a reset; the cause is in RCC_CSR."""
        self.resets += 1
        self.cycle_of_reset = self.core.cycle
        self.rcc.reset_cause = self.rcc.value["CSR"] & 0xFE000000 | cause
        for peripheral in self.peripherals:
            peripheral.reset()
        self.core.reset()

    def power_cycle(self) -> None:
        """Power goes away and comes back: memory is lost but for the flash."""
        for base, size in RAM.items():
            self.core.store(base, b"\xa5" * size)
        self.rcc.value["CSR"] = 0
        self.reset(BROWN_OUT_RESET | PIN_RESET)

    def run(self, until: Callable[[], bool], limit_cycles: int) -> bool:
        """As Core.run; resets happen, and are counted."""
        end = self.core.cycle + limit_cycles
        while True:
            try:
                return self.core.run(until, end - self.core.cycle)
            except SystemReset as reset:
                self.reset(getattr(reset, "cause", SOFTWARE_RESET))


class WatchdogReset(SystemReset):
    cause = WATCHDOG_RESET
