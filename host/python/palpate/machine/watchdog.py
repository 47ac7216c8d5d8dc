"""The independent watchdog (RM0440, 42): once started, it resets the part unless it is fed."""

from collections.abc import Callable

from palpate.machine.peripheral import Chip, MachineError, Peripheral

_START, _UNLOCK, _FEED = 0xCCCC, 0x5555, 0xAAAA
_LSI_Hz = 32_000


class Watchdog(Peripheral):
    """bite is called when its time is over. clock_Hz: of the processor, in whose cycles time is counted."""

    REGISTERS = {"KR": (0x00, 0), "PR": (0x04, 0), "RLR": (0x08, 0xFFF), "SR": (0x0C, 0), "WINR": (0x10, 0xFFF)}

    def __init__(self, chip: Chip, name: str, base: int, clock_Hz: int) -> None:
        self._clock_Hz = clock_Hz
        self.bite: Callable[[], None] = lambda: None
        self._generation = 0
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        self._generation += 1
        self.is_running = self._is_unlocked = False

    @property
    def timeout_cycles(self) -> int:
        divider = 4 << min(self.value["PR"] & 7, 6)
        return (self.value["RLR"] + 1) * divider * self._clock_Hz // _LSI_Hz

    def write_KR(self, value: int) -> None:
        if value == _START:
            self.is_running = True
            self._feed()
        elif value == _FEED:
            self._is_unlocked = False
            if self.is_running:
                self._feed()
        elif value == _UNLOCK:
            self._is_unlocked = True
        else:
            raise MachineError(f"IWDG_KR = {value:#x}: not a key")

    def _write_locked(self, register: str, value: int) -> None:
        if not self._is_unlocked:
            raise MachineError(f"IWDG_{register} is written without its key")
        self.value[register] = value

    def write_PR(self, value: int) -> None:
        self._write_locked("PR", value)

    def write_RLR(self, value: int) -> None:
        self._write_locked("RLR", value & 0xFFF)

    def write_WINR(self, value: int) -> None:
        raise MachineError("IWDG_WINR: the window is not modelled")

    def _feed(self) -> None:
        self._generation += 1
        generation = self._generation
        self.chip.after(self.timeout_cycles, lambda: self._over(generation))

    def _over(self, generation: int) -> None:
        if generation == self._generation:
            self.bite()
