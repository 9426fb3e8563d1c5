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
            start_angle = start_omega * period[column] * _slower(loop, path, start)
            stop_angle = stop_omega * period[column] * _slower(loop, path, stop)
            rows.append((start, stop, start_angle, stop_angle))
        return rows

    return prove


def _slower(loop: Loops, path: str, value: float) -> float:
    """How many times as long a frame is at a value of a number, from which the rate may follow."""
    if name_of(path) not in loop.drawing.rating:
        return 1.0
    return loop.rate / loop.changed({path: value}).rate
