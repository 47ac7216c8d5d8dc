"""Choices read from bytes: what libFuzzer varies, and keeps where a choice reaches something new."""

from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


class Draw:
    """The choices of random.Random that the targets need, of a fuzzer's input. Behind its end each is the first."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def randrange(self, stop: int) -> int:
        """In [0, stop)."""
        length = max((stop - 1).bit_length() + 7, 8) // 8
        return int.from_bytes(self._take(length), "little") % stop

    def randint(self, first: int, last: int) -> int:
        """In [first, last]."""
        return first + self.randrange(last - first + 1)

    def choice(self, values: Sequence[T]) -> T:
        """One of them; there is one at least."""
        return values[self.randrange(len(values))]

    def chance(self, probability: float) -> bool:
        """True with about this probability, were the bytes random; false behind their end."""
        return self.randrange(256) > 255 - round(256 * probability)

    def rest(self) -> bytes:
        """What is left."""
        return self._take(len(self._data))

    def _take(self, length: int) -> bytes:
        part = self._data[self._at : self._at + length]
        self._at += length
        return part
