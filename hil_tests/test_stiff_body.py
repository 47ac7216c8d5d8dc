"""A body of 1e4 N/m, whose modes are over within a servo tick (docs/decisions/contact_output.md, "Stiff bodies")."""

from pathlib import Path

import palpate
from palpate.paths import SCENES

# Bounds of docs/frontier.md, "stiff_1e4". With the target of half a tick for every body the error is 0.75 %.
MOST_ERROR_PERCENT, MOST_JUMP_N = 0.3, 0.01


def test_its_force_does_not_lead(tmp_path: Path) -> None:
    result = palpate.run(
        SCENES / "frontier" / "reference.toml",
        {
            "path.csv": "poke_0.1mm.csv",
            "model.builder": "hybrid",
            "body.stiffness_N_m": 1e4,
            "integrator.step_s": 2e-5,
            "reference.enabled": True,
            "reference.step_s": 2e-5,
        },
        board="native",
        out=tmp_path,
    )
    assert result.summary["rms_force_error_percent"] < MOST_ERROR_PERCENT
    assert result.summary["largest_force_jump_N"] < MOST_JUMP_N
    assert result.summary["peak_force_N"] > 3.0
