"""What is run: experiments, ways to build the local model, and sweeps of one setting at a time."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from palpate.reproduce.figure import Run

Overrides = Mapping[str, Any]

SCENE_FOLDER, SCENE = "frontier", "reference"
TICKS_PER_FRAME = 33  # of the scene's 30 Hz
CONTACT_NODE = (6, 6, 11)  # the nearest to where the pokes are


@dataclass(frozen=True)
class Bounds:
    """The numbers to reach with the default builder; None: none is set."""

    compliance_percent: float | None = None
    error_percent: float | None = None
    jump_N: float | None = None
    same_mode_percent: float | None = None


@dataclass(frozen=True)
class Experiment:
    """A motion of the tip on a body. overrides: of the scene; bounds: for the default builder."""

    name: str
    title: str
    overrides: Overrides
    bounds: Bounds


@dataclass(frozen=True)
class Builder:
    """A way to build the local model. family: its name in the pictures' legend; board: where it runs, None where all do."""

    name: str
    title: str
    family: str
    overrides: Overrides
    board: str | None = None


@dataclass(frozen=True)
class Point:
    """One run: an experiment, a builder, and what a sweep sets otherwise. sweep: None for the plain table."""

    experiment: Experiment
    builder: Builder
    sweep: str | None = None
    value: str = ""
    overrides: Overrides = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Also that of its folder."""
        setting = f"--{self.sweep}={self.value}" if self.sweep else ""
        return f"{self.experiment.name}--{self.builder.name}{setting}".replace(" ", "")

    @property
    def run(self) -> Run:
        """The run of the firmware."""
        overrides = {**self.experiment.overrides, **self.builder.overrides, **self.overrides}
        return Run(self.name, SCENE, overrides, folder=SCENE_FOLDER, may_fault=True)


def _path(name: str, duration_s: float) -> dict[str, Any]:
    return {"path.csv": f"{name}.csv", "duration_s": duration_s}


_STICK = _path("poke_5mm", 1.5)
_SLIDE_BOUNDS = Bounds(error_percent=1.0, jump_N=0.03, same_mode_percent=98.0)


def _slide(speed: str, duration_s: float, friction: float) -> Experiment:
    return Experiment(
        f"slide_{speed}_mu{friction:g}",
        f"slide 3 cm at {speed.replace('cm_s', ' cm/s')}, mu = {friction:g}",
        {**_path(f"drag_{speed}", duration_s), "contact.friction": friction},
        _SLIDE_BOUNDS,
    )


EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        Experiment("stick_5mm", "poke 5 mm, pull 5 mm, sticking", _STICK, Bounds(1.0, error_percent=0.3, jump_N=0.01)),
        Experiment("stick_8mm", "poke 8 mm, pull 5 mm, sticking", _path("poke_8mm", 1.5), Bounds(error_percent=1.0)),
        Experiment(
            "alone_1s",
            "poke 5 mm, pull 5 mm, no update within 1 s",
            {**_path("poke_5mm_alone", 2.0), "rates.model_update_Hz": 1.0},
            Bounds(error_percent=2.0),
        ),
        *(_slide("3cm_s", 2.35, friction) for friction in (0.0, 0.3, 1.0)),
        *(_slide("10cm_s", 1.65, friction) for friction in (0.0, 0.3, 1.0)),
        # With the pull the device's 8.5 N allow no more than 0.15 mm.
        Experiment(
            "stiff_1e4",
            "k = 1e4 N/m: poke 0.1 mm, pull 0.1 mm, sticking",
            {**_path("poke_0.1mm", 1.5), "body.stiffness_N_m": 1e4, "integrator.step_s": 2e-5},
            Bounds(error_percent=0.3, jump_N=0.01),
        ),
    )
}

# 96 modes of a patch take 76 ms (docs/benchmarks.md).
_96_MODES = {"model.basis_latency_ticks": 90}
_KRYLOV_REST = {"model.builder": "krylov", "model.tangent": "rest"}
_KRYLOV_FRAME = {"model.builder": "krylov", "model.tangent": "frame"}

# One more builder is one more line. `hold` sends no model, `patch_stale` one that is not rolled forward.
BUILDERS: dict[str, Builder] = {
    builder.name: builder
    for builder in (
        Builder("hold", "hold the last force", "hold", {"model.feedback": "hold"}),
        Builder("patch_stale", "patch, not rolled forward", "patch", {"model.feedback": "discard"}),
        Builder("patch", "patch, rolled forward", "patch", {}),
        Builder("patch_rescaled", "patch, outer springs rescaled", "patch, corrected", {"model.builder": "patch_rescaled"}),
        Builder("condensed", "patch, rest of the body condensed", "patch, corrected", {"model.builder": "condensed"}),
        Builder("krylov_rest", "krylov at rest, 0 Hz", "krylov, rest", {**_KRYLOV_REST}),
        Builder(
            "krylov_rest_2",
            "krylov at rest, 0 and 20 Hz",
            "krylov, rest",
            {**_KRYLOV_REST, **_96_MODES, "model.shifts_Hz": [0.0, 20.0]},
        ),
        Builder("hybrid", "hybrid: krylov at rest, exact near field", "hybrid", {"model.builder": "hybrid"}),
        Builder(
            "hybrid_m7",
            "hybrid with 96 modes, on a Cortex-M7",
            "hybrid",
            {"model.builder": "hybrid", "model.near_nodes": 12, **_96_MODES},
            board="mps2_an500",
        ),
        Builder("krylov_frame", "krylov of the frame, 0 Hz", "krylov, frame", {**_KRYLOV_FRAME}),
        Builder(
            "krylov_frame_2",
            "krylov of the frame, 0 and 20 Hz",
            "krylov, frame",
            {**_KRYLOV_FRAME, **_96_MODES, "model.shifts_Hz": [0.0, 20.0]},
        ),
    )
}
# The builder that the numbers to reach are for, that sweeps vary, and that pictures mark; not the default of a scene.
DEFAULT = "hybrid"
# The same on a larger part, with as many modes as it has time for: reaches numbers that the default does not.
LARGER_PART = "hybrid_m7"

# Values by sweep: what the scene is given for each.
SWEEPS: dict[str, dict[str, Overrides]] = {
    "delay_frames": {
        str(frames): {
            "rates.host_delay_ticks": frames * TICKS_PER_FRAME,
            # No more than three: when a newer model took the place of one that was still catching up, none was taken with more
            # (docs/frontier.md). Now the newest waits on the board, and takes the place of one that waits.
            "rates.models_under_way": min(frames + 1, 3),
        }
        for frames in (0, 1, 2, 4, 10)
    },
    "shifts_Hz": {
        "0": {"model.shifts_Hz": [0.0]},
        "20": {"model.shifts_Hz": [20.0]},
        "0,20": {"model.shifts_Hz": [0.0, 20.0], **_96_MODES},
        "0,150": {"model.shifts_Hz": [0.0, 150.0], **_96_MODES},
        "0,20,150": {"model.shifts_Hz": [0.0, 20.0, 150.0], "model.basis_latency_ticks": 130},
    },
    "near_nodes": {
        str(nodes): {"model.near_nodes": nodes, **(_96_MODES if nodes > 4 else {})} for nodes in (0, 4, 8, 12)
    },
    "patch_nodes": {
        "3x3x2": {"model.patch_nodes": [3, 3, 2]},
        "4x4x2": {"model.patch_nodes": [4, 4, 2]},
        # With more nodes below it, it had more modes than a board can take.
        "5x5x2": {"model.patch_nodes": [5, 5, 2], "model.near_nodes": 3, **_96_MODES},
    },
    "update_Hz": {f"{rate:g}": {"rates.model_update_Hz": rate} for rate in (10.0, 20.0, 30.0, 60.0, 120.0, 240.0)},
    "body_step_s": {f"{step_s:g}": {"integrator.step_s": step_s} for step_s in (5e-5, 1e-4, 2e-4, 2.5e-4)},
}
# Sweeps are of these experiments, with the default or with these builders.
_SWEPT = ("stick_5mm", "slide_10cm_s_mu0.3")
_SWEPT_BUILDERS = {"delay_frames": ("hold", "patch", DEFAULT), "shifts_Hz": ("krylov_frame",)}
QUICK = ("stick_5mm", "slide_10cm_s_mu0.3")
_QUICK_BUILDERS = ("hold", "patch", DEFAULT)


def table_points(experiments: Iterable[str], builders: Iterable[str]) -> list[Point]:
    """Every builder in every experiment."""
    names = list(builders)
    return [Point(EXPERIMENTS[experiment], BUILDERS[builder]) for experiment in experiments for builder in names]


def sweep_points(sweep: str, experiments: Iterable[str], builders: Iterable[str]) -> list[Point]:
    """Every value of the sweep for every builder in every experiment."""
    names = list(builders)
    return [
        Point(EXPERIMENTS[experiment], BUILDERS[builder], sweep, value, overrides)
        for experiment in experiments
        for builder in names
        for value, overrides in SWEEPS[sweep].items()
    ]


def all_points(quick: bool) -> list[Point]:
    """What `palpate bench frontier` runs; quick: two experiments, the builders that differ most, no sweeps."""
    if quick:
        return table_points(QUICK, _QUICK_BUILDERS)
    points = table_points(EXPERIMENTS, BUILDERS)
    for sweep in SWEEPS:
        points += sweep_points(sweep, _SWEPT, _SWEPT_BUILDERS.get(sweep, (DEFAULT,)))
    return points
