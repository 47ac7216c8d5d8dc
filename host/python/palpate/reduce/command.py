"""`palpate reduce`: from a scene, or a square or cube of the paper, to a reduction or a verdict on locality."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from palpate.experiment import ProgressBar
from palpate.paths import SCENES
from palpate.reduce import compliance, pictures
from palpate.reduce.compliance import Comparison
from palpate.reduce.locality import Locality, check_locality
from palpate.reduce.study import LARGEST_DENSE, Reduction, reduce_system
from palpate.reduce.system import BodyError, ContactSystem, LinearBody, contact_system, linear_body, middle_of_top
from palpate.scene import Scene, SceneError, load_scene

OpenBar = Callable[[str, str], AbstractContextManager[ProgressBar]]

# The paper's bodies: one edge or two faces held.
PAPER_SCENES = {2: SCENES / "reproduce" / "square.toml", 3: SCENES / "reproduce" / "cube.toml"}


@dataclass(frozen=True)
class Request:
    """What to reduce. node: lattice indices of the contact node, [i, k] in two dimensions; None: the middle of the top."""

    scene: Scene
    node: Sequence[int] | None
    order: int | None
    dense: bool
    tolerance: float


def paper_overrides(dimension: int, nodes: int | None, damping_ratio: float | None) -> dict[str, Any]:
    """Keys of the paper's scene for `--n` and `--damping`."""
    chosen: dict[str, Any] = {}
    if nodes is not None:
        chosen["body.nodes"] = [nodes] * dimension
    if damping_ratio is not None:
        chosen["body.damping_ratio"] = damping_ratio
    return chosen


def load(file: Path | None, dimension: int, overrides: Mapping[str, Any]) -> Scene:
    """A scene's file, or the paper's body of this dimension. Raises SceneError."""
    return load_scene(file or PAPER_SCENES[dimension], dict(overrides))


def build_system(core: Any, request: Request) -> ContactSystem:
    """The system of the request's contact node. Raises SceneError, naming the scene's file."""
    request.scene.require_lattice("a reduction")
    body = linear_body(core, request.scene.to_dict())
    try:
        with threadpool_limits(1):
            return contact_system(body, middle_of_top(body) if request.node is None else _node(body, request.node))
    except BodyError as error:
        raise SceneError(f"{request.scene.file}: {error}") from None


def _node(body: LinearBody, indices: Sequence[int]) -> int:
    nx, ny, nz = body.shape
    planar = ny == 1 and len(indices) == 2
    i, j, k = (indices[0], 0, indices[1]) if planar else indices if len(indices) == 3 else (-1, -1, -1)
    if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
        given = " ".join(map(str, indices))
        wanted = f"I K in [0, {nx - 1}] [0, {nz - 1}]" if ny == 1 else f"I J K in [0, {nx - 1}] [0, {ny - 1}] [0, {nz - 1}]"
        raise SceneError(f"--node = {given}: must be {wanted}")
    return i + nx * (j + ny * k)


def reduce_body(
    core: Any, request: Request, folder: Path, open_bar: OpenBar
) -> tuple[dict[str, Any], str, bool]:
    """Reduces, writes reduction.json and reduction.png to the folder; what `--json` prints, the text for a person, and
    whether the projection came to its tolerance. Raises SceneError."""
    system = build_system(core, request)
    if request.dense and system.states > LARGEST_DENSE:
        raise SceneError(f"--dense: {system.states:,} states: must be at most {LARGEST_DENSE:,}")
    if request.order is not None and not 1 <= request.order <= system.states:
        raise SceneError(f"--order = {request.order}: must be in [1, {system.states}], the body's states")
    _make(folder)
    with open_bar(f"reducing {system.states:,} states", "step") as bar:
        reduction = reduce_system(
            system, request.order, dense=request.dense, tolerance=request.tolerance, progress=bar
        )
    converged = reduction.projection_error <= request.tolerance
    values = {
        "scene": str(request.scene.file),
        "contact_node": list(_place(reduction.system)),
        "converged": converged,
        **reduction.to_dict(),
    }
    files = _write(folder, "reduction", values, lambda file: pictures.draw_reduction(reduction, file))
    text = describe_reduction(request, reduction)
    if not converged:
        text += (
            f"\nThe projection missed its tolerance of {request.tolerance:g}: {2 * reduction.projected.size} states are its "
            f"most, too few for a body that rings so long; raise --tolerance, or, up to {LARGEST_DENSE:,} states, use --dense."
        )
    return {**values, "files": files}, text, converged


