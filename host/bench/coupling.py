"""Measures what couples the tip with the body: chatter, stiffness felt, delay and stability of each candidate.

    PYTHONPATH=host/python python host/bench/coupling.py --out out/coupling [--quick]

Every number comes from the closed loop with the firmware on the native board: simulated arm and hand, encoder counts of
0.023 to 0.029 mm, local models at 30 Hz, the 12 x 12 x 12 reference body pressed 5 to 7 mm. Writes coupling.json and
coupling.png. docs/decisions/coupling.md says what was chosen and why.
"""

import argparse
import json
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate import _core, hil
from palpate.scene import load_scene

CHATTER_N, STIFFNESS, DELAY_S, OSCILLATION_M = 0.02, 0.02, 1e-3, 5e-5  # targets

_BODY = """
[body]
nodes = [12, 12, 12]
origin_m = [-0.055, -0.055, -0.13]
fixed_faces = ["z-", "x-"]
[integrator]
step_s = 0.0002
[contact]
friction = 1.0
[board]
name = "native"
[reference]
enabled = false
"""
_ABOVE_M, _PRESSED_M = np.array([0.002, 0.001, -0.018]), np.array([0.002, 0.001, -0.0255])
_TICK_S = 1e-3
# Rest: the hand holds its place within a slow drift of 0.015 mm/s, half a count a second, with and without tremor:
# about 30 um of finger tremor with the arm rested (Growdon et al., Electromyogr. Clin. Neurophysiol. 40(5), 2000), read
# as peak to peak, at 8 to 12 Hz, another frequency along each axis.
_DRIFT_M_S, _TREMOR_M, _TREMOR_HZ = 1.5e-5, 1.5e-5, np.array([8.1, 10.4, 9.3])
_WINDOW = 250  # ticks in which the peak to peak is taken: a drift alone changes the force by 1 mN in them
# Motions: frequency and amplitude, about the pressed place.
_MOTIONS = ((1.0, 1e-3), (3.0, 1e-3), (10.0, 1e-3), (20.0, 0.5e-3))
_SETTLED_S = 1.0
_COMPENSATION_S = 2e-3
_GRIPS = (1.0, 0.1, 0.0)
_RELEASE_S, _AFTER_S = 1.0, 5.0
_WATCHED = 2000  # ticks at the end in which the tip's peak to peak is taken
# Without grip the arm rests on the body under 0.5 N: an offset of the shoulder's current, l1 = 0.215 m, ratio 11.2,
# 0.0234 N m/A.
_REST_OFFSET_A = -0.5 * 0.215 / (11.2 * 0.0234)


@dataclass(frozen=True)
class Candidate:
    """One way to couple. stiffness_N_m 0: kinematic."""

    estimated: bool
    stiffness_N_m: float = 0.0
    damping_N_s_m: float = 0.0

    @property
    def name(self) -> str:
        what = "kinematic" if self.stiffness_N_m == 0 else f"{self.stiffness_N_m:g} N/m, {self.damping_N_s_m:g} N s/m"
        return f"{what}, {'estimated' if self.estimated else 'counts'}"

    def section(self) -> str:
        tip = "estimated" if self.estimated else "counts"
        if self.stiffness_N_m == 0:
            return f'[coupling]\nkind = "kinematic"\ntip = "{tip}"\n'
        return (
            f'[coupling]\nkind = "virtual"\ntip = "{tip}"\n'
            f"stiffness_N_m = {self.stiffness_N_m}\ndamping_N_s_m = {self.damping_N_s_m}\n"
        )


