"""What a search asks for: stretches in doubt proved in ball arithmetic."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops

REACH_BEYOND_END = 1e-14  # of an end: how far a proof reaches into what is known on its other side

BallProver = Callable[[int, float, float], list[tuple[float, float, float, float]] | None]


def ball_prover(loops: Loops, path: str, period: np.ndarray) -> BallProver:
    """Return what `tiles.proved_by_balls` asks about a stretch, for loops of a batch along one
    of their numbers.

    period: of the frames, s, `(loops,)`.
    """
    budgets = {}

    def prove(column, low, high):
        from wavesweep.prove.ball_polynomials import Budget
        from wavesweep.prove.columns import prove_column

        loop = loops.one(column).in_whole_ticks(path)
        if loop is None:
            return None
        # Some five seconds of ball arithmetic for a column in doubt.
        budget = budgets.setdefault(column, Budget(3e7))
        span = (low - REACH_BEYOND_END * abs(low), high + REACH_BEYOND_END * abs(high))
        proof = None
        with suppress(IllPosedLoopError):
            drift = loop.changed({path: np.array(span)}).drift_of_frames()
            proof = prove_column(loop, path, span, drift, operations=budget)
        if not proof:
            return None
        given_ends = dict(zip(span, (low, high), strict=True))
        rows = []
        for found_start, found_stop, start_omega, stop_omega in proof.intervals:
            start = given_ends.get(found_start, found_start)
            stop = given_ends.get(found_stop, found_stop)
            start_angle = angle(column, loop, start_omega, start)
            stop_angle = angle(column, loop, stop_omega, stop)
            rows.append((start, stop, start_angle, stop_angle))
        return rows

    def angle(column, loop, omega, value):
        """The angle per frame of an oscillation at a value of the number, which the rate may
        follow from."""
        if name_of(path) in loop.drawing.rating:
            slower = loop.rate / loop.changed({path: value}).rate
        else:
            slower = 1.0
        return omega * period[column] * slower

    return prove
