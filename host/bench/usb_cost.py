#!/usr/bin/env python3
"""What USB costs the board: instructions of the firmware's background in QEMU (mps2_an386), beside those of the same firmware
with the same bytes on a plain byte link, in JSON. The virtual device controller is part of it; the driver of a real one takes
its place.

    python host/bench/usb_cost.py
"""

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "hil_tests"))

from board_peer import LinkCodec, Lockstep, lockstep
from usb_host import PACKET_BYTES, VENDOR_IN, VENDOR_OUT, Status, Transfer, UsbHost, usb_board

INSTRUCTIONS_PER_COUNT = 5  # 125 MIPS (-icount shift=3: 8 ns) at a clock of 25 MHz
TICKS = 400  # of each measurement: a hundred traces
SETTLING_TICKS = 50
FRAMES = 50  # from the host, of a kilobyte each
NO_PORT = 1699  # a subject that the board does not know: it takes the frame apart and drops it


def background_counts(tick: Callable[[], object], ticks: int) -> int:
    """Of the background in `ticks` ticks, without the interrupts in it. A frame tells of the tick before it."""
    return sum(int(frame["busy_count"]) - int(frame["tick_count"]) for frame in (tick() for _ in range(ticks)))


def frames() -> list[bytes]:
    payload = bytes(1 + i % 251 for i in range(1000))
    return [LinkCodec.encode(NO_PORT, number, payload) for number in range(FRAMES)]


def on_bytes(board: Lockstep) -> dict[str, int]:
    """Counts without anything from the host, and with the frames."""
    board.run(SETTLING_TICKS)
    idle = background_counts(board.tick, TICKS)
    rest = frames()
    # At the pace of the USB host.
    busy = background_counts(lambda: board.tick(link=rest.pop() if rest and board.next_tick % 3 == 0 else b""), TICKS)
    assert not rest
    return {"idle": idle, "receiving": busy}


def on_usb(host: UsbHost) -> dict[str, int]:
    """The same, and before it those of a bus that nobody asks anything on."""
    host.configure()
    host.run(SETTLING_TICKS)
    silent = background_counts(host.tick, TICKS)
    read = {"packets": 0, "bytes": 0}

    def ask(done: Transfer | None = None) -> None:
        if done is not None:
            assert done.status is Status.DONE
            read["bytes"] += len(done.received)
            read["packets"] += len(done.received) // PACKET_BYTES + 1
        host.submit(Transfer(VENDOR_IN, length=16384, on_done=ask))

    ask()
    host.run(SETTLING_TICKS)
    read["packets"] = read["bytes"] = 0
    idle = background_counts(host.tick, TICKS)
    sent = dict(read)
    rest = frames()
    out = [host.submit(Transfer(VENDOR_OUT, data=one)) for one in rest]
    busy = background_counts(host.tick, TICKS)
    assert all(one.status is Status.DONE for one in out)
    return {"silent": silent, "idle": idle, "receiving": busy, "packets_read": sent["packets"], "bytes_read": sent["bytes"]}


def measure(folder: Path) -> dict[str, float]:
    """In instructions."""
    with lockstep("mps2", folder / "bytes") as board:
        plain = on_bytes(board)
    with usb_board("mps2_usb", folder / "usb") as host:
        usb = on_usb(host)
    received = sum(map(len, frames()))
    sending = usb["idle"] - usb["silent"]
    receiving = (usb["receiving"] - usb["idle"]) - (plain["receiving"] - plain["idle"])

    def instructions(counts: float, things: float) -> float:
        return round(INSTRUCTIONS_PER_COUNT * counts / things, 1)

    return {
        "background_per_tick_on_bytes": instructions(plain["idle"], TICKS),
        "background_per_tick_nobody_reads": instructions(usb["silent"], TICKS),
        "background_per_tick_traces_read": instructions(usb["idle"], TICKS),
        "per_packet_sent": instructions(sending, usb["packets_read"]),
        "per_byte_sent": instructions(sending, usb["bytes_read"]),
        "per_byte_received_on_bytes": instructions(plain["receiving"] - plain["idle"], received),
        "more_per_byte_received": instructions(receiving, received),
        "more_per_packet_received": instructions(receiving, -(-received // PACKET_BYTES)),
    }


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(measure(Path(folder)), indent=2))


if __name__ == "__main__":
    main()
