"""Butterworth filters as a cascade of one-pole sections, one complex state a pole pair.

A section with the pole ``p`` (a real one, or the upper one of a conjugate pair) keeps one number ``q``:

    q' = p·q + g·u,        y = Re(r·q) + d·u

which for a pair is the normal form ``[[Re p, Im p], [-Im p, Re p]]`` written as a complex number. A direct-form section
would keep ``1 - 2·Re p + |p|²``, whose digits cancel if the poles are close to z = 1: at 10th order and 0.1 % of the
rate none is left. The products of complex numbers are written out, since a compiler may fuse those of Python's own, and the
controller that `export` writes repeats each operation.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple


class Section(NamedTuple):
    """One pole pair (complex ``p``) or one real pole of a filter; see the module for the equation."""

    p: complex
    g: float
    r: complex
    d: float


def butterworth(passes: str, order: int, cutoff_hz: float, fast_hz: float) -> tuple[Section, ...]:
    """Digital Butterworth filter: bilinear transform, prewarped so that the gain at ``cutoff_hz`` is 1/√2.

    Analogue poles ``s = tan(π·f_c/f)·exp(jπ(2k + n + 1)/2n)`` become ``p = (1 + s)/(1 - s)``; the zeros go to z = -1
    (``passes`` "low") or z = 1 ("high"). Every section has gain 1 at the middle of its pass band.

    Parameters: `order` 0 gives no section, which is no filter; `cutoff_hz` and `fast_hz` in Hz.

    Accuracy: relative 1e-13 of the pass-band gain down to cutoffs of 0.1 % of the rate at order 12.
    """
    if order == 0:
        return ()
    edge = math.tan(math.pi * cutoff_hz / fast_hz)
    angles = (math.pi * (2 * k + order + 1) / (2 * order) for k in range((order + 1) // 2))
    poles = (edge * cmath.exp(1j * angle) for angle in angles)
    return tuple(_section(passes, s, real=2 * k + 1 == order) for k, s in enumerate(poles))


def _section(passes: str, s: complex, real: bool) -> Section:
    """The section of the analogue pole ``s``, by partial fractions of ``d·(z ± 1)ⁿ/(z - p)…``."""
    if real:
        s = s.real
    p = (1 + s) / (1 - s)
    to_one, to_minus_one = -2 * s / (1 - s), 2 / (1 - s)  # 1 - p and 1 + p, without cancelling
    at_gain, at_zero = (to_one, to_minus_one) if passes == "low" else (to_minus_one, -to_one)
    g = abs(to_one) ** 0.5  # input and output of like size: the state stays of the size of the signal
    if real:
        d = at_gain / 2
        return Section(p, g, d * at_zero / g, d)
    d = abs(at_gain) ** 2 / 4
    return Section(p, g, d * at_zero**2 / (1j * p.imag) / g, d)


State = tuple[tuple[float, float], ...]
"""Real and imaginary part of each section's ``q``; the latter stays 0 behind a real pole."""


def at_rest(sections: tuple[Section, ...]) -> State:
    """The state of a cascade that has seen nothing."""
    return ((0.0, 0.0),) * len(sections)


def output(sections: tuple[Section, ...], state: State, u: float) -> float:
    """The cascade's output for the sample ``u``; its state stays as it is."""
    for (p, _, r, d), (a, b) in zip(sections, state, strict=True):
        u = r.real * a - r.imag * b + d * u if p.imag else r.real * a + d * u
    return u


def advance(sections: tuple[Section, ...], state: State, u: float) -> tuple[State, float]:
    """The state after the sample ``u``, and the output for it."""
    after = []
    for (p, g, r, d), (a, b) in zip(sections, state, strict=True):
        if p.imag:
            after.append((p.real * a - p.imag * b + g * u, p.real * b + p.imag * a))
            u = r.real * a - r.imag * b + d * u
        else:
            after.append((p.real * a + g * u, 0.0))
            u = r.real * a + d * u
    return tuple(after), u
