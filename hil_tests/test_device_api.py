"""The C library with programs in C, against `palpate device`: firmware on its board with arm and hand, at a pseudo-terminal."""

import contextlib
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from board_peer import BUILD_HOST, REPOSITORY

import palpate
from palpate.scene import make_scene
from palpate.virtual_device import PathPlayer

pytestmark = pytest.mark.real_time
LIBRARY = BUILD_HOST / "host/device_api"
WALL = LIBRARY / "example_wall"
# As example_wall.c has them.
FLOOR_M, STIFFNESS_N_M = -0.005, 600.0
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(REPOSITORY / "host/python")}
# Longer than anything takes, even on a busy machine.
HANGS_S = 120.0


def _may_be_interrupted() -> None:
    """What a shell starts in the background ignores it, and so does all that it starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextlib.contextmanager
def device_command(*arguments: str, stream: str = "stdout") -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The running command, and the address, which comes on the first line of that stream."""
    command = [sys.executable, "-m", "palpate", "device", *arguments]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT, preexec_fn=_may_be_interrupted
    ) as process:
        try:
            yield process, getattr(process, stream).readline().strip()
        finally:
            process.kill()


def wall(address: str, seconds: float) -> subprocess.CompletedProcess[str]:
    return subprocess.run([WALL, address, str(seconds)], capture_output=True, text=True, timeout=HANGS_S)


@pytest.mark.parametrize("board", ["native", "mps2_an386"])
def test_the_example_renders_a_floor(board):
    """The hand means to be 5 mm below the floor: it stays above that, held by the floor's spring."""
    path = [{"time_s": 0.0, "position_m": [0.0, 0.0, 0.0]}]
    scene = make_scene({"body": {"nodes": [2, 2, 2], "fixed_faces": ["z-"]}, "path": {"waypoints": path}}, name="floor")
    with palpate.VirtualDevice(scene, board) as device:
        assert device.guide_hand([0.0, 0.0, FLOOR_M - 0.005])
        done = wall(device.address, 2.0)
        state = device.state
    assert done.returncode == 0, done.stderr
    told = re.search(r"at most ([0-9.]+) mm deep, ([0-9.]+) N", done.stdout)
    assert told, done.stdout
    depth_m, force_N = 1e-3 * float(told[1]), float(told[2])
    assert 0.0 < depth_m < 0.005
    assert 0.5 < force_N < 5.0
    # A spring and a damper of 1 N s/m, which a hand that arrives with 0.2 m/s at most meets.
    assert force_N == pytest.approx(STIFFNESS_N_M * depth_m, abs=0.2 + 0.05)
    # The example has closed its device: nothing is left switched on.
    assert not state.outputs_on
    assert state.faults == 0


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_the_command_says_its_address_and_ends_when_interrupted(end):
    with device_command() as (process, address):
        assert address.startswith("serial:/dev/")
        assert wall(address, 0.2).returncode == 0
        process.send_signal(end)
        out, err = process.communicate(timeout=HANGS_S)
        assert process.returncode == 0, err
        assert "servo ticks, mode" in out


def test_the_command_over_udp_as_json():
    command = ("--link", "udp-listen:127.0.0.1:0", "--duration", "3", "--play", "--json")
    with device_command(*command, stream="stderr") as (process, address):
        assert address.startswith("udp:127.0.0.1:")
        done = wall(address, 0.2)
        out, _ = process.communicate(timeout=HANGS_S)
        assert done.returncode == 0, done.stderr
        numbers = json.loads(out)
        assert process.returncode == 0
        assert numbers["address"] == address
        assert numbers["bytes_received"] > 0 and numbers["ticks"] > 0


