"""Pictures: drawn for every kind of result, and not empty."""

from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from synthetic import NODES, run_values, sheet_values, simulate_values

from palpate import figures
from palpate.figures import BodyShape, ForceTrace

# A white page with axes and labels alone has fewer pixels that are not white.
INK_FRACTION = 0.02


def ink(file: Path) -> float:
    """Fraction of pixels that are not white; also checks that there are many colours."""
    pixels = matplotlib.image.imread(file)[..., :3]
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50
    return float(np.mean(np.any(pixels < 0.99, axis=-1)))


def shape(values: dict[str, Any], lattice: tuple[int, int, int]) -> BodyShape:
    return BodyShape(
        values["body/rest_m"],
        values["body/position_m"],
        values["body/triangles"].astype(int),
        lattice,
        values["body/patch_nodes"].astype(int),
    )


@pytest.mark.parametrize("friction", [((1.0, 1.0),), ((0.8, 0.5),), ((0.0, 0.0),), ((1.0, 1.0), (0.3, 0.2))])
def test_forces_of_a_run(tmp_path: Path, friction: tuple[tuple[float, float], ...]) -> None:
    values, _ = run_values(ticks=1000)
    # One pair after the other, as on a body with regions.
    of_tick = np.array(friction)[np.arange(1000) * len(friction) // 1000]
    figures.save_forces(
        tmp_path / "forces.png",
        title="run",
        time_s=1e-3 * values["ticks/tick"],
        rendered=ForceTrace(values["ticks/force_N"], values["ticks/contact_mode"], values["ticks/normal"]),
        friction=of_tick,
        reference=ForceTrace(
            values["reference/force_N"], values["reference/contact_mode"], values["reference/normal"]
        ),
        model_age_ticks=values["ticks/model_age_ticks"],
    )
    assert ink(tmp_path / "forces.png") > INK_FRACTION


def test_marks_have_a_row_each_and_shade_the_forces(tmp_path: Path) -> None:
    values, _ = run_values(ticks=1000)

    def draw(name: str, marks: figures.Marks | None) -> np.ndarray:
        figures.save_forces(
            tmp_path / name, title="run", time_s=1e-3 * values["ticks/tick"],
            rendered=ForceTrace(values["ticks/force_N"], values["ticks/contact_mode"], values["ticks/normal"]),
            friction=np.zeros((1000, 2)), marks=marks,
        )  # fmt: skip
        image: np.ndarray = matplotlib.image.imread(tmp_path / name)[..., :3]
        return image

    def orange(image: np.ndarray) -> int:
        return int((np.abs(image - np.array([0xD9, 0x82, 0x00]) / 255).max(axis=-1) < 0.02).sum())

    none, empty = draw("none.png", None), draw("empty.png", figures.Marks({}, ()))
    assert none.shape == empty.shape and orange(none) == 0
    rows = {"cable out": [(0.2, 0.6)], "outputs off": [(0.5, 0.7)]}
    both, other = draw("both.png", figures.Marks(rows, ("cable out",))), draw("other.png", figures.Marks(rows, ()))
    assert both.shape[0] > none.shape[0] and orange(both) > 1000 and orange(other) == 0


def test_forces_of_a_simulation(tmp_path: Path) -> None:
    values = simulate_values()
    figures.save_forces(
        tmp_path / "forces.png",
        title="simulation",
        time_s=values["tip/time_s"],
        rendered=ForceTrace(values["tip/force_N"], values["tip/contact_mode"], values["tip/normal"]),
        friction=np.full((len(values["tip/time_s"]), 2), 0.5),
    )
    assert ink(tmp_path / "forces.png") > INK_FRACTION


def test_forces_of_a_single_tick(tmp_path: Path) -> None:
    figures.save_forces(
        tmp_path / "forces.png",
        title="one tick",
        time_s=np.array([0.001]),
        rendered=ForceTrace(np.zeros((1, 3)), np.zeros(1), np.full((1, 3), np.nan)),
        friction=np.zeros((1, 2)),
    )
    assert (tmp_path / "forces.png").exists()


@pytest.mark.parametrize("tip_radius_m", [0.0, 0.004])
def test_block(tmp_path: Path, tip_radius_m: float) -> None:
    values, _ = run_values(ticks=100)
    figures.save_body(
        tmp_path / "body.png",
        title="block",
        body=shape(values, (NODES, NODES, NODES)),
        tip_m=values["body/tip_m"],
        tip_radius_m=tip_radius_m,
        path_m=values["ticks/tip_m"],
    )
    assert ink(tmp_path / "body.png") > INK_FRACTION


def test_block_at_rest_without_a_tip(tmp_path: Path) -> None:
    values, _ = run_values(ticks=100)
    values["body/position_m"] = values["body/rest_m"]
    figures.save_body(tmp_path / "body.png", title="at rest", body=shape(values, (NODES, NODES, NODES)))
    assert ink(tmp_path / "body.png") > INK_FRACTION


def test_sheet(tmp_path: Path) -> None:
    figures.save_body(tmp_path / "body.png", title="sheet", body=shape(sheet_values(), (12, 1, 12)))
    assert ink(tmp_path / "body.png") > INK_FRACTION


def test_lines_break_at_long_gaps() -> None:
    time_s = np.array([0.0, 0.001, 0.004, 0.1, 0.101])
    line_s, value, vector = figures.with_breaks(time_s, np.arange(5), np.arange(10).reshape(5, 2))
    np.testing.assert_array_equal(line_s, [0.0, 0.001, 0.004, 0.1, 0.1, 0.101])
    np.testing.assert_array_equal(value, [0, 1, 2, np.nan, 3, 4])
    np.testing.assert_array_equal(vector[3:], [[np.nan, np.nan], [6, 7], [8, 9]])
    np.testing.assert_array_equal(figures.with_breaks(time_s[:3], time_s[:3])[1], time_s[:3])


def test_split_of_a_force() -> None:
    normal = np.array([[0, 0, 1.0], [0, 0.6, 0.8], [np.nan] * 3, [0, 0, 0]])
    force_N = np.array([[3.0, 4.0, -2.0], [0.0, -0.6, -0.8], [0.0, 3.0, 4.0], [6.0, 0.0, -8.0]])
    pressing_N, tangential_N = figures.split_force(force_N, normal)
    np.testing.assert_allclose(pressing_N, [2.0, 1.0, 5.0, 10.0], atol=1e-15)
    np.testing.assert_allclose(tangential_N, [5.0, 0.0, 0.0, 0.0], atol=1e-15)
