"""`palpate calibrate LINK`: the steps with an operator at a terminal, calibration.json and a picture of the sweeps."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.board_link import BoardLink, BoardLinkError
from palpate.calibration import arm
from palpate.calibration.session import Calibration, Drive, StepError
from palpate.calibration.steps import STEPS
from palpate.experiment import take_folder
from palpate.scene_schema import SceneError

RESULTS, PICTURE = "calibration.json", "calibration.png"
FIELDS = (
    "encoder.sign", "setpoint.offset_a", "setpoint.gain", "monitor.offset_a", "monitor.gain", "friction.coulomb_n_m",
    "friction.viscous_n_m_s", "friction.compensated_share", "gravity.torque_n_m",
)  # fmt: skip
# What only watches: motors stay off, and no origin is set.
UNASKED = ("direction", "monitors")


def parse_setting(text: str) -> tuple[str, tuple[float, ...]]:
    """NAME=A,B,C of --set. Raises SceneError."""
    name, _, numbers = text.partition("=")
    if name not in FIELDS:
        raise SceneError(f"--set {text}: {name!r} must be one of {', '.join(FIELDS)}")
    try:
        values = tuple(float(number) for number in numbers.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(math.isfinite(value) for value in values):
        raise SceneError(f"--set {text}: must be three numbers, base, upper arm and forearm: {name}=A,B,C")
    return name, values


def parse_steps(names: Sequence[str] | None, unasked: bool) -> tuple[str, ...]:
    """Of --steps, in the order in which they build on each other; `unasked`: --yes. Raises SceneError."""
    for name in names or ():
        if name not in STEPS:
            raise SceneError(f"--steps {name}: must be one of {', '.join(STEPS)}")
    steps = tuple(name for name in STEPS if names is None or name in names)
    asking = [name for name in steps if name not in UNASKED]
    if unasked and asking:
        raise SceneError(
            f"--yes: not with {', '.join(asking)}, whose operator must agree before the zero is set or the arm moves; must be --steps {' '.join(UNASKED)}, or one of them"
        )
    return steps


def registers(board: BoardLink) -> dict[str, dict[str, Any]]:
    """What the board has now."""
    read = [board.read_register(name) for name in FIELDS]
    return {one.name: {"values": list(one.values), "persistent": one.is_persistent} for one in read}


def calibrate(
    board: BoardLink,
    steps: Sequence[str],
    settings: Sequence[tuple[str, tuple[float, ...]]],
    ask: Callable[[str, str, Drive | None], None],
    tell: Callable[[str], None],
    patience_s: float,
    out: Path,
) -> dict[str, Any]:
    """Settings first, then the steps until one fails; writes calibration.json and, where a joint was swept, the picture. Returns the file's content
    with `files`. Raises SceneError for a folder that cannot be, BoardLinkError where the link fails or a setting is refused."""
    take_folder(out, (RESULTS, PICTURE), "palpate calibrate")
    info = board.info()
    calibration = Calibration(board, ask, patience_s)
    before = registers(board)
    for name, wanted in settings:
        calibration.write(name, np.array(wanted))
        tell(f"{name} = {', '.join(f'{value:g}' for value in wanted)}")
    done: list[dict[str, Any]] = []
    for name in steps:
        tell(f"{name} ...")
        try:
            found = STEPS[name](calibration)
        except (StepError, BoardLinkError) as error:
            why = "; ".join([str(error), *getattr(error, "__notes__", [])])
            done.append({"step": name, "ok": False, "why": why})
            tell(f"{name} failed: {why}")
            break
        done.append({"step": name, "ok": True, **found})
        tell(f"{name}: {_said(found)}")
    after = registers(board)
    # A joint without weight has no torque of it: JSON has no NaN.
    fits = [{name: None if math.isnan(value) else value for name, value in vars(fit).items()} for fit in calibration.fits]
    values: dict[str, Any] = {"command": "calibrate", "board": info.board, "steps": done, "ok": all(one["ok"] for one in done),
                              "before": before, "after": after, "fits": fits}  # fmt: skip
    files = {RESULTS: str(out / RESULTS)}
    (out / RESULTS).write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if calibration.sweeps:
        _draw(calibration, out / PICTURE)
        files[PICTURE] = str(out / PICTURE)
    return {**values, "files": files}


def _said(found: dict[str, Any]) -> str:
    registers = {name: values for name, values in found.items() if "." in name}
    return "; ".join(f"{name} = {', '.join(f'{value:.4g}' for value in values)}" for name, values in registers.items()) or "done"


def _draw(calibration: Calibration, file: Path) -> None:
    """Torque over angle of each joint's sweep: a loop as high as twice the friction, about the weight's line."""
    from palpate.reproduce import plot

    figure, axes = plot.grid(3, 1, (1.0,) * 3)
    for panel, sweep in zip(axes[:, 0], calibration.sweeps, strict=True):
        joint = sweep.joint
        angle = sweep.joint_rad[:, joint]
        panel.plot(angle, 1e3 * arm.TORQUE_N_M_A[joint] * sweep.measured_A[:, joint], ".", color=plot.GREY, markersize=1.5, label="measured")
        if calibration.fits:
            fit = calibration.fits[joint]
            places = np.linspace(angle.min(), angle.max(), 100)
            weight = (np.zeros(100), np.cos(places), np.sin(places))[joint] * (fit.gravity_N_m if joint else 0.0)
            for sign, colour in ((1.0, plot.BLUE), (-1.0, plot.RED)):
                panel.plot(places, 1e3 * (weight + sign * fit.coulomb_N_m), color=colour, label=f"weight {'+' if sign > 0 else '-'} Coulomb friction")
        panel.set_ylabel("torque [mN m]", fontsize=8)
        panel.set_title(arm.JOINTS[joint], fontsize=9)
        panel.legend(fontsize=7)
    axes[-1, 0].set_xlabel("joint angle [rad]", fontsize=8)
    plot.save(figure, file)
