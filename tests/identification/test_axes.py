"""Devices of several axes, from logs of a march with matrix exponentials, or with friction in fine steps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.identification.axes import _coupled, _numbers, as_early_as_the_force
from wavesweep.identification.device_spec import spec_text
from wavesweep.identification.model import Model
from wavesweep.identification.prediction.scaled_log import scaled
from wavesweep.identification.prediction.search import Place, Search

PERIOD, STEP = 1e-3, 2e-5


def marched(M, D, F, force, late, beside):
    """Positions at each tick of M a + D v + F sgn(v) = f + beside, the force held and late by a part of a tick."""
    count, whole, part = len(M), int(late), late % 1
    delayed = np.concatenate([force[:1].repeat(whole + 1, axis=0), force])
    A = np.zeros((3 * count, 3 * count))
    A[:count, count : 2 * count] = np.eye(count)
    A[count : 2 * count, count:] = np.linalg.solve(M, np.hstack([-D, np.eye(count)]))
    parts = 10 if np.any(F) else 1
    steps = [(share * PERIOD / parts, expm(A * PERIOD * share / parts)) for share in (part, 1 - part)]
    state, places, v, W = np.zeros(3 * count), [], slice(count, 2 * count), np.linalg.inv(M)
    for tick in range(len(force)):
        places.append(state[:count])
        for (length, step), push in zip(steps, (delayed[tick], delayed[tick + 1]), strict=True):
            for _ in range(parts):
                state[2 * count :] = push + beside[tick]
                after, rubbed = step @ state, np.zeros(count)
                for axis in [*range(count)] * 5 * bool(parts > 1):  # impulses that stop each axis, or as large as they can be
                    others = rubbed * (np.arange(count) != axis)
                    stops = (after[v] - W @ others)[axis] / W[axis, axis]
                    rubbed[axis] = np.clip(stops, -F[axis] * length, F[axis] * length)
                after[v] -= W @ rubbed
                after[:count] -= length * W @ rubbed / 2
                state = after
    return np.array(places)


def log_of(seed, count, friction, hand, rows):
    """Truth by names, forces of noise held for 5 ticks, and positions as encoders show them, with the sway of a hand."""
    source = np.random.default_rng([seed, count])
    M, D = (np.diag(size * source.uniform(0.7, 1.5, count)) for size in (0.1, 0.8))
    upper = np.triu_indices(count, 1)
    M[upper], D[upper] = (source.uniform(-share, share, len(upper[0])) for share in (0.03, 0.2))
    M, D = M + M.T - np.diag(np.diag(M)), D + D.T - np.diag(np.diag(D))
    F, late = friction * source.uniform(0.5, 1.5, count), source.uniform(0, 3)
    force = source.standard_normal((rows // 5, count)).repeat(5, axis=0)
    sway = hand * np.sin(np.outer(np.arange(rows), source.uniform(4, 60, count)) * PERIOD)
    read = STEP * np.floor(marched(M, D, F, force, late, sway) / STEP + source.uniform(size=count) + 0.5)
    names = [axis + other for at, axis in enumerate("xyz"[:count]) for other in "xyz"[at:count]]
    upper = np.triu_indices(count)
    truth = dict(zip((f"mass_{name}" for name in names), M[upper], strict=True))
    truth |= dict(zip((f"damping_{name}" for name in names), D[upper], strict=True))
    truth |= {f"friction_{axis}": value for axis, value in zip("xyz", F, strict=False) if friction}
    return truth | {"delay": late}, force, read


def written(path, force, read, axes="xyz"):
    names = ["time", *axes, *(f"f{axis}" for axis in axes)]
    table = np.c_[PERIOD * np.arange(len(force)), read, force]
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("count", "friction", "hand", "seeds"), [(2, 0.0, 0.0, 2), (3, 0.0, 0.0, 1), (2, 0.1, 0.0, 1)])
def test_intervals_contain_the_matrices(tmp_path, count, friction, hand, seeds):
    inside = []
    for seed in range(seeds):
        truth, force, read = log_of(seed, count, friction, hand, 1500)
        axes = "xyz"[:count]
        path = written(tmp_path / "log.csv", force, read, axes)
        options = {"axes": list(axes), "resolution": STEP, "friction": bool(friction)}
        found = wavesweep.identify(path, **options).attrs["summary"]["parameters"]
        assert {*found} == {*truth}
        inside += [found[name]["low"] <= value <= found[name]["high"] for name, value in truth.items()]
        half = {name: found[name]["high"] - found[name]["low"] for name in truth}
        assert all(half[f"mass_{axis}{axis}"] < 0.1 * truth[f"mass_{axis}{axis}"] for axis in axes)
    assert np.mean(inside) >= 0.9


@pytest.mark.slow
def test_a_log_of_one_axis_says_that_the_forces_of_others_explain_what_it_lacks(tmp_path):
    _, force, read = log_of(1, 2, 0.0, 0.0, 1500)
    path = written(tmp_path / "log.csv", force, read, "xy")
    found = wavesweep.identify(path, columns={"force": "fx", "position": "x"}, resolution=STEP).attrs["summary"]
    assert (found["missing"], found["parameters"]["mass"]["low"]) == ("axes", None)
    assert found["residual"]["share_of_missing"] > 0.3


def test_forces_that_are_sums_of_others_are_refused(tmp_path):
    _, force, read = log_of(0, 2, 0.0, 0.0, 500)
    force[:, 1] = -2 * force[:, 0]
    with pytest.raises(UsageError, match="push each axis with a signal of its own"):
        wavesweep.identify(written(tmp_path / "log.csv", force, read, "xy"), axes=["x", "y"])


@pytest.mark.parametrize("axes", ["xy", "xyz"])
@pytest.mark.parametrize("known", [True, False])
def test_the_spec_of_axes_has_their_matrices(tmp_path, axes, known):
    """Before a wall whose normal has any direction; within the ranges of three masses, if they are known."""
    names = [one + two for at, one in enumerate(axes) for two in axes[at:]]
    value = {name: 0.1 if name[0] == name[1] else 0.01 for name in names}
    ends = {"low": 0.99, "high": 1.01} if known else {}
    parameters = {
        f"{word}_{name}": {"value": size, "unit": "kg", **{end: ends.get(end) and size * ends[end] for end in ("low", "high")}}
        for word in ("mass", "damping")
        for name, size in value.items()
    }
    parameters["delay"] = {"value": 1.5, "low": 1.4, "high": 1.6, "unit": "tick"}
    facts = {"axes": dict.fromkeys(axes), "parameters": parameters, "period_s": PERIOD, "spec_name": "log", "turns": False}
    facts |= {"missing": "", "explained": True, "measured": "position", "asked": {}}
    (tmp_path / "device.toml").write_text(spec_text(facts))
    spec = wavesweep.load(tmp_path / "device.toml")
    assert wavesweep.compile(spec).spectral_radius(K=10.0) < 1
    assert bool(spec.for_all) is known


def test_what_is_held_over_ticks_that_begin_later_is_not_smoothed_where_it_is_moved():
    """Mean forces of what is held from a later instant to the next, and of a line."""
    held = np.random.default_rng(0).normal(size=40)
    ticks = np.arange(40)
    mean = 0.78 * np.roll(held, 2) + 0.22 * np.roll(held, 3) + 0.3 * ticks
    earlier = as_early_as_the_force(mean, held, 2.22)
    np.testing.assert_allclose(earlier[3:-3], (held + 0.3 * (ticks + 2.22))[3:-3], rtol=1e-12)


def test_a_number_that_two_axes_tell_is_their_mean_and_has_the_mean_of_their_widths():
    def told(theta, half, one_way):
        log = SimpleNamespace(one_way=one_way)
        theta, half = np.array(theta), np.array(half)
        return SimpleNamespace(
            model=Model(friction=True), theta=theta, half=half, place=SimpleNamespace(log=log), searched={"delay": 9.0}
        )

    first = told([np.log(0.1), 1.0, 0.2, 1.5, 0.010, 0.05], [0.02, 0.1, 0.01, 0.02, 0.001, 0.004], False)
    second = told([np.log(0.2), 2.0, 0.3, 1.7, 0.014, 0.07], [0.05, 0.2, 0.01, 0.04, 0.003, 0.008], True)
    expected = {"mass_xx": (0.1, 0.002), "mass_xy": (0.012, 0.002), "mass_yy": (0.2, 0.01), "damping_xx": (1.0, 0.1)}
    expected |= {"damping_xy": (0.06, 0.006), "damping_yy": (2.0, 0.2), "friction_x": (0.2, 0.01), "friction_y": (0.3, np.inf)}
    found = _numbers("xy", [first, second])
    assert found == {name: pytest.approx(row) for name, row in (expected | {"delay": (1.6, 0.03)}).items()}
    for alone in (first, second):
        alone.model, alone.theta, alone.half = Model(delay=2.0), np.delete(alone.theta, [2, 3]), np.delete(alone.half, [2, 3])
        alone.place.log.one_way, alone.searched = False, {"delay": 2.0}
    assert _numbers("xy", [first, second])["delay"] == (2.0, 0.0)


def test_what_resists_an_axis_is_the_motion_of_the_other_within_each_tick():
    """Of two masses that share nothing, whose forces change 0.3 of a tick late, read without noise."""
    force = np.random.default_rng(1).standard_normal((300, 2))
    M = np.diag([0.1, 0.3])
    places = marched(M, np.diag([1.0, 2.0]), np.zeros(2), force, 1.3, np.zeros((300, 2)))
    predictions = []
    for axis, rate in enumerate((10.0, 2.0 / 0.3)):
        log = scaled(Model(), force[:, axis], places[:, axis], PERIOD, 0.0)
        search = Search(log, {"rate": rate, "square": 0.0, "delay": 1.3, "white": 1e-8, "drift": 1e-12})
        predictions.append(SimpleNamespace(place=Place(log, search, search.begun, 6)))
    numbers = {"mass_xx": (0.1, 0), "mass_xy": (0.0, 0), "mass_yy": (0.3, 0), "delay": (1.3, 0)}
    beside = _coupled("xy", numbers, list(force.T), predictions)
    late = np.roll(force, 1, axis=0)
    jumps = (late - np.roll(force, 2, axis=0)) @ np.linalg.inv(M)
    for axis in (0, 1):
        (acceleration, moment), (speed, lever) = beside[1 - axis]
        rows = slice(20, 280)
        mean = np.diff(places[:, axis])[rows] / PERIOD
        assert speed[rows] == pytest.approx(mean, abs=0.15 * mean.std())
        held = (late[:, axis] - jumps[:, axis] * 0.3 * M[axis, axis] - (1.0, 2.0)[axis] * speed) / M[axis, axis]
        assert acceleration[rows] == pytest.approx(held[rows], abs=0.02 * held.std())
        assert moment[rows] == pytest.approx(-0.105 * jumps[rows, axis])
        assert lever[rows] == pytest.approx(-acceleration[rows] * PERIOD / 12)
