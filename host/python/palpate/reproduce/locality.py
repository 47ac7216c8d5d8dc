"""The paper's condition for its local model, checked for bodies that meet it and that do not (section 6)."""

from pathlib import Path

import numpy as np

from palpate.reduce.locality import GOOD_ERROR, locality_of
from palpate.reduce.pictures import draw_section, draw_section_bar, section
from palpate.reduce.study import Reduction
from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Study, Table

HOMOGENEOUS, SOFT_CORE, STIFF_SKIN = "homogeneous", "soft_core", "stiff_skin"
WORDS = {HOMOGENEOUS: "homogeneous", SOFT_CORE: "soft core", STIFF_SKIN: "stiff skin"}
# Of the scenes' global updates.
UPDATE_RATE_Hz = 30.0
_SPOTS_Hz = (1.0, 10.0, 30.0, 100.0, 500.0)


def collect(reduction: Reduction) -> Record:
    """patch (p, 2): nodes along the surface, depth; modes, fits, in_band (p,); error (p, w) and reduced_error (w,), relative,
    at frequency_Hz (w,); share (nz, nx), first (5,): as from `palpate.reduce.pictures.section`; state_share: within the
    first patch; certified: of the whole body's reduction."""
    from palpate import _core

    locality = locality_of(reduction, UPDATE_RATE_Hz, _core.MAX_MODES)
    share, first = section(locality)
    return {
        "states": np.array(reduction.system.states),
        "order": np.array(reduction.order),
        "certified": np.array(reduction.certified_error),
        "patch": np.array([(patch.along, patch.depth) for patch in locality.patches]),
        "modes": np.array([patch.modes for patch in locality.patches]),
        "fits": np.array([patch.fits for patch in locality.patches]),
        "in_band": np.array([patch.error_in_band for patch in locality.patches]),
        "error": np.array([patch.error for patch in locality.patches]),
        "frequency_Hz": locality.frequency_Hz,
        "reduced_error": locality.reduced_error,
        "share": share,
        "first": first,
        "state_share": np.array(locality.state_share),
    }


def patch_name(record: Record, i: int) -> str:
    """As in 4x4x2."""
    along, depth = (int(value) for value in record["patch"][i])
    return f"{along}x{along}x{depth}"


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    first = {name: 100.0 * float(records[name]["in_band"][0]) for name in WORDS}
    limit = (
        f"{100 * GOOD_ERROR:.0f} % is the limit of reduce --check-locality: less than the just noticeable difference of "
        "stiffness, 23 %"
    )
    missed = f"largest error of the {patch_name(records[HOMOGENEOUS], 0)} patch alone above {UPDATE_RATE_Hz:g} Hz"
    dominant = "the local states must be the dominant ones"
    violated = "violated if the deep tissue were significantly more compliant than at the surface"
    return [
        Check(
            f"{missed}: homogeneous",
            dominant,
            first[HOMOGENEOUS],
            "%",
            f"{limit}. The body is the paper’s own, so it must be local",
            at_most=100.0 * GOOD_ERROR,
        ),
        Check(
            f"{missed}: soft core",
            violated,
            first[SOFT_CORE],
            "%",
            f"{limit}. Two layers down the body is 30 times softer, so it must not be local",
            at_least=100.0 * GOOD_ERROR,
        ),
        Check(
            f"{missed}: stiff skin",
            violated,
            first[STIFF_SKIN],
            "%",
            f"{limit}. All below the top layer is 100 times softer, so it must not be local",
            at_least=100.0 * GOOD_ERROR,
        ),
        *(
            Check(
                f"share of the states inside that patch: {words}",
                "the locality of the dominant modes can always be checked by performing off-line model reduction",
                100.0 * float(records[name]["state_share"]),
                "%",
                "reported only: the share hardly tells these bodies apart, so the verdict rests on the force",
            )
            for name, words in WORDS.items()
        ),
        Check(
            "largest certified error of the whole bodies’ reductions",
            NO_NUMBER,
            100.0 * max(float(record["certified"]) for record in records.values()),
            "%",
            "the order is the lowest whose bound known before truncation is 1 %, so these bodies are no harder to reduce; the "
            "projection’s error comes on top",
            at_most=1.01,
        ),
    ]


