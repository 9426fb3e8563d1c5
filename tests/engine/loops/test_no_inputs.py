"""Blocks that nothing drives (references, disturbances, whole recursions), and the tick of loops that do not read it."""

import math

import numpy as np
import pytest

import wavesweep


def driven_by_nothing(A, C, **more):
    return {"type": "ss", "inputs": [], "outputs": ["y"], "A": A, "B": [[] for _ in A], "C": [C], **more}


RECURSION = {
    "rates": {"tick_hz": 1000},
    "numbers": {"p": {"value": 0.5, "unit": "", "description": "feedback"}},
    "block": {"s": driven_by_nothing([[0.9, 1], ["-p", 0.4]], [1, 0], discrete=True)},
}
PLANT = {"type": "ss", "discrete": True, "inputs": ["u"], "outputs": ["y"], "A": [[0.8]], "B": [[0.3]], "C": [[1]]}
FOLLOWER = {
    "rates": {"tick_hz": 1000},
    "numbers": {"k": {"value": 1.0, "unit": "", "description": "gain"}},
    "block": {
        "sampled": driven_by_nothing([[0.9, 0.1], [0, 0.5]], [1, 0], discrete=True),
        "lag": driven_by_nothing([[-3]], [1]),
        "plant": PLANT,
    },
    "wire": {"plant.u": "k*(sampled.y + lag.y - plant.y)"},
}


def recursion(p):
    x, y = 1.0, 0.3
    while True:
        yield x, y
        x, y = 0.9 * x + y, 0.4 * y - p * x


def follower(k):
    x, y, lag, plant = 1.0, -1.0, 1.0, 0.2
    while True:
        yield x, y, lag, plant
        x, y, lag, plant = 0.9 * x + 0.1 * y, 0.5 * y, lag * math.exp(-0.003), 0.8 * plant + 0.3 * k * (x + lag - plant)


def size_after(march, ticks):
    return max(map(abs, next(state for tick, state in enumerate(march) if tick == ticks)))


@pytest.mark.parametrize(
    ("drawn", "along", "march", "ends"),
    [(RECURSION, "p", recursion, (-0.06, 0.64)), (FOLLOWER, "k", follower, (-2 / 3, 6.0))],
)
def test_ends_are_where_the_tick_by_tick_run_begins_to_grow(drawn, along, march, ends):
    table = wavesweep.compile(drawn).stable_intervals(along=along, span=(-10, 20))
    assert table.certified.all()
    np.testing.assert_allclose([table.low, table.high], np.array(ends)[:, None], rtol=1e-12)
    for end, outwards in zip(ends, (-1, 1), strict=True):
        assert size_after(march(end - outwards * 0.01), 10000) < 1e-6
        assert size_after(march(end + outwards * 0.01), 10000) > 1e6
