"""`palpate bench links`, in its quick form, against what each medium can do by its definition."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate import _core, cli
from palpate.link_bench import command, runs
from palpate.link_bench.runs import LinkRun
from palpate.scene import SceneError

# Bytes of messages a tick that full frames carry (docs/links.md).
MOST_BYTES_PER_TICK = {"canfd 1M/5M": 327.0, "usb full speed": 1235.0}
# A tip is heard no earlier than with the tick behind that of its message, and that crosses in one more.
LEAST_TIP_TICKS = 2


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("links") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stderr.isatty", lambda: False)
        assert cli.main(["bench", "links", "--quick", "--out", str(folder)]) == 0
    written: dict[str, Any] = json.loads((folder / command.RESULTS).read_text("utf-8"))
    assert (folder / command.PICTURE).stat().st_size > 10_000
    return written


def all_runs(values: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [*values["usual"], *(entry["held"] for entry in values["highest"] if entry["held"] is not None)]


def test_both_media_hold_the_defaults_states_and_usb_every_frames_bases(values: dict[str, Any]) -> None:
    assert {(one["medium"], one["model"]) for one in values["usual"]} == {
        ("canfd 1M/5M", "hybrid"), ("usb full speed", "hybrid"), ("usb full speed", "patch"), ("usb full speed", "krylov")
    }  # fmt: skip
    for one in values["usual"]:
        assert one["held"], one["problems"]
        assert (one["basis_bytes"] > 6000) == (one["model"] != "hybrid")


def test_no_medium_carries_more_than_it_can(values: dict[str, Any]) -> None:
    for one in all_runs(values):
        assert 0.0 < one["busy_share"] <= 1.0
        needed = one["rate_Hz"] * (one["state_bytes"] + one["basis_bytes"]) / 1000
        # Framing is in these bytes, and not in that bound: of CAN records, a tenth.
        assert needed <= 1.13 * MOST_BYTES_PER_TICK[one["medium"]]


def test_nothing_is_earlier_than_its_bytes(values: dict[str, Any]) -> None:
    for one in all_runs(values):
        least = (one["state_bytes"] + one["basis_bytes"]) / (1.13 * MOST_BYTES_PER_TICK[one["medium"]])
        assert min(map(int, one["host_to_model_active_ticks"])) >= least
        assert min(map(int, one["tip_to_host_ticks"])) >= LEAST_TIP_TICKS
        assert max(map(int, one["host_to_model_active_ticks"])) <= 1000 / one["rate_Hz"]


def test_the_limit_is_the_mediums(values: dict[str, Any]) -> None:
    for medium, limit in values["limits"].items():
        assert limit["message_bytes_per_s"] <= 1000 * MOST_BYTES_PER_TICK[medium]
        assert 0.94 <= limit["busy_share"] <= 1.0 + 1e-9  # on USB, beside two questions a frame and what no packet fits in


def test_bases_of_every_frame_hold_as_often_as_the_bus_brings_them(values: dict[str, Any]) -> None:
    """Bound: the bus's own limit over the bytes of a model; at least 0.35 of it, beside traces, reports and the replay of each, or the most that is tried."""
    for entry in values["highest"]:
        if entry["model"] == "hybrid":
            continue
        one = entry["held"]
        bound_Hz = values["limits"][entry["medium"]]["link_bytes_per_s"] / (one["state_bytes"] + one["basis_bytes"])
        assert min(0.35 * bound_Hz, 0.95 * command._QUICK_MOST_HZ) <= one["rate_Hz"] <= bound_Hz


def test_messages_cost_host_and_board_something_everywhere(values: dict[str, Any]) -> None:
    assert {row["framing"] for row in values["host"]} == {row["framing"] for row in values["board"]} == {"serial", "can_classic", "can_fd"}
    for row in values["host"]:
        assert row["us"] > 0.0 and row["of_a_copy"] > 1.0, row
    for row in values["board"]:
        # An instruction a byte at least; a message that took all of a tick would miss its deadline.
        assert row["link_bytes"] < row["instructions"] < 125_000, row


def test_a_rate_that_is_not_held_says_why() -> None:
    slow = {**command.QUICK, "link.medium": "uart", "link.baud": 100_000}
    scene = runs.scene_of(command.SCENE, "uart 921,600", "patch", 30, slow, None)
    done = runs.run(_core, scene, "uart 921,600", "patch", 30)
    assert not done.held and all(problem for problem in done.problems)


@pytest.mark.parametrize("most_Hz", [1, 17, 29, 30, 31, 100, 250, 400])
def test_the_highest_rate_is_found(most_Hz: int) -> None:
    def measure(rate_Hz: int) -> LinkRun:
        none = np.zeros(0, dtype=np.int64)
        problems = () if rate_Hz <= most_Hz else ("too fast",)
        return LinkRun("m", "b", rate_Hz, 1, 1, 1, 0.0, 0.0, 0.0, {}, none, none, problems)

    best = runs.highest_held(measure)
    assert best is not None and best.held
    assert best.rate_Hz <= min(most_Hz, runs.MOST_HZ) <= best.rate_Hz + max(1, best.rate_Hz // 20)


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(SceneError, match=r"holds thesis\.txt"):
        command.check_folder(tmp_path)
