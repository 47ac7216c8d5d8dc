"""A calibration under way: the board, what it measures, and how the operator is asked."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from palpate.board_link import BoardLink
from palpate.body import Floats
from palpate.calibration.fit import JointFit

# Called again and again while the operator is waited for.
Drive = Callable[[], object]


class StepError(RuntimeError):
    """Why a step has failed."""


@dataclass(frozen=True)
class Sample:
    """Of one tick (the register arm.sample), each (3,)."""

    time_s: float
    joint_rad: Floats
    joint_rad_s: Floats
    setpoint_A: Floats
    measured_A: Floats


@dataclass
class Sweep:
    """One joint moved by its motor, the others held. (n,) and (n, 3)."""

    joint: int
    time_s: Floats
    joint_rad: Floats
    setpoint_A: Floats
    measured_A: Floats


@dataclass
class Calibration:
    """A calibration under way: the board, and how the operator is asked. `ask(key, text, drive)` returns when the operator has been told, and is
    ready; until then it calls `drive`, where there is one, without a pause of more than 10 ms: the motors are on and fed by it. Keys are the
    joints' names and those of docs/calibration.md."""

    board: BoardLink
    ask: Callable[[str, str, Drive | None], None]
    patience_s: float = 30.0
    sweeps: list[Sweep] = field(default_factory=list)
    fits: list[JointFit] = field(default_factory=list)

    def sample(self) -> Sample:
        register = self.board.read_register("arm.sample")
        rows = np.array(register.values).reshape(4, 3)
        return Sample(register.time_s, *rows)

    def counts(self) -> Floats:
        return np.array(self.board.read_register("encoder.count").values, np.float64)

    def require_idle(self) -> None:
        state = self.board.state()
        if state.mode != "idle":
            raise StepError(f"the board is in mode {state.mode} with faults {state.faults:#x}: must be idle (docs/safety.md)")

    def write(self, name: str, values: Floats) -> list[float]:
        """Writes and reads back."""
        self.board.write_register(name, values)
        return list(self.board.read_register(name).values)
