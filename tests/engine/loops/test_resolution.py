"""What is resolved has no narrow features, and what has some is divided."""

import re

import numpy as np
import pytest
from support import expressions

import wavesweep
from wavesweep.engine._loops.resolution import RIM_DEGREE, Resolution, Side, halves, to_divide
from wavesweep.program.spec import load

SEEDS = range(15)
PULSES = 18  # of exp(-300 (1 + cos(58 p))) for p from -1 to 1


def spec_of(expression, span, **more):
    """A tick of 1 ms in which a state is multiplied by an expression of p, less K times what it was."""
    block = {"type": "ss", "discrete": True, "inputs": ["u"], "outputs": ["y"], "B": [[1]], "C": [[1]], "D": [[0]]}
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"p": span[0], "K": 0.0},
        "block": {"s": block | {"A": [[expression]]}, "h": {"type": "hold"}},
        "wire": {"h.u": "s.y", "s.u": "-K*h.y"},
        **more,
    }


def leaves(resolution, box, most):
    """The parts of a box that are resolved, at most so many; and whether they are all of it."""
    queue, found = [box], []
    while queue and len(found) < most:
        piece = queue.pop()
        if (unresolved := resolution.unresolved(piece)).any():
            queue += halves(piece, to_divide(unresolved, piece, box))
        else:
            found.append(piece)
    return found, not queue


@pytest.mark.slow
def test_on_a_resolved_part_an_expression_is_a_polynomial_but_for_rounding():
    node = np.cos(np.pi * (np.arange(RIM_DEGREE + 1) + 0.5) / (RIM_DEGREE + 1))
    dense = np.linspace(-1, 1, 2001)
    for seed in SEEDS:
        q = expressions.expression(np.random.default_rng(seed))
        spec = load(spec_of(re.sub(r"\bq\b", "p", q.text), q.span))
        box = np.array(q.span)[:, None]
        found, whole = leaves(Resolution(spec.drawing, spec.values, [Side("numbers.p")]), box, 3000)
        assert whole
        for low, high in (part[:, 0] for part in found):
            middle, half = (low + high) / 2, (high - low) / 2
            series = np.polynomial.chebyshev.chebfit(node, q.at(middle + half * node) + 0 * node, RIM_DEGREE)
            exact = q.at(middle + half * dense)
            missed = np.abs(np.polynomial.chebyshev.chebval(dense, series) - exact).max()
            assert missed <= 1e-8 * np.ptp(exact) + 1e-9 * np.abs(exact).max(), (seed, q.text, low, high)


@pytest.mark.asks("for_all")
def test_a_range_with_a_narrow_peak_is_proved_where_all_of_it_is_stable():
    """The pole of x[k+1] = (a(p) - K) x[k] is stable for a - 1 < K < a + 1."""
    sweep = {"along": "K", "K": {"start": 0, "stop": 2}}
    tables = spec_of("0.9 + 2e-6/((p - 0.3)**2 + 1e-5)", (0, 1), for_all={"p": {"start": 0, "stop": 1}}, sweep=sweep)
    (row,) = (row for _, row in wavesweep.zwidth(tables, "K").iterrows() if row["guarantee"] == "for_all")
    peak, least = 0.9 + 0.2, 0.9 + 2e-6 / (0.49 + 1e-5)
    assert peak - 1 < row["low"] < 1.01 * (peak - 1)
    assert 0.99 * (least + 1) < row["high"] < least + 1
    assert row["fails_below"] < peak - 1 + 1e-9
    assert row["certified"]


def test_pulses_of_an_entire_function_are_seen_along_their_number():
    """a - 0.01 passes 1 at exp(-300 (1 + cos(58 p))) = 0.55."""
    sweep = {"along": "p", "p": {"start": -1, "stop": 1}}
    found = wavesweep.zwidth(spec_of("0.89 + 0.2*exp(-300*(1 + cos(58*p)))", (-1, 1), sweep=sweep), "p")
    assert found["certified"].all()
    assert len(found) == PULSES + 1
    half = np.arccos(1 + np.log(0.55) / 300) / 58
    centres = np.pi / 58 * np.arange(-PULSES + 1, PULSES, 2)
    np.testing.assert_allclose(found["high"][:-1], centres - half, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found["low"][1:], centres + half, rtol=0, atol=1e-9)
