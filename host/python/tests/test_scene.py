"""Scenes: good ones are read, bad ones are refused with one line that names file, key, value and range."""

import math
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command import ROOT, palpate

from palpate.scene import Scene, SceneError, load_scene

GOOD = """
duration_s = 1.0
[body]
nodes = [4, 5, 6]
fixed_faces = ["z-"]
[contact]
friction = 0.5
[path]
waypoints = [
  { time_s = 0.0, position_m = [0.0, 0.0, 0.0] },
  { time_s = 0.5, position_m = [0.0, 0.01, -0.03] },
]
"""
SHEET = """
duration_s = 1.0
[body]
dimension = 2
nodes = [4, 6]
fixed_faces = ["z-"]
"""

Load = Callable[[str], Scene]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def from_text(text: str) -> Scene:
        file = tmp_path / "scene.toml"
        file.write_text(text, encoding="utf-8")
        return load_scene(file)

    return from_text


def refusal(load: Load, text: str) -> str:
    """The message, without the folder."""
    with pytest.raises(SceneError) as caught:
        load(text)
    message = str(caught.value)
    assert "\n" not in message
    name = Path(message.split(".toml", 1)[0] + ".toml")
    assert name.name == "scene.toml"
    return message.removeprefix(f"{name.parent}/")


def drives(node: tuple[int, ...], start_s: float, reach_s: float, release_s: float) -> str:
    """The good scene with a driven node."""
    return GOOD + (
        f"[[body.drives]]\nnode = {list(node)}\nstart_s = {start_s}\nreach_s = {reach_s}\nrelease_s = {release_s}\n"
        "displacement_m = [0.0, 0.0, 0.01]\n"
    )


def region(lines: str) -> str:
    """The good scene with a good region and one of these lines."""
    plain = "[[body.regions]]\nfrom_node = [0, 0, 0]\nto_node = [3, 4, 5]\n"
    return f"{GOOD}{plain}[[body.regions]]\n{lines}\n"


def body(line: str) -> str:
    """The good scene with one more line in [body]."""
    return GOOD.replace("[contact]", f"{line}\n[contact]")


def test_defaults_of_a_small_scene(load: Load) -> None:
    scene = load(GOOD)
    given = scene.to_dict()
    assert given["duration_ticks"] == 1000
    assert given["body"]["nodes"] == [4, 5, 6]
    # Table 2 of the paper: sqrt(2 * 1 g * 100 N/m) at damping ratio 1
    assert given["body"]["damping_N_s_m"] == pytest.approx(math.sqrt(0.2), rel=1e-15)
    assert given["contact"] == {
        "static_friction": 0.5,
        "kinetic_friction": 0.5,
        "regions": [],
        "surface": "smooth",
    }
    assert given["integrator"]["steps_per_tick"] == 10
    assert given["path"]["interpolation"] == "minimum_jerk"
    np.testing.assert_array_equal(given["path"]["time_s"], [0.0, 0.5])
    np.testing.assert_array_equal(given["path"]["position_m"], [[0, 0, 0], [0, 0.01, -0.03]])


def test_a_region_takes_from_the_body_what_it_leaves_out(load: Load) -> None:
    regions = """
[[body.regions]]
from_node = [0, 0, 5]
to_node = [3, 4, 5]
stiffness_N_m = 10000.0
[[body.regions]]
from_node = [1, 1, 1]
to_node = [1, 1, 1]
mass_kg = 0.004
[[body.regions]]
from_node = [1, 1, 1]
to_node = [2, 2, 3]
damping_N_s_m = 0.3
[[body.regions]]
from_node = [1, 1, 1]
to_node = [2, 2, 3]
mass_kg = 0.002
damping_ratio = 0.1
"""
    ratio = load(GOOD + regions).to_dict()["body"]["regions"]
    assert ratio[0] == {
        "from_node": [0, 0, 5],
        "to_node": [3, 4, 5],
        "mass_kg": 0.001,
        "stiffness_N_m": 10000.0,
        "damping_N_s_m": pytest.approx(math.sqrt(2 * 0.001 * 10000.0), rel=1e-15),
    }
    assert (ratio[1]["mass_kg"], ratio[1]["stiffness_N_m"]) == (0.004, 100.0)
    assert ratio[2]["damping_N_s_m"] == 0.3
    assert ratio[3]["damping_N_s_m"] == pytest.approx(0.1 * math.sqrt(2 * 0.002 * 100.0), rel=1e-15)
    given = load(body("damping_N_s_m = 0.2") + regions).to_dict()["body"]["regions"]
    assert [region["damping_N_s_m"] for region in given[:3]] == [0.2, 0.2, 0.3]
    assert given[3]["damping_N_s_m"] == ratio[3]["damping_N_s_m"]


def test_a_sheet_gets_its_third_axis(load: Load) -> None:
    given = load(
        SHEET
        + "fixed_nodes = [[1, 2]]\ninitial_displacements = [{ node = [3, 4], displacement_m = [0.1, 0.2] }]\n"
        "regions = [{ from_node = [0, 1], to_node = [3, 4] }]\n"
    ).to_dict()["body"]
    assert given["regions"][0]["from_node"] == [0, 0, 1]
    assert given["regions"][0]["to_node"] == [3, 0, 4]
    assert given["nodes"] == [4, 1, 6]
    assert given["fixed_nodes"] == [[1, 0, 2]]
    assert given["initial_nodes"] == [[3, 0, 4]]
    assert given["initial_displacements_m"] == [[0.1, 0.0, 0.2]]


