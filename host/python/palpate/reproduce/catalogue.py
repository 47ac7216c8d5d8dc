"""The figures and tables that can be reproduced, in the paper's order, and after those of each part what goes beyond them."""

from palpate.reproduce import (
    fig4,
    fig5,
    fig8,
    fig12,
    fig13,
    fig14,
    fig15,
    fig16,
    fig17,
    frontier,
    late,
    locality,
    table1,
    table2,
)
from palpate.reproduce.figure import PaperFigure

FIGURES: dict[str, PaperFigure] = {
    module.FIGURE.name: module.FIGURE
    for module in (fig4, table1, table2, fig5, fig8, frontier, locality, fig12, fig13, fig14, fig15, fig16, fig17, late)
}
