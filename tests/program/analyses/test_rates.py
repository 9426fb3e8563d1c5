"""The rate of a drawn loop as an axis: of intervals, and of slices that are one batch."""

from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

RECIPES = Path(__file__).parents[3] / "sweeps" / "recipes"
I, STEPS = 0.025101925, np.linspace(0.002, 0.008, 25)


def test_slices_of_several_rates_are_one_batch_and_have_the_bits_of_each_alone(monkeypatch):
    joint, sizes, drawn = wavesweep.compile(RECIPES / "physics-joint.toml"), [], Loops.drawn

    def watched(loops, *without):
        if without:
            sizes.append(max(np.size(value) for value in loops.values.values()))
        return drawn(loops, *without)

    monkeypatch.setattr(Loops, "drawn", watched)
    table = joint.stable_intervals("kp", (0, 50000), h=STEPS)
    assert sizes[-1] == STEPS.size
    assert len([size for size in sizes if size > 2]) == 1  # the one of two tells what a slice costs
    assert table.high.to_numpy() == pytest.approx(np.minimum((4 * I + 2 * STEPS * 6.3088) / STEPS**2, 50000), rel=1e-12)
    for row in table.iloc[::8].itertuples():
        alone = wavesweep.compile(load(joint.spec.tables(), [f"h={row.h!r}"])).stable_intervals("kp", (0, 50000))
        assert [row.low, row.high] == [alone.low[0], alone.high[0]]


@pytest.mark.parametrize(
    ("recipe", "along", "span", "axes", "said"),
    [
        ("physics-joint", "h", (0, 0.05), {}, "finite number"),
        ("physics-joint", "h", (-1, 0.05), {}, "a number > 0"),
        ("physics-joint", "kp", (0, 5000), {"h": [0.005, -0.1]}, "a number > 0"),
        ("controllers/pmw", "rates.tick_hz", (10, 3000), {}, "half the block's own rate"),
        ("controllers/pmw", "K", (0, 3000), {"rates.tick_hz": [1000.0, 15.0]}, "half the block's own rate"),
    ],
)
def test_rates_that_make_no_loop_are_refused(recipe, along, span, axes, said):
    with pytest.raises(SpecError, match=said):
        wavesweep.compile(RECIPES / f"{recipe}.toml").stable_intervals(along, span, **axes)


def test_beyond_its_range_a_rate_goes_half_way_to_where_a_loop_ends():
    spec = load({"controller": {"kind": "pmw-lm"}, "filters": {"lp1": {"cutoff_hz": 200.0}}})
    loop = own_loop(spec, "rates.fast_hz")
    assert loop.domain("rates.fast_hz", (500.0, 3000.0))[0] == pytest.approx(450.0, rel=0.01)
    tables = {"rates": {"tick_hz": "1000-20*q"}, "numbers": {"q": 5.0}, "block": {"m": {"type": "mass", "mass": 0.1}}}
    spec = load(tables | {"wire": {"m.f": "-m.x - m.v"}})
    assert Loops(spec.drawing, spec.values).domain("numbers.q", (0.0, 40.0))[1] == pytest.approx(45.0, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "own", "K"),
    [("dc", {}, 4000.0), ("dc-slow", {}, 1500.0), ("pmw-lm", {"b": 25.0, "Kp": 20.0}, 4000.0)],
)
def test_the_fast_rate_of_a_controller_has_the_intervals_of_its_drawing(kind, own, K):
    """Those of the waves with a local model have an island at low rates."""
    drawn, span = wavesweep.compile(RECIPES / "controllers" / f"{kind}.toml"), (300.0, 6000.0)
    loop = wavesweep.compile({"controller": {"kind": kind, **own}})
    B = drawn.spec.values["numbers.B"]
    mine, same = (
        loop.stable_intervals("rates.fast_hz", span, K_VE=K, B_VE=B),
        drawn.stable_intervals("rates.tick_hz", span, K=K),
    )
    assert mine.certified.all()
    assert len(mine) == 1 + (kind == "pmw-lm")
    for name in ("low", "high", "low_omega", "high_omega"):
        assert mine[name].to_numpy() == pytest.approx(same[name].to_numpy(), rel=1e-10, nan_ok=True)
    inner = [end for end in (*mine.low, *mine.high) if end not in span]
    radius = loop.spectral_radius(K_VE=K, B_VE=B, **{"rates.fast_hz": inner})
    assert radius == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize(
    ("rates", "start", "said"),
    [
        ({"slow_hz": 50.0}, 300.0, "give rates.ratio"),
        ({}, 15.0, "half of rates.fast_hz"),
        ({}, 0.0, "a number > 0"),
    ],
)
def test_ranges_of_a_fast_rate_that_make_no_loop_are_refused(rates, start, said):
    axis = {"along": "rates.fast_hz", "rates.fast_hz": {"start": start, "stop": 6000.0}}
    with pytest.raises((SpecError, UsageError), match=said):
        wavesweep.stability_region({"controller": {"kind": "pmw-lm"}, "rates": rates, "sweep": axis})
