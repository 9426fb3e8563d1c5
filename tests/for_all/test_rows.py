"""[for_all]: what is proved for all values of numbers that are not known, and what refutes more."""

import re
from dataclasses import replace
from functools import reduce
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from cliffs import FIG4
from meaning.attacked import contradictions
from scipy.linalg import expm

import wavesweep
from wavesweep import UsageError
from wavesweep.engine._switched import boxes as ranges_module
from wavesweep.engine._switched.any_order import Decision, Verdict
from wavesweep.for_all import rows as for_all_module
from wavesweep.for_all import unknown as unknown_module
from wavesweep.for_all import varying
from wavesweep.for_all.frame_families import SlowFrames
from wavesweep.for_all.members import members
from wavesweep.for_all.on_check import facts, lines
from wavesweep.for_all.rows import ForAllGuarantee, Row, verdict
from wavesweep.for_all.unknown import Part
from wavesweep.for_all.varying import Rules
from wavesweep.program.row_kinds import OPEN_BETWEEN
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

PD = {
    "rates": {"tick_hz": 1000},
    "numbers": {"kp": 200.0, "kd": 4.0, "n": 5},
    "block": {"arm": {"type": "mass", "mass": 0.2}, "pd": {"type": "hold", "every": "n"}},
    "wire": {"pd.u": "-kp*arm.x - kd*arm.v", "arm.f": "pd.y"},
    "sweep": {"along": "kp", "kp": {"start": 0, "stop": 5000}},
}


def for_all(spec, **ranges):
    """The rows of the spec's own numbers, and those for all, which have no characteristic equation."""
    table = intervals(load(spec | {"for_all": ranges}), jobs=1, along=None if "block" in spec else "K_VE").columns
    rows = [{name: column[row] for name, column in table.items()} for row in range(len(table["along"]))]
    assert all(
        np.isnan(row["residual"]) == (row["guarantee"] == "for_all") for row in rows if row["intervals"] and not row["doubt"]
    )
    return [row for row in rows if row["guarantee"] == "spec"], [row for row in rows if row["guarantee"] == "for_all"]


def integrator(K, ranges, **block):
    """`x' = -g K x`, whose input is sent or held each n ticks of 0.1 s."""
    return {
        "rates": {"tick_hz": 10.0},
        "numbers": {"K": K, "g": 1.0, "n": 2},
        "block": {
            "plant": {"type": "tf", "num": [1], "den": [1, 0]},
            "net": {"type": "channel" if "lost" in block else "hold", "every": "n", **block},
        },
        "wire": {"net.u": "-K*plant.y", "plant.u": "g*net.y"},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 30}},
        "for_all": ranges,
    }


GAINS = {"start": 1, "stop": 2}
FRAMES = {"values": [1, 2], "varying": True}


@pytest.mark.parametrize(
    ("ranges", "block", "limit"),
    [
        ({"n": {"values": [2, 4], "varying": True}}, {"phase": 1}, 5.0),
        ({"g": GAINS, "n": FRAMES}, {}, 5.0),
        ({"g": GAINS}, {"lost": 1}, 2.5),
        ({}, {"lost": 3, "missing": "held"}, 2.5),
        ({}, {"lost": 3, "missing": "zero"}, 10.0),
    ],
)
def test_an_integrator_is_stable_up_to_two_over_its_longest_hold(ranges, block, limit):
    """Nothing is lost by losses where a missing message is zero."""
    assert verdict(load(integrator(0.98 * limit, ranges, **block)))["verdict"] == "proved"
    assert verdict(load(integrator(1.01 * limit, ranges, **block)))["verdict"] == "refuted"


@pytest.mark.parametrize(
    ("ranges", "block", "limit", "by"),
    [
        ({"g": GAINS, "n": [1, 2]}, {}, 5.0, "n = 2, g = 2"),
        ({"g": GAINS, "n": FRAMES}, {}, 5.0, "g = 2, frames 2"),
        ({}, {"lost": 1}, 5.0, "messages net: 0, lost"),
    ],
)
def test_rows_of_an_integrator_end_next_to_the_pattern_that_holds_longest(ranges, block, limit, by):
    _, (row,) = for_all(integrator(1.0, {}, **block), **ranges)
    assert row["settled"]
    assert 0 <= row["low"] < 2e-3 * limit
    assert 0.99 * limit < row["high"] < limit <= row["fails_from"] < limit * (1 + 1e-6)
    assert row["counterexample"] == by