def holds_tuples(value: object) -> bool:
    if isinstance(value, dict):
        return any(map(holds_tuples, value.values()))
    return isinstance(value, tuple) or (isinstance(value, list) and any(map(holds_tuples, value)))


@pytest.mark.parametrize("file", sorted((ROOT / "scenes").rglob("*.toml")), ids=lambda file: file.stem)
def test_the_core_gets_lists(file: Path) -> None:
    assert not holds_tuples(load_scene(file).to_dict())


def test_friction_and_damping_can_be_given_apart(load: Load) -> None:
    text = body("damping_N_s_m = 0.2").replace(
        "friction = 0.5", "static_friction = 0.9\nkinetic_friction = 0.4"
    )
    scene = load(text)
    contact = scene.to_dict()["contact"]
    assert (contact["static_friction"], contact["kinetic_friction"]) == (0.9, 0.4)
    assert scene.damping_N_s_m == 0.2


@pytest.mark.parametrize("file", sorted((ROOT / "scenes").rglob("*.toml")), ids=lambda file: file.stem)
def test_scenes_of_the_project_are_good(file: Path) -> None:
    scene = load_scene(file)
    assert scene.to_dict()["duration_ticks"] == scene.duration_ticks


BAD = {
    "syntax": (GOOD + "[body\n", "scene.toml:13: not TOML: "),
    "empty": ("", "scene.toml: duration_s: missing; must be in [0.001, 600] s"),
    "no body": ("duration_s = 1.0", "scene.toml: body: missing; must be a table [body]"),
    "no nodes": (
        'duration_s = 1.0\n[body]\nfixed_faces = ["z-"]',
        "scene.toml: body.nodes: missing; must be 2 or 3 whole numbers in [2, 64]",
    ),
    "body is a number": (
        "duration_s = 1.0\nbody = 3",
        "scene.toml: body = 3: must be a table with the keys dimension, ",
    ),
    "unknown key": (
        body("stifness_N_m = 10"),
        "scene.toml: body.stifness_N_m = 10: unknown key; did you mean body.stiffness_N_m?",
    ),
    "unknown section": (
        GOOD + "[bdy]\n",
        "scene.toml: bdy = {}: unknown key; did you mean body?",
    ),
    "unknown key, not near": (
        GOOD + "[tool]\nzzzzzz = 1",
        "scene.toml: tool.zzzzzz = 1: unknown key; must be one of tool.radius_m",
    ),
    "key that needs quotes": (GOOD + '[tool]\n"a b" = 1', 'scene.toml: tool."a b" = 1: unknown key; '),
    "negative stiffness": (
        body("stiffness_N_m = -3"),
        "scene.toml: body.stiffness_N_m = -3: must be in (0, 1e6] N/m",
    ),
    "no stiffness": (
        body("stiffness_N_m = 0.0"),
        "scene.toml: body.stiffness_N_m = 0: must be in (0, 1e6] N/m",
    ),
    "NaN": (body("mass_kg = nan"), "scene.toml: body.mass_kg = nan: must be in (0, 10] kg"),
    "infinity": (body("mass_kg = inf"), "scene.toml: body.mass_kg = inf: must be in (0, 10] kg"),
    "huge": (body(f"mass_kg = 1{'0' * 400}"), "scene.toml: body.mass_kg = 0x"),
    "text for a number": (body('mass_kg = "1"'), 'scene.toml: body.mass_kg = "1": must be in (0, 10] kg'),
    "boolean for a number": (
        body("mass_kg = true"),
        "scene.toml: body.mass_kg = true: must be in (0, 10] kg",
    ),
    "date for a number": (
        body("mass_kg = 1979-05-27"),
        "scene.toml: body.mass_kg = 1979-05-27: must be in (0, 10] kg",
    ),
    "fraction for a whole number": (
        GOOD + "[rates]\nhost_delay_ticks = 2.5",
        "scene.toml: rates.host_delay_ticks = 2.5: must be a whole number in [0, 400] ticks",
    ),
    "number for a boolean": (
        GOOD + "[outputs]\npictures = 1",
        "scene.toml: outputs.pictures = 1: must be true or false",
    ),
    "number for a text": ("title = 1\n" + GOOD, "scene.toml: title = 1: must be a string"),
    "too long a run": (
        GOOD.replace("1.0", "1e9", 1),
        "scene.toml: duration_s = 1000000000: must be in [0.001, 600] s",
    ),
    "one node": (
        GOOD.replace("[4, 5, 6]", "[4, 1, 6]"),
        "scene.toml: body.nodes = [4, 1, 6]: must be 2 or 3 whole numbers in [2, 64]",
    ),
    "too many nodes": (
        GOOD.replace("[4, 5, 6]", "[4, 5, 65]"),
        "scene.toml: body.nodes = [4, 5, 65]: must be 2 or 3 whole numbers in [2, 64]",
    ),
    "two lengths of a block": (
        GOOD.replace("[4, 5, 6]", "[4, 5]"),
        "scene.toml: body.nodes = [4, 5]: must be 3 whole numbers in [2, 64] where body.dimension = 3",
    ),
    "four dimensions": (
        body("dimension = 4"),
        "scene.toml: body.dimension = 4: must be a whole number in [2, 3]",
    ),
    "both dampings": (
        body("damping_ratio = 1.0\ndamping_N_s_m = 0.1"),
        "scene.toml: body.damping_N_s_m: given together with body.damping_ratio = 1; must be only one",
    ),
    "unknown neighbours": (
        body('neighbours = "corner"'),
        'scene.toml: body.neighbours = "corner": must be one of "axis", "edge", "full"',
    ),
    "unknown face": (
        GOOD.replace('"z-"', '"z-", "top"'),
        'scene.toml: body.fixed_faces[1] = "top": must be one of "x-", "x+", "y-", "y+", "z-", "z+"',
    ),
    "face of a sheet": (
        SHEET.replace("z-", "y-"),
        'scene.toml: body.fixed_faces[0] = "y-": must be one of "x-", "x+", "z-", "z+" where body.dimension = 2',
    ),
    "nothing fixed": (
        GOOD.replace('["z-"]', "[]"),
        "scene.toml: body.fixed_faces = []: must be such that at least one node is fixed, "
        "by body.fixed_faces or body.fixed_nodes",
    ),
    "everything fixed": (
        GOOD.replace("[4, 5, 6]", "[4, 5, 2]").replace('["z-"]', '["z-", "z+"]'),
        'scene.toml: body.fixed_faces = ["z-", "z+"]: must be such that at least one node is free',
    ),
    "fixed node that is not there": (
        body("fixed_nodes = [[0, 0, 0], [0, 0, 6]]"),
        "scene.toml: body.fixed_nodes[1] = [0, 0, 6]: must be indices within [0..3, 0..4, 0..5]",
    ),
    "fixed node of a sheet with three indices": (
        SHEET + "fixed_nodes = [[0, 0, 0]]",
        "scene.toml: body.fixed_nodes[0] = [0, 0, 0]: must be indices within [0..3, 0..5]",
    ),
    "displaced node that is fixed": (
        body("initial_displacements = [{ node = [1, 1, 0], displacement_m = [0.0, 0.0, 0.1] }]"),
        "scene.toml: body.initial_displacements[0].node = [1, 1, 0]: must be a node that is not fixed",
    ),
    "node displaced twice": (
        body(
            "initial_displacements = [" + 2 * "{ node = [1, 1, 1], displacement_m = [0.0, 0.0, 0.1] }, " + "]"
        ),
        "scene.toml: body.initial_displacements[1].node = [1, 1, 1]: must be a node that is not displaced already",
    ),
    "displacement of a sheet with three numbers": (
        SHEET + "initial_displacements = [{ node = [1, 1], displacement_m = [0.0, 0.0, 0.1] }]",
        "scene.toml: body.initial_displacements[0].displacement_m = [0, 0, 0.1]: must be 2 numbers in [-1, 1] m "
        "where body.dimension = 2",
    ),
    "displacement without a node": (
        body("initial_displacements = [{ displacement_m = [0.0, 0.0, 0.1] }]"),
        "scene.toml: body.initial_displacements[0].node: missing; must be 2 or 3 whole numbers in [0, 63]",
    ),
    "gravity across a sheet": (
        SHEET + "gravity_m_s2 = [0, 1, 0]",
        "scene.toml: body.gravity_m_s2 = [0, 1, 0]: must be 0 along y where body.dimension = 2",
    ),
    "region without a box": (
        region("stiffness_N_m = 10"),
        "scene.toml: body.regions[1].from_node: missing; must be 2 or 3 whole numbers in [0, 63]",
    ),
    "region that is a number": (
        body("regions = 3"),
        "scene.toml: body.regions = 3: must be a list (at most 1,000 items) of tables {from_node, to_node, mass_kg, ",
    ),
    "region outside of the body": (
        region("from_node = [0, 0, 0]\nto_node = [3, 5, 5]"),
        "scene.toml: body.regions[1].to_node = [3, 5, 5]: must be indices within [0..3, 0..4, 0..5]",
    ),
    "region below the body": (
        region("from_node = [0, -1, 0]\nto_node = [3, 4, 5]"),
        "scene.toml: body.regions[1].from_node = [0, -1, 0]: must be 2 or 3 whole numbers in [0, 63]",
    ),
    "region that holds no node": (
        region("from_node = [0, 3, 0]\nto_node = [3, 2, 5]"),
        "scene.toml: body.regions[1].to_node = [3, 2, 5]: must be at least body.regions[1].from_node in each index; "
        "y is less",
    ),
    "region of a sheet that holds no node": (
        SHEET + "regions = [{ from_node = [0, 3], to_node = [3, 2] }]",
        "scene.toml: body.regions[0].to_node = [3, 2]: must be at least body.regions[0].from_node in each index; "
        "z is less",
    ),
    "region of a sheet with three indices": (
        SHEET + "regions = [{ from_node = [0, 0, 3], to_node = [3, 0, 4] }]",
        "scene.toml: body.regions[0].from_node = [0, 0, 3]: must be indices within [0..3, 0..5]",
    ),
    "region with an unknown key": (
        region("from_node = [0, 0, 0]\nto_node = [3, 4, 5]\nstiffness = 3"),
        "scene.toml: body.regions[1].stiffness = 3: unknown key; did you mean body.regions[1].stiffness_N_m?",
    ),
    "region without mass": (
        region("from_node = [0, 0, 0]\nto_node = [3, 4, 5]\nmass_kg = 0"),
        "scene.toml: body.regions[1].mass_kg = 0: must be in (0, 10] kg",
    ),
    "region without stiffness": (
        region("from_node = [0, 0, 0]\nto_node = [3, 4, 5]\nstiffness_N_m = 0"),
        "scene.toml: body.regions[1].stiffness_N_m = 0: must be in (0, 1e6] N/m",
    ),
    "both dampings of a region": (
        region("from_node = [0, 0, 0]\nto_node = [3, 4, 5]\ndamping_ratio = 1.0\ndamping_N_s_m = 0.1"),
        "scene.toml: body.regions[1].damping_N_s_m: given together with body.regions[1].damping_ratio = 1; "
        "must be only one",
    ),
    "stiffness of a region of one node": (
        region("from_node = [1, 1, 1]\nto_node = [1, 1, 1]\nstiffness_N_m = 10"),
        "scene.toml: body.regions[1].stiffness_N_m: given for a region of one node, which holds no spring; "
        "must be left out",
    ),
    "step longer than a tick": (
        GOOD + "[integrator]\nstep_s = 0.002",
        "scene.toml: integrator.step_s = 0.002: must be in [1e-6, 0.001] s",
    ),
    "step that does not divide a tick": (
        GOOD + "[integrator]\nstep_s = 0.0003",
        "scene.toml: integrator.step_s = 0.0003: must be 0.001 s divided by a whole number in [1, 1000]",
    ),
    "reference step that does not divide a tick": (
        GOOD + "[reference]\nstep_s = 0.00015",
        "scene.toml: reference.step_s = 0.00015: must be 0.001 s divided by a whole number in [1, 1000]",
    ),
    "unknown method": (
        GOOD + '[integrator]\nmethod = "rk4"',
        'scene.toml: integrator.method = "rk4": must be one of "semi_implicit", "implicit"',
    ),
    "tip on an implicit body": (
        GOOD + '[integrator]\nmethod = "implicit"',
        'scene.toml: integrator.method = "implicit": must be "semi_implicit" where [path] is given',
    ),
    "friction twice": (
        GOOD.replace("friction = 0.5", "friction = 0.5\nstatic_friction = 0.5"),
        "scene.toml: contact.static_friction: given together with contact.friction = 0.5; must be only one",
    ),
    "unknown surface": (
        GOOD.replace("friction = 0.5", 'surface = "round"'),
        'scene.toml: contact.surface = "round": must be one of "smooth", "flat"',
    ),
    "region upside down": (
        GOOD.replace("friction = 0.5", "friction = 0.5\nregions = [{from_m = [0, 0.2, 0], to_m = [0, 0.1, 0]}]"),
        "scene.toml: contact.regions[0].from_m = [0, 0.2, 0]: must be at most contact.regions[0].to_m in each "
        "coordinate; y is greater",
    ),
    "region with kinetic above static friction": (
        GOOD.replace(
            "friction = 0.5",
            "friction = 0.5\n[[contact.regions]]\nfrom_m = [0, 0, 0]\nto_m = [0, 0, 0]\nstatic_friction = 0.1\n"
            "kinetic_friction = 0.2",
        ),
        "scene.toml: contact.regions[0].kinetic_friction = 0.2: must be in [0, 0.1], at most "
        "contact.regions[0].static_friction",
    ),
    "too many frictions": (
        GOOD.replace(
            "friction = 0.5",
            "friction = 0.5\nregions = ["
            + ", ".join(
                f"{{from_m = [0, 0, 0], to_m = [0, 0, 0], friction = {value}}}" for value in (1, 2, 3, 4)
            )
            + "]",
        ),
        "scene.toml: contact.regions: 5 different pairs of friction coefficients in the scene; must be at most 4",
    ),
    "kinetic friction alone": (
        GOOD.replace("friction = 0.5", "kinetic_friction = 0.5"),
        "scene.toml: contact.static_friction: missing; must be in [0, 10] where contact.kinetic_friction is given",
    ),
    "kinetic above static friction": (
        GOOD.replace("friction = 0.5", "static_friction = 0.5\nkinetic_friction = 0.6"),
        "scene.toml: contact.kinetic_friction = 0.6: must be in [0, 0.5], at most contact.static_friction",
    ),
    "waypoints that go back in time": (
        GOOD.replace("time_s = 0.0", "time_s = 0.7"),
        "scene.toml: path.waypoints[1].time_s = 0.5: must be greater than the previous time 0.7 s",
    ),
    "waypoint with a wrong key": (
        GOOD.replace("time_s = 0.0", "t_s = 0.0"),
        "scene.toml: path.waypoints[0].t_s = 0: unknown key; did you mean path.waypoints[0].time_s?",
    ),
    "waypoint far away": (
        GOOD.replace("0.01, -0.03", "10, -0.03"),
        "scene.toml: path.waypoints[1].position_m = [0, 10, -0.03]: must be 3 numbers in [-1, 1] m",
    ),
    "no waypoint": (
        GOOD[: GOOD.index("waypoints")] + "waypoints = []",
        "scene.toml: path.waypoints = []: must be a list of at least one point",
    ),
    "empty path": (
        GOOD[: GOOD.index("waypoints")],
        "scene.toml: path.waypoints: missing; must be exactly one of path.waypoints and path.csv",
    ),
    "two paths": (
        GOOD + 'csv = "a.csv"',
        'scene.toml: path.waypoints: given together with path.csv = "a.csv"; must be exactly one of path.waypoints '
        "and path.csv",
    ),
    "path on a sheet": (
        SHEET + GOOD[GOOD.index("[path]") :],
        "scene.toml: path: a two-dimensional body cannot be touched; body.dimension must be 3, "
        "or [path] must be left out",
    ),
    "missing CSV file": (
        GOOD[: GOOD.index("waypoints")] + 'csv = "none.csv"',
        'scene.toml: path.csv = "none.csv": must be a readable CSV file (',
    ),
    "CSV file with a null": (
        GOOD[: GOOD.index("waypoints")] + 'csv = "a\\u0000b"',
        'scene.toml: path.csv = "a\\u0000b": must be the name of a file',
    ),
    "grip": (GOOD + "[hand]\ngrip = 1.5", "scene.toml: hand.grip = 1.5: must be in [0, 1]"),
    "grip changes that go back in time": (
        GOOD + "[hand]\ngrip_changes = [{ time_s = 0.5, grip = 0.1 }, { time_s = 0.5, grip = 0.2 }]",
        "scene.toml: hand.grip_changes[1].time_s = 0.5: must be greater than the previous time 0.5 s",
    ),
    "hand of another kind": (
        GOOD + '[hand]\nkind = "robot"',
        'scene.toml: hand.kind = "robot": must be one of "impedance", "scripted"',
    ),
    "scripted hand with a grip": (
        GOOD + '[hand]\nkind = "scripted"\ngrip_changes = [{ time_s = 0.5, grip = 0.1 }]',
        'scene.toml: hand.grip_changes: given together with hand.kind = "scripted"; must be left out, '
        "for nothing gives way",
    ),
    "drive of a fixed node": (
        drives((0, 0, 0), 0.1, 0.2, 0.3),
        "scene.toml: body.drives[0].node = [0, 0, 0]: must be a node that is not fixed",
    ),
    "drive outside the body": (
        drives((0, 5, 1), 0.1, 0.2, 0.3),
        "scene.toml: body.drives[0].node = [0, 5, 1]: must be indices within [0..3, 0..4, 0..5]",
    ),
    "drive that takes no time": (
        drives((1, 1, 5), 0.2, 0.2, 0.3),
        "scene.toml: body.drives[0].reach_s = 0.2: must be greater than start_s = 0.2 s",
    ),
    "drive that ends before it arrives": (
        drives((1, 1, 5), 0.1, 0.2, 0.15),
        "scene.toml: body.drives[0].release_s = 0.15: must be at least reach_s = 0.2 s",
    ),
    "two drives of a node at a time": (
        drives((1, 1, 5), 0.1, 0.2, 0.3) + drives((1, 1, 5), 0.25, 0.3, 0.4).removeprefix(GOOD),
        "scene.toml: body.drives[1].start_s = 0.25: must be at least 0.3 s, when the drive of this node before "
        "releases it",
    ),
    "drives of the implicit method": (
        drives((1, 1, 5), 0.1, 0.2, 0.3).replace(GOOD[GOOD.index("[path]") :], "")
        + '[integrator]\nmethod = "implicit"',
        'scene.toml: integrator.method = "implicit": must be "semi_implicit" where body.drives is given',
    ),
    "probe outside the body": (
        GOOD + "[outputs]\nprobe_node = [4, 0, 5]",
        "scene.toml: outputs.probe_node = [4, 0, 5]: must be indices within [0..3, 0..4, 0..5]",
    ),
    "update rate": (
        GOOD + "[rates]\nmodel_update_Hz = 0",
        "scene.toml: rates.model_update_Hz = 0: must be in [1, 250] Hz",
    ),
    "unknown builder": (
        GOOD + '[model]\nbuilder = "balanced"',
        'scene.toml: model.builder = "balanced": must be one of "patch", "patch_rescaled", "condensed", "krylov"',
    ),
    "driven nodes that the builder does not know": (
        drives((1, 1, 5), 0.1, 0.2, 0.3) + "[model]\nbuilder = 'condensed'",
        'scene.toml: body.drives: given together with model.builder = "condensed", which knows no driven nodes',
    ),
    "large patch": (
        GOOD + "[model]\npatch_nodes = [5, 5, 3]",
        "scene.toml: model.patch_nodes = [5, 5, 3]: must be at most 64 nodes in all",
    ),
    "babbling that ends before it begins": (
        GOOD + "[link]\nmedium = 'can'\n[link.faults]\nbabble = [{from_s = 0.5, to_s = 0.2}]",
        "scene.toml: link.faults.babble[0].to_s = 0.2",
    ),
    "patch that the real part has no room for": (
        GOOD + "[model]\npatch_nodes = [4, 4, 3]\n[link]\nmedium = 'canfd'\n[board]\nname = 'nucleo_g474re'",
        "scene.toml: model.patch_nodes = [4, 4, 3]: must be at most 32 nodes in all where board.name = "
        '"nucleo_g474re", which has room for 96 modes',
    ),
    "baud rate of the real part": (
        GOOD + "[link]\nbaud = 3_000_000\n[board]\nname = 'nucleo_g474re'",
        'scene.toml: link.baud = 3000000: must be 921600 where board.name = "nucleo_g474re"',
    ),
    "times of the real part": (
        GOOD + "[link]\nmedium = 'can'\n[safety]\nfade_s = 0.1\n[board]\nname = 'nucleo_g474re'",
        'scene.toml: safety: the image for board.name = "nucleo_g474re" has times of its own (boards/nucleo_g474re/limits.hpp); leave it out',
    ),
    "krylov without frequencies": (
        GOOD + "[model]\nbuilder = 'krylov'\nshifts_Hz = []",
        "scene.toml: model.shifts_Hz = []: must be at least one frequency",
    ),
    "krylov with frequencies in no order": (
        GOOD + "[model]\nbuilder = 'krylov'\nshifts_Hz = [20.0, 0.0]",
        "scene.toml: model.shifts_Hz[1] = 0: must be greater than the previous one, 20 Hz",
    ),
    "krylov with frequencies of the middle in no order": (
        GOOD + "[model]\nbuilder = 'krylov'\nmiddle_shifts_Hz = [20.0, 10.0]",
        "scene.toml: model.middle_shifts_Hz[1] = 10: must be greater than the previous one, 20 Hz",
    ),
    "krylov with more modes than the board holds": (
        GOOD + "[model]\nbuilder = 'krylov'\nshifts_Hz = [0, 10, 20, 30]\npatch_nodes = [5, 5, 2]",
        "scene.toml: model.shifts_Hz = [0, 10, 20, 30]: must be so few that 3 modes for each of them and of the 25 nodes of a ",
    ),
    "hybrid with frequencies in no order": (
        GOOD + "[model]\nbuilder = 'hybrid'\nmiddle_shifts_Hz = [20.0, 10.0]",
        "scene.toml: model.middle_shifts_Hz[1] = 10: must be greater than the previous one, 20 Hz",
    ),
    "hybrid with more modes than the board holds": (
        GOOD + "[model]\nbuilder = 'hybrid'\nnear_nodes = 13",
        "scene.toml: model.near_nodes = 13: must be so few that 3 modes for each of them and of the 16 nodes of a face of ",
    ),
    "unknown board": (
        GOOD + '[board]\nname = "arduino"',
        'scene.toml: board.name = "arduino": must be one of "mps2_an386", "mps2_an500", "native"',
    ),
    "time of the supervisor": (
        GOOD + "[safety]\nfade_s = 0.01",
        "scene.toml: safety.fade_s = 0.01: must be in [0.02, 2] s",
    ),
    "lost before outputs are off": (
        GOOD + "[safety]\nresume_within_s = 1.5",
        "scene.toml: safety.resume_within_s = 1.5: must be at least 2.2 s, until outputs are off",
    ),
    "unknown medium": (
        GOOD + '[link]\nmedium = "lin"',
        'scene.toml: link.medium = "lin": must be one of "uart", "can", "canfd", "usb"',
    ),
    "fast classic CAN": (
        GOOD + '[link]\nmedium = "can"\nbit_rate_Hz = 2_000_000',
        "scene.toml: link.bit_rate_Hz = 2000000: must be a whole number in [10000, 1000000] bit/s",
    ),
    "data slower than their arbitration": (
        GOOD + '[link]\nmedium = "canfd"\ndata_bit_rate_Hz = 500_000',
        "scene.toml: link.data_bit_rate_Hz = 500000: must be in [1000000, 8000000] bit/s, at least link.bit_rate_Hz",
    ),
    "faults of serial frames on CAN": (
        GOOD + '[link]\nmedium = "canfd"\n[link.faults]\ndrop_up = [1]',
        'scene.toml: link.faults.drop_up: given together with link.medium = "canfd"; frames have numbers on "uart" only: there is '
        "link.faults.random",
    ),
    "cut frames on CAN": (
        GOOD + '[link]\nmedium = "can"\n[link.faults]\nrandom = [{ way = "up", kind = "truncate", chance = 0.1 }]',
        'scene.toml: link.faults.random[0].kind = "truncate": must be "drop", "flip" or "duplicate" where link.medium = "can": a frame says '
        "its length under its CRC, so none is cut short",
    ),
    "reordered frames on CAN": (
        GOOD + '[link]\nmedium = "can"\n[link.faults]\nrandom = [{ way = "up", kind = "reorder", chance = 0.1 }]',
        'scene.toml: link.faults.random[0].kind = "reorder": must be "drop", "flip" or "duplicate" where link.medium = "can": frames of one '
        "identifier keep their order, and those of others overtake by priority in every run",
    ),
    "errors on CAN without end": (
        GOOD + '[link]\nmedium = "can"\n[link.faults]\nrandom = [{ way = "up", kind = "flip", chance = 1 }]',
        'scene.toml: link.faults.random[0].chance = 1: must be in [0, 0.9] where link.medium = "can", or no frame ever goes through',
    ),
    "more than a CAN bus": (
        GOOD + '[link]\nmedium = "canfd"\n[link.faults]\nflood = [{ load = 1.5 }]',
        'scene.toml: link.faults.flood[0].load = 1.5: must be in [0, 1] where link.medium = "canfd": no node sends more than its bus carries',
    ),
    "faults of serial frames on USB": (
        GOOD + '[link]\nmedium = "usb"\n[link.faults]\ndrop_up = [1]',
        'scene.toml: link.faults.drop_up: given together with link.medium = "usb"; frames have numbers on "uart" only: there is link.faults.random',
    ),
    "frames that USB loses": (
        GOOD + '[link]\nmedium = "usb"\n[link.faults]\nrandom = [{ way = "up", kind = "drop", chance = 0.1 }]',
        'scene.toml: link.faults.random[0].kind = "drop": must be "flip" where link.medium = "usb": it repeats what an error has hit',
    ),
    "errors on USB without end": (
        GOOD + '[link]\nmedium = "usb"\n[link.faults]\nrandom = [{ way = "up", kind = "flip", chance = 1 }]',
        'scene.toml: link.faults.random[0].chance = 1: must be in [0, 0.9] where link.medium = "usb", or no packet ever goes through',
    ),
    "two hosts on USB": (
        GOOD + '[link]\nmedium = "usb"\n[link.faults]\nsecond_host = [{ from_s = 1 }]',
        'scene.toml: link.faults.second_host: given together with link.medium = "usb"; a USB bus has one host',
    ),
    "flood on USB": (
        GOOD + '[link]\nmedium = "usb"\n[link.faults]\nflood = [{ from_s = 1 }]',
        'scene.toml: link.faults.flood: given together with link.medium = "usb"; a USB bus has one host',
    ),
    "refusal on a serial line": (
        GOOD + "[link.faults]\nrefused = [{ from_s = 1 }]",
        'scene.toml: link.faults.refused: given together with link.medium = "uart"; a device refuses packets on "usb" only',
    ),
    "babbling on a serial line": (
        GOOD + "[link.faults]\nbabble = [{ from_s = 1 }]",
        'scene.toml: link.faults.babble: given together with link.medium = "uart"; a node babbles on "can" and "canfd" only',
    ),
    "unknown trace": (
        GOOD + '[link]\ntrace = "none"',
        'scene.toml: link.trace = "none": must be one of "full", "tip"',
    ),
    "too many ticks in a trace": (
        GOOD + "[link]\ntrace_ticks = 33",
        "scene.toml: link.trace_ticks = 33: must be a whole number in [1, 32]",
    ),
    "tips alone for the paper's feedback": (
        GOOD + '[model]\nfeedback = "paper"\n[link]\ntrace = "tip"',
        'scene.toml: link.trace = "tip": must be "full" where model.feedback = "paper"',
    ),
    "slow link": (
        GOOD + "[link]\nbaud = 300",
        "scene.toml: link.baud = 300: must be a whole number in [1200, 20000000] bit/s",
    ),
    "fault on the link": (
        GOOD + "[link.faults]\nflip_up = [{ frame = 1, bit = -1 }]",
        "scene.toml: link.faults.flip_up[0].bit = -1: must be a whole number in [0, 1000000]",
    ),
    "two faults of a frame": (
        GOOD + "[link.faults]\ndrop_down = [1]\nflip_down = [{ frame = 1, bit = 0 }]",
        "scene.toml: link.faults.flip_down[0].frame = 1: must be a frame that has no fault yet",
    ),
    "a frame that comes twice and late": (
        GOOD + "[link.faults]\nduplicate_up = [{ frame = 1 }]\nreorder_up = [{ frame = 1 }]",
        "scene.toml: link.faults.reorder_up[0].frame = 1: must be a frame that has no fault yet",
    ),
    "a frame that comes behind none": (
        GOOD + "[link.faults]\nreorder_down = [{ frame = 1, behind = 0 }]",
        "scene.toml: link.faults.reorder_down[0].behind = 0: must be a whole number in [1, 1000]",
    ),
    "export after the end": (
        GOOD + "[outputs]\nnode_times_s = [0.0, 1.5]",
        "scene.toml: outputs.node_times_s[1] = 1.5: must be in [0, 1] s, the duration",
    ),
    "exports that go back in time": (
        GOOD + "[outputs]\nnode_times_s = [0.5, 0.25]",
        "scene.toml: outputs.node_times_s[1] = 0.25: must be greater than the previous time 0.5 s",
    ),
    "too large an export": (
        GOOD.replace("[4, 5, 6]", "[64, 64, 64]")
        + f"[outputs]\nnode_times_s = {[round(0.001 * i, 3) for i in range(200)]}",
        "scene.toml: outputs.node_times_s: 200 times: must be at most 95 for 262,144 nodes",
    ),
}


