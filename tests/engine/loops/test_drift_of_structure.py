"""What drifts in loops that differ in the values of numbers alone is found once."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.engine import loop as of_loops
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine.rows import items_of
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

TEMPLATES = Path(__file__).parents[3] / "sweeps" / "templates"
PARTS = ((0.5, 0.7), (0.8, 0.85), (1.2, 1.3))  # of a number, in which a batch has it


@pytest.mark.whole
def test_each_batch_has_the_drift_that_it_has_by_itself():
    """A dead time decides how many ticks a delay has, and a mass decides nothing."""
    loop = own_loop(load(TEMPLATES / "two-mass.toml"))
    for pair in combinations(["numbers.Jm", "numbers.tau", "rates.tick_hz"], 2):
        for part in PARTS:
            batch = loop.changed({path: loop.values[path] * np.linspace(*part, 3) for path in pair})
            assert batch.drift().constant
            assert batch.drift() == MarginalModes.of(*batch.twins())
            assert batch.drift_of_frames() == MarginalModes.of_frames(*batch.twins())


def test_a_batch_of_the_same_structure_looks_for_none(monkeypatch):
    loop = own_loop(wavesweep.compile({"controller": {"kind": "pmw-lm"}}).spec).changed({"environment.K_VE": 0.0})

    def batch(values):
        return loop.changed({"controller.b": np.array(values)})

    drift = batch([10.0, 20.0]).drift()
    assert drift.constant
    looked_for = []
    twins = of_loops.Loops.twins
    monkeypatch.setattr(of_loops.Loops, "twins", lambda *given: looked_for.append(1) or twins(*given))
    assert batch([30.0, 45.0]).drift() is drift
    assert not looked_for
    batch([-3.0, 45.0]).drift()
    batch([30.0, 30.0]).drift()
    assert len(looked_for) == 2


def test_numbers_of_several_axes_are_remembered():
    """As those of a loop with a dead time are, which are followed two at a time."""
    numbers = {"K": np.ones((2, 1)), "B": np.arange(2.0), "tau": 0.5}
    items = items_of(numbers)
    assert len({items, items_of(dict(numbers))}) == 1
    assert np.array(dict(items)["K"]).shape == (2, 1)