@pytest.mark.parametrize("step", ["elapsed", "nominal"])
def test_proofs_integrate_over_what_the_spec_says(step):
    varied = {"rates.ratio": {"values": [16, 20], "varying": True}}
    tables = FIG4 | {"environment": FIG4["environment"] | {"step": step}, "for_all": varied}
    rules = Rules.of(load(tables))
    assert rules.elapsed == (step == "elapsed")
    (case,) = for_all_module.own_cases(rules, load(tables))
    constant = {each.values["rates.ratio"] for each in members(rules, case)}
    assert constant == ({16, 20} if rules.elapsed else {20}), "constant frames of 16 ticks would be integrated over 16, not 20"


def test_the_table_says_in_words_whether_its_loops_are_stable():
    held = {
        "controller": {"kind": "dc-slow"},
        "environment": {"delay": 1, "K_VE": 50.0},
        "for_all": {"device.mass": [0.08, 0.125]},
    }
    spec = load(held)
    assert spec.for_all.verdict(spec) == "proved stable for device.mass of 0.08, 0.125 (each for ever)"


def test_nobody_at_the_device_is_a_passive_hand():
    """Where messages alone refute, hands are refuted too, and of them only the damping that suffices is said."""
    spec = load(FIG4 | {"for_all": {"rates.ratio": {"values": [16, 20], "varying": True}}})
    unknown = {"needed": None, "refuted": None, "device": 4.0, "by": ""}
    assert not [*lines(spec, {"for_all": {"verdict": "refuted"}, "every_hand": unknown})]
    ((_, said),) = lines(spec, {"for_all": {"verdict": "refuted"}, "every_hand": unknown | {"needed": 5.983}})
    assert said == "with every passive hand: 5.983 N*s/m of damping suffice, the device has 4"


@pytest.mark.parametrize(
    ("needed", "refuted", "begins", "ends"),
    [
        (3.0, None, "proved stable", "3 N*s/m of damping suffice, the device has 4"),
        (4.0, None, "proved stable", "4 N*s/m of damping suffice, the device has 4"),
        (5.0, 4.0, "not known whether", "5 N*s/m of damping suffice, the device has 4"),
        (5.0, 4.5, "not stable for all", "hands: x; 5 N*s/m of damping suffice, the device has 4"),
        (None, 6.0, "not stable for all", "hands: x; no damping is proved to suffice, the device has 4"),
    ],
)
def test_what_hands_need_is_held_against_what_the_device_has(needed, refuted, begins, ends):
    spec = load(FIG4 | {"for_all": {"rates.ratio": {"values": [16, 20], "varying": True}}})
    hands = {"needed": needed, "refuted": refuted, "device": 4.0, "by": "x"}
    ((_, said),) = lines(spec, {"for_all": {"verdict": "proved"}, "every_hand": hands})
    assert said.startswith(begins)
    assert said.endswith(ends)


def test_numbers_in_sentences_are_those_that_count():
    """By which share an end is open, and which damping suffices: never less than what is proved."""
    share = float(re.search(r"more than (\S+) %", OPEN_BETWEEN)[1]) / 100
    assert for_all_module.is_near(1.0, 1 - 0.999 * share)
    assert not for_all_module.is_near(1.0, 1 - 1.001 * share)
    spec = load(FIG4 | {"for_all": {"rates.ratio": {"values": [16, 20], "varying": True}}})
    for needed in (1.23456, 0.07, 12.3451):
        found = {"needed": needed, "refuted": needed, "device": 20.0, "by": ""}
        (said,) = (line for _, line in lines(spec, {"for_all": {"verdict": "proved"}, "every_hand": found}))
        printed = float(re.search(r"(\S+) N\*s/m of damping suffice", said)[1])
        assert needed <= printed <= needed * (1 + 1e-3)


