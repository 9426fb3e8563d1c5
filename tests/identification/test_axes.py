"""Devices of several axes, from logs of a march with matrix exponentials, or with friction in fine steps."""

import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.identification.axes import as_early_as_the_force
from wavesweep.identification.device_spec import spec_text

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
