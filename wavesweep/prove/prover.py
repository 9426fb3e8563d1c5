"""What a search asks for: stretches in doubt proved in ball arithmetic, and certified slices proved again."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from wavesweep.engine.drawing.drawing import name_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.prove.again import prove_again

__all__ = ["ball_prover", "prove_again"]

OPERATIONS = 3e7  # of ball arithmetic for a column in doubt, at most: some five seconds
MARGIN = 1e-14  # of an end: how far a proof reaches into what is known on its other side

BallProver = Callable[[int, float, float], list[tuple[float, float, float, float]] | None]


def ball_prover(loops: Loops, along: str, period: np.ndarray, operations: float = OPERATIONS) -> BallProver:
    """Return what `covering.proved_by_balls` asks about a stretch, for loops of a batch along one of their numbers.

    period: of the frames, s, `(loops,)`. operations: of ball arithmetic for each loop, at most.
    """
    budgets = {}

    def prove(column, low, high):
        from wavesweep.prove.ball_polynomials import Budget
        from wavesweep.prove.columns import prove_column

        loop, span = loops.one(column), (low - MARGIN * abs(low), high + MARGIN * abs(high))
        loop, budget = loop.in_whole_ticks(along), budgets.setdefault(column, Budget(operations))
        if loop is None:
            return None
        with suppress(IllPosedLoopError):
            drift = loop.changed({along: np.array(span)}).drift()
            proof = prove_column(*loop, along, span, len(drift.states) - len(drift.remaining), operations=budget)
            if proof:
                exact_ends = dict(zip(span, (low, high), strict=True))
                rows = [(exact_ends.get(row[0], row[0]), exact_ends.get(row[1], row[1]), *row[2:]) for row in proof.intervals]
                return [(*row[:2], *(angle(column, loop, *end) for end in zip(row[2:], row[:2], strict=True))) for row in rows]
        return None

    def angle(column, loop, omega, value):
        """The angle per frame of an oscillation at a value of the number, which the rate may follow from."""
        slower = loop.rate / loop.changed({along: value}).rate if name_of(along) in loop.drawing.rating else 1.0
        return omega * period[column] * slower

    return prove