@pytest.mark.slow
def test_a_row_that_goes_beyond_one_of_its_members_is_in_doubt_and_asks_to_be_reported(monkeypatch):
    """Frames that are planned half as long as they are, are told from the loops at constant frames."""
    own = SlowFrames.of
    monkeypatch.setattr(SlowFrames, "of", lambda *about: replace(own(*about), lengths=(1, 2, 3)))
    numbers, integrator = {"K": 45.0, "n": 2}, {"type": "integrator", "method": "explicit"}
    blocks, wires = {"p": integrator, "h": {"type": "hold", "every": "2*n"}}, {"h.u": "p.y", "p.u": "-10*K*h.y"}
    loop = {"rates": {"tick_hz": 1000}, "numbers": numbers, "block": blocks, "wire": wires}
    loop |= {"sweep": {"along": "K", "K": {"start": 0, "stop": 100}}}
    varying = {"n": {"values": [1, 2, 3], "varying": True}}
    _, (row,) = for_all(loop, **varying)
    assert row["high"] > 60
    assert (row["certified"], row["settled"], row["doubt"]) == (False, False, "contradiction")
    said = facts(load(loop | {"for_all": varying}))["for_all"]
    assert (said["verdict"], said["doubt"]) == ("unknown", "contradiction")
    assert "please report it" in for_all_module.reason_of(said)


@pytest.mark.parametrize(
    ("spec", "ranges", "expected"),
    [
        (
            FIG4 | {"controller": {"kind": "dc"}},
            {"rates.ratio": {"values": [4, 5], "varying": True}},
            "controller.kind: expected a controller with a slow environment, whose frames may vary, found dc",
        ),
        (
            FIG4,
            {"rates.ratio": {"values": [1, 20], "varying": True}, "environment.delay": {"values": [5, 9]}},
            "expected delays",
        ),
        (
            PD | {"block": PD["block"] | {"pd": {"type": "notch", "frequency_hz": 1.0, "q": 2.0, "every": "n"}}},
            {"n": {"values": [2, 5], "varying": True}},
            r"have a rule for steps that vary .*, found pd \(notch\)",
        ),
        (
            PD | {"block": PD["block"] | {"pd": {"type": "hold", "every": "n", "phase": 3}}},
            {"n": {"values": [2, 5], "varying": True}},
            "block.pd.phase: expected phases below the shortest frame, 2, found 3 of pd",
        ),
        (
            PD | {"block": PD["block"] | {"more": {"type": "hold", "every": 7}}, "wire": PD["wire"] | {"more.u": "0"}},
            {"n": {"values": [2, 5], "varying": True}},
            r"block\.more\.every: .* found n of pd, 7 of more",
        ),
        (
            PD | {"block": PD["block"] | {"pd": {"type": "channel", "every": 5, "loss": 0.01}}},
            {"loss": 0.3},
            "whose channels say what is lost, found 0.3",
        ),
        (PD, {"kd": {"values": [2, 5], "varying": True}}, "one number that varies, which `every` of blocks reads, found kd"),
    ],
)
def test_what_cannot_vary_is_said(spec, ranges, expected):
    with pytest.raises(UsageError, match=expected):
        for_all(spec, **ranges)


def test_check_says_whether_the_design_holds_for_all():
    good = facts(load(PD | {"for_all": {"kd": {"start": 3, "stop": 5}}}))["for_all"]
    assert good == {"verdict": "proved", "counterexample": "", "kind": "for_all"}
    bad = facts(load(PD | {"for_all": {"kd": {"start": 0.2, "stop": 5}}}))["for_all"]
    assert (bad["verdict"], bad["counterexample"]) == ("refuted", "kd = 0.2")


def test_an_end_that_is_not_known_is_no_counterexample(monkeypatch):
    """An interval of one of the loops ends at an open place: what is beyond it is not refuted."""

    class Open(unknown_module.Search):
        def records(self):
            records = super().records()
            records["open_places"], records["open_low"], records["open_high"] = 1, 700.0, 900.0
            records["high"], records["certified"] = 700.0, False
            return records

    _, (row,) = for_all(PD, kd={"start": 3, "stop": 5})
    assert (row["fails_from"], row["settled"]) == (pytest.approx(1200), True)
    monkeypatch.setattr(unknown_module, "Search", Open)
    _, (row,) = for_all(PD, kd={"start": 3, "stop": 5})
    assert np.isnan(row["fails_from"])
    assert not row["counterexample"]
    assert not row["settled"]
    assert row["high"] <= 700


