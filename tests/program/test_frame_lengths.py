"""Which lengths of frames a summary says that decide, and which may be left out."""

import numpy as np
import pytest

import wavesweep
from wavesweep.program.tables.frame_lengths import DecidingLengths, lengths_in_words, varying_lengths

NAN = float("nan")


def counted(lengths, *rows):
    """The numbers of rows `(low, high, fails_below, fails_from, counterexample)` within 0 to 2000."""
    names = ("low", "high", "fails_below", "fails_from", "counterexample")
    columns = {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
    deciding = DecidingLengths(lengths)
    deciding.add({**columns, "intervals": np.ones(len(rows), int)}, (0.0, 2000.0))
    return deciding.numbers()


def test_lengths_of_all_counterexamples_decide_and_the_others_may_be_left_out():
    both = "below: frames 15; from: the linear wall, m = 2, frames 21, 22"
    rows = (
        (1e-6, 99.0, NAN, 100.0, "frames 14, 14, 22"),
        (49.0, 300.0, 48.0, 302.0, both),
    )
    found = counted(tuple(range(14, 23)), *rows, (0.0, 2000.0, NAN, NAN, ""))
    assert found == {"decide": [14, 15, 21, 22], "left_out": [16, 17, 18, 19, 20], "moves_an_end_by": pytest.approx(1 / 49)}
    said = "frames of 14, 15, 21, 22 ticks decide: without those of 16 to 20 no end moves by more than 2.1 %"
    assert lengths_in_words(found) == said


@pytest.mark.parametrize(
    "row",
    [
        (1e-6, 99.0, NAN, NAN, ""),  # nothing is refuted beyond 99
        (50.0, 99.0, NAN, 100.0, "frames 14"),  # nor below 50
        (1e-6, 99.0, NAN, 100.0, "frames 14, 14, 14, ..."),  # cut
        (1e-6, 99.0, NAN, 100.0, "second moments that grow"),
        (1e-6, 99.0, NAN, 100.0, "frames 14, 15, 16"),  # all of them
    ],
)
def test_nothing_is_said_where_it_is_not_known_or_no_length_is_left(row):
    assert counted((14, 15, 16), row) == {}


def test_lengths_of_a_drawn_loop_are_those_of_the_number_that_every_is():
    drawn = {"block": {"wall": {"every": "N"}}, "for_all": {"N": {"start": 3, "stop": 5, "varying": True}}}
    assert varying_lengths(drawn) == (3, 4, 5)
    assert varying_lengths({**drawn, "block": {"wall": {"every": "2*N"}}}) == ()
    assert varying_lengths({"for_all": {"rates.ratio": {"values": [16, 20]}}}) == ()


@pytest.mark.slow
def test_without_the_lengths_that_may_be_left_out_the_same_is_refuted():
    spec = {
        "environment": {"integration": "explicit", "delay": 1, "B_VE": 1.0},
        "device": {"velocity": "difference"},
        "controller": {"kind": "dc-slow"},
        "sweep": {"K_VE": {"start": 0, "stop": 500}},
    }

    def row(values):
        table = wavesweep.zwidth(spec | {"for_all": {"rates.ratio": {"values": values, "varying": True}}})
        return table[table.guarantee == "for_all"].iloc[0]

    lengths = (16, 20, 25, 33)
    full = row(lengths)
    deciding = DecidingLengths(lengths)
    deciding.add({name: np.array([full[name]]) for name in full.index}, (0.0, 500.0))
    numbers = deciding.numbers()
    alone = row(numbers["decide"])
    assert numbers["left_out"]
    assert alone.high < full.fails_from
    assert full.high < alone.fails_from
    assert alone.fails_from == pytest.approx(full.fails_from, rel=1e-4)
    assert alone.high == pytest.approx(full.high, rel=numbers["moves_an_end_by"])
