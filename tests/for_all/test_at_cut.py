"""Margins that all loops of [for_all] keep, held against an own matrix of a frame with a complex factor."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support.margin_cut import N, T, factors_of, largest, tables_with

from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.for_all.on_check import facts
from wavesweep.for_all.rows import cases_of
from wavesweep.for_all.unknown import Part
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.factors_at_cut import with_factors
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals


def spec_of(margins, m, kp):
    return load(tables_with(margins, kp, for_all={"m": m}))


def named(margin, size, text):
    """The member and the factor that a counterexample names."""
    value = dict(re.findall(r"(\w+)(?: at c.y)? = ([-\d.e+]+)", text))
    turn = np.exp(1j * np.radians(float(value[margin])))
    match margin:
        case "gain":
            turn = float(value[margin])
        case "disk":
            turn = (1 + size / 2 * turn) / (1 - size / 2 * turn)
        case "Ms":
            turn = 1 / (1 - turn / size)
    return float(value["m"]), turn


@pytest.mark.slow
@pytest.mark.parametrize(
    ("require", "of_frame"),  # a frame is of N ticks
    [({"radius": 0.998}, 0.998**N), ({"settling": 1.6}, 0.02 ** (N * T / 1.6))],
)
def test_all_modes_are_within_a_radius_for_all_and_one_of_a_refuter_is_not(require, of_frame):
    tables = tables_with({}, (2.0, 900.0), for_all={"m": {"start": 0.9, "stop": 1.1}})
    tables["sweep"]["require"] = require
    rows = intervals(load(tables), jobs=1).columns
    (row,) = np.flatnonzero(rows["guarantee"] == "for_all")
    assert rows["certified"][row]
    assert rows["settled"][row]
    low, high = rows["low"][row], rows["high"][row]
    members = [(each, kp) for each in np.linspace(0.9, 1.1, 5) for kp in np.linspace(low, high, 9)]
    assert max(largest(m, kp, 1.0) for m, kp in members) <= of_frame
    ends = (rows["fails_below"][row], low, 1.0), (rows["fails_from"][row], high, -1.0)
    for (fails, proved, inward), m in zip(ends, (1.1, 0.9), strict=True):
        assert largest(m, fails * (1 - 1e-6 * inward), 1.0) > of_frame > largest(m, fails * (1 + 1e-6 * inward), 1.0)
        assert proved == pytest.approx(fails, rel=0.01)


def case_within(radius, along, span):
    tables = tables_with({}, (2.0, 900.0), for_all={"m": {"start": 0.9, "stop": 1.1}})
    tables["sweep"]["require"] = {"radius": radius}
    spec = load(tables)
    rules = replace(Rules.of(spec), require=spec.require)
    (case,) = cases_of(rules, along, span, Loops(spec.drawing, dict(spec.values)))
    return case


def test_all_of_a_box_is_proved_to_be_within_a_radius_and_not_within_less():
    slowest = max(largest(m, 100.0, 1.0) for m in np.linspace(0.9, 1.1, 9)) ** (1 / N)
    for more, proved in ((1e-4, True), (-1e-4, False)):
        case = case_within(slowest + more, "", (0.0, 0.0))
        assert (case.cover().whole, case.begins_unstable()) == (proved, not proved)


@pytest.mark.slow
def test_a_proof_within_a_radius_ends_where_a_mode_leaves_it():
    """Also where nothing has been looked at before."""
    proved = case_within(0.998, "numbers.kp", (2.0, 900.0)).cover(300.0, 600.0)
    assert not proved.whole
    assert proved.low == 300
    assert largest(0.9, proved.high, 1.0) < 0.998**N < largest(0.9, proved.high * 1.03, 1.0)


def test_a_time_of_modes_is_of_numbers_that_leave_the_rate():
    tables = tables_with({}, (2.0, 900.0), for_all={"rates.tick_hz": {"start": 900, "stop": 1100}})
    tables["sweep"]["require"] = {"settling": 1.6}
    with pytest.raises(UsageError, match="expected numbers beside settling that leave the rate as it is"):
        intervals(load(tables), jobs=1)


@pytest.mark.slow
@pytest.mark.parametrize(("margin", "size"), [("phase_deg", 30.0), ("gain", 2.0), ("disk", 0.5)])
def test_a_proved_value_keeps_the_margin_for_all_and_a_refuter_does_not(margin, size):
    m = {"start": 0.9, "stop": 1.1}
    rows = intervals(spec_of({"cut": "c.y", margin: size}, m, (200.0, 800.0)), jobs=1).columns
    (row,) = np.flatnonzero(rows["guarantee"] == "for_all")
    assert rows["certified"][row]
    assert rows["settled"][row]
    low, high = rows["low"][row], rows["high"][row]
    factors = factors_of(margin, size)
    members = [(each, value) for each in np.linspace(0.9, 1.1, 5) for value in np.linspace(low, high, 7)]
    assert max(largest(each, value, factors) for each, value in members) < 1
    fails_from = rows["fails_from"][row]
    worst, factor = named(margin, size, rows["counterexample"][row])
    assert largest(worst, fails_from * (1 + 1e-9), factor) > 1 > largest(worst, fails_from * (1 - 1e-6), factor)
    assert high >= 0.99 * fails_from
    assert abs(factor) == pytest.approx(1) if margin == "phase_deg" else np.abs(factors - factor).min() < 0.05
    own = rows["guarantee"] == "spec"
    assert high < rows["high"][own].max()


@pytest.mark.slow
def test_each_of_several_margins_at_several_cuts_is_kept():
    """The least of them sets the end, the text says which, and the end of a list is exact."""
    margins = [{"cut": "c.y", "gain": 2.0, "phase_deg": 20.0}, {"cut": "z.y", "phase_deg": 70.0}]
    rows = intervals(spec_of(margins, [0.9, 1.1], (100.0, 800.0)), jobs=1).columns
    (row,) = np.flatnonzero(rows["guarantee"] == "for_all")
    high = rows["high"][row]
    assert rows["counterexample"][row] == "m = 0.9, phase at z.y"
    assert rows["fails_from"][row] == high
    turned = np.exp(1j * np.radians(70))
    assert largest(0.9, high * (1 - 1e-9), turned) < 1 < largest(0.9, high * (1 + 1e-9), turned)
    assert largest(0.9, high, factors_of("gain", 2.0)) < 1


@pytest.mark.slow
def test_an_end_that_the_factor_of_one_margin_sets_is_narrowed_by_those_of_others():
    """Whose members have a factor that the refuter does not name."""
    spec = spec_of({"cut": "c.y", "phase_deg": 60.0, "gain": 2.0}, {"start": 0.9, "stop": 1.1}, (100.0, 800.0))
    rules = replace(Rules.of(spec), require=spec.require)
    cases = cases_of(rules, "numbers.kp", (100.0, 800.0), Loops(spec.drawing, dict(spec.values)))
    part = Part(100.0, 300.0, high_by={"numbers.m": 0.9, "of another margin": 17.5})
    high = min(case.narrowed([part])[0].high for case in cases)
    turned = np.exp(1j * np.radians(60))
    assert largest(0.9, high * (1 - 1e-6), turned) < 1 < largest(0.9, high * (1 + 1e-6), turned)


@pytest.mark.parametrize(
    ("require", "more", "said"),
    [
        (
            {"damping_ratio": 0.1},
            {},
            "expected margins, radius, settling and time_constant alone beside .for_all., found damping_ratio",
        ),
        ({"margins": {"cut": "c.y", "Ms": 2}, "rms": {"from": "push", "to": "x", "at_most": 1}}, {}, "found rms"),
        ({"radius": 0.999}, {"n": {"values": [5, 6], "varying": True}}, "found frames or messages that vary"),
        (
            {"margins": {"cut": "c.y", "Ms": 2}},
            {"n": {"values": [5, 6], "varying": True}},
            "found frames or messages that vary",
        ),
    ],
)
def test_what_cannot_be_held_for_all_is_refused_with_what_can(require, more, said):
    spec = spec_of({"cut": "c.y", "Ms": 2}, [0.9, 1.1], (100.0, 800.0)).tables()
    spec["sweep"]["require"] = require
    spec["numbers"]["n"] = 5
    spec["block"]["c"]["every"] = spec["block"]["z"]["every"] = "n"
    spec["for_all"] |= more
    with pytest.raises(UsageError, match=said):
        intervals(load(spec), jobs=1)


def test_a_circle_is_of_a_signal_that_is_made_once_in_a_frame():
    spec = spec_of({"cut": "c.y", "Ms": 2}, [0.9, 1.1], (100.0, 800.0)).tables()
    spec["block"]["z"]["every"] = 10
    with pytest.raises(UsageError, match=r"margins.Ms: expected a signal that is made once in a frame .* found c.y"):
        intervals(load(spec), jobs=1)


@pytest.mark.parametrize(("K", "sides"), [((0.0, 3.0), 2), ((0.0, 0.0), 1)])
def test_a_circle_is_proved_on_its_rim_alone_where_no_value_of_the_number_brings_the_signal_back_at_once(K, sides):
    """Whatever the number is in the spec."""
    block = {"type": "ss", "inputs": ["u"], "A": [[0.5]], "B": [[1]], "C": [[1]], "D": [[1]]}
    wire = {"p.u": "-K*p.y"}
    loop = load({"rates": {"tick_hz": 1000}, "numbers": {"K": 0.0}, "block": {"p": block}, "wire": wire})
    loops = Loops(loop.drawing, dict(loop.values))
    ((_, found),) = with_factors(loops, {"cut": "p.y", "disk": 0.5}, {"numbers.K": K})
    assert len(found) == sides


@pytest.mark.parametrize(
    ("margin", "size", "kp", "answer"),
    [
        ("phase_deg", 30.0, 300.0, "yes"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (("phase_deg", 30.0, 480.0, "no"), ("Ms", 2.0, 150.0, "yes"), ("Ms", 2.0, 300.0, "no"))
        ),
    ],
)
def test_check_says_whether_the_spec_keeps_the_margin_for_all(margin, size, kp, answer):
    spec = spec_of({"cut": "c.y", margin: size}, {"start": 0.9, "stop": 1.1}, (100.0, 800.0)).with_values({"numbers.kp": kp})
    (claim,) = facts(spec)["claims"]
    assert claim.status.answer == answer
    assert claim.what.required.startswith("stability and")
    if answer == "no":
        worst, factor = named(margin, size, claim.reason)
        assert np.abs(factors_of(margin, size) - factor).min() < 0.05
        assert largest(worst, kp, factor) > 1
    else:
        assert max(largest(m, kp, factors_of(margin, size)) for m in (0.9, 1.0, 1.1)) < 1


@pytest.mark.slow
def test_check_says_with_which_member_a_mode_is_too_slow_and_not_that_it_is_unstable():
    tables = tables_with({}, (2.0, 900.0), for_all={"m": {"start": 0.9, "stop": 1.1}})
    tables["sweep"]["require"] = {"radius": 0.998}
    tables["numbers"]["kp"] = 5.0
    spec = load(tables)
    (claim,) = (each for each in facts(spec)["claims"] if each)
    assert claim.reason.startswith("not with m = ")
    assert 0.998**N < largest(float(claim.reason.split("=")[1]), 5.0, 1.0) < 1
