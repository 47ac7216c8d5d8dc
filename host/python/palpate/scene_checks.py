"""Checks that relate several keys of a scene to each other; those of one key alone are in `scene_sections` and
`scene_body`."""

import math
from collections.abc import Sequence
from dataclasses import astuple, fields
from itertools import product

from palpate.scene_body import Body, MaterialRegion, nodes_requirement
from palpate.scene_mesh import BodyMesh, FixedBox
from palpate.scene_schema import Reader, SceneError
from palpate.scene_sections import (
    FAULT_WAYS,
    TICK_S,
    BoardFaults,
    Contact,
    FrictionRegion,
    Hand,
    Link,
    LinkFaults,
    Outputs,
    Path,
    Safety,
    SceneFile,
)

# Capacity of a local model (kMaxFrictions in shared/model).
MAX_FRICTIONS = 4
MAX_MODES = 192  # of a local model on the board (shared/model/local_model.hpp)
MAX_HYBRID_MODES = 96  # of one with as many nodes as it may have
MAX_PATCH_NODES = 64
# nucleo_g474re (CMakePresets.json, boards/stm32g4/lpuart_link.hpp).
NUCLEO = "nucleo_g474re"
NUCLEO_MAX_MODES = 96
NUCLEO_BAUD = 921_600
# 1.2 GB of positions and velocities in memory and in the record.
MAX_EXPORTED_NODES = 25_000_000


def check_scene(reader: Reader, scene: SceneFile) -> None:
    """Raises SceneError for the first combination of keys that is not usable."""
    _check_body(reader, scene.body)
    if scene.body.mesh is not None:
        _check_mesh_elsewhere(reader, scene)
    _check_step(reader, "integrator.step_s", scene.integrator.step_s)
    _check_contact(reader, scene.contact)
    if scene.path is not None:
        if scene.body.dimension == 2:
            raise reader.problem(
                "path",
                "a two-dimensional body cannot be touched; body.dimension must be 3, or [path] "
                "must be left out",
            )
        if scene.integrator.method != "semi_implicit":
            raise reader.error(
                "integrator.method", scene.integrator.method, '"semi_implicit" where [path] is given'
            )
        _check_path(reader, scene.path)
    if scene.body.drives and scene.integrator.method != "semi_implicit":
        raise reader.error(
            "integrator.method", scene.integrator.method, '"semi_implicit" where body.drives is given'
        )
    _check_hand(reader, scene.hand)
    _check_safety(reader, scene.safety)
    if scene.board.name == NUCLEO:
        _check_nucleo(reader, scene)
    _check_patch(reader, scene)
    if scene.link.trace == "tip" and scene.model.feedback == "paper":
        raise reader.error(
            "link.trace",
            scene.link.trace,
            '"full" where model.feedback = "paper": the host repeats the board\'s rendering, to the bit',
        )
    _check_link(reader, scene.link)
    for way in ("down", "up"):
        _check_link_faults(reader, way, scene.link.faults)
    _check_fault_times(reader, scene.link.faults, scene.duration_s)
    _check_board_faults(reader, scene.board.faults, scene.duration_s)
    _check_step(reader, "reference.step_s", scene.reference.step_s)
    _check_outputs(reader, scene.outputs, scene)


def steps_per_tick(step_s: float) -> int | None:
    """How many steps make a servo tick; None where the tick is not a whole number of them."""
    steps = round(TICK_S / step_s)
    return steps if math.isclose(steps * step_s, TICK_S, rel_tol=1e-9) else None


def _check_step(reader: Reader, where: str, step_s: float) -> None:
    if steps_per_tick(step_s) is None:
        raise reader.error(where, step_s, f"{TICK_S:g} s divided by a whole number in [1, 1000]")


# Of [body], what a mesh takes.
_MESH_TAKES = ("mesh", "origin_m", "damping_ratio", "gravity_m_s2")


def _check_mesh(reader: Reader, body: Body, mesh: BodyMesh) -> None:
    """What does not need the file."""
    for given in fields(body):
        if given.name not in _MESH_TAKES and getattr(body, given.name) != given.default:
            raise reader.problem(f"body.{given.name}", "given together with body.mesh; must be left out")
    if mesh.file == "":
        raise reader.error("body.mesh.file", mesh.file, "the name of a file")
    names = [region.name for region in mesh.regions]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise reader.error(f"body.mesh.regions[{i}].name", name, "a region that is not given already")
    for i, box in enumerate(mesh.fixed_boxes):
        _check_box(reader, f"body.mesh.fixed_boxes[{i}]", box)
    for i, plane in enumerate(mesh.fixed_planes):
        if not any(plane.normal):
            raise reader.error(f"body.mesh.fixed_planes[{i}].normal", list(plane.normal), "of a length other than 0")