SAMPLED = {
    "rates": {"tick_hz": 100},
    "numbers": {"n": 18},
    "block": {
        "plant": {
            "type": "ss",
            "inputs": ["u"],
            "outputs": ["x1", "x2"],
            "A": [[1, 3], [2, 1]],
            "B": [[1], [0.6]],
            "C": [[1, 0], [0, 1]],
        },
        "sample": {"type": "hold", "every": "n"},
    },
    "wire": {"sample.u": "-plant.x1 - 6*plant.x2", "plant.u": "sample.y"},
}


def sampled_frame(ticks):
    """The same loop over so many ticks: `x' = F x + G u`, `u = -[1, 6] x`, from the exponential of the whole."""
    block = np.zeros((3, 3))
    block[:2, :2], block[:2, 2] = SAMPLED["block"]["plant"]["A"], [1, 0.6]
    held = expm(block * ticks / 100)
    return held[:2, :2] - np.outer(held[:2, 2], [1, 6])


@pytest.mark.parametrize(("nominal", "lengths"), [(18, [18, 54]), (18, [18, 20]), (1, [1, 2])])
def test_periods_in_any_order_are_judged_without_an_axis(nominal, lengths):
    """Each period by itself is stable; a counterexample has to grow, and where there is none no word of nine frames does."""
    spec = SAMPLED | {"numbers": {"n": nominal}, "for_all": {"n": {"values": lengths, "varying": True}}}
    found, frames = facts(load(spec))["for_all"], {ticks: sampled_frame(ticks) for ticks in lengths}

    def radius(word):
        return np.abs(np.linalg.eigvals(reduce(np.matmul, [frames[ticks] for ticks in reversed(word)]))).max()

    assert max(radius([ticks]) for ticks in lengths) < 1
    if lengths == [18, 54]:
        word = [int(ticks) for ticks in found["counterexample"].removeprefix("frames ").split(", ")]
        assert (found["verdict"], sorted(word)) == ("refuted", [18, 18, 54])
        assert radius(word) > 1
    else:
        assert found == {"verdict": "proved", "counterexample": "", "kind": "for_all"}
        assert max(radius(word) for word in product(lengths, repeat=9)) < 1


def held_arm(ticks, kp):
    """A frame of `PD`: a free mass of 0.2 kg under the force of its first tick."""
    T = ticks * 1e-3
    return np.array([[1.0, T], [0.0, 1.0]]) - np.outer([T**2 / 2, T], [kp, 4.0]) / 0.2


@pytest.fixture(scope="module")
def varying_row():
    """A loop whose frames vary, and the row that is proved of it."""
    tables = PD | {"for_all": {"n": {"values": [5, 10], "varying": True}}}
    (row,) = wavesweep.stability_region(tables).query("guarantee == 'for_all'").itertuples()
    return tables, row


@pytest.mark.slow
@pytest.mark.parametrize("place", ["proved", "refuted", "between", "beyond"])
def test_check_says_what_intervals_say_where_it_cannot_decide_by_itself(place, varying_row, monkeypatch):
    """The pattern that refutes grows, by the frames' own matrices; what is proved does not for any order of eight."""
    tables, row = varying_row
    value = {
        "proved": row.high,
        "between": (row.high + row.fails_from) / 2,
        "refuted": row.fails_from,
        "beyond": 1.01 * row.fails_from,
    }
    monkeypatch.setattr(varying, "decide", lambda *_, **__: Decision(Verdict.UNKNOWN))
    spec = load(tables).with_values({"kp": value[place]})
    found = for_all_module.verdict(spec)
    expected = {"proved": "proved", "between": "unknown"}.get(place, "refuted")
    assert found["verdict"] == expected
    if place != "beyond":  # where a long pattern no longer grows
        assert found["counterexample"] == (row.counterexample if expected == "refuted" else "")
    frames = {ticks: held_arm(ticks, value[place]) for ticks in (5, 10)}
    if expected == "refuted":
        word = [int(ticks) for ticks in found["counterexample"].removeprefix("frames ").split(", ")]
        assert np.abs(np.linalg.eigvals(reduce(np.matmul, [frames[ticks] for ticks in reversed(word)]))).max() > 1
    elif expected == "proved":
        assert all(np.abs(np.linalg.eigvals(reduce(np.matmul, each))).max() < 1 for each in product(frames.values(), repeat=8))


