"""The rule that chooses order, patch and update rate: what it is monotone in, what it leaves alone, and what it says where nothing
fits."""

import contextlib
import itertools
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate.model_choice import (
    ENOUGH_HZ,
    RATES_HZ,
    Choice,
    Measured,
    choose,
    measured_in,
    path_speed_m_s,
)
from palpate.model_size import model_size
from palpate.paths import SCENES
from palpate.scene import Scene, SceneError, load_recorded_scene, load_scene
from palpate.scene_schema import Reader

FILE = SCENES / "frontier/reference.toml"
ALL_AUTO = {
    "rates.model_update_Hz": "auto",
    "model.patch_nodes": "auto",
    "model.near_nodes": "auto",
    "model.shifts_Hz": "auto",
}
BUILDERS = ("patch", "patch_rescaled", "condensed", "krylov", "hybrid")
BOARDS = ("mps2_an386", "mps2_an500", "native")
BAUDS = (20_000_000, 12_000_000, 6_000_000, 4_000_000, 3_000_000, 2_600_000, 2_000_000, 1_500_000, 921_600, 600_000, 460_800, 115_200)
SPEEDS_M_S = (0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5)
DELAYS = (0, 5, 33)


def chosen(**keys: Any) -> Scene:
    """The scene with everything "auto" but what is given, dots of the keys as two underlines."""
    return load_scene(FILE, {**ALL_AUTO, **{key.replace("__", "."): value for key, value in keys.items()}})


def choice(**keys: Any) -> Choice | None:
    """None where nothing fits."""
    try:
        found = chosen(**keys).choice
    except SceneError:
        return None
    assert found is not None
    return found


def values(**keys: Any) -> Any:
    found = choice(**keys)
    return found and found.values


def test_a_scene_without_auto_is_left_alone() -> None:
    scene = load_scene(FILE, {"model.builder": "hybrid"})
    assert scene.choice is None and scene.sections == scene.requested
    assert scene.sections.model.patch_nodes == (4, 4, 2)
    assert scene.judge().values == {}


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("board", BOARDS)
def test_what_is_chosen_fits(builder: str, board: str) -> None:
    scene = chosen(model__builder=builder, board__name=board, tool__speed_m_s=0.03)
    assert scene.choice is not None
    assert set(scene.choice.values) == set(ALL_AUTO)
    assert all(check.holds for check in scene.choice.checks)
    assert model_size(scene.sections).fits_the_board()
    given = scene.to_dict()  # numbers only, as the core takes them
    assert given["rates"]["model_update_Hz"] in RATES_HZ
    assert given["model"]["patch_nodes"] in ([3, 3, 2], [4, 4, 2])
    assert isinstance(given["model"]["near_nodes"], int) and given["model"]["shifts_Hz"] == [0.0]


def grid(builder: str, board: str) -> Iterator[tuple[dict[str, Any], Any]]:
    """Speed, rate of the link and delay of the host, and what is chosen for them; None where nothing fits."""
    scene = chosen(model__builder=builder, board__name=board, tool__speed_m_s=0.0).requested
    for speed_m_s, baud, delay in itertools.product(SPEEDS_M_S, BAUDS, DELAYS):
        requested = replace(
            scene,
            tool=replace(scene.tool, speed_m_s=speed_m_s),
            link=replace(scene.link, baud=baud),
            rates=replace(scene.rates, host_delay_ticks=delay),
        )
        found: Any = None
        with contextlib.suppress(SceneError):
            found = choose(Reader(FILE), requested, None)[1].values
        yield {"speed_m_s": speed_m_s, "baud": baud, "delay": delay}, found


BUILDERS_AND_BOARDS = list(itertools.product(("patch", "krylov", "hybrid"), BOARDS[:2]))


@pytest.mark.parametrize(("builder", "board"), BUILDERS_AND_BOARDS)
def test_the_rule_is_monotone(builder: str, board: str) -> None:
    """Less bandwidth never gives more updates, a faster tool never a smaller patch; nothing fitting is the end of either."""
    found = list(grid(builder, board))
    rates_Hz, sides = defaultdict(list), defaultdict(list)  # along the link's rates, along the speeds
    for given, values in found:
        rate_Hz = values["rates.model_update_Hz"] if values else 0.0
        rates_Hz[given["speed_m_s"], given["delay"]].append((-given["baud"], rate_Hz))
        side = values["model.patch_nodes"][0] if values else 99
        sides[given["baud"], given["delay"]].append((given["speed_m_s"], side))
    for where, along in rates_Hz.items():
        assert all(a >= b for (_, a), (_, b) in itertools.pairwise(sorted(along))), where
    for where, speeds in sides.items():
        assert all(a <= b for (_, a), (_, b) in itertools.pairwise(sorted(speeds))), where
    # Not for want of choices.
    assert len({values["rates.model_update_Hz"] for _, values in found if values}) >= 4
    chosen_sides = {values["model.patch_nodes"][0] for _, values in found if values}
    assert chosen_sides == ({4} if builder == "hybrid" else {3, 4})


