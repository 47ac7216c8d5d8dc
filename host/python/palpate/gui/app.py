"""The window: what it shows, and what its controls do. Drawing never makes the loop wait (host/session/live_loop.hpp)."""

import sys
import time
from collections import deque
from collections.abc import Callable
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
from palpate.gui import attached_board
from palpate.gui.attached_board import AttachedBoard
from palpate.gui.board_lines import medium_of
from palpate.gui.body_view import BodyView
from palpate.gui.controls import Controls
from palpate.gui.mouse_hand import MouseHand
from palpate.gui.plots import PlotPanel
from palpate.gui.settings import Settings, shown
from palpate.hil import BoardError
from palpate.image_budgets import Table, tables
from palpate.injected import faulty_sections
from palpate.live import Live, is_address
from palpate.record import RecordError
from palpate.tip_path import TipPath

_CONTROLS_WIDTH, _PLOTS_WIDTH = 290.0, 380.0
_FRAMES = 60  # that a rate is taken from
_MOST_FRAMES_S = 60
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
        self.unplugged = self.babbling = False
        self.last_recording: Path | None = None
        self.attached: AttachedBoard | None = None  # as the loop began
        self.image = ""  # the board's name in the build
        self.budgets: list[Table] = []  # of its image, as it was built here
        self.frames = 0  # drawn so far
        self.hand = MouseHand()
        self.controls = Controls()
        self.plots = PlotPanel()
        self._out = out
        self._size = size
        self._stack = ExitStack()
        self._wanted: list[Callable[[], object]] = []
        self._recorded_with = settings
        self._drawn_at_s: deque[float] = deque(maxlen=_FRAMES)
        self._tick_at: deque[tuple[float, int]] = deque(maxlen=_FRAMES)
        self._shown_tick: int | None = None

    def __enter__(self) -> "App":
        try:
            started = self._start(self._stack, self.settings, None)
            _open_window(self._size)
            self._show(*started)
        except BaseException:
            self._stack.close()
            raise
        ps.set_user_callback(self._draw)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Raises RecordError where a recording that was open could not be written."""
        try:
            self._stack.close()
        except RecordError as error:
            if kind is None:
                raise
            print(error, file=sys.stderr)
        finally:
            ps.clear_user_callback()

    # What controls and scripts do

    def later(self, action: Callable[[], object]) -> None:
        """For controls: at the end of the frame. A ValueError is shown as the message."""
        self._wanted.append(action)

    def open(self, file: Path) -> None:
        """Another scene, with its own values."""
        self._restart(Settings(file, self.settings.board))

    def choose_board(self, board: str) -> None:
        """The same scene on another board: of `hil.BOARDS`, or an attached one by its address."""
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
        """Opens the chain of the emergency stop and says STOP over the link as well, or closes the chain. Of an attached board
        only STOP: its chain has a switch of its own."""
        self.emergency_stop = is_open
        self.live.set_emergency_stop(is_open)
        if is_open:
            self.live.command("stop")

    def set_unplugged(self, unplugged: bool) -> None:
        """The link's cable."""
        self.unplugged = unplugged
        self.live.set_unplugged(unplugged)

    def set_babbling(self, babbling: bool) -> None:
        """A broken node on the CAN bus."""
        self.babbling = babbling
        self.live.set_babbling(babbling)

    def use_mouse(self, enabled: bool) -> None:
        """The mouse as the hand, from where the hand is; not before there is a tick that says where."""
        if enabled and self.live.contact is None:
            self.message = "Where the hand is, is not known yet."
            return
        if enabled and self.live.contact is not None:
            self.hand.begin(self.live.contact.hand_m)
            self.guide_hand(self.hand.target_m)  # a path that is being played ends here
        self.hand.enable(enabled)

    def guide_hand(self, target_m: NDArray[np.float64]) -> None:
        """Where the hand shall go, in the device frame."""
        if self.live.guide_hand(target_m):
            self.hand.target_m = target_m
            self.message = ""
        else:
            self.message = "The arm does not reach further."

    def play_path(self) -> None:
        """The scene's, or the recorded one after `replay_last`; the mouse is no longer the hand."""
        self.use_mouse(False)
        self.live.play_path()

    def record(self) -> None:
        """Into a new file in the folder for results."""
        name = f"recording_{datetime.now():%Y%m%d_%H%M%S}"
        file, number = self._out / f"{name}.h5", 1
        while file.exists():
            number += 1
            file = self._out / f"{name}_{number}.h5"
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            self.live.record(file)
        except OSError as error:
            self.message = f"{file}: {error.strerror}"

    def stop_recording(self) -> None:
        """Closes the file, if one is open."""
        file = self.live.recording
        try:
            self.live.stop_recording()
        except RecordError as error:
            self.message = str(error)
            return
        if file is not None:
            self.last_recording, self._recorded_with = file, self.settings

    def replay_last(self) -> None:
        """A new start with the settings of the last recording, a body at rest, and a hand that goes where it meant to be
        then. Arms the board, but with an open emergency stop."""
        if self.last_recording is None:
            self.message = "Nothing has been recorded yet."
            return
        try:
            values = record.load(self.last_recording).values
        except RecordError as error:
            self.message = str(error)
            return
        tick = values["ticks/tick"]
        if len(tick) < 2:
            self.message = f"{self.last_recording}: has {len(tick)} ticks: must have 2 or more to be replayed"
            return
        time_s = (tick - tick[0]) * 1e-3
        path = TipPath(time_s, values["ticks/hand_target_m"], "linear")
        if not self._restart(self._recorded_with, path):
            return
        self.play_path()
        if self.emergency_stop:
            self.message = "The emergency stop is open: not armed."
        else:
            self.live.arm()

    # What there is to see

    @property
    def frames_per_s(self) -> float:
        """Median of the last frames."""
        return 1.0 / float(np.median(np.diff(self._drawn_at_s))) if len(self._drawn_at_s) > 1 else 0.0

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
        ps.frame_tick()
        return not ps.window_requests_close()

    def screenshot(self) -> NDArray[np.uint8]:
        """The window as it is (height, width, 4), 8 bits a channel. Draws a frame."""
        return np.asarray(ps.screenshot_to_buffer(transparent_bg=False, include_UI=True), dtype=np.uint8)

    # Inside

    def _start(self, stack: ExitStack, settings: Settings, path: TipPath | None) -> tuple[Live, Body, AttachedBoard | None]:
        scene = settings.scene()
        body = Body(scene)
        attached = attached_board.ask(settings.board) if is_address(settings.board) else None
        return stack.enter_context(Live(scene, settings.board, path)), body, attached

    def _show(self, live: Live, body: Body, attached: AttachedBoard | None) -> None:
        self.live, self.attached = live, attached
        self.image = live.board_name if attached is None else attached.name
        self.budgets = tables(self.image, live.medium if attached is None else medium_of(live.board_name))
        self.shown = shown(live.scene)
        sections = live.scene.sections
        network = live.scene.network
        volume_m3 = sections.body.spacing_m**3 if network is None else network.volume_m3
        self.view = BodyView(body, volume_m3, sections.tool.radius_m)
        self._shown_tick = None
        self._tick_at.clear()
        self.controls.restarted(sections.hand.grip)
        self.unplugged = self.babbling = False
        self.use_mouse(False)
        if not live.is_attached and (sections_with_faults := faulty_sections(sections)):
            self.message = f"The scene's {' and '.join(sections_with_faults)} are not injected here: Faults to inject has others."

    def _restart(self, settings: Settings, path: TipPath | None = None) -> bool:
        """The loop that runs goes on, and nothing else changes, where the new one cannot be made: False then. But that beside an
        attached board ends first where the new one is for the same board, which serves one host."""
        stack = ExitStack()
        try:
            if self.live.is_attached and self.live.board_name == settings.board:
                Live(settings.scene(), settings.board, path)  # is the scene good? Nothing is opened yet
                self.stop_recording()
                self._stack.close()
            live, body, attached = self._start(stack, settings, path)
        except (BoardError, OSError, ValueError) as error:
            self.message = str(error)
            return False
        if self.emergency_stop:
            live.set_emergency_stop(True)
        self.message = ""
        self.stop_recording()
        before, self._stack = self._stack, stack
        before.close()
        colouring = self.view.colouring
        self._show(live, body, attached)
        self.view.colouring = colouring
        self.settings = settings
        self.pending.clear()
        return True

    def _draw(self) -> None:
        """Called by the window once a frame."""
        self.frames += 1
        self._drawn_at_s.append(time.monotonic())
        live = self.live
        if not live.poll() and live.problem:
            self.message = f"The loop has ended: {live.problem}. Choose a scene to start again."
        self._tick_at.append((time.monotonic(), live.status["tick"]))
        if not psim.GetIO().WantTextInput and psim.IsKeyPressed(psim.ImGuiKey_H, False):
            self.use_mouse(not self.hand.enabled)
        if (target_m := self.hand.moved()) is not None:
            self.guide_hand(target_m)
        if live.picture is not None and (live.picture.tick != self._shown_tick or self.view.recolour):
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
        wanted, self._wanted = self._wanted, []
        for action in wanted:
            try:
                action()
            except ValueError as error:
                self.message = str(error)
        # Last, and whatever has the keyboard: nothing else of this frame can close the chain again.
        if psim.IsKeyPressed(psim.ImGuiKey_Space, False):
            self.set_emergency_stop(True)


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
    ps.set_max_fps(_MOST_FRAMES_S)
    ps.set_frame_tick_limit_fps_mode("block_to_hit_target")  # else it returns at once, without a frame
    ps.set_enable_render_error_checks(False)
    ps.init()
