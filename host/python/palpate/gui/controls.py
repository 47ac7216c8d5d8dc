"""The panel of controls: scene, material, rates, board, faults, recording, view."""

import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import polyscope.imgui as psim

from palpate.board_search import find_boards
from palpate.gui import board_lines
from palpate.gui.attached_board import AttachedBoard
from palpate.gui.body_view import COLOURINGS
from palpate.gui.settings import BAUDS, BUILDERS
from palpate.hil import BOARDS
from palpate.injected import fault_names
from palpate.paths import SCENES
from palpate.record_layout import BOARD_MODES

if TYPE_CHECKING:
    from palpate.gui.app import App
    from palpate.live import Live

_MODE_COLOURS = {
    "boot": (0.75, 0.75, 0.75, 1.0), "idle": (0.55, 0.75, 1.0, 1.0), "calibrate": (0.80, 0.70, 1.0, 1.0),
    "render": (0.45, 0.95, 0.55, 1.0), "direct": (0.45, 0.85, 0.95, 1.0), "fault": (1.0, 0.45, 0.40, 1.0),
    "suspended": (1.0, 0.70, 0.30, 1.0),
}  # fmt: skip
_STOP = (0.80, 0.10, 0.10, 1.0)
_BAD = (1.0, 0.45, 0.40, 1.0)
_DULL = (0.70, 0.70, 0.70, 1.0)
_WARNING = (1.0, 0.70, 0.30, 1.0)
# On CAN a flipped bit is an error that every node sees (host/link/can_bus.hpp).
_NAMES_ON_CAN = {"flip_bit": "error on the bus"}
_MEANT = {"plain": (1.0, 1.0, 1.0, 1.0), "dull": _DULL, "warning": _WARNING}
_WIDTH = 140.0
_MOST_DELAY_ms = 400
_SILENT_s = 0.5  # without a word of the board
_OLD_MODEL_s = 0.5  # its force has faded by then; within a second more outputs go off (docs/safety.md)
# Also for values that are typed in.
_CLAMP = psim.ImGuiSliderFlags_AlwaysClamp


