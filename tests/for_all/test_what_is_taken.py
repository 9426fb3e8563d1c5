"""What [for_all] says of the rates and of delays is taken exactly, or refused."""

import pytest

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.for_all.rows import ForAllGuarantee
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.claims import asked_scope, own_scope
from wavesweep.program.spec import load

WALL = {
    "environment": {"integration": "explicit", "delay": 1},
    "device": {"velocity": "difference"},
    "controller": {"kind": "dc-slow"},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [1]},
}
EDGES = {"passband_hz": 8, "stopband_hz": 60, "passband_db": 3, "stopband_db": 20}


@pytest.mark.parametrize(
    ("tables", "ranges", "said"),
    [
        ({}, {"rates.slow_hz": {"values": [50, 25]}}, r"for_all.rates.slow_hz: expected rates.ratio = \{ values"),
        (
            {"rates": {"slow_hz": 50}},
            {"rates.fast_hz": {"values": [1000, 2000]}},
            "beside several fast rates a ratio .*, found rates.slow_hz",
        ),
        (
            {"controller": {"kind": "pmw"}, "filters": {"lp1": EDGES}},
            {"rates.fast_hz": {"values": [1000, 2000]}},
            "filters by order and cutoff_hz, found filters.lp1.passband_hz",
        ),
        (
            {"environment": {"delay": 15}},
            {"rates.ratio": {"values": [10, 20]}},
            r"for_all.rates.ratio: expected frames of at least 15 ticks \(environment.delay\), found 10",
        ),
    ],
)
def test_numbers_from_which_others_follow_are_refused(tables, ranges, said):
    with pytest.raises(SpecError, match=said):
        load(WALL | tables | {"for_all": ranges})


@pytest.mark.slow
@pytest.mark.parametrize("lost", [0, 1])
def test_delays_of_the_table_take_the_place_of_the_next_frame(lost):
    rows = []
    for delay in (1, "frame"):
        own = WALL | {"rates": {"ratio": 4}, "environment": WALL["environment"] | {"delay": delay}}
        spec = load(own | {"for_all": {"environment.delay": {"values": [2]}, "lost": lost}})
        table = wavesweep.compile(spec).stable_intervals()
        rows.append(table[table.guarantee == "for_all"][["low", "high", "certified"]].to_numpy())
    assert (rows[0] == rows[1]).all()


DRAWN = {
    "rates": {"tick_hz": 1000},
    "numbers": {"n": 4, "k": 1.0},
    "block": {"x": {"type": "mass", "mass": 1, "damping": 1, "stiffness": 1}, "h": {"type": "hold", "every": "n/2"}},
    "wire": {"x.f": "push - k*h.y", "h.u": "x.x"},
    "ports": {"inputs": {"push": "push"}, "outputs": {"place": "x.x"}},
    "sweep": {"along": "k", "k": {"start": 0, "stop": 2000}},
}


@pytest.mark.parametrize(
    ("changes", "ranges", "said"),
    [
        ({}, {"values": [4, 5]}, "block.h.every: expected a whole number >= 1, found 2.5 with n = 5 of .for_all."),
        ({}, {"start": 4, "stop": 6}, "found 2.5 with n = 5"),
        (
            {"block": DRAWN["block"] | {"h": {"type": "delay", "steps": "n/2"}}},
            {"values": [4, 5]},
            "block.h.steps: expected a whole number >= 0, found 2.5",
        ),
        (
            {"block": DRAWN["block"] | {"h": {"type": "hold", "every": "n*2"}}, "numbers": {"n": 2.5, "k": 1.0}},
            {"start": 2.5, "stop": 3.5},
            "a list of values, .* found the range of n",
        ),
    ],
)
def test_numbers_with_which_no_loop_can_be_built_are_refused_and_not_cut_off(changes, ranges, said):
    spec = load(DRAWN | changes | {"for_all": {"n": ranges}})
    with pytest.raises(UsageError, match=said):
        wavesweep.compile(spec).stable_intervals()


@pytest.mark.parametrize(
    ("tables", "ranges", "said"),
    [
        (
            WALL,
            {"device.mass": {"start": 0.08, "stop": 0.125, "varying": True}},
            "environment.delay as numbers that vary, found device.mass",
        ),
        (
            WALL,
            {"device": {"mass": {"start": 1.08, "stop": 1.125, "varying": True}}},
            "as numbers that vary, found device.mass",
        ),
        (WALL, {"device.mass": {"values": [0.1], "varying": True}}, "as numbers that vary, found device.mass"),
        (
            DRAWN,
            {"k": {"start": 0.8, "stop": 0.9, "varying": True}},
            "one number that varies, which `every` of blocks reads, found k",
        ),
        (DRAWN, {"numbers": {"k": {"values": [0.8, 0.9], "varying": True}}}, "which `every` of blocks reads, found numbers.k"),
    ],
)
def test_a_constant_number_that_varies_is_refused_when_the_spec_is_read(tables, ranges, said):
    """Also one whose range has no whole number, or a single one, within it."""
    with pytest.raises(SpecError, match=said):
        load(tables | {"for_all": ranges, "sweep": {}})


@pytest.mark.parametrize("more", [{}, {"varying": True}])
def test_a_range_whose_ends_are_the_same_is_its_value(more):
    asked = load(
        WALL | {"for_all": {"rates.ratio": {"start": 16, "stop": 16, **more}, "device.mass": {"start": 0.1, "stop": 0.1}}}
    ).for_all
    assert [axis.values for axis in asked.axes] == [(16,), (0.1,)]
    assert asked.changing == ()


@pytest.mark.parametrize("chances", [{"late": "n"}, {"lost": "n"}, {"loss": "n/20"}])
def test_messages_that_follow_from_a_number_of_the_table_are_those_of_each_of_its_values(chances):
    """Not those of the first value, or of the spec's own one, which others exceed."""
    link = {"type": "channel", "every": 5, **chances}
    drawn = DRAWN | {"block": DRAWN["block"] | {"h": link}, "numbers": {"n": 2, "k": 1.0}}
    spec = load(drawn | {"for_all": {"n": {"values": [3, 1]}}})
    asked = asked_scope(spec, at_random="loss" in chances)
    proved = ForAllGuarantee(Rules.of(spec)).scope(spec)
    assert next(iter(chances.values())) in str(proved.messages)
    assert proved.messages == asked.messages
    assert proved.covers(asked, spec.values)
    assert not own_scope(spec).covers(asked, spec.values)
