"""DAC and ADC (RM0440, 21 and 22), as codes: what they are in volts is the board's."""

from collections.abc import Callable

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_CODES = 4096


class Dac(Peripheral):
    """Two channels of 12 bits, without trigger: what is stored is put out."""

    REGISTERS = {
        "CR": (0x00, 0),
        "SWTRGR": (0x04, 0),
        "DHR12R1": (0x08, 0),
        "DHR12R2": (0x14, 0),
        "DHR12RD": (0x20, 0),
        "DOR1": (0x2C, 0),
        "DOR2": (0x30, 0),
        "SR": (0x34, 0),
        "MCR": (0x3C, 0),
    }

    def __init__(self, chip: Chip, name: str, base: int) -> None:
        self.changed: Callable[[], None] = lambda: None
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        self.changed()

    def write_CR(self, value: int) -> None:
        if value & (2 | 2 << 16):
            raise MachineError(f"{self.name}_CR = {value:#x}: triggers are not modelled")
        if value & (1 | 1 << 16) and self.value["MCR"] >> 14 & 3 != 2:
            raise MachineError(f"{self.name}_CR: on with MCR_HFSEL = {self.value['MCR'] >> 14 & 3}; above 160 MHz it must be 2")
        self.value["CR"] = value
        self.changed()

    def write_MCR(self, value: int) -> None:
        if self.value["CR"] & (1 | 1 << 16):
            raise MachineError(f"{self.name}_MCR is written while a channel is on")
        self.value["MCR"] = value

    def write_DHR12R1(self, value: int) -> None:
        self.value["DHR12R1"] = self.value["DOR1"] = value % _CODES
        self.changed()

    def write_DHR12R2(self, value: int) -> None:
        self.value["DHR12R2"] = self.value["DOR2"] = value % _CODES
        self.changed()

    def write_DHR12RD(self, value: int) -> None:
        self.value["DOR1"], self.value["DOR2"] = value % _CODES, (value >> 16) % _CODES
        self.changed()

    def code(self, channel: int) -> int | None:
        """What a channel (1 or 2) puts out; None: it is off, and its pin floats."""
        if not self.value["CR"] >> 16 * (channel - 1) & 1:
            return None
        return self.value[f"DOR{channel}"]


_READY, _END_OF_SEQUENCE, _OVERRUN = 1 << 0, 1 << 3, 1 << 4
_ADEN, _ADSTART, _ADVREGEN, _DEEPPWD, _ADCAL = 1 << 0, 1 << 2, 1 << 28, 1 << 29, 1 << 31
_CYCLES_TO_READY, _CYCLES_TO_CALIBRATE, _CYCLES_PER_CONVERSION = 200, 1000, 100


class Adc(Peripheral):
    """A regular sequence, started by software or by a timer's trigger, whose results DMA takes. input(channel) is the code at an input."""

    REGISTERS = {
        "ISR": (0x00, 0),
        "IER": (0x04, 0),
        "CR": (0x08, _DEEPPWD),
        "CFGR": (0x0C, 0x80000000),
        "CFGR2": (0x10, 0),
        "SMPR1": (0x14, 0),
        "SMPR2": (0x18, 0),
        "SQR1": (0x30, 0),
        "SQR2": (0x34, 0),
        "DR": (0x40, 0),
        "DIFSEL": (0xB0, 0),
        "CALFACT": (0xB4, 0),
    }
    BYTES = 0x100

    def __init__(self, chip: Chip, name: str, base: int) -> None:
        self.input: Callable[[int], int] = lambda channel: 0
        self.request_dma: Callable[[], None] = lambda: None
        super().__init__(chip, name, base)

    def write_ISR(self, value: int) -> None:
        self.value["ISR"] &= ~value

    def write_CR(self, value: int) -> None:
        old = self.value["CR"]
        if value & (_ADEN | _ADCAL) and (not value & _ADVREGEN or value & _DEEPPWD):
            raise MachineError(f"{self.name}_CR = {value:#x}: its regulator is off")
        if value & _ADCAL and old & _ADEN:
            raise MachineError(f"{self.name}_CR: calibration while it is enabled")
        if value & _ADSTART and not self.value["ISR"] & _READY and not old & _ADSTART:
            raise MachineError(f"{self.name}_CR: started before it was ready")
        self.value["CR"] = value
        if value & _ADCAL and not old & _ADCAL:
            self.chip.after(_CYCLES_TO_CALIBRATE, self._calibrated)
        if value & _ADEN and not old & _ADEN:
            self.chip.after(_CYCLES_TO_READY, self._enabled)
        if value & _ADSTART and not old & _ADSTART and not self.value["CFGR"] >> 10 & 3:
            self.convert()

    def _calibrated(self) -> None:
        self.value["CR"] &= ~_ADCAL

    def _enabled(self) -> None:
        self.value["ISR"] |= _READY

    def overrun(self) -> None:
        """Nobody has taken a result before the next one."""
        self.value["ISR"] |= _OVERRUN

    @property
    def trigger(self) -> int | None:
        """EXTSEL of the trigger it waits for; None: none."""
        waits = self.value["CR"] & _ADSTART and self.value["CFGR"] >> 10 & 3
        return self.value["CFGR"] >> 5 & 31 if waits else None

    def convert(self) -> None:
        """Runs the sequence once."""
        length = (self.value["SQR1"] & 15) + 1
        if length > 4:
            raise MachineError(f"{self.name}_SQR1: a sequence of {length} is not modelled, 4 at most")
        channels = [self.value["SQR1"] >> 6 + 6 * i & 31 for i in range(length)]
        self._next(channels)

    def _next(self, channels: list[int]) -> None:
        def done() -> None:
            self.value["DR"] = self._oversampled(self.input(channels[0]))
            if self.value["CFGR"] & 1:
                self.request_dma()
            if len(channels) > 1:
                self._next(channels[1:])
            else:
                self.value["ISR"] |= _END_OF_SEQUENCE

        self.chip.after(_CYCLES_PER_CONVERSION, done)

    def _oversampled(self, code: int) -> int:
        setting = self.value["CFGR2"]
        if not setting & 1:
            return code
        return code * (2 << (setting >> 2 & 7)) >> (setting >> 5 & 15)


class AdcCommon(Peripheral):
    REGISTERS = {"CSR": (0x00, 0), "CCR": (0x08, 0)}
    BYTES = 0x100
