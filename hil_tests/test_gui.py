"""The window, for real: on an X server without a screen, drawn by software."""

import json
import os
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

pytestmark = pytest.mark.real_time
ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "hil_tests" / "gui_scripts"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "host" / "python")}
WIDTH, HEIGHT = 1280, 800
# What the panels leave of the window (palpate/gui/app.py).
SCENE = (slice(0, HEIGHT), slice(290, 900))
PLOTS = (slice(0, HEIGHT), slice(900, WIDTH))
CONTROLS = (slice(0, HEIGHT), slice(0, 290))
# Shares of the scene that the body may cover: the camera stands so that it fills the middle.
BODY_SHARE = (0.15, 0.8)
# Pixels: the patch has 32 points, of a few pixels each.
PATCH_PIXELS = 100
# A line across a plot of 380 pixels is as long; the orange one, along the surface, leaves zero only in contact.
BLUE_PIXELS, ORANGE_PIXELS = 300, 100
# The button is 270 x 34, its text takes a part.
STOP_PIXELS = 2000
# A line of text in the panel, its smoothed edges left out.
TEXT_PIXELS = 60


def gui(*arguments: object, screen: bool = True, timeout_s: float = 280.0) -> subprocess.CompletedProcess[str]:
    """`palpate gui --json ...`. On board native unless it is told: these tests arm, and a board with motors may be attached."""
    words = [sys.executable, "-m", "palpate", "gui", "--json", "--board", "native", *map(str, arguments)]
    if screen:
        words = ["xvfb-run", "-a", "-s", f"-screen 0 {WIDTH}x{HEIGHT}x24", *words]
    environment = {k: v for k, v in ENVIRONMENT.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=timeout_s)


def near(image: np.ndarray, colour: tuple[float, float, float], tolerance: float) -> int:
    """Pixels of about that colour."""
    return int((np.abs(image[..., :3] - colour).max(axis=-1) < tolerance).sum())


@pytest.mark.timeout(300)
def test_touch_and_look(tmp_path: Path) -> None:
    picture = tmp_path / "gui.png"
    done = gui("scenes/demo.toml", "--script", SCRIPTS / "touch.py", "--screenshot", picture, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    numbers = json.loads(done.stdout)
    assert numbers["models_taken"] > 0 and numbers["frames"] > 10
    image = matplotlib.image.imread(picture)
    assert image.shape[:2] == (HEIGHT, WIDTH)
    scene, plots, controls = image[SCENE], image[PLOTS], image[CONTROLS]
    # The body covers a good part of the white background.
    body = (scene[..., :3].max(axis=-1) < 0.98).mean()
    assert BODY_SHARE[0] < body < BODY_SHARE[1]
    # Points of the patch: a red that nothing else has.
    red = (scene[..., 0] > 0.75) & (scene[..., 1] < 0.65) & (scene[..., 2] > 0.35) & (scene[..., 2] < 0.8)
    assert red.sum() > PATCH_PIXELS
    # Lines in the plots: blue and orange ones.
    assert near(plots, (0.12, 0.40, 0.80), 0.08) > BLUE_PIXELS
    assert near(plots, (0.90, 0.45, 0.05), 0.08) > ORANGE_PIXELS
    assert near(controls, (0.80, 0.10, 0.10), 0.05) > STOP_PIXELS  # the button of the emergency stop


@pytest.mark.timeout(300)
def test_the_displacement_has_colours(tmp_path: Path) -> None:
    done = gui("scenes/demo.toml", "--script", SCRIPTS / "colours.py", "--out", tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.timeout(300)
def test_a_body_from_a_mesh(tmp_path: Path) -> None:
    picture = tmp_path / "gui.png"
    done = gui("scenes/liver.toml", "--script", SCRIPTS / "mesh.py", "--screenshot", picture, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    body = (matplotlib.image.imread(picture)[SCENE][..., :3].max(axis=-1) < 0.98).mean()
    assert BODY_SHARE[0] < body < BODY_SHARE[1]


@pytest.mark.timeout(300)
def test_controls_by_script(tmp_path: Path) -> None:
    done = gui("scenes/demo.toml", "--script", SCRIPTS / "controls.py", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(list(tmp_path.glob("recording_*.h5"))) == 3
    assert json.loads(done.stdout)["board"] == "mps2_an386"


@pytest.mark.timeout(200)
def test_faults_of_a_can_bus(tmp_path: Path) -> None:
    picture = tmp_path / "can.png"
    done = gui(
        "scenes/press.toml", "--set", 'link.medium="canfd"', "--set", 'link.trace="tip"', "--set", "link.faults.unplugged=[{from_s=0.5, to_s=0.6}]",
        "--script", SCRIPTS / "can_faults.py",
        "--screenshot", picture, "--out", tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    numbers = json.loads(done.stdout)
    assert numbers["frames_lost_up"] > 0 and numbers["models_taken"] > 0
    image = matplotlib.image.imread(picture)
    # At the top, where nobody scrolls: mode and fault in red, what was injected in orange.
    top = image[:200, :290]
    assert near(top, (1.0, 0.45, 0.40), 0.15) > TEXT_PIXELS
    assert near(top, (1.0, 0.70, 0.30), 0.15) > TEXT_PIXELS


@pytest.mark.timeout(200)
def test_a_step_is_a_frame(tmp_path: Path) -> None:
    done = gui("scenes/demo.toml", "--size", "800x500", "--script", SCRIPTS / "frames.py", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["frames"] == 12


@pytest.mark.timeout(200)
def test_mouse_and_keys(tmp_path: Path) -> None:
    done = gui("scenes/demo.toml", "--script", SCRIPTS / "mouse.py", "--out", tmp_path)
    assert done.returncode == 0, done.stderr


def test_without_a_display_it_says_what_to_do() -> None:
    done = gui("--duration", 1, screen=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and "xvfb-run" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--size", "10x10"), "--size"),
        (("--script", "no_such_file.py"), "no_such_file.py"),
        (("--script", "README.md"), "README.md:"),
        (("--duration", "nan"), "--duration"),
        (("--duration", "0"), "--duration"),
        (("--screenshot", "picture.jpg"), "--screenshot"),
        (("no_such_scene.toml",), "no_such_scene.toml"),
        (("scenes/wave2d.toml",), "body.dimension"),
        (("--set", "contact.friction=-1"), "contact.friction"),
    ],
)
def test_bad_input_ends_with_one_line(arguments: tuple[str, ...], word: str) -> None:
    """Also where no window could be opened."""
    done = gui(*arguments, screen=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1 and word in done.stderr and "Traceback" not in done.stderr
