"""Made-up results of an experiment, in the shape in which the core returns them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
NODES = 8


def lattice(nodes: int = NODES, spacing_m: float = 0.01) -> tuple[Array, Array]:
    """Rest positions (nodes^3, 3) in m of a cube below the origin, x fastest, and its surface triangles."""
    z, y, x = np.meshgrid(*[np.arange(nodes)] * 3, indexing="ij")
    rest_m = spacing_m * np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(float)
    rest_m -= spacing_m * np.array([(nodes - 1) / 2, (nodes - 1) / 2, nodes - 1]) + np.array([0.0, 0.0, 0.02])
    index = np.arange(nodes**3).reshape(nodes, nodes, nodes)
    triangles = []
    for face, flip in (
        (index[-1], False),
        (index[0], True),
        (index[:, 0], False),
        (index[:, -1], True),
        (index[:, :, 0], True),
        (index[:, :, -1], False),
    ):
        a, b, c, d = (
            face[:-1, :-1].ravel(),
            face[:-1, 1:].ravel(),
            face[1:, 1:].ravel(),
            face[1:, :-1].ravel(),
        )
        pairs = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
        triangles.append(pairs[:, ::-1] if flip else pairs)
    return rest_m, np.concatenate(triangles)


def body_values(nodes: int = NODES) -> dict[str, Any]:
    """The datasets body/*: a dimple of 5 mm, dragged sideways."""
    rest_m, triangles = lattice(nodes)
    tip_m = np.array([0.012, 0.003, -0.025])
    squared = np.sum(np.square(rest_m - tip_m), axis=1)
    displacement = np.exp(-squared / (2 * 0.012**2))[:, None] * np.array([0.002, 0.0, -0.005])
    return {
        "body/time_s": 2.5,
        "body/rest_m": rest_m,
        "body/position_m": rest_m + displacement,
        "body/tip_m": tip_m,
        "body/triangles": triangles,
        "body/triangle_friction": np.full((len(triangles), 2), 0.5),
        "body/patch_nodes": np.argsort(squared)[:16],
    }


def run_values(ticks: int = 5000, nodes: int = NODES) -> tuple[dict[str, Any], dict[str, int]]:
    """The datasets of a run and its counters: a press, a drag that sticks and slips, and a release."""
    k = np.arange(ticks)
    t = k / ticks
    pressing_N = 1.6 * np.clip((t - 0.2) / 0.1, 0, 1) * np.clip((0.85 - t) / 0.1, 0, 1)
    sawtooth = (
        np.clip((t - 0.4) / 0.02, 0, 1) * (0.55 + 0.45 * ((t * 25) % 1.0)) * np.clip((0.8 - t) / 0.02, 0, 1)
    )
    tangential_N = pressing_N * sawtooth
    force_N = np.stack([tangential_N, 0 * t, -pressing_N], axis=1)
    mode = np.where(pressing_N <= 0, 0, np.where(sawtooth > 0.93, 2, 1))
    wiggle_N = 0.03 * np.sin(2 * np.pi * 90 * t) * (pressing_N > 0)
    sequence = np.minimum(k // 33, 3 * ticks)
    updates = int(sequence[-1])
    update_tick = 33 * (1 + np.arange(updates))
    zeros = np.zeros(ticks)
    vectors = np.zeros((ticks, 3))
    tip_m = np.stack(
        [
            -0.015 + 0.03 * np.clip((t - 0.4) / 0.4, 0, 1),
            0.003 + 0 * t,
            -0.025 * np.clip(t / 0.25, 0, 1) * np.clip((1 - t) / 0.15, 0, 1),
        ],
        axis=1,
    )
    values: dict[str, Any] = {
        "ticks/tick": k,
        "ticks/encoder_count": np.rint(1e4 * tip_m),
        "ticks/measured_current_A": vectors,
        "ticks/setpoint_A": 0.1 * force_N,
        "ticks/enabled": np.ones(ticks),
        "ticks/tip_m": tip_m,
        "ticks/force_N": force_N + wiggle_N[:, None] * np.array([0.5, 0.0, 1.0]),
        "ticks/contact_mode": mode,
        "ticks/triangle": zeros,
        "ticks/barycentric": vectors + 1 / 3,
        "ticks/normal": np.where((mode == 0)[:, None], 0.0, [0.0, 0.0, 1.0]),
        "ticks/mode": zeros + 3,
        "ticks/faults": zeros,
        "ticks/model_sequence": sequence,
        "ticks/model_age_ticks": 25 + k % 33,
        "ticks/catch_up_ticks": zeros,
        "ticks/true_tip_m": tip_m,
        "ticks/hand_target_m": tip_m - np.array([0, 0, 0.002]),
        "ticks/hand_force_N": force_N,
        "ticks/link_up_bytes": zeros + 40,
        "ticks/link_down_bytes": zeros + 700,
        "ticks/missed_deadlines": zeros,
        "ticks/background_overruns": zeros,
        "ticks/tick_count": zeros + 5000,
        "ticks/busy_count": zeros + 15000,
        "updates/sequence": 1 + np.arange(updates),
        "updates/tick": update_tick - 25,
        "updates/sent_tick": update_tick - 20,
        "updates/swap_tick": update_tick,
        "updates/status": np.zeros(updates),
        "updates/correction_energy_J": 1e-3 * (-1.0) ** np.arange(updates),
        "updates/modes": np.full(updates, 96),
        "updates/nodes": np.full(updates, 32),
        "updates/bytes": np.full(updates, 400),
        "updates/basis_bytes": np.full(updates, 13000),
        "updates/interpolated_ticks": np.zeros(updates),
        "updates/interpolation_error_m": np.zeros(updates),
        "updates/damping_coupling": np.zeros(updates),
        "updates/limited_modes": np.zeros(updates),
        "reference/force_N": force_N,
        "reference/contact_mode": np.roll(mode, 3),
        "reference/normal": np.where((mode == 0)[:, None], np.nan, [0.0, 0.0, 1.0]),
        **body_values(nodes),
    }
    counters = {
        "clock_Hz": 25_000_000,
        "frames_lost_down": 0,
        "frames_lost_up": 0,
        "frames_repeated_up": 0,
        "frames_late_up": 0,
        "models_sent": updates,
        "models_taken": updates,
        "models_refused": 0,
        "basis_waits": 0,
    }
    return values, counters


def simulate_values(ticks: int = 300, times: int = 3) -> dict[str, Any]:
    """The datasets of a simulation with a tip that presses and lets go."""
    t = np.arange(1, ticks + 1) / ticks
    pressing_N = np.clip(np.sin(2 * np.pi * t), 0, None)
    body = body_values()
    nodes = len(body["body/rest_m"])
    growth = np.linspace(0, 1, times)[:, None, None]
    moved_m = body["body/position_m"] - body["body/rest_m"]
    return {
        "tip/time_s": 1e-3 * np.arange(1, ticks + 1),
        "tip/position_m": np.stack([0.012 + 0 * t, 0.003 + 0 * t, -0.02 - 0.004 * pressing_N], axis=1),
        "tip/force_N": np.stack([0.3 * pressing_N, 0 * t, -pressing_N], axis=1),
        "tip/contact_mode": (pressing_N > 0).astype(int),
        "tip/triangle": np.zeros(ticks, int),
        "tip/normal": np.where((pressing_N > 0)[:, None], [0.0, 0.0, 1.0], np.nan),
        "nodes/time_s": np.linspace(0.0, 1e-3 * ticks, times),
        "nodes/position_m": body["body/rest_m"] + growth * moved_m,
        "nodes/velocity_m_s": np.zeros((times, nodes, 3)),
        **body,
        "body/patch_nodes": np.zeros(0),
    }


def sheet_values(nodes: int = 12) -> dict[str, Any]:
    """The datasets of a simulated sheet, without a tip."""
    z, x = np.meshgrid(np.arange(nodes), np.arange(nodes), indexing="ij")
    rest_m = 0.01 * np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3).astype(float)
    bump_m = 0.004 * np.exp(-np.sum(np.square(rest_m - rest_m[-nodes // 2]), axis=1) / (2 * 0.015**2))
    position_m = rest_m + bump_m[:, None] * np.array([0.0, 0.0, 1.0])
    return {
        "nodes/time_s": np.zeros(0),
        "nodes/position_m": np.zeros((0, len(rest_m), 3)),
        "nodes/velocity_m_s": np.zeros((0, len(rest_m), 3)),
        "body/time_s": 0.5,
        "body/rest_m": rest_m,
        "body/position_m": position_m,
        "body/tip_m": np.full(3, np.nan),
        "body/triangles": np.zeros((0, 3)),
        "body/triangle_friction": np.zeros((0, 2)),
        "body/patch_nodes": np.zeros(0),
    }