def _check_mesh_elsewhere(reader: Reader, scene: SceneFile) -> None:
    """Of other sections, what knows lattices only."""
    if scene.model.builder == "hybrid":
        raise reader.error(
            "model.builder",
            scene.model.builder,
            '"patch", "patch_rescaled", "condensed" or "krylov" where body.mesh is given: each spring of a mesh is of its own kind, and '
            "the board holds 16 kinds near the contact",
        )
    if scene.outputs.probe_node is not None:
        raise reader.error("outputs.probe_node", list(scene.outputs.probe_node), "left out where body.mesh is given: it has no indices [i, j, k]")


def _check_body(reader: Reader, body: Body) -> None:
    if body.mesh is not None:
        _check_mesh(reader, body, body.mesh)
        return
    if not body.nodes:
        raise reader.problem("body.nodes", f"missing; must be {nodes_requirement()}, or a table [body.mesh]")
    dimension = body.dimension
    if len(body.nodes) != dimension:
        raise reader.error(
            "body.nodes",
            list(body.nodes),
            f"{dimension} whole numbers in [2, 64] where body.dimension = {dimension}",
        )
    _check_damping(reader, "body", body)
    if dimension == 2 and body.gravity_m_s2[1] != 0.0:
        raise reader.error("body.gravity_m_s2", list(body.gravity_m_s2), "0 along y where body.dimension = 2")
    if dimension == 2:
        for i, face in enumerate(body.fixed_faces):
            if face.startswith("y"):
                raise reader.error(
                    f"body.fixed_faces[{i}]", face, 'one of "x-", "x+", "z-", "z+" where body.dimension = 2'
                )
    for i, node in enumerate(body.fixed_nodes):
        _check_node(reader, f"body.fixed_nodes[{i}]", node, body)
    fixed = fixed_nodes(body)
    if not fixed:
        raise reader.error(
            "body.fixed_faces",
            list(body.fixed_faces),
            "such that at least one node is fixed, by body.fixed_faces or body.fixed_nodes",
        )
    if len(fixed) == math.prod(body.nodes):
        raise reader.error("body.fixed_faces", list(body.fixed_faces), "such that at least one node is free")
    seen: set[tuple[int, ...]] = set()
    for i, start in enumerate(body.initial_displacements):
        where = f"body.initial_displacements[{i}]"
        _check_node(reader, f"{where}.node", start.node, body)
        if len(start.displacement_m) != dimension:
            raise reader.error(
                f"{where}.displacement_m",
                list(start.displacement_m),
                f"{dimension} numbers in [-1, 1] m where body.dimension = {dimension}",
            )
        if start.node in fixed:
            raise reader.error(f"{where}.node", list(start.node), "a node that is not fixed")
        if start.node in seen:
            raise reader.error(f"{where}.node", list(start.node), "a node that is not displaced already")
        seen.add(start.node)
    for i, region in enumerate(body.regions):
        _check_region(reader, f"body.regions[{i}]", region, body)
    _check_drives(reader, body, fixed)


def _check_damping(reader: Reader, where: str, given: Body | MaterialRegion) -> None:
    if given.damping_ratio is not None and given.damping_N_s_m is not None:
        raise reader.problem(
            f"{where}.damping_N_s_m",
            f"given together with {where}.damping_ratio = {given.damping_ratio:g}; must be only one",
        )


def _check_region(reader: Reader, where: str, region: MaterialRegion, body: Body) -> None:
    _check_node(reader, f"{where}.from_node", region.from_node, body)
    _check_node(reader, f"{where}.to_node", region.to_node, body)
    axes = "xyz" if body.dimension == 3 else "xz"
    for axis, low, high in zip(axes, region.from_node, region.to_node, strict=True):
        if low > high:
            raise reader.error(
                f"{where}.to_node",
                list(region.to_node),
                f"at least {where}.from_node in each index; {axis} is less",
            )
    _check_damping(reader, where, region)
    if region.from_node == region.to_node:
        for name in ("stiffness_N_m", "damping_ratio", "damping_N_s_m"):
            if getattr(region, name) is not None:
                raise reader.problem(
                    f"{where}.{name}",
                    "given for a region of one node, which holds no spring; must be left out",
                )


