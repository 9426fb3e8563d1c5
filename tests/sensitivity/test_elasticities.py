"""Elasticities of limits against differences in 50 digits, against limits computed again, and against closed forms."""

import tomllib

import numpy as np
import pytest
from meaning.reading import radius_of, with_numbers
from scipy.optimize import brentq
from support.drawn import CORNER, JOINT, NETWORK, PD, random_tables
from support.specs import nested, random_values

import wavesweep
from wavesweep.program.spec import load

# Powers of kg and of 1/s in the unit of each number.
MASS = {"device.mass": 1, "device.damping": 1, "operator.mass": 1, "operator.damping": 1, "operator.stiffness": 1}
MASS |= {"B_VE": 1, "b": 1, "K_LM": 1, "B_LM": 1, "Kp": 0.5}
RATE = {"rates.fast_hz": 1, "device.damping": 1, "operator.damping": 1, "operator.stiffness": 2, "B_VE": 1, "b": 1}
RATE |= {"K_LM": 2, "B_LM": 1, "Kp": 1.5} | {f"filters.{name}.cutoff_hz": 1 for name in ("lp1", "hp", "lp2")}


def dimension(rows, powers):
    """The sum of elasticities times powers of a unit, which is the power of the unit in the limit (Euler)."""
    known = rows.set_index("number").elasticity
    return sum(power * known.get(number, 0.0) for number, power in powers.items())


IN_DOUBT = (9, 14)  # seeds of loops that are not certified


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", [*range(12), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(12, 150))])
def test_units_decide_sums_of_elasticities(seed):
    """A stiffness has the unit kg/s^2, so it is homogeneous in all numbers: no formula is shared with the derivatives."""
    table = wavesweep.compile(nested(random_values(seed))).sensitivity()
    if seed in IN_DOUBT:
        assert not table.certified.all()
        return
    some = table[table.limit_value != 0]
    assert some.certified.all()
    for (*_, quantity), rows in some.groupby(["interval", "side", "crossing", "quantity"]):
        off = 1e-9 if quantity == "end" else 1e-7  # what is felt is differentiated by real steps
        assert dimension(rows, MASS) == pytest.approx(1, abs=off)
        assert dimension(rows, RATE) == pytest.approx(2, abs=off)
        assert rows.damping_ratio.iloc[0] > 0  # beside the end the loop is stable


STEPS = (1e-4, -1e-4, 2e-4, -2e-4)  # of a number; both pairs together are good to the fourth power


def compare(tables, along, span):
    """The number of derivatives, all of which agree with limits computed again."""
    loop = wavesweep.compile(tables)
    table, limits = loop.sensitivity(along, span), loop.stable_intervals(along, span)
    rows = table[table.certified & (table.value != 0) & (table.number != "rates.fast_hz") & ~table.corner]
    compared = 0
    for number, some in rows.groupby("number"):
        value = some["value"].iloc[0]
        moved = [loop.stable_intervals(along, span, **{number: value * (1 + step)}) for step in STEPS]
        if any(len(each) != len(limits) for each in moved):
            continue
        for row in some.itertuples():
            name = row.side if row.quantity == "end" else f"felt_{row.side}"
            up, down, twice_up, twice_down = (each[name].iloc[row.interval] for each in moved)
            slope = (8 * (up - down) - (twice_up - twice_down)) / (12e-4 * value)
            scale = max(abs(row.slope), abs(row.limit_value / value), 1e-6)
            assert abs(slope - row.slope) < 2e-6 * scale, (number, row)
            compared += 1
    return compared


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 12))])
def test_limits_of_random_specs_computed_again(seed):
    along, span = [("K_VE", (0, 20000)), ("b", (1, 200)), ("device.mass", (0.01, 5))][seed % 3]
    values = random_values(seed, ["pmw", "pmw-lm", "dc-lm", "dc-slow"][seed % 4] if along != "b" else "pmw-lm")
    assert compare(nested(values), along, span) > 10


def of(table, end, *names):
    rows = table[(table.side == end) & (table.quantity == "end")].set_index("number")
    return rows.elasticity[list(names)].tolist()


def test_closed_forms():
    """PD held over T: kp T/2 < kd < 2 m/T. Semi-implicit Euler: kp < (4 I + 2 h kd)/h^2."""
    table = wavesweep.compile(tomllib.loads(PD)).sensitivity("kd", (0.01, 2000))
    assert of(table, "high", "m", "rates.tick_hz", "kp") == pytest.approx([1, 1, 0], abs=1e-12)
    assert of(table, "low", "m", "rates.tick_hz", "kp") == pytest.approx([0, -1, 1], abs=1e-9)
    assert table[table.number == "m"].slope.iloc[-1] == pytest.approx(2000)
    table = wavesweep.compile(tomllib.loads(JOINT)).sensitivity()
    share = 0.8 / (0.8 + 2e-3 * 3)
    assert of(table, "high", "I", "kd", "h") == pytest.approx([share, 1 - share, -2 + 1 - share], rel=1e-9)
    table = wavesweep.compile(tomllib.loads(NETWORK)).sensitivity()
    assert set(table.number) == {"d", "rates.tick_hz"}  # not k, a number of ticks
    assert of(table, "high", "d", "rates.tick_hz") == pytest.approx([1, 1])


