"""All of the paper, table after table."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from wavesweep.paper import judging, open_choices, passive_bank
from wavesweep.paper.bench import Bench
from wavesweep.paper.documents import bank_text, choices_text, statements_text
from wavesweep.paper.figures import FIGURES
from wavesweep.paper.statements import STATEMENTS
from wavesweep.paper.tables import Table


def tables(progress: Callable[[int, int], None] | None = None) -> Iterator[Table]:
    """Give the tables of the figures, of the open choices, of passive filter banks and, last, of the statements; each is
    computed when it is asked for.

    progress: called with how many steps are done, and of how many.
    """
    bench, done, steps = Bench(), 0, len(FIGURES) + 2 + len(STATEMENTS)

    def step() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, steps)

    for figure in FIGURES:
        yield from figure(bench)
        step()
    study = open_choices.open_choices()
    yield Table("open-choices", open_choices.FIELDS, study, text=choices_text(study.columns))
    step()
    banks = passive_bank.passive_bank()
    yield Table("passive-bank", passive_bank.FIELDS, banks, passive_bank.figure(), bank_text(banks.columns))
    step()
    judged = judging.judge(bench, STATEMENTS, step)
    yield Table("statements", judging.FIELDS, judged, text=statements_text(judged.columns))
