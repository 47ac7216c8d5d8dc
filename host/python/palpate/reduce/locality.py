"""Is a body's response at the contact local? The paper's condition for its local model (section 6), for one's own body.

The paper looks at where the states of the balanced reduction lie (Figure 5). That share is reported, but it hardly tells a
body that the patch renders well from one that it does not (docs/reduction.md). The verdict rests on what the hand feels: the
force of the patch alone, everything else held, against the full body's, at the frequencies that a local model has to
render by itself: from the rate of the global updates to half the servo rate. Below, the full body corrects it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from palpate.reduce.response import box, full_response, local_states, reduced_response
from palpate.reduce.state_space import state_space
from palpate.reduce.study import Progress, Reduction, finite, reduce_system
from palpate.reduce.system import ContactSystem

Array = NDArray[np.float64]

# A patch counts as good with at most this relative error in the band. Set after the first measurements, between the paper's
# own case, the 4x4x2 patch of a homogeneous body (0.12 at 30 Hz), and the soft core (0.20); below what people notice (the
# just noticeable difference of stiffness is 0.23: Jones and Hunter 1990, Experimental Brain Research 79).
GOOD_ERROR = 0.15
HIGHEST_HZ = 500.0
LOWEST_SHOWN_HZ = 0.3
# (nodes along the surface, depth) in ascending order of cost.
_SIZES = ((4, 2), (5, 2), (4, 3), (4, 4), (6, 3), (8, 4))
_FREQUENCIES = 16
# Of builder "krylov" by default: modes for each surface node of a patch of 4 x 4 x 2, at one frequency.
_KRYLOV_MODES_PER_NODE, _KRYLOV_SURFACE_NODES = 3, 16
KRYLOV_MODES = _KRYLOV_MODES_PER_NODE * _KRYLOV_SURFACE_NODES


@dataclass(frozen=True)
class PatchError:
    """A patch and its relative error per frequency, over the full body's response. modes: of its local model on the board,
    the contact node among its nodes; fits: the board holds as many."""

    along: int
    depth: int
    modes: int
    states: int
    fits: bool
    error: Array
    error_in_band: float

    def name(self, planar: bool) -> str:
        """As in 4x4x2, or 4x2 in two dimensions."""
        return f"{self.along}x{self.depth}" if planar else f"{self.along}x{self.along}x{self.depth}"


@dataclass(frozen=True)
class Locality:
    """frequency_Hz (w,); response_N_m (w,): 2-norm of the full body's; reduced_error (w,): of its balanced reduction, relative;
    patches: smallest first; node_share (n,): of the reduced states that matter, each weighted by its Hankel singular value, how
    much lies on each node (sum 1); state_share: inside the first patch."""

    reduction: Reduction
    update_rate_Hz: float
    frequency_Hz: Array
    response_N_m: Array
    reduced_error: Array
    patches: list[PatchError]
    node_share: Array
    state_share: float

    @property
    def planar(self) -> bool:
        """In two dimensions."""
        return len(self.reduction.system.contact_axes) == 2

    @property
    def local(self) -> bool:
        """The paper's patch, 4x4x2 or 4x2, is good."""
        return self.patches[0].error_in_band <= GOOD_ERROR

    @property
    def recommended(self) -> PatchError | None:
        """The smallest good patch that fits on the board."""
        return next((patch for patch in self.patches if patch.fits and patch.error_in_band <= GOOD_ERROR), None)

    def verdict(self) -> str:
        """For a person, in a few sentences."""
        first, best, order = self.patches[0], self.recommended, self.reduction.order
        rate = f"{self.update_rate_Hz:g} Hz"
        measured = (
            f"Held alone, the {first.name(self.planar)} patch around the contact misses {100 * first.error_in_band:.0f} % "
            f"of the body's force above {rate}"
        )
        if best is first:
            return (
                f"Local. {measured}, within the {100 * GOOD_ERROR:.0f} % that count as good: builder \"patch\", "
                f"patch_nodes for {first.name(self.planar)}, {first.modes} modes."
            )
        if best is not None:
            return (
                f"Not local to the smallest patch. {measured}; good is {100 * GOOD_ERROR:.0f} %. A larger one does: builder "
                f"\"patch\", patch_nodes for {best.name(self.planar)}, {best.modes} modes "
                f"({100 * best.error_in_band:.0f} %)."
            )
        larger = next((patch for patch in self.patches if patch.error_in_band <= GOOD_ERROR), None)
        unfit = (
            f"the first good one, {larger.name(self.planar)}, has {larger.modes} modes, more than the board holds"
            if larger
            else "no patch tried is good"
        )
        return (
            f"Not local. {measured}; good is {100 * GOOD_ERROR:.0f} %, and {unfit}. Try builder "
            f"\"krylov\", {KRYLOV_MODES} modes of the whole body; its compliance is compared here, its force in a run. A balanced "
            f"reduction, which is no builder, has {order} states with an error of {self._certified()}."
        )

    def _certified(self) -> str:
        error = self.reduction.certified_error
        return f"at most {100 * error:.2g} %" if np.isfinite(error) else "no known bound"

    def to_dict(self) -> dict[str, Any]:
        """What `--json` prints."""
        best = self.recommended
        return {
            "local": self.local,
            "verdict": self.verdict(),
            "good_error": GOOD_ERROR,
            "band_Hz": [self.update_rate_Hz, HIGHEST_HZ],
            "state_share_in_first_patch": self.state_share,
            "recommended": {
                "builder": "patch" if best else "krylov",
                "patch_nodes": self._patch_nodes(best) if best else None,
                "modes": best.modes if best else KRYLOV_MODES,
            },
            "balanced": {
                "order": self.reduction.order,
                "certified_error": finite(self.reduction.certified_error),
            },
            "patches": [
                {
                    "nodes": self._patch_nodes(patch),
                    "modes": patch.modes,
                    "fits": patch.fits,
                    "error_in_band": patch.error_in_band,
                    "error": patch.error.tolist(),
                }
                for patch in self.patches
            ],
            "frequency_Hz": self.frequency_Hz.tolist(),
            "response_N_m": self.response_N_m.tolist(),
            "reduced_error": self.reduced_error.tolist(),
            "states": self.reduction.system.states,
        }

    def _patch_nodes(self, patch: PatchError) -> list[int]:
        return [patch.along, patch.depth] if self.planar else [patch.along, patch.along, patch.depth]