@pytest.mark.parametrize(("arguments", "text"), [
    (["--link", "tin-can:"], "offered at pty:, udp-listen:[HOST:]PORT"),
    (["--link", "udp:127.0.0.1:5760"], "offered at pty:, udp-listen:[HOST:]PORT"),
    (["--set", "link.medium=usb"], "--set link.medium: a device takes no [link]"),
    (["--duration", "-1"], "--duration = -1"),
    (["nowhere.toml"], "nowhere.toml"),
])  # fmt: skip
def test_bad_input_is_told_on_one_line(arguments, text):
    done = subprocess.run(
        [sys.executable, "-m", "palpate", "device", *arguments], capture_output=True, text=True, env=ENVIRONMENT, timeout=HANGS_S
    )
    assert done.returncode == 2
    assert text in done.stderr and done.stderr.count("\n") == 1


def test_the_hand_can_be_led_and_the_tip_follows():
    scene = make_scene({"body": {"nodes": [2, 2, 2], "fixed_faces": ["z-"]}}, name="lead")
    target_m = np.array([0.01, 0.0, 0.005])
    with palpate.VirtualDevice(scene) as device:
        assert not device.guide_hand([1.0, 0.0, 0.0])  # out of the arm's reach
        assert device.guide_hand(target_m)
        # The arm's weight, which nobody carries while outputs are off, pulls the hand down by millimetres.
        while np.linalg.norm(device.state.tip_m - target_m) > 5e-3:
            assert device.state.tick < 60_000


def test_a_path_is_played_again_and_again():
    calls = []

    class Device:
        def play_path(self):
            calls.append("play")

        def guide_hand(self, target_m):
            calls.append(tuple(target_m))

    # 0.1 m back: 0.4 s and 1 s of rest, behind 2 s of path.
    player = PathPlayer({"time_s": [0.0, 2.0], "position_m": [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]})
    told = {}
    for tick in range(5000, 9000, 200):
        player.step(Device(), tick)
        told[tick] = list(calls)
        calls.clear()
    assert {tick: what for tick, what in told.items() if what} == {5000: ["play"], 7200: [(0.0, 0.0, 0.0)], 8400: ["play"]}


def test_only_the_interface_is_exported():
    symbols = subprocess.run(
        ["nm", "-D", "--defined-only", "--format=posix", LIBRARY / "libpalpate_device.so"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    names = {line.split()[0] for line in symbols.splitlines()}
    header = (REPOSITORY / "host/device_api/palpate_device.h").read_text()
    declared = set(re.findall(r"^(?:palpate_result|void|const char ?\*)\s*(palpate_device_\w+)\(", header, re.MULTILINE))
    assert names == declared and len(declared) == 11


def test_it_installs_and_a_program_builds_against_it(tmp_path: pathlib.Path):
    subprocess.run(
        ["cmake", "--install", str(BUILD_HOST), "--component", "device", "--prefix", str(tmp_path)], check=True, capture_output=True
    )
    pc = (tmp_path / "lib/pkgconfig/palpate_device.pc").read_text()
    assert f"Version: {palpate.__version__}" in pc
    source = tmp_path / "who.c"
    source.write_text(
        '#include <palpate_device.h>\n#include <stdio.h>\nint main(void) {\n  palpate_device *device;\n'
        '  if (palpate_device_open("serial:/nowhere", &device) == PALPATE_OK) return 1;\n'
        "  puts(palpate_device_error(NULL));\n  return 0;\n}\n"
    )
    flags = [f"-I{tmp_path}/include", f"-L{tmp_path}/lib", "-lpalpate_device", f"-Wl,-rpath,{tmp_path}/lib"]
    for compiler in (["gcc", "-std=c99"], ["g++", "-std=c++11", "-x", "c++"]):
        subprocess.run([*compiler, "-Wall", "-Wextra", "-Wpedantic", "-Werror", str(source), "-o", str(tmp_path / "who"), *flags],
                       check=True)  # fmt: skip
        done = subprocess.run([tmp_path / "who"], capture_output=True, text=True, timeout=HANGS_S)
        assert done.returncode == 0
        assert "serial:/nowhere: No such file" in done.stdout
