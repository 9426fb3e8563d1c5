"""A grid: which axes are of one drawing, and that its loops are those of the spec with the values of each combination."""

import numpy as np
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.interval_jobs import job_of
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import make_grid, own_loop

SPEC = {"controller": {"kind": "dc-slow"}, "rates": {"fast_hz": 1000.0, "ratio": 20}}


def swept(**axes):
    return load({**SPEC, "sweep": {"B_VE": [1.0], "K_VE": {"start": 0.0, "stop": 2000.0}, **axes}})


def test_the_fast_rate_is_of_one_drawing_where_nothing_follows_from_it():
    many = {"start": 500.0, "stop": 2000.0, "num": 10_001}
    assert len(job_of(swept(**{"rates.fast_hz": many})).grid.resolved) == 1
    edged = swept(**{"rates.fast_hz": many, "rates.slow_hz": [50.0]})
    with pytest.raises(UsageError, match="drawn anew for"):
        job_of(edged)


def test_drawn_loops_are_those_of_the_spec_with_the_values_of_each_combination():
    """In another order of the numbers too, of whole numbers, floats, and zeros among them."""
    spec = swept(B_VE=[0.0, 1.0, 2.0], **{"rates.ratio": [10, 20]})
    grid = make_grid(spec, [axis for axis in spec.sweep if axis.values])
    numbers = [5, 0, 3, 1]
    seen = []
    for members, loops in grid.drawn(numbers=numbers):
        for place, member in enumerate(members.tolist()):
            at = grid.loop_values([numbers[member]])
            alone = own_loop(spec.with_values({path: value[0].item() for path, value in at.items()}))
            assert np.array_equal(loops.read.one(place).radii(), alone.radii())
            assert loops.drawing == alone.drawing
            seen.append(member)
    assert sorted(seen) == [0, 1, 2, 3]