@pytest.mark.parametrize(("apart", "corner"), [(1e-8, True), (-1e-8, True), (1e-5, False)])
def test_a_corner_has_rows_for_both_crossings(apart, corner):
    """Two loops that share a gain: k < 2 m1/T, and k < 2 sin(pi/10) m2/T with two ticks of delay."""
    limit = 2 * np.sin(np.pi / 10) * 0.2 * 1000
    text = CORNER.format(m1=float(limit / 2000 * (1 + apart)))
    table = wavesweep.compile(tomllib.loads(text)).sensitivity("k", (0.001, 1000))
    assert table.certified.all()
    assert table.corner.tolist() == [corner] * (6 if corner else 3)
    first = table[table.crossing == 0].set_index("number").elasticity
    assert [first["m1"], first["m2"]] == pytest.approx([0, 1] if apart > 0 else [1, 0], abs=1e-9)
    if corner:
        second = table[table.crossing == 1].set_index("number").elasticity
        assert [second["m1"], second["m2"]] == pytest.approx([1, 0] if apart > 0 else [0, 1], abs=1e-9)


def test_a_row_that_is_not_certified_has_a_doubt_and_no_numbers():
    limit = 2 * np.sin(np.pi / 10) * 0.2 * 1000
    spec = load(tomllib.loads(CORNER.format(m1=float(limit / 2000)) + "[sweep]\nk = { start = 0.001, stop = 1000 }\n"))
    table = wavesweep.why(spec)  # both crossings at the same value, each of a loop of its own
    assert table.attrs["facts"]["doubts"] == {}
    assert table.certified.all()
    assert table.corner.all()
    slopes = table.pivot_table(index="crossing", columns="number", values="elasticity")
    assert slopes[["m1", "m2"]].to_numpy() == pytest.approx(np.eye(2), abs=1e-9)
    table = wavesweep.compile(random_tables(9)).sensitivity("k", (0.0, 200.0))
    assert set(table.doubt) == {"defective"}  # two eigenvalues meet at z = 1 where the gain is 0
    assert table[["elasticity", "slope", "damping_ratio"]].isna().all(axis=None)


def test_a_range_without_a_limit_has_no_rows():
    table = wavesweep.compile({"controller": {"kind": "dc"}}).sensitivity("device.mass", (0.5, 1.0))
    assert len(table) == 0
    assert table.columns[0] == "along"


@pytest.mark.parametrize("rates", [{"ratio": 5}, {"slow_hz": 200.0}])
def test_derivatives_are_along_what_the_spec_keeps(rates):
    """One per cent more of a number is one per cent more of the key that the spec has, with all its other keys as they are."""
    tables = {
        "controller": {"kind": "pmw", "b": 9.0},
        "rates": {"fast_hz": 1000.0, **rates},
        "environment": {"integration": "explicit"},
    }
    step = 1e-5

    def high(changes):
        return wavesweep.compile(load(tables).with_values(changes)).stable_intervals("K_VE", (0, 20_000)).high.iloc[0]

    rows = wavesweep.compile(tables).sensitivity("K_VE", (0, 20_000))
    rows = rows[(rows.side == "high") & (rows.quantity == "end") & rows.certified & (rows.value != 0)]
    assert ("rates.fast_hz" in rows.number.tolist()) == ("ratio" in rates)
    for number, value, given in zip(rows.number, rows.value, rows.elasticity, strict=True):
        up, down = (high({number: value * (1 + sign * step)}) for sign in (1, -1))
        assert given == pytest.approx((up - down) / (2 * step * rows.limit_value.iloc[0]), rel=1e-4, abs=1e-6), number


def with_dead_times(lag, **sensor):
    """1/(s + 1) under a held gain k at 10 Hz; a dead time behind the hold, and perhaps one that reads the plant."""
    tables = {
        "rates": {"tick_hz": 10.0},
        "numbers": {"k": 3.0, "lag": lag, **sensor},
        "block": {
            "plant": {"type": "tf", "num": [1], "den": [1, 1]},
            "h": {"type": "hold"},
            "dead": {"type": "delay", "seconds": "lag"},
        },
        "wire": {"h.u": "-k*plant.y", "dead.u": "h.y", "plant.u": "dead.y"},
    }
    if sensor:
        tables["block"]["eye"] = {"type": "delay", "seconds": "sensor"}
        tables["wire"] |= {"eye.u": "plant.y", "h.u": "-k*eye.y"}
    return tables


def largest_gain(lag, hz):
    """The end of k by the documents' own reading."""
    tables = with_dead_times(lag) | {"rates": {"tick_hz": hz}}
    return brentq(lambda k: radius_of(with_numbers(tables, {"k": k}), 0) - 1, 0.5, 100.0, xtol=1e-13, rtol=1e-14)


