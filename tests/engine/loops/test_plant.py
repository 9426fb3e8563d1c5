"""Blocks that act on each other continuously are one block, exact over a held tick, within its bounds."""

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg
from support.plants import WAYS, bodies

from wavesweep.engine._loops.from_drawing import assembled
from wavesweep.program.spec import load

ENTRIES = 4 * np.finfo(float).eps  # of its terms, the error of an entry (see `rounding`)


def block_of(tables, **values):
    spec = load(tables)
    drawn = assembled(spec.drawing, dict(spec.values) | {f"numbers.{name}": value for name, value in values.items()})
    return next(each.block for each in drawn.placed if "+" in each.block.name), float(drawn.period)


def exponential(A, B, period):
    """exp([[A, B], [0, 0]] T) - 1 to 40 digits, its first rows."""
    n = len(A)
    with mp.workdps(40):
        whole = mp.zeros(n + B.shape[1])
        for i in range(n):
            for j, value in enumerate([*A[i], *B[i]]):
                whole[i, j] = mp.mpf(value) * mp.mpf(period)
        found = mp.expm(whole, method="taylor") - mp.eye(n + B.shape[1])
        return [[found[i, j] for j in range(n + B.shape[1])] for i in range(n)]


@pytest.mark.slow
@pytest.mark.sample(5)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", range(4))
def test_a_plant_is_exact_to_its_bounds(seed, way):
    """The matrices are those of the equations of motion, to a rounding of each spring over a mass."""
    many, _, A, B = bodies(seed, way)
    block, period = block_of(many)
    n = len(A) // 2
    order = [block.states.index(f"m{i}:{part}") for part in "xv" for i in range(n)]
    inputs = [block.inputs.index(f"m{i}:f") for i in (0, n - 1)]
    exact, sizes = exponential(A, B, period), block.terms[:2]
    found = np.hstack([block.E[np.ix_(order, order)], block.B[np.ix_(order, inputs)]])
    size = np.hstack([sizes[0][np.ix_(order, order)], sizes[1][np.ix_(order, inputs)]])
    error = np.array(
        [[float(abs(mp.mpf(value) - x)) for value, x in zip(*rows, strict=True)] for rows in zip(found, exact, strict=True)]
    )
    assert (error <= 2 * ENTRIES * size).all()  # A of the test is rounded too
    assert (error <= 2e-14 * np.abs(found)).all()


CHAIN = {  # a lag with a direct term, a mass and a filter, through which a force comes back
    "rates": {"tick_hz": 100},
    "numbers": {"g": 3.0, "q": 2.0},
    "block": {
        "lag": {"type": "tf", "num": [1, 5], "den": ["q", 3]},
        "m": {"type": "mass", "mass": 0.5, "stiffness": 7.0},
        "f": {"type": "ss", "A": [[-2]], "B": [[1, "g"]], "C": [["q"]], "D": [[0.2, 0]], "inputs": ["u", "w"]},
        "held": {"type": "hold"},
    },
    "wire": {"lag.u": "-0.7*f.y + held.y", "m.f": "g*lag.y", "f.u": "q*lag.y", "f.w": "m.x - m.v", "held.u": "-m.x"},
}


def rates_of_chain(g, q):
    """A, B of the states of lag, m (velocity, position) and f under the input at lag.u, by hand."""
    # lag: x' = -3/q x + u, y = (5/q - 3/q^2) x + u/q;   f: z' = -2 z + q y + g (p - v), h = q z + 0.2 q y;   u = -0.7 h + e
    c, d = 5 / q - 3 / q**2, 1 / q
    share = 1 / (1 + 0.7 * 0.2 * q * d)  # of y = c x + d (-0.7 (q z + 0.2 q y) + e)
    y = np.array([c, 0, 0, -0.7 * q * d, d]) * share
    u = -0.7 * (np.array([0, 0, 0, q, 0]) + 0.2 * q * y) + np.array([0, 0, 0, 0, 1])
    rows = [np.array([-3 / q, 0, 0, 0, 0]) + u, np.array([0, 0, -14.0, 0, 0]) + 2 * g * y, np.array([0, 1, 0, 0, 0])]
    whole = np.array([*rows, np.array([0, -g, g, -2, 0]) + q * y])
    return whole[:, :4], whole[:, 4:]


@pytest.mark.parametrize(("g", "q"), [(3.0, 2.0), (-1.5, 0.7), (2.0 + 1e-3j, 1.3 - 0.2j)])
def test_direct_terms_within_a_plant_are_solved(g, q):
    """For a batch, and for complex numbers too, as at the nodes of panels."""
    block, period = block_of(CHAIN, g=np.array([g, 1.0]), q=np.array([q, 1.0]))
    A, B = rates_of_chain(g, q)
    whole = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 5))]]) * period) - np.eye(5)
    assert block.states == ("lag:x0", "m:v", "m:x", "f:x0")
    np.testing.assert_allclose(block.E[0], whole[:4, :4], rtol=1e-12, atol=1e-16)
    np.testing.assert_allclose(block.B[0][:, [block.inputs.index("lag:u")]], whole[:4, 4:], rtol=1e-12)
    np.testing.assert_allclose(block_of(CHAIN, g=g, q=q)[0].E, block.E[0], rtol=1e-15)
