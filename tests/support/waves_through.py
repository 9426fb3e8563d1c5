"""A wave that gains energy on its way: the channel's worst input, run through it tick by tick."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfilt

from wavesweep.loops.controllers import loop_drawing
from wavesweep.passive.channel import channel_norm, channel_of


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """Waves (sqrt(W)) that went through the channel and their energies (J).

    user: u_m, or v_m on the way back, a value per tick. slow: the wave at the environment's side, a value per frame:
    u_s, or v_s. local: that at the local model, a value per tick, None without one: u_h, or v_l. energy_in, energy_out:
    of what was sent, and of what arrived until the filters had died out.
    """

    user: np.ndarray
    slow: np.ndarray
    local: np.ndarray | None
    energy_in: float
    energy_out: float

    @property
    def gain(self) -> float:
        """Energy out over energy in; a passive channel has at most 1, any channel at most the square of its norm."""
        return self.energy_out / self.energy_in


def worst_wave(values, frames: int) -> np.ndarray:
    """The outgoing wave that gains most: the worst input at the worst frequency for so many frames, a value per tick.

    values: flat keys, numbers. The worst input is the singular vector of the lifted way out. It is scaled to a largest value of
    1.
    """
    channel, norm = (of(loop_drawing(values), values) for of in (channel_of, channel_norm))
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


def run_out(values, sent, tail_frames: int = 200) -> Passage:
    """Send the wave u_m (`(ticks,)`) to the environment, tick by tick, then nothing for `tail_frames` frames.

    The filters are scipy's, which knows nothing of lifting: a witness of `channel_norm`.
    """
    fast_hz, ratio = values["rates.fast_hz"], values["rates.ratio"]
    waves = np.concatenate([np.asarray(sent, float), np.zeros(ratio * tail_frames)])
    sampled = filtered(values, "lp1", waves)[::ratio]
    passed = filtered(values, "hp", waves) if values["controller.kind"] == "pmw-lm" else None
    out = ratio * (sampled**2).sum() + (0.0 if passed is None else (passed**2).sum())
    energy_in = np.square(sent).sum()
    return Passage(np.asarray(sent, float), sampled, passed, float(energy_in / fast_hz), float(out / fast_hz))


def run_back(values, slow, local, tail_frames: int = 200) -> Passage:
    """Send v_s (a value per frame) and v_l (one per tick, as many frames) back to the user, then nothing.

    The wave that reaches the user is `v_m = v_1 + v_2`: the held v_s, from phase `delay` on, and what LP2 lets by.
    """
    fast_hz, ratio = values["rates.fast_hz"], values["rates.ratio"]
    delay, late = values["environment.delay"], values["local_model.delay"]
    rest = np.zeros(ratio * tail_frames)
    held = np.concatenate([np.zeros(delay), np.repeat(slow, ratio), rest[delay:]])
    passed = filtered(values, "lp2", np.concatenate([local, rest]))
    user = held + np.concatenate([np.zeros(late), passed])[: held.size]
    energy_in = ratio * np.square(slow).sum() + np.square(local).sum()
    return Passage(
        user,
        np.asarray(slow, float),
        np.asarray(local, float),
        float(energy_in / fast_hz),
        float(np.square(user).sum() / fast_hz),
    )
