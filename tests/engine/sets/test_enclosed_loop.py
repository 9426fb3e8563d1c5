"""Ticks of loops over cells: every kind of block, held against the ticks in doubles at places of the cell."""

from pathlib import Path

import numpy as np
import pytest

from wavesweep.engine._drawing.drawing import name_of
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._sets.enclosed_loop import EnclosedLoop, Side
from wavesweep.engine._sets.taylor_models import UnresolvedError
from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

SPECS = sorted(
    path
    for folder in ("recipes", "templates", "examples", "for-all", "paper")
    for path in (Path(__file__).parents[3] / "sweeps" / folder).glob("*.toml")
)
NUMBERS = 3  # that vary in a spec
WIDE = 0.02  # share of a number, to both sides


def varied(drawing, values):
    """Some numbers that the loop reads, apart from those that decide how it is built."""
    building = {name_of(path) for path in drawing.building} | drawing.timing | drawing.shaping
    found = []
    for path in sorted(drawing.reads):
        value = values.get(path)
        if name_of(path) not in building and isinstance(value, float) and value:
            found.append(path)
    return found[:: max(1, len(found) // NUMBERS)][:NUMBERS]


def enclosed(path, order=4, wide=WIDE):
    """The ticks of a spec's loop, those in doubles as a function of places, and the places at which these are compared."""
    loop = own_loop(load(path))
    drawing, values = loop.drawing, dict(loop.values)
    paths = varied(drawing, values)
    centre = np.array([values[path] for path in paths])
    half = wide * np.abs(centre)
    middle = Loops(drawing, values).drawn()
    running, kind = middle.schedule()
    places = [int(np.argmax(kind == index)) for index in range(len(running))]
    loop = EnclosedLoop(drawing, values, [Side(path) for path in paths], order)
    ticks = []
    while not ticks:
        try:
            model = loop.over(np.stack([centre - half, centre + half]))
            ticks = [model.tick(middle, place, middle.held()) for place in places]
        except UnresolvedError:
            half = half / 2
            assert half.max() > 1e-3 * wide * np.abs(centre).max()

    def at(s):
        numbers = dict(zip(paths, (centre + half * s).tolist(), strict=True))
        return [block.E for block in Ticks.of(Loops(drawing, values | numbers).drawn(), alone=True).maps]

    return ticks, at, np.random.default_rng(0).uniform(-1, 1, (4, len(paths)))


def missed(ticks, at, s):
    """By how much the rest of an entry is too small at a place; ticks in doubles are known to some roundings."""
    worst = -np.inf
    for model, exact in zip(ticks, at(s), strict=True):
        value = np.tensordot((s**model.exponents).prod(1), model.terms, 1)
        worst = max(worst, (np.abs(value - exact) - model.rest - 1e-13 * (1 + np.abs(exact))).max(initial=-np.inf))
    return worst


@pytest.mark.whole
@pytest.mark.parametrize("path", SPECS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_ticks_over_a_cell_enclose_those_of_all_its_numbers(path):
    ticks, at, places = enclosed(path)
    for s in [*places, np.ones(places.shape[1]), -np.ones(places.shape[1])]:
        assert missed(ticks, at, s) <= 0