def test_a_slice_whose_proof_fails_in_arithmetic_ends_none_of_the_others(monkeypatch):
    sweep = {"K_VE": {"start": 0, "stop": 4000}, "b": [10.0, 20.0]}
    tables = {"controller": {"kind": "pmw"}, "environment": {"integration": "explicit"}, "sweep": sweep}
    tables["for_all"] = {"device.mass": {"values": [0.1, 0.2]}}
    right, prove = intervals(load(tables), jobs=1).columns, ForAllGuarantee.records_of

    def failing(rules, loop, *rest, **named):
        if loop.values["controller.b"] == 20:
            raise np.linalg.LinAlgError("singular")
        return prove(rules, loop, *rest, **named)

    monkeypatch.setattr(ForAllGuarantee, "records_of", failing)
    with pytest.warns(RuntimeWarning, match="LinAlgError"):
        found = intervals(load(tables), jobs=1).columns
    failed = (found["b"] == 20) & (found["guarantee"] == "for_all")
    assert found["doubt"][failed].tolist() == ["search"]
    assert not found["settled"][failed].any()
    kept = (right["b"] != 20) | (right["guarantee"] != "for_all")
    for name in ("b", "low", "high", "certified"):
        np.testing.assert_allclose(found[name][~failed], right[name][kept], rtol=1e-9)


def test_where_nothing_is_stable_that_is_certified():
    tables = {"controller": {"kind": "dc"}, "environment": {"B_VE": 400.0}, "device": {"velocity": "difference"}}
    tables |= {"sweep": {"K_VE": {"start": 0, "stop": 3000}}}
    masses = {"for_all": {"device.mass": {"start": 0.08, "stop": 0.125}}}
    for found in (wavesweep.zwidth(tables | masses), wavesweep.zwidth(tables, for_hands="box")):
        assert not found.intervals.any()
        assert (found.certified & found.settled & (found.doubt == "")).all()


def test_nowhere_is_certified_where_one_combination_has_no_stable_value_and_another_has_some():
    """An integrator `x + T u` with `u = -c K x` held over 1 or 2 ticks grows for every K > 0 if c = -1."""
    blocks = {"p": {"type": "integrator"}, "h": {"type": "hold", "every": "n"}}
    loop = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 45.0, "n": 1, "c": 1},
        "block": blocks,
        "wire": {"h.u": "p.y", "p.u": "-c*K*h.y"},
        "sweep": {"along": "K", "K": {"start": 1, "stop": 100}},
    }
    varying = {"n": {"values": [1, 2], "varying": True}}
    for signs, proved in (([1], True), ([1, -1], False)):
        _, (row,) = for_all(loop, **varying, c={"values": signs})
        assert (bool(row["intervals"]), row["certified"], row["settled"]) == (proved, True, True)


@pytest.mark.slow
def test_a_gaussian_is_nothing_far_from_its_peak_and_counts_at_it():
    """`x+ = (g + 0.3 exp(-300 (p - 0.2)^2 - 20 q^2)) x` is stable for all p and q up to g = 0.7."""
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"p": 0.1, "q": 0.1, "g": 0.5},
        "block": {"x": {"type": "delay"}},
        "wire": {"x.u": "(g + 0.3*exp(-300*(p - 0.2)**2)*exp(-20*q*q))*x.y"},
        "for_all": {"p": {"start": -10, "stop": 10}, "q": {"start": -3, "stop": 3}},
        "sweep": {"along": "g", "g": {"start": 0, "stop": 2}},
    }
    (row,) = wavesweep.stability_region(tables).query("guarantee == 'for_all'").itertuples()
    assert row.certified
    assert row.settled
    assert row.high < 0.7 <= row.fails_from < 0.7001


HELD = """
rates.tick_hz = 1000
numbers = { m = 1.0, k = 10.0, K = 100.0, b = 5.0, n = 2 }
block.arm = { type = "mass", mass = "m", damping = "b" }
block.wall = { type = "hold", every = "n" }
wire = { "wall.u" = "arm.x", "arm.f" = "-K*wall.y - k*arm.x" }
for_all = { m = { start = 0.5, stop = 2 }, k = { start = 0, stop = 400 } }
sweep = { along = "K", K = { start = 0, stop = 20000 } }
"""


