"""What is left of each rule of the fault matrix, by the case that comes closest to it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from palpate.faults.cases import CUT
from palpate.faults.rules import (
    DAMPING_TICKS,
    FADE_TICKS,
    MOTOR_CURRENT_A,
    PEAK_FORCE_N,
    ROUNDING,
    SIGN_TICKS,
    TIP_SPEED_M_S,
    Result,
)


@dataclass(frozen=True)
class Margin:
    """value, limit: those of `case`, which has the least left of all; left: limit - value."""

    rule: int
    what: str
    unit: str
    value: float
    limit: float
    left: float
    case: str


def smallest_margins(results: Sequence[Result], valid_ticks: int) -> list[Margin]:
    """Of each number that a rule limits and that a case has. results: not empty."""
    margins = []

    def add(rule: int, what: str, unit: str, limit: float | str, value_of: Callable[[Result], float | None]) -> None:
        known = []
        for result in results:
            value, most = value_of(result), result.numbers[limit] if isinstance(limit, str) else limit
            if value is not None:
                # Rounding of a limit that is just reached is nothing beyond it.
                left = 0.0 if -ROUNDING <= most - value < 0.0 else most - value
                known.append(Margin(rule, what, unit, value, most, left, result.case.name))
        if known:
            margins.append(min(known, key=lambda margin: margin.left))

    def number(name: str) -> Callable[[Result], float | None]:
        return lambda result: result.numbers[name]

    def of(name: str, wanted: Callable[[Result], bool]) -> Callable[[Result], float | None]:
        return lambda result: result.numbers[name] if wanted(result) else None

    add(1, "force", "N", PEAK_FORCE_N, number("force_N"))
    add(1, "set-point", "A", MOTOR_CURRENT_A, number("current_A"))
    add(1, "speed of the tip", "m/s", TIP_SPEED_M_S, number("speed_m_s"))
    add(2, "change of force in a tick", "N", "step_limit_N", number("step_N"))
    add(2, "from the fault that cuts to outputs off, of one that lasts a tick", "ms", 0.0,
        of("outputs_off_ticks", lambda result: result.case.kind == CUT and result.case.first_s == result.case.end_s))  # fmt: skip
    add(3, "force above that of the body, or of the same tick without the fault, and 0.5 N", "N", 0.0, number("excess_N"))
    gone = valid_ticks + FADE_TICKS

    def without_models(result: Result) -> bool:
        return result.case.silent or result.case.refused

    add(4, "from the last model to no force of it", "ms", gone, of("force_gone_ticks", without_models))
    add(4, "from silence, or the last model that counts, to outputs off", "ms", gone + DAMPING_TICKS + SIGN_TICKS,
        of("outputs_off_ticks", without_models))  # fmt: skip
    return margins
