"""Scenes: reads a TOML file into typed values, all checked, and hands them to the core.

The format is documented in docs/scenes.md. A scene alone reproduces an experiment.
"""

import math
import re
import tomllib
from dataclasses import asdict, dataclass, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.model_choice import Choice, Measured, auto_keys, choose, without_auto
from palpate.scene_body import Body, MaterialRegion
from palpate.scene_checks import check_exported_nodes, check_scene, friction, steps_per_tick
from palpate.scene_overrides import (
    OVERRIDE_COMMENT,
    Overrides,
    apply_overrides,
    exact_override,
    split_overrides,
)
from palpate.scene_schema import Reader, SceneError, read_section
from palpate.scene_sections import TICK_S, Contact, FrictionRegion, Model, Path, SceneFile
from palpate.tip_path import Interpolation, TipPath, read_csv

if TYPE_CHECKING:
    from palpate.mesh.network import Network

__all__ = ["Scene", "SceneError", "load_recorded_scene", "load_scene", "make_scene"]


@dataclass(frozen=True)
class Scene:
    """A checked scene: the file's own sections, its path with the CSV file read, and the text that it came from (`source`). In
    `sections` numbers stand where the file, and `requested`, may have "auto"; choice: which, and why, None where nothing is "auto"."""

    file: FilePath
    source: str
    sections: SceneFile
    path: TipPath | None
    requested: SceneFile
    choice: Choice | None

    @property
    def text(self) -> str:
        """The source, with what was chosen for "auto" as further overrides: for a record, which then repeats without the rule."""
        values = self.choice.values if self.choice else {}
        return self.source + "".join(f"{OVERRIDE_COMMENT}{exact_override(*item)}" for item in _plain(dict(values)).items())

    @property
    def duration_ticks(self) -> int:
        """Length of the experiment in servo ticks of 1 ms."""
        return round(self.sections.duration_s / TICK_S)

    @property
    def damping_N_s_m(self) -> float:
        """Damping of each spring outside of regions; the ratio is b / sqrt(2 m k) (Table 2 of Jacobs, Fu and Cavusoglu,
        2010)."""
        return _material(self.sections.body, self.sections.body)["damping_N_s_m"]

    @property
    def network(self) -> "Network | None":
        """The body made of [body.mesh]; None of a lattice. Raises SceneError."""
        return _network(Reader(self.file), self.sections.body)

    def keep_mesh(self, results: FilePath) -> FilePath | None:
        """Puts a copy of the body's mesh, if it has one, into the folder of a record. The copy, None where there is none to make."""
        mesh = self.sections.body.mesh
        if mesh is None:
            return None
        from palpate.mesh.load import keep_mesh

        return keep_mesh(self.file.parent, mesh, results)

    def require_lattice(self, what: str) -> None:
        """Raises SceneError for a body that is a mesh, of which `what` knows nothing."""
        if self.sections.body.mesh is not None:
            raise Reader(self.file).problem("body.mesh", f"given; must be left out, with body.nodes in its place: {what} is for lattices only")

    def with_board(self, name: str) -> "Scene":
        """The same scene on another board. Raises SceneError for what that has not, or where "auto" finds nothing for it."""
        requested = replace(self.requested, board=replace(self.requested.board, name=name))
        check_scene(Reader(self.file), without_auto(requested))
        return _resolve(self.file, self.source, requested, self.path)

    def judge(self, measured: Measured | None = None) -> Choice:
        """What the rule makes of the scene, and of its fixed values; measured: of a run, in place of the scene's link and latency.
        Raises SceneError."""
        self.require_path()
        return choose(Reader(self.file), self.requested, self.path, measured)[1]

    def with_model(self, **keys: Any) -> "Scene":
        """The same scene with these keys in [model], all others of that section at their defaults. Raises SceneError."""
        reader = Reader(self.file)
        requested = replace(self.requested, model=read_section(reader, "model", Model, _plain(keys)))
        check_scene(reader, without_auto(requested))
        return _resolve(self.file, self.source, requested, self.path)

    def require_path(self) -> TipPath:
        """The path; raises SceneError where the scene has none."""
        if self.path is None:
            raise Reader(self.file).problem(
                "path", "missing; must be a table [path] with waypoints or csv for palpate run"
            )
        return self.path

    def to_dict(self) -> dict[str, Any]:
        """The scene as `palpate._core` takes it: nested dictionaries of numbers, strings, lists and arrays.

        Defaults that follow from other keys are filled in; indices and vectors of a sheet get their y. `path` is None
        or {interpolation, time_s (n,), position_m (n, 3)}; `network` None or the fields of `palpate.mesh.network.Network`.
        """
        values: dict[str, Any] = _with_lists(asdict(self.sections))
        values["duration_ticks"] = self.duration_ticks
        network = self.network
        values["body"] = _body_dict(self.sections.body) if network is None else _network_body(self.sections.body, network)
        values["network"] = None if network is None else vars(network)
        contact = self.sections.contact
        every: tuple[Contact | FrictionRegion, ...] = (contact, *contact.regions)
        for given, table in zip(every, (values["contact"], *values["contact"]["regions"]), strict=True):
            del table["friction"]
            table["static_friction"], table["kinetic_friction"] = friction(given)
        if self.sections.coupling.kind == "kinematic":  # stiffness 0 to the core
            values["coupling"].update(stiffness_N_m=0.0, damping_N_s_m=0.0)
        values["integrator"]["steps_per_tick"] = steps_per_tick(self.sections.integrator.step_s)
        values["reference"]["steps_per_tick"] = steps_per_tick(self.sections.reference.step_s)
        values["outputs"]["node_ticks"] = [
            round(time_s / TICK_S) for time_s in self.sections.outputs.node_times_s
        ]
        if self.sections.body.dimension == 3 and network is None:  # a patch larger than the body is the whole body
            values["model"]["patch_nodes"] = [
                min(patch, count)
                for patch, count in zip(values["model"]["patch_nodes"], values["body"]["nodes"], strict=True)
            ]
        path = self.path
        values["path"] = path and {
            "interpolation": path.interpolation,
            "time_s": path.time_s,
            "position_m": path.position_m,
        }
        return values


