"""A board at a link of the operating system: asks it who it is, reads its state, arms it."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.body import Floats
from palpate.record_layout import BOARD_MODES

# palpate.Command
_ARM_REQUEST, _ARM_CONFIRM, _DISARM, _CALIBRATE, _CLEAR_FAULT, _STOP, _ARM_DIRECT = range(1, 8)
_TICKS_PER_S = 1000
_READ_S = 0.05
# It takes 100 ticks of rest, and begins within a tick or two.
_CALIBRATION_TICKS = 110


def _list(values: Sequence[float] | Floats) -> str:
    return ", ".join(f"{value:g}" for value in values)


class BoardLinkError(RuntimeError):
    """No answer, a refusal, or a board of other message definitions."""


@dataclass(frozen=True)
class BoardInfo:
    """What a board is: its answer to GetInfo (docs/protocol.md)."""

    board: str
    firmware: str
    schema_hash: int
    max_modes: int
    max_nodes: int
    basis_slots: int
    tick_rate_Hz: int
    tip_history_ticks: int


@dataclass(frozen=True)
class BoardState:
    """The newest BoardStatus, and tip and force of the newest tick of a trace.

    tick: of the board's clock, 1 ms. mode: one of BOARD_MODES. faults: bits of docs/safety.md. tip_m, force_N (3,): device frame;
    None: no trace has come, or its form, which whoever serves the board chooses (palpate.TraceRequest), does not have it: a TipTrace
    has no force.
    """

    tick: int
    mode: str
    faults: int
    models_taken: int
    frames_refused: int
    missed_deadlines: int
    tip_m: Floats | None
    force_N: Floats | None


@dataclass(frozen=True)
class Register:
    """A register of the board (docs/protocol.md, "Registers"). time_s: of the board's clock, when it was read."""

    name: str
    values: tuple[float, ...]
    is_mutable: bool
    is_persistent: bool
    time_s: float


class Link(Protocol):
    """What a board is behind."""

    def write(self, frame: bytes) -> bool: ...
    def read(self, longest_s: float) -> bytes: ...
    @property
    def is_open(self) -> bool: ...


