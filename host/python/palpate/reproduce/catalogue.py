"""The figures that can be reproduced."""

from palpate.reproduce import fig14, fig15, fig16
from palpate.reproduce.figure import PaperFigure

FIGURES: dict[str, PaperFigure] = {
    figure.name: figure for figure in (fig14.FIGURE, fig15.FIGURE, fig16.FIGURE)
}
