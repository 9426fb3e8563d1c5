"""The library as its users call it."""

import re
import sys
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace

import control
import numpy as np
import pytest
from support.specs import KINDS, nested, values_of

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.analyses.own_design import own_design

HOLE = {
    "controller": {"kind": "pmw"},
    "environment": {"integration": "explicit"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
}


@pytest.fixture(scope="module")
def hole():
    """The loop whose stable set has a hole."""
    return wavesweep.compile(HOLE)


def test_every_stable_interval_is_a_row(hole):
    table = hole.stable_intervals(along="K_VE", span=(0, 20000), B_VE=[1.0, 5.0])
    np.testing.assert_allclose(table.high, [799.7134000606709, 4448.818804163079, 4848.818804163079], rtol=1e-12)
    assert table.intervals.tolist() == [2, 2, 1]
    assert table.interval.tolist() == [0, 1, 0]
    assert table.certified.all()


def test_the_ideal_coupling_counts_its_radius_per_frame_of_the_others():
    """0.988767...^20, the reference value of the paper's ideal wall."""
    loop = wavesweep.compile({"controller": {"kind": "dc"}})
    assert loop.spectral_radius() == pytest.approx(0.7977853313905533, rel=1e-13)


def test_python_control_gets_the_lifted_loop(hole):
    system = hole.to_control()
    assert isinstance(system, control.StateSpace)
    assert system.dt == pytest.approx(0.02)
    assert (system.ninputs, system.noutputs) == (20, 20)
    radius = np.sort(np.abs(system.poles()))
    assert radius[-1] == pytest.approx(1, abs=1e-12)  # the drift of a free hand, a pole like any other here
    assert radius[-2] == pytest.approx(float(hole.spectral_radius()), rel=1e-12)


@pytest.mark.sample(7)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", [{}, {"Kp": 20.0}, {"stiffness": 100.0}, {"K_VE": 0.0}])
def test_displacements_have_no_pole_of_a_drift(kind, changes):
    """The poles that decide stability and no others, and the same way from forces to displacements as through the positions."""
    loop = wavesweep.compile(nested(values_of(kind, delay=3, **changes)))
    system, whole = loop.to_control("displacement"), loop.to_control()
    assert np.abs(system.poles()).max() == pytest.approx(float(loop.spectral_radius()), rel=1e-9)
    assert np.abs(system.poles() - 1).min() > 1e-4
    z = 1.0007 * np.exp(0.3j)
    positions = whole(z)
    expected = np.vstack([positions[1:] - positions[:-1], z * positions[:1] - positions[-1:]])
    np.testing.assert_allclose(system(z), expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda loop: loop.to_control("force"), "position"),
        (lambda loop: loop.stable_intervals(B_V=[1.0]), "did you mean B_VE"),
        (lambda loop: loop.stable_intervals(along="K_LM", span=(0, 1)), "does not read"),
        (lambda loop: loop.stable_intervals(along="b"), "span"),
        (lambda loop: loop.stable_intervals(span=(5, 5)), "low < high"),
        (lambda loop: loop.stable_intervals(B_VE=[]), "at least one value"),
        (lambda loop: loop.stable_intervals(B_VE=[np.nan]), "finite"),
        (lambda loop: loop.stable_intervals(span=(0, 100), K_VE=[1, 200]), "other axes than K_VE"),
        (lambda loop: loop.stable_intervals("b", (0, 100)), "> 0"),
        (lambda loop: loop.stable_intervals(b=[20.0], **{"controller.b": [40.0]}), "under two names"),
        (lambda loop: loop.spectral_radius(b="x"), "expected a number or a list of numbers, found 'x'"),
        (lambda loop: loop.spectral_radius(b=[[1.0], [2.0, 3.0]]), "list of numbers"),
        (lambda loop: loop.response([]), "found none"),
        (lambda loop: loop.response([501.0]), r"numbers <= 500 \(half of rates"),
        (lambda loop: loop.spectral_radius(**{"device.velocity": [1]}), "numeric key"),
    ],
)
def test_what_a_spec_would_refuse_is_refused(hole, call, says):
    with pytest.raises((UsageError, SpecError), match=says):
        call(hole)


