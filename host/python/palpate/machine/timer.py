"""Timers (RM0440, 29 and 30): counters of the clock, with update interrupt and trigger output, and quadrature counters with capture of the
count at an index."""

from collections.abc import Callable

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_ENABLE, _UPDATE, _URS = 1 << 0, 1 << 0, 1 << 2
_QUADRATURE = 3  # SMCR_SMS: counts on both edges of both inputs
_UPDATE_TRIGGERS = 2  # CR2_MMS
_SLAVE_MODE = 7 | 1 << 16


class BasicTimer(Peripheral):
    """interrupt: of its update. bits: of its counter. on_update is called with each update, on_trigger when its trigger
    output rises."""

    REGISTERS = {
        "CR1": (0x00, 0),
        "CR2": (0x04, 0),
        "DIER": (0x0C, 0),
        "SR": (0x10, 0),
        "EGR": (0x14, 0),
        "CNT": (0x24, 0),
        "PSC": (0x28, 0),
        "ARR": (0x2C, 0),
    }

    def __init__(self, chip: Chip, name: str, base: int, interrupt: int, bits: int) -> None:
        self._interrupt, self._mask = interrupt, (1 << bits) - 1
        self.on_update: Callable[[], None] = lambda: None
        self.on_trigger: Callable[[], None] = lambda: None
        self.position = 0
        self._generation = 0
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        self.value["ARR"] = self._mask
        self._generation += 1
        self._prescaler = 0  # the one in use: it changes with an update
        self._zero = 0  # cycle in which CNT was 0
        self._position_at_zero = 0
        self.chip.set_line(self._interrupt, False)

    @property
    def is_running(self) -> bool:
        return bool(self.value["CR1"] & _ENABLE)

    @property
    def _is_quadrature(self) -> bool:
        return False

    @property
    def period_cycles(self) -> int:
        return (self._prescaler + 1) * (self.value["ARR"] + 1)

    def read_CNT(self) -> int:
        if not self.is_running:
            return self.value["CNT"]
        if self._is_quadrature:
            return (self.position - self._position_at_zero) % (self.value["ARR"] + 1)
        return (self.chip.cycle - self._zero) // (self._prescaler + 1) % (self.value["ARR"] + 1)

    def write_CNT(self, value: int) -> None:
        self.value["CNT"] = value & self._mask
        self._zero = self.chip.cycle - self.value["CNT"] * (self._prescaler + 1)
        self._position_at_zero = self.position - self.value["CNT"]
        self._schedule()

    def write_CR1(self, value: int) -> None:
        was_running, self.value["CR1"] = self.is_running, value
        if self.is_running and not was_running:
            self.write_CNT(self.value["CNT"])
        elif was_running and not self.is_running:
            self.value["CR1"] |= _ENABLE
            count = self.read_CNT()
            self.value["CR1"] = value
            self.value["CNT"] = count
            self._generation += 1

    def write_ARR(self, value: int) -> None:
        self.value["ARR"] = value & self._mask
        self._schedule()

    def write_DIER(self, value: int) -> None:
        if value & ~_UPDATE:
            raise MachineError(f"{self.name}_DIER = {value:#x}: only the update is modelled")
        self.value["DIER"] = value
        self._request()

    def write_SR(self, value: int) -> None:
        self.value["SR"] &= value
        self._request()

    def write_EGR(self, value: int) -> None:
        if value & _UPDATE:
            self._prescaler = self.value["PSC"]
            self.write_CNT(0)
            if not self.value["CR1"] & _URS:
                self.value["SR"] |= _UPDATE
                self._request()

    def _request(self) -> None:
        self.chip.set_line(self._interrupt, bool(self.value["SR"] & self.value["DIER"] & _UPDATE))

    def _schedule(self) -> None:
        self._generation += 1
        if not self.is_running or self._is_quadrature:
            return
        if not self.value["DIER"] & _UPDATE and self.value["CR2"] >> 4 & 7 != _UPDATE_TRIGGERS:
            return  # nobody wants to know
        generation = self._generation
        since = (self.chip.cycle - self._zero) % self.period_cycles
        self.chip.after(self.period_cycles - since, lambda: self._update(generation))

    def _update(self, generation: int) -> None:
        if generation != self._generation:
            return
        self._prescaler = self.value["PSC"]
        self.value["SR"] |= _UPDATE
        self._request()
        self.on_update()
        if self.value["CR2"] >> 4 & 7 == _UPDATE_TRIGGERS:
            self.on_trigger()
        self._schedule()


class Timer(BasicTimer):
    """Counts time or, set so, what a quadrature encoder turns: `position`, in counts."""

    REGISTERS = BasicTimer.REGISTERS | {
        "SMCR": (0x08, 0),
        "CCMR1": (0x18, 0),
        "CCMR2": (0x1C, 0),
        "CCER": (0x20, 0),
        "CCR1": (0x34, 0),
        "CCR2": (0x38, 0),
        "CCR3": (0x3C, 0),
        "CCR4": (0x40, 0),
    }

    @property
    def _is_quadrature(self) -> bool:
        mode = self.value["SMCR"] & _SLAVE_MODE
        if mode not in (0, _QUADRATURE):
            raise MachineError(f"{self.name}_SMCR: SMS = {mode:#x} is not modelled")
        return mode == _QUADRATURE

    def index(self, channel: int) -> None:
        """An edge at the input of a capture channel (1 to 4): its register takes the count."""
        if self.value["CCER"] >> 4 * (channel - 1) & 1:
            self.value[f"CCR{channel}"] = self.read_CNT()
            self.value["SR"] |= 1 << channel

    def read_CCR3(self) -> int:
        self.value["SR"] &= ~(1 << 3)
        return self.value["CCR3"]

    def read_CCR4(self) -> int:
        self.value["SR"] &= ~(1 << 4)
        return self.value["CCR4"]