def check_locality(
    system: ContactSystem, update_rate_Hz: float, board_modes: int, progress: Progress = lambda done, total: None
) -> Locality:
    """update_rate_Hz: of the global updates; board_modes: the most that a local model may have. The full body's response
    is that of a projection with a certified error of 1e-6 of the largest."""
    return locality_of(reduce_system(system, progress=progress), update_rate_Hz, board_modes)


def locality_of(reduction: Reduction, update_rate_Hz: float, board_modes: int) -> Locality:
    """The same, of a body that has been reduced."""
    system = reduction.system
    band = np.geomspace(update_rate_Hz, HIGHEST_HZ, _FREQUENCIES)
    below = np.geomspace(LOWEST_SHOWN_HZ, update_rate_Hz, _FREQUENCIES, endpoint=False)
    frequency_Hz = np.concatenate([below, band])
    frequency_rad_s = 2.0 * np.pi * frequency_Hz
    with threadpool_limits(1):
        full = reduced_response(system, state_space(reduction.projected), frequency_rad_s)
        size = np.linalg.norm(full, 2, axis=(1, 2))
        reduced = reduced_response(system, reduction.reduced, frequency_rad_s)
        reduced_error = np.linalg.norm(reduced - full, 2, axis=(1, 2)) / size
        axes = len(system.contact_axes)
        patches: list[PatchError] = []
        for along, depth in _sizes(system):
            nodes = box(system, along, depth)
            local = full_response(system, frequency_rad_s, nodes)
            error = np.linalg.norm(local - full, 2, axis=(1, 2)) / size
            states = local_states(system, nodes)
            modes = states // 2 + axes
            in_band = float(error[frequency_Hz >= update_rate_Hz].max())
            patches.append(PatchError(along, depth, modes, states, modes <= board_modes, error, in_band))
            if in_band <= 0.2 * GOOD_ERROR:
                break
    share = node_share(reduction)
    first = box(system, patches[0].along, patches[0].depth)
    return Locality(
        reduction,
        update_rate_Hz,
        frequency_Hz,
        size,
        reduced_error,
        patches,
        share,
        float(share[first].sum()),
    )


def _sizes(system: ContactSystem) -> list[tuple[int, int]]:
    """Patches to try; those that stick out of the lattice are cut to it."""
    nx, ny, nz = system.body.shape
    widest = nx if ny == 1 else min(nx, ny)
    return list(dict.fromkeys((min(along, widest), min(depth, nz)) for along, depth in _SIZES))


def node_share(reduction: Reduction) -> Array:
    """(n,): the part of each reduced state's squared displacements on each node, weighted by its Hankel singular value;
    sum 1."""
    system = reduction.system
    squared = reduction.shapes() ** 2
    weighted = (squared / squared.sum(axis=0)) @ reduction.hankel_N_m[: reduction.order]
    share = np.zeros(len(system.body.fixed))
    np.add.at(share, system.node, weighted)
    return np.asarray(share / share.sum())