def tables(records: Records) -> list[Table]:
    """Patches of each body."""
    columns = ("nodes along", "depth", "modes", "board holds it", f"error above {UPDATE_RATE_Hz:g} Hz [%]")
    return [
        Table(
            f"{words[0].upper()}{words[1:]}, {int(record['states']):,} states; patches, and their error at some frequencies",
            (*columns, *(f"at {frequency:g} Hz [%]" for frequency in _SPOTS_Hz)),
            tuple(
                (int(along), int(depth), int(record["modes"][i]), int(record["fits"][i]), 100.0 * float(record["in_band"][i]))
                + tuple(
                    100.0 * float(np.interp(np.log(spot), np.log(record["frequency_Hz"]), record["error"][i]))
                    for spot in _SPOTS_Hz
                )
                for i, (along, depth) in enumerate(record["patch"])
            ),
            main=True,
        )
        for name, words in WORDS.items()
        for record in (records[name],)
    ]


def draw(records: Records, file: Path) -> None:
    """A column for each body: where the states lie, and what the models miss."""
    figure, axes = plot.grid(2, 3, (0.9, 1.3), share_y=True)
    orders = [int(record["order"]) for record in records.values()]
    whole = f"whole body, {min(orders)} to {max(orders)} states"
    for column, (name, words) in enumerate(WORDS.items()):
        record = records[name]
        above, below = axes[:, column]
        above.grid(visible=False)
        image = draw_section(record["share"], record["first"], above)
        above.set_title(f"{words} ({100 * float(record['state_share']):.0f} % inside)", fontsize=9)
        frequency_Hz = record["frequency_Hz"]
        below.axvspan(UPDATE_RATE_Hz, frequency_Hz[-1], color="#eef3f8", zorder=0)
        below.axhline(GOOD_ERROR, color=plot.GREY, linestyle="--", linewidth=1)
        for i, colour in enumerate(np.linspace(0.0, 0.75, len(record["patch"]))):
            below.loglog(
                frequency_Hz,
                record["error"][i],
                color=(0.05 + 0.9 * colour, 0.2 + 0.5 * colour, 0.55 + 0.3 * colour),
                linestyle="-" if record["fits"][i] else ":",
                linewidth=1.6 if i == 0 else 1.0,
                label=f"{patch_name(record, i)} patch, {int(record['modes'][i])} modes",
            )
        below.loglog(frequency_Hz, record["reduced_error"], color=plot.GREEN, label=whole)
        below.set(xlabel="frequency [Hz]")
        if column:
            above.set_ylabel("")
    axes[1, 0].set_ylabel("relative error of the force")
    draw_section_bar(image, figure, list(axes[0]))
    most = max(range(len(WORDS)), key=lambda column: len(axes[1, column].lines))
    figure.legend(
        *axes[1, most].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8, frameon=False
    )
    plot.save(figure, file)


FIGURE = PaperFigure(
    name="locality",
    title="Bodies whose response at the contact is local, and bodies where it is not",
    claims=(
        (
            "The major limit of this method is that the local states must be the dominant ones. This could be violated if the "
            "material was inhomogeneous, for example, if the deep tissue were significantly more compliant than at the "
            "surface so that most of the deformation occurred in states far from the interaction.",
            "6",
        ),
        (
            "However, the locality of the dominant modes can always be checked by performing off-line model reduction, as "
            "shown in Section 2.2.",
            "6",
        ),
    ),
    setting=(
        "Three blocks of 12 x 12 x 12 nodes, held at the bottom and on one side: homogeneous; with a core 30 times softer, "
        "two layers down; under a top layer 100 times stiffer. The paper has no such bodies: they are ours.",
        "What a patch around the contact misses, alone and with everything else held, is its force’s difference from the full "
        f"body’s, over the latter, from {UPDATE_RATE_Hz:g} Hz, the rate of the global updates, to 500 Hz. Below, the full body "
        "corrects the local model. A body counts as local where the paper’s patch, 4x4x2, misses at most 15 %.",
    ),
    caption="Above: where the states of the balanced reduction lie, in the section through the contact (triangle), and the "
    "4x4x2 patch (frame). Below: what each model misses; dashed: 15 %; shade: the local model alone; dotted: more modes than the "
    "board holds.",
    studies=tuple(Study(name, name, folder="reduce", order=None, collect=collect) for name in WORDS),
    checks=checks,
    draw=draw,
    tables=tables,
)
