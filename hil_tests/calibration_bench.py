"""A board in virtual time with an arm whose encoders, monitors and amplifiers are not as the firmware takes them to be, and an operator who does as he
is asked: for tests of `palpate calibrate`."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from board_peer import Lockstep

from palpate import Plant
from palpate.calibration.arm import tip_m
from palpate.calibration.session import Drive

HAND_SPEED_M_S = 0.1
LOOSE = 0.02  # 100 N/m
# What an operator may take to find the key: longer than the second after which a board without forces switches its outputs off.
KEY_TICKS = 3000


@dataclass
class FaultyArm:
    """What is wrong with it: encoder_sign (3,); monitor_offset_A (3,) added to what the monitors say, with noise of monitor_noise_A;
    amplifiers that, told u, let (u + setpoint_offset_A) / setpoint_gain flow; motor_sign: -1 for a motor whose wires are exchanged, 0 for none; dead and exchanged: an encoder that stands still, two that are
    exchanged."""

    encoder_sign: tuple[int, ...] = (1, 1, 1)
    monitor_offset_A: tuple[float, ...] = (0.0, 0.0, 0.0)
    monitor_noise_A: float = 0.0
    setpoint_offset_A: tuple[float, ...] = (0.0, 0.0, 0.0)
    setpoint_gain: tuple[float, ...] = (1.0, 1.0, 1.0)
    motor_sign: tuple[int, ...] = (1, 1, 1)
    dead: tuple[int, ...] = ()
    exchanged: tuple[int, int] | None = None


class Bench:
    """The link of a BoardLink (write, read, is_open) and its clock. Time passes while somebody reads."""

    is_open = True

    def __init__(self, board: Lockstep, faults: FaultyArm) -> None:
        self.board, self.faults = board, faults
        self._gain = np.array(faults.setpoint_gain)
        offset_A = np.array(faults.setpoint_offset_A) / self._gain * faults.motor_sign
        self.plant = Plant([(0.0, (0.0, 0.0, 0.0))], device={"amplifier_offset_A": offset_A.tolist()})
        self.flags = 0  # of the next tick
        self._target_m = self._hand_m = np.zeros(3)
        self._to_board = b""
        self._noise = np.random.default_rng(1)
        self.ticks = 0

    def clock(self) -> float:
        return 1e-3 * self.ticks

    def write(self, frame: bytes) -> bool:
        self._to_board += frame
        return True

    def read(self, longest_s: float) -> bytes:
        for _ in range(max(1, round(1e3 * longest_s))):
            heard = self.tick()
            if heard:
                return heard
        return b""

    def tick(self) -> bytes:
        way = self._target_m - self._hand_m
        distance_m = float(np.linalg.norm(way))
        if distance_m > 0:
            self._hand_m = self._hand_m + way * min(1.0, 1e-3 * HAND_SPEED_M_S / distance_m)
            self.plant.guide(self._hand_m)
        counts = self.plant.encoder_counts * np.array(self.faults.encoder_sign)
        for joint in self.faults.dead:
            counts[joint] = 0
        if self.faults.exchanged:
            one, other = self.faults.exchanged
            counts[[one, other]] = counts[[other, one]]
        currents = self.plant.measured_current_A * self.faults.motor_sign + self.faults.monitor_offset_A + self.faults.monitor_noise_A * self._noise.standard_normal(3)
        frame = self.board.tick(encoder=tuple(int(count) for count in counts), current_A=tuple(float(one) for one in currents), link=self._to_board, flags=self.flags)
        self._to_board = b""
        self.board.frames.clear()
        self.board.sent.clear()
        self.plant.advance(frame["setpoint_A"] / self._gain * self.faults.motor_sign, bool(frame["enabled"]))
        self.ticks += 1
        return bytes(frame["link"][: frame["link_length"]])

    # The operator

    def move_hand(self, joint_rad: tuple[float, ...]) -> None:
        self._target_m = tip_m(np.array(joint_rad))


@dataclass
class Operator:
    """Does what the keys of the steps mean; `overrides` replace what he does for one of them. keys: in the order in which he was asked;
    strayed_rad: how far the arm was from the reference pose when he took it again."""

    bench: Bench
    overrides: dict[str, Callable[[Bench], None]] = field(default_factory=dict)
    keys: list[str] = field(default_factory=list)
    strayed_rad: float = float("nan")

    def ask(self, key: str, text: str, drive: Drive | None) -> None:
        assert text
        self.keys.append(key)
        if key in self.overrides:
            self.overrides[key](self.bench)
            return
        # He goes from pose to pose, so that one joint moves between two of them.
        poses = {"base": (0.1, 0.0, 0.0), "upper arm": (0.1, 0.1, 0.0), "forearm": (0.1, 0.1, 0.1), "zero": (0.0, 0.0, 0.0), "hold": (0.0, 0.0, 0.0)}
        if key in poses:
            self.bench.move_hand(poses[key])
        if key in ("zero", "hold"):  # he says so when he is there
            for _ in range(1500):
                self.bench.write(b"")
                self.bench.tick()
        if key == "hold":
            self.bench.plant.set_grip(LOOSE)
        if key == "release":
            self.bench.plant.set_grip(0.0)
        if key in ("release", "take"):
            begun = self.bench.ticks
            while self.bench.ticks < begun + KEY_TICKS:
                if drive is None:
                    self.bench.tick()
                else:
                    drive()
        if key == "take":
            self.strayed_rad = float(np.abs(self.bench.plant.joint_rad).max())
            self.bench.plant.set_grip(1.0)
