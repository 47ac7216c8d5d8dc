"""Time, memory and certified error of the reduction against order, on one core.

    PYTHONPATH=host/python python host/bench/reduction.py --out out/reduction [--quick]

Each case runs in a process of its own, whose peak memory is its own: meshes of the paper and larger ones, `palpate.reduce`
by projection at several tolerances, the dense method of the same module, and SLICOT's AB09AD on the same state space. Phases
are wall clock and processor time: on a shared machine the latter is the one to compare. Writes reduction.json and
reduction.png. docs/decisions/reduction.md says what was chosen and why.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ORDERS = (2, 4, 6, 10, 14, 20, 28, 40, 56)
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8)
_ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_WATCHDOG_S = 1800


@dataclass(frozen=True)
class Case:
    """A mesh of n nodes along each axis, held as the paper's, and what is done with it. method: krylov, dense (own), or
    ab09ad."""

    dimension: int
    n: int
    method: str
    tolerance: float = 1e-6
    damping_ratio: float = 1.0


def cases(quick: bool) -> list[Case]:
    """All that is measured."""
    meshes = [(2, 12), (2, 25), (3, 7)] if quick else [(2, 12), (2, 25), (3, 7), (3, 12), (3, 20)]
    chosen = [Case(2, 5, "krylov")]  # warms the file cache: its numbers are left out
    chosen += [Case(dimension, n, "krylov") for dimension, n in meshes]
    chosen += [
        Case(dimension, n, "krylov", tolerance)
        for dimension, n in meshes
        if n < 20 or dimension == 2
        for tolerance in TOLERANCES
        if tolerance != Case.tolerance
    ]
    dense = [(2, 12), (3, 5)] if quick else [(2, 10), (2, 12), (3, 5), (2, 15)]
    for dimension, n in dense:
        done = {(case.dimension, case.n, case.method) for case in chosen}
        chosen += [
            Case(dimension, n, method)
            for method in ("krylov", "dense", "ab09ad")
            if (dimension, n, method) not in done
        ]
    ringing = [(2, 25, 0.3), (2, 25, 0.1)] if quick else [(2, 25, 0.3), (2, 25, 0.1), (3, 12, 0.3)]
    chosen += [Case(dimension, n, "krylov", damping_ratio=ratio) for dimension, n, ratio in ringing]
    return chosen


@contextmanager
def _phase(phases: dict[str, dict[str, float]], name: str) -> Iterator[None]:
    wall_s, processor_s = time.perf_counter(), time.process_time()
    yield
    phases[name] = {"wall_s": time.perf_counter() - wall_s, "processor_s": time.process_time() - processor_s}


def measure(case: Case) -> dict[str, Any]:
    """One case, in this process."""
    import numpy as np
    import slycot
    from threadpoolctl import threadpool_limits

    from palpate import _core
    from palpate.reduce.balance import balance
    from palpate.reduce.projection import project
    from palpate.reduce.state_space import state_space
    from palpate.reduce.study import LARGEST_PROJECTION, reduce_system
    from palpate.reduce.system import contact_system, linear_body, middle_of_top
    from palpate.scene import load_scene

    faces = ["z-"] if case.dimension == 2 else ["z-", "x-"]
    phases: dict[str, dict[str, float]] = {}
    result: dict[str, Any] = {}
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(
            f"duration_s = 1.0\n[body]\ndimension = {case.dimension}\nnodes = {[case.n] * case.dimension}\n"
            f"fixed_faces = {json.dumps(faces)}\ndamping_ratio = {case.damping_ratio}\n"
        )
        before_MB = _peak_MB()
        with _phase(phases, "body"):
            body = linear_body(_core, load_scene(file).to_dict())
        with _phase(phases, "system"):
            system = contact_system(body, middle_of_top(body))
        result["states"] = system.states
        if case.method == "ab09ad":
            full = state_space(system)
            with _phase(phases, "reduce"):
                size = full.order, full.b.shape[1], full.c.shape[0]
                _, _, _, _, hankel = slycot.ab09ad("C", "B", "N", *size, full.a, full.b, full.c, 20)
            result["hankel_singular_values_N_m"] = hankel.tolist()
        else:
            # `reduce_system`'s parts, one by one, and then all of it
            small: Any = system
            if case.method == "krylov":
                with _phase(phases, "projection"):
                    projection = project(system, case.tolerance, LARGEST_PROJECTION)
                small = projection.small
            with _phase(phases, "balancing"):
                balanced = balance(small)
            with _phase(phases, "norms"):
                strictly_proper = state_space(small)
                strictly_proper.h_infinity()
                strictly_proper.minus(balanced.truncate(20)).h_infinity()
            dense = case.method == "dense"
            with _phase(phases, "reduce"):
                reduction = reduce_system(system, 20, dense=dense, tolerance=case.tolerance)
            result["peak_MB"] = _peak_MB()
            result["reduction"] = reduction.to_dict()
            result["hankel_singular_values_N_m"] = reduction.hankel_N_m.tolist()
            result["frontier"] = []
            for order in ORDERS:
                if order > balanced.largest_order:
                    break
                missing, _ = strictly_proper.minus(balanced.truncate(order)).h_infinity()
                of_norm, part = missing / reduction.norm_N_m, reduction.projection_error
                bound = (of_norm + part) / (1.0 - part) if part < 1.0 else None
                result["frontier"].append({"order": order, "certified": bound})
        result.setdefault("peak_MB", _peak_MB())
        result["peak_before_MB"] = before_MB
    result["phases"] = phases
    assert np.all(np.isfinite(result["hankel_singular_values_N_m"]))
    return result


def _peak_MB() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _in_a_process(case: Case) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, __file__, "--case", json.dumps(asdict(case))],
        env={**os.environ, **_ONE_CORE},
        capture_output=True,
        text=True,
        timeout=_WATCHDOG_S,
        check=True,
    )
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def against_the_reference(results: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Each mesh that AB09AD did too: largest difference of singular values over the largest value, and ratios of time."""
    compared = []
    for reference in results:
        mesh = reference["case"]["dimension"], reference["case"]["n"]
        if reference["case"]["method"] != "ab09ad":
            continue
        values = reference["hankel_singular_values_N_m"]
        row: dict[str, Any] = {"dimension": mesh[0], "n": mesh[1], "states": reference["states"]}
        reference_s = reference["phases"]["reduce"]["processor_s"]
        row["ab09ad_processor_s"] = reference_s
        for other in results:
            case = other["case"]
            if (case["dimension"], case["n"], case["tolerance"], case["damping_ratio"]) != (*mesh, 1e-6, 1.0):
                continue
            if case["method"] != "ab09ad":
                given = other["hankel_singular_values_N_m"]
                differences = [abs(a - b) for a, b in zip(values, given, strict=False)]
                processor_s = other["phases"]["reduce"]["processor_s"]
                row[case["method"]] = {
                    "hankel_difference": max(differences) / values[0],
                    "processor_s": processor_s,
                    "times_faster": reference_s / processor_s,
                }
        compared.append(row)
    return compared


