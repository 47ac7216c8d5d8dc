"""The host beside a board that runs by itself: `palpate.Live` and the window at a link of the operating system."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
from test_gui import BODY_SHARE, BLUE_PIXELS, ENVIRONMENT, HEIGHT, PATCH_PIXELS, PLOTS, ROOT, SCENE, SCRIPTS, WIDTH, near
from test_live import DEADLINE_S, RENDER, SCENES, SMALL, wait

from palpate import board_search, doctor, record
from palpate.hil import BOARDS, BoardError
from palpate.live import Live
from palpate.scene import load_scene
from palpate.virtual_device import VirtualDevice

# The top of the body is at -2 cm; the hand presses 4 mm in, goes 1 cm aside, and comes up again.
ABOVE_M, PRESSED_M, ASIDE_M = [-0.005, 0.0, -0.015], [-0.005, 0.0, -0.024], [0.005, 0.0, -0.024]
pytestmark = pytest.mark.real_time
IDLE = 1


@pytest.fixture
def device() -> Iterator[VirtualDevice]:
    """Its hand goes up and down, and aside, until the test ends."""
    ended = threading.Event()
    scene = load_scene(SCENES / "demo.toml", SMALL)

    def move() -> None:
        while not ended.wait(0.4):
            for place in (ABOVE_M, PRESSED_M, ASIDE_M):
                device.guide_hand(place)
                if ended.wait(0.6):
                    return

    with VirtualDevice(scene) as device:
        mover = threading.Thread(target=move)
        mover.start()
        try:
            yield device
        finally:
            ended.set()
            mover.join()


def test_touch_and_record_beside_a_board(device: VirtualDevice, tmp_path: Path) -> None:
    file = tmp_path / "attached.h5"
    with Live(load_scene(SCENES / "demo.toml", SMALL), device.address) as live:
        assert live.is_attached
        wait(live, lambda: live.status["board_mode"] == IDLE)
        live.arm()
        wait(live, lambda: live.status["board_mode"] == RENDER)
        live.record(file)
        wait(live, lambda: live.contact is not None and live.contact.mode != "free" and live.contact.force_N[2] < -0.3)
        contact = live.contact
        assert contact is not None
        # The body's own triangle, pressed in: its normal still points up.
        assert contact.normal[2] > 0.8
        assert device.state.outputs_on
        began = live.status["tick"]
        wait(live, lambda: live.status["tick"] > began + 500)
        assert live.picture is not None and live.picture.position_m.shape == (512, 3)
        assert live.history["model_age_s"][-1] > 0.0
        assert live.history["link_down_bytes"].sum() > 0.0
        live.stop_recording()
    # Leaving disarms.
    latest_s = time.monotonic() + DEADLINE_S
    while device.state.outputs_on:
        assert time.monotonic() < latest_s
        time.sleep(0.005)
    kept = record.load(file)
    assert np.any(kept.values["ticks/contact_mode"] > 0)
    # Counts of an arm whose tip is there: where the tip moved, so did they.
    assert np.ptp(kept.values["ticks/encoder_count"], axis=0).max() > 100


def test_a_board_that_is_not_there_is_an_error() -> None:
    with pytest.raises(BoardError, match="serial:/nowhere"), Live(load_scene(SCENES / "demo.toml", SMALL), "serial:/nowhere"):
        pass


def port(device: str, product: str | None, vid: int | None = None, pid: int | None = None) -> SimpleNamespace:
    return SimpleNamespace(device=device, product=product, vid=vid, pid=pid)


def test_ports_that_look_like_a_board_are_asked_others_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(board_search.VARIABLE, raising=False)
    ports = [
        port("/dev/ttyS0", None), port("/dev/ttyACM0", "palpate board"), port("/dev/ttyACM1", "STM32 STLink", 0x0483, 0x374E),
        port("/dev/ttyUSB0", "GPS receiver", 0x1546, 0x01A7),
    ]  # fmt: skip
    assert board_search.addresses(ports) == ["serial:/dev/ttyACM0,4000000", "serial:/dev/ttyACM1,921600"]


def test_an_attached_board_is_found_and_told(device: VirtualDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(board_search.VARIABLE, device.address)
    found = [one for one in board_search.find_boards(DEADLINE_S) if one.address == device.address]
    assert len(found) == 1 and found[0].info.board == "native"
    told = [check for check in doctor.check_boards() if check.name == f"board at {device.address}"]
    assert len(told) == 1 and told[0].ok and "native, firmware" in told[0].found
    monkeypatch.setenv(board_search.VARIABLE, "serial:/nowhere")
    assert "serial:/nowhere" not in [one.address for one in board_search.find_boards()]
    told = [check for check in doctor.check_boards() if check.name == "board at serial:/nowhere"]
    assert len(told) == 1 and not told[0].ok and not told[0].needed


def test_a_named_board_that_does_not_answer_is_an_error() -> None:
    environment = {**ENVIRONMENT, board_search.VARIABLE: "serial:/nowhere"}
    done = subprocess.run(
        [sys.executable, "-m", "palpate", "gui"], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=DEADLINE_S
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "PALPATE_LINK = serial:/nowhere" in done.stderr


def window(device: VirtualDevice, script: str, folder: Path, height: int, *more: str) -> subprocess.CompletedProcess[str]:
    words = ["xvfb-run", "-a", "-s", f"-screen 0 {WIDTH}x{height}x24", sys.executable, "-m", "palpate", "gui", "--json", "--size", f"{WIDTH}x{height}",
             str(SCENES / "demo.toml"), *(word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")),
             "--script", str(SCRIPTS / script), "--out", str(folder), *more]  # fmt: skip
    environment = {k: v for k, v in ENVIRONMENT.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment[board_search.VARIABLE] = device.address
    return subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=280)


@pytest.mark.timeout(300)
def test_the_window_finds_it_by_itself(device: VirtualDevice, tmp_path: Path) -> None:
    picture = tmp_path / "attached.png"
    done = window(device, "attached.py", tmp_path, HEIGHT, "--screenshot", str(picture))
    assert done.returncode == 0, done.stderr
    assert f"board native at {device.address}" in done.stderr
    numbers = json.loads(done.stdout)
    assert numbers["board"] == device.address and numbers["models_taken"] > 0
    image = matplotlib.image.imread(picture)
    scene, plots = image[SCENE], image[PLOTS]
    assert BODY_SHARE[0] < (scene[..., :3].max(axis=-1) < 0.98).mean() < BODY_SHARE[1]
    red = (scene[..., 0] > 0.75) & (scene[..., 1] < 0.65) & (scene[..., 2] > 0.35) & (scene[..., 2] < 0.8)
    assert red.sum() > PATCH_PIXELS
    assert near(plots, (0.12, 0.40, 0.80), 0.08) > BLUE_PIXELS


@pytest.mark.timeout(300)
def test_window_and_doctor_tell_of_a_real_boards_last_reset_and_budgets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The flashed image on models of its part, which are fast enough for it."""
    pytest.importorskip("unicorn", reason="Unicorn is not installed: ./run does it")
    if not BOARDS["nucleo_g474re"].image.exists():
        pytest.skip("the image for nucleo_g474re is not built: ./run does it")
    scene = load_scene(SCENES / "demo.toml", {**SMALL, "link.baud": 921_600, "model.builder": "hybrid"})
    with VirtualDevice(scene, "nucleo_g474re") as device:
        monkeypatch.setenv(board_search.VARIABLE, device.address)
        told = next(check for check in doctor.check_boards() if check.name == f"board at {device.address}")
        assert told.ok and "nucleo_g474re, firmware" in told.found and told.found.endswith("; last reset: power was low or off, reset pin"), told
        done = window(device, "board.py", tmp_path, 1400)
    assert done.returncode == 0, done.stderr
