"""The column `counterexample` is read as it was written."""

import pytest

from wavesweep.program.tables.refuters import Refuters, in_a_sentence


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
