"""How well the board's local models answer a force at the contact, by builder, against the full linear body.

Driven at a node, and in the middle of a triangle at it, where a body is softer between its nodes and models err more. At
rest, or with the node pressed in. The builders are those that a scene can name (`model.builder`), as they build: in modes,
their damping decoupled, in continuous time.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.reduce.study import finite
from palpate.reduce.system import ContactSystem
from palpate.scene import Scene, SceneError
from palpate.scene_checks import MAX_HYBRID_MODES, hybrid_modes, largest_face

Array = NDArray[np.float64]
Progress = Callable[[int, int], bool]

# Frequencies of `krylov` that are compared, in Hz: of all surface nodes, and of the contact's cell.
KRYLOV_SHIFTS_HZ = (
    ((0.0,), ()),
    ((0.0, 20.0), ()),
    ((0.0, 20.0, 150.0), ()),
    ((0.0,), (20.0, 200.0)),
    ((0.0,), (20.0, 40.0, 300.0)),
    ((0.0,), (10.0, 20.0, 40.0, 200.0)),
)


@dataclass(frozen=True)
class ModelError:
    """A local model of the board. model: the keys of [model] that its builder reads; modes, and basis: entries of the board's
    basis; at_node, between_nodes (f,): relative error of the 3x3 compliance there; damping_error, damping_bound (f,): the part of
    it at the node that comes from damping between modes, which is left out, and its bound (infinite: none); damping_coupling,
    limited_modes: see docs/records.md."""

    model: dict[str, Any]
    modes: int
    basis: int
    at_node: Array
    between_nodes: Array
    damping_error: Array
    damping_bound: Array
    damping_coupling: float
    limited_modes: int

    def name(self) -> str:
        """For a person."""
        if self.model["builder"] != "krylov":
            return str(self.model["builder"])
        shifts = ", ".join(f"{shift_Hz:g}" for shift_Hz in self.model["shifts_Hz"])
        middle = ", ".join(f"{shift_Hz:g}" for shift_Hz in self.model["middle_shifts_Hz"])
        return f"krylov, {self.model['tangent']}, {shifts}{f' + {middle}' if middle else ''} Hz"


@dataclass(frozen=True)
class Comparison:
    """frequency_Hz (f,): 0, then rising; body_m_N (f,): 2-norm of the full body's compliance at the node; press_m: how far the
    node was pressed in."""

    frequency_Hz: Array
    body_m_N: Array
    press_m: float
    models: list[ModelError]

    def to_dict(self) -> dict[str, Any]:
        """What `--json` prints as `compliance`."""

        def error(relative: Array) -> dict[str, Any]:
            return {
                "largest": float(relative.max()),
                "largest_at_Hz": float(self.frequency_Hz[relative.argmax()]),
                "static": float(relative[0]),
                "relative": relative.tolist(),
            }

        return {
            "press_m": self.press_m,
            "frequency_Hz": self.frequency_Hz.tolist(),
            "body_m_N": self.body_m_N.tolist(),
            "models": [
                {
                    **one.model,
                    "modes": one.modes,
                    "basis": one.basis,
                    "damping_coupling": one.damping_coupling,
                    "damping_error": float(one.damping_error.max()),
                    "damping_bound": finite(float(one.damping_bound.max())),
                    "limited_modes": one.limited_modes,
                    "at_node": error(one.at_node),
                    "between_nodes": error(one.between_nodes),
                }
                for one in self.models
            ],
        }


def comparable(system: ContactSystem) -> bool:
    """Whether the board has local models for this contact: of a node on the surface of a body in three dimensions."""
    return bool(np.any(system.body.triangles == system.contact_node))


def compare_builders(core: Any, scene: Scene, system: ContactSystem, press_m: float, progress: Progress) -> Comparison:
    """The scene's own model first, then every builder with the scene's patch. Raises SceneError for what the core refuses."""
    values = scene.to_dict()
    models = candidates(values["model"], system.body.shape, core.MAX_MODES, pressed=press_m != 0.0)
    try:
        found = core.compliance_errors(values, system.contact_node, models, press_m, progress)
    except ValueError as error:
        raise SceneError(f"{scene.file}: {error}") from None
    compared = [
        ModelError(
            model,
            one["modes"],
            one["basis"],
            one["at_node"],
            one["between_nodes"],
            one["damping_error"],
            one["damping_bound"],
            one["damping_coupling"],
            one["limited_modes"],
        )
        for model, one in zip(models, found["models"], strict=True)
    ]
    return Comparison(found["frequency_Hz"], found["compliance_m_N"], press_m, compared)


def candidates(
    own: Mapping[str, Any], nodes: tuple[int, int, int], most_modes: int, *, pressed: bool
) -> list[dict[str, Any]]:
    """Models to compare. own: the scene's [model]; nodes: of the lattice, to which patches are cut. At rest the tangent of the
    frame is the tangent at rest; pressed, `krylov` is compared with both."""
    patch = [min(size, most) for size, most in zip(own["patch_nodes"], nodes, strict=True)]

    def model(
        builder: str, tangent: str = "frame", shifts_Hz: Sequence[float] = (0.0,), middle_Hz: Sequence[float] = ()
    ) -> dict[str, Any]:
        return {
            "builder": builder,
            "tangent": tangent,
            "patch_nodes": patch,
            "shifts_Hz": list(shifts_Hz),
            "middle_shifts_Hz": list(middle_Hz),
            "near_nodes": own["near_nodes"],
        }

    face = largest_face(patch)
    found = [model(own["builder"], own["tangent"], own["shifts_Hz"], own["middle_shifts_Hz"])]
    found += [model(builder) for builder in ("patch", "patch_rescaled", "condensed")]
    if hybrid_modes(patch, own["near_nodes"], ()) <= MAX_HYBRID_MODES:
        found.append(model("hybrid"))
    for shifts_Hz, middle_Hz in KRYLOV_SHIFTS_HZ:
        if 3 * face * len(shifts_Hz) + 12 * len(middle_Hz) > most_modes:
            continue
        found += [model("krylov", tangent, shifts_Hz, middle_Hz) for tangent in (("rest", "frame") if pressed else ("frame",))]
    distinct: list[dict[str, Any]] = []
    for one in found:
        if one["builder"] == "hybrid":
            one = model("hybrid", middle_Hz=one["middle_shifts_Hz"])
        elif one["builder"] != "krylov":  # the others have no such keys
            one = model(one["builder"])
        elif not pressed:
            one = model("krylov", "frame", one["shifts_Hz"], one["middle_shifts_Hz"])
        if one not in distinct:
            distinct.append(one)
    return distinct


def _left_out(one: ModelError) -> str:
    """What the modes leave out, where it is more than 0.1 %."""
    error, bound = 100 * one.damping_error.max(), 100 * one.damping_bound.max()
    damping = f"; of it damping between modes {error:.2g} % (bound {bound:.2g} %)" if error > 0.1 else ""
    return damping + (f"; {one.limited_modes} growing modes limited" if one.limited_modes else "")


def describe(comparison: Comparison) -> list[tuple[str, str]]:
    """Rows of a table for a person."""
    where = f", pressed in by {1e3 * comparison.press_m:g} mm" if comparison.press_m else ""
    rows = [(f"compliance over 0 to {comparison.frequency_Hz[-1]:g} Hz{where}", "largest error at the node; between nodes")]
    for one in comparison.models:
        at_Hz = comparison.frequency_Hz[one.at_node.argmax()]
        rows.append(
            (
                f"{one.name()}, {one.modes} modes",
                f"{100 * one.at_node.max():.3g} % near {at_Hz:.3g} Hz, static {100 * one.at_node[0]:.2g} %; "
                f"{100 * one.between_nodes.max():.3g} %{_left_out(one)}",
            )
        )
    return rows
