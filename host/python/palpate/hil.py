"""A board in the loop: starts the firmware (in QEMU, or as a process) and connects it to the core through two FIFOs.

The frames are those of boards/lockstep/exchange.hpp. Virtual time stands still while either side computes, so nothing
here depends on how fast this machine is; the watchdog alone looks at the wall clock.
"""

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from palpate.paths import BUILD, PACKAGE, SOURCE, cache_folder
from palpate.scene_sections import Safety, SceneFile

Progress = Callable[[int, int], bool]

WATCHDOG_S = 30.0
_SHUTDOWN_S = 10.0
_POLL_S = 0.2
_CONSOLE = "console.txt"
_STDOUT = "stdout.txt"
# palpate::lockstep::ExitCode
_EXIT_CODES = {
    0: "asked to shut down",
    1: "wrong command line",
    2: "cannot open its streams",
    3: "its streams ended",
    4: "wrong sensor frame",
    5: "processor fault",
}


class BoardError(RuntimeError):
    """The board cannot be started, died, or hangs."""


# A board's images, by the medium of scenes: what their file's name has behind the board's.
IMAGES = {"uart": "", "usb": "_usb", "can": "_can_classic", "canfd": "_can_fd"}
_NO_USB = "it has a USB stack where TinyUSB's sources are, which ./run unpacks where there is cargo, and then builds it"


@dataclass(frozen=True)
class BoardType:
    """How a board is started. instructions_per_count: of the firmware's clock; None: it has no such clock.
    identify: how it is started to print what it is, on the first line of standard output. argument: one more of its command
    line (boards/lockstep/start_times.hpp); empty: none. environment: names and values that its process gets beside our own."""

    name: str
    image: Path
    command: Callable[..., list[str]]
    instructions_per_count: float | None
    identify: Callable[[Path], list[str]]
    argument: str = ""
    environment: tuple[tuple[str, str], ...] = ()

    def on(self, medium: str) -> "BoardType":
        """The same board with the firmware for a scene's `link.medium`."""
        return replace(self, image=self.image.with_stem(self.image.stem + IMAGES[medium]))

    def of(self, scene: SceneFile) -> "BoardType":
        """The same board with the firmware and the supervisor's times of a scene."""
        return self.on(scene.link.medium).timed(scene.safety)

    def timed(self, safety: Safety) -> "BoardType":
        """The same board with these times of its supervisor."""
        return replace(self, argument=_times(safety))

    def start_command(self) -> list[str]:
        """What starts it, in the folder of its FIFOs."""
        return self.command(self.image, argument=self.argument) if self.argument else self.command(self.image)


def _times(safety: Safety) -> str:
    """Of boards/lockstep/start_times.hpp."""
    times_s = (safety.horizon_s, safety.fade_s, safety.damp_s, safety.resume_within_s)
    if all(time_s is None for time_s in times_s):
        return ""
    return "times=" + ":".join("" if time_s is None else str(round(1000.0 * time_s)) for time_s in times_s)


def _qemu_command(
    machine: str, shift: int, image: Path, console: str = f"file:{_CONSOLE}", argument: str = ""
) -> list[str]:
    # sleep=off: virtual time does not wait for the wall clock.
    return [
        "qemu-system-arm",
        "-M",
        machine,
        "-icount",
        f"shift={shift},sleep=off",
        "-display",
        "none",
        "-monitor",
        "none",
        "-serial",
        console,
        "-semihosting-config",
        "enable=on,target=native" + (f",arg={argument}" if argument else ""),
        "-kernel",
        str(image),
    ]


def _machine_command(image: Path, arguments: tuple[str, ...] = ()) -> list[str]:
    """The part's processor and register models; without arguments: what the image is."""
    return [sys.executable, "-m", "palpate.machine.lockstep", str(image), *arguments]


def _native_command(image: Path, argument: str = "") -> list[str]:
    return [str(image), "--lockstep", "act.fifo", "sen.fifo", *([argument] if argument else [])]


def _native_image() -> Path:
    return BUILD / "host/boards/native/palpate_native" if SOURCE else PACKAGE / "bin/palpate_native"


def _mps2(name: str, shift: int) -> BoardType:
    # An instruction takes 2^shift ns; its clock counts every 40 ns.
    command = partial(_qemu_command, name.replace("_", "-"), shift)
    return BoardType(
        name,
        BUILD / f"{name}/boards/{name}/palpate_{name}.elf",
        command,
        40 >> shift,
        # On a serial line: without a plant's files to open.
        partial(command, console="stdio", argument="uart"),
    )


# 125 and 500 million instructions a second: 125,000 and 500,000 a servo tick.
BOARDS = {
    board.name: board
    for board in (
        _mps2("mps2_an386", 3),
        _mps2("mps2_an500", 1),
        BoardType(
            "nucleo_g474re",
            BUILD / "nucleo_g474re/boards/nucleo_g474re/palpate_nucleo_g474re.elf",
            partial(_machine_command, arguments=("act.fifo", "sen.fifo")),
            # It counts cycles, at most 1.8 an instruction (docs/decisions/cycles.md): palpate.machine takes them to be as many.
            5 / 9,
            _machine_command,
            environment=(("PYTHONPATH", str(PACKAGE.parent)),),
        ),
        BoardType("native", _native_image(), _native_command, None, lambda image: [str(image), "--version"]),
    )
}


