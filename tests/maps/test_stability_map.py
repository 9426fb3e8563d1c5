"""Planes in parts: every part against spectral radii, the shares, the rectangle, and what is refused."""

import json

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.maps.rectangle import largest_about
from wavesweep.maps.stability_map import stability_map
from wavesweep.maps.table import KINDS

DRIVE = {
    "rates": {"tick_hz": 500.0},
    "numbers": {"k": {"value": 100.0}, "K": {"value": 20.0}, "T": {"value": 0.5}},
    "block": {
        "load": {"type": "mass", "mass": 10.0},
        "slow": {"type": "gain", "k": "K", "every": 5},
        "integral": {"type": "integrator", "method": "implicit"},
    },
    "wire": {
        "slow.u": "-load.x",
        "integral.u": "slow.y - load.v",
        "load.f": "k*(slow.y - load.v + integral.y/T)",
    },
    "sweep": {
        "along": "k",
        "k": {"start": 5.0, "stop": 8000.0, "scale": "log"},
        "K": {"start": 1.0, "stop": 400.0, "scale": "log"},
    },
}


def _held(spec, names, wanted, points=40):
    """A map, each of whose proved parts is held against radii at points of it and at its corners."""
    table = stability_map(spec, names, wanted)
    columns = table.columns
    places = ("first", "second", "third")[: len(names)]
    low, high = (np.stack([columns[f"{place}_{end}"] for place in places], -1) for end in ("low", "high"))
    rng = np.random.default_rng(0)
    compiled = wavesweep.compile(spec)
    proved = np.flatnonzero(columns["proved"] != "open")
    for row in rng.choice(proved, points):
        point = low[row] + rng.choice([0.0, rng.uniform(), 1.0], len(names)) * (high - low)[row]
        own = compiled.with_(**dict(zip(names, point.tolist(), strict=True)))
        assert (float(own.spectral_radius()) < 1) == (columns["outside"][row] == 0), point
    assert columns["share"].sum() == pytest.approx(1, abs=1e-9)
    assert columns["share"][columns["proved"] == "open"].sum() <= wanted
    return table


def test_what_is_proved_of_a_part_holds_at_its_points():
    table = _held(wavesweep.load(DRIVE), ["k", "K"], 0.2)
    assert {"stable", "unstable", "open"} == {*table.columns["proved"]}
    again = KINDS[0].again(table.facts, str)
    assert (next(iter(again.all_blocks()))["share"] == table.columns["share"]).all()
    numbers = KINDS[0].tally(table)
    numbers.add(table.columns)
    found = numbers.numbers(table.facts)
    json.dumps(found)
    assert {*found["outside"]} == {"1", "2"}
    lines = [line for line, _ in KINDS[0].lines(found)]
    assert lines[0].startswith("k by K: ")
    # the rectangle has the own design, and nothing but stable parts
    about = np.array(found["about"])
    assert (about[0] < [100, 20]).all()
    assert (about[1] > [100, 20]).all()
    columns = table.columns
    low, high = (np.stack([columns[f"{place}_{end}"] for place in ("first", "second")], -1) for end in ("low", "high"))
    meets = ((low < about[1] * (1 - 1e-9)) & (high > about[0] * (1 + 1e-9))).all(-1)
    assert {*columns["proved"][meets]} == {"stable"}


@pytest.mark.slow
def test_maps_of_a_wall_and_of_three_numbers_hold_at_their_points():
    haptic = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 5000}, "b": {"start": 5, "stop": 100}}}
    _held(wavesweep.load(haptic), ["K_VE", "b"], 0.05, 200)
    _held(wavesweep.load(DRIVE), ["k", "K", "T"], 0.3, 200)
    # modes as far outside as 1e9
    clocked = DRIVE | {
        "rates": {"tick_hz": "1/h"},
        "numbers": DRIVE["numbers"] | {"h": {"value": 0.002}},
        "sweep": {"along": "k", "k": {"start": 0.1, "stop": 20000.0}, "h": {"start": 0.002, "stop": 0.03}},
    }
    _held(wavesweep.load(clocked), ["k", "h"], 0.1, 200)
    # elsewhere with an offset and on scales that are not logarithmic
    offset = DRIVE | {"sweep": {"along": "k", "k": {"start": -5.0, "stop": 900.0}, "K": {"start": 0.0, "stop": 400.0}}}
    _held(wavesweep.load(offset), ["k", "K"], 0.1, 200)


def test_a_map_of_a_block_that_nothing_drives_is_that_of_its_matrix():
    block = {"type": "ss", "A": [["a", "b"], ["-b", "a"]], "inputs": [], "B": [[], []], "C": [[1, 0]]}
    sweep = {"along": "a", "a": {"start": -2.0, "stop": 1.0}, "b": {"start": 0.0, "stop": 2.0}}
    tables = {"rates": {"tick_hz": 10.0}, "numbers": {"a": 0.3, "b": 0.2}, "block": {"x": block}, "sweep": sweep}
    columns = stability_map(wavesweep.load(tables), ["a", "b"], 0.02).columns
    assert {*columns["proved"]} == {"stable", "unstable", "open"}
    assert (columns["first_high"][columns["proved"] == "stable"] <= 0).all()
    assert (columns["first_low"][columns["proved"] == "unstable"] >= 0).all()


def test_the_largest_rectangle_about_a_point_is_that_of_all_tries():
    rng = np.random.default_rng(3)
    whole = np.array([[0.0, 0.0], [6.0, 6.0]])
    for _ in range(10):
        corners = rng.integers(0, 6, (6, 2))
        obstacles = np.stack([corners, corners + 1], 1).astype(float)
        point = rng.integers(0, 6, 2) + 0.5
        on_floor = np.array([[point - 0.5, point + 0.5]]) * [1, 0] + [[0, 0], [0, 1]]  # under which no room is left
        assert largest_about(point * [1, 0], whole, np.concatenate([obstacles, on_floor])) is None
        inside = ((obstacles[:, 0] < point) & (point < obstacles[:, 1])).all(-1).any()
        found = largest_about(point, whole, obstacles)
        assert (found is None) == inside
        best = 0.0
        ticks = np.arange(7.0)
        for low in np.stack(np.meshgrid(ticks, ticks), -1).reshape(-1, 2):
            for high in np.stack(np.meshgrid(ticks, ticks), -1).reshape(-1, 2):
                if (low < point).all() and (point < high).all():
                    met = ((obstacles[:, 0] < high) & (obstacles[:, 1] > low)).all(-1).any()
                    best = max(best, 0.0 if met else float((high - low).prod()))
        if found is not None:
            assert (found[1] - found[0]).prod() == pytest.approx(best)


@pytest.mark.parametrize(
    ("names", "more", "said"),
    [
        (["k"], {}, "expected two or three numbers"),
        (["k", "k"], {}, "expected two or three numbers"),
        (["k", "block.slow.every"], {}, "decides how it is built"),
        (["k", "K"], {"sweep": DRIVE["sweep"] | {"require": {"radius": 0.9}}}, "stability-region --map"),
    ],
)
def test_what_has_no_map_is_refused(names, more, said):
    with pytest.raises(UsageError, match=said):
        stability_map(wavesweep.load(DRIVE | more), names)
