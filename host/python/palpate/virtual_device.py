"""A device without hardware, in real time: the firmware on its board, an arm in a hand, and a link of the operating system at
which any program finds the board as it would find a real one.

    with VirtualDevice(load_scene(file)) as device:
        print(device.address)  # serial:/dev/pts/3
"""

import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.body import Floats, vector3
from palpate.hil import BOARDS, WATCHDOG_S, Board, BoardError
from palpate.injected import faulty_sections
from palpate.record_layout import BOARD_MODES
from palpate.scene import Scene, SceneError

PSEUDO_TERMINAL = "pty:"
_SIGN_S = 1.0  # between two looks at the tick, for the watchdog
_SHOW_S = 0.2  # between two lines of the command
_LINKS = "pty:, udp-listen:[HOST:]PORT, serial:PATH[,BAUD], can:INTERFACE[,fd] or canfd:INTERFACE"
_GUIDED_M_S = 0.5  # as fast as a hand that is guided goes
_REST_S = 1.0  # at the path's beginning, before the hand follows it again


def _medium_of(address: str) -> str:
    """Of scenes, the one with this link's framing (docs/links.md)."""
    kind, _, name = address.partition(":")
    if kind == "can":
        return "canfd" if name.endswith(",fd") else "can"
    return "canfd" if kind == "canfd" else "uart"


@dataclass(frozen=True)
class VirtualDeviceState:
    """The newest tick. tip_m: where the tip is, not what the encoders say; hand_force_N: of the hand on the tool; force_N: that
    the tip pushes the hand with, after the board's limits; all (3,), device frame. mode: one of `record_layout.BOARD_MODES`. slipped_s:
    wall-clock time that went on without the device, on a computer too busy for it."""

    tick: int
    mode: str
    faults: int
    outputs_on: bool
    tip_m: Floats
    hand_force_N: Floats
    force_N: Floats
    slipped_s: float
    bytes_sent: int
    bytes_received: int
    frames_unsent: int


class VirtualDevice:
    """A running device. Use as a context manager; any thread. Of the scene it takes [path], [hand], [device] and [safety]: the hand
    stays at the path's beginning, or at the arm's reference point where there is none, until play_path() or guide_hand().

    link: "pty:" for a pseudo-terminal, "udp-listen:[HOST:]PORT" for a UDP port, "serial:PATH[,BAUD]" for a line to another computer, "can:INTERFACE" or "canfd:INTERFACE" for a CAN bus. board: a name in `hil.BOARDS`. Raises SceneError
    for bad scenes and links, BoardError where the board cannot be started.
    """

    def __init__(
        self, scene: Scene, board: str = "native", link: str = PSEUDO_TERMINAL, watchdog_s: float = WATCHDOG_S
    ) -> None:
        if board not in BOARDS:
            raise BoardError(f"board {board!r}: must be one of {', '.join(BOARDS)}")
        if link.partition(":")[0] not in ("pty", "udp-listen", "serial", "can", "canfd") or ":" not in link:
            raise SceneError(f"link {link!r}: a device is offered at {_LINKS}")
        for name in faulty_sections(scene.sections):
            raise SceneError(
                f"{scene.file}: {name}: given, but a device without hardware injects no faults; must be left out (palpate run injects them)"
            )
        self._scene = scene
        self._link = link
        values = scene.to_dict()
        values["hand"]["kind"] = "impedance"
        if values["path"] is None:
            values["path"] = {"interpolation": "minimum_jerk", "time_s": np.zeros(1), "position_m": np.zeros((1, 3))}
        self._dict = values
        self._board = Board(BOARDS[board].on(_medium_of(link)).timed(scene.sections.safety), watchdog_s)
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        self._board.__enter__()
        try:
            self._core = _core.VirtualDevice(self._dict, self._board.actuator_fd, self._board.sensor_fd, self._link)
            self._core.start()
        except (ValueError, RuntimeError) as error:
            self._board.__exit__(type(error), error, None)
            # Of a link it names the link, of a path the scene.
            raise SceneError(str(error) if isinstance(error, RuntimeError) else f"{self._scene.file}: {error}") from None
        self._winder = threading.Thread(target=self._wind_on, name="virtual device watchdog", daemon=True)
        self._winder.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._core.stop()
        self._ended.set()
        self._winder.join()
        failed = BoardError(self._core.state["error"]) if self._core.state["error"] else error
        self._board.__exit__(type(failed) if failed else None, failed, trace)

    def _wind_on(self) -> None:
        before = -1
        while not self._ended.wait(_SIGN_S):
            tick = self._core.state["tick"]
            if tick != before:
                self._board.sign_of_life(tick)
            before = tick

    @property
    def address(self) -> str:
        """Of the link, as another program opens it: "serial:/dev/pts/3"."""
        return self._core.address.replace("udp-listen:0.0.0.0:", "udp:127.0.0.1:").replace("udp-listen:", "udp:")

    @property
    def state(self) -> VirtualDeviceState:
        """The newest tick. Raises BoardError where the board has failed."""
        now = self._core.state
        if now["error"]:
            raise BoardError(self._board.failure() or now["error"])
        names = VirtualDeviceState.__dataclass_fields__
        values: dict[str, Any] = {name: now[name] for name in names}
        values["mode"] = BOARD_MODES[now["mode"]]
        values["force_N"] = -now["force_N"].astype(np.float64)  # the firmware's is that of the tip on the body
        return VirtualDeviceState(**values)

    def guide_hand(self, target_m: ArrayLike) -> bool:
        """Where the hand shall go; smoothed, at most 0.5 m/s. False, and no effect, where the arm cannot reach."""
        return self._core.guide_hand(*vector3("target_m", target_m).tolist())

    def play_path(self) -> None:
        """The hand follows the scene's path from its beginning."""
        self._core.play_path()

    def set_emergency_stop(self, is_open: bool) -> None:
        """Opens or closes the chain of the emergency stop at the board."""
        self._core.set_emergency_stop(is_open)