class Board:
    """A running board. Use as a context manager: it is gone when the block ends, however it ends.

    actuator_fd, sensor_fd: blocking file descriptors for the core, valid inside the block. Reading from actuator_fd
    meets the end of the stream when the board has died or was killed by the watchdog.
    """

    def __init__(self, board: BoardType, watchdog_s: float = WATCHDOG_S) -> None:
        self._type = board
        self._watchdog_s = watchdog_s
        self._last_sign_s = time.monotonic()
        self._tick = 0
        self._hung = False
        self._closing = threading.Event()
        self.actuator_fd = -1
        self.sensor_fd = -1

    def __enter__(self) -> Self:
        if not self._type.image.exists():
            remedy = "./run builds it" if SOURCE else "it needs the source tree, where ./run builds it; native is here"
            if self._type.image.stem.endswith(IMAGES["usb"]):
                remedy = _NO_USB
            raise BoardError(f"board {self._type.name}: {self._type.image} does not exist: {remedy}")
        self._folder = tempfile.TemporaryDirectory(prefix="palpate-", ignore_cleanup_errors=True)
        try:
            self._start(Path(self._folder.name))
        except BaseException:
            self._folder.cleanup()
            raise
        return self

    def _start(self, folder: Path) -> None:
        for name in ("act.fifo", "sen.fifo"):
            os.mkfifo(folder / name)
        # Non-blocking only while opening: no peer is there yet.
        self.actuator_fd = os.open(folder / "act.fifo", os.O_RDONLY | os.O_NONBLOCK)
        os.set_blocking(self.actuator_fd, True)
        # Our own ends of both FIFOs keep a read from ending before the board has opened its side, and a write from
        # raising SIGPIPE; _watch() closes the first when the board is gone.
        self._keep_open_fd = os.open(folder / "act.fifo", os.O_WRONLY)
        self.sensor_fd = os.open(folder / "sen.fifo", os.O_RDWR)
        command = self._type.start_command()
        try:
            with (folder / _STDOUT).open("wb") as output:
                # In a session of its own: Ctrl-C is for this program, which then ends the board.
                self._process = subprocess.Popen(
                    command,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                    env={**os.environ, **dict(self._type.environment)},
                )
        except OSError as error:
            for fd in (self.actuator_fd, self._keep_open_fd, self.sensor_fd):
                os.close(fd)
            raise BoardError(
                f"board {self._type.name}: cannot start {command[0]}: {error.strerror}"
            ) from None
        self._last_sign_s = time.monotonic()
        self._watcher = threading.Thread(target=self._watch, name="board watchdog", daemon=True)
        self._watcher.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        if self._process.poll() is None:
            try:
                self._process.wait(0.0 if kind else _SHUTDOWN_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._process.wait()
        self._watcher.join()
        os.close(self.actuator_fd)
        os.close(self.sensor_fd)
        self._folder.cleanup()

    def _watch(self) -> None:
        while self._process.poll() is None:
            try:
                self._process.wait(_POLL_S)
            except subprocess.TimeoutExpired:
                silent_s = time.monotonic() - self._last_sign_s
                if silent_s > self._watchdog_s and not self._closing.is_set():
                    self._hung = True
                    self._process.kill()
        os.close(self._keep_open_fd)

    def sign_of_life(self, tick: int) -> None:
        """The board has computed this many ticks: winds up the watchdog."""
        self._tick = tick
        self._last_sign_s = time.monotonic()

    def failure(self) -> str | None:
        """Why the board is gone, on one line; None while it runs, or when it was asked to end."""
        try:
            code = self._process.wait(2.0 * _POLL_S)
        except subprocess.TimeoutExpired:
            return None
        if self._hung:
            reason = f"gave no tick for {self._watchdog_s:g} s and was ended"
        elif code == 0:
            return None
        elif code < 0:
            reason = f"was ended by signal {-code}"
        else:
            reason = f"ended with code {code} ({_EXIT_CODES.get(code, 'unknown')})"
        last = self.console().strip().splitlines()[-1:]
        return f"board {self._type.name} {reason}; last sign of life at tick {self._tick}" + "".join(
            f"; it said: {t}" for t in last
        )

    def console(self) -> str:
        """What the board has printed."""
        folder = Path(self._folder.name)
        texts = [
            (folder / name).read_bytes().decode(errors="replace")
            for name in (_STDOUT, _CONSOLE)
            if (folder / name).exists()
        ]
        return "".join(texts)


def run_closed_loop(
    core: Any, scene: dict[str, Any], board: BoardType, progress: Progress, watchdog_s: float = WATCHDOG_S
) -> tuple[dict[str, Any], str]:
    """Runs a scene (`Scene.to_dict`) against a board. Returns the core's results and what the board printed.

    Raises BoardError when the board fails, else what `core.run_closed_loop` or `progress` raises.
    """
    with Board(board, watchdog_s) as running:

        def watched_progress(done: int, total: int) -> bool:
            running.sign_of_life(done)
            return progress(done, total)

        try:
            results = core.run_closed_loop(
                scene, running.actuator_fd, running.sensor_fd, watched_progress, str(cache_folder() / "bases")
            )
        except RuntimeError as error:
            failure = running.failure()
            if failure is not None:
                raise BoardError(failure) from error
            raise
        return results, running.console()