def _with_lists(value: Any) -> Any:
    """The same with every tuple as a list."""
    if isinstance(value, dict):
        return {name: _with_lists(item) for name, item in value.items()}
    return [_with_lists(item) for item in value] if isinstance(value, tuple) else value


def _material(body: Body, given: Body | MaterialRegion) -> dict[str, float]:
    """Mass of the nodes, stiffness and damping of the springs, of the body itself or of one of its regions."""
    mass_kg = body.mass_kg if given.mass_kg is None else given.mass_kg
    stiffness_N_m = body.stiffness_N_m if given.stiffness_N_m is None else given.stiffness_N_m
    declared = body if given.damping_ratio is None and given.damping_N_s_m is None else given
    damping_N_s_m = declared.damping_N_s_m
    if damping_N_s_m is None:
        ratio = 1.0 if declared.damping_ratio is None else declared.damping_ratio
        damping_N_s_m = ratio * math.sqrt(2.0 * mass_kg * stiffness_N_m)
    return {"mass_kg": mass_kg, "stiffness_N_m": stiffness_N_m, "damping_N_s_m": damping_N_s_m}


def _body_dict(body: Body) -> dict[str, Any]:
    def three(values: tuple[Any, ...], middle: Any) -> list[Any]:
        """[x, z] of a sheet as [x, middle, z]."""
        return list(values) if len(values) == 3 else [values[0], middle, values[1]]

    return {
        "dimension": body.dimension,
        "nodes": three(body.nodes, 1),
        "spacing_m": body.spacing_m,
        "origin_m": list(body.origin_m),
        **_material(body, body),
        "neighbours": body.neighbours,
        "fixed_faces": list(body.fixed_faces),
        "fixed_nodes": [three(node, 0) for node in body.fixed_nodes],
        "gravity_m_s2": list(body.gravity_m_s2),
        "regions": [
            {
                "from_node": three(region.from_node, 0),
                "to_node": three(region.to_node, 0),
                **_material(body, region),
            }
            for region in body.regions
        ],
        "initial_nodes": [three(start.node, 0) for start in body.initial_displacements],
        "initial_displacements_m": [three(start.displacement_m, 0.0) for start in body.initial_displacements],
        "drives": [
            {
                **asdict(drive),
                "node": three(drive.node, 0),
                "displacement_m": three(drive.displacement_m, 0.0),
            }
            for drive in body.drives
        ],
    }


def _network_body(body: Body, network: "Network") -> dict[str, Any]:
    """Of a body that is a mesh; network: a digest of all that the core takes as an array."""
    return {
        "dimension": 3,
        "network": network.digest,
        "gravity_m_s2": list(body.gravity_m_s2),
        "initial_nodes": [],
        "initial_displacements_m": [],
        "drives": [],
    }


def _network(reader: Reader, body: Body) -> "Network | None":
    if body.mesh is None:
        return None
    from palpate.mesh.load import load_network  # SciPy takes its time: only where there is a mesh
    from palpate.mesh.read import MeshError

    try:
        return load_network(reader.file.parent, body)
    except MeshError as error:
        raise reader.problem(f"body.mesh.{error.key}" if error.key else "body.mesh", str(error)) from None


def load_scene(
    file: FilePath,
    overrides: Overrides | None = None,
    board: str | None = None,
    measured: Measured | None = None,
) -> Scene:
    """Reads and checks a scene. Raises SceneError: one line that names the file, the key, the value and its range.

    overrides: keys that are set otherwise than in the file, by dotted name; they stand as comments in the scene's text. board:
    in place of the scene's, as with `Scene.with_board`. measured: of a run, in place of the scene's link and latency where "auto"
    goes by them.
    """
    return _build(file, _read_text(file), overrides or {}, None, board, measured)