def draw(results: list[dict[str, Any]], file: Path) -> None:
    """Certified error against order; time and memory against states."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(16, 5), layout="constrained")
    for result in results:
        case = result["case"]
        small = (case["dimension"], case["n"]) in ((2, 10), (3, 5))
        if case["method"] != "krylov" or case["tolerance"] != 1e-6 or small:
            continue
        points = [(p["order"], p["certified"]) for p in result["frontier"] if p["certified"] is not None]
        name = f"{case['n']}$^{case['dimension']}$, {result['states']:,} states"
        if case["damping_ratio"] != 1.0:
            name += f", damping ratio {case['damping_ratio']:g}"
        style = "o-" if case["damping_ratio"] == 1.0 else "s--"
        left.loglog(*zip(*points, strict=True), style, label=name, markersize=4)
    left.set(xlabel="order (states kept)", ylabel="certified error / H-infinity norm", title="Error against order")
    left.set_xticks(ORDERS, [str(order) for order in ORDERS], minor=False)
    left.minorticks_off()
    left.legend(fontsize=8)
    names = {"krylov": "projection, 1e-6", "dense": "dense, own", "ab09ad": "dense, SLICOT AB09AD"}
    for method, name in names.items():
        chosen = sorted(
            (
                (r["states"], _processor_s(r), r["peak_MB"])
                for r in results
                if (r["case"]["method"], r["case"]["tolerance"], r["case"]["damping_ratio"]) == (method, 1e-6, 1.0)
            )
        )
        if chosen:
            states, seconds, megabytes = zip(*chosen, strict=True)
            middle.loglog(states, seconds, "o-", label=name)
            right.loglog(states, megabytes, "o-", label=name)
    middle.plot(2396, 1172, "k*", markersize=10, label="the paper, 25$^2$: 1,172 s")
    middle.axhline(2.0, color="gray", linewidth=0.8, linestyle=":", label="to be reached for 25$^2$: 2 s")
    middle.set(xlabel="states of the full model", ylabel="processor time / s", title="Time on one core")
    right.set(xlabel="states of the full model", ylabel="peak memory of the process / MB", title="Memory")
    for axes in (left, middle, right):
        axes.grid(alpha=0.3)
    middle.legend(fontsize=8)
    right.legend(fontsize=8)
    figure.savefig(file, dpi=110)


def _processor_s(result: dict[str, Any]) -> float:
    """From the body to the reduced system."""
    return float(result["phases"]["system"]["processor_s"] + result["phases"]["reduce"]["processor_s"])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/reduction"), help="folder for reduction.json and .png")
    parser.add_argument("--quick", action="store_true", help="without the meshes of 12 x 12 x 12 nodes and more")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.case:
        json.dump(measure(Case(**json.loads(options.case))), sys.stdout)
        return 0
    options.out.mkdir(parents=True, exist_ok=True)
    results = []
    for case in cases(options.quick):
        result = {"case": asdict(case), **_in_a_process(case)}
        phases = {name: f"{value['processor_s']:.2f}" for name, value in result["phases"].items()}
        error = result.get("reduction", {}).get("error", {}).get("certified")
        print(case, f"{result['states']} states, {result['peak_MB']:.0f} MB, certified {error}, processor s:", phases)
        results.append(result)
    report = {"cases": results[1:], "against_ab09ad": against_the_reference(results[1:])}
    (options.out / "reduction.json").write_text(json.dumps(report, indent=1) + "\n")
    draw(results[1:], options.out / "reduction.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
