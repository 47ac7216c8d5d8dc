"""What a figure claims and what was measured: one row of results.json and of the report."""

from dataclasses import dataclass
from typing import Any

NO_NUMBER = "no number in the paper"


@dataclass(frozen=True)
class Check:
    """One number held against a claim.

    paper_states: the claim in short. at_most, at_least: the tolerance; with neither the number is only reported, and
    `passed` is None. reason: why this tolerance, decided before measuring.
    """

    name: str
    paper_states: str
    measured: float | int
    unit: str
    reason: str
    at_most: float | None = None
    at_least: float | None = None

    @property
    def passed(self) -> bool | None:
        """Whether the number lies within the tolerance (NaN never does); None without a tolerance."""
        if self.at_most is None and self.at_least is None:
            return None
        low = -float("inf") if self.at_least is None else self.at_least
        high = float("inf") if self.at_most is None else self.at_most
        return bool(low <= self.measured <= high)

    def to_dict(self) -> dict[str, Any]:
        """The row of results.json; a number that is not finite becomes null."""
        tolerance = {
            name: bound
            for name, bound in (("at_least", self.at_least), ("at_most", self.at_most))
            if bound is not None
        }
        return {
            "name": self.name,
            "paper_states": self.paper_states,
            "measured": number_or_none(self.measured),
            "unit": self.unit,
            "tolerance": tolerance or None,
            "tolerance_reason": self.reason,
            "pass": self.passed,
        }


def number_or_none(value: float | int) -> float | int | None:
    """For JSON, which has no NaN and no infinity."""
    return value if abs(value) < float("inf") else None


def all_passed(checks: list[Check]) -> bool:
    """No check failed; those that only report do not count."""
    return all(check.passed is not False for check in checks)
