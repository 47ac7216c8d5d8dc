"""The layout of a record: every dataset with its type, shape, unit and meaning.

`record` writes and checks files against these tables and docs/records.md is generated from them.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Dataset:
    """One dataset of a record.

    shape: a name ("ticks") stands for a length that all datasets of the record share. dtype: little-endian NumPy type.
    hashed: part of record_hash. optional: may be absent.
    """

    path: str
    dtype: str
    shape: tuple[int | str, ...]
    unit: str
    description: str
    hashed: bool = False
    optional: bool = False

    def shape_text(self) -> str:
        """The shape for the documentation."""
        return " × ".join(map(str, self.shape)) if self.shape else "1"


def _tick(name: str, dtype: str, columns: int, unit: str, description: str, hashed: bool = True) -> Dataset:
    return Dataset(
        f"ticks/{name}", dtype, ("ticks", columns) if columns else ("ticks",), unit, description, hashed
    )


def _update(name: str, dtype: str, unit: str, description: str) -> Dataset:
    return Dataset(f"updates/{name}", dtype, ("updates",), unit, description, hashed=True)


CONTACT_MODES = ("free", "stick", "slip")
# palpate.BoardStatus MODE_*, by number.
BOARD_MODES = ("boot", "idle", "calibrate", "render", "fault", "direct", "suspended")

# Bits of BoardStatus.faults, from 0 on (docs/safety.md).
BOARD_FAULTS = (
    "emergency_stop", "stop_command", "not_a_number", "encoder_jump", "over_speed", "outside_workspace",
    "over_current", "force_implausible", "deadline_missed", "link_lost", "energy_created",
    "motor_heat", "current_tracking", "supply_low",
)  # fmt: skip

# One row per servo tick; "the board says" is telemetry that does not cross the link.
TICKS = (
    _tick(
        "tick",
        "u4",
        0,
        "ticks",
        "number of the servo tick, at so many milliseconds; numbers are missing after an overlong tick",
    ),
    _tick("encoder_count", "i4", 3, "counts", "joint encoders, as given to the board"),
    _tick("measured_current_A", "f4", 3, "A", "motor currents, as given to the board"),
    _tick("setpoint_A", "f4", 3, "A", "motor current set-points, from the board"),
    _tick("enabled", "u1", 0, "", "1: the board enables the amplifiers"),
    _tick("tip_m", "f4", 3, "m", "tip position that the board computed from the encoders"),
    _tick("force_N", "f4", 3, "N", "force of the tip on the body, after the board's limits"),
    _tick("contact_mode", "u1", 0, "", "0 free, 1 stick, 2 slip"),
    _tick("triangle", "u4", 0, "", "triangle that is touched; only with a contact mode other than free"),
    _tick("barycentric", "f4", 3, "", "contact point on that triangle"),
    _tick(
        "normal",
        "f4",
        3,
        "",
        "unit outward normal in which the force was found; zero when free, and where the force is held (`model.feedback`)",
    ),
    _tick("mode", "u1", 0, "", f"the board's mode: {', '.join(f'{number} {name}' for number, name in enumerate(BOARD_MODES))}"),
    _tick("faults", "u4", 0, "", "bits of the board's latched faults"),
    _tick("model_sequence", "u4", 0, "", "number of the local model that was rendered; 0: none"),
    _tick("model_age_ticks", "u4", 0, "ticks", "age of that model's own state"),
    _tick(
        "catch_up_ticks", "u4", 0, "ticks", "ticks by which the model being prepared still lags; 0: none is"
    ),
    _tick("true_tip_m", "f8", 3, "m", "tip position in the plant, without quantization"),
    _tick("hand_target_m", "f8", 3, "m", "where the hand means to be; in a replay where the tip was"),
    _tick(
        "hand_force_N",
        "f8",
        3,
        "N",
        "force of the hand on the device; of a scripted one, what holds the tip on its path: against the arm's inertia, "
        "weight and friction and the motors; NaN in a replay, where nobody holds it",
    ),
    _tick("link_up_bytes", "u4", 0, "bytes", "bytes that left the link's board end in this tick"),
    _tick("link_down_bytes", "u4", 0, "bytes", "bytes that reached the board in this tick"),
    _tick("missed_deadlines", "u4", 0, "", "servo ticks so far that took too long", hashed=False),
    _tick(
        "background_overruns", "u4", 0, "", "ticks so far in which background work was not done", hashed=False
    ),
    _tick("tick_count", "u4", 0, "clock counts", "length of the previous servo tick", hashed=False),
    _tick(
        "busy_count", "u4", 0, "clock counts",
        "previous servo tick and the background runs that ended in it: after an overrun the work of more than one tick, before "
        "that none", hashed=False
    ),
)

UPDATES = (
    _update("sequence", "u4", "", "number of the local model, from 1"),
    _update("tick", "u4", "ticks", "its own tick: the state is that at the end of this tick"),
    _update("sent_tick", "u4", "ticks", "tick at which the host handed it to the link"),
    _update("swap_tick", "u4", "ticks", "tick at which the board took it over; 0: it did not"),
    _update("status", "u1", "", "the board's palpate::Status of it; 255: the board never said"),
    _update(
        "correction_energy_J",
        "f4",
        "J",
        "energy that the forces rendered before it gave the hand beyond those of its own replay, over the ticks that it "
        "replayed and no model before it (decisions/correction_energy.md); 0 where the board did not take it over or does "
        "not replay it",
    ),
    _update("modes", "u2", "", "number of modes; 0: a held force, or that nothing is near the tip"),
    _update("nodes", "u1", "", "number of nodes; with a near field those below the surface, too"),
    _update("bytes", "u4", "bytes", "length of its state's frame on the link"),
    _update("basis_bytes", "u4", "bytes", "length of the frames with pieces of bases since the state before"),
    _update(
        "interpolated_ticks",
        "u4",
        "ticks",
        "ticks since the update before whose tip position was interpolated",
    ),
    _update(
        "interpolation_error_m",
        "f8",
        "m",
        "largest error of an interpolated tip position, as known afterwards",
    ),
    _update(
        "damping_coupling",
        "f8",
        "",
        "what its modes neglect: off-diagonal part of the modal damping, relative to the whole",
    ),
    _update(
        "limited_modes",
        "u4",
        "",
        "modes that would grow more than tenfold while it is valid, and grow by that",
    ),
)

REFERENCE = (
    Dataset(
        "reference/force_N",
        "f8",
        ("ticks", 3),
        "N",
        "force of the tip on the full body, same tip path",
        optional=True,
    ),
    Dataset("reference/contact_mode", "u1", ("ticks",), "", "0 free, 1 stick, 2 slip", optional=True),
    Dataset(
        "reference/normal",
        "f8",
        ("ticks", 3),
        "",
        "unit outward normal in which the force was found: mean of the normals of the tick's steps, weighted by their "
        "forces; NaN when free",
        optional=True,
    ),
)

# With outputs.probe_node.
PROBE = (
    Dataset(
        "probe/rendered_m",
        "f8",
        ("ticks", 3),
        "m",
        "position of outputs.probe_node in the model that the board rendered, from a replay of that model by the "
        "board's code; NaN where the rendered model does not hold the node",
        hashed=True,
        optional=True,
    ),
    Dataset(
        "probe/force_N",
        "f4",
        ("ticks", 3),
        "N",
        "force of the tip on the body in that replay: the same bits as ticks/force_N where the board does not limit it",
        hashed=True,
        optional=True,
    ),
    Dataset(
        "probe/correction_energy_J",
        "f8",
        ("updates",),
        "J",
        "updates/correction_energy_J as that replay has it, in double precision; NaN for a model that was never rendered. The board "
        "begins anew where it is calibrated again in a run, this does not",
        hashed=True,
        optional=True,
    ),
    Dataset(
        "probe/reference_m",
        "f8",
        ("ticks", 3),
        "m",
        "position of that node in the full body of the reference",
        optional=True,
    ),
)

# The body at the moment of the largest tip force (without contact: at the end).
BODY = (
    Dataset("body/time_s", "f8", (), "s", "time of this state: the largest tip force, else the end"),
    Dataset("body/rest_m", "f8", ("nodes", 3), "m", "node positions at rest"),
    Dataset("body/position_m", "f8", ("nodes", 3), "m", "node positions then"),
    Dataset("body/tip_m", "f8", (3,), "m", "tip position then; NaN without a tip"),
    Dataset(
        "body/triangles",
        "u4",
        ("triangles", 3),
        "",
        "nodes of each surface triangle, counter-clockwise from outside; none in two dimensions",
    ),
    Dataset(
        "body/triangle_friction",
        "f8",
        ("triangles", 2),
        "",
        "coefficients of static and kinetic friction of each surface triangle",
    ),
    Dataset(
        "body/patch_nodes",
        "u4",
        ("patch nodes",),
        "",
        "nodes of the local model then; none in simulate",
    ),
)

RUN = (*TICKS, *UPDATES, *REFERENCE, *PROBE, *BODY)

SIMULATE = (
    Dataset("tip/time_s", "f8", ("ticks",), "s", "time of the servo tick", hashed=True, optional=True),
    Dataset("tip/position_m", "f8", ("ticks", 3), "m", "tip position", hashed=True, optional=True),
    Dataset(
        "tip/force_N", "f8", ("ticks", 3), "N", "force of the tip on the body", hashed=True, optional=True
    ),
    Dataset("tip/contact_mode", "u1", ("ticks",), "", "0 free, 1 stick, 2 slip", hashed=True, optional=True),
    Dataset(
        "tip/normal",
        "f8",
        ("ticks", 3),
        "",
        "unit outward normal in which the force was found: mean of the normals of the tick's steps, weighted by their "
        "forces; NaN when free",
        optional=True,
    ),
    Dataset(
        "tip/triangle",
        "u4",
        ("ticks",),
        "",
        "surface triangle that is touched (index into body/triangles); only with contact_mode > 0",
        optional=True,
    ),
    Dataset("nodes/time_s", "f8", ("times",), "s", "time of export", hashed=True),
    Dataset("nodes/position_m", "f8", ("times", "nodes", 3), "m", "node positions", hashed=True),
    Dataset("nodes/velocity_m_s", "f8", ("times", "nodes", 3), "m/s", "node velocities", hashed=True),
    *BODY,
)

# Numbers of a run that the core counts; they end in summary.json and as attributes of /.
RUN_COUNTERS = {
    "clock_Hz": "clock of tick_count and busy_count; 0 where the board has none",
    "frames_lost_down": "frames to the board that were lost or refused",
    "frames_lost_up": "frames to the host that were lost or refused",
    "frames_repeated_up": "frames to the host that came twice; the second one was ignored",
    "frames_late_up": "frames to the host that came behind later ones: taken, and not lost",
    "models_sent": "local models that the host sent",
    "models_taken": "local models that the board took over",
    "models_refused": "local models that the board refused or dropped",
    "basis_waits": "updates at which the modes of the patch that the model should be on were not there yet: one less far ahead "
    "or the patch before was used, or no model was sent",
}