def _check_drives(reader: Reader, body: Body, fixed: set[tuple[int, ...]]) -> None:
    latest: dict[tuple[int, ...], float] = {}
    for i, drive in enumerate(body.drives):
        where = f"body.drives[{i}]"
        _check_node(reader, f"{where}.node", drive.node, body)
        if len(drive.displacement_m) != body.dimension:
            raise reader.error(
                f"{where}.displacement_m",
                list(drive.displacement_m),
                f"{body.dimension} numbers in [-1, 1] m where body.dimension = {body.dimension}",
            )
        if drive.node in fixed:
            raise reader.error(f"{where}.node", list(drive.node), "a node that is not fixed")
        if drive.reach_s <= drive.start_s:
            raise reader.error(f"{where}.reach_s", drive.reach_s, f"greater than start_s = {drive.start_s:g} s")
        if drive.release_s < drive.reach_s:
            raise reader.error(f"{where}.release_s", drive.release_s, f"at least reach_s = {drive.reach_s:g} s")
        released_s = latest.get(drive.node, 0.0)
        if drive.start_s < released_s:
            raise reader.error(
                f"{where}.start_s",
                drive.start_s,
                f"at least {released_s:g} s, when the drive of this node before releases it",
            )
        latest[drive.node] = drive.release_s


def _check_node(reader: Reader, where: str, node: tuple[int, ...], body: Body) -> None:
    if len(node) != body.dimension or any(
        index >= count for index, count in zip(node, body.nodes, strict=True)
    ):
        ranges = ", ".join(f"0..{count - 1}" for count in body.nodes)
        raise reader.error(where, list(node), f"indices within [{ranges}]")


def fixed_nodes(body: Body) -> set[tuple[int, ...]]:
    """Indices of all nodes that do not move."""
    fixed = set(body.fixed_nodes)
    axes = "xyz" if body.dimension == 3 else "xz"
    for face in body.fixed_faces:
        axis = axes.index(face[0])
        index = 0 if face[1] == "-" else body.nodes[axis] - 1
        ranges = [range(count) for count in body.nodes]
        ranges[axis] = range(index, index + 1)
        fixed.update(product(*ranges))
    return fixed


def _check_box(reader: Reader, where: str, box: FixedBox | FrictionRegion) -> None:
    for axis, (low_m, high_m) in enumerate(zip(box.from_m, box.to_m, strict=True)):
        if low_m > high_m:
            raise reader.error(
                f"{where}.from_m", list(box.from_m), f"at most {where}.to_m in each coordinate; {'xyz'[axis]} is greater"
            )


def _check_contact(reader: Reader, contact: Contact) -> None:
    _check_friction(reader, "contact", contact)
    for i, region in enumerate(contact.regions):
        where = f"contact.regions[{i}]"
        _check_friction(reader, where, region)
        _check_box(reader, where, region)
    different = {friction(contact), *map(friction, contact.regions)}
    if len(different) > MAX_FRICTIONS:
        raise reader.problem(
            "contact.regions",
            f"{len(different)} different pairs of friction coefficients in the scene; must be at most {MAX_FRICTIONS}",
        )


def _check_friction(reader: Reader, where: str, given: Contact | FrictionRegion) -> None:
    if given.friction is not None:
        for name, value in (
            ("static_friction", given.static_friction),
            ("kinetic_friction", given.kinetic_friction),
        ):
            if value is not None:
                raise reader.problem(
                    f"{where}.{name}",
                    f"given together with {where}.friction = {given.friction:g}; must be only one",
                )
    static, kinetic = friction(given)
    if given.kinetic_friction is not None and given.static_friction is None:
        raise reader.problem(
            f"{where}.static_friction", f"missing; must be in [0, 10] where {where}.kinetic_friction is given"
        )
    if kinetic > static:
        raise reader.error(
            f"{where}.kinetic_friction", kinetic, f"in [0, {static:g}], at most {where}.static_friction"
        )


def friction(given: Contact | FrictionRegion) -> tuple[float, float]:
    """Coefficients of static and of kinetic friction, with the defaults filled in."""
    static = next((v for v in (given.static_friction, given.friction) if v is not None), 0.0)
    return static, static if given.kinetic_friction is None else given.kinetic_friction


