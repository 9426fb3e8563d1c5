"""Waves that gain energy in a march exactly where the norm says that they may."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt
from support.held import channel_norm

from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.passive.channel import channel_of


def worst_wave(values, frames: int) -> np.ndarray:
    """The outgoing wave that gains most: the worst input at the worst frequency for so many frames, a value per tick.

    values: flat keys, numbers. The worst input is the singular vector of the lifted way out. It is scaled to a largest value of
    1.
    """
    channel, norm = channel_of(loop_drawing(values), values), channel_norm(values)
    theta, way = float(norm.outward_omega * channel.frame), channel.outward.lifted()
    E, T, O, G = (part[0] for part in (way.E, way.T, way.O, way.G))
    H = T + O @ np.linalg.solve((np.exp(1j * theta) - 1) * np.eye(len(E)) - E, G)
    vector = np.linalg.svd(H)[2][0].conj()
    wave = (np.exp(1j * theta * np.arange(frames))[:, None] * vector).real.ravel()
    return wave / np.abs(wave).max()


def filtered(values, name, waves):
    """The waves behind the filter of that name, which was at rest before."""
    order, cutoff_hz = values[f"filters.{name}.order"], values[f"filters.{name}.cutoff_hz"]
    passes = "high" if name == "hp" else "low"
    return sosfilt(butter(order, cutoff_hz, passes, fs=values["rates.fast_hz"], output="sos"), waves)


def run_out(values, sent, tail_frames: int = 200) -> float:
    """Energy out over energy in of the wave u_m (`(ticks,)`) to the environment, and then nothing for `tail_frames` frames.

    The filters are scipy's, which knows nothing of lifting: a witness of `channel_norm`.
    """
    ratio = values["rates.ratio"]
    waves = np.concatenate([np.asarray(sent, float), np.zeros(ratio * tail_frames)])
    sampled = filtered(values, "lp1", waves)[::ratio]
    passed = filtered(values, "hp", waves) if values["controller.kind"] == "pmw-lm" else None
    out = ratio * (sampled**2).sum() + (0.0 if passed is None else (passed**2).sum())
    return out / np.square(sent).sum()


def run_back(values, slow, local, tail_frames: int = 200) -> float:
    """The same of v_s (a value per frame) and v_l (one per tick, as many frames) back to the user.

    The wave that reaches the user is `v_m = v_1 + v_2`: the held v_s, from phase `delay` on, and what LP2 lets by.
    """
    ratio = values["rates.ratio"]
    delay, late = values["environment.delay"], values["local_model.delay"]
    rest = np.zeros(ratio * tail_frames)
    held = np.concatenate([np.zeros(delay), np.repeat(slow, ratio), rest[delay:]])
    passed = filtered(values, "lp2", np.concatenate([local, rest]))
    user = held + np.concatenate([np.zeros(late), passed])[: held.size]
    return np.square(user).sum() / (ratio * np.square(slow).sum() + np.square(local).sum())


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize(("order", "cutoff_hz"), [(1, 10.0), (2, 30.0), (3, 60.0)])
def test_a_marched_wave_gains_the_square_of_the_norm(values, kind, order, cutoff_hz):
    """A long wave comes as near to it as the filters' coming and going lets it, and no nearer than the norm."""
    v = values(kind, **{"filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff_hz})
    limit = float(channel_norm(v).outward) ** 2
    gains = [run_out(v, worst_wave(v, frames)) for frames in (20, 80, 640)]
    assert limit > 1
    assert gains[0] < gains[1] < gains[2] <= limit
    assert gains[2] == pytest.approx(limit, rel=3e-3)
    assert gains[2] > 1


@pytest.mark.slow
@pytest.mark.parametrize("tone_hz", [0.0, 50.0])
def test_no_wave_gains_energy_where_the_norm_is_one(values, tone_hz):
    v = values("pmw", **{"filters.lp1.order": 8})
    assert channel_norm(v).passive
    rng = np.random.default_rng(3)
    shapes = [
        worst_wave(v, 100), rng.standard_normal(4000), np.cumsum(rng.standard_normal(2000)),
        np.cos(2 * np.pi * tone_hz * np.arange(4000) / 1000), np.ones(20), np.eye(1, 40)[0],
    ]  # fmt: skip
    for sent in shapes:
        assert run_out(v, sent) <= 1 + 1e-10


@pytest.mark.parametrize("delay", [0, 7, 20])
def test_on_the_way_back_two_equal_constant_waves_become_one_of_twice_their_energy(values, delay):
    v = values("pmw-lm", **{"environment.delay": delay})
    gains = [run_back(v, np.ones(frames), np.ones(20 * frames)) for frames in (20, 400)]
    assert 1 < gains[0] < gains[1] <= float(channel_norm(v).inward) ** 2
    assert gains[1] == pytest.approx(2.0, rel=5e-3)


def test_the_channel_is_the_nearer_to_passive_the_higher_its_order(values):
    norms = [float(channel_norm(values("pmw", **{"filters.lp1.order": order})).norm) for order in (1, 2, 4)]
    assert [round(norm, digits) for norm, digits in zip(norms, (4, 4, 7), strict=True)] == [1.0533, 1.0017, 1.0000024]
