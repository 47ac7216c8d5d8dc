"""RCC, PWR and CRS: clocks come when they are asked for, and the rules of the manual between them are checked (RM0440, 3, 6 and 7)."""

from collections.abc import Callable

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_CYCLES_TO_READY = 2000
# Reset causes in RCC_CSR.
PIN_RESET, BROWN_OUT_RESET, SOFTWARE_RESET, WATCHDOG_RESET = 1 << 26, 1 << 27, 1 << 28, 1 << 29
_REMOVE_FLAGS = 1 << 23
_HSI_Hz, _HSE_Hz = 16_000_000, 24_000_000
_MOST_Hz = 170_000_000
_VOLTAGE_RANGE_1_Hz = 150_000_000  # above it only with boost (RM0440, 6.1.5)
# Flash wait states: up to these frequencies in range 1, boost and normal (RM0440, table 29).
_Hz_PER_WAIT_STATE = {True: 34_000_000, False: 30_000_000}
_HIGHEST_THRESHOLD = 6  # of the supply's detector, about 2.9 V


class Pwr(Peripheral):
    """The supply's detector at its highest threshold only. is_low: what it would find."""

    REGISTERS = {"CR1": (0x00, 0x200), "CR2": (0x04, 0), "CR3": (0x08, 0x8000), "SR2": (0x14, 0), "CR5": (0x80, 0x100)}

    is_low = False

    def write_CR2(self, value: int) -> None:
        if value & 1 and value >> 1 & 7 != _HIGHEST_THRESHOLD:
            raise MachineError(f"PWR_CR2 = {value:#x}: only PVDLS = {_HIGHEST_THRESHOLD} is modelled")
        self.value["CR2"] = value

    def read_SR2(self) -> int:
        return self.value["SR2"] | (1 << 11 if self.is_low and self.value["CR2"] & 1 else 0)

    @property
    def boost(self) -> bool:
        return not self.value["CR5"] >> 8 & 1


class Crs(Peripheral):
    REGISTERS = {"CR": (0x00, 0x4000), "CFGR": (0x04, 0x2022BB7F), "ISR": (0x08, 0), "ICR": (0x0C, 0)}


