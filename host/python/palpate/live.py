"""A scene in real time: the firmware on its board, a plant whose hand follows a mouse, the host's session.

    with Live(load_scene(file)) as live:
        live.arm()
        live.guide_hand([0.0, 0.0, -0.022])
        live.poll()
        print(live.history["force_normal_N"][-1])

`Live(scene, "serial:/dev/ttyACM0")` is the same beside a board that runs by itself, with a device in a person's hand.
The loop runs in a thread of the core; nothing here makes it wait. All positions are in the device frame.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core, record_layout
from palpate.body import Body, vector3
from palpate.hil import BOARDS, WATCHDOG_S, Board, BoardError
from palpate.history import History
from palpate.paths import cache_folder
from palpate.recorder import Recorder
from palpate.scene import Scene, SceneError
from palpate.scene_overrides import OVERRIDE_COMMENT, exact_override
from palpate.scene_sections import Safety
from palpate.tip_path import TipPath

Floats = NDArray[np.float64]

TICK_S = 1e-3
HISTORY_S = 10.0
_COUNTED = ("ticks_unseen", *(name for name in record_layout.RUN_COUNTERS if name != "clock_Hz"))
SERIAL_FAULT_KINDS = ("drop", "flip_bit", "truncate", "duplicate", "reorder")
CAN_FAULT_KINDS = ("drop", "flip_bit", "duplicate")
# Of the hand above the middle of the body's top where a scene has no path.
_START_ABOVE_M = 0.015
_SIGN_S = 1.0  # between two looks at the tick, for the watchdog
COLUMNS = (
    "time_s", "force_normal_N", "force_tangential_N", "cone_N", "contact_mode", "tip_x_m", "tip_y_m", "tip_z_m",
    "tick_count", "busy_count", "model_age_s", "link_up_bytes", "link_down_bytes", "frames_lost", "absorbed_J",
    "late_s", "took_s",
)  # fmt: skip


@dataclass(frozen=True)
class Contact:
    """The newest tick's contact: where the tip is and what it does to the body.

    tip_m, force_N (of the tip on the body), normal (outward; zeros when free): (3,). mode: "free", "stick" or "slip".
    friction: static coefficient of the triangle that is touched.
    """

    tip_m: Floats
    hand_m: Floats
    force_N: Floats
    normal: Floats
    mode: str
    friction: float


@dataclass(frozen=True)
class Picture:
    """The body as the session had it at the end of a tick: position_m and velocity_m_s (n, 3), nodes of the newest patch."""

    tick: int
    position_m: Floats
    velocity_m_s: Floats
    patch_nodes: NDArray[np.uint32]


class Live:
    """A running loop. Use as a context manager. One thread calls.

    board: a name in `hil.BOARDS`, or the address of a board that runs by itself (docs/device_api.md): then nothing of the device
    is simulated (`is_attached`), and what only a simulated one can do has no effect. path: that play_path() follows, in place
    of the scene's. Without any the hand begins above the middle of the body. watchdog_s: a board that gives no tick for so long is ended, unless the loop is paused.
    Raises SceneError for scenes that have no tip to touch with, BoardError where the board cannot be started.

    problem: why the loop has ended by itself, on one line; None: it has not.
    """

    def __init__(
        self,
        scene: Scene,
        board: str = "native",
        path: TipPath | None = None,
        watchdog_s: float = WATCHDOG_S,
    ) -> None:
        self.is_attached = is_address(board)
        if not self.is_attached:
            if board not in BOARDS:
                raise BoardError(f"board {board!r}: must be one of {', '.join(BOARDS)}, or the address of a link")
            scene = scene.with_board(board)
        elif scene.sections.safety != Safety():
            raise SceneError(f"{scene.file}: safety: given, but the board at {board} has times of its own (docs/safety.md)")
        self.scene = scene
        self.board_name = board
        self.status: dict[str, Any] = {}
        self.contact: Contact | None = None
        self.picture: Picture | None = None
        self.history = History(COLUMNS, round(HISTORY_S / TICK_S))
        self.recording: Path | None = None
        self.recorded_ticks = 0
        self.problem: str | None = None
        self._dict = _for_a_person(scene, path)
        self.triangle_friction: Floats = _core.triangle_friction(self._dict)
        medium = scene.sections.link.medium
        self._board = None if self.is_attached else Board(BOARDS[board].of(scene.sections), watchdog_s)
        self.medium = medium
        self.is_on_can = not self.is_attached and medium in ("can", "canfd")
        # What add_faults() takes (host/link/fault_plan.hpp, can_fault_plan.hpp): nothing beside an attached board, and nothing on a USB bus,
        # which repeats what an error has hit.
        self.fault_kinds = () if self.is_attached or medium == "usb" else CAN_FAULT_KINDS if self.is_on_can else SERIAL_FAULT_KINDS
        self._triangles = Body(scene).triangles if self.is_attached else None
        self._recorder: Recorder | None = None
        self._before: dict[str, int] = {}  # counters when the recording began
        self._absorbed_J = 0.0
        self._last_tick = -1
        self._last_tip_m: Floats | None = None
        self._speed = 1.0
        self._wound_tick = 0
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        bases = str(cache_folder() / "bases")
        try:
            if self._board is None:
                self._loop: Any = _core.AttachedLoop(self._dict, self.board_name, bases)
            else:
                self._board.__enter__()
                self._loop = self._beside_emulated(self._board, bases)
        except ValueError as error:
            raise SceneError(f"{self.scene.file}: {error}") from None
        except RuntimeError as error:
            raise BoardError(str(error)) from None
        self._loop.start()
        if self._board is not None:
            self._board.sign_of_life(0)  # the body's basis may have taken long
            self._winder = threading.Thread(target=self._wind_on, name="live watchdog", daemon=True)
            self._winder.start()
        self.poll()
        return self

    def _beside_emulated(self, board: Board, bases: str) -> Any:
        try:
            return _core.LiveLoop(self._dict, board.actuator_fd, board.sensor_fd, bases)
        except BaseException as error:
            board.__exit__(type(error), error, None)
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._loop.stop()
            self.poll()
            self.stop_recording()
        finally:
            self._ended.set()
            if self._board is not None:
                self._winder.join()
                # A loop that has failed has not told its board to end.
                failed = BoardError(self.status["error"]) if self.status.get("error") else error
                self._board.__exit__(type(failed) if failed else None, failed, trace)

    # Controls: in effect from the next tick on.

    def guide_hand(self, target_m: ArrayLike) -> bool:
        """Where the hand shall go; smoothed, at most 0.5 m/s. False, and no effect, where the arm cannot reach."""
        x, y, z = vector3("target_m", target_m)
        return not self.is_attached and bool(self._loop.guide_hand(x, y, z))

    def play_path(self) -> None:
        """The hand goes to the beginning of the path and follows it."""
        if not self.is_attached:
            self._loop.play_path()

    def set_grip(self, grip: float) -> None:
        """0 let go to 1 as tight as the scene's hand. ValueError beyond."""
        if not self.is_attached:
            self._loop.set_grip(grip)

    def arm(self) -> None:
        """Asks the board to switch its outputs on, in two steps (docs/safety.md)."""
        self._loop.arm()

    def command(self, action: str) -> None:
        """disarm, calibrate, clear_fault or stop, over the link."""
        self._loop.command(action)

    def set_emergency_stop(self, is_open: bool) -> None:
        """Opens or closes the chain of the emergency stop at the board. That of an attached one has a switch of its own."""
        if not self.is_attached:
            self._loop.set_emergency_stop(is_open)

    def set_unplugged(self, unplugged: bool) -> None:
        """Pulls the link's cable out, or puts it in again."""
        if not self.is_attached:
            self._loop.set_unplugged(unplugged)

    def set_babbling(self, babbling: bool) -> None:
        """A broken node fills the CAN bus with frames of the first priority, or no longer. Without effect on other media."""
        if self.is_on_can:
            self._loop.set_babbling(babbling)

    def burn_next_tick(self) -> None:
        """The next servo tick takes 2.5 ms longer; without effect on board native, which has no clock."""
        if not self.is_attached:
            self._loop.burn_next_tick()

    def add_faults(self, direction: str, kind: str, count: int, argument: int = 1) -> None:
        """Of the next `count` frames "down" to the board or "up" to the host: drop, flip_bit (number `argument`), truncate
        (to `argument` bytes), duplicate or reorder (behind `argument` more). On CAN frames of the bus, and only drop, duplicate and
        flip_bit (`fault_kinds`): the last is an error at so many attempts to send, of which 32 in a row take the sender off the bus. Raises
        ValueError for other kinds; no effect beside an attached board."""
        if not self.is_attached:
            self._loop.add_faults(direction, kind, argument, count)

    def set_host_delay(self, ticks: int) -> None:
        """From the tick in which a model is due to its hand-over to the link, 0 to 1000 ms."""
        self._loop.set_host_delay(ticks)

    def set_speed(self, speed: float) -> None:
        """Virtual over wall-clock time, at most 10; 0 pauses."""
        if not self.is_attached:
            self._loop.set_speed(speed)
            self._speed = speed

    # Results

    def poll(self) -> bool:
        """Takes over what has happened since the call before. False when the loop has ended, with `problem` set."""
        self.status = self._loop.status
        block = self._loop.take()
        self._wind(self.status["tick"])
        if len(block["ticks/tick"]):
            self._remember(block)
        if self._recorder is not None and any(len(array) for array in block.values()):
            rows = {path: array for path, array in block.items() if not path.startswith("wall/")}
            if self._recorder.append(rows):
                self.recorded_ticks += len(block["ticks/tick"])
        if self.status["error"] and self.problem is None:
            failure = None if self._board is None else self._board.failure()
            self.problem = failure or str(self.status["error"])
        if (shown := self._loop.take_picture()) is not None:
            self.picture = Picture(**shown)
        return bool(self.status["running"])

    @property
    def silence_s(self) -> float:
        """For how long the board has not said how it is, which it does every 100 ms; 0 before it has said so once."""
        return max(0, self.status["tick"] - self.status["board_tick"]) * 1e-3 if self.status["board_heard"] else 0.0

    @property
    def recording_problem(self) -> str | None:
        """Why the recording that is open takes no more rows; None: all is well."""
        return None if self._recorder is None else self._recorder.problem

    def record(self, file: Path) -> None:
        """Begins to record into `file` (docs/records.md). OSError where it cannot be made."""
        self.stop_recording()
        attributes = {"command": "gui", "board": self.board_name}
        self.scene.keep_mesh(file.parent)
        self._recorder = Recorder(file, record_layout.RUN, attributes, scene_text=self._scene_text())
        self.recording, self.recorded_ticks = file, 0
        self._before = {name: self.status[name] for name in _COUNTED}

    def _scene_text(self) -> str:
        """As it runs: a script's hand is a person's here."""
        if self.scene.sections.hand.kind == "impedance":
            return self.scene.text
        return f"{self.scene.text}{OVERRIDE_COMMENT}{exact_override('hand.kind', 'impedance')}"

    def stop_recording(self) -> None:
        """Closes the file; does nothing where none is open. Its attributes have what was counted meanwhile, and as
        `ticks_unseen` the ticks that are missing because nobody polled for seconds. Raises RecordError where the file could not be written; it is no longer open then."""
        recorder, self._recorder, self.recording = self._recorder, None, None
        if recorder is not None:
            recorder.close({name: self.status[name] - before for name, before in self._before.items()})

    def _wind(self, tick: int) -> None:
        """A tick that does not move is no sign of life, but when the loop is paused."""
        if self._board is not None and (tick != self._wound_tick or self._speed == 0.0):
            self._wound_tick = tick
            self._board.sign_of_life(tick)

    def _wind_on(self) -> None:
        """The thread: for those who poll seldom."""
        while not self._ended.wait(_SIGN_S):
            self._wind(self._loop.status["tick"])

    def _lost_frames(self) -> int:
        return sum(self.status.get(name, 0) for name in ("frames_lost_down", "frames_lost_up"))

    def _normals(self, block: Mapping[str, NDArray[Any]]) -> Floats:
        """(ticks, 3): outward, zero when free. A trace does not have them: of an attached board they are those of the triangles of
        the body as it was seen last."""
        normal: Floats = block["ticks/normal"].astype(np.float64)
        if self._triangles is None or self.picture is None:
            return normal
        touching = block["ticks/contact_mode"] != 0
        corners = self.picture.position_m[self._triangles[block["ticks/triangle"][touching]]]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal[touching] = across / np.linalg.norm(across, axis=1, keepdims=True)
        return normal

    def _remember(self, block: Mapping[str, NDArray[Any]]) -> None:
        force_N = block["ticks/force_N"].astype(np.float64)
        normal = self._normals(block)
        tip_m = block["ticks/tip_m"].astype(np.float64)
        mode = block["ticks/contact_mode"]
        pressing_N = -np.einsum("ij,ij->i", force_N, normal)
        tangential_N = np.linalg.norm(force_N + pressing_N[:, None] * normal, axis=1)
        # The triangle of a free tick has no meaning.
        triangle = np.where(mode == 0, 0, block["ticks/triangle"]).astype(np.intp)
        friction = self.triangle_friction[triangle, 0]
        if self._last_tip_m is None or block["ticks/tick"][0] != self._last_tick + 1:
            # The first, or ticks before it went unseen: the work of the jump is not known.
            self._last_tip_m, self._absorbed_J = tip_m[0], 0.0
        before = np.vstack([self._last_tip_m[None], tip_m[:-1]])
        self._last_tick, self._last_tip_m = int(block["ticks/tick"][-1]), tip_m[-1]
        absorbed_J = self._absorbed_J + np.cumsum(np.einsum("ij,ij->i", force_N, tip_m - before))
        self._absorbed_J = float(absorbed_J[-1])
        self.history.append({
            "time_s": block["ticks/tick"] * TICK_S,
            "force_normal_N": pressing_N,
            "force_tangential_N": tangential_N,
            "cone_N": friction * pressing_N,
            "contact_mode": mode,
            "tip_x_m": tip_m[:, 0],
            "tip_y_m": tip_m[:, 1],
            "tip_z_m": tip_m[:, 2],
            "tick_count": block["ticks/tick_count"],
            "busy_count": block["ticks/busy_count"],
            "model_age_s": block["ticks/model_age_ticks"] * TICK_S,
            "link_up_bytes": block["ticks/link_up_bytes"],
            "link_down_bytes": block["ticks/link_down_bytes"],
            # Of both directions since the start, as it was known when these ticks were taken over.
            "frames_lost": np.full(len(mode), float(self._lost_frames())),
            "absorbed_J": absorbed_J,
            "late_s": block["wall/late_s"],
            "took_s": block["wall/took_s"],
        })  # fmt: skip
        self.contact = Contact(
            tip_m[-1],
            block["ticks/hand_target_m"][-1],
            force_N[-1],
            normal[-1],
            record_layout.CONTACT_MODES[mode[-1]],
            float(friction[-1]),
        )


