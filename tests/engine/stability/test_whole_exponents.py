"""Powers with an exponent that is a number of the loop: `y[k + 1] = g x^n y[k]` is stable while
`|g x^n| < 1`, whatever the sign of x."""

import pytest

import wavesweep
from wavesweep.engine.errors import UsageError


def remembered(gain):
    return {
        "rates": {"tick_hz": 10},
        "numbers": {"r": 0.5, "n": 2.0},
        "block": {"a": {"type": "hold"}},
        "wire": {"a.u": f"{gain}*prev(a.y)"},
    }


@pytest.mark.asks("prove")
@pytest.mark.parametrize(
    ("gain", "n", "searched", "ends"),
    [
        ("(1 - r)**n", [1.0, 2.0, 3.0, 40.0], (0, 3), lambda _: (0, 2)),
        ("(-r)**n", [2.0], (-3, 3), lambda _: (-1, 1)),
        ("(r**2 - 2)**(2*n)", [1.0, 2.0], (0.5, 3), lambda _: (1, 3**0.5)),
        ("(1 - r)**(-n)/4", [2.0, 4.0], (-7, 0.8), lambda n: (-7, 1 - 4 ** (-1 / n))),
    ],
)
def test_a_whole_exponent_is_exact_whatever_its_base(gain, n, searched, ends):
    found = wavesweep.compile(remembered(gain)).stable_intervals("r", searched, n=n)
    assert found["certified"].all()
    for (_, row), exponent in zip(found.iterrows(), n, strict=True):
        assert (row["low"], row["high"]) == pytest.approx(ends(exponent), abs=1e-9)


@pytest.mark.parametrize("n", [2.5, [2.0, 2.5], -2.0])
def test_a_base_that_may_vanish_has_no_other_exponent(n):
    with pytest.raises(UsageError, match=r"wire\.a\.u"):
        wavesweep.compile(remembered("(1 - r)**n")).stable_intervals("r", (0.0, 3.0), n=n)
