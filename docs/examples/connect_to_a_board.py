"""Connect to a board: asks who it is, calibrates, arms, reads its state, disarms.

`python connect_to_a_board.py [PORT]`. Without a port it starts the firmware as a Linux process, which offers a
pseudo-terminal in its place. With real motors keep your hands off: arming switches them on (docs/safety.md).
"""

import subprocess
import sys

import palpate
from palpate.hil import BOARDS


def watch(port: str) -> None:
    """Arms the board and prints its state ten times."""
    with palpate.BoardLink(port) as board:  # disarms when the block ends, however it ends
        info = board.info()
        print(f"{info.board}, firmware {info.firmware}, up to {info.max_modes} modes at {info.tick_rate_Hz} Hz")
        while board.state().mode == "boot":
            pass
        board.calibrate()
        try:
            board.arm(patience_s=3.0)
        except palpate.BoardLinkError as error:  # the process is a board too: on a busy computer it misses deadlines
            print(f"not armed: {error}")
        for _ in range(10):
            state = board.state()
            tip_mm = "unknown" if state.tip_m is None else (1e3 * state.tip_m).round(2)
            print(f"tick {state.tick}: {state.mode}, tip at {tip_mm} mm, {state.missed_deadlines} deadlines missed")


if len(sys.argv) > 1:
    try:
        watch(sys.argv[1])
    except palpate.BoardLinkError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
else:
    command = [str(BOARDS["native"].image), "--pty"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as firmware:
        assert firmware.stdout is not None
        try:
            watch(firmware.stdout.readline().strip())
        finally:
            firmware.kill()
