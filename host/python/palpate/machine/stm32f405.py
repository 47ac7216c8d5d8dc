"""An STM32F405 as far as the drivers in boards/stm32f4 use it: clocks, pins, tick, watchdog, and a USART by DMA. As strict as the models of the
STM32G474: what no model knows ends the run."""

from collections import deque
from collections.abc import Callable

from palpate.machine.gpio import Gpio
from palpate.machine.nvic import SystemReset
from palpate.machine.part import Image, Part
from palpate.machine.peripheral import Chip, MachineError, Peripheral
from palpate.machine.timer import BasicTimer, Timer
from palpate.machine.watchdog import Watchdog

CLOCK_Hz = 168_000_000
FLASH_BYTES = 1024 * 1024
RAM = {0x20000000: 128 * 1024}
UNIQUE_ID = (0x0038001F, 0x31385107, 0x31353436)
POWER_RESET, SOFTWARE_RESET, WATCHDOG_RESET = 7 << 25, 1 << 28, 1 << 29  # RCC_CSR
_REMOVE_FLAGS = 1 << 24
_HSI_Hz, _HSE_Hz = 16_000_000, 12_000_000
_CYCLES_TO_READY = 2000
_Hz_PER_WAIT_STATE = 30_000_000  # at 2.7 to 3.6 V (RM0090, table 10)
_APB1_MOST_Hz = 42_000_000
_CLOCKS = {
    "GPIOB": ("AHB1ENR", 1),
    "GPIOC": ("AHB1ENR", 2),
    "DMA1": ("AHB1ENR", 21),
    "TIM5": ("APB1ENR", 3),
    "TIM7": ("APB1ENR", 5),
    "USART3": ("APB1ENR", 18),
    "PWR": ("APB1ENR", 28),
}


class _Divided:
    """A chip whose clock is a part of the processor's: what peripherals of a slower bus count."""

    def __init__(self, chip: Chip, divider: int) -> None:
        self._chip, self._divider = chip, divider

    @property
    def cycle(self) -> int:
        return self._chip.cycle // self._divider

    def after(self, cycles: int, action: Callable[[], None]) -> None:
        self._chip.after(cycles * self._divider, action)

    def set_line(self, interrupt: int, level: bool) -> None:
        self._chip.set_line(interrupt, level)


class _Pwr(Peripheral):
    REGISTERS = {"CR": (0x00, 1 << 14), "CSR": (0x04, 0)}


class _FlashInterface(Peripheral):
    REGISTERS = {"ACR": (0x00, 0)}


class _Identity(Peripheral):
    """The part's 96-bit number."""

    REGISTERS = {f"WORD{i}": (0x10 + 4 * i, word) for i, word in enumerate(UNIQUE_ID)}
    BYTES = 0x100

    def write(self, offset: int, size: int, value: int) -> None:
        raise MachineError(f"store to {self.name} + {offset:#x}: it can only be read")


