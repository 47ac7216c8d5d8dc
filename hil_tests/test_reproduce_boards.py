"""`palpate reproduce` gives one record on both boards."""

import contextlib

import pytest
from palpate import _core
from palpate.reproduce import command


@pytest.mark.slow
def test_figure_15_on_both_boards(tmp_path):
    figures = command.select(["fig15"])
    hashes = {}
    for hil in (False, True):
        out = tmp_path / f"hil_{hil}"
        (result,), _ = command.reproduce(
            _core, figures, out, hil, lambda label, unit: contextlib.nullcontext(lambda done, total: True)
        )
        assert result.passed, result.checks
        (run,) = result.to_dict()["runs"]
        hashes[run["board"]] = run["record_hash"]
    assert set(hashes) == {command.NATIVE, command.HIL}
    assert hashes[command.NATIVE] == hashes[command.HIL]
