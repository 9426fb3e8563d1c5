"""Summaries of long tables count the same in blocks as at once."""

from itertools import pairwise

import numpy as np
import pytest

from wavesweep.passive.table import passivity
from wavesweep.program.analyses.claims import STABLE, Claim, Scope, Status
from wavesweep.program.spec import load
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.in_common import InCommon
from wavesweep.program.tables.interval_sentences import Sentences
from wavesweep.program.tables.interval_summary import LoopSummary
from wavesweep.program.tables.response_table import responses

OWN = Claim(STABLE, Scope(), Status.CERTIFIED)
AXES = {"b": [10.0, 40.0], "K_LM": [100.0, 200.0]}


def tables():
    """Responses of a spec with axes, of one without, and of one frequency; and passivity."""
    bode = {"frequency_hz": [0.0, 1.0, 10.0]} | AXES
    one = {"controller": {"kind": "pmw"}, "bode": bode, "environment": {"K_VE": 1e5, "integration": "explicit"}}
    yield responses([load(one), load({"controller": {"kind": "dc"}, "bode": {"frequency_hz": [1.0]}})])
    yield responses([load({"controller": {"kind": "dc"}, "bode": {"frequency_hz": [1.0], "K_VE": [1.0, 2.0, 3.0]}})])
    yield passivity(load({"controller": {"kind": "pmw"}, "sweep": AXES}), jobs=1)


@pytest.mark.slow
def test_the_numbers_do_not_depend_on_the_blocks():
    found = []
    for table in tables():
        columns, numbers = table.columns, []
        for size in (10**6, 4, 1):
            tally, rows = kind_named(table.kind).tally(table), len(columns["stable"])
            for start in range(0, rows, size):
                tally.add({name: column[start : start + size] for name, column in columns.items()})
            numbers.append(tally.numbers(table.facts))
        assert numbers[0] == numbers[1] == numbers[2]
        found.append(numbers[0])
    assert (found[0]["rows"], found[0]["curves"], found[0]["frequencies"]) == (13, 5, 3)
    assert (found[1]["rows"], found[1]["curves"], found[1]["frequencies"]) == (3, 3, 1)
    assert (found[0]["unstable_specs"], found[0]["unstable_curves"], found[0]["undecided_curves"]) == (["spec"], 4, 0)
    assert found[2]["rows"] == 4
    assert found[2]["damping_needed"] is None or np.isfinite(found[2]["damping_needed"]).all()


def known(rows):
    """The columns of rows without open places."""
    return {"open_places": np.zeros(rows, int), "open_low": np.full(rows, np.nan), "open_high": np.full(rows, np.nan)}


def test_of_rows_with_the_same_largest_value_one_without_a_gap_is_named():
    """The first row has it above a hole, the second from 0 on."""
    columns = {
        "b": np.array([1.0, 1.0, 2.0]),
        "along": np.full(3, "K_VE", object),
        "intervals": np.array([2, 2, 1]),
        "interval": np.array([0, 1, 0]),
        "low": np.array([0.0, 700.0, 0.0]),
        "high": np.array([500.0, 1000.0, 1000.0]),
        "high_omega": np.array([40.0, np.nan, np.nan]),
        "certified": np.ones(3, bool),
        "doubt": np.full(3, "", object),
        "felt_low": np.zeros(3),
        "felt_high": np.array([5.0, 9.0, 9.0]),
    } | known(3)
    tally = LoopSummary(OWN)
    tally.add(columns)
    largest = tally.numbers()["largest"]
    assert (largest["from"], largest["at"], largest["equal_rows"]) == (0.0, {"b": 2.0}, 2)
    assert Sentences(tally.numbers()).extremes()[1:] == [
        "stable K_VE for all of them: 0 to 500 N/m (at b = 1 N*s/m) and 700 (at b = 1 N*s/m) to 1000 N/m (at b = 1 N*s/m)"
    ]
    tally.add({name: column[:2] for name, column in columns.items()} | {"high": np.array([500.0, 2000.0])})
    whole, largest, _ = Sentences(tally.numbers()).extremes()
    assert "2000 N/m (stable from 700 on) at b = 1" in largest
    assert whole.startswith("stable for every K_VE from 0 up to 1000 N/m at b = 2")
    felt = "stiffest wall as the hand feels it at rest"
    assert Sentences(tally.numbers()).stiffest_felt().startswith(f"{felt}: 9 N/m with K_VE = 1000 N/m")
    tally.add(columns | {"felt_high": np.array([-5.0, 9.0, 9.0])})  # what is felt has a pole between
    assert Sentences(tally.numbers()).stiffest_felt().startswith(f"{felt}, at an end of an interval: 9 N/m")


