import cmath
import math

import numpy as np
import pytest

from wavesweep.simulation.laws import butterworth
from wavesweep.simulation.tick_sums import evaluated


def step(law, state, u):
    """The state after a sample, and the output for it."""
    seen = evaluated(law.gives.items(), {**state, "u": u})
    return {name: sum(factor * seen.get(source, 0.0) for factor, source in terms) for name, terms in law.keeps.items()}, seen[
        "y"
    ]


def response(law, z):
    """The sections at z: from z times the state as what follows the state."""
    names = list(law.keeps)
    unit = [step(law, {name: 1.0}, 0.0) for name in names]
    A = np.array([[after[name] for after, _ in unit] for name in names])
    after, D = step(law, {}, 1.0)
    return D + np.array([y for _, y in unit]) @ np.linalg.solve(z * np.eye(len(names)) - A, [after[name] for name in names])


@pytest.mark.parametrize("passes", ["low", "high"])
@pytest.mark.parametrize(("order", "cutoff_hz"), [(1, 10.0), (2, 20.0), (5, 3.0), (6, 400.0), (10, 1.0), (12, 10.0)])
def test_the_response_is_butterworths_at_the_warped_frequency(passes, order, cutoff_hz):
    """`1/prod(s - p)` at `s = j tan(pi f/f_s)/tan(pi f_c/f_s)`, or at its inverse for a high-pass."""
    law = butterworth(1e-3, order, cutoff_hz, passes)
    for frequency in np.array([0.1, 0.5, 1.0, 1.7, 8.0]) * cutoff_hz:
        if frequency >= 500.0:
            continue
        s = 1j * math.tan(math.pi * frequency / 1000.0) / math.tan(math.pi * cutoff_hz / 1000.0)
        s = 1 / s if passes == "high" else s
        analogue = 1.0
        for k in range(order):
            analogue /= s - cmath.exp(1j * math.pi * (2 * k + order + 1) / (2 * order))
        found = response(law, cmath.exp(2j * math.pi * frequency / 1000.0))
        assert abs(found - analogue) < 1e-12  # of the pass band's 1; a direct form is off by 10 at order 10, 1 Hz