@pytest.mark.parametrize(("text", "expected"), BAD.values(), ids=BAD.keys())
def test_bad_scenes_are_refused(load: Load, text: str, expected: str) -> None:
    message = refusal(load, text)
    assert message.startswith(expected)


BAD_CSV = {
    "NaN": ("time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,nan,0\n", ":3: y_m = nan: must be a number in [-1, 1] m"),
    "infinity": ("time_s,x_m,y_m,z_m\n0,0,0,-inf\n", ":2: z_m = -inf: must be a number in [-1, 1] m"),
    "word": ("time_s,x_m,y_m,z_m\n0,zero,0,0\n", ":2: x_m = zero: must be a number in [-1, 1] m"),
    "nothing": ("time_s,x_m,y_m,z_m\n0,,0,0\n", ":2: x_m = : must be a number in [-1, 1] m"),
    "early": ("time_s,x_m,y_m,z_m\n-1,0,0,0\n", ":2: time_s = -1: must be a number in [0, 600] s"),
    "back in time": (
        "time_s,x_m,y_m,z_m\n0.1,0,0,0\n0.3,0,0,0\n0.2,0,0,0\n",
        ":4: time_s = 0.2: must be greater than the previous time 0.3",
    ),
    "same time": (
        "time_s,x_m,y_m,z_m\n0.1,0,0,0\n0.1,0,0,0\n",
        ":3: time_s = 0.1: must be greater than the previous time 0.1",
    ),
    "missing column": (
        "time_s,x_m,y_m\n0,0,0\n",
        ":1: column z_m: missing; must have the columns time_s, x_m, y_m, z_m",
    ),
    "column twice": (
        "time_s,x_m,y_m,z_m,x_m\n0,0,0,0,0\n",
        ":1: column x_m: given twice; must have the columns time_s, x_m, y_m, z_m",
    ),
    "no header": ("0,0,0,0\n", ":1: column time_s: missing; must have the columns time_s, x_m, y_m, z_m"),
    "short row": ("time_s,x_m,y_m,z_m\n0,0,0\n", ":2: 3 values: must be 4, as in the header"),
    "no rows": ("time_s,x_m,y_m,z_m\n", ": no rows: must have at least one row below the header"),
    "empty": ("", ":1: column time_s: missing; must have the columns time_s, x_m, y_m, z_m"),
    "not text": (b"\xff\xfe\x00", ": is not UTF-8 text: must be CSV with the columns time_s, x_m, y_m, z_m"),
}
CSV_SCENE = GOOD[: GOOD.index("waypoints")] + 'csv = "tip.csv"'


