"""Local models in Python: what a builder makes of a body's state around a place of its surface."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.body import Body, Floats, Ints, State, vector3

Builder = Literal["patch", "patch_rescaled", "condensed", "krylov", "hybrid"]
Complex = NDArray[np.complex128]


class LocalModel:
    """A local model as a session would send it: independent second-order modes around a place of the surface.

    With modal positions q (m of them) and forces f on its nodes, the nodes move by Phi q, and q'' + d q' + lambda q = Phi' f
    (docs/architecture.md, "Local model"). `build_model` makes them.
    """

    def __init__(self, core: _core.LocalModel) -> None:
        self._core = core

    @property
    def modes(self) -> int:
        """m."""
        return self._core.modes

    @property
    def nodes(self) -> Ints:
        """The body's numbers of the nodes, those on the surface first."""
        return self._core.nodes

    @property
    def surface_nodes(self) -> int:
        """How many of them are on the surface."""
        return self._core.surface_nodes

    @property
    def springs(self) -> int:
        """Springs of the near field that the board computes exactly; 0 of any builder but hybrid."""
        return self._core.springs

    @property
    def at_m(self) -> Floats:
        """(3,): the place of the surface that it was built around, device frame."""
        return self._core.at_m

    @property
    def lambda_rad2_s2(self) -> Floats:
        """(m,): square of each mode's angular frequency; negative where a compressed body gives way."""
        return self._core.lambda_rad2_s2

    @property
    def damping_rad_s(self) -> Floats:
        """(m,): d of each mode."""
        return self._core.damping_rad_s

    @property
    def frequencies_Hz(self) -> Floats:
        """(m,): undamped frequencies, ascending; 0 for a mode with negative lambda."""
        return np.sort(np.sqrt(np.maximum(self.lambda_rad2_s2, 0.0)) / (2.0 * np.pi))

    @property
    def damping_coupling(self) -> float:
        """What the diagonal damping leaves out, relative (docs/decisions/modal_form.md)."""
        return self._core.damping_coupling

    @property
    def limited_modes(self) -> int:
        """Modes that would grow faster than they may and were stiffened."""
        return self._core.limited_modes

    @property
    def packed_basis(self) -> bytes:
        """The basis as it crosses the link in pieces (docs/protocol.md, "Models")."""
        return self._core.packed_basis

    @property
    def packed_state(self) -> bytes:
        """The state as it crosses the link: a ModelState's payload."""
        return self._core.packed_state

    def compliance_m_N(self, frequency_Hz: ArrayLike) -> Complex:
        """(f, 3, 3): displacement of the place under unit forces on it, device frame, m/N, at each of f frequencies."""
        return self._core.compliance_m_N(_frequencies(frequency_Hz))

    def body_compliance_m_N(self, frequency_Hz: ArrayLike) -> Complex:
        """(f, 3, 3): that of the full body, linearized at the same state, to 1e-6."""
        return self._core.body_compliance_m_N(_frequencies(frequency_Hz))

    def compliance_error(self, frequency_Hz: ArrayLike) -> Floats:
        """(f,): error of the compliance against the full linear body's, relative, in 2-norms. Of a hybrid model the modes
        alone are judged: its springs are exact on the board."""
        exact = self.body_compliance_m_N(frequency_Hz)
        wrong = self.compliance_m_N(frequency_Hz) - exact
        error: Floats = np.linalg.norm(wrong, 2, (1, 2)) / np.linalg.norm(exact, 2, (1, 2))
        return error

    def damping_bound(self, frequency_Hz: ArrayLike) -> Floats:
        """(f,): bound of what the damping that is left out costs at the place, relative to the model; inf: no bound."""
        return self._core.damping_bound(_frequencies(frequency_Hz))

    def __repr__(self) -> str:
        return f"LocalModel({self.modes} modes, {len(self.nodes)} nodes, at {np.round(self.at_m, 4).tolist()} m)"


def _frequencies(frequency_Hz: ArrayLike) -> Floats:
    given = np.atleast_1d(np.asarray(frequency_Hz, dtype=np.float64))
    if given.ndim != 1 or not (np.isfinite(given) & (given >= 0.0)).all():
        raise ValueError("frequency_Hz: must be numbers in [0, inf) Hz, one or a row of them")
    return np.ascontiguousarray(given)


def build_model(
    body: Body,
    state: State | None = None,
    *,
    at: ArrayLike,
    builder: Builder = "patch",
    **model: Any,
) -> LocalModel:
    """Linearizes the body about a state (its present one by default) and reduces it around the place of its surface that is
    closest to `at` (3,; device frame, m).

    builder: docs/scenes.md, [model]; further keys of that section by name: patch_nodes, tangent, shifts_Hz,
    middle_shifts_Hz, near_nodes, valid_ticks. Raises SceneError for keys and values out of range, ValueError for a sheet and
    for a place where all nodes are fixed.
    """
    scene = body.scene.with_model(builder=builder, **model)
    used = body.state if state is None else state
    core = _core.build_model(
        body.core,
        scene.to_dict(),
        np.ascontiguousarray(used.position_m),
        np.ascontiguousarray(used.velocity_m_s),
        vector3("at", at),
    )
    return LocalModel(core)