class Rcc(Peripheral):
    """Clocks (RM0090, 7). has_crystal: False for a board whose HSE does not start."""

    REGISTERS = {
        "CR": (0x00, 0x83),
        "PLLCFGR": (0x04, 0x24003010),
        "CFGR": (0x08, 0),
        "CIR": (0x0C, 0),
        "AHB1ENR": (0x30, 0x00100000),
        "APB1ENR": (0x40, 0),
        "CSR": (0x74, POWER_RESET),
    }

    def __init__(self, chip: Chip, name: str, base: int, wait_states: Callable[[], int], scale_1: Callable[[], bool]) -> None:
        self._wait_states, self._scale_1 = wait_states, scale_1
        self.has_crystal = True
        self.reset_cause = POWER_RESET
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        self.value["CSR"] = self.reset_cause

    def _follow(self, on: int, value: int) -> None:
        """A clock's ready bit, the one above `on`, follows it."""
        if not value & on:
            self.value["CR"] &= ~(on << 1)
        elif not self.value["CR"] & on << 1:
            self.chip.after(_CYCLES_TO_READY, lambda: self._ready(on))

    def _ready(self, on: int) -> None:
        if self.value["CR"] & on:
            self.value["CR"] |= on << 1

    def write_CR(self, value: int) -> None:
        ready = 1 << 1 | 1 << 17 | 1 << 25
        self.value["CR"] = value & ~ready | self.value["CR"] & ready
        if self.has_crystal:
            self._follow(1 << 16, value)
        self._follow(1 << 24, value)

    def write_PLLCFGR(self, value: int) -> None:
        if self.value["CR"] >> 24 & 1:
            raise MachineError("RCC_PLLCFGR is written while the PLL is on")
        self.value["PLLCFGR"] = value

    def write_CSR(self, value: int) -> None:
        if value & _REMOVE_FLAGS:
            self.value["CSR"] = 0

    @property
    def pll_Hz(self) -> int:
        """Its main output, checked step by step (RM0090, 7.3.2)."""
        word = self.value["PLLCFGR"]
        source, name = (_HSE_Hz, 17) if word >> 22 & 1 else (_HSI_Hz, 1)
        if not self.value["CR"] >> name & 1:
            raise MachineError("RCC_PLLCFGR: the source of the PLL is not ready")
        input_Hz = source // (word & 63)
        vco_Hz = input_Hz * (word >> 6 & 511)
        if not (1_000_000 <= input_Hz <= 2_000_000 and 100_000_000 <= vco_Hz <= 432_000_000):
            raise MachineError(f"RCC_PLLCFGR: {input_Hz} Hz at the PLL's input and {vco_Hz} Hz inside: out of range")
        return vco_Hz // (2 * ((word >> 16 & 3) + 1))

    @property
    def system_Hz(self) -> int:
        """SYSCLK."""
        return {0: _HSI_Hz, 1: _HSE_Hz, 2: self.pll_Hz if self.value["CFGR"] >> 2 & 3 == 2 else 0}[self.value["CFGR"] >> 2 & 3]

    @property
    def apb1_divider(self) -> int:
        prescaler = self.value["CFGR"] >> 10 & 7
        return 1 if prescaler < 4 else 2 << prescaler - 4

    def write_CFGR(self, value: int) -> None:
        ready = {0: 1 << 1, 1: 1 << 17, 2: 1 << 25}.get(value & 3, 0)
        if not self.value["CR"] & ready:
            raise MachineError(f"RCC_CFGR: SW = {value & 3} chooses a clock that is not ready")
        if value >> 4 & 8:
            raise MachineError("RCC_CFGR: a divider of the processor's clock is not modelled")
        self.value["CFGR"] = value & ~0xC | (value & 3) << 2
        if self.system_Hz > CLOCK_Hz or not self._scale_1():
            raise MachineError(f"SYSCLK of {self.system_Hz} Hz: 168 MHz at most, and that with the regulator at scale 1")
        if self.system_Hz > (self._wait_states() + 1) * _Hz_PER_WAIT_STATE:
            raise MachineError(f"{self.system_Hz} Hz with {self._wait_states()} wait states of the flash: too few")
        if self.system_Hz // self.apb1_divider > _APB1_MOST_Hz:
            raise MachineError(f"APB1 at {self.system_Hz // self.apb1_divider} Hz: 42 MHz at most")


class _Port(Gpio):
    RESETS = {"GPIOB": (0x280, 0xC0, 0x100)}
    RESET = (0, 0, 0)  # inputs


class Dma(Peripheral):
    """Streams 1 and 3 of DMA1 (RM0090, 10): bytes, by a peripheral's request."""

    REGISTERS = {"LISR": (0x00, 0), "LIFCR": (0x08, 0)} | {
        f"S{n}{register}": (0x10 + 0x18 * n + offset, 0)
        for n in (1, 3)
        for register, offset in (("CR", 0x00), ("NDTR", 0x04), ("PAR", 0x08), ("M0AR", 0x0C))
    }
    _EN, _CIRC, _MINC = 1 << 0, 1 << 8, 1 << 10

    def __init__(self, part: "Stm32f405", name: str, base: int) -> None:
        self._part = part
        self.enabled: Callable[[int], None] = lambda stream: None
        super().__init__(part, name, base)
        for n in (1, 3):
            self.writers[f"S{n}CR"] = lambda value, n=n: self._write_control(n, value)

    def reset(self) -> None:
        super().reset()
        self._whole = {1: 0, 3: 0}

    def _write_control(self, stream: int, value: int) -> None:
        was_on = self.value[f"S{stream}CR"] & self._EN
        if value & self._EN and not was_on:
            if value & ~(self._EN | self._CIRC | self._MINC | 3 << 6 | 7 << 25) or not value & self._MINC:
                raise MachineError(f"DMA1_S{stream}CR = {value:#x}: not modelled")
            if self.value["LISR"] >> {1: 6, 3: 22}[stream] & 0x3D:
                raise MachineError(f"DMA1 stream {stream} is switched on with flags of its last transfer (RM0090, 10.3.17)")
            self._whole[stream] = self.value[f"S{stream}NDTR"]
        self.value[f"S{stream}CR"] = value
        if value & self._EN and not was_on:
            self.enabled(stream)

    def write_LIFCR(self, value: int) -> None:
        self.value["LISR"] &= ~value

    def next_address(self, stream: int, channel: int, direction: int) -> int | None:
        """Where a request's byte comes from or goes to; None: the stream does not take it. The item counts as moved."""
        control = self.value[f"S{stream}CR"]
        left = self.value[f"S{stream}NDTR"]
        if not control & self._EN or not left or control >> 25 & 7 != channel or control >> 6 & 3 != direction:
            return None
        address = self.value[f"S{stream}M0AR"] + self._whole[stream] - left
        left -= 1
        if left == 0:
            if control & self._CIRC:
                left = self._whole[stream]
            else:
                self.value[f"S{stream}CR"] &= ~self._EN
                self.value["LISR"] |= 1 << {1: 11, 3: 27}[stream]
        self.value[f"S{stream}NDTR"] = left
        return address