def judge_locality(
    core: Any, request: Request, press_m: float, folder: Path, open_bar: OpenBar
) -> tuple[dict[str, Any], str, bool]:
    """Writes locality.json, locality.png and, where the board has models for the contact, compliance.png to the folder; what
    `--json` prints, the text for a person, and the verdict. press_m: how far the node is pressed in where builders are
    compared. Raises SceneError."""
    system = build_system(core, request)
    rate_Hz = request.scene.sections.rates.model_update_Hz
    _make(folder)
    with open_bar(f"reducing {system.states:,} states", "step") as bar:
        locality = check_locality(system, rate_Hz, core.MAX_MODES, bar)
    comparison: Comparison | None = None
    if compliance.comparable(system):
        with open_bar("answering forces on the full body", "frequency") as bar:
            comparison = compliance.compare_builders(core, request.scene, system, press_m, bar)
    values = {
        "scene": str(request.scene.file),
        "contact_node": list(_place(system)),
        **locality.to_dict(),
        "compliance": comparison.to_dict() if comparison else None,
    }
    files = _write(folder, "locality", values, lambda file: pictures.draw_locality(locality, file))
    if comparison:
        pictures.draw_compliance(comparison, folder / "compliance.png")
        files["compliance.png"] = str(folder / "compliance.png")
    return {**values, "files": files}, describe_locality(request, locality, comparison), locality.local


def _place(system: ContactSystem) -> tuple[int, int, int]:
    return system.body.coordinates(system.contact_node)


def _make(folder: Path) -> None:
    """Before anything is computed, so that a folder that can't be written is told of at once."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SceneError(f"--out = {folder}: must be a folder that can be written ({error.strerror})") from None


def _write(folder: Path, name: str, values: Mapping[str, Any], draw: Callable[[Path], None]) -> dict[str, str]:
    picture, data = folder / f"{name}.png", folder / f"{name}.json"
    draw(picture)
    data.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return {data.name: str(data), picture.name: str(picture)}


def _lines(title: str, rows: Sequence[tuple[str, str]]) -> str:
    width = max([46, *(len(label) + 1 for label, _ in rows)])
    return "\n".join([title, *(f"  {label:<{width}}{text}" for label, text in rows)])


def _title(request: Request, system: ContactSystem) -> str:
    return f"{request.scene.sections.title or request.scene.file.stem}, contact at node {_place(system)}"


def _bound(relative: float) -> str:
    return f"at most {100 * relative:.3g} %" if math.isfinite(relative) else "no bound"


def describe_reduction(request: Request, reduction: Reduction) -> str:
    """A reduction and its errors, for a person."""
    asked = request.order
    rest = "" if asked is None or reduction.order == asked else f" (asked: {asked}; the rest is rounding)"
    percent = "{:.3g} %".format
    rows = [
        ("states", f"{reduction.system.states:,}"),
        ("order", f"{reduction.order}{rest}"),
        ("error, certified (H-infinity, relative)", _bound(reduction.certified_error)),
        ("  of it, of the projection", percent(100 * reduction.projection_error)),
        ("error by the singular values left out (bound)", _bound(reduction.a_priori_bound)),
        ("next singular value over the largest", percent(100 * reduction.next_singular_value)),
        ("sum of those left out over the sum", percent(100 * reduction.tail_sum)),
        ("states that were balanced", f"{2 * reduction.projected.size}"),
        (
            "time on one core of this machine",
            f"{reduction.time_s:.3g} s, {reduction.system.time_s:.3g} s of it for the system's eigenvalue bounds",
        ),
    ]
    return _lines(_title(request, reduction.system), rows)


def describe_locality(request: Request, locality: Locality, comparison: Comparison | None = None) -> str:
    """A verdict on locality, for a person."""
    rows = [("states", f"{locality.reduction.system.states:,}")]
    rows += [
        (
            f"{patch.name(locality.planar)} patch, {patch.modes} modes{'' if patch.fits else ' (too many)'}",
            f"misses {100 * patch.error_in_band:.3g} % above {locality.update_rate_Hz:g} Hz, "
            f"{100 * patch.error[0]:.3g} % at {locality.frequency_Hz[0]:g} Hz",
        )
        for patch in locality.patches
    ]
    rows.append(
        (
            f"whole body, balanced, {locality.reduction.order} states",
            f"error, certified, of the largest: {_bound(locality.reduction.certified_error)}",
        )
    )
    rows.append(("of its states, inside the first patch", f"{100 * locality.state_share:.0f} %"))
    if comparison:
        rows += compliance.describe(comparison)
    return _lines(_title(request, locality.reduction.system), rows) + f"\n{locality.verdict()}"
