"""The fault matrix by groups of cases: the largest of each number, and the least that was left of rule 3."""

from collections.abc import Sequence
from typing import Any

_LARGEST = ("step_N", "rise_N", "force_gone_ticks", "outputs_off_ticks", "recovery_ticks")


def by_group(cases: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each group, in the order of its first case. cases: of faults.json. Numbers that no case of a group has are None;
    frames are summed over its cases and both ways."""
    rows = []
    for group in dict.fromkeys(case["group"] for case in cases):
        of_group = [case for case in cases if case["group"] == group]

        def most(name: str, of_group: Sequence[dict[str, Any]] = of_group) -> float | None:
            return max((case[name] for case in of_group if case[name] is not None), default=None)

        rows.append(
            {
                "group": group,
                "cases": len(of_group),
                **{name: most(name) for name in _LARGEST},
                "left_N": min(-case["excess_N"] for case in of_group),
                **{kind: sum(case[f"{kind}_{way}"] for case in of_group for way in ("down", "up")) for kind in ("lost", "removed")},
            }
        )
    return rows


def closest(cases: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The case that leaves least of rule 3."""
    return max(cases, key=lambda case: float(case["excess_N"]))