FIXED: list[dict[str, Any]] = [
    {"rates.model_update_Hz": 17.0},
    {"model.patch_nodes": [4, 4, 3]},
    {"model.near_nodes": 1},
    {"rates.model_update_Hz": 11.0, "model.near_nodes": 3},
]


@pytest.mark.parametrize("fixed", FIXED, ids=str)
def test_a_fixed_value_is_never_changed(fixed: dict[str, Any]) -> None:
    scene = load_scene(FILE, {**ALL_AUTO, "model.builder": "hybrid", "tool.speed_m_s": 0.01, **fixed})
    assert scene.choice is not None and set(scene.choice.values) == set(ALL_AUTO) - set(fixed)
    given = scene.to_dict()
    for key, value in fixed.items():
        section, name = key.split(".")
        assert given[section][name] == value


def test_the_order_gives_way_before_the_rate_is_less_than_enough() -> None:
    """On the board with less time: fewer modes at ENOUGH_HZ rather than all of them less often."""
    found = values(model__builder="hybrid", tool__speed_m_s=0.03)
    assert (found["rates.model_update_Hz"], found["model.near_nodes"]) == (ENOUGH_HZ, 4)
    larger = values(model__builder="hybrid", tool__speed_m_s=0.03, board__name="mps2_an500")
    assert larger["rates.model_update_Hz"] > ENOUGH_HZ and larger["model.near_nodes"] == 12


@pytest.mark.parametrize(
    ("keys", "short", "cure"),
    [
        ({"link.baud": 300_000}, "link: traces and reports to the host", r"a link of [\d,]+ baud would do, or link.trace"),
        ({"model.builder": "patch", "link.baud": 600_000}, "link: states and bases to the board", r"a link of [\d,]+ baud would do"),
        ({"rates.host_delay_ticks": 90, "rates.models_under_way": 4, "model.near_nodes": 12}, "board: catching up", "a larger part"),
        ({"tool.speed_m_s": 0.5}, "tool: speed for which the contact stays on the patch", r"a tool of at most 0\.\d+ m/s"),
        ({"rates.host_delay_ticks": 120, "rates.models_under_way": 1}, "host: models that it computes at a time", "a greater rates.models_under_way"),
    ],
    ids=["link up", "link down", "board", "tool", "host"],
)
def test_where_nothing_fits_it_says_what_is_short_and_by_how_much(keys: dict[str, Any], short: str, cure: str) -> None:
    with pytest.raises(SceneError) as refused:
        load_scene(FILE, {**ALL_AUTO, "model.builder": "hybrid", "tool.speed_m_s": 0.02, **keys})
    message = str(refused.value)
    assert message.startswith(f"{FILE}: rates.model_update_Hz: \"auto\" finds nothing that fits; ")
    assert "\n" not in message
    told = re.search(rf"{re.escape(short)}[^;]*: ([\d,.e+]+) of ([\d,.e+]+) \S+, short by ([\d,.e+]+); {cure}", message)
    assert told, message
    need, have, by = (float(number.replace(",", "")) for number in told.groups())
    assert need > have and by == pytest.approx(need - have, rel=0.02, abs=0.6)


def test_the_cure_for_the_link_is_one() -> None:
    keys = {"model__builder": "patch", "tool__speed_m_s": 0.0, "link__baud": 500_000, "rates__model_update_Hz": 20.0}
    with pytest.raises(SceneError) as refused:
        chosen(**keys)
    needed = [int(baud.replace(",", "")) for baud in re.findall(r"a link of ([\d,]+) baud", str(refused.value))]
    found = chosen(**{**keys, "link__baud": max(needed) + 1}).choice if needed else None
    assert found is not None


def test_speed_of_a_path() -> None:
    """Constant along x; with least jerk 1.875 times the mean; not where it is far from the body."""
    scene = load_scene(FILE, {"path.csv": "drag_3cm_s.csv"})
    assert path_speed_m_s(scene.sections, scene.path) == pytest.approx(0.03, rel=0.01)
    waypoints = [{"time_s": 0.0, "position_m": [0.0, 0.0, -0.02]}, {"time_s": 1.0, "position_m": [0.03, 0.01, -0.02]}]
    scene = load_scene(SCENES / "auto.toml", {"path.waypoints": waypoints})
    assert path_speed_m_s(scene.sections, scene.path) == pytest.approx(1.875 * 0.03, rel=0.01)
    far = [{**point, "position_m": [*point["position_m"][:2], 0.05]} for point in waypoints]
    scene = load_scene(SCENES / "auto.toml", {"path.waypoints": far})
    assert path_speed_m_s(scene.sections, scene.path) == 0.0
    assert path_speed_m_s(scene.sections, None) == 0.0


