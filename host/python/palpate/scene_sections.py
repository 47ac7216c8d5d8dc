"""The sections of a scene and all their keys: names, units, defaults, ranges and meanings.

Everything that holds for one key alone is declared here, or in `scene_body` for [body]; what relates several keys
stands in `scene_checks`.
"""

from dataclasses import dataclass

from palpate.scene_body import COORDINATE, MAX_NODES_PER_AXIS, Body
from palpate.scene_schema import Choice, Flag, Integer, ListOf, Number, OrAuto, TablesOf, Text, Vector, key, section
from palpate.tip_path import MAX_TIME_S

TICK_S = 1e-3
MAX_FRAME = 10_000_000

_STEP = Number(1e-6, TICK_S)


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """How the full body is stepped."""

    method: str = key(
        Choice(("semi_implicit", "implicit")),
        "`semi_implicit`: symplectic Euler, stable below a step that depends on the body; `implicit`: backward Euler, "
        "for bodies without [path] and without drives",
        default="semi_implicit",
    )
    step_s: float = key(
        _STEP, "time step; the servo tick of 0.001 s divided by a whole number", unit="s", default=0.0001
    )


@dataclass(frozen=True, kw_only=True)
class FrictionRegion:
    """A part of the body's surface with a friction of its own."""

    from_m: tuple[float, ...] = key(
        Vector((3,), COORDINATE), "lowest corner of a box in the device frame", unit="m"
    )
    to_m: tuple[float, ...] = key(
        Vector((3,), COORDINATE), "highest corner; no coordinate less than that of `from_m`", unit="m"
    )
    friction: float | None = key(
        Number(0.0, 10.0),
        "as `friction` in [contact]",
        default=None,
        default_text="0, unless `static_friction` is given",
    )
    static_friction: float | None = key(
        Number(0.0, 10.0), "as `static_friction` in [contact]", default=None, default_text="`friction`"
    )
    kinetic_friction: float | None = key(
        Number(0.0, 10.0), "as `kinetic_friction` in [contact]", default=None, default_text="`static_friction`"
    )


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Contact of the tip with the body: Coulomb friction, and the surface that is touched."""

    friction: float | None = key(
        Number(0.0, 10.0),
        "coefficient of both static and kinetic friction; not together with the other two",
        default=None,
        default_text="0, unless `static_friction` is given",
    )
    static_friction: float | None = key(
        Number(0.0, 10.0),
        "coefficient above which the tip begins to slip",
        default=None,
        default_text="`friction`",
    )
    kinetic_friction: float | None = key(
        Number(0.0, 10.0),
        "coefficient while it slips; at most `static_friction`",
        default=None,
        default_text="`static_friction`",
    )
    surface: str = key(
        Choice(("smooth", "flat")),
        "what the triangles stand for; `smooth`: the normal is interpolated between nodes; `flat`: it is that of the "
        "triangle, as in the paper",
        default="smooth",
    )
    regions: tuple[FrictionRegion, ...] = key(
        TablesOf(FrictionRegion, 1000),
        "parts of the surface with other friction: a triangle belongs to the last region whose box holds its centroid at "
        "rest; at most 4 different pairs of coefficients in a scene; see below",
        default=(),
    )


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """What connects the tip with the point that it touches."""

    kind: str = key(
        Choice(("kinematic", "virtual")),
        "`kinematic`: the contact point is where the tip is; `virtual`: a spring and a damper between them",
        default="kinematic",
    )
    stiffness_N_m: float = key(
        Number(10.0, 1e6), "of the spring; `virtual` only", unit="N/m", default=2000.0
    )
    damping_N_s_m: float = key(
        Number(0.0, 1e3), "of the damper; `virtual` only", unit="N s/m", default=1.0
    )
    tip: str = key(
        Choice(("counts", "estimated")),
        "where the device's tip is taken to be (`palpate run` only); `counts`: where the encoder counts say; "
        "`estimated`: the board estimates it between counts",
        default="estimated",
    )


@dataclass(frozen=True, kw_only=True)
class Tool:
    """What touches the body."""

    radius_m: float = key(
        Number(0.0, 0.05), "radius of the sphere at the tip; 0: a point", unit="m", default=0.0
    )
    speed_m_s: float | None = key(
        Number(0.0, 5.0),
        "greatest speed along x or y that `\"auto\"` plans for",
        unit="m/s",
        default=None,
        default_text="that of [path] near the body",
    )


@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """One point of a path."""

    time_s: float = key(Number(0.0, MAX_TIME_S), "time; greater than that of the point before", unit="s")
    position_m: tuple[float, ...] = key(Vector((3,), COORDINATE), "position in the device frame", unit="m")


@dataclass(frozen=True, kw_only=True)
class Path:
    """For `palpate run`, where the hand means to go; for `palpate simulate`, where the tip is."""

    waypoints: tuple[Waypoint, ...] | None = key(
        TablesOf(Waypoint, 100_000),
        "points in time and space; see below",
        default=None,
        default_text="or `csv`",
    )
    csv: str | None = key(
        Text(),
        "file with the columns time_s, x_m, y_m and z_m, beside the scene unless the path is absolute",
        default=None,
        default_text="or `waypoints`",
    )
    interpolation: str | None = key(
        Choice(("linear", "minimum_jerk")),
        "between the points: at constant speed, or resting at each point with least jerk",
        default=None,
        default_text="`minimum_jerk` for `waypoints`, `linear` for `csv`",
    )


@dataclass(frozen=True, kw_only=True)
class GripChange:
    """A grip that holds from a time on."""

    time_s: float = key(Number(0.0, MAX_TIME_S), "time; greater than that of the change before", unit="s")
    grip: float = key(Number(0.0, 1.0), "the new grip")


@dataclass(frozen=True, kw_only=True)
class Hand:
    """The hand: a mass that a spring and a damper pull along the path, and a grip between it and the tip."""

    kind: str = key(
        Choice(("impedance", "scripted")),
        "`impedance`: it gives way to forces as the keys below say; `scripted`: the tip is exactly on [path] in every "
        "tick, whatever the motors do, and no other key of [hand] may be given",
        default="impedance",
    )
    grip: float = key(
        Number(0.0, 1.0), "how tight: 1 as the grip's stiffness and damping say, 0 let go", default=1.0
    )
    grip_changes: tuple[GripChange, ...] = key(
        TablesOf(GripChange, 10_000), "later changes of the grip; see below", default=()
    )
    mass_kg: float = key(Number(0.01, 10.0), "mass of the hand", unit="kg", default=0.2)
    stiffness_N_m: float = key(Number(0.0, 2e4), "from the path to the hand", unit="N/m", default=3000.0)
    damping_N_s_m: float = key(Number(0.0, 100.0), "from the path to the hand", unit="N s/m", default=35.0)
    grip_stiffness_N_m: float = key(Number(0.0, 2e4), "from the hand to the tip", unit="N/m", default=5000.0)
    grip_damping_N_s_m: float = key(Number(0.0, 60.0), "from the hand to the tip", unit="N s/m", default=15.0)


@dataclass(frozen=True, kw_only=True)
class Device:
    """The simulated arm behind encoders and amplifiers; it starts where the path does."""

    encoder_reference: tuple[int, ...] = key(
        Vector((3,), Integer(-1_000_000_000, 1_000_000_000)),
        "what the encoders read in the reference pose",
        unit="counts",
        default=(0, 0, 0),
    )
    amplifier_bandwidth_Hz: float = key(
        Number(1.0, 1e6), "corner frequency of the motor currents", unit="Hz", default=1000.0
    )
    amplifier_peak_A: float = key(Number(0.1, 100.0), "the currents saturate at this", unit="A", default=7.0)
    amplifier_offset_A: tuple[float, ...] = key(
        Vector((3,), Number(-1.0, 1.0)), "error added to each set-point", unit="A", default=(0.0, 0.0, 0.0)
    )


@dataclass(frozen=True, kw_only=True)
class Rates:
    """How often, and how late, the host works. The servo ticks at 1000 Hz."""

    model_update_Hz: float = key(
        OrAuto(Number(1.0, 250.0)), "local models sent per second of virtual time", unit="Hz", default=30.0
    )
    host_delay_ticks: int = key(
        Integer(0, 400), "virtual time that the host takes to compute a model", unit="ticks", default=5
    )
    models_under_way: int = key(
        Integer(1, 16),
        "models that the host may compute at a time; with 1 none is begun before the one before is done, and with a "
        "delay of a frame or more fewer are sent",
        default=1,
    )


@dataclass(frozen=True, kw_only=True)
class Model:
    """The local model that the board renders."""

    builder: str = key(
        Choice(("patch", "patch_rescaled", "condensed", "krylov", "hybrid")),
        "how it is built; `patch`: the nodes around the tip, those beyond held, with the tangent of the frame; "
        "`patch_rescaled`: the same, the springs that lead out of it softened until its border yields as in the body at "
        "rest; `condensed`: the same, with the static stiffness of the rest of the body at rest; `krylov`: modes of the "
        "whole body that answer forces on the patch's surface as it does; `hybrid`: such modes of the body at rest, and "
        "on the board the exact forces of the springs at the contact",
        default="patch",
    )
    patch_nodes: tuple[int, ...] = key(
        OrAuto(Vector((3,), Integer(2, 8))),
        "nodes of the patch [x, y, z] or fewer at a border; 64 at most",
        default=(4, 4, 2),
    )
    patch_ahead: bool = key(
        Flag(),
        "the patch lies around the place where the tip, by its speed since the update before, will be in the middle of the "
        "time in which the model is used (by when the board took over those before), as long as the contact is on it; "
        "otherwise around the contact at the model's own tick, as in the paper",
        default=True,
    )
    tangent: str = key(
        Choice(("frame", "rest")),
        "`krylov`: where the body's stiffness and damping are taken; `rest`: once, `frame`: at each update's state",
        default="frame",
    )
    shifts_Hz: tuple[float, ...] = key(
        OrAuto(ListOf(Number(0.0, 1000.0), 4)),
        "`krylov`: frequencies, ascending, around which the modes answer exactly; 3 modes for each and each surface node, "
        "192 at most",
        unit="Hz",
        default=(0.0,),
    )
    middle_shifts_Hz: tuple[float, ...] = key(
        ListOf(Number(0.0, 1000.0), 4),
        "`krylov`, `hybrid`: further such frequencies, ascending, of the four nodes of the contact's cell only; 12 modes for "
        "each; `hybrid` without any has 20 Hz",
        unit="Hz",
        default=(),
    )
    basis_latency_ticks: int = key(
        Integer(0, 60_000),
        "virtual time that the modes of a patch take to compute, one patch at a time; until then the patch before is used "
        "as far as it goes, so that a run does not depend on the machine's speed; 0: none",
        unit="ticks",
        default=100,
    )
    basis_cache_MB: int = key(
        Integer(0, 1_000_000),
        "modes of patches are kept in files for later runs, at most so much, in `$PALPATE_CACHE` or `palpate` in the user's "
        "cache folder (`$XDG_CACHE_HOME` or `~/.cache`); results are the same bits with and without; 0: no files",
        unit="MB",
        default=1024,
    )
    near_nodes: int = key(
        OrAuto(Integer(0, 16)),
        "`hybrid`: nodes below the surface, nearest to the middle of the patch first, whose own answers to forces are in "
        "the modes, three each; all modes are 96 at most",
        default=4,
    )
    feedback: str = key(
        Choice(("exact", "paper", "discard", "hold")),
        "what the full body on the host learns of the contact between two updates; `exact`: it goes through the tip's "
        "path with the same contact code; `paper`: it moves without the tip and the local model's nodes overwrite its "
        "own; `discard`: it knows the tip at the updates only, and each local model begins as if it were of the "
        "present; `hold`: the same without local model, the board holds the force of the newest update",
        default="exact",
    )
    valid_ticks: int = key(
        Integer(1, 5000),
        "ticks after the model's own tick for which it may be rendered",
        unit="ticks",
        default=200,
    )
    growth_ticks: int | None = key(
        Integer(0, 65535),
        "ticks after the board took a model over in which its force may grow; then it stays below what it was, or 0.5 N, until the "
        "next model",
        unit="ticks",
        default=None,
        default_text="two updates and 30",
    )


@dataclass(frozen=True, kw_only=True)
class EncoderSlip:
    """An encoder that reads otherwise from one servo tick on."""

    tick: int = key(Integer(0, 600_000), "first servo tick of it", unit="ticks")
    joint: int = key(Integer(0, 2), "number of the joint")
    count: int = key(
        Integer(-1_000_000, 1_000_000), "what is added to each of its readings; 8,670 are a radian of joint 0", unit="counts"
    )


@dataclass(frozen=True, kw_only=True)
class BoardFaults:
    """What goes wrong on the board."""

    overlong_ticks: tuple[int, ...] = key(
        ListOf(Integer(0, 600_000), 100_000),
        "servo ticks that compute for 2.5 ticks more (not on `native`)",
        unit="ticks",
        default=(),
    )
    emergency_stop_ticks: tuple[int, ...] = key(
        ListOf(Integer(0, 600_000), 100_000),
        "servo ticks with the emergency-stop chain open",
        unit="ticks",
        default=(),
    )
    supply_low_ticks: tuple[int, ...] = key(
        ListOf(Integer(0, 600_000), 100_000),
        "servo ticks in which the supply of the board's electronics is too low",
        unit="ticks",
        default=(),
    )
    reset_ticks: tuple[int, ...] = key(
        ListOf(Integer(0, 600_000), 1000),
        "servo ticks in which the board starts again, as after a moment without power; the host finds it out when ticks go back by "
        "more than 2,000, and leaves the board disarmed",
        unit="ticks",
        default=(),
    )
    encoder_slips: tuple[EncoderSlip, ...] = key(
        TablesOf(EncoderSlip, 1000), "encoders that read otherwise from a servo tick on", default=()
    )


@dataclass(frozen=True, kw_only=True)
class Board:
    """Where the firmware runs."""

    name: str = key(
        Choice(("mps2_an386", "mps2_an500", "native", "nucleo_g474re")),
        "`mps2_an386`: the image for a Cortex-M4F, in QEMU; `mps2_an500`: that for a Cortex-M7; `native`: the same firmware as a Linux process; `nucleo_g474re`: the image for that board, on models of its part",
        default="mps2_an386",
    )
    faults: BoardFaults = section(BoardFaults, "What goes wrong on the board, for tests; ticks beyond the scene's end are refused.")


@dataclass(frozen=True, kw_only=True)
class Safety:
    """Times of the board's supervisor; None: the board's own."""

    horizon_s: float | None = key(
        Number(0.001, 5.0),
        "the longest that a model may be rendered beyond its tick, whatever `model.valid_ticks` says",
        unit="s",
        default=None,
        default_text="the board's: 1",
    )
    fade_s: float | None = key(
        Number(0.02, 2.0),
        "then its force fades to zero within this time",
        unit="s",
        default=None,
        default_text="the board's: 0.2",
    )
    damp_s: float | None = key(
        Number(0.0, 5.0),
        "while the host is silent the tip is then damped for so long, before outputs go off",
        unit="s",
        default=None,
        default_text="the board's: 1",
    )
    resume_within_s: float | None = key(
        Number(1.0, 60.0),
        "a host that has been silent for no longer than this renders again by itself; later that is a fault",
        unit="s",
        default=None,
        default_text="the board's: 10",
    )


@dataclass(frozen=True, kw_only=True)
class BitFlip:
    """One bit that arrives inverted."""

    frame: int = key(Integer(0, MAX_FRAME), "number of the frame in its direction, from 0")
    bit: int = key(Integer(0, 1_000_000), "number of the bit in the frame, modulo the frame's length")


@dataclass(frozen=True, kw_only=True)
class Copy:
    """A frame that comes twice."""

    frame: int = key(Integer(0, MAX_FRAME), "number of the frame in its direction, from 0")
    behind: int = key(Integer(0, 1000), "its copy comes behind so many of the next frames", default=0)


@dataclass(frozen=True, kw_only=True)
class LateFrame:
    """A frame that others overtake."""

    frame: int = key(Integer(0, MAX_FRAME), "number of the frame in its direction, from 0")
    behind: int = key(Integer(1, 1000), "it comes behind so many of the next frames", default=1)


FAULT_WAYS = ("down", "up")


@dataclass(frozen=True, kw_only=True)
class TimeSpan:
    """From one time on, before another."""

    from_s: float = key(Number(0.0, MAX_TIME_S), "beginning", unit="s", default=0.0)
    to_s: float = key(Number(0.0, MAX_TIME_S), "end", unit="s", default=MAX_TIME_S)


@dataclass(frozen=True, kw_only=True)
class RandomFault(TimeSpan):
    """Faults by chance."""

    way: str = key(Choice(FAULT_WAYS), "`down`: to the board; `up`: to the host")
    kind: str = key(
        Choice(("drop", "flip", "truncate", "duplicate", "reorder")),
        "what happens to a frame that is hit; which bit flips, where it is cut and how many frames, up to 3, go before it is drawn, too. "
        "On `can` and `canfd`, each frame of the bus: `drop`: lost, and not sent again; `duplicate`: it comes twice, one behind the other; "
        "`flip`: every node signals an error, and the frame goes again. On `usb`, each packet: `flip` alone, and it goes again",
    )
    chance: float = key(Number(0.0, 1.0), "that a frame is hit")


@dataclass(frozen=True, kw_only=True)
class LateBytes(TimeSpan):
    """A delay on top of the medium's own time. Nothing overtakes."""

    way: str = key(Choice(FAULT_WAYS), "`down`: to the board; `up`: to the host")
    delay_s: float = key(Number(0.0, 10.0), "what every submission waits", unit="s", default=0.0)
    jitter_s: float = key(Number(0.0, 10.0), "what it waits more at most, drawn for each", unit="s", default=0.0)


