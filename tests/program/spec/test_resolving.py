"""A filter is given by order and cutoff or by its four band edges, which SciPy turns into the same order and cutoff."""

import math
import random

import pytest
from scipy import signal

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.spec import load
from wavesweep.program.spec.resolving import butterworth_order

EDGES = {"passband_hz": 10, "stopband_hz": 40, "passband_db": 1, "stopband_db": 20}


def tables(name, **keys):
    return {"controller": {"kind": "pmw-lm"}, "filters": {name: keys}}


@pytest.mark.parametrize(("name", "low", "high"), [("lp1", 10, 40), ("lp2", 3, 4.5), ("hp", 20, 5)])
def test_band_edges_give_order_and_cutoff_and_a_resolved_spec_has_both(name, low, high):
    spec = load(tables(name, **EDGES | {"passband_hz": low, "stopband_hz": high}))
    order, cutoff_hz = signal.buttord(low, high, 1, 20, fs=1000.0)
    cutoff = f"filters.{name}.cutoff_hz"
    assert spec.values[f"filters.{name}.order"] == order
    assert spec.values[cutoff] == pytest.approx(cutoff_hz, rel=1e-13)
    assert load(spec.tables()).values == spec.values
    # of a machine whose functions round otherwise
    assert load(spec.tables(), [f"{cutoff}={spec.values[cutoff] * (1 + 4e-16)!r}"]).values == spec.values
    with pytest.raises(SpecError, match="both, which differ"):
        load(spec.tables(), [f"{cutoff}={spec.values[cutoff] * (1 + 1e-9)!r}"])
    for changes in ({"rates.fast_hz": 2000.0}, {f"filters.{name}.stopband_db": 30.0}):
        assert load(spec.tables()).with_values(changes).values == spec.with_values(changes).values


def test_order_and_cutoff_are_those_of_buttord_and_meet_the_edges():
    draw = random.Random(11)  # noqa: S311 - a fixed sample, no secret
    cases = [(10.0, 40.0, 1.0, 40.0, 1000.0), (10.0, 499.999, 3.0, 3.1, 1000.0)]
    for _ in range(60):
        fast_hz = draw.choice([100.0, 1000.0, 8000.0])
        edges = sorted(draw.uniform(0.001, 0.499) * fast_hz for _ in range(2))
        losses = sorted(10 ** draw.uniform(-3, 2.2) for _ in range(2))
        cases.append((*edges[:: draw.choice([1, -1])], *losses, fast_hz))
    for case in cases:
        passband_hz, stopband_hz, passband_db, stopband_db, fast_hz = case
        order, cutoff_hz = butterworth_order(*case)
        expected = signal.buttord(*case[:4], fs=fast_hz)
        assert order == expected[0]
        # One power, one tangent and one arctangent, each rounded; the arctangent damps what the tangent magnifies.
        assert cutoff_hz == pytest.approx(float(expected[1]), rel=1e-13)
        if order > 12:
            continue

        def loss(frequency_hz, cutoff_hz=cutoff_hz, order=order, fast_hz=fast_hz, low_pass=passband_hz < stopband_hz):
            ratio = math.tan(math.pi * frequency_hz / fast_hz) / math.tan(math.pi * cutoff_hz / fast_hz)
            return 10 * math.log10(1 + ratio ** (2 * order if low_pass else -2 * order))

        assert loss(passband_hz) == pytest.approx(passband_db, rel=1e-9)
        assert loss(stopband_hz) >= stopband_db * (1 - 1e-9)


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_the_rate_limits_no_filter_that_a_controller_does_not_read_and_none_of_order_0(kind):
    read = {
        path.split(".")[1] for path in keys_of_page(load({"controller": {"kind": kind}}).values) if path.startswith("filters.")
    }
    assert set(CONTROLLERS[kind].filters) == read
    tables = {"controller": {"kind": kind}, "rates": {"fast_hz": 13.0, "ratio": 2}}
    spec = load(tables | {"filters": {name: {"cutoff_hz": 1.0} for name in read}})
    assert wavesweep.compile(spec).stable_intervals().certified.all()
    load(tables | {"filters": {name: {"order": 0} for name in read}})
    for name in read:
        with pytest.raises(SpecError, match=r"expected a number < 6.5 \(half of rates.fast_hz\)"):
            load(tables | {"filters": {other: {"cutoff_hz": 1.0 if other != name else 6.5} for other in read}})


def test_a_limit_whose_own_value_is_wrong_is_not_applied():
    with pytest.raises(SpecError) as caught:
        load(tables("lp1", order=1, cutoff_hz=4000) | {"rates": {"fast_hz": -1000.0}})
    assert [mistake.key for mistake in caught.value.mistakes] == ["rates.fast_hz"]
