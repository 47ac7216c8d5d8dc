"""The NUCLEO-G474RE with amplifiers, encoders and emergency-stop chain, as boards/nucleo_g474re is wired (docs/hardware.md)."""

import struct
from collections.abc import Sequence

from palpate.machine.part import Image
from palpate.machine.stm32g474 import CLOCK_Hz, Stm32g474

_ENABLE = ("B", 1)
_EMERGENCY_STOP = ("B", 14)
_ENCODERS = ("TIM2", "TIM3", "TIM4")
_SERVO_TIMER, _SERVO_EXCEPTION = "TIM7", 16 + 55
_FIRST_MONITOR = 6  # input of ADC1
CODES = 4096
# Of an ideal amplifier and its monitor: 3.3 V are so many amperes, and half of it is none.
SETPOINT_RANGE_A, MONITOR_RANGE_A = 16.0, 24.0
TICK_CYCLES = CLOCK_Hz // 1000
# What the last tick before a reset leaves: firmware/core/kept_tick.hpp.
_KEPT, _KEPT_TICK_WORDS, _KEPT_SEED = "palpate_kept_tick", 9, 0x4B455054


class Nucleo:
    """A board with power on. Time passes in run_tick() only."""

    def __init__(self, image: Image) -> None:
        self.chip = chip = Stm32g474(image)
        self._monitor_A = [0.0, 0.0, 0.0]
        self._tick_is_due = self._tick_is_done = False
        chip.adc.input = self._monitor_code
        chip.timer[_SERVO_TIMER].on_update = self._on_update
        chip.core.on_return = self._on_return
        self.set_emergency_stop(False)

    def _on_update(self) -> None:
        self._tick_is_due = True
        self.chip.core.look_again()

    def _on_return(self, exception: int) -> None:
        self._tick_is_done |= exception == _SERVO_EXCEPTION

    def _monitor_code(self, channel: int) -> int:
        current_A = self._monitor_A[channel - _FIRST_MONITOR]
        return min(max(round(CODES * (0.5 + current_A / MONITOR_RANGE_A)), 0), CODES - 1)

    # Pins

    def set_encoders(self, counts: Sequence[int]) -> None:
        """Positions of the three joints' encoders."""
        for name, count in zip(_ENCODERS, counts, strict=True):
            self.chip.timer[name].position = count

    def set_monitors(self, current_A: Sequence[float]) -> None:
        """Currents in the motors."""
        self._monitor_A = list(current_A)

    def set_emergency_stop(self, is_open: bool) -> None:
        """The chain: closed, it is a wire to ground."""
        port, pin = _EMERGENCY_STOP
        self.chip.gpio[port].outside[pin] = None if is_open else False

    def set_supply_low(self, is_low: bool) -> None:
        """The part's supply: below the highest threshold of its detector, or well above."""
        self.chip.pwr.is_low = is_low

    @property
    def amplifiers_on(self) -> bool:
        """A pin that nobody drives is low: it has a resistor to ground."""
        port, pin = _ENABLE
        return self.chip.gpio[port].driven(pin) is True

    @property
    def setpoint_A(self) -> list[float]:
        """What the amplifiers are told, on or off; 0 V, all it can be below mid-scale, where a channel is off."""
        codes = (self.chip.dac["DAC1"].code(1), self.chip.dac["DAC1"].code(2), self.chip.dac["DAC2"].code(1))
        return [SETPOINT_RANGE_A * ((code or 0) / CODES - 0.5) for code in codes]

    def leave_cold_motors(self) -> None:
        """Before the first cycle: RAM as a reset leaves it that came when nothing was latched and the motors were cold. Power that comes on leaves none,
        and the board takes its motors for hot (docs/safety.md, "Heat")."""
        words = [0] * _KEPT_TICK_WORDS
        check = _KEPT_SEED
        for word in words:
            check = (check << 5 | check >> 27) & 0xFFFFFFFF ^ word
        self.chip.core.store(self.chip.image.symbols[_KEPT], struct.pack(f"<{1 + len(words)}I", check, *words))

    # Time

    def run_to_tick(self, limit_cycles: int) -> bool:
        """Up to the next tick of the servo, before its interrupt; false: none came in that time."""
        self._tick_is_due = False
        return self.chip.run(lambda: self._tick_is_due, limit_cycles)

    def run_tick(self) -> bool:
        """The servo's interrupt, which is due, to its end; false: it does not end within a tick, or the part was reset."""
        self._tick_is_done = self._tick_is_due = False
        resets = self.chip.resets
        self.chip.run(lambda: self._tick_is_done or self._tick_is_due or self.chip.resets != resets, TICK_CYCLES)
        return self._tick_is_done
