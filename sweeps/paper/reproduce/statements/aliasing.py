"""Sections 2 and 3: aliasing, the filters, and whether the wave channel is passive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from reproduce.felt_responses import show
from reproduce.paper_loops import BASE, PaperLoops
from reproduce.readings import ANTI_ALIASING, FILTERS, Reading, readings, under
from reproduce.resolvent import solved_response
from reproduce.verdicts import Answer, Finding, Statement, over
from wavesweep.engine._loops.filters import butterworth
from wavesweep.engine._monodromy.unit_circle import on_circle
from wavesweep.passive.channel import NORM_TOLERANCE, ChannelNorm

HIGHEST_HZ = 24.0
LP1 = readings(ANTI_ALIASING)
BOTH_FILTERS = readings((*ANTI_ALIASING, *under("filters.hp.")))


def aliasing_injects_energy(paper: PaperLoops) -> Finding:
    """Norm of the wave channel without the anti-aliasing filter; above 1 it can give out more energy than it takes
    in."""

    def check(norm: ChannelNorm) -> Answer:
        return Answer(bool(norm.norm > 1), f"norm 1 + {show(norm.norm - 1)}")

    return over(BASE, check, paper.channels("pmw", BASE, {"filters.lp1.order": 0}))


def low_pass_makes_passive(paper: PaperLoops) -> Finding:
    """Norm of the wave channel with LP1 of order 1 to 12 at 1 to 24 Hz: whether it is at most 1. Where it is within 1e-10
    of 1, what a constant wave gains decides: LP1 lets it pass whole, and its images about the slow rate add the sum of
    |LP1|^2 over 50, 100, ... 950 Hz, which no Butterworth filter makes 0. So none is passive; some come near."""
    return _passive(LP1, paper.channels("pmw", LP1), paper.values("pmw", LP1))


def low_pass_ensures_passivity(paper: PaperLoops) -> Finding:
    """The same for the way from the user to both environments, (u_m) to (u_s, u_h), with HP beside LP1."""
    return _passive(BOTH_FILTERS, paper.channels("fig6", BOTH_FILTERS), paper.values("fig6", BOTH_FILTERS))


def _passive(tried: Sequence[Reading], norms: Sequence[ChannelNorm], values: Sequence[Mapping]) -> Finding:
    """Whether the way out is passive under each reading, with the smallest norm of all, and of all at 24 Hz."""
    excess = [_excess(norm, each) for norm, each in zip(norms, values, strict=True)]
    at_24_hz = [number for number, each in enumerate(values) if each["filters.lp1.cutoff_hz"] == HIGHEST_HZ]
    least, least_there = (min(rows, key=excess.__getitem__) for rows in (range(len(excess)), at_24_hz))
    nearest = (
        f"nearest to passive: 1 + {excess[least]:.3g} ({tried[least].label}); "
        f"at {HIGHEST_HZ:g} Hz: 1 + {excess[least_there]:.3g} ({tried[least_there].label})"
    )
    return over(tried, lambda each: Answer(each <= 0, f"norm 1 + {each:.3g}; {nearest}"), excess)


def _excess(norm: ChannelNorm, values: Mapping) -> float:
    """Excess over 1 of the norm of the way out; a lower bound if it is within its own tolerance of 1."""
    measured = float(norm.outward) - 1
    return measured if measured > NORM_TOLERANCE else _gain_of_a_constant(values)


def _gain_of_a_constant(values: Mapping) -> float:
    """Excess over 1 of the channel's gain for a constant wave: `sqrt(1 + s) - 1`, `s = sum |LP1(2 pi m/M)|^2`.

    A bilinear Butterworth low-pass has `|LP1|^2 = 1/(1 + (tan(phi/2)/tan(phi_c/2))^2n)`; the sum is over the M - 1 images
    of 0 Hz about the slow rate.
    Accuracy: rounding of s, however small: nothing is subtracted from 1.
    """
    ratio, order = values["rates.ratio"], values["filters.lp1.order"]
    corner = np.tan(np.pi * values["filters.lp1.cutoff_hz"] / values["rates.fast_hz"])
    images = np.abs(np.tan(np.pi * np.arange(1, ratio) / ratio))
    gained = float(np.sum(np.exp(-np.logaddexp(0, 2 * order * np.log(images / corner)))))
    return gained / (1 + np.sqrt(1 + gained))


def bank_keeps_passive(paper: PaperLoops) -> Finding:
    """Norm of the wave channel with filter bank and local model, ports (u_m, v_s, v_l) to (u_s, u_h, v_m): whether it is
    at most 1. It is the root of 2 at least for every LP2 that passes 0 Hz whole, as `passive-bank.md` proves: the two
    returned waves are added, and constant ones pass hold and LP2."""

    def check(norm: ChannelNorm) -> Answer:
        numbers = f"norm 1 + {show(norm.inward - 1)} of the returned waves, 1 + {show(norm.outward - 1)} of the outgoing one"
        return Answer(bool(norm.norm <= 1), numbers)

    return over(FILTERS, check, paper.channels("fig6", FILTERS))


def bank_divides(paper: PaperLoops) -> Finding:
    """Gains of LP1 and HP from 0.1 to 400 Hz: whether LP1's is the larger one below some frequency, and HP's above it."""

    def check(values: Mapping) -> Answer:
        frequency = np.geomspace(0.1, 400, 200)
        low, high = (_gain(name, frequency, values) ** 2 for name in ("lp1", "hp"))
        passes = low > high
        below = int(passes.sum())
        holds = bool(0 < below < frequency.size and passes[:below].all())
        return Answer(holds, f"powers add up to 1, off by up to {show(np.abs(low + high - 1).max())}")

    tried = readings(under("filters.lp1.", "filters.hp."))
    return over(tried, check, paper.values("fig6", tried))


def lp2_reduces_reflections(paper: PaperLoops) -> Finding:
    """Largest part |HP LP2| of a wave that comes back to the user from a lossless local model: whether it is below that
    without LP2."""

    def check(values: Mapping) -> Answer:
        frequency = np.geomspace(0.1, 499, 2000)
        without, low = (_gain(name, frequency, values) for name in ("hp", "lp2"))
        found = [float(part.max()) for part in (without * low, without)]
        return Answer(found[0] < found[1], f"{show(found[0])}, without LP2 {show(found[1])}")

    tried = readings(under("filters.hp.", "filters.lp2."))
    return over(tried, check, paper.values("fig6", tried))


def _gain(filter_name: str, frequency_hz: np.ndarray, values: Mapping) -> np.ndarray:
    """Magnitude of a filter over frequency."""
    order, cutoff = (values[f"filters.{filter_name}.{part}"] for part in ("order", "cutoff_hz"))
    block = butterworth(filter_name, order, cutoff, 1 / values["rates.fast_hz"], filter_name == "hp")
    angle = on_circle(2 * np.pi * frequency_hz / values["rates.fast_hz"])
    return np.abs(solved_response(block, angle)[:, 0, 0])


STATEMENTS = (
    Statement(
        "2",
        "“wave aliasing due to downsampling may inject energy into the haptic system and destroy the passivity of multirate "
        "wave communications”",
        aliasing_injects_energy,
    ),
    Statement(
        "2",
        "“To eliminate aliasing and guarantee the passivity of the multi rate wave transformation, a low pass wave filter LP "
        "with cutoff frequency less than half the update frequency of the virtual environment is placed before the "
        "downsampler”",
        low_pass_makes_passive,
    ),
    Statement(
        "3",
        "“the low-pass antialiasing filter which ensures the passivity of the multi rate wave transformation”",
        low_pass_ensures_passivity,
    ),
    Statement(
        "Abstract; 3",
        "“The filter bank divides the outgoing wave at the user's side ... into a low-frequency wave, which it sends to the "
        "slowly updated virtual environment, and a high-frequency wave, which it passes along to the local model.”",
        bank_divides,
    ),
    Statement(
        "3",
        "“It can be shown that this filter bank structure maintains the passivity of the wave-based communication channels.”",
        bank_keeps_passive,
    ),
    Statement(
        "3; 3.1",
        "“a low pass wave filter which reduces the wave reflections in the feedback loop which comprises the local model”",
        lp2_reduces_reflections,
    ),
)
