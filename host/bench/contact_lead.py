"""By how much a local model's contact leads the body's force, mean of the tick, while the tip moves steadily: from the
model's modes alone (docs/decisions/contact_output.md, "Stiff bodies"). Prints a row for each material.

    PYTHONPATH=host/python python host/bench/contact_lead.py
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import nnls

import palpate
from palpate.paths import SCENES
from palpate.scene import load_scene

TICK_S = 1e-3
TARGET_TICKS = 0.5  # where the contact aims without a word of the host's (shared/model/local_model.hpp)
LARGEST_PHASE_RAD = 2.5  # kLargestResolvedPhase_rad of host/linearize/modal_coefficients.hpp
AT_M = (0.0035, 0.0042, -0.02)  # where the pokes are (palpate.frontier.paths)
# Stiffness (N/m), damping ratio, a step of the body that is stable (s).
MATERIALS = ((1e2, 1.0, 1e-4), (1e3, 1.0, 5e-5), (1e4, 1.0, 2e-5), (1e4, 0.3, 2e-5), (1e4, 0.1, 2e-5))

Floats = NDArray[np.float64]


def tick_of_mode(lambda_rad2_s2: float, damping_rad_s: float) -> tuple[Floats, Floats]:
    """A - I (2, 2) and B (2,) of a tick of q'' = -lambda q - d q' + u, as host/linearize/modal_coefficients has them."""
    stiffness, damping = lambda_rad2_s2 * TICK_S**2, damping_rad_s * TICK_S
    if stiffness - 0.25 * damping**2 > LARGEST_PHASE_RAD**2:
        inverse = 1.0 / (1.0 + damping + stiffness)
        a = [[-stiffness, TICK_S], [-stiffness / TICK_S, -(damping + stiffness)]]
        return inverse * np.array(a), inverse * np.array([TICK_S**2, TICK_S])
    generator = np.array([[0.0, 1.0, 0.0], [-lambda_rad2_s2, -damping_rad_s, 1.0], [0.0, 0.0, 0.0]])
    step = expm(TICK_S * generator)
    return step[:2, :2] - np.eye(2), step[:2, 2]


def weights(model: palpate.LocalModel, axis: int) -> Floats:
    """(m,), 1/kg: squares of the modes at the place along an axis, from its compliance over all frequencies."""
    frequency_Hz = np.concatenate([[0.0], np.geomspace(0.5, 2e5, 1500)])
    wanted = model.compliance_m_N(frequency_Hz)[:, axis, axis]
    omega = 2.0 * np.pi * frequency_Hz[:, None]
    answers = 1.0 / (model.lambda_rad2_s2 - omega**2 + 1j * omega * model.damping_rad_s)
    answers = answers / np.abs(wanted)[:, None]
    relative = wanted / np.abs(wanted)
    rows = np.vstack([answers.real, answers.imag])
    scale = np.linalg.norm(rows, axis=0)
    found, _ = nnls(rows / scale, np.concatenate([relative.real, relative.imag]), maxiter=100_000)
    return np.asarray(found / scale)


def needed_target_ticks(weight: Floats, lambda_rad2_s2: Floats, damping_rad_s: Floats) -> float:
    """Extrapolation of the tip, in ticks of its motion, with which a steady motion has the continuous modes' force on the mean
    of the tick. For a force that rises by 1 N a tick and is 0 on the mean of tick 0. weight: (m,), as `weights` gives them."""
    output_m = 0.0
    for w, lam, damping in zip(weight, lambda_rad2_s2, damping_rad_s, strict=True):
        a_less_i, b = tick_of_mode(lam, damping)
        q, p = np.linalg.solve(a_less_i, np.array([1.0 / lam, 0.0]) - b)
        output_m += w * (q + 0.5 * TICK_S * p)
    static_m = float(np.sum(weight / lambda_rad2_s2))
    tip_m = 0.5 * static_m - float(np.sum(weight * damping_rad_s / lambda_rad2_s2**2)) / TICK_S  # at the end of tick 0
    return (output_m - tip_m) / static_m


def main() -> None:
    """A row for each material and axis."""
    for stiffness_N_m, damping_ratio, step_s in MATERIALS:
        overrides: dict[str, Any] = {
            "body.stiffness_N_m": stiffness_N_m,
            "body.damping_ratio": damping_ratio,
            "integrator.step_s": step_s,
        }
        body = palpate.Body(load_scene(SCENES / "frontier" / "reference.toml", overrides))
        model = palpate.build_model(body, at=AT_M, builder="hybrid")
        for axis in (0, 2):
            needed = needed_target_ticks(weights(model, axis), model.lambda_rad2_s2, model.damping_rad_s)
            print(
                f"{stiffness_N_m:g} N/m, damping ratio {damping_ratio:g}, {'xyz'[axis]}: needed {needed:.3f} ticks, "
                f"lead with {TARGET_TICKS:g}: {1e3 * TICK_S * (TARGET_TICKS - needed):.3f} ms"
            )


if __name__ == "__main__":
    main()