@dataclass(frozen=True, kw_only=True)
class Flood(TimeSpan):
    """Frames of a second host, as many as it can; on a CAN bus those of another node, of nominal priority."""

    load: float = key(Number(0.0, 10.0), "of what the link to the board carries", default=1.0)


@dataclass(frozen=True, kw_only=True)
class LinkFaults:
    """Faults on the link, for tests. "down" is from host to board, "up" from board to host."""

    drop_down: tuple[int, ...] = key(
        ListOf(Integer(0, MAX_FRAME), 100_000),
        "frames to the board that are lost, by number from 0",
        default=(),
    )
    drop_up: tuple[int, ...] = key(
        ListOf(Integer(0, MAX_FRAME), 100_000),
        "frames to the host that are lost, by number from 0",
        default=(),
    )
    flip_down: tuple[BitFlip, ...] = key(
        TablesOf(BitFlip, 100_000), "bits that flip in frames to the board", default=()
    )
    flip_up: tuple[BitFlip, ...] = key(
        TablesOf(BitFlip, 100_000), "bits that flip in frames to the host", default=()
    )
    duplicate_down: tuple[Copy, ...] = key(
        TablesOf(Copy, 100_000), "frames to the board that come twice", default=()
    )
    duplicate_up: tuple[Copy, ...] = key(
        TablesOf(Copy, 100_000), "frames to the host that come twice", default=()
    )
    reorder_down: tuple[LateFrame, ...] = key(
        TablesOf(LateFrame, 100_000), "frames to the board that come behind later ones", default=()
    )
    reorder_up: tuple[LateFrame, ...] = key(
        TablesOf(LateFrame, 100_000), "frames to the host that come behind later ones", default=()
    )
    seed: int = key(Integer(1, 1_000_000), "of all that is drawn: equal seeds, equal runs", default=1)
    random: tuple[RandomFault, ...] = key(
        TablesOf(RandomFault, 100), "frames that are hit by chance; of two faults of one frame the first counts", default=()
    )
    delay: tuple[LateBytes, ...] = key(TablesOf(LateBytes, 100), "delay and jitter", default=())
    unplugged: tuple[TimeSpan, ...] = key(
        TablesOf(TimeSpan, 100), "the cable is out; what had passed it arrives", default=()
    )
    host_stopped: tuple[TimeSpan, ...] = key(
        TablesOf(TimeSpan, 100), "the host's process is stopped: it says nothing, and what comes waits", default=()
    )
    other_schema: tuple[TimeSpan, ...] = key(
        TablesOf(TimeSpan, 100), "the host's models carry another schema hash: as of a host built from other definitions", default=()
    )
    second_host: tuple[TimeSpan, ...] = key(
        TablesOf(TimeSpan, 100), "another node sends commands, models and requests of its own, 100 a second each", default=()
    )
    flood: tuple[Flood, ...] = key(TablesOf(Flood, 100), "another node fills the link to the board", default=())
    babble: tuple[TimeSpan, ...] = key(
        TablesOf(TimeSpan, 100), "`can`, `canfd`: a broken node fills the bus with frames of the first priority", default=()
    )
    refused: tuple[TimeSpan, ...] = key(
        TablesOf(TimeSpan, 100), "`usb`: the device refuses every packet (NAK), and has none to give", default=()
    )


