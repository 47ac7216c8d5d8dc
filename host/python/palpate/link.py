"""Link media in Python: what a line does to bytes in virtual time."""

from palpate import _core

MIN_BAUD, MAX_BAUD = 1200, 20_000_000


class Uart:
    """One direction of a serial line (8 data bits, no parity, 1 stop bit) in servo ticks of 1 ms: what is submitted arrives
    when a line of that speed would have brought it. Ticks given to one object never decrease (ValueError)."""

    def __init__(self, baud: int, queue_bytes: int = 1 << 20) -> None:
        if not MIN_BAUD <= baud <= MAX_BAUD:
            raise ValueError(f"baud = {baud}: must be in [{MIN_BAUD}, {MAX_BAUD}] bit/s")
        if queue_bytes < 1:
            raise ValueError(f"queue_bytes = {queue_bytes}: must be at least 1")
        self._core = _core.Uart(baud, queue_bytes)

    def submit(self, data: bytes, tick: int) -> bool:
        """Queues bytes at the beginning of a tick. False: they did not fit in the queue and are all lost, and counted."""
        return self._core.submit(data, tick)

    def deliver(self, tick: int) -> bytes:
        """Takes what has fully arrived at the beginning of a tick."""
        return self._core.deliver(tick)

    def backlog_bytes(self, tick: int) -> int:
        """Submitted and not yet fully arrived."""
        return self._core.backlog_bytes(tick)

    @property
    def bytes_per_tick(self) -> float:
        """What the line carries at most."""
        return self._core.bytes_per_tick

    @property
    def counters(self) -> dict[str, float]:
        """bytes_accepted, bytes_delivered, bytes_dropped, submissions_dropped, busy_ticks."""
        return self._core.counters