class Rcc(Peripheral):
    """Clocks. has_crystal: False for a board whose HSE does not start. wait_states() and boost() are what FLASH and PWR are set to."""

    REGISTERS = {
        "CR": (0x00, 0x63 | 1 << 10 | 1 << 8),
        "ICSCR": (0x04, 0x40000000),
        "CFGR": (0x08, 0x5),
        "PLLCFGR": (0x0C, 0x1000),
        "CIER": (0x18, 0),
        "CIFR": (0x1C, 0),
        "CICR": (0x20, 0),
        "AHB1RSTR": (0x28, 0),
        "AHB2RSTR": (0x2C, 0),
        "APB1RSTR1": (0x38, 0),
        "APB1RSTR2": (0x3C, 0),
        "APB2RSTR": (0x40, 0),
        "AHB1ENR": (0x48, 0x100),
        "AHB2ENR": (0x4C, 0),
        "APB1ENR1": (0x58, 0x400),
        "APB1ENR2": (0x5C, 0),
        "APB2ENR": (0x60, 0),
        "CCIPR": (0x88, 0),
        "CSR": (0x94, 0x0C000000),
        "CRRCR": (0x98, 0),
    }

    def __init__(
        self, chip: Chip, name: str, base: int, wait_states: Callable[[], int], boost: Callable[[], bool]
    ) -> None:
        self._wait_states, self._boost = wait_states, boost
        self.has_crystal = True
        self.reset_cause = BROWN_OUT_RESET | PIN_RESET
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        # After a reset the SVD's values, with the internal oscillator on, which runs the processor.
        self.value["CSR"] = self.reset_cause

    def _becomes_ready(self, register: str, on: int, ready: int, present: int) -> None:
        if not present & on:
            self.value[register] &= ~ready
        elif not self.value[register] & ready:
            self.chip.after(_CYCLES_TO_READY, lambda: self._ready(register, on, ready))

    def _ready(self, register: str, on: int, ready: int) -> None:
        if self.value[register] & on:
            self.value[register] |= ready

    def write_CR(self, value: int) -> None:
        flags = 1 << 10 | 1 << 17 | 1 << 25
        self.value["CR"] = value & ~flags | self.value["CR"] & flags
        self._becomes_ready("CR", 1 << 8, 1 << 10, value)
        if self.has_crystal:
            self._becomes_ready("CR", 1 << 16, 1 << 17, value)
        if value >> 24 & 1 and not self.value["CR"] >> 25 & 1:
            self._becomes_ready("CR", 1 << 24, 1 << 25, value)
        elif not value >> 24 & 1:
            self.value["CR"] &= ~(1 << 25)

    def write_PLLCFGR(self, value: int) -> None:
        if self.value["CR"] >> 24 & 1:
            raise MachineError("RCC_PLLCFGR is written while the PLL is on")
        self.value["PLLCFGR"] = value

    def write_CRRCR(self, value: int) -> None:
        self.value["CRRCR"] = value & ~2 | self.value["CRRCR"] & 2
        self._becomes_ready("CRRCR", 1, 2, value)

    def write_CICR(self, value: int) -> None:
        self.value["CIFR"] &= ~value

    def write_CSR(self, value: int) -> None:
        self.value["CSR"] = 0 if value & _REMOVE_FLAGS else self.value["CSR"]

    @property
    def pll_Hz(self) -> int:
        """Output R of the PLL."""
        word = self.value["PLLCFGR"]
        source_Hz = {2: _HSI_Hz, 3: _HSE_Hz}.get(word & 3, 0)
        return source_Hz // ((word >> 4 & 15) + 1) * (word >> 8 & 127) // (2 * ((word >> 25 & 3) + 1))

    @property
    def system_Hz(self) -> int:
        """SYSCLK."""
        return {1: _HSI_Hz, 2: _HSE_Hz, 3: self.pll_Hz}[self.value["CFGR"] >> 2 & 3]

    def write_CFGR(self, value: int) -> None:
        wanted = value & 3
        ready = {1: 1 << 10, 2: 1 << 17, 3: 1 << 25}.get(wanted, 0)
        if not self.value["CR"] & ready:
            raise MachineError(f"RCC_CFGR: SW = {wanted} chooses a clock that is not ready")
        prescaler = value >> 4 & 15
        divider = 1 if prescaler < 8 else (2, 4, 8, 16, 64, 128, 256, 512)[prescaler - 8]
        self.value["CFGR"] = value & ~0xC | wanted << 2
        frequency_Hz = self.system_Hz // divider
        boost = self._boost()
        if frequency_Hz > _MOST_Hz or (frequency_Hz > _VOLTAGE_RANGE_1_Hz and not boost):
            raise MachineError(f"SYSCLK of {frequency_Hz} Hz: over 150 MHz only with boost, and 170 MHz at most")
        if frequency_Hz > (self._wait_states() + 1) * _Hz_PER_WAIT_STATE[boost]:
            raise MachineError(f"{frequency_Hz} Hz with {self._wait_states()} wait states of the flash: too few")

    @property
    def fdcan_Hz(self) -> int:
        """The kernel clock of the FDCAN controllers."""
        select = self.value["CCIPR"] >> 24 & 3
        if select == 0:
            return _HSE_Hz
        if select == 2:
            return self.system_Hz
        raise MachineError(f"RCC_CCIPR: FDCANSEL = {select} is not modelled")

    @property
    def usb_ready(self) -> bool:
        """Is there a clock of 48 MHz?"""
        return bool(self.value["CRRCR"] & 2) and self.value["CCIPR"] >> 26 & 3 == 0