@pytest.mark.parametrize(
    ("doubt", "said"),
    [
        ("", "no stable K anywhere in the swept range"),
        ("rounding", "no stable K found, but part of the swept range is not known"),
        ("search", "no stable K found, but part of the swept range is not known"),
    ],
)
def test_nothing_is_called_unstable_everywhere_that_is_in_doubt(doubt, said):
    unknown = dict.fromkeys(("low", "high", "low_omega", "high_omega", "felt_low", "felt_high"), np.array([np.nan]))
    columns = (
        known(1)
        | unknown
        | {
            "along": np.array(["K"], object),
            "intervals": np.array([0]),
            "interval": np.array([0]),
            "certified": np.array([not doubt]),
            "doubt": np.array([doubt], object),
        }
    )
    tally = LoopSummary(OWN)
    tally.add(columns)
    assert Sentences(tally.numbers()).extremes() == [said]


def rows_of(slices):
    """The columns of slices of an axis b, each with its intervals; of the last one a place is open."""
    rows = []
    for b, intervals in enumerate(slices):
        for number, (low, high) in enumerate(intervals or [(np.nan, np.nan)]):
            rows.append((float(b), len(intervals), number, low, high, 0, np.nan, np.nan))
    rows[-1] = (*rows[-1][:5], 1, 20.3, 20.6)
    names = ("b", "intervals", "interval", "low", "high", "open_places", "open_low", "open_high")
    columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
    return {"b": columns.pop("b"), "along": np.full(len(rows), "K", object)} | columns


@pytest.mark.parametrize("block", [1, 3, 1000])
@pytest.mark.parametrize("seed", range(4))
def test_what_slices_have_in_common_are_the_places_that_each_has(block, seed):
    """Held against places that are looked at in each, with any rows in a block."""
    rng = np.random.default_rng(seed)
    slices = [np.sort(rng.uniform(0, 40, 2 * rng.integers(1, 4))).reshape(-1, 2) for _ in range(4)]
    slices = [[(max(a - 10, 0.0), min(b + 10, 40.0)) for a, b in each] for each in slices]
    slices = [[each[0], *(own for before, own in pairwise(each) if own[0] > before[1])] for each in slices]
    columns = rows_of(slices)
    common = InCommon()
    for start in range(0, columns["low"].size, block):
        common.add({name: column[start : start + block] for name, column in columns.items()})
    found = common.numbers((0.0, 40.0))["intervals"]
    looked_at = np.linspace(0.001, 39.999, 20_001)
    inside = ~((looked_at >= 20.3) & (looked_at <= 20.6))
    for each in slices:
        inside &= np.any([(low <= looked_at) & (looked_at <= high) for low, high in each], axis=0)
    assert (inside == np.any([(each["low"] <= looked_at) & (looked_at <= each["high"]) for each in found], axis=0)).all()
    for each in found:
        for end in ("low", "high"):
            at = each[f"{end}_at"]
            ends = [own for pair in slices[int(at["b"])] for own in pair] if at else (0.0, 40.0)
            assert each[end] in (*ends, 20.3, 20.6)


@pytest.mark.parametrize(
    ("slices", "said"),
    [
        ([[(0, 10)], [(2, 8)], [(3, 40)]], "stable K for all of them: 3 (at b = 2 N*s/m) to 8 (at b = 1 N*s/m)"),
        ([[(0, 10)], [], [(3, 40)]], "no stable K for all of them: none (at b = 1 N*s/m)"),
        (
            [[(0, 10)], [(0, 20)], [(30, 40)]],
            "no stable K for all of them: up to 10 (at b = 0 N*s/m), and from 30 (at b = 2 N*s/m) on",
        ),
        ([[(0, 10), (20, 40)], [(12, 18)], [(0, 40)]], "no stable K for all of them"),
        ([[(0, 10)]], None),
        ([[], []], None),
    ],
)
def test_what_all_have_is_said_or_what_rules_it_out(slices, said):
    columns = rows_of(slices)
    n = columns["low"].size
    columns["certified"], columns["doubt"] = np.ones(n, bool), np.full(n, "", object)
    columns |= known(n) | {name: np.full(n, np.nan) for name in ("felt_low", "felt_high", "high_omega")}
    tally = LoopSummary(OWN, axes={"b": (0.0, 1.0, 2.0)})
    tally.add(columns)
    lines = [" ".join(line.split()) for line in Sentences(tally.numbers()).extremes() if "all of them" in line]
    assert lines == ([said] if said else [])