def test_the_scene_may_say_the_speed() -> None:
    slow, fast = (chosen(model__builder="krylov", board__name="mps2_an500", tool__speed_m_s=v).choice for v in (0.0, 0.1))
    assert slow is not None and fast is not None
    assert (slow.values["model.patch_nodes"], fast.values["model.patch_nodes"]) == ((3, 3, 2), (4, 4, 2))


def test_a_measured_link_takes_the_place_of_the_scenes() -> None:
    scene = chosen(model__builder="krylov", tool__speed_m_s=0.01)
    assert scene.choice is not None
    slow = scene.judge(Measured(bytes_per_tick=100.0, sent_ticks=20.0, late_ticks=50.0))
    assert slow.inputs["link_bytes_per_s"] == 100_000.0
    assert slow.values["rates.model_update_Hz"] < scene.choice.values["rates.model_update_Hz"]
    with pytest.raises(SceneError, match="link: "):
        scene.judge(Measured(bytes_per_tick=10.0, sent_ticks=20.0, late_ticks=50.0))


def test_what_a_run_has_measured() -> None:
    record = {
        "ticks/link_down_bytes": np.array([0, 0, 300, 300, 300, 20, 0]),
        "updates/tick": np.array([10, 40, 70], dtype=np.uint32),
        "updates/sent_tick": np.array([15, 47, 76], dtype=np.uint32),
        "updates/swap_tick": np.array([50, 0, 120], dtype=np.uint32),
        "updates/status": np.array([0, 255, 0]),
    }
    assert measured_in(record) == Measured(bytes_per_tick=300.0, sent_ticks=5.5, late_ticks=45.0)
    with pytest.raises(ValueError, match="no model was taken over"):
        measured_in({**record, "updates/status": np.full(3, 255)})


@pytest.mark.parametrize(
    ("keys", "modes", "nodes", "springs", "state_bytes"),
    [  # as measured in QEMU, `updates/bytes`
        ({"model.builder": "hybrid"}, 72, 32, 142, 617),
        ({"model.builder": "hybrid", "model.near_nodes": 12}, 96, 32, 142, 713),
        ({"model.builder": "krylov"}, 48, 16, 0, 329),
        ({"model.builder": "patch"}, 96, 16, 0, 521),
        ({"model.builder": "patch", "model.patch_nodes": [4, 4, 4]}, 192, 16, 0, 905),
    ],
    ids=str,
)
def test_sizes_are_those_of_models(keys: dict[str, Any], modes: int, nodes: int, springs: int, state_bytes: int) -> None:
    size = model_size(load_scene(FILE, keys).sections)
    assert (size.modes, size.nodes, size.springs, size.state_bytes) == (modes, nodes, springs, state_bytes)
    assert size.evaluated_springs == (48 if springs else 0)  # docs/decisions/near_field.md
    assert size.fits_the_board()


def test_a_record_repeats_what_was_chosen_without_the_rule() -> None:
    scene = chosen(model__builder="hybrid", tool__speed_m_s=0.03)
    assert scene.path is not None
    again = load_recorded_scene(FILE, scene.text, {}, scene.path)
    assert again.choice is None
    assert again.sections.model == scene.sections.model and again.sections.rates == scene.sections.rates
    # On another board the rule is asked again, and the text has its new answer alone.
    other = scene.with_board("mps2_an500")
    assert other.text.count("model.near_nodes=12") == 1 and "model.near_nodes=4" not in other.text


def test_lines_and_dictionary_say_the_same() -> None:
    found = choice(model__builder="hybrid", tool__speed_m_s=0.03)
    assert found is not None
    told = found.to_dict()
    assert told["chosen"]["model.patch_nodes"] == [4, 4, 2]
    lines = found.lines()
    assert lines[0].startswith("chosen: rates.model_update_Hz = 30, model.patch_nodes = [4, 4, 2], model.near_nodes = 4")
    assert lines[-len(told["reasons"]):] == told["reasons"]


def test_a_body_that_cannot_be_touched_has_nothing_to_choose(tmp_path: Path) -> None:
    file = tmp_path / "sheet.toml"
    file.write_text('duration_s = 1\n[body]\ndimension = 2\nnodes = [4, 4]\nfixed_faces = ["z-"]\n[rates]\nmodel_update_Hz = "auto"\n')
    with pytest.raises(SceneError, match="body.dimension = 2: must be 3"):
        load_scene(file)
