"""Columns of drawn loops that doubles leave in doubt, computed again in ball arithmetic and put in place of their rows."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from wavesweep.analyses.loops import Groups, drift_of
from wavesweep.errors import IllPosedLoopError
from wavesweep.spec.drawing import Drawing
from wavesweep.stability import Intervals
from wavesweep.stability.certificate import NONE
from wavesweep.sweep.grid import selected

OPERATIONS = 3e7  # of ball arithmetic for a column in doubt, at most: some five seconds
ALL = 3e8  # for all columns of a table, if all were in doubt; counted, so that the result does not depend on the machine


def with_proofs(
    found: Intervals, drawing: Drawing, groups: Groups, along: str, span: tuple[float, float], operations: float
) -> Intervals:
    """Intervals with those that are proved in place of those in doubt.

    found: by slices. groups: see `DrawnTask`. operations: for each column.
    """
    doubtful = np.unique(found.column[found.doubt != NONE]).tolist()
    if not doubtful:
        return found
    from wavesweep.prove import prove_column, proved_intervals

    proofs = {}
    for column in doubtful:
        values = _values(groups, column)
        with suppress(IllPosedLoopError):
            drift = drift_of(drawing, values | {along: np.array(span)})
            integrators = len(drift.states) - len(drift.kept)
            if proof := prove_column(drawing, values, along, span, integrators, operations=operations):
                proofs[column] = proof
    if not proofs:
        return found
    columns, new = np.array(list(proofs)), proved_intervals(list(proofs.values()))
    whole = Intervals.join([found.take(~np.isin(found.column, columns)), replace(new, column=columns[new.column])])
    return whole.take(np.argsort(whole.column, kind="stable"))


def _values(groups, column):
    """The flat values of one slice as plain numbers."""
    members, values = next(each for each in groups if column in each[0])
    loop = selected(values, int(np.searchsorted(members, column)))
    return {path: value.item() if isinstance(value, np.generic) else value for path, value in loop.items()}
