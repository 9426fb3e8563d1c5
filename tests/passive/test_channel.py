"""The norm of the wave channel against the closed form and scans of the lifted matrices, and what must not matter."""

import numpy as np
import pytest
from support.held import channel_norm

import wavesweep
from wavesweep.engine._energy import hinf
from wavesweep.engine._energy.hinf import hinf_norm
from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.passive.channel import channel_of

THETA = np.pi * np.linspace(0, 1, 801) ** 2


def low_pass_power(phi, order, cutoff_hz, fast_hz=1000.0):
    """|LP|^2 of a prewarped digital Butterworth filter, as textbooks have it."""
    with np.errstate(over="ignore"):
        return 1 / (1 + np.abs(np.tan(phi / 2) / np.tan(np.pi * cutoff_hz / fast_hz)) ** (2 * order))


def aliases(theta, ratio):
    return (theta[..., None] + 2 * np.pi * np.arange(ratio)) / ratio


def closed_form(order, cutoff_hz, ratio):
    """The norm is max(1, max over theta of the root of the sum of |LP1|^2 over the aliases); scanned, then refined."""

    def root(theta):
        return np.sqrt(low_pass_power(aliases(theta, ratio), order, cutoff_hz).sum(-1))

    best, width = THETA[root(THETA).argmax()], 0.01
    for _ in range(12):
        near = np.clip(best + width * np.linspace(-1, 1, 41), 0, np.pi)
        best, width = near[root(near).argmax()], width / 8
    return max(1.0, root(np.array([best]))[0])


@pytest.mark.sample(14)
@pytest.mark.parametrize("order", range(1, 9))
@pytest.mark.parametrize("cutoff_hz", [1.0, 10.0, 24.0, 60.0, 300.0])
def test_pmw_agrees_with_the_closed_form(values, order, cutoff_hz):
    found = channel_norm(values("pmw", **{"filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff_hz}))
    assert found.certified
    assert found.norm == pytest.approx(closed_form(order, cutoff_hz, 20), rel=1e-9, abs=0)


def test_frames_of_a_thousand_ticks_are_answered_one_way_and_refused_where_all_ticks_send_to_all(values):
    ratio, order, cutoff_hz = 1000, 2, 10.0
    given = {"rates.ratio": ratio, "filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff_hz}
    found = channel_norm(values("pmw", **given))
    assert found.norm == pytest.approx(closed_form(order, cutoff_hz, ratio), rel=1e-9)
    assert found.certified
    with pytest.raises(UsageError, match="at most 100000 entries, found 1001000 for a frame of 1000 ticks"):
        wavesweep.passivity({"controller": {"kind": "pmw-lm"}, "rates": {"ratio": ratio}})


@pytest.mark.parametrize("ratio", [1, 2, 7, 20])
def test_the_mean_of_a_frame_makes_the_channel_passive(values, ratio):
    found = channel_norm(values("pmw-mean", **{"rates.ratio": ratio, "environment.delay": 1}))
    assert found.certified
    assert found.passive
    assert found.norm == pytest.approx(1, abs=1e-12)


def test_without_waves_there_is_no_norm(values):
    assert [channel_norm(values(kind)) for kind in ("dc", "dc-slow", "dc-lm")] == [None, None, None]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 10, 19])
def test_no_point_of_a_scan_is_higher(random_values, seed):
    v = random_values(seed) | {"controller.kind": "pmw-lm" if seed % 3 else "pmw"}
    found, channel = channel_norm(v), channel_of(loop_drawing(v), v)
    assert found.certified
    for norm, way in ((found.outward, channel.outward), (found.inward, channel.inward)):
        scan = np.sqrt(way.lifted().largest_square(0, THETA).max())
        assert scan <= norm * (1 + 2e-10)
        assert norm <= scan * (1 + 1e-3)  # what the scan's spacing allows


def test_two_returned_waves_are_added_so_the_way_back_of_the_filter_bank_gains_the_root_of_two(values):
    """At zero frequency v_m = v_s + v_l, whatever LP2: the paper's bank is no passive channel between these ports."""
    found = channel_norm(values("pmw-lm"))
    assert found.inward == pytest.approx(np.sqrt(2), rel=1e-12)
    assert (found.norm, found.omega) == (found.inward, 0.0)
    assert not found.passive


def test_a_peak_is_certified_only_if_its_level_is_out_of_reach(monkeypatch):
    """Of a narrow peak, whose side the first level meets, in a search that ends before it is climbed."""

    def value(_owner, theta, _floor):
        return 1 / (1 + (1e3 * (theta - 1.2345)) ** 2)

    def angles(_owner, level):
        off = np.sqrt(np.maximum(1 / level - 1, 0)) / 1e3
        return np.stack([1.2345 - off, 1.2345 + 0.5 * off], axis=-1)

    def peak():
        return hinf_norm(value, angles, 1, lambda _, found: 1e-9 * found)

    assert peak().certified.all()
    assert peak().value == pytest.approx(1.0, rel=1e-8)
    monkeypatch.setattr(hinf, "RAISES", 1)
    assert not peak().certified.any()
