"""The column `counterexample` is read as it was written."""

import random

import pytest

from wavesweep.program.tables.refuters import Refuter, Refuters, in_a_sentence


def drawn(draw: random.Random) -> Refuter:
    """A member with a pattern of one of three kinds, or without."""

    def pattern(values):
        return [draw.choice(values) for _ in range(draw.choice([1, 2, 3, 5, 8]))] * draw.choice([1, 2, 3])

    numbers = {name: draw.choice(["1", "-2.5e-05"]) for name in ("b", "x.m")[: draw.randint(1, 2)]}
    return draw.choice(
        [
            Refuter(numbers),
            Refuter(frames=pattern([(16, ""), (33, "")]), wall="the linear wall"),
            Refuter(numbers, frames=pattern([(16, ""), (8, "lost"), (33, "delay 3")])),
            Refuter(messages={name: pattern([0, 12, None]) for name in ("up", "down")}),
            Refuter(numbers, ticks=pattern(["1", "1.2", "1.05"])),
        ]
    )


def test_a_refuter_is_read_as_it_was_written():
    draw = random.Random(0)  # noqa: S311
    for _ in range(400):
        refuter = drawn(draw)
        assert Refuter.read(str(refuter)) == refuter


UNREADABLE = [
    "",
    "second moments that grow",
    "the linear wall, in contact all the time",
    "no member, frames 1",
    "frames 16, 33, ...",
    "messages up: 0, ...",
    "ticks of 1, (2 x ... ms",
]


@pytest.mark.parametrize("text", UNREADABLE)
def test_what_is_no_member_and_no_whole_pattern_is_no_refuter(text):
    with pytest.raises(ValueError):
        Refuter.read(text)


def test_a_hand_behind_a_pattern_is_none_of_its_frames():
    assert Refuter.read("m = 2, frames 33, a hand that moves at 15.15 Hz").frames == [(33, "")]


@pytest.mark.parametrize(
    ("low", "high"), [("b = 1", "messages up: 0, lost"), ("messages from: 0; up: lost", ""), ("", "frames 1, 2"), ("", "")]
)
def test_refuters_are_read_as_they_were_written(low, high):
    read = Refuters.read(Refuters(low, high).written(1000))
    assert read == ((low, high) if low and high else (low or high,) * 2)


def test_refuters_of_both_ends_are_cut_each():
    read = Refuters.read(Refuters("b = 1 " * 100, "c = 2 " * 100).written(200))
    assert len(read.low) <= 100
    assert read.low.startswith("b = 1 b")
    assert read.high.startswith("c = 2 c")
    assert read.high.endswith(" ...")


def test_a_pattern_of_messages_says_what_happens_to_them():
    said = in_a_sentence("K = 2, messages camera: 0, 1, lost; up: 12")
    assert said == ("K = 2, messages of camera: in time, 1 tick late, lost; of up: 12 ticks late")


MOTION = "a wall, in frames of 21 ticks and a delay of 8, through (2.001, 1.988), (1.716, 1.705), (1.05, 1.04), frame by frame"
SAID = "a wall, in frames of 21 ticks and a delay of 8, and a motion of 3 frames"


@pytest.mark.parametrize(("written", "said"), [(MOTION, SAID), ("m = 2, frames 16, 16, 16, 33", "m = 2, frames 16 x 3, 33")])
def test_refuters_are_short_in_a_sentence(written, said):
    assert in_a_sentence(written) == said
