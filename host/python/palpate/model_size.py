"""How large a local model is, from the keys of a scene: modes, nodes, springs, and bytes on the link."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations, product

from palpate.scene_checks import hybrid_modes, largest_face
from palpate.scene_sections import SceneFile

MAX_NODES = 32  # of a local model (kMaxSurfaceNodes in shared/model/local_model.hpp)
MAX_SPRINGS = 192  # kMaxSprings there
MAX_BASIS = 9216  # rows x modes: kMaxBasis there
# Builders whose basis follows the body from frame to frame, so that each state takes one of its own.
_OF_THE_FRAME = ("patch", "patch_rescaled", "condensed")
# A difference of two indices of the lattice is a spring's with at most so many entries other than 0 (body.neighbours).
_AXES = {"axis": 1, "edge": 2, "full": 3}
# Frames on the link: those of 0 modes and nodes, with their framing (docs/protocol.md; as measured, `updates/bytes`).
_STATE_BYTES, _BASIS_HEADER_BYTES = 137, 48
_PIECE_BYTES, _PIECE_FRAMING_BYTES = 1024, 50
_FRICTION_BYTES, _SPRING_KIND_BYTES = 4 * 8, 16 * 12  # as many kinds as there may be


@dataclass(frozen=True)
class ModelSize:
    """springs: of the near field; evaluated_springs: those at the touched triangle's nodes, which a step computes;
    state_bytes, basis_bytes: on the link, framing included; basis_each_state: no basis serves two states."""

    modes: int
    nodes: int
    springs: int
    evaluated_springs: int
    state_bytes: int
    basis_bytes: int
    basis_each_state: bool

    def fits_the_board(self) -> bool:
        """Within the capacities of a local model."""
        return self.nodes <= MAX_NODES and 3 * self.nodes * self.modes <= MAX_BASIS and self.springs <= MAX_SPRINGS


def _are_joined(a: Sequence[int], b: Sequence[int], axes: int) -> bool:
    steps = [abs(i - j) for i, j in zip(a, b, strict=True)]
    return max(steps) == 1 and sum(step != 0 for step in steps) <= axes


@cache
def _springs(patch: tuple[int, ...], axes: int) -> int:
    """Springs of a patch with an end on its top."""
    nodes = list(product(*(range(count) for count in patch)))
    top = patch[2] - 1
    return sum(1 for a, b in combinations(nodes, 2) if top in (a[2], b[2]) and _are_joined(a, b, axes))


@cache
def _evaluated_springs(axes: int) -> int:
    """Springs at the three nodes of a triangle in the middle of a flat top."""
    triangle = ((2, 2, 2), (3, 2, 2), (2, 3, 2))
    around = list(product(range(6), range(6), range(3)))
    joined = {frozenset((a, b)) for a in triangle for b in around if a != b and _are_joined(a, b, axes)}
    return len(joined)


def model_size(scene: SceneFile) -> ModelSize:
    """Of a patch in the middle of the body's top, at its largest: nearer to a border it may be smaller."""
    model, body = scene.model, scene.body
    patch = tuple(min(size, count) for size, count in zip(model.patch_nodes, body.nodes, strict=True))
    surface = largest_face(patch)
    nodes = surface
    springs = evaluated = 0
    if model.builder == "hybrid":
        nodes = min(math.prod(patch), max(surface, MAX_NODES))
        axes = _AXES[body.neighbours]
        springs, evaluated = min(_springs(patch, axes), MAX_SPRINGS), _evaluated_springs(axes)
        near_nodes = min(model.near_nodes, math.prod(patch) - surface)
        modes = hybrid_modes(patch, near_nodes, model.middle_shifts_Hz)
    elif model.builder == "krylov":
        modes = 3 * surface * len(model.shifts_Hz) + 12 * len(model.middle_shifts_Hz)
    else:
        modes = 3 * math.prod(patch)
    of_the_frame = model.builder in _OF_THE_FRAME or (model.builder == "krylov" and model.tangent == "frame")
    triangles = 2 * (patch[0] - 1) * (patch[1] - 1)
    basis = _BASIS_HEADER_BYTES + 12 * nodes + 28 * modes + 6 * nodes * modes + 6 * triangles + _FRICTION_BYTES
    if springs:
        basis += 3 * springs + _SPRING_KIND_BYTES
    return ModelSize(
        modes=modes,
        nodes=nodes,
        springs=springs,
        evaluated_springs=evaluated,
        # Displacements of the nodes cross only where the basis is not of the same state.
        state_bytes=_STATE_BYTES + 4 * modes + (0 if of_the_frame else 6 * nodes),
        basis_bytes=basis + math.ceil(basis / _PIECE_BYTES) * _PIECE_FRAMING_BYTES,
        basis_each_state=of_the_frame,
    )