def test_where_the_budget_ends_the_part_that_is_open_is_told(tmp_path, monkeypatch, caplog):
    (tmp_path / "spec.toml").write_text(HELD)
    spec = load(tmp_path / "spec.toml")
    caplog.set_level("INFO", "wavesweep.proof")
    monkeypatch.setattr(unknown_module, "OPERATIONS_OF_CASE", 1e9)
    row = {name: column[1] for name, column in intervals(spec, jobs=1, along="K").columns.items()}
    found = re.fullmatch(r"([0-9.]+) %, within K (\d+) to \d+, m [0-9.]+ to 2, k 0 to 400", row["left_open"])
    assert found
    assert 0 < float(found[1]) <= 100
    assert float(found[2]) == pytest.approx(row["high"], rel=1e-3)
    assert not row["settled"]
    assert row["high"] < row["fails_from"]
    said = [re.fullmatch(r"K proved from [0-9.]+ to [0-9.]+ on (\d+) % of the box so far", each) for each in caplog.messages]
    shares = [int(each[1]) for each in said]
    assert shares == sorted(shares)  # of all of it, up and down
    assert 0 < shares[-1] < 100
    monkeypatch.setattr(unknown_module, "OPERATIONS_OF_CASE", 6e7)
    monkeypatch.setattr(ranges_module, "CELLS_AT_ONCE", 1)
    said = for_all_module.reason_of(for_all_module.verdict(spec))
    part = re.search(r"proved for m 0.5 to ([0-9.]+), open from there \(100 %, within m \1 to 2, k 0 to 400\)", said)
    assert part
    monkeypatch.undo()
    smaller = load(tmp_path / "spec.toml", [f"for_all.m.stop={part[1]}"])
    assert for_all_module.verdict(smaller)["verdict"] == "proved"
    assert for_all_module.verdict(spec) == {"verdict": "proved", "counterexample": "", "kind": "for_all"}


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (0.5, 1.25, "proved for m 0.5 to 1.25 with c = 3, open from there (within m 1 to 2)"),
        (0.5, 0.5, "open from m = 0.5 on with c = 3 (within m 1 to 2)"),
    ],
)
def test_what_is_open_is_said_from_where_the_proof_ends(low, high, said):
    case = SimpleNamespace(ranges=[SimpleNamespace(name="m")], fixed={"numbers.c": 3.0})
    left = unknown_module.LeftOpen(("numbers.m",), (np.array([1.0]), np.array([2.0])), 1.0)
    assert for_all_module._partly(case, SimpleNamespace(low=low, high=high, open=left)) == said


def test_what_a_constant_member_refutes_everywhere_needs_no_proof_beside_a_range_that_is_a_point_to_rounding():
    """Frames of 34 ticks alone leave nothing; the range is as narrow on its logarithmic side as the proof's first stretch."""
    spec = {
        "rates": {"ratio": 11},
        "device": {"mass": 0.185, "damping": 2.1, "velocity": "difference"},
        "environment": {"integration": "explicit", "delay": "frame", "B_VE": 2.0},
        "controller": {"kind": "dc-vc", "K_VC": 250.0, "B_VC": 6.0},
        "sweep": {"K_VE": {"start": 0, "stop": 1000}},
        "for_all": {"device.mass": {"start": 0.184985, "stop": 0.185008}, "rates.ratio": {"values": [11, 34], "varying": True}},
    }
    row = {name: column[1] for name, column in intervals(load(spec), jobs=1).columns.items()}
    assert row["certified"]
    assert row["intervals"] == 0
    assert row["counterexample"].startswith("with frames 34 no K_VE is stable")