@pytest.mark.parametrize(("text", "expected"), BAD_CSV.values(), ids=BAD_CSV.keys())
def test_bad_csv_files_are_refused(load: Load, tmp_path: Path, text: str | bytes, expected: str) -> None:
    file = tmp_path / "tip.csv"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(SceneError) as caught:
        load(CSV_SCENE)
    assert str(caught.value) == f"{file}{expected}"


def test_csv_columns_may_stand_in_any_order_and_among_others(load: Load, tmp_path: Path) -> None:
    (tmp_path / "tip.csv").write_bytes(
        b"\xef\xbb\xbfz_m, x_m,force_x_N,time_s,y_m\r\n-0.1,0.1,nan,0.0,0.2\r\n\r\n-0.3,0.2,9,1.5,0.4\r\n"
    )
    path = load(CSV_SCENE).require_path()
    assert path.interpolation == "linear"
    np.testing.assert_array_equal(path.time_s, [0.0, 1.5])
    np.testing.assert_array_equal(path.position_m, [[0.1, 0.2, -0.1], [0.2, 0.4, -0.3]])


def test_syntax_errors_name_the_line(load: Load) -> None:
    assert refusal(load, "duration_s = 1.0\n[body]\nnodes = [1, 2\n= 3").startswith(
        "scene.toml:4: not TOML: "
    )
    assert refusal(load, 'duration_s = 1.0\ntitle = """\n').startswith("scene.toml:")


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.toml: no such file: must be a scene in TOML"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(SceneError, match=r"Is a directory: must be a scene in TOML"):
        load_scene(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(SceneError, match=r"binary\.toml: not TOML: is not UTF-8 text"):
        load_scene(tmp_path / "binary.toml")


def test_mutilated_scenes_never_do_worse_than_a_refusal(load: Load) -> None:
    """A few hundred random edits of a good scene: each is read or refused, on one line."""
    generator = random.Random(1)
    alphabet = '[]{}=",.-# \n0159aeinz_\\'
    for _ in range(400):
        text = GOOD
        for _ in range(generator.randint(1, 4)):
            at = generator.randrange(len(text))
            text = (
                text[:at]
                + generator.choice(["", generator.choice(alphabet)])
                + text[at + generator.randint(0, 2) :]
            )
        try:
            load(text).to_dict()
        except SceneError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize("command", ["run", "simulate"])
def test_the_command_line_refuses_with_code_2_and_one_line(command: str, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(body("stiffness_N_m = -3"))
    done = palpate(command, "bad.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "bad.toml: body.stiffness_N_m = -3: must be in (0, 1e6] N/m\n"


def test_run_needs_a_path(tmp_path: Path) -> None:
    (tmp_path / "sheet.toml").write_text(SHEET)
    done = palpate("run", "sheet.toml", "--json", cwd=tmp_path)
    message = "sheet.toml: path: missing; must be a table [path] with waypoints or csv for palpate run"
    assert (done.returncode, done.stderr) == (2, message + "\n")
    assert done.stdout == f'{{"error": "{message}"}}\n'
