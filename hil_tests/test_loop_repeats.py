"""The closed loop gives equal bits: from run to run, and on both boards."""

import numpy as np
import pytest
from loop_scene import FREE, ROOT, SLIP, STICK, Run, run, scene



@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    folder = tmp_path_factory.mktemp("repeats")
    return {name: run(folder / name, scene(board=board, reference=True))
            for name, board in (("first", "mps2_an386"), ("second", "mps2_an386"), ("native", "native"))}


def same(a: Run, b: Run) -> None:
    for path, values in a.record.items():
        if path.startswith(("ticks/", "updates/")) and not path.endswith(("tick_count", "busy_count")):
            assert values.tobytes() == b[path].tobytes(), path
    assert a.summary["record_hash"] == b.summary["record_hash"]


def test_the_scene_has_what_it_takes_to_differ(runs):
    first = runs["first"]
    assert set(first["ticks/contact_mode"]) == {FREE, STICK, SLIP}
    assert first.summary["model_updates"] > 15 and first.summary["peak_force_N"] > 1.0


def test_two_runs_in_qemu_give_one_record(runs):
    same(runs["first"], runs["second"])
    # Not in the hash, and yet equal: the clock of the emulated board counts instructions.
    for path in ("ticks/tick_count", "ticks/busy_count", "reference/force_N"):
        assert runs["first"][path].tobytes() == runs["second"][path].tobytes(), path


def test_both_boards_give_one_record(runs):
    # Where background work is left over, a model may be taken over a tick later than on the native board.
    assert runs["first"].summary["background_overruns"] == runs["first"].summary["missed_deadlines"] == 0
    same(runs["first"], runs["native"])


@pytest.mark.slow
def test_the_demo_gives_one_record_on_both_boards(tmp_path):
    text = (ROOT / "scenes/demo.toml").read_text("utf-8")
    text = text.replace("[reference]", "[reference]\nenabled = false") + "[outputs]\ncsv = false\npictures = false\n"
    emulated = run(tmp_path / "emulated", text)
    native = run(tmp_path / "native", text.replace('"mps2_an386"', '"native"'))
    assert emulated.summary["background_overruns"] == emulated.summary["missed_deadlines"] == 0
    same(emulated, native)


def test_every_tick_is_there_and_in_time(runs):
    np.testing.assert_array_equal(runs["first"]["ticks/tick"], np.arange(800))
    # 125 million instructions a second: a tick has 125,000 of them.
    assert runs["first"].summary["worst_tick_instructions"] < 125_000
    assert runs["first"].summary["worst_busy_instructions"] < 125_000