def load_recorded_scene(file: FilePath, text: str, overrides: Overrides, path: TipPath) -> Scene:
    """The scene of a record: `Scene.text` of then. What was overridden then stays so, but for the present overrides.

    file: for messages. path: in place of the scene's own. Raises SceneError as `load_scene` does.
    """
    own, recorded = split_overrides(text)
    return _build(file, own, {**recorded, **overrides}, path)


def _build(
    file: FilePath,
    text: str,
    overrides: Overrides,
    path: TipPath | None,
    board: str | None = None,
    measured: Measured | None = None,
) -> Scene:
    reader = Reader(file)
    try:
        table = tomllib.loads(text)
    except ValueError as error:
        raise _syntax_error(file, text, str(error)) from None
    except RecursionError:
        raise SceneError(f"{file}: not TOML that can be read: nested too deeply") from None
    return _checked(reader, table, text, overrides, path, board, measured)


def make_scene(table: dict[str, Any], overrides: Overrides | None = None, name: str = "scene") -> Scene:
    """A scene from nested tables as they stand in a file (docs/scenes.md), checked alike; errors begin with the name. A
    scene without duration_s has one tick: enough where only body, plant or model of it count. csv paths are relative to
    the working directory."""
    plain = _plain({"duration_s": TICK_S, **table})
    return _checked(Reader(FilePath(name)), plain, "", overrides or {}, None)


def _plain(value: Any) -> Any:
    """As TOML has it: tuples and arrays as lists, NumPy's numbers as Python's; a copy."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _checked(
    reader: Reader,
    table: dict[str, Any],
    text: str,
    overrides: Overrides,
    path: TipPath | None,
    board: str | None = None,
    measured: Measured | None = None,
) -> Scene:
    for name, given in overrides.items():
        value = _plain(given)
        apply_overrides(table, {name: value})
        text += f"{OVERRIDE_COMMENT}{exact_override(name, value)}"
    if path is not None:
        table["path"] = {"waypoints": [{"time_s": 0.0, "position_m": path.position_m[0].tolist()}]}
    requested = read_section(reader, "", SceneFile, table)
    if board is not None:
        requested = replace(requested, board=replace(requested.board, name=board))
    check_scene(reader, without_auto(requested))
    if path is None and requested.path is not None:
        path = _load_path(reader, requested.path)
    network = _network(reader, requested.body)
    if network is not None:
        check_exported_nodes(reader, requested.outputs, len(network.mass_kg))
    return _resolve(reader.file, text, requested, path, measured)


def _resolve(
    file: FilePath, source: str, requested: SceneFile, path: TipPath | None, measured: Measured | None = None
) -> Scene:
    """With numbers in place of "auto"."""
    if not auto_keys(requested):
        return Scene(file, source, requested, path, requested, None)
    reader = Reader(file)
    sections, choice = choose(reader, requested, path, measured)
    check_scene(reader, sections)
    return Scene(file, source, sections, path, requested, choice)


def _read_text(file: FilePath) -> str:
    try:
        return file.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SceneError(f"{file}: not TOML: is not UTF-8 text") from None
    except FileNotFoundError:
        raise SceneError(f"{file}: no such file: must be a scene in TOML (docs/scenes.md)") from None
    except OSError as error:
        raise SceneError(f"{file}: {error.strerror}: must be a scene in TOML (docs/scenes.md)") from None


def _syntax_error(file: FilePath, text: str, message: str) -> SceneError:
    """tomllib ends its messages with "(at line 3, column 5)" or "(at end of document)"."""
    match = re.search(r" *\(at (?:line (\d+), column (\d+)|end of document)\)$", message)
    if match is None:
        return SceneError(f"{file}: not TOML: {' '.join(message.split())}")
    line = match[1] or str(text.count("\n") + 1)
    column = f" (column {match[2]})" if match[2] else " (end of the file)"
    return SceneError(f"{file}:{line}: not TOML: {' '.join(message[: match.start()].split())}{column}")


def _load_path(reader: Reader, path: Path) -> TipPath:
    if path.waypoints is not None:
        time_s = np.array([point.time_s for point in path.waypoints], dtype=np.float64)
        position_m = np.array([point.position_m for point in path.waypoints], dtype=np.float64)
        default: Interpolation = "minimum_jerk"
    else:
        assert path.csv is not None
        file = reader.file.parent / path.csv
        if "\0" in path.csv:
            raise reader.error("path.csv", path.csv, "the name of a file")
        try:
            time_s, position_m = read_csv(file)
        except OSError as error:
            raise reader.error(
                "path.csv", path.csv, f"a readable CSV file ({file}: {error.strerror})"
            ) from None
        default = "linear"
    interpolation: Interpolation = default
    if path.interpolation is not None:
        interpolation = "linear" if path.interpolation == "linear" else "minimum_jerk"
    return TipPath(time_s, position_m, interpolation)
