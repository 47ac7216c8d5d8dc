"""The C++ core (host/python/bindings). Scene dictionaries are those of `palpate.scene.Scene.to_dict`.

ValueError: the scene is not usable; the message names the key, the value and the allowed range. RuntimeError: the
computation or the board failed. `progress(done, total)` is called in the calling thread, many times a second; False
from it, or an exception, ends the computation (False as RuntimeError). The GIL is released in between.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Progress = Callable[[int, int], bool]

# Of the message definitions that the extension was built with (docs/protocol.md, "Schema hash").
SCHEMA_HASH: int
# The most modes that a local model on the board may have.
MAX_MODES: int
# Of one with as many nodes as it may have.
MAX_HYBRID_MODES: int
# What the board's renderer takes on this machine: models in their slots, tip history. On the board pointers are shorter.
RENDERER_BYTES: int

def run_closed_loop(
    scene: dict[str, Any], actuator_fd: int, sensor_fd: int, progress: Progress, cache_folder: str
) -> dict[str, Any]:
    """Runs plant, hand, link and session against a board that reads SensorFrames from sensor_fd and writes
    ActuatorFrames to actuator_fd, and shuts the board down. Returns the datasets of `record_layout.RUN` by path, those
    of reference/ and probe/reference_m excepted, and the counters of `record_layout.RUN_COUNTERS`.
    cache_folder: for the modes of patches, unless the scene wants no files. By "basis_problem": the latest file there
    that was refused or could not be written, and why; empty where there was none."""

def simulate(scene: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """The full body alone, its tip on the scene's path if there is one. Returns the datasets of
    `record_layout.SIMULATE` by path."""

def reference(
    scene: dict[str, Any], time_s: NDArray[np.float64], tip_m: NDArray[np.float64], progress: Progress
) -> dict[str, Any]:
    """The full non-linear body with contact, stepped at the scene's reference.step_s while the tip goes through tip_m
    (n, 3) at time_s (n,). Returns the datasets reference/* and
    probe/reference_m by path."""

def model_cost(scene: dict[str, Any], rounds: int) -> dict[str, float]:
    """Time of this machine that the scene's builder takes for a model of the states in which the scripted tip touches the
    body, 30 a second. {kernel_s, model_s, first_s}: medians over `rounds` times all states of a fixed piece of work
    (a product of two 128 x 128 matrices of doubles) and of a model, taking turns; and the time of the first model, with
    what is computed once."""

def linear_body(scene: dict[str, Any]) -> dict[str, Any]:
    """The linear system of the scene's body at rest and without load: mass x'' + damping x' + stiffness x = f.

    x and f are displacements and forces at the d free degrees of freedom in the device frame: node by node, along x, y
    and z, or x and z in two dimensions. Of the scene only [body] counts; weight, initial displacements and drives are
    left out. n nodes, node = i + nodes[0] (j + nodes[1] k), and s springs.

    mass_kg (d,), node (d,) and axis (d,; 0 x, 1 y, 2 z): of each degree of freedom.
    stiffness, damping: symmetric (d, d) matrices K = -df/dX in N/m and B = -df/dV in N s/m, each as the three arrays of
      `scipy.sparse.csc_array`: {data, indices, indptr}, rows ascending, no explicit zeros. Entries below 1e-13 of
      sqrt(K_ii K_jj) are rounding and left out.
    nodes (3,): of the lattice along x, y, z; spacing_m: between neighbours along an axis.
    rest_position_m (n, 3), node_mass_kg (n,), fixed (n,; bool): of each node.
    triangles (t, 3): nodes of the outer surface, counter-clockwise seen from outside; none in two dimensions.
    springs (s, 2): the nodes at their ends; spring_stiffness_N_m and spring_damping_N_s_m (s,)."""

def compliance_errors(
    scene: dict[str, Any], node: int, models: list[dict[str, Any]], press_m: float, progress: Progress
) -> dict[str, Any]:
    """Local models against the full linear body at a node of its surface: relative errors of the 3x3 compliance (displacement
    under unit forces there), in 2-norms. Of the scene only [body], the step of [integrator] and model.valid_ticks count. The node is first
    pressed in by press_m along the surface's normal and held until the body has settled; body and models are linearized there.

    models: tables of the keys builder, tangent, patch_nodes, shifts_Hz, middle_shifts_Hz and near_nodes of [model].
    frequency_Hz (f,): 0, then 40 a decade from 0.1 to 500 Hz; compliance_m_N (f,): 2-norm of the full body's, to 1e-6.
    models: of each: modes, basis (entries of the board's), damping_coupling, limited_modes, damping_error and damping_bound (f,):
      what damping between modes, left out, costs at the node, relative to the model (infinite: no bound), at_node (f,), and between_nodes (f,): in the middle
      of a triangle at the node, the model built for a contact there."""