class BoardLink:
    """A board behind a link. Use as a context manager: when the block ends the board is disarmed and the link closed.

    link: a serial port ("/dev/ttyACM0", with `baud`; None: 921,600, that of the boards), or an address as in docs/device_api.md ("udp:192.168.1.7:5760").

    Arming switches the motors on: keep hands clear and read docs/safety.md first. One thread. Methods raise BoardLinkError
    when no answer comes in time. A program may bring what carries Cyphal/serial itself (`over`), and the clock that goes with it: tests
    in virtual time do.
    """

    def __init__(
        self,
        link: str,
        baud: int | None = None,
        timeout_s: float = 5.0,
        *,
        over: Link | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._timeout_s = timeout_s
        self.clock = clock
        self._started_s = clock()
        self._received: deque[dict[str, Any]] = deque()
        self._trace: dict[str, Any] | None = None
        self._status: dict[str, Any] | None = None
        self._armed = False
        self._link: Link
        if over is not None:
            self._link, self._endpoint = over, _core.HostEndpoint(None)
        else:
            try:
                rate = "" if baud is None else f",{baud}"
                transport = _core.Transport(link if ":" in link else f"serial:{link}{rate}")
            except RuntimeError as error:
                raise BoardLinkError(f"{link}: cannot be opened: {error}") from None
            self._link, self._endpoint = transport, _core.HostEndpoint(transport)
        self.name = link
        self._link.write(self._endpoint.get_info()[0])  # over UDP a board answers whom it has heard

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self._armed:
                self.disarm()
        finally:
            del self._link

    def info(self) -> BoardInfo:
        """Asks who the board is. Raises BoardLinkError where its message definitions are not the host's."""
        frame, transfer_id = self._endpoint.get_info()
        self._link.write(frame)
        answer = self._wait("GetInfo", transfer_id)
        info = BoardInfo(**{name: answer[name] for name in BoardInfo.__dataclass_fields__})
        if info.schema_hash != _core.SCHEMA_HASH:
            raise BoardLinkError(
                f"{self.name}: message schema {info.schema_hash:016x}: must be the host's, {_core.SCHEMA_HASH:016x}"
            )
        return info

    def state(self) -> BoardState:
        """Waits for the next status (ten a second) and returns it."""
        return self._state_of(self._wait("BoardStatus"))

    @property
    def newest_state(self) -> BoardState | None:
        """Of the newest status that came while something was waited for; does not wait. None: none has come yet."""
        return None if self._status is None else self._state_of(self._status)

    def _state_of(self, status: dict[str, Any]) -> BoardState:
        trace = self._trace
        return BoardState(
            tick=status["tick"],
            mode=BOARD_MODES[status["mode"]],
            faults=status["faults"],
            models_taken=status["models_taken"],
            frames_refused=status["frames_refused"],
            missed_deadlines=status["missed_deadlines"],
            tip_m=None if trace is None else trace["tip_m"][-1].astype(np.float64),
            force_N=None if trace is None or "force_N" not in trace else trace["force_N"][-1].astype(np.float64),
        )

    def register_names(self) -> list[str]:
        """Those of the board's registers, in its order."""
        names: list[str] = []
        while True:
            frame, transfer_id = self._endpoint.register_list(len(names))
            self._link.write(frame)
            name = self._wait("RegisterList", transfer_id)["name"]
            if not name:
                return names
            names.append(name)

    def read_register(self, name: str) -> Register:
        """Raises BoardLinkError where the board has none of that name."""
        return self._access(name, [])

    def find_register(self, name: str) -> Register | None:
        """None where the board has none of that name."""
        return self._try_access(name, [])

    def write_register(self, name: str, values: ArrayLike) -> Register:
        """Three numbers, by joint; in use, and stored where the board can, when it returns. Raises BoardLinkError where the board has
        no such register, or refuses: out of range, armed, or not stored."""
        wanted = np.asarray(values, np.float32)
        now = self._access(name, wanted.tolist())
        if not now.is_mutable:
            raise BoardLinkError(f"{self.name}: register {name} can only be read")
        if now.values != tuple(wanted.tolist()):
            least, most = self.read_register(name + ">").values, self.read_register(name + "<").values
            raise BoardLinkError(
                f"{self.name}: register {name} = {_list(wanted.tolist())}: refused, it is still {_list(now.values)}; must be from {_list(least)} to {_list(most)}, and the board disarmed"
            )
        return now

    def _access(self, name: str, values: list[float]) -> Register:
        found = self._try_access(name, values)
        if found is None:
            raise BoardLinkError(f"{self.name}: no register {name!r}: it has {', '.join(self.register_names())}")
        return found

    def _try_access(self, name: str, values: list[float]) -> Register | None:
        try:
            frame, transfer_id = self._endpoint.register_access(name, values)
        except ValueError as error:
            raise BoardLinkError(f"{self.name}: {error}") from None
        self._link.write(frame)
        answer = self._wait("RegisterAccess", transfer_id)
        if answer["value"] is None:
            return None
        return Register(name, tuple(answer["value"]), answer["mutable"], answer["persistent"], 1e-6 * answer["read_us"])

    def push(self, force_N: ArrayLike) -> None:
        """The force that the tip exerts on the hand from now on (3,), device frame; armed with `direct`, and again within
        20 ms, or it fades. The board limits it."""
        self._link.write(self._endpoint.direct_force(np.asarray(force_N, np.float64).tolist()))

    def arm(self, patience_s: float = 0.0, direct: bool = False) -> None:
        """Switches the outputs on, in the two steps of docs/protocol.md; `direct` for forces of this program (push) in place of
        a model's. Raises BoardLinkError where the board is none of the
        project's (boards/), whose limits nobody here has checked, or has other message definitions; and with the board's status where
        it refuses: it is not idle, a fault is there, the tip is outside of its workspace or too fast, or it has just missed
        deadlines, as a board that is a process on a busy computer does. While it is idle it is asked again for patience_s."""
        name = self.info().board
        if name not in _core.KNOWN_BOARDS:
            raise BoardLinkError(f"{self.name}: board {name!r} is not armed: must be one of {', '.join(_core.KNOWN_BOARDS)}")
        deadline_s = self.clock() + patience_s
        self._armed = True  # from here on leave it disarmed, whatever happens
        while True:
            try:
                token = self._command("arming", _ARM_DIRECT if direct else _ARM_REQUEST)["token"]
                self._command("confirming", _ARM_CONFIRM, token)
                return
            except BoardLinkError:
                if self.clock() > deadline_s or self.state().mode != "idle":
                    raise

    def disarm(self) -> None:
        """Switches the outputs off."""
        self._command("disarming", _DISARM)
        self._armed = False

    def calibrate(self) -> None:
        """Makes the present pose the reference pose; idle and hand off. Returns when that is done. Raises BoardLinkError where
        the board refuses, or the tip does not come to rest within timeout_s."""
        self._command("calibrating", _CALIBRATE)
        begun, deadline_s = self.state(), self.clock() + self._timeout_s
        now = begun
        while now.mode == "calibrate" or now.tick < begun.tick + _CALIBRATION_TICKS:
            if self.clock() > deadline_s:
                raise BoardLinkError(f"{self.name}: calibrating: the tip does not rest")
            now = self.state()

    def clear_fault(self) -> None:
        """From fault to idle, when the cause has gone."""
        self._command("clearing the fault", _CLEAR_FAULT)

    def stop(self) -> None:
        """Emergency stop: outputs off, fault latched."""
        self._command("stopping", _STOP)

    def _command(self, what: str, action: int, token: int = 0) -> dict[str, Any]:
        frame, transfer_id = self._endpoint.command(action, token)
        self._link.write(frame)
        answer = self._wait("Command", transfer_id)
        if answer["status"] != 0:
            mode = BOARD_MODES[answer["mode"]]
            raise BoardLinkError(
                f"{self.name}: {what}: refused in mode {mode} with status {answer['status']}: docs/safety.md has the conditions"
            )
        return answer

    def _wait(self, message: str, transfer_id: int | None = None) -> dict[str, Any]:
        """The next message of this name; all before it are dropped, but for the newest trace and status."""
        deadline_s = self.clock() + self._timeout_s
        while True:
            while self._received:
                one = self._received.popleft()
                if one["message"] == "BoardStatus":
                    self._status = one
                if one["message"] in ("ServoTrace", "TipTrace"):
                    self._trace = one
                elif one["message"] == message and transfer_id in (None, one.get("transfer_id")):
                    return one
            if not self._link.is_open:
                raise BoardLinkError(f"{self.name}: the link has gone")
            if self.clock() > deadline_s:
                raise BoardLinkError(f"{self.name}: no {message} within {self._timeout_s:g} s: is it a board, and awake?")
            tick = int((self.clock() - self._started_s) * _TICKS_PER_S)
            self._received += self._endpoint.receive(self._link.read(_READ_S), tick)
