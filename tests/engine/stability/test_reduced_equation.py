"""Loops with long delays along a number, against all of their eigenvalues."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._stability import along_any, reduced_equation
from wavesweep.engine._stability.sampled_frames import Frames, ParametricFrames
from wavesweep.engine.doubts import Doubt

STATES = 30  # of the delay


def radius(M):
    return np.abs(np.linalg.eigvals(M)).max()


def random_loop(seed):
    """M0, M1 and M2 of `M0 + p M1 + p^2 M2`: a few states behind and before a delay, whose last two are read.

    The gain from these is such that the largest eigenvalue at p = 0 has a size from well inside the circle to just outside.
    """
    random = np.random.default_rng(seed)
    k, line = int(random.integers(1, 4)), np.arange(STATES)
    parts = np.zeros((3, k + STATES, k + STATES))
    for M, size in zip(parts, (1.0, 0.03, 0.01), strict=True):
        M[:k, :k], M[:k, -2:] = size * 0.3 * random.normal(size=(k, k)), size * random.normal(size=(k, 2))
        M[k, :k], M[k + 5, :k] = size * random.normal(size=k), size * 0.1 * random.normal(size=k)
    parts[0, k + line[1:], k + line[:-1]] = 1
    low, high, wanted = 0.0, 8.0, random.choice([0.9, 0.99, 1 - 1e-3, 1 - 1e-5, 1 + 1e-4, 1.01])
    for _ in range(30):
        gain = np.ones(k + STATES)
        gain[-2:] = (low + high) / 2
        low, high = (gain[-1], high) if radius(parts[0] * gain) < wanted else (low, gain[-1])
    return parts * gain


def regions_of(parts):
    """The regions of the loop for p from -1 to 1; its entries are exact but for a rounding."""

    def frames(_, p):
        return Frames.of(np.tensordot(np.ravel(p)[:, None] ** np.arange(3), parts, 1) - np.eye(parts.shape[-1]))

    def errors(_, p):
        E = frames(_, p).E
        return E, np.finfo(float).eps * np.abs(E)

    return along_any.regions_along_any(ParametricFrames(frames, np.ones(1), errors=errors), (-1.0, 1.0))


def labels(regions, p):
    """Whether each value lies in a stable region: 1 if it does, 0 in an unstable one, -1 if that is not known."""
    at = np.searchsorted(regions.low, p, side="right") - 1
    return np.where(regions.unstable[at] < 0, -1, regions.unstable[at] == 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 133, 266, 399])
def test_regions_are_those_of_the_eigenvalues_at_all_values(seed):
    parts, p = random_loop(seed), np.linspace(-1, 1, 101)
    regions = regions_of(parts)
    ends = regions.low[1:]
    p = np.concatenate([p, ends - 1e-7, ends + 1e-7])
    outside = np.array([radius(parts[0] + q * parts[1] + q**2 * parts[2]) - 1 for q in p])
    found = labels(regions, p)
    assert ((found < 0) | (found == (outside < 0)) | (np.abs(outside) < 1e-11)).all()


def test_a_crossing_that_newtons_method_does_not_find_is_left_open(monkeypatch):
    """The rest of the range is proved box by box, so a crossing that is missed cannot be passed over."""
    nothing = np.zeros(0)
    none = reduced_equation._Crossings(np.zeros(0, int), nothing, nothing, nothing)
    monkeypatch.setattr(reduced_equation.ReducedEquation, "crossings", lambda *_: none)
    monkeypatch.setattr(reduced_equation, "MOST_BOXES", 20_000)
    monkeypatch.setattr(
        along_any, "tiles_of", lambda *_, **__: reduced_equation.Tiles.of(np.zeros(0, int), nothing, nothing, 0)
    )
    parts = np.zeros((3, STATES + 1, STATES + 1))
    parts[0, np.arange(1, STATES + 1), np.arange(STATES)] = 1
    parts[0, 0, -1], parts[1, 0, -1] = 0.995, 0.01
    assert (regions_of(parts).doubt != Doubt.NONE).all()


@pytest.mark.asks("prove")  # doubles leave the places where the link is nearly 0
@pytest.mark.parametrize("pole", [0.96, 0.99])
def test_a_link_that_is_tiny_and_0_at_some_values_may_close_a_loop_of_large_gains(pole):
    """z^26 (z - pole) = e(p), e = 4e10 times the link between two lines of 13 ticks: for e > 0 the largest root is real, and it
    crosses z = 1 at e = 1 - pole; at the zeros of the link the roots are 0 and the pole."""
    link = "2.5e-10*(p - 1.53)*(p - 1.37)*(p - 1.71)*(p - 1.013)*(p - 1.987)"
    line = {"type": "delay", "steps": 13}
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"p": 1.4},
        "block": {"a": line, "b": line, "x": {"type": "tf", "discrete": True, "num": [1], "den": [1, -pole]}},
        "wire": {"a.u": "2e5*x.y", "b.u": f"{link}*a.y", "x.u": "2e5*b.y"},
        "sweep": {"along": "p", "p": {"start": 1, "stop": 2}},
    }
    table = wavesweep.compile(tables).stable_intervals()
    assert table.certified.all()
    for p in np.linspace(1, 2, 401):
        e = 10 * np.prod(p - np.array([1.53, 1.37, 1.71, 1.013, 1.987]))
        stable = ((table.low <= p) & (p <= table.high)).any()
        if e > 1 - pole + 1e-9:
            assert not stable
        if abs(e) < (1 - pole) * 0.99:  # the pole and e are too small together for a root on the circle
            assert stable


@pytest.mark.parametrize("later", [None, {"type": "delay", "steps": 15, "every": 2, "phase": 1}])
def test_a_slow_crossing_behind_long_delays_is_known_to_the_digits_of_its_distance_from_1(monkeypatch, later):
    """A mass on a spring of 2 N/m that is felt late, also at two rates: the crossing is at 1.4 rad/s of 1000 ticks a second."""
    nothing = reduced_equation.Tiles.of(np.zeros(0, int), *np.zeros((2, 0)), 0)
    monkeypatch.setattr(along_any, "tiles_of", lambda *_, **__: nothing)
    late = {"type": "delay", "steps": 100 if later is None else 80, "every": 1 if later is None else 3}
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"d": 1.0},
        "block": {"body": {"type": "mass", "mass": 1, "damping": "d"}, "late": late, "last": later or {"type": "gain", "k": 1}},
        "wire": {"late.u": "2*body.x", "last.u": "late.y", "body.f": "-last.y"},
    }
    loop = wavesweep.compile(tables)
    (row,) = loop.stable_intervals("d", (0.01, 100)).itertuples()
    assert row.certified
    below, above = loop.spectral_radius(d=row.low * np.array([1 - 1e-6, 1 + 1e-6]))
    assert above < 1 < below
