"""host/bench/contact_lead.py: the target that it says is needed, against a steady press that is stepped."""

import importlib.util
import math
from types import ModuleType

import numpy as np
import pytest
from command import ROOT


@pytest.fixture(scope="module")
def lead() -> ModuleType:
    spec = importlib.util.spec_from_file_location("contact_lead", ROOT / "host/bench/contact_lead.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# Slow, within a tick, faster than it can be sampled (backward Euler), and overdamped.
LAMBDA_RAD2_S2 = np.array([1e4, 4e6, 2e7, 9e6])
DAMPING_RAD_S = np.array([20.0, 1800.0, 500.0, 9000.0])
WEIGHT_PER_KG = np.array([0.5, 200.0, 300.0, 400.0])


@pytest.mark.parametrize("modes", [slice(0, 1), slice(1, 2), slice(2, 3), slice(3, 4), slice(0, 4)])
def test_a_steady_press_has_the_force_of_the_mean_of_the_tick(lead: ModuleType, modes: slice) -> None:
    lam, damping, weight = LAMBDA_RAD2_S2[modes], DAMPING_RAD_S[modes], WEIGHT_PER_KG[modes]
    needed = lead.needed_target_ticks(weight, lam, damping)
    ticks, a_tick_m = 2000, 1e-6
    steps = [lead.tick_of_mode(k, d) for k, d in zip(lam, damping, strict=True)]
    output = np.array([1.0, 0.5 * lead.TICK_S])
    pushed = float(sum(w * output @ b for w, (_, b) in zip(weight, steps, strict=True)))
    static_m, lag_m = np.sum(weight / lam), np.sum(weight * damping / lam**2) / lead.TICK_S
    for target, ahead_ticks in ((needed, 0.0), (lead.TARGET_TICKS, lead.TARGET_TICKS - needed)):
        state = np.zeros((len(lam), 2))
        force_N = math.nan
        for tick in range(1, ticks + 1):
            free = [s + a @ s for s, (a, _) in zip(state, steps, strict=True)]
            free_m = sum(w * output @ s for w, s in zip(weight, free, strict=True))
            force_N = ((tick + target) * a_tick_m - free_m) / pushed
            state = np.array([s + b * force_N for s, (_, b) in zip(free, steps, strict=True)])
        # Of the continuous modes, half a tick ago; and by how many ticks this is ahead of that.
        slope_N = a_tick_m / static_m
        wanted_N = (ticks - 0.5) * slope_N + lag_m / static_m * slope_N
        assert (force_N - wanted_N) / slope_N == pytest.approx(ahead_ticks, abs=1e-6)


def test_slow_modes_need_half_a_tick_and_stiff_ones_less(lead: ModuleType) -> None:
    one = np.ones(1)
    assert lead.needed_target_ticks(one, 100.0 * one, 1.0 * one) == pytest.approx(0.5, abs=1e-4)
    # Overdamped, over in a hundredth of a tick: the force of the tick's end, and no velocity, stand for its mean.
    assert lead.needed_target_ticks(one, 1e12 * one, 1e7 * one) == pytest.approx(-0.5, abs=0.02)