class Usart(Peripheral):
    """USART3 (RM0090, 30), whose bytes DMA moves: each takes its time on the line. receive() is the line towards the part, `sent` what it has
    put on the line."""

    REGISTERS = {"SR": (0x00, 0xC0), "DR": (0x04, 0), "BRR": (0x08, 0), "CR1": (0x0C, 0), "CR2": (0x10, 0), "CR3": (0x14, 0)}
    _UE, _TE, _RE = 1 << 13, 1 << 3, 1 << 2
    _DMAT, _DMAR = 1 << 7, 1 << 6
    _CHANNEL, _RECEIVE, _TRANSMIT = 4, 1, 3

    def __init__(self, part: "Stm32f405", name: str, base: int) -> None:
        self._part = part
        self.sent = bytearray()
        self.lost = 0
        super().__init__(part, name, base)

    def reset(self) -> None:
        super().reset()
        self._line: deque[int] = deque()
        self._is_receiving = self._is_sending = False

    @property
    def baud(self) -> float:
        return self._part.rcc.system_Hz / self._part.rcc.apb1_divider / self.value["BRR"]

    def _byte_cycles(self) -> int:
        if self.value["BRR"] < 16:
            raise MachineError(f"USART_BRR = {self.value['BRR']}: at least 16")
        return 10 * self.value["BRR"] * self._part.rcc.apb1_divider

    def receive(self, data: bytes) -> None:
        if self.value["CR1"] & (self._UE | self._RE) != self._UE | self._RE:
            self.lost += len(data)
            return
        self._line.extend(data)
        if self._line and not self._is_receiving:
            self._is_receiving = True
            self.chip.after(self._byte_cycles(), self._received)

    def _received(self) -> None:
        if not self._line:
            self._is_receiving = False
            return
        byte = self._line.popleft()
        address = self._part.dma.next_address(self._RECEIVE, self._CHANNEL, 0) if self.value["CR3"] & self._DMAR else None
        if address is None:
            self.lost += 1
        else:
            self._part.core.store(address, bytes([byte]))
        self.chip.after(self._byte_cycles(), self._received)

    def kick(self) -> None:
        """A stream has come on."""
        if not self._is_sending and self.value["CR1"] & (self._UE | self._TE) == self._UE | self._TE and self.value["CR3"] & self._DMAT:
            self._send_next()

    def _send_next(self) -> None:
        address = self._part.dma.next_address(self._TRANSMIT, self._CHANNEL, 1)
        self._is_sending = address is not None
        if address is not None:
            self.sent += self._part.core.load(address, 1)
            self.chip.after(self._byte_cycles(), self._send_next)

    def read_DR(self) -> int:
        raise MachineError("USART_DR is read by the processor: only DMA is modelled")

    def write_DR(self, value: int) -> None:
        raise MachineError("USART_DR is written by the processor: only DMA is modelled")


class Stm32f405(Part):
    """The part."""

    def __init__(self, image: Image) -> None:
        # The last page holds no code: nothing writes flash here.
        super().__init__(image, FLASH_BYTES, 4096, RAM, SOFTWARE_RESET)
        for base, size in ((0x40000000, 0x30000), (0xE000E000, 0x1000), (0x1FFF7000, 0x1000)):
            self.core.map_bus(base, size)
        pwr, flash = _Pwr(self, "PWR", 0x40007000), _FlashInterface(self, "FLASH", 0x40023C00)
        self.rcc = Rcc(self, "RCC", 0x40023800, lambda: flash.value["ACR"] & 7, lambda: bool(pwr.value["CR"] >> 14 & 1))
        self.gpio = {port: _Port(self, f"GPIO{port}", 0x40020000 + 0x400 * (ord(port) - ord("A"))) for port in "BC"}
        # Of APB1's timers: twice its clock, and so half the processor's (RM0090, 7.2).
        timers = _Divided(self, 2)
        self.tick_timer = BasicTimer(timers, "TIM7", 0x40001400, 55, 16)
        self.dma = Dma(self, "DMA1", 0x40026000)
        self.usart = Usart(self, "USART3", 0x40004800)
        self.dma.enabled = lambda stream: self.usart.kick()
        watchdog = Watchdog(self, "IWDG", 0x40003000, CLOCK_Hz)
        watchdog.bite = self._bite
        clock = Timer(timers, "TIM5", 0x40000C00, 50, 32)
        identity = _Identity(self, "UID", 0x1FFF7A00)
        self.attach(
            (pwr, self.rcc, flash, *self.gpio.values(), clock, self.tick_timer, self.dma, self.usart, watchdog, identity), self.rcc, _CLOCKS
        )
        self.core.reset()

    def note_cause(self, cause: int) -> None:
        self.rcc.reset_cause = self.rcc.value["CSR"] & 0xFE000000 | cause

    @staticmethod
    def _bite() -> None:
        raise WatchdogReset("the watchdog was not fed")


class WatchdogReset(SystemReset):
    cause = WATCHDOG_RESET