def is_address(board: str) -> bool:
    """Of a link, not the name of an emulated board?"""
    return ":" in board


def _box(scene: Scene, body: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest corner of the body at rest, and its extent, m."""
    if (network := scene.network) is not None:
        return network.rest_position_m.min(axis=0), np.ptp(network.rest_position_m, axis=0)
    return np.array(body["origin_m"]), body["spacing_m"] * (np.array(body["nodes"]) - 1.0)


def _for_a_person(scene: Scene, path: TipPath | None) -> dict[str, Any]:
    """The scene for the core, its hand one that follows a guide."""
    if scene.sections.body.dimension != 3:
        raise SceneError(f"{scene.file}: body.dimension = {scene.sections.body.dimension}: must be 3 to be touched")
    values = scene.to_dict()
    values["hand"]["kind"] = "impedance"
    if path is not None:
        values["path"] = {
            "interpolation": path.interpolation, "time_s": path.time_s, "position_m": path.position_m
        }  # fmt: skip
    elif values["path"] is None:
        low_m, size_m = _box(scene, values["body"])
        above_m = low_m + size_m * [0.5, 0.5, 1.0] + [0.0, 0.0, _START_ABOVE_M]
        values["path"] = {
            "interpolation": "minimum_jerk", "time_s": np.zeros(1), "position_m": above_m[None]
        }  # fmt: skip
    return values
