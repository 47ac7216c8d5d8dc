"""Ports of pins (RM0440, 9)."""

from collections.abc import Callable
from typing import ClassVar

from palpate.machine.peripheral import Chip, Peripheral

INPUT, OUTPUT, ALTERNATE, ANALOG = range(4)
_PULL_UP = 1


class Gpio(Peripheral):
    """outside[pin] is the level that something outside drives it to; None or absent: nothing."""

    # Reset values of MODER, OSPEEDR and PUPDR, of an STM32G474: the debugger's pins are in use. Of the other ports: RESET.
    RESETS: ClassVar[dict[str, tuple[int, int, int]]] = {
        "GPIOA": (0xABFFFFFF, 0x0C000000, 0x64000000),
        "GPIOB": (0xFFFFFEBF, 0x000000C0, 0x00000100),
    }
    RESET: ClassVar[tuple[int, int, int]] = (0xFFFFFFFF, 0, 0)

    REGISTERS = {
        "MODER": (0x00, 0xFFFFFFFF),
        "OTYPER": (0x04, 0),
        "OSPEEDR": (0x08, 0),
        "PUPDR": (0x0C, 0),
        "IDR": (0x10, 0),
        "ODR": (0x14, 0),
        "BSRR": (0x18, 0),
        "LCKR": (0x1C, 0),
        "AFRL": (0x20, 0),
        "AFRH": (0x24, 0),
        "BRR": (0x28, 0),
    }

    def __init__(self, chip: Chip, name: str, base: int) -> None:
        self.outside: dict[int, bool | None] = {}
        self.changed: Callable[[], None] = lambda: None  # an output, or what a pin is
        super().__init__(chip, name, base)

    def reset(self) -> None:
        super().reset()
        mode, speed, pull = self.RESETS.get(self.name, self.RESET)
        self.value |= {"MODER": mode, "OSPEEDR": speed, "PUPDR": pull}
        self.changed()

    def mode(self, pin: int) -> int:
        return self.value["MODER"] >> 2 * pin & 3

    def alternate(self, pin: int) -> int:
        """Number of the function that an ALTERNATE pin has."""
        return self.value["AFRL" if pin < 8 else "AFRH"] >> 4 * (pin & 7) & 15

    def driven(self, pin: int) -> bool | None:
        """Level that the part drives a pin to as an output; None: it does not."""
        if self.mode(pin) != OUTPUT:
            return None
        level = bool(self.value["ODR"] >> pin & 1)
        return None if level and self.value["OTYPER"] >> pin & 1 else level

    def level(self, pin: int) -> bool:
        """What is at a pin: what drives it, else its resistor, else low."""
        driven = self.driven(pin)
        if driven is None:
            driven = self.outside.get(pin)
        if driven is None:
            driven = self.value["PUPDR"] >> 2 * pin & 3 == _PULL_UP
        return driven

    def read_IDR(self) -> int:
        return sum(1 << pin for pin in range(16) if self.mode(pin) != ANALOG and self.level(pin))

    def write_MODER(self, value: int) -> None:
        self.value["MODER"] = value
        self.changed()

    def write_ODR(self, value: int) -> None:
        self.value["ODR"] = value & 0xFFFF
        self.changed()

    def write_BSRR(self, value: int) -> None:
        self.write_ODR(self.value["ODR"] & ~(value >> 16) | value & 0xFFFF)

    def write_BRR(self, value: int) -> None:
        self.write_ODR(self.value["ODR"] & ~value)


class Syscfg(Peripheral):
    REGISTERS = {"MEMRMP": (0x00, 0), "CFGR1": (0x04, 0x7C000001)}
