"""What a slice of a sweep gets is what it gets alone: the ends of its intervals do not depend on what else is swept."""

import tomllib
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from wavesweep.engine._search import interval_search
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

RECIPES = sorted((Path(__file__).parents[3] / "sweeps" / "recipes").rglob("*.toml"))
RING = """
[rates]
tick_hz = 100
[numbers]
h = 1.2
n = 5
[type.car]
block.engine = { type = "tf", num = [1], den = [0.3, 1] }
block.speed = { type = "tf", num = [1], den = [1, 0] }
block.place = { type = "tf", num = [1], den = [1, 0] }
block.radar = { type = "hold", every = "n" }
block.late = { type = "delay", seconds = 0.2 }
wire."radar.u" = "(v_ahead - speed.y + 0.5*(x_ahead - place.y - h*speed.y))/h"
wire."late.u" = "radar.y"
wire."engine.u" = "late.y"
wire."speed.u" = "engine.y"
wire."place.u" = "speed.y"
ports = { inputs = ["x_ahead", "v_ahead"], outputs = { x = "place.y", v = "speed.y" } }
[block]
a.type = "car"
b.type = "car"
[wire]
"a.x_ahead" = "b.x"
"a.v_ahead" = "b.v"
"b.x_ahead" = "a.x"
"b.v_ahead" = "a.v"
[sweep]
along = "h"
h = { start = 0.05, stop = 3 }
n = [1, 5, 10]
"""


def rows(tables, **swept):
    """The rows of a sweep over these values, all others being those of the spec."""
    sweep = {name: values for name, values in tables["sweep"].items() if name not in swept}
    return intervals(load({**tables, "sweep": sweep | swept}), jobs=1).columns


def differences(tables, parts):
    """The slices that differ from what they are alone; parts: numbers between 0 and 1 that pick them, all if there are none."""
    whole = rows(tables)
    axes = {axis.name: axis.values for axis in load(tables).sweep if axis.values}
    slices, found = [dict(zip(axes, values, strict=True)) for values in product(*axes.values())], []
    for one in [slices[int(part * len(slices))] for part in parts] or slices:
        alone = rows(tables, **{name: [value] for name, value in one.items()})
        own = np.logical_and.reduce([whole[name] == value for name, value in one.items()])
        for name, column in alone.items():
            if column.dtype.kind == "f":
                same = own.sum() == column.size and np.allclose(whole[name][own], column, 1e-9, 1e-12, equal_nan=True)
            else:
                same = whole[name][own].tolist() == column.tolist()
            if not same and name not in ("residual", "low_residual", "high_residual"):
                found.append((one, name, whole[name][own], column))
    return found


@pytest.mark.whole
@pytest.mark.slow
@pytest.mark.parametrize("name", ["admittance", "pmw"])
def test_slices_of_recipes_are_what_they_are_alone(name):
    (path,) = (each for each in RECIPES if each.stem == name)
    assert not differences(tomllib.loads(path.read_text()), (0.0, 0.55, 0.999))


@pytest.mark.slow
def test_a_rate_that_every_tick_belongs_to_does_not_change_the_other_slices():
    """With n = 1 no tick can be divided out; with n = 10 the dead time has two states and not twenty."""
    assert not differences(tomllib.loads(RING), ())


PMW = {"controller": {"kind": "pmw"}, "environment": {"integration": "explicit"}}
K_VE = {"start": 0, "stop": 4000}


def failing_at(function, path, value, error):
    """The function, but it raises the error for loops among which this value is."""

    def failing(question, slices, *rest, **named):
        if np.any(np.asarray(slices.loops.values[path]) == value):
            raise error
        return function(question, slices, *rest, **named)

    return failing


def test_an_error_that_is_none_of_numerics_shows(monkeypatch):
    failing = failing_at(interval_search.intervals_of, "controller.b", 20.0, IndexError("0"))
    monkeypatch.setattr(interval_search, "intervals_of", failing)
    with pytest.raises(IndexError):
        rows(PMW | {"sweep": {"K_VE": K_VE, "b": [20.0]}})


@pytest.mark.slow
@pytest.mark.parametrize("error", [np.linalg.LinAlgError("singular"), FloatingPointError("overflow")])
def test_a_slice_whose_search_fails_is_in_doubt_and_ends_none_of_the_others(monkeypatch, error):
    tables = PMW | {"sweep": {"K_VE": K_VE, "b": [5.0, 10.0, 20.0, 40.0, 80.0], "device.mass": [0.1, 0.2]}}
    right = rows(tables)
    monkeypatch.setattr(interval_search, "intervals_of", failing_at(interval_search.intervals_of, "controller.b", 20.0, error))
    with pytest.warns(RuntimeWarning, match=type(error).__name__):
        found = rows(tables)
    failed = found["b"] == 20
    assert found["doubt"][failed].tolist() == ["search"] * 2
    assert found["intervals"][failed].tolist() == [0, 0]
    assert (found["open_low"][failed].tolist(), found["open_high"][failed].tolist()) == ([0, 0], [4000, 4000])
    assert not found["certified"][failed].any()
    for name in ("b", "device.mass", "low", "high", "certified"):
        np.testing.assert_allclose(found[name][~failed], right[name][right["b"] != 20], rtol=1e-9)