@dataclass(frozen=True, kw_only=True)
class Link:
    """The medium between board and host, metered in virtual time."""

    medium: str = key(
        Choice(("uart", "can", "canfd", "usb")),
        "what carries the frames; `uart`: a serial line in each direction, 10 bits a byte; `can`, `canfd`: a bus that both "
        "directions share, frame by frame; `usb`: a full-speed bus with the firmware's own USB stack at its end, 19 packets of 64 bytes a "
        "millisecond for both directions; `--medium` overrides it",
        default="uart",
    )
    baud: int = key(
        Integer(1200, 20_000_000), "`uart`: bits per second in each direction", unit="bit/s", default=12_000_000
    )
    bit_rate_Hz: int = key(
        Integer(10_000, 1_000_000),
        "`can`: bits per second; `canfd`: of the arbitration",
        unit="bit/s",
        default=1_000_000,
    )
    data_bit_rate_Hz: int = key(
        Integer(10_000, 8_000_000),
        "`canfd`: bits per second of the data; at least `bit_rate_Hz`",
        unit="bit/s",
        default=5_000_000,
    )
    queue_bytes: int = key(
        Integer(32_768, 16_777_216),
        "what each direction may hold back before frames are lost; a model has up to 28 kB",
        unit="bytes",
        default=1_048_576,
    )
    trace: str = key(
        Choice(("full", "tip")),
        "what the board sends of its ticks; `full`: tip, force and contact; `tip`: where the tip was, all that the host "
        "needs, each coordinate off by 46 nm at most at 0.5 m/s and four ticks a message; records have the rest from the "
        "emulated board; not with `model.feedback = \"paper\"`",
        default="full",
    )
    trace_ticks: int = key(
        Integer(1, 32), "ticks in each message of them; the host hears of them that much later", unit="ticks", default=4
    )
    faults: LinkFaults = section(
        LinkFaults,
        "Faults on the link, for tests: at most one a frame. Times count to the nearest servo tick; what would begin at the scene's end or later is "
        "refused.",
    )


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The full non-linear body with contact, stepped finely along the same tip path, to compare with."""

    enabled: bool = key(Flag(), "compute it (`palpate run` only)", default=True)
    step_s: float = key(
        _STEP, "its time step; the servo tick of 0.001 s divided by a whole number", unit="s", default=0.0001
    )


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """What is written, beside `summary.json` and `record.h5`."""

    node_times_s: tuple[float, ...] = key(
        ListOf(Number(0.0, MAX_TIME_S), 100_000),
        "times, increasing, at which `palpate simulate` exports all nodes (at the nearest servo tick)",
        unit="s",
        default=(),
    )
    probe_node: tuple[int, ...] | None = key(
        Vector((3,), Integer(0, MAX_NODES_PER_AXIS - 1)),
        "node [i, j, k] whose position is recorded in every tick, as the board rendered it and as the reference has "
        "it (`palpate run` only)",
        default=None,
        default_text="none",
    )
    csv: bool = key(Flag(), "also write tip.csv, and nodes.csv where nodes are exported", default=True)
    pictures: bool = key(Flag(), "draw forces.png and body.png", default=True)


@dataclass(frozen=True, kw_only=True)
class SceneFile:
    """The whole scene as it stands in the file. The servo tick is 0.001 s throughout."""

    title: str = key(Text(), "shown in the output", default="")
    duration_s: float = key(
        Number(TICK_S, MAX_TIME_S),
        "length of the experiment in virtual time, rounded to whole ticks",
        unit="s",
    )
    body: Body = section(
        Body, "The lattice: point masses, and springs with dampers between neighbours.", required=True
    )
    integrator: Integrator = section(Integrator, "How the full body is stepped on the host.")
    contact: Contact = section(Contact, "Contact of the tip with the body: Coulomb friction, and the surface that is touched.")
    coupling: Coupling = section(Coupling, "What connects the tip with the point of the body that it touches.")
    tool: Tool = section(Tool, "What touches the body.")
    path: Path | None = section(
        Path,
        "Where the tip goes. For `palpate run` this is where the *hand* means to go: its stiffness lets the tip lag "
        "behind; for `palpate simulate`, and with `hand.kind = \"scripted\"`, the tip itself is there. Before its first point and after its last the path "
        "rests. A scene without [path] is a body that moves on its own (`palpate simulate` only).",
        optional=True,
    )
    hand: Hand = section(
        Hand,
        "The hand that holds the tool (`palpate run` only). The tip gives way by force / `stiffness_N_m` + force / "
        "`grip_stiffness_N_m`, unless it is scripted.",
    )
    device: Device = section(
        Device,
        "The simulated arm behind encoders and amplifiers (`palpate run` only); it starts where the path does.",
    )
    rates: Rates = section(
        Rates,
        "How often, and how late, the host works; all in virtual time. `\"auto\"`: chosen for link, board and tool "
        "([model_choice.md](decisions/model_choice.md)).",
    )
    model: Model = section(
        Model,
        "The local model that the board renders (`palpate run` only). `\"auto\"`: as in [rates]; `shifts_Hz` and `near_nodes` "
        "are the order of the builders that know them, and any value of the others.",
    )
    board: Board = section(Board, "Where the firmware runs (`palpate run` only); `--board` overrides it.")
    safety: Safety = section(
        Safety,
        "What the emulated board's supervisor does with a model that grows old and a link that is lost ([Safety](safety.md#a-lost-link)), in whole "
        "milliseconds: others are refused. A board that runs by itself has its own.",
    )
    link: Link = section(
        Link, "The medium between board and host (`palpate run` only), metered in virtual time."
    )
    reference: Reference = section(
        Reference, "The full body with contact, stepped finely along the tip path that the run took."
    )
    outputs: Outputs = section(Outputs, "What is written beside `summary.json` and `record.h5`.")