@pytest.mark.slow
def test_a_box_whose_frames_have_no_bound_is_divided_along_what_they_lack_it_for():
    """Along the stiffness of the wall, in N/m, a proof beside a range of masses did not end."""
    spec = {
        "rates": {"ratio": 25},
        "device": {"mass": 0.08, "damping": 1.0, "velocity": "difference"},
        "environment": {"integration": "explicit", "delay": 2, "B_VE": 1.5},
        "controller": {"kind": "pmw", "b": 12.0},
        "filters": {"lp1": {"order": 2, "cutoff_hz": 8.0}},
        "sweep": {"K_VE": {"start": 0, "stop": 2000}},
        "for_all": {"device.mass": {"start": 0.06, "stop": 0.2}, "operator.stiffness": {"start": 0, "stop": 300}},
    }
    row = {name: column[1] for name, column in intervals(load(spec), jobs=1).columns.items()}
    assert row["settled"]
    assert row["low"] <= 1.001e-3 * row["high"]
    assert 294 < row["high"] < row["fails_from"] < 296.1


@pytest.mark.slow
def test_a_refuter_is_inside_of_its_range_and_refutes_with_the_digits_that_are_printed():
    spec = {
        "rates": {"ratio": 4},
        "device": {"velocity": "difference", "damping": 1.2345678},
        "environment": {"integration": "explicit", "delay": 1, "B_VE": 0.1},
        "controller": {"kind": "dc-slow"},
        "for_all": {"device.mass": {"start": 0.08123456, "stop": 0.1234567}},
        "sweep": {"K_VE": {"start": 0, "stop": 5000}},
    }
    table = wavesweep.zwidth(spec)
    row = table[table.guarantee == "for_all"].iloc[0]
    mass = float(row.counterexample.removeprefix("device.mass = "))
    assert 0.08123456 <= mass <= 0.1234567
    del spec["for_all"]
    one = wavesweep.compile(load(spec).with_values({"device.mass": mass}))
    assert one.spectral_radius(K_VE=row.fails_from * (1 + 1e-9)) >= 1


@pytest.mark.slow
def test_the_nearest_pattern_of_losses_is_one_that_a_single_value_is_refuted_by():
    """An arm whose short patterns grow from 274.477 on, and one of many messages from below 274.05."""
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 20.0, "kd": 2.0},
        "block": {
            "arm": {"type": "inertia", "inertia": 0.03, "damping": 0.05},
            "radio": {"type": "channel", "every": 5, "lost": 2},
        },
        "wire": {"radio.u": "-kp*arm.x - kd*arm.v", "arm.f": "radio.y + push"},
        "ports": {"hand": {"force": "push", "displacement": "arm.x", "turns": True}},
        "sweep": {"along": "kp", "kp": {"start": 0, "stop": 2000}},
    }
    table = wavesweep.stability_region(spec)
    row = table[table.guarantee == "for_all"].iloc[0]
    assert row.high < row.fails_from < 274.05
    assert contradictions(spec) == []


@pytest.mark.parametrize(
    ("low", "high", "span", "refuted", "settled"),
    [
        (5.9e-5, 0.4397, (0, 3), (None, 0.43968), True),
        (4.3e-4, 0.4397, (0, 3), (None, 0.43968), True),
        (5e-4, 0.4397, (0, 3), (None, 0.43968), False),
        (4.3e-4, 0.4397, (1e-4, 3), (None, 0.43968), False),
        (0.0, 2.99, (0, 3), (None, None), True),
        (0.0, 2.9, (0, 3), (None, None), False),
        (0.2, 0.43, (0, 3), (0.199, 0.43968), False),
        (0.2, 0.439, (0, 3), (0.199, 0.43968), True),
    ],
)
def test_a_row_is_settled_but_for_the_first_thousandth_from_0(low, high, span, refuted, settled):
    """As docs/for-all.md has it: within 1 % at both ends, or of the swept range's ends."""
    low_by, high_by = (end and {"lost": None} for end in refuted)
    part = Part(refuted[0] or span[0], refuted[1] or high, low_by, high_by)
    assert Row(low, high, part, span, "").settled == settled


def test_what_a_proof_has_reached_never_shrinks(caplog):
    caplog.set_level("INFO", "wavesweep.proof")
    report = varying._shown(varying.ON_THE_WAY, "K")
    for end in (8.0, 2.0, 9.0):
        report(1.0, end, 10 * end)
    assert [said.split(" so far")[0] for said in caplog.messages] == [f"K proved from 1 to {end}" for end in (8, 8, 9)]
