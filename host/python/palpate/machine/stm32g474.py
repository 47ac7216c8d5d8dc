"""An STM32G474: processor, memory, and models of the peripherals that the firmware uses."""

from functools import partial

from palpate.machine.analog import Adc, AdcCommon, Dac
from palpate.machine.clock import BROWN_OUT_RESET, PIN_RESET, SOFTWARE_RESET, WATCHDOG_RESET, Crs, Pwr, Rcc
from palpate.machine.dma import Dma, Dmamux
from palpate.machine.fdcan import Fdcan, MessageMemory
from palpate.machine.flash import BYTES as FLASH_BYTES
from palpate.machine.flash import Flash
from palpate.machine.gpio import Gpio, Syscfg
from palpate.machine.lpuart import Lpuart
from palpate.machine.nvic import SystemReset
from palpate.machine.part import Image, Part
from palpate.machine.peripheral import MachineError, Peripheral
from palpate.machine.timer import BasicTimer, Timer
from palpate.machine.usb import PacketMemory, UsbDevice
from palpate.machine.watchdog import Watchdog

CLOCK_Hz = 170_000_000
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


class Stm32g474(Part):
    """The part. data_bytes: at the end of the flash, which the firmware writes."""

    def __init__(self, image: Image, data_bytes: int = 8192) -> None:
        super().__init__(image, FLASH_BYTES, data_bytes, RAM, SOFTWARE_RESET)
        core = self.core
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
        peripherals: tuple[Peripheral, ...] = (
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
        self.attach(peripherals, self.rcc, _CLOCKS)
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

    def note_cause(self, cause: int) -> None:
        self.rcc.reset_cause = self.rcc.value["CSR"] & 0xFE000000 | cause

    def power_cycle(self) -> None:
        """Power goes away and comes back: memory is lost but for the flash."""
        for base, size in self.ram.items():
            self.core.store(base, b"\xa5" * size)
        self.rcc.value["CSR"] = 0
        self.reset(BROWN_OUT_RESET | PIN_RESET)


class WatchdogReset(SystemReset):
    cause = WATCHDOG_RESET
