"""The host's side of a session in Python: takes the tip's path, advances the full body, makes local models."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from numpy.typing import ArrayLike

from palpate import _core
from palpate.body import Floats, Ints, State, rows3
from palpate.paths import cache_folder
from palpate.scene import Scene, load_scene

_MODES = ("free", "stick", "slip")


@dataclass(frozen=True)
class Update:
    """A local model that the session made.

    tick: that it holds for. sequence: counts models from 1. modes. patch_nodes: the body's numbers of its nodes, those on the
    surface first. basis_bytes: of its basis. interpolated_ticks: ticks whose tip was never heard of and was interpolated.
    damping_coupling, limited_modes: as of `LocalModel`.
    """

    tick: int
    sequence: int
    modes: int
    patch_nodes: Ints
    basis_bytes: int
    interpolated_ticks: int
    damping_coupling: float
    limited_modes: int


class Session:
    """Replays a measured tip path on the full non-linear body and makes a local model whenever one is due. Of a scene [body],
    [integrator], [contact], [tool], [coupling], [model] and rates.model_update_Hz count. One thread."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._core = _core.Session(scene.to_dict(), str(cache_folder() / "bases"))

    @classmethod
    def from_scene(cls, file: str | Path, overrides: Mapping[str, Any] | None = None) -> Self:
        """Of a scene file; overrides as after --set."""
        return cls(load_scene(Path(file), overrides))

    def take(self, first_tick: int, tip_m: ArrayLike) -> None:
        """What the board says of its ticks, in any order: tip_m (n, 3) at the ends of first_tick, first_tick + 1, ..., device
        frame. The body begins at the first tick that is ever told."""
        self._core.take(first_tick, rows3("tip_m", tip_m))

    def due(self, tick: int) -> bool:
        """Is a model due in this tick?"""
        return self._core.due(tick)

    def update(self) -> Update | None:
        """Advances the body through the ticks that are known and makes a model; None: nothing new, or the tip is more than
        2 cm from the surface."""
        made = self._core.update()
        return None if made is None else Update(**made)

    @property
    def tick(self) -> int:
        """That the body has come to."""
        return self._core.tick

    @property
    def contact_mode(self) -> str:
        """At that tick: "free", "stick" or "slip"."""
        return _MODES[self._core.contact_mode]

    @property
    def force_N(self) -> Floats:
        """(3,): of the tip on the body in the last step, device frame."""
        return self._core.force_N

    @property
    def state(self) -> State:
        """A copy of the body's state at that tick."""
        return State(self._core.position_m, self._core.velocity_m_s)
