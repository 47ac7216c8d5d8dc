"""Programmed experiments (Jacobs, Fu, Cavusoglu 2010, section 5.1) on the real core: a scripted tip."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from command import palpate
from numpy.typing import NDArray

BODY = """
duration_s = 0.4
[body]
nodes = [6, 6, 6]
origin_m = [-0.025, -0.025, -0.07]
fixed_faces = ["z-"]
"""
# 3 mm into the body and out again.
PATH_M = np.array([[0.001, 0.002, -0.018], [0.001, 0.002, -0.023], [0.004, 0.002, -0.018]])
PATH_S = np.array([0.1, 0.2, 0.35])
PRESS = (
    "[contact]\nfriction = 0.5\n[path]\nwaypoints = ["
    + ", ".join(
        f"{{ time_s = {t}, position_m = {x.tolist()} }}" for t, x in zip(PATH_S, PATH_M, strict=True)
    )
    + ']\n[board]\nname = "native"\n'
)
SCRIPTED = '[hand]\nkind = "scripted"\n'


def record(
    folder: Path, text: str, command: str = "run", outputs: str = "csv = false\npictures = false\n"
) -> dict[str, NDArray[Any]]:
    """All datasets of a scene's record."""
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(f"{text}[outputs]\n{outputs}")
    done = palpate(command, "scene.toml", "--json", "--out", "out", cwd=folder)
    assert done.returncode == 0, done.stderr
    values: dict[str, NDArray[Any]] = {}

    def take(path: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.shape != ():
            values[path] = item[()]

    with h5py.File(folder / "out/record.h5") as file:
        file.visititems(take)
    return values


def minimum_jerk(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions (n, 3) of the path at times (n,)."""
    u = np.clip((time_s[:, None] - PATH_S[:-1]) / np.diff(PATH_S), 0.0, 1.0)
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    positions: NDArray[np.float64] = PATH_M[0] + s @ np.diff(PATH_M, axis=0)
    return positions


def test_a_scripted_tip_is_on_its_path_in_every_tick(tmp_path: Path) -> None:
    values = record(tmp_path, BODY + PRESS + SCRIPTED)
    path_m = minimum_jerk(values["ticks/tick"] * 1e-3)
    assert np.abs(values["ticks/force_N"]).max() > 0.5
    # rounding of the kinematics; the board sees half an encoder count beside it, 0.03 mm, with every joint
    np.testing.assert_allclose(values["ticks/true_tip_m"], path_m, atol=1e-14)
    np.testing.assert_allclose(values["ticks/tip_m"], path_m, atol=6e-5)
    # Outputs are on and the motors act, though nothing gives way.
    assert np.abs(values["ticks/measured_current_A"]).max() > 0.1
