"""A host's process that is stopped, resumed and killed, beside a board that goes on: what no run in virtual time can show."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_live import DEADLINE_S, SCENES, SMALL, wait

from palpate.live import Live
from palpate.scene import load_scene
from palpate.virtual_device import VirtualDevice

pytestmark = pytest.mark.real_time
ROOT = Path(__file__).resolve().parent.parent
ABOVE_M, PRESSED_M = [-0.005, 0.0, -0.018], [-0.005, 0.0, -0.024]
IDLE = 1
# Arms and goes on until it is killed. Its first argument is the link, the others are a scene and its keys.
HOST = """
import json, pathlib, sys, time
from palpate.live import Live
from palpate.scene import load_scene
with Live(load_scene(pathlib.Path(sys.argv[2]), json.loads(sys.argv[3])), sys.argv[1]) as live:
    armed = False
    while live.poll():
        if not armed and live.status["board_mode"] == 1:
            live.arm()
            armed = True
        time.sleep(0.02)
"""


def until(done: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    latest_s = time.monotonic() + DEADLINE_S
    while not done():
        assert process.poll() is None, "the host has ended"
        assert time.monotonic() < latest_s
        time.sleep(0.002)


def test_a_host_that_is_stopped_goes_on_and_one_that_is_killed_is_not_followed_by_the_next() -> None:
    with VirtualDevice(load_scene(SCENES / "demo.toml", SMALL)) as device:
        host = subprocess.Popen(
            [sys.executable, "-c", HOST, device.address, str(SCENES / "demo.toml"), json.dumps(SMALL)],
            env={**os.environ, "PYTHONPATH": str(ROOT / "host/python")},
        )
        try:
            device.guide_hand(ABOVE_M)
            until(lambda: device.state.mode == "render", host)
            device.guide_hand(PRESSED_M)
            until(lambda: float(np.linalg.norm(device.state.force_N)) > 0.3, host)

            host.send_signal(signal.SIGSTOP)
            until(lambda: device.state.mode == "suspended", host)
            assert not device.state.outputs_on and not np.any(device.state.force_N) and device.state.faults == 0
            host.send_signal(signal.SIGCONT)
            until(lambda: device.state.mode == "render", host)
            # By itself, and it is felt again: drawn in at first, so the hand comes anew.
            device.guide_hand(ABOVE_M)
            until(lambda: float(np.linalg.norm(device.state.force_N)) < 0.1, host)
            device.guide_hand(PRESSED_M)
            until(lambda: float(np.linalg.norm(device.state.force_N)) > 0.3, host)

            host.kill()
            host.wait(DEADLINE_S)
            latest_s = time.monotonic() + DEADLINE_S
            while device.state.mode == "render":
                assert time.monotonic() < latest_s
                time.sleep(0.002)
            assert device.state.mode == "suspended" and not device.state.outputs_on
            # Another process has not armed: it ends what the one before had begun.
            with Live(load_scene(SCENES / "demo.toml", SMALL), device.address) as live:
                wait(live, lambda: live.status["board_mode"] == IDLE)
                assert not device.state.outputs_on
        finally:
            host.kill()
            host.wait()
