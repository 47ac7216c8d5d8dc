"""Which points nothing else beats."""

import math
from collections.abc import Sequence


def dominated(points: Sequence[Sequence[float | None]]) -> list[bool]:
    """Of each point: is there another with no number larger and at least one smaller? All numbers are to be small; None
    and what is not finite count as infinitely large. Equal points do not dominate each other."""
    numbers = [
        tuple(math.inf if value is None or not math.isfinite(value) else value for value in point) for point in points
    ]

    def beats(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
        return all(x <= y for x, y in zip(a, b, strict=True)) and any(x < y for x, y in zip(a, b, strict=True))

    return [any(beats(other, point) for other in numbers) for point in numbers]