class PathPlayer:
    """Lets the hand follow a path again and again: to its end, back to its beginning, there for a second, and anew. Its
    clock is the device's tick."""

    def __init__(self, path: dict[str, Any] | None) -> None:
        self._target_m = np.zeros(3) if path is None else np.asarray(path["position_m"], float)[0]
        end_m = self._target_m if path is None else np.asarray(path["position_m"], float)[-1]
        self._path_s = 0.0 if path is None else float(np.asarray(path["time_s"])[-1])
        # A guided hand starts and stops gently: twice the time of the straight way.
        self._back_s = 2.0 * float(np.linalg.norm(end_m - self._target_m)) / _GUIDED_M_S + _REST_S
        self._began_s: float | None = None
        self._returning = False

    def step(self, device: VirtualDevice, tick: int) -> None:
        """At this tick of the device, or some time after it."""
        now_s = tick / 1000.0
        if self._began_s is None or now_s - self._began_s >= self._path_s + self._back_s:
            device.play_path()
            self._began_s, self._returning = now_s, False
        elif not self._returning and now_s - self._began_s >= self._path_s + _SHOW_S:
            device.guide_hand(self._target_m)
            self._returning = True


def run_device(
    scene: Scene, board: str, link: str, play: bool, duration_s: float | None, announce: Callable[[str], None]
) -> dict[str, Any]:
    """`palpate device`: until duration_s has passed, or the program is interrupted or told to end (SIGTERM). `announce` is told the address once the
    device is there. Returns what `--json` prints (docs/device_api.md)."""
    if duration_s is not None and not 0.0 < duration_s < 1e9:
        raise SceneError(f"--duration = {duration_s:g}: must be in (0, 1e9) s")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with VirtualDevice(scene, board, link) as device:
        announce(device.address)
        player = PathPlayer(scene.to_dict()["path"]) if play else None
        began_s = time.monotonic()
        try:
            while duration_s is None or time.monotonic() - began_s < duration_s:
                time.sleep(_SHOW_S if duration_s is None else min(_SHOW_S, duration_s))
                state = device.state
                if player is not None:
                    player.step(device, state.tick)
                if sys.stderr.isatty():
                    tip_mm, force_N = 1e3 * state.tip_m, float(np.linalg.norm(state.force_N))
                    place = " ".join(f"{coordinate:7.2f}" for coordinate in tip_mm)
                    print(f"\r\033[K{state.tick / 1000:9.1f} s  {state.mode:<9} tip {place} mm  force {force_N:5.2f} N  "
                          f"link {state.bytes_received:,} B in, {state.bytes_sent:,} B out", end="", file=sys.stderr)  # fmt: skip
        except KeyboardInterrupt:  # how one ends it
            pass
        finally:
            if sys.stderr.isatty():
                print(file=sys.stderr)
        state = device.state
        return {
            "address": device.address,
            "board": board,
            "ticks": state.tick,
            "mode": state.mode,
            "faults": state.faults,
            "slipped_s": state.slipped_s,
            "bytes_sent": state.bytes_sent,
            "bytes_received": state.bytes_received,
            "frames_unsent": state.frames_unsent,
        }
