"""The window: what it shows, and what its controls do. Drawing never makes the loop wait (host/session/live_loop.hpp)."""

import time
from collections import deque
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import polyscope as ps
import polyscope.imgui as psim
from numpy.typing import NDArray

from palpate import record
from palpate.body import Body
from palpate.gui.body_view import BodyView
from palpate.gui.controls import Controls
from palpate.gui.mouse_hand import MouseHand
from palpate.gui.plots import PlotPanel
from palpate.gui.settings import Settings, shown
from palpate.hil import BoardError
from palpate.live import Live
from palpate.record import RecordError
from palpate.scene import SceneError
from palpate.tip_path import TipPath

_CONTROLS_WIDTH, _PLOTS_WIDTH = 290.0, 380.0
_FRAMES = 60  # that a rate is taken from
_WINDOW = "palpate"


class App:
    """A loop and its window. Use as a context manager; `frame()` draws once. One thread: that of the window.

    A script may use everything here that has no underscore, and `live`.
    """

    def __init__(self, settings: Settings, out: Path, size: tuple[int, int] = (1280, 800)) -> None:
        self.settings = settings
        self.pending: dict[str, Any] = {}  # controls that wait for `apply`
        self.message = ""
        self.show_cone = True
        self.emergency_stop = False
        self.unplugged = False
        self.last_recording: Path | None = None
        self.hand = MouseHand()
        self.controls = Controls()
        self.plots = PlotPanel()
        self._out = out
        self._size = size
        self._stack = ExitStack()
        self._frame_s: deque[float] = deque(maxlen=_FRAMES)
        self._tick_at: deque[tuple[float, int]] = deque(maxlen=_FRAMES)
        self._shown_tick: int | None = None

    def __enter__(self) -> "App":
        live, body = self._make(self.settings, None)
        _open_window(self._size)
        self._begin(live, body)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        ps.clear_user_callback()

    # What controls and scripts do

    def open(self, file: Path) -> None:
        """Another scene, with its own values."""
        self._restart(Settings(file, self.settings.board))

    def choose_board(self, board: str) -> None:
        """The same scene on another board (`hil.BOARDS`)."""
        self._restart(Settings(self.settings.file, board, dict(self.settings.overrides)))

    def set(self, name: str, value: Any) -> None:
        """A control that counts after `apply`; names: `Settings.set`."""
        self.pending[name] = value

    def apply(self) -> None:
        """Starts anew with what `set` has changed."""
        settings = Settings(self.settings.file, self.settings.board, dict(self.settings.overrides))
        for name, value in self.pending.items():
            settings.set(name, value)
        self._restart(settings)

    def set_emergency_stop(self, is_open: bool) -> None:
        """Opens the chain of the emergency stop and says STOP over the link as well, or closes the chain."""
        self.emergency_stop = is_open
        self.live.set_emergency_stop(is_open)
        if is_open:
            self.live.command("stop")

    def set_unplugged(self, unplugged: bool) -> None:
        """The link's cable."""
        self.unplugged = unplugged
        self.live.set_unplugged(unplugged)

    def guide_hand(self, target_m: NDArray[np.float64]) -> None:
        """Where the hand shall go, in the device frame."""
        if self.live.guide_hand(target_m):
            self.hand.target_m = target_m
            self.message = ""
        else:
            self.message = "The arm does not reach further."

    def play_path(self) -> None:
        """The scene's, or the recorded one after `replay_last`; the mouse is no longer the hand."""
        self.hand.enable(False)
        self.live.play_path()

    def record(self) -> None:
        """Into a new file in the folder for results."""
        file = self._out / f"recording_{datetime.now():%Y%m%d_%H%M%S}.h5"
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            self.live.record(file)
        except OSError as error:
            self.message = f"{file}: {error.strerror}"

    def stop_recording(self) -> None:
        """Closes the file."""
        file = self.live.recording
        try:
            self.live.stop_recording()
            self.last_recording = file
        except RecordError as error:
            self.message = str(error)

    def replay_last(self) -> None:
        """A new start whose hand goes where it meant to be in the last recording."""
        assert self.last_recording is not None
        try:
            values = record.load(self.last_recording).values
        except RecordError as error:
            self.message = str(error)
            return
        time_s = (values["ticks/tick"] - values["ticks/tick"][0]) * 1e-3
        self._restart(self.settings, TipPath(time_s, values["ticks/hand_target_m"], "linear"))
        self.live.arm()
        self.play_path()

    # What there is to see

    @property
    def frames_per_s(self) -> float:
        """Median of the last frames."""
        return 1.0 / float(np.median(self._frame_s)) if self._frame_s else 0.0

    @property
    def real_time(self) -> float:
        """Virtual over wall-clock time of the last frames."""
        if len(self._tick_at) < 2:
            return 1.0
        (first_s, first), (last_s, last) = self._tick_at[0], self._tick_at[-1]
        return (last - first) * 1e-3 / max(last_s - first_s, 1e-6)

    @property
    def host_delay_ms(self) -> int:
        """Of the scene."""
        return int(self.live.scene.sections.rates.host_delay_ticks)

    def frame(self) -> bool:
        """Draws once. False when the window wants to close."""
        began_s = time.monotonic()
        ps.frame_tick()
        self._frame_s.append(time.monotonic() - began_s)
        return not ps.window_requests_close()

    def screenshot(self) -> NDArray[np.uint8]:
        """The window as it is (height, width, 4), 8 bits a channel. Draws a frame."""
        return np.asarray(ps.screenshot_to_buffer(transparent_bg=False, include_UI=True), dtype=np.uint8)

    # Inside

    def _make(self, settings: Settings, path: TipPath | None) -> tuple[Live, Body]:
        scene = settings.scene()
        return Live(scene, settings.board, path), Body(scene)

    def _begin(self, live: Live, body: Body) -> None:
        self.live = self._stack.enter_context(live)
        self.shown = shown(live.scene)
        sections = live.scene.sections
        self.view = BodyView(body, sections.body.spacing_m, sections.tool.radius_m)
        self._shown_tick = None
        self._tick_at.clear()
        self.controls.restarted()
        self.emergency_stop = self.unplugged = False
        if live.contact is not None:
            self.hand.begin(live.contact.hand_m)
        ps.set_user_callback(self._draw)

    def _restart(self, settings: Settings, path: TipPath | None = None) -> None:
        """Keeps the loop that runs where the new one cannot be made."""
        try:
            live, body = self._make(settings, path)
        except SceneError as error:
            self.message = str(error)
            return
        before = self.settings
        self._stack.close()
        self._stack = ExitStack()
        colouring = self.view.colouring
        try:
            self._begin(live, body)
            self.settings, self.message = settings, ""
        except (SceneError, BoardError) as error:
            self._begin(*self._make(before, None))
            self.message = str(error)
        self.pending.clear()
        self.view.colouring = colouring

    def _draw(self) -> None:
        """Called by the window once a frame."""
        live = self.live
        if not live.poll() and live.problem:
            self.message = f"The loop has ended: {live.problem}. Choose a scene to start again."
        self._tick_at.append((time.monotonic(), live.status["tick"]))
        if not psim.GetIO().WantTextInput:
            if psim.IsKeyPressed(psim.ImGuiKey_Space, False):
                self.set_emergency_stop(True)
            if psim.IsKeyPressed(psim.ImGuiKey_H, False):
                self.hand.enable(not self.hand.enabled)
        if (target_m := self.hand.moved()) is not None:
            self.guide_hand(target_m)
        if live.picture is not None and live.picture.tick != self._shown_tick:
            self._shown_tick = live.picture.tick
            self.view.show(live.picture)
        if live.contact is not None:
            self.view.touch(live.contact, self.show_cone)
        width, height = ps.get_window_size()
        flags = psim.ImGuiWindowFlags_NoMove | psim.ImGuiWindowFlags_NoResize | psim.ImGuiWindowFlags_NoCollapse
        psim.SetNextWindowPos((0.0, 0.0))
        psim.SetNextWindowSize((_CONTROLS_WIDTH, height))
        psim.Begin(f"palpate: {self.settings.file.stem}###controls", flags)
        self.controls.draw(self)
        psim.End()
        psim.SetNextWindowPos((width - _PLOTS_WIDTH, 0.0))
        psim.SetNextWindowSize((_PLOTS_WIDTH, height))
        psim.Begin("live", flags)
        self.plots.draw(live.history)
        psim.End()


def _open_window(size: tuple[int, int]) -> None:
    """Raises RuntimeError where there is no display."""
    if ps.is_initialized():
        return
    ps.set_program_name(_WINDOW)
    ps.set_verbosity(0)
    ps.set_use_prefs_file(False)
    ps.set_errors_throw_exceptions(True)
    ps.set_window_size(*size)
    ps.set_build_default_gui_panels(False)
    ps.set_open_imgui_window_for_user_callback(False)
    ps.set_ground_plane_mode("none")
    ps.set_up_dir("z_up")
    ps.set_front_dir("neg_y_front")
    ps.set_SSAA_factor(1)
    ps.set_max_fps(60)
    ps.set_enable_render_error_checks(False)
    ps.init()
