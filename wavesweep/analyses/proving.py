"""Columns of drawn loops that doubles leave in doubt, computed again in ball arithmetic and put in place of their rows."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from wavesweep.analyses.loops import drift_of
from wavesweep.analyses.open_loops import in_place
from wavesweep.errors import IllPosedLoopError
from wavesweep.stability import Intervals
from wavesweep.stability.certificate import NONE
from wavesweep.sweep.grid import Loops

OPERATIONS = 3e7  # of ball arithmetic for a column in doubt, at most: some five seconds
ALL = 3e8  # for all columns of a table, if all were in doubt; counted, so that the result does not depend on the machine


def with_proofs(
    found: Intervals, groups: Sequence[tuple[np.ndarray, Loops]], along: str, span: tuple[float, float], operations: float
) -> Intervals:
    """Intervals with those that are proved in place of those in doubt.

    found: by slices. groups: the loops, see `Search`. operations: for each column.
    """
    doubtful = np.unique(found.column[found.doubt != NONE]).tolist()
    if not doubtful:
        return found
    from wavesweep.prove import prove_column, proved_intervals

    proofs = {}
    for column in doubtful:
        members, loops = next(each for each in groups if column in each[0])
        loop = loops.one(int(np.searchsorted(members, column)))
        with suppress(IllPosedLoopError):
            drift = drift_of(loop.changed({along: np.array(span)}))
            integrators = len(drift.states) - len(drift.kept)
            if proof := prove_column(*loop, along, span, integrators, operations=operations):
                proofs[column] = proof
    if not proofs:
        return found
    return in_place(found, np.array(list(proofs)), proved_intervals(list(proofs.values())))