def one_sided(end, value, sign):
    """The elasticity of an end on one side of a number, to the second order of a step."""
    step = sign * 1e-4
    near, far, here = end(value * (1 + step)), end(value * (1 + 2 * step)), end(value)
    return (4 * near - far - 3 * here) / (2 * step * here)


@pytest.mark.parametrize(("ticks", "grows"), [(1, 0.0905), (2, -0.1796), (1.5, -0.8205)])
def test_at_whole_ticks_of_a_dead_time_an_end_moves_otherwise_up_than_down(ticks, grows):
    """Against the eigenvalues of a march of this loop, with a kink in both the dead time and the rate of the ticks."""
    rows = wavesweep.compile(with_dead_times(ticks / 10)).sensitivity("k", (0, 40)).set_index("number")
    assert rows.certified.all()
    assert rows.elasticity["lag"] == pytest.approx(grows, abs=1e-4)
    for number, value, end in (
        ("lag", ticks / 10, lambda lag: largest_gain(lag, 10.0)),
        ("rates.tick_hz", 10.0, lambda hz: largest_gain(ticks / 10, hz)),
    ):
        for column, sign in (("elasticity", 1), ("elasticity_down", -1)):
            assert rows[column][number] == pytest.approx(one_sided(end, value, sign), abs=1e-5)
    for side in ("", "_down"):
        moved = rows["elasticity" + side] * rows.limit_value
        assert (rows["slope" + side] * rows.value).tolist() == pytest.approx(moved.tolist())


@pytest.mark.parametrize(("ticks", "ups", "downs"), [(2, [-1], [1]), (1, [-1, 1, None], [0, 0, None])])
def test_along_a_dead_time_an_end_at_a_whole_tick_moves_as_the_loop_on_the_side_it_moves_to(ticks, ups, downs):
    """Two intervals meet at one tick: a gain that falls joins them, so their ends have no derivative for it."""
    tables = with_dead_times(0.25)
    tables["numbers"]["k"] = largest_gain(ticks / 10, 10.0)
    rows = wavesweep.compile(tables).sensitivity("lag", (0, 2)).set_index("number").loc[["k"]]
    assert len(rows) == len(ups)
    for column, sides in (("elasticity", ups), ("elasticity_down", downs)):
        for found, side in zip(rows[column], sides, strict=True):
            if side == 0:
                assert np.isnan(found)
            elif side:
                by_lag = one_sided(lambda lag: largest_gain(lag, 10.0), ticks / 10, side)
                assert found == pytest.approx(1 / by_lag, rel=1e-4)


@pytest.mark.slow
def test_along_a_dead_time_every_part_of_the_range_has_the_derivatives_of_its_loop():
    """The end is in the seventh tick, the spec's own dead time in the third. Along the end `largest_gain(lag, hz) = k`, so in
    logarithms d lag/d k = 1/(d gain/d lag), and d lag/d hz = -(d gain/d hz)/(d gain/d lag)."""
    rows = wavesweep.compile(with_dead_times(0.25)).sensitivity("lag", (0, 2)).set_index("number")
    end = rows.limit_value.iloc[0]
    assert largest_gain(end, 10.0) == pytest.approx(3.0)
    by_lag = one_sided(lambda lag: largest_gain(lag, 10.0), end, 1)
    by_rate = one_sided(lambda hz: largest_gain(end, hz), 10.0, 1)
    assert rows.certified.all()
    assert rows.elasticity["k"] == pytest.approx(1 / by_lag, abs=1e-5)
    assert rows.elasticity["rates.tick_hz"] == pytest.approx(-by_rate / by_lag, abs=1e-5)
    assert rows.elasticity.tolist() == rows.elasticity_down.tolist()
    assert 0 < rows.damping_ratio.iloc[0] < 0.1  # just inside the end


def test_what_is_felt_has_derivatives_also_beside_an_end_at_0():
    """From which they step by less than any number of a spec."""
    rows = wavesweep.compile({"controller": {"kind": "pmw"}, "environment": {"integration": "explicit"}}).sensitivity()
    felt = rows[(rows.quantity == "felt") & (rows.side == "high")]
    assert len(felt)
    assert (felt.doubt == "").all()


def test_just_inside_an_end_at_0_a_mode_has_the_damping_of_a_pole_next_to_it():
    """k beside m s^2 + d s has two real poles up to d^2/(4 m) = 1."""
    mass = {"type": "mass", "mass": 1, "damping": 2}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"k": 10.0}, "block": {"m": mass}, "wire": {"m.f": "-k*m.x"}}
    rows = wavesweep.compile(tables | {"sweep": {"along": "k", "k": {"start": 0, "stop": 400}}}).sensitivity()
    assert rows[rows.side == "low"].damping_ratio.tolist() == pytest.approx([1.0] * (rows.side == "low").sum())