def _check_path(reader: Reader, path: Path) -> None:
    if (path.waypoints is None) == (path.csv is None):
        problem = "missing" if path.csv is None else f'given together with path.csv = "{path.csv}"'
        raise reader.problem(
            "path.waypoints", f"{problem}; must be exactly one of path.waypoints and path.csv"
        )
    if path.waypoints is None:
        return
    if not path.waypoints:
        raise reader.error("path.waypoints", [], "a list of at least one point")
    for i in range(1, len(path.waypoints)):
        time_s, before_s = path.waypoints[i].time_s, path.waypoints[i - 1].time_s
        if time_s <= before_s:
            raise reader.error(
                f"path.waypoints[{i}].time_s", time_s, f"greater than the previous time {before_s:.12g} s"
            )


# What firmware::Limits has where a scene says nothing (firmware/core/supervisor.hpp), s.
BOARDS_OWN_s = {"horizon_s": 1.0, "fade_s": 0.2, "damp_s": 1.0, "resume_within_s": 10.0}
LINK_SILENT_s = 0.3


def _check_safety(reader: Reader, safety: Safety) -> None:
    """As lost_after_off() of firmware/core/limit_ranges.hpp."""
    given = {name: getattr(safety, name) for name in BOARDS_OWN_s}
    for name, time_s in given.items():
        if time_s is not None and not math.isclose(time_s / TICK_S, round(time_s / TICK_S), abs_tol=1e-6):
            raise reader.error(f"safety.{name}", time_s, f"a whole number of servo ticks of {TICK_S:g} s")
    ticks = {name: round((own_s if given[name] is None else given[name]) / TICK_S) for name, own_s in BOARDS_OWN_s.items()}
    off = max(ticks["horizon_s"] + ticks["fade_s"], round(LINK_SILENT_s / TICK_S)) + ticks["damp_s"]
    if off > ticks["resume_within_s"]:
        raise reader.error(
            "safety.resume_within_s", TICK_S * ticks["resume_within_s"],
            f"at least {TICK_S * off:.12g} s, until outputs are off: horizon_s + fade_s, or {LINK_SILENT_s:g} s, + damp_s",
        )


def _check_hand(reader: Reader, hand: Hand) -> None:
    if hand.kind == "scripted":
        for field in fields(hand):
            value = getattr(hand, field.name)
            if field.name != "kind" and value != field.default:
                raise reader.problem(
                    f"hand.{field.name}",
                    'given together with hand.kind = "scripted"; must be left out, for nothing gives way',
                )
    for i in range(1, len(hand.grip_changes)):
        time_s, before_s = hand.grip_changes[i].time_s, hand.grip_changes[i - 1].time_s
        if time_s <= before_s:
            raise reader.error(
                f"hand.grip_changes[{i}].time_s", time_s, f"greater than the previous time {before_s:.12g} s"
            )


def largest_face(patch_nodes: Sequence[int]) -> int:
    """Nodes of the largest face of a patch."""
    x, y, z = patch_nodes
    return max(x * y, x * z, y * z)


def hybrid_modes(patch_nodes: Sequence[int], near_nodes: int, middle_shifts_Hz: Sequence[float]) -> int:
    """The most modes of a local model of builder hybrid; without middle_shifts_Hz it has one."""
    return 3 * (largest_face(patch_nodes) + near_nodes) + 12 * max(1, len(middle_shifts_Hz))


