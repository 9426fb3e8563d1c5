"""What the spec of a device says of its numbers."""

import pytest

from wavesweep.identification.device_spec import negative


@pytest.mark.parametrize(
    ("ends", "told"),
    [((-1.1, -0.9), ""), ((-2.1, -1.9), "2 ticks ahead of its force"), ((-5.0, 1.0), "from -5 to 1 ticks"), ((-1.0, 5.0), "")],
    ids=["rows with the position after their force", "two ticks ahead", "unknown", "a usual delay"],
)
def test_a_position_ahead_of_its_force_is_told_unless_it_is_that_after_it(ends, told):
    low, high = ends
    delay = {"value": (low + high) / 2, "low": low, "high": high, "unit": "tick"}
    sentences = list(negative({"mass": {"low": 0.1}, "delay": delay}))
    assert len(sentences) == bool(told)
    assert told in "".join(sentences)
