"""Bodies in Python: a mass-spring-damper lattice that is stepped, pushed, driven and touched."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.scene import Scene, SceneError, load_scene, make_scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def vector3(name: str, value: ArrayLike) -> Floats:
    """Three finite numbers; raises ValueError that names them."""
    vector = np.ascontiguousarray(value, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name} = {value!r}: must be three finite numbers [x, y, z]")
    return vector


def rows3(name: str, value: ArrayLike) -> Floats:
    """An (n, 3) array; raises ValueError that names it."""
    rows = np.ascontiguousarray(value, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{name}: has the shape {rows.shape}: must be (n, 3)")
    return rows


@dataclass(frozen=True)
class State:
    """Where the n nodes are and how they move, in the device frame.

    position_m (n, 3), velocity_m_s (n, 3).
    """

    position_m: Floats
    velocity_m_s: Floats


@dataclass(frozen=True)
class Touch:
    """What the tip did to the body in one servo tick of 1 ms, in the device frame.

    force_N (3,): of the tip on the body, averaged over the tick; the hand feels the opposite. mode: at its end: "free",
    "stick" or "slip". normal (3,): outward unit normal of the force; zeros without contact. triangle: that is touched, -1
    when free.
    """

    force_N: Floats
    mode: str
    normal: Floats
    triangle: int


@dataclass(frozen=True)
class Drive:
    """A node that is moved along a given path, whatever the forces. Times in s from when the drive is set: from start_s on
    it goes with least jerk to its place of rest + displacement_m (device frame), is there at reach_s and is let go at
    release_s."""

    node: int
    displacement_m: Sequence[float]
    start_s: float
    reach_s: float
    release_s: float


class Body:
    """A body that moves. All positions, velocities and forces are in the device frame, in m, m/s and N.

    `Body(nodes=(8, 8, 8), fixed_faces=["z-"])` takes the keys of a scene's section [body] (docs/scenes.md);
    `Body.from_scene(file)` a scene file, of which [body], [integrator], [contact], [tool] and [coupling] count. Errors are
    `SceneError` (a ValueError) with the key, its value and the allowed range. One thread.
    """

    def __init__(self, scene: Scene | None = None, **body: Any) -> None:
        if scene is not None and body:
            raise SceneError(f"Body: {', '.join(body)}: not together with a scene: set them there")
        self.scene = make_scene({"body": body}, name="Body") if scene is None else scene
        self.core = _core.Body(self.scene.to_dict())

    @classmethod
    def from_scene(cls, file: str | Path, overrides: Mapping[str, Any] | None = None) -> Self:
        """The body of a scene file; overrides as after --set: {"body.stiffness_N_m": 200.0}."""
        return cls(load_scene(Path(file), overrides))

    @property
    def node_count(self) -> int:
        """n, the number of nodes."""
        return self.core.node_count

    @property
    def rest_m(self) -> Floats:
        """(n, 3): places of the nodes at rest."""
        return self.core.rest_m

    @property
    def mass_kg(self) -> Floats:
        """(n,): of each node."""
        return self.core.mass_kg

    @property
    def fixed_nodes(self) -> Ints:
        """Numbers of the nodes that do not move, ascending."""
        return self.core.fixed_nodes

    @property
    def triangles(self) -> Ints:
        """(t, 3): nodes of the outer surface, counter-clockwise seen from outside; none of a sheet."""
        return self.core.triangles

    @property
    def springs(self) -> Ints:
        """(s, 2): the nodes at the springs' ends."""
        return self.core.springs

    @property
    def spring_stiffness_N_m(self) -> Floats:
        """(s,): of each spring."""
        return self.core.spring_stiffness_N_m

    @property
    def spring_damping_N_s_m(self) -> Floats:
        """(s,): of each spring, along it."""
        return self.core.spring_damping_N_s_m

    @property
    def step_s(self) -> float:
        """One step, from the scene's integrator.step_s."""
        return self.core.step_s

    @property
    def time_s(self) -> float:
        """How long it has been stepped."""
        return self.core.time_s

    def node(self, i: int, j: int, k: int) -> int:
        """The number of the node with these indices along x, y and z. Raises ValueError outside of the lattice."""
        return self.core.node(i, j, k)

    @property
    def state(self) -> State:
        """A copy of the present state. Setting it ends any contact; not while nodes are driven (ValueError)."""
        return State(self.core.position_m, self.core.velocity_m_s)

    @state.setter
    def state(self, state: State) -> None:
        self.core.set_state(rows3("position_m", state.position_m), rows3("velocity_m_s", state.velocity_m_s))

    def forces_N(self) -> Floats:
        """(n, 3): of springs, dampers and weight on every node in the present state; on fixed nodes what their support
        holds."""
        return self.core.forces_N()

    def stable_step_s(self) -> float:
        """The longest step that the semi-implicit integrator may take about the present positions."""
        return self.core.stable_step_s()

    def step(self, duration_s: float | None = None, forces_N: Mapping[int, ArrayLike] | None = None) -> State:
        """Lets time pass without a tip: one step, or as many as are nearest to duration_s, under constant forces {node:
        [x, y, z]}. Returns the new state. Raises ValueError for forces while nodes are driven, an unstable step (naming
        the bound), a node that does not exist, or a duration that is not in [0, 1e6 step_s]."""
        steps = 1
        if duration_s is not None:
            if not 0.0 <= duration_s <= 1e6 * self.step_s:
                raise ValueError(f"duration_s = {duration_s:g}: must be in [0, {1e6 * self.step_s:g}] s")
            steps = round(duration_s / self.step_s)
        given = forces_N or {}
        rows = np.array([vector3(f"forces_N[{node}]", force) for node, force in given.items()]).reshape(-1, 3)
        self.core.step(steps, list(given), rows)
        return self.state

    def set_drives(self, drives: Sequence[Drive]) -> None:
        """Has nodes moved from now on, in place of all drives before. Raises ValueError for fixed or unknown nodes, times out
        of order, and two drives of one node at a time."""
        self.core.set_drives(
            [drive.node for drive in drives],
            [drive.start_s for drive in drives],
            [drive.reach_s for drive in drives],
            [drive.release_s for drive in drives],
            np.array([vector3("displacement_m", drive.displacement_m) for drive in drives]).reshape(-1, 3),
        )

    def touch(self, tip_m: ArrayLike) -> Touch:
        """One servo tick (1 ms) in which the tip goes straight from where it was to tip_m; the first call finds it there. The
        same contact code as the board's, against the full body. Raises ValueError for a sheet."""
        return Touch(**self.core.touch(vector3("tip_m", tip_m)))