def _check_patch(reader: Reader, scene: SceneFile) -> None:
    patch = scene.model.patch_nodes
    if math.prod(patch) > MAX_PATCH_NODES:
        raise reader.error("model.patch_nodes", list(patch), f"at most {MAX_PATCH_NODES} nodes in all")
    max_modes = NUCLEO_MAX_MODES if scene.board.name == NUCLEO else MAX_MODES
    if scene.model.builder in ("patch", "patch_rescaled") and 3 * math.prod(patch) > max_modes:
        raise reader.error(
            "model.patch_nodes",
            list(patch),
            f'at most {max_modes // 3} nodes in all where board.name = "{NUCLEO}", which has room for {max_modes} modes',
        )
    if scene.model.builder != "patch" and scene.body.drives:
        raise reader.problem(
            "body.drives",
            f'given together with model.builder = "{scene.model.builder}", which knows no driven nodes',
        )
    if scene.model.builder not in ("krylov", "hybrid"):
        return
    shifts_Hz, middle_Hz = scene.model.shifts_Hz, scene.model.middle_shifts_Hz
    if not shifts_Hz:
        raise reader.error("model.shifts_Hz", [], "at least one frequency")
    for name, ascending in (("shifts_Hz", shifts_Hz), ("middle_shifts_Hz", middle_Hz)):
        for i in range(1, len(ascending)):
            if ascending[i] <= ascending[i - 1]:
                raise reader.error(
                    f"model.{name}[{i}]", ascending[i], f"greater than the previous one, {ascending[i - 1]:g} Hz"
                )
    face = largest_face(patch)
    if scene.model.builder == "hybrid":
        if hybrid_modes(patch, scene.model.near_nodes, middle_Hz) > MAX_HYBRID_MODES:
            raise reader.error(
                "model.near_nodes",
                scene.model.near_nodes,
                f"so few that 3 modes for each of them and of the {face} nodes of a face of the patch, and 12 for each of "
                f"model.middle_shifts_Hz, one at least, are at most {MAX_HYBRID_MODES}",
            )
    elif 3 * face * len(shifts_Hz) + 12 * len(middle_Hz) > max_modes:
        raise reader.error(
            "model.shifts_Hz",
            list(shifts_Hz),
            f"so few that 3 modes for each of them and of the {face} nodes of a face of the patch, and 12 for each of "
            f"model.middle_shifts_Hz, are at most {max_modes}",
        )


# On a USB bus (USB 2.0, 8.6 and 8.7).
_ONE_HOST = "a USB bus has one host, and no device sends what it has not asked for"
_REPEATS = "it repeats what an error has hit, so that no frame is lost, cut, comes twice or overtakes"
# On a CAN bus (ISO 11898-1).
_NOT_ON_CAN = {
    "truncate": "a frame says its length under its CRC, so none is cut short",
    "reorder": "frames of one identifier keep their order, and those of others overtake by priority in every run",
}
_MOST_BUS_ERRORS = 0.9


def _check_link(reader: Reader, link: Link) -> None:
    if link.medium == "canfd" and link.data_bit_rate_Hz < link.bit_rate_Hz:
        raise reader.error(
            "link.data_bit_rate_Hz", link.data_bit_rate_Hz, f"in [{link.bit_rate_Hz}, 8000000] bit/s, at least link.bit_rate_Hz"
        )
    faults = link.faults
    if link.medium != "usb" and faults.refused:
        raise reader.problem("link.faults.refused", f'given together with link.medium = "{link.medium}"; a device refuses packets on "usb" only')
    if link.medium not in ("can", "canfd") and faults.babble:
        raise reader.problem("link.faults.babble", f'given together with link.medium = "{link.medium}"; a node babbles on "can" and "canfd" only')
    if link.medium == "uart":
        return
    for name in (f"{kind}_{way}" for kind in ("drop", "flip", "duplicate", "reorder") for way in FAULT_WAYS):
        if getattr(faults, name):
            raise reader.problem(
                f"link.faults.{name}",
                f'given together with link.medium = "{link.medium}"; frames have numbers on "uart" only: there is link.faults.random',
            )
    if link.medium == "usb":
        _check_usb_faults(reader, faults)
    else:
        _check_can_faults(reader, link)


def _check_usb_faults(reader: Reader, faults: LinkFaults) -> None:
    for name in ("second_host", "flood"):
        if getattr(faults, name):
            raise reader.problem(f"link.faults.{name}", f'given together with link.medium = "usb"; {_ONE_HOST}')
    for i, fault in enumerate(faults.random):
        where = f"link.faults.random[{i}]"
        if fault.kind != "flip":
            raise reader.error(f"{where}.kind", fault.kind, f'"flip" where link.medium = "usb": {_REPEATS}')
        if fault.chance > _MOST_BUS_ERRORS:
            raise reader.error(f"{where}.chance", fault.chance, f'in [0, {_MOST_BUS_ERRORS:g}] where link.medium = "usb", or no packet ever goes through')