def _approach(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """From above the body to the pressed place between 0.2 and 0.7 s, with least jerk."""
    u = np.clip((time_s - 0.2) / 0.5, 0.0, 1.0)[:, None]
    return _ABOVE_M + (_PRESSED_M - _ABOVE_M) * (u**3 * (10 - 15 * u + 6 * u**2))


def _run(position_m: NDArray[np.float64], candidate: Candidate, extra: str) -> dict[str, NDArray[Any]]:
    """The closed loop along a path with one position per tick."""
    with tempfile.TemporaryDirectory() as folder:
        rows = np.column_stack([np.arange(len(position_m)) * _TICK_S, position_m])
        csv = Path(folder) / "path.csv"
        np.savetxt(csv, rows, "%.9g", delimiter=",", header="time_s,x_m,y_m,z_m", comments="")
        file = Path(folder) / "scene.toml"
        file.write_text(
            f'duration_s = {len(position_m) * _TICK_S}\n[path]\ncsv = "path.csv"\n{extra}{_BODY}{candidate.section()}'
        )
        scene = load_scene(file)
        results, _ = hil.run_closed_loop(_core, scene.to_dict(), hil.BOARDS["native"], lambda done, total: True)
    if results["ticks/faults"].max() > 0:
        raise RuntimeError(f"{candidate.name}: the board's supervisor tripped")
    return results


def _peak_to_peak_N(force_N: NDArray[Any]) -> float:
    """Largest peak to peak of a component within a window, after the approach."""
    starts = range(1500, len(force_N) - _WINDOW, 25)
    return float(max(np.ptp(force_N[i : i + _WINDOW], axis=0).max() for i in starts))


def _rest(candidate: Candidate, tremor_m: float) -> dict[str, NDArray[Any]]:
    """The hand at rest on the body."""
    time_s = np.arange(4000) * _TICK_S
    path_m = _approach(time_s)
    path_m += _DRIFT_M_S * np.maximum(time_s - 0.7, 0.0)[:, None] * np.array([1.0, 1.0, -1.0]) / np.sqrt(3.0)
    path_m += tremor_m * np.sin(2 * np.pi * _TREMOR_HZ * time_s[:, None])
    return _run(path_m, candidate, "")


def _motion(frequency_Hz: float, amplitude_m: float) -> tuple[NDArray[np.float64], slice]:
    periods = max(2, round(frequency_Hz * 0.8))
    start, ticks = round(_SETTLED_S / _TICK_S), round(periods / frequency_Hz / _TICK_S)
    first = round(1 / frequency_Hz / _TICK_S)
    time_s = np.arange(start + first + ticks) * _TICK_S
    path_m = _approach(time_s)
    moving = time_s >= _SETTLED_S
    path_m[moving, 2] += amplitude_m * np.sin(2 * np.pi * frequency_Hz * (time_s[moving] - _SETTLED_S))
    return path_m, slice(start + first, start + first + ticks)


def _phasor(values: NDArray[Any], rows: slice, frequency_Hz: float) -> complex:
    time_s = np.arange(len(values))[rows] * _TICK_S
    return complex(np.sum((values[rows] - values[rows].mean()) * np.exp(-2j * np.pi * frequency_Hz * time_s)))


def dynamic_stiffness(candidate: Candidate) -> list[complex]:
    """Force over displacement, N/m, along the motion of a scripted tip, at each of the motions."""
    result = []
    for frequency_Hz, amplitude_m in _MOTIONS:
        path_m, rows = _motion(frequency_Hz, amplitude_m)
        run = _run(path_m, candidate, '[hand]\nkind = "scripted"\n')
        result.append(
            _phasor(run["ticks/force_N"][:, 2], rows, frequency_Hz)
            / _phasor(run["ticks/true_tip_m"][:, 2], rows, frequency_Hz)
        )
    return result


def _body_force_N(tip_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the full body answers to a tip that is exactly there in each tick, its contact point where the tip is."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(
            f"duration_s = {len(tip_m) * _TICK_S}\n[path]\nwaypoints = [{{ time_s = 0.0, position_m = [0.0, 0.0, 0.0] }}]\n"
            f"{_BODY}{Candidate(estimated=False).section()}"
        )
        scene = load_scene(file).to_dict()
    time_s = np.arange(len(tip_m)) * _TICK_S
    results = _core.reference(scene, time_s, np.ascontiguousarray(tip_m), lambda done, total: True)
    return np.asarray(results["reference/force_N"])


def full_body() -> dict[str, Any]:
    """Stiffness along the motions, and the force's peak to peak along the tip of a hand at rest: no encoder in between."""
    felt = []
    for frequency_Hz, amplitude_m in _MOTIONS:
        path_m, rows = _motion(frequency_Hz, amplitude_m)
        force_N = _body_force_N(path_m)
        felt.append(_phasor(force_N[:, 2], rows, frequency_Hz) / _phasor(path_m[:, 2], rows, frequency_Hz))
    rest = {}
    for name, tremor_m in (("drift", 0.0), ("tremor", _TREMOR_M)):
        tip_m = _rest(Candidate(estimated=True), tremor_m)["ticks/true_tip_m"]
        rest[f"peak_to_peak_{name}_N"] = _peak_to_peak_N(_body_force_N(tip_m))
    return {"felt_N_m": [[z.real, z.imag] for z in felt], **rest}


def oscillation_m(candidate: Candidate, grip: float) -> float:
    """Peak to peak of the true tip in the last two seconds of five after the grip has changed."""
    time_s = np.arange(round((_RELEASE_S + _AFTER_S) / _TICK_S)) * _TICK_S
    hand = "" if grip == 1.0 else f"[hand]\ngrip_changes = [{{ time_s = {_RELEASE_S}, grip = {grip} }}]\n"
    offset = f"[device]\namplifier_offset_A = [0.0, {_REST_OFFSET_A if grip == 0.0 else 0.0}, 0.0]\n"
    tip_m = _run(_approach(time_s), candidate, hand + offset)["ticks/true_tip_m"]
    return float(np.ptp(tip_m[-_WATCHED:], axis=0).max())


def measure(candidate: Candidate) -> dict[str, Any]:
    """All numbers of one candidate."""
    stiffness = dynamic_stiffness(candidate)
    return {
        "name": candidate.name,
        **asdict(candidate),
        "chatter_drift_N": _peak_to_peak_N(_rest(candidate, 0.0)["ticks/force_N"]),
        "chatter_tremor_N": _peak_to_peak_N(_rest(candidate, _TREMOR_M)["ticks/force_N"]),
        "oscillation_m": {str(grip): oscillation_m(candidate, grip) for grip in _GRIPS},
        "felt_N_m": [[z.real, z.imag] for z in stiffness],
    }


def compare(row: dict[str, Any], base: list[complex], body: list[complex]) -> None:
    """Adds stiffness and delay against `base`, the kinematic coupling from counts, stiffness against the full body, whose
    difference has the local model's own error in it, and whether the targets are met."""
    felt = [complex(*z) for z in row["felt_N_m"]]
    row["stiffness_error_full_body"] = [abs(z) / abs(z0) - 1.0 for z, z0 in zip(felt, body, strict=True)]
    row["delay_full_body_s"] = [
        float(-np.angle(z / z0)) / (2 * np.pi * f) for z, z0, (f, _) in zip(felt, body, _MOTIONS, strict=True)
    ]
    row["stiffness_error"] = [abs(z) / abs(z0) - 1.0 for z, z0 in zip(felt, base, strict=True)]
    row["delay_s"] = [
        float(-np.angle(z / z0)) / (2 * np.pi * f) for z, z0, (f, _) in zip(felt, base, _MOTIONS, strict=True)
    ]
    if row["stiffness_N_m"] > 0:
        # Had the spring's compliance been taken out of the body's with a time constant: linear theory, not run.
        compensated = [
            abs(1.0 / (1.0 + z0 * lead / (row["stiffness_N_m"] * (1.0 + lead)))) - 1.0
            for z0, (f, _) in zip(base, _MOTIONS, strict=True)
            for lead in [2j * np.pi * f * _COMPENSATION_S]
        ]
        row["stiffness_error_compensated"] = compensated
    row["meets"] = {
        "chatter_drift": row["chatter_drift_N"] <= CHATTER_N,
        "chatter_tremor": row["chatter_tremor_N"] <= CHATTER_N,
        "stiffness": max(map(abs, row["stiffness_error"][:3])) <= STIFFNESS,
        "stiffness_full_body": max(map(abs, row["stiffness_error_full_body"][:3])) <= STIFFNESS,
        "delay": max(row["delay_s"]) <= DELAY_S,
        "stability": max(row["oscillation_m"].values()) <= OSCILLATION_M,
    }


def candidates(quick: bool) -> list[Candidate]:
    """Kinematic and a grid of virtual couplings, each from counts and from the estimate."""
    stiffnesses, dampings = ((2000.0,), (1.0,)) if quick else ((500.0, 2000.0, 10000.0), (1.0,))
    grid = [(0.0, 0.0), *((k, b) for k in stiffnesses for b in dampings)]
    return [Candidate(estimated, k, b) for k, b in grid for estimated in (False, True)]


def draw(rows: list[dict[str, Any]], file: Path) -> None:
    """Chatter against the stiffness error at 10 Hz, and the worst of delay and oscillation."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(13, 4.6), layout="constrained")
    limits = (100 * STIFFNESS, 1e3 * DELAY_S, 1e6 * OSCILLATION_M)
    labels = (
        "largest stiffness error at 1 to 10 Hz (%)",
        "largest delay at 1 to 20 Hz (ms)",
        "largest oscillation after 5 s (\u00b5m)",
    )
    for row in rows:
        x = (
            100 * max(map(abs, row["stiffness_error"][:3])),
            1e3 * max(row["delay_s"]),
            1e6 * max(row["oscillation_m"].values()),
        )
        y = max(1.0, 1e3 * row["chatter_drift_N"])  # at the lower edge: 1 mN or less
        kinematic = row["stiffness_N_m"] == 0
        marker = ("s" if kinematic else "o") if row["estimated"] else ("D" if kinematic else "x")
        for axis, value in zip(axes, x, strict=True):
            axis.plot(value, y, marker, color="tab:blue" if row["estimated"] else "tab:red", markersize=8)
            text = "kinematic" if kinematic else f"{row['stiffness_N_m'] / 1e3:g}/{row['damping_N_s_m']:g}"
            below = kinematic and row["estimated"]  # where the stiffest spring is as good
            offset = (-6, -14) if below else (7, 3)
            axis.annotate(text, (value, y), xytext=offset, textcoords="offset points", fontsize=7)
    for axis, label, limit in zip(axes, labels, limits, strict=True):
        axis.set_xlim(0.0, 1.15 * axis.get_xlim()[1])  # room for the labels
        axis.set_ylim(1.0, 1e3)
        axis.axvspan(0.0, limit, color="tab:green", alpha=0.08)
        axis.axhline(1e3 * CHATTER_N, color="tab:green", linewidth=1)
        axis.axvline(limit, color="tab:green", linewidth=1)
        axis.set(xlabel=label, ylabel="chatter at rest (mN)", yscale="log")
        axis.grid(alpha=0.3)
    figure.suptitle(
        "Coupling: blue with the tip estimated, red from counts; kN/m / N s/m; green lines: targets", fontsize=10
    )
    figure.savefig(file, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for coupling.json and coupling.png")
    parser.add_argument("--quick", action="store_true", help="two couplings in place of four")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    with ProcessPoolExecutor(options.jobs) as pool:
        own = pool.submit(full_body)
        for row in pool.map(measure, candidates(options.quick)):
            rows.append(row)
            print(
                f"{row['name']}: chatter {1e3 * row['chatter_drift_N']:.1f}, {1e3 * row['chatter_tremor_N']:.1f} mN",
                flush=True,
            )
        body = own.result()
    base = [complex(*z) for z in rows[0]["felt_N_m"]]
    for row in rows:
        compare(row, base, [complex(*z) for z in body["felt_N_m"]])
    result = {
        "targets": {
            "chatter_N": CHATTER_N,
            "stiffness": STIFFNESS,
            "delay_s": DELAY_S,
            "oscillation_m": OSCILLATION_M,
        },
        "motions_Hz_m": _MOTIONS,
        "full_body": body,
        "candidates": rows,
    }
    (options.out / "coupling.json").write_text(json.dumps(result, indent=1) + "\n")
    draw(rows, options.out / "coupling.png")


if __name__ == "__main__":
    main()
