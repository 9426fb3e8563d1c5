"""Drawn loops block by block, against their ticks as matrices."""

import numpy as np
import pytest
from support.drawings import pmw, random_drawing

from wavesweep.analysis.simulation.drawn import run_drawn
from wavesweep.diagram.drawn import Drawn
from wavesweep.lifted.periodic import ticks_of


def by_matrices(drawn, force, signals):
    """The same signals from the connected ticks."""
    ticks = ticks_of(drawn, signals)
    x, rows, w = np.zeros(len(ticks.states)), [], drawn.inputs.index("hand")
    for tick, f in enumerate(force):
        each = ticks.maps[ticks.kind[tick % drawn.ticks]]
        rows.append(each.C @ x + each.D[:, w] * f)
        x = x + each.E @ x + each.B[:, w] * f
    return np.array(rows).T


@pytest.mark.parametrize("seed", range(30))
def test_random_drawings_step_as_their_matrices_do(seed):
    drawn = random_drawing(seed)
    sums = dict(drawn.sums)
    sums["m.f"] = sums["m.f"] | {"hand": 1.0}
    drawn = Drawn(drawn.period, drawn.placed, sums, ("hand",))
    force = np.random.default_rng(seed).normal(size=min(3 * drawn.ticks, 200))
    seen = run_drawn(drawn, {"hand": force}, ("m.x", "m.v"))
    expected = by_matrices(drawn, force, ("m.x", "m.v"))
    for row, name in zip(expected, ("m.x", "m.v"), strict=True):
        assert seen[name] == pytest.approx(row[: len(seen[name])], rel=1e-9, abs=1e-9 * np.abs(row).max())


@pytest.mark.parametrize("changes", [{}, {"Kp": 20.0}, {"delay": 7}, {"integration": "implicit"}])
def test_blocks_that_depend_on_each_other_at_once_are_solved_together(changes):
    """Waves without a delay go round within a tick."""
    drawn, force = pmw(**changes, wall=(500.0, 1.0)), np.sin(0.05 * np.arange(120))
    seen = run_drawn(drawn, {"hand": force, "w": 0 * force}, ("m.x", "f_m"))
    for row, name in zip(by_matrices(drawn, force, ("m.x", "f_m")), ("m.x", "f_m"), strict=True):
        assert seen[name] == pytest.approx(row, rel=1e-11, abs=1e-12 * np.abs(row).max())
