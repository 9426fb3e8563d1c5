"""Numbers in sentences."""

import numpy as np
import pytest

from wavesweep.program.number_words import in_all_digits, in_time, rounded_down, rounded_up, span_around, span_in_words


@pytest.mark.parametrize("digits", [1, 3, 6])
def test_rounding_goes_to_one_side_and_no_farther_than_a_unit_of_the_last_digit(digits):
    rng = np.random.default_rng(digits)
    for value in (rng.normal(size=300) * 10.0 ** rng.integers(-9, 9, 300)).tolist():
        down, up = float(rounded_down(value, digits)), float(rounded_up(value, digits))
        assert down <= value <= up
        assert up - down <= 1.000001 * 10.0 ** (np.floor(np.log10(abs(value))) - digits + 1)
    assert (rounded_up(0.0), rounded_down(20.0), rounded_up(308.7404)) == ("0", "20", "308.741")


def test_a_long_time_is_in_seconds():
    assert [in_time(seconds) for seconds in (0.0005, 9.99, 60.0001)] == ["0.5 ms", "9990 ms", "60.0001 s"]
    assert in_time(60.0001, 4, rounded_up) == "60.01 s"


def test_ends_of_a_range_do_not_look_alike():
    assert span_in_words(0.1, 0.25) == "0.1 to 0.25"
    assert span_in_words(0.1150001, 0.1150002, 3) == "0.1150001 to 0.1150002"
    assert span_in_words(2.0, 2.0) == "2"
    assert span_in_words(1.0, np.nextafter(1.0, 2)) == "1 to 1.0000000000000002"


def test_a_member_of_a_set_reads_back():
    rng = np.random.default_rng(3)
    for value in [0.1, 20.0, *(rng.normal(size=300) * 10.0 ** rng.integers(-9, 9, 300)).tolist()]:
        assert float(in_all_digits(value)) == value
    assert (in_all_digits(0.1), in_all_digits(20.0)) == ("0.1", "20")


def test_a_range_is_rounded_inwards_where_something_holds_and_outwards_where_it_does_not():
    rng = np.random.default_rng(7)
    for low, high in np.sort(rng.normal(size=(300, 2)) * 10.0 ** rng.integers(-6, 6, (300, 1)), axis=1).tolist():
        inner = [*map(float, span_in_words(low, high).split(" to "))]
        outer = [*map(float, span_around(low, high).split(" to "))]
        assert low <= inner[0] < inner[1] <= high
        assert outer[0] <= low <= high <= outer[-1]
    assert (rounded_up(0.1), rounded_down(0.3)) == ("0.1", "0.3")  # as they were written
    assert span_around(2.0000001, 2.0000002) == "2 to 2.00001"
