"""Every quantitative or comparative statement of the paper, in its order, and the functions that judge them."""

from reproduce.statements import aliasing, experiments, figure2, introduction, stability, transparency

STATEMENTS = (
    *introduction.STATEMENTS,
    *aliasing.STATEMENTS,
    *figure2.STATEMENTS,
    *transparency.STATEMENTS,
    *stability.STATEMENTS,
    *experiments.STATEMENTS,
    *transparency.LABELS,
)
