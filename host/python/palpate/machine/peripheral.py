"""What all register models have in common."""

from collections.abc import Callable
from typing import ClassVar, Protocol


class MachineError(RuntimeError):
    """The firmware did something that no model knows: an access to a register that is not modelled, a wrong width, or a
    state that the part does not define."""


class Chip(Protocol):
    """What a peripheral may ask of the rest."""

    @property
    def cycle(self) -> int: ...  # of the processor's clock, since power came on
    def after(self, cycles: int, action: Callable[[], None]) -> None: ...  # calls it that much later
    def set_line(self, interrupt: int, level: bool) -> None: ...  # its interrupt request


class Responder(Protocol):
    """What answers loads and stores of a range of addresses."""

    @property
    def name(self) -> str: ...
    @property
    def base(self) -> int: ...
    @property
    def BYTES(self) -> int: ...
    def read(self, offset: int, size: int) -> int: ...
    def write(self, offset: int, size: int, value: int) -> None: ...


class Peripheral:
    """Registers at an address. A subclass lists them, name -> (offset, reset value), and may have methods read_NAME() ->
    int and write_NAME(value); without them a register keeps what is written."""

    REGISTERS: ClassVar[dict[str, tuple[int, int]]] = {}
    BYTES: ClassVar[int] = 0x400  # of the address range that it answers

    def __init__(self, chip: Chip, name: str, base: int) -> None:
        self.chip, self.name, self.base = chip, name, base
        self.names = {offset: register for register, (offset, _) in self.REGISTERS.items()}
        self.readers = {n: getattr(self, f"read_{n}") for n in self.REGISTERS if hasattr(self, f"read_{n}")}
        self.writers = {n: getattr(self, f"write_{n}") for n in self.REGISTERS if hasattr(self, f"write_{n}")}
        self.value: dict[str, int] = {}
        self.reset()

    def reset(self) -> None:
        """As after a reset of the part."""
        self.value = {register: reset for register, (_, reset) in self.REGISTERS.items()}

    def _register(self, offset: int, how: str) -> str:
        register = self.names.get(offset & ~3)
        if register is None:
            raise MachineError(f"{how} {self.name} + {offset:#x} ({self.base + offset:#010x}): no model has this register")
        return register

    def read(self, offset: int, size: int) -> int:
        """A load of `size` bytes."""
        register = self._register(offset, "load from")
        reader = self.readers.get(register)
        word: int = reader() if reader else self.value[register]
        return word >> 8 * (offset & 3) & (1 << 8 * size) - 1

    def write(self, offset: int, size: int, value: int) -> None:
        """A store of `size` bytes; of less than a word, the rest stays as it is."""
        register = self._register(offset, "store to")
        if size != 4:
            shift = 8 * (offset & 3)
            mask = (1 << 8 * size) - 1 << shift
            value = self.value[register] & ~mask | value << shift & mask
        writer = self.writers.get(register)
        if writer:
            writer(value)
        else:
            self.value[register] = value