@pytest.mark.parametrize(
    ("axes", "says"),
    [
        ({"rates.fast_hz": [300.0, 1000.0], "filters.lp1.cutoff_hz": [10.0, 310.0]}, "a number < 150.0"),
        ({"rates.fast_hz": 200.0, "filters.lp1.cutoff_hz": [200.0]}, "a number < 100.0"),
        ({"rates.ratio": [20, 40], "environment.delay": [0, 30]}, "a whole number <= 20"),
        ({"rates.fast_hz": [1000.0, 4000.0], "along": "filters.lp1.cutoff_hz", "span": (5, 800)}, "a number < 500.0"),
        ({"filters.lp1.cutoff_hz": 310.0, "along": "rates.fast_hz", "span": (100, 4000)}, "a number < 50.0"),
    ],
)
def test_combinations_that_a_spec_would_refuse_are_refused(hole, axes, says):
    """Each value alone suits the spec's own other values, or the other way round."""
    with pytest.raises(SpecError, match=re.escape(says)):
        hole.stable_intervals(**axes)


def test_a_frame_that_overflows_has_an_infinite_radius_and_rows_with_a_doubt(capfd):
    """A wave line of 693 N*s/m at a device of 0.14 g, over frames of 100 ticks: the frame is beyond 1e308."""
    tables = {
        "rates": {"fast_hz": 1000.0, "slow_hz": 30.0},
        "device": {"mass": 0.0001378251602140977, "damping": 0.007417002165999043},
        "controller": {"kind": "pmw-lm", "b": 692.9926457629622},
    }
    loop = wavesweep.compile(tables)
    assert np.isinf(loop.spectral_radius())
    assert np.isinf(loop.spectral_radius(b=[600.0, 692.9])).all()
    assert set(loop.response([1.0, 10.0]).doubt) <= {"overflow", "unstable"}
    assert own_design(wavesweep.load(tables))["stable"] is False
    assert capfd.readouterr() == ("", "")  # nor a word of LAPACK


def test_a_loop_with_other_numbers_is_that_of_a_spec_with_them():
    loop = wavesweep.compile({"controller": {"kind": "pmw"}})
    other = loop.with_(b=40, **{"device.mass": 0.2})
    assert other.spectral_radius() == loop.spectral_radius(b=40, **{"device.mass": 0.2})
    assert loop.spec.values["controller.b"] == 25.0
    with pytest.raises(UsageError, match="did you mean"):
        loop.with_(Kpp=3)
    with pytest.raises(SpecError):
        loop.with_(b=-1)


def test_a_bar_of_tqdm_gets_to_the_number_of_slices_and_without_tqdm_it_is_asked_for(monkeypatch):
    bars = []

    @contextmanager
    def tqdm(**_):
        bar = SimpleNamespace(n=0, total=0, set_postfix_str=lambda *_, **__: None)
        bar.update = lambda more: setattr(bar, "n", bar.n + more)
        bars.append(bar)
        yield bar

    auto = ModuleType("tqdm.auto")
    auto.tqdm = tqdm
    loop = wavesweep.compile({"controller": {"kind": "dc-slow"}})
    monkeypatch.setitem(sys.modules, "tqdm", ModuleType("tqdm"))
    monkeypatch.setitem(sys.modules, "tqdm.auto", auto)
    loop.stable_intervals("K_VE", (0, 1000), B_VE=[1.0, 2.0, 3.0], progress=True)
    assert [(bar.n, bar.total) for bar in bars] == [(3, 3)]
    monkeypatch.setitem(sys.modules, "tqdm", None)
    monkeypatch.delitem(sys.modules, "tqdm.auto")
    with pytest.raises(UsageError, match="pip install tqdm"):
        loop.stable_intervals("K_VE", (0, 1000), B_VE=[1.5], progress=True)