def _check_can_faults(reader: Reader, link: Link) -> None:
    faults = link.faults
    for i, flood in enumerate(faults.flood):
        if flood.load > 1.0:
            raise reader.error(
                f"link.faults.flood[{i}].load", flood.load, f'in [0, 1] where link.medium = "{link.medium}": no node sends more than its bus carries'
            )
    for i, fault in enumerate(faults.random):
        where = f"link.faults.random[{i}]"
        if fault.kind in _NOT_ON_CAN:
            raise reader.error(
                f"{where}.kind", fault.kind, f'"drop", "flip" or "duplicate" where link.medium = "{link.medium}": {_NOT_ON_CAN[fault.kind]}'
            )
        if fault.kind == "flip" and fault.chance > _MOST_BUS_ERRORS:
            raise reader.error(
                f"{where}.chance", fault.chance, f'in [0, {_MOST_BUS_ERRORS:g}] where link.medium = "{link.medium}", or no frame ever goes through'
            )


def _check_link_faults(reader: Reader, way: str, faults: LinkFaults) -> None:
    named = [(f"link.faults.drop_{way}[{i}]", frame) for i, frame in enumerate(getattr(faults, f"drop_{way}"))]
    for kind in ("flip", "duplicate", "reorder"):
        tables = getattr(faults, f"{kind}_{way}")
        named += [(f"link.faults.{kind}_{way}[{i}].frame", fault.frame) for i, fault in enumerate(tables)]
    seen: set[int] = set()
    for where, frame in named:
        if frame in seen:
            raise reader.error(where, frame, "a frame that has no fault yet")
        seen.add(frame)


def _check_board_faults(reader: Reader, faults: BoardFaults, duration_s: float) -> None:
    ticks = round(duration_s / TICK_S)
    given = [
        (f"board.faults.{name}[{i}]", tick)
        for name in ("overlong_ticks", "emergency_stop_ticks", "supply_low_ticks", "reset_ticks")
        for i, tick in enumerate(getattr(faults, name))
    ]
    given += [(f"board.faults.encoder_slips[{i}].tick", slip.tick) for i, slip in enumerate(faults.encoder_slips)]
    for where, tick in given:
        if tick >= ticks:
            raise reader.error(where, tick, f"less than {ticks}, the servo ticks of duration_s = {duration_s:.12g} s: it would never show")


def _check_fault_times(reader: Reader, faults: LinkFaults, duration_s: float) -> None:
    for name in ("random", "delay", "unplugged", "host_stopped", "other_schema", "second_host", "babble", "flood", "refused"):
        for i, span in enumerate(getattr(faults, name)):
            if span.to_s <= span.from_s:
                raise reader.error(
                    f"link.faults.{name}[{i}].to_s", span.to_s, f"greater than its from_s, {span.from_s:.12g} s"
                )
            if span.from_s >= duration_s:
                raise reader.error(
                    f"link.faults.{name}[{i}].from_s", span.from_s, f"less than duration_s = {duration_s:.12g} s: it would never show"
                )


def _check_nucleo(reader: Reader, scene: SceneFile) -> None:
    """What the image for a real part has not, or has once for all."""
    if any(time_s is not None for time_s in astuple(scene.safety)):
        raise reader.problem(
            "safety", f"the image for board.name = \"{NUCLEO}\" has times of its own (boards/{NUCLEO}/limits.hpp); leave it out"
        )
    if scene.link.medium == "uart" and scene.link.baud != NUCLEO_BAUD:
        raise reader.error("link.baud", scene.link.baud, f'{NUCLEO_BAUD} where board.name = "{NUCLEO}"')


def _check_outputs(reader: Reader, outputs: Outputs, scene: SceneFile) -> None:
    times_s = outputs.node_times_s
    for i, time_s in enumerate(times_s):
        if time_s > scene.duration_s:
            raise reader.error(
                f"outputs.node_times_s[{i}]", time_s, f"in [0, {scene.duration_s:g}] s, the duration"
            )
        if i > 0 and time_s <= times_s[i - 1]:
            raise reader.error(
                f"outputs.node_times_s[{i}]",
                time_s,
                f"greater than the previous time {times_s[i - 1]:.12g} s",
            )
    if scene.body.mesh is None:
        if outputs.probe_node is not None:
            _check_node(reader, "outputs.probe_node", outputs.probe_node, scene.body)
        check_exported_nodes(reader, outputs, math.prod(scene.body.nodes))


def check_exported_nodes(reader: Reader, outputs: Outputs, nodes: int) -> None:
    """Raises SceneError where all the nodes at all the times are more than fit into memory."""
    most = max(1, MAX_EXPORTED_NODES // nodes)
    if len(outputs.node_times_s) > most:
        raise SceneError(
            f"{reader.file}: outputs.node_times_s: {len(outputs.node_times_s):,} times: must be at most {most:,} for {nodes:,} nodes"
        )