class Controls:
    """Draws the panel and calls the app; keeps only what is not the app's."""

    def __init__(self) -> None:
        self._scenes = sorted(file.resolve() for file in SCENES.glob("*.toml"))
        self._fault_kind = 0
        self._fault_count = 10
        self._direction = 0
        self._grip = 1.0
        self._delay_ms: int | None = None
        self._speed = 1.0
        self._attached: list[str] = []  # addresses of boards that were found

    def draw(self, app: "App") -> None:
        """In the present window."""
        psim.PushItemWidth(_WIDTH)
        self._safety(app)
        if psim.CollapsingHeader("Scene", psim.ImGuiTreeNodeFlags_DefaultOpen):
            self._scene(app)
        if psim.CollapsingHeader("Hand", psim.ImGuiTreeNodeFlags_DefaultOpen):
            self._hand(app)
        if psim.CollapsingHeader("View", psim.ImGuiTreeNodeFlags_DefaultOpen):
            self._view(app)
        if psim.CollapsingHeader("Recording", psim.ImGuiTreeNodeFlags_DefaultOpen):
            self._recording(app)
        if psim.CollapsingHeader("Faults to inject"):
            self._faults(app)
        if psim.CollapsingHeader("Numbers", psim.ImGuiTreeNodeFlags_DefaultOpen):
            self._numbers(app)
        if psim.CollapsingHeader("Board", psim.ImGuiTreeNodeFlags_DefaultOpen):
            _board(app)
        if app.attached is not None and psim.CollapsingHeader("Calibration", psim.ImGuiTreeNodeFlags_DefaultOpen):
            _calibration(app.attached)
        psim.PopItemWidth()

    def restarted(self, grip: float) -> None:
        """A new loop has the grip and delay of its scene."""
        self._grip, self._delay_ms, self._speed = grip, None, 1.0

    def _safety(self, app: "App") -> None:
        live = app.live
        mode = BOARD_MODES[min(live.status["board_mode"], len(BOARD_MODES) - 1)] if live.status["board_heard"] else "boot"
        if not live.status["link_is_open"]:
            psim.TextColored(_BAD, "the link has gone: waiting for it")
        silent = live.silence_s > _SILENT_s
        psim.TextColored(_DULL if silent else _MODE_COLOURS[mode], f"board {live.board_name}: {mode}{' when last heard' if silent else ''}")
        if silent:
            psim.TextColored(_WARNING, f"silent for {live.silence_s:.1f} s: without a host a\nboard switches its outputs off")
        if mode == "suspended":
            psim.TextColored(_WARNING, "goes on by itself with the next model")
        for name in fault_names(live.status["board_faults"]):
            psim.TextColored(_BAD, f"  {name.replace('_', ' ')}")
        if live.is_attached:
            if live.status["link_trouble"]:
                _wrapped(_WARNING, f"link: {live.status['link_trouble']}")
            if app.attached is not None and app.attached.reset is not None and app.attached.reset.fault:
                _wrapped(_WARNING, f"before its last reset: {app.attached.reset.fault}")
        else:
            self._troubles(live)
        psim.PushStyleColor(psim.ImGuiCol_Button, _STOP)
        psim.PushStyleColor(psim.ImGuiCol_Text, (1.0, 1.0, 1.0, 1.0))
        label = "release e-stop" if app.emergency_stop else "E-STOP (space)"
        if psim.Button(label, (-1.0, 34.0)):
            app.later(partial(app.set_emergency_stop, not app.emergency_stop))
        psim.PopStyleColor(2)
        _button(app, "arm", mode == "idle", live.arm)
        psim.SameLine()
        _button(app, "disarm", mode in ("render", "direct", "suspended"), lambda: live.command("disarm"))
        psim.SameLine()
        _button(app, "clear fault", mode == "fault" and not app.emergency_stop, lambda: live.command("clear_fault"))
        psim.SameLine()
        _button(app, "calibrate", mode == "idle", lambda: live.command("calibrate"))
        psim.SetItemTooltip("the arm rests in its reference pose for 0.1 s (docs/safety.md)")

    def _scene(self, app: "App") -> None:
        settings, shown = app.settings, app.shown
        file = settings.file.resolve()
        files = self._scenes if file in self._scenes else [file, *self._scenes]
        changed, index = psim.Combo("scene", files.index(file), [file.stem for file in files])
        if changed:
            app.later(partial(app.open, files[index]))
        boards = [*BOARDS, *(address for address in self._attached if address != settings.board)]
        if settings.board not in boards:
            boards.append(settings.board)
        changed, index = psim.Combo("board", boards.index(settings.board), boards)
        if changed:
            app.later(partial(app.choose_board, boards[index]))
        _button(app, "look for boards", True, lambda: self._look_for_boards(app))
        psim.SetItemTooltip("at serial ports that look like one, and where PALPATE_LINK says")
        logarithmic = psim.ImGuiSliderFlags_Logarithmic
        for name, label, low, high, text, flags in (
            ("stiffness_N_m", "spring", 1.0, 1e4, "%.0f N/m", logarithmic),
            ("young_modulus_Pa", "Young's modulus", 100.0, 1e7, "%.0f Pa", logarithmic),
            ("damping_ratio", "damping ratio", 0.05, 2.0, "%.2f", logarithmic),
            ("friction", "friction", 0.0, 2.0, "%.2f", 0),
            ("update_Hz", "updates", 10.0, 120.0, "%.0f Hz", 0),
        ):
            if name not in shown:
                continue
            value = float(app.pending.get(name, shown[name]))
            changed, value = psim.SliderFloat(label, value, low, high, text, flags | _CLAMP)
            if changed:
                app.pending[name] = value
        changed, index = psim.Combo("builder", BUILDERS.index(app.pending.get("builder", shown["builder"])), BUILDERS)
        if changed:
            app.pending["builder"] = BUILDERS[index]
        if not app.live.is_attached and app.live.scene.sections.link.medium == "uart":  # others are what they are
            baud = app.pending.get("baud", shown["baud"])
            bauds = sorted({*BAUDS, baud})
            changed, index = psim.Combo("link", bauds.index(baud), [f"{b / 1e6:g} Mbaud" for b in bauds])
            if changed:
                app.pending["baud"] = bauds[index]
        _button(app, "apply and restart", bool(app.pending), app.apply)
        psim.SameLine()
        _button(app, "scene's own", bool(settings.overrides or app.pending), lambda: app.open(settings.file))
        delay_ms = app.host_delay_ms if self._delay_ms is None else self._delay_ms
        changed, delay_ms = psim.SliderInt("host delay", delay_ms, 0, _MOST_DELAY_ms, "%d ms", _CLAMP)
        if changed:
            self._delay_ms = delay_ms
            app.later(partial(app.live.set_host_delay, delay_ms))
        if app.live.is_attached:
            return
        changed, self._speed = psim.SliderFloat("speed", self._speed, 0.0, 2.0, "%.2f of real time", _CLAMP)
        if changed:
            app.later(partial(app.live.set_speed, self._speed))

    def _look_for_boards(self, app: "App") -> None:
        """Beside the drawing: each port takes up to a second."""

        def look() -> None:
            self._attached = [found.address for found in find_boards(but=app.settings.board)]
            app.message = "" if self._attached else "No other board has answered."

        app.message = "Looking for boards..."
        threading.Thread(target=look, name="board search", daemon=True).start()

    def _hand(self, app: "App") -> None:
        if app.live.is_attached:
            psim.TextColored(_DULL, "yours, at the device")
            return
        changed, enabled = psim.Checkbox("mouse is the hand (H)", app.hand.enabled)
        if changed:
            app.later(partial(app.use_mouse, enabled))
        psim.TextColored(_DULL, "move: level; wheel or left\nbutton: up and down")
        _button(app, "play the scene's path", True, app.play_path)
        changed, self._grip = psim.SliderFloat("grip", self._grip, 0.0, 1.0, "%.2f", _CLAMP)
        if changed:
            app.later(partial(app.live.set_grip, self._grip))

    def _view(self, app: "App") -> None:
        for colouring in COLOURINGS:
            if psim.RadioButton(colouring, app.view.colouring == colouring):
                app.view.colouring = colouring
            if colouring != "nothing" and colouring != "stress":
                psim.SameLine()
        _, app.show_cone = psim.Checkbox("friction cone", app.show_cone)

    def _recording(self, app: "App") -> None:
        live = app.live
        if live.recording is None:
            _button(app, "record", True, app.record)
            psim.SameLine()
            _button(app, "replay the last", app.last_recording is not None, app.replay_last)
        else:
            _button(app, "stop", True, app.stop_recording)
            psim.SameLine()
            psim.TextColored(_BAD, f"{live.recorded_ticks / 1e3:.1f} s")
            psim.Text(live.recording.name)
            if live.recording_problem is not None:
                _wrapped(_BAD, f"no longer written: {live.recording_problem}")

    def _faults(self, app: "App") -> None:
        live = app.live
        if live.is_attached:
            psim.TextColored(_DULL, "only into an emulated board's link")
            return
        if live.fault_kinds:
            self._frame_faults(app)
            psim.SameLine()
        changed, unplugged = psim.Checkbox("cable out", app.unplugged)
        if changed:
            app.later(partial(app.set_unplugged, unplugged))
        if live.is_on_can:
            changed, babbling = psim.Checkbox("a node babbles", app.babbling)
            if changed:
                app.later(partial(app.set_babbling, babbling))
        _button(app, "an overlong tick", live.board_name != "native", live.burn_next_tick)

    def _frame_faults(self, app: "App") -> None:
        live = app.live
        _, self._direction = psim.Combo("frames", self._direction, ["to the board", "to the host"])
        self._fault_kind = min(self._fault_kind, len(live.fault_kinds) - 1)  # CAN has fewer
        names = [_NAMES_ON_CAN.get(kind, kind) if live.is_on_can else kind for kind in live.fault_kinds]
        _, self._fault_kind = psim.Combo("fault", self._fault_kind, names)
        _, self._fault_count = psim.SliderInt("of the next", self._fault_count, 1, 1000, "%d frames", _CLAMP)
        direction = ("down", "up")[self._direction]
        kind = live.fault_kinds[self._fault_kind]
        _button(app, "inject", True, lambda: live.add_faults(direction, kind, self._fault_count))
        if live.is_on_can:
            psim.SetItemTooltip("frames of the bus; errors at 32 attempts in a row take the sender off the bus")

    def _medium(self, live: "Live") -> None:
        """The link, and how busy it has been."""
        status = live.status
        ways = {way: status[way] for way in ("down", "up")}
        ticks = max(status["tick"], 1)
        busy = ", ".join(f"{100.0 * of['busy_ticks'] / ticks:.0f} % {way}" for way, of in ways.items())
        psim.Text(f"{live.medium}: busy {busy}")

    def _troubles(self, live: "Live") -> None:
        """Errors on a CAN bus, and what the faults that were injected have done: where nobody has to scroll."""
        status = live.status
        ways = (status["down"], status["up"])
        sent_again, offs = (sum(of[name] for of in ways) for name in ("attempts_failed", "bus_offs"))
        if sent_again:
            _wrapped(_WARNING, f"errors on the bus: {sent_again:,}; a sender off it: {offs}")
        injected = _injected(status["troubles"])
        if injected:
            _wrapped(_WARNING, f"injected: {injected}")

    def _numbers(self, app: "App") -> None:
        live = app.live
        status = live.status
        psim.Text(f"{app.frames_per_s:.0f} frames/s, loop at {app.real_time:.2f} of real time")
        if not live.is_attached and status["running"] and app.real_time < 0.9 and self._speed >= 1.0:
            psim.TextColored(_WARNING, "this machine is too slow for the body:\neverything goes slower, nothing is lost")
        age_s = live.history["model_age_s"]
        if live.is_attached and len(age_s) and age_s[-1] > _OLD_MODEL_s and live.contact is not None and live.contact.mode != "free":
            psim.TextColored(_WARNING, f"the model is {age_s[-1]:.1f} s old: machine or link\nis too slow, and the force fades")
        psim.Text(f"models {status['models_taken']} of {status['models_sent']}, refused {status['models_refused']}")
        psim.Text(f"frames lost: {status['frames_lost_down']} down, {status['frames_lost_up']} up")
        if not live.is_attached:
            self._medium(live)
        if status["links_opened"] > 1:
            psim.TextColored(_WARNING, f"link opened again {status['links_opened'] - 1} times")
        psim.Text(f"missed deadlines {status['board_missed_deadlines']}")
        if live.contact is not None:
            x_mm, y_mm, z_mm = 1e3 * live.contact.tip_m
            psim.Text(f"tip {x_mm:.1f}, {y_mm:.1f}, {z_mm:.1f} mm: {live.contact.mode}")
        if app.message:
            _wrapped(_WARNING, app.message)


