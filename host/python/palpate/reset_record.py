"""What a board knows of its last reset: its register reset.record in words (docs/protocol.md, "Registers")."""

from collections.abc import Sequence
from dataclasses import dataclass

from palpate.injected import fault_names

REGISTER = "reset.record"
WORDS = 10
# Bits of RCC_CSR (RM0440, 7.4.30), by board. Any reset of the part's own pulls its pin, too.
CAUSES = {
    "nucleo_g474re": {31: "low power", 30: "window watchdog", 29: "watchdog", 28: "software", 27: "power was low or off", 26: "reset pin", 25: "option bytes"},
}  # fmt: skip
# boards/cortex_m/fault_record.hpp
REASONS = {
    1: "processor fault", 2: "unexpected interrupt", 3: "clock lost", 4: "a peripheral was not ready", 5: "background stuck", 6: "flash unreadable",
}  # fmt: skip
_PROCESSOR = 1
# What the reason's detail is, and how it is written.
_DETAILS = {2: "vector {}", 4: "waiting for register {:#010x}", 5: "at tick {:,}", 6: "at {:#x}"}


@dataclass(frozen=True)
class ResetRecord:
    """causes: of the last reset, by the part's flags. reason, detail, program_counter, cfsr, hfsr, bfar: of the fault before it, 0 where there was none.
    tick, faults: of the last tick before it (bits of docs/safety.md), 0 where the memory was lost."""

    board: str
    causes: int
    reason: int
    detail: int
    program_counter: int
    cfsr: int
    hfsr: int
    bfar: int
    failed_starts: int
    tick: int
    faults: int

    @classmethod
    def of(cls, board: str, values: Sequence[float]) -> "ResetRecord":
        """Of the register's values, signed 32-bit integers. Raises ValueError for another number of them."""
        if len(values) != WORDS:
            raise ValueError(f"register {REGISTER} of {board}: {len(values)} values: must be {WORDS}; is it another version?")
        return cls(board, *(int(value) & 0xFFFFFFFF for value in values))

    @property
    def cause(self) -> str:
        """In words; the flags themselves of a part that is not known here, or that has none set."""
        known = [text for bit, text in CAUSES.get(self.board, {}).items() if self.causes >> bit & 1]
        return ", ".join(known) or f"flags {self.causes:#010x}"

    @property
    def fault(self) -> str:
        """What the firmware has recorded before it, in words; empty: nothing."""
        if self.reason == 0:
            return f"{self.failed_starts} starts failed" if self.failed_starts else ""
        text = REASONS.get(self.reason, f"reason {self.reason}")
        if self.reason == _PROCESSOR:
            text += f" at {self.program_counter:#010x}, CFSR {self.cfsr:#x}, HFSR {self.hfsr:#x}, BFAR {self.bfar:#x}"
        elif self.reason in _DETAILS:
            text += ", " + _DETAILS[self.reason].format(self.detail)
        return text + (f"; {self.failed_starts} failed starts in a row" if self.failed_starts else "")

    @property
    def before(self) -> str:
        """The last tick before it, in words."""
        if self.tick == 0:
            return "nothing is left of before: memory was without power"
        names = ", ".join(name.replace("_", " ") for name in fault_names(self.faults))
        return f"last tick {self.tick:,}, {f'latched: {names}' if names else 'no fault latched'}"
