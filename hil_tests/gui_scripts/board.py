"""Beside the image of a real board, attached: what the window says of it."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

from palpate.gui import board_lines  # noqa: E402
from palpate.reset_record import ResetRecord  # noqa: E402

SOFTWARE_RESET, PROCESSOR_FAULT, MOTOR_HEAT = 1 << 28, 1, 1 << 11

TOP = 200
# A line of text in the panel, its smoothed edges left out.
TEXT_PIXELS = 60


def orange(image):
    """Pixels of a warning, in the panel of controls."""
    return int((np.abs(image[:, :290, :3].astype(int) - (255, 178, 76)).max(axis=-1) < 30).sum())


def stages(app):
    live, attached = app.live, app.attached
    # Asked before the loop took the link.
    assert attached.trouble == "" and attached.name == app.image == "nucleo_g474re", attached
    assert attached.reset.fault == "" and "power" in attached.reset.cause, attached.reset
    table = next(table for table in app.budgets if table.name == "palpate_nucleo_g474re.elf")
    assert [row.what for row in table.rows] == ["flash", "RAM, stack included", "deepest stack"]
    assert all(0.1 < row.share <= 1.0 for row in table.rows), table
    while not live.status["board_heard"] or live.status["board_worst_tick_count"] == 0:
        yield
    assert live.status["board_clock_Hz"] == 170_000_000
    ((text, meant),) = board_lines.tick_lines(live.board_name, live.status)
    assert " ms of 1, " in text and meant == "plain", text
    yield
    quiet = app.screenshot()
    # As after a fault, which hil_tests/test_nucleo.py reads from the image itself.
    words = (SOFTWARE_RESET, PROCESSOR_FAULT, 3, 0x08001234, 0x8200, 0x40000000, 0, 0, 12_345, MOTOR_HEAT)
    app.attached = replace(attached, reset=ResetRecord.of(attached.name, words))
    yield
    yield
    shown = app.screenshot()
    # At the top, and in the section of the board.
    for rows in (slice(0, TOP), slice(TOP, None)):
        assert orange(shown[rows]) > orange(quiet[rows]) + TEXT_PIXELS, (orange(shown[rows]), orange(quiet[rows]))


step = run(stages)