def _board(app: "App") -> None:
    """Why it started, its longest tick, and what its image takes of the part."""
    attached = app.attached
    lines = board_lines.tick_lines(app.live.board_name, app.live.status)
    if attached is not None and attached.trouble:
        lines.append((f"not read: {attached.trouble}", "warning"))
    else:
        lines += board_lines.budget_lines(app.image, app.budgets)
        if attached is not None:
            lines = board_lines.reset_lines(attached.reset) + lines
    for text, meant in lines:
        _wrapped(_MEANT[meant], text)


def _calibration(board: AttachedBoard) -> None:
    """Base, upper arm, forearm."""
    if board.trouble:
        _wrapped(_WARNING, f"not read: {board.trouble}")
        return
    for register in board.registers:
        # Names and numbers side by side are wider than the panel.
        psim.TextColored(_DULL, register.name)
        psim.Text("  " + ", ".join(f"{value:.3g}" for value in register.values))
    kept = all(register.is_persistent for register in board.registers)
    _wrapped(_DULL, "as the loop began; " + ("kept by the board" if kept else "until the board starts again"))


def _injected(troubles: Mapping[str, Any]) -> str:
    """What the faults that were injected did, both directions together; empty where there was none."""
    kinds = [kind for kind in troubles["down"] if kind != "frames"]
    of = {kind: troubles["down"][kind] + troubles["up"][kind] for kind in kinds}
    of["of another node"] = troubles["foreign_frames"]
    return ", ".join(f"{kind} {number:,}" for kind, number in of.items() if number)


def _wrapped(colour: tuple[float, float, float, float], text: str) -> None:
    psim.PushTextWrapPos(0.0)
    psim.TextColored(colour, text)
    psim.PopTextWrapPos()


def _button(app: "App", label: str, possible: bool, pressed: Callable[[], object]) -> None:
    psim.BeginDisabled(not possible)
    if psim.Button(label):
        app.later(pressed)
    psim.EndDisabled()

