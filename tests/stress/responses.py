"""Responses at the extremes against ball arithmetic: how far they are off, beside how far they say that they may be."""

import warnings
from dataclasses import dataclass

import numpy as np
from flint import arb, ctx
from stress.judge import Verdict
from stress.specs import FAMILIES, maybe, spread, usual
from support import balls
from support.responses import loop_of

from wavesweep.engine._response.steady import respond
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.program.columns import SPARED

BITS = (256, 512, 1024, 2048, 4096)
STEP = arb(2) ** -83  # relative and exact, to either side of a frequency where the formula is 0/0
NOTHING = 1e-40  # control force per hand force that is none; next to a multiple of the slow rate 1e-24 is some


@dataclass(frozen=True)
class Judged:
    """One response: relative errors of admittance and impedance, their stated bounds, and where it is.

    An impedance that is zero has the error 0 if it is said to be zero, or to be unknown.
    """

    frequency: float
    error: tuple[float, float]
    bound: tuple[float, float]

    @property
    def excess(self) -> float:
        """The larger ratio of an error to its bound; 0 where no number is given."""
        return max(0.0 if np.isnan(b) else e / b for e, b in zip(self.error, self.bound, strict=True))


def resonant(r):
    """No wall, next to none or a usual one, a device without damping, a spring in the hand, no local model."""
    values = usual(r)
    ratio = int(r.choice([1, 2, 3, 10, 20, 33, 40, 100, 200]))
    values |= {"rates.ratio": ratio, "environment.delay": int(r.integers(0, ratio + 1))}
    wall = int(r.integers(4))
    values["environment.K_VE"] = (0.0, 0.0, spread(r, 1e-9, 1e-2), spread(r, 1, 1e3))[wall]
    values["environment.B_VE"] = maybe(r, spread(r, 1e-3, 2.0), 0.5)
    if r.random() < 0.5:
        values |= {"device.damping": maybe(r, spread(r, 1e-9, 1e-1), 0.5), "operator.damping": 0.0}
    values["operator.stiffness"] = maybe(r, spread(r, 1e-2, 1e4), 0.4)
    values["controller.Kp"] = maybe(r, spread(r, 1, 100), 0.4)
    if r.random() < 0.3:
        values |= {"local_model.K_LM": 0.0, "local_model.B_LM": maybe(r, 1.0, 0.5)}
    return values


RESPONSES = FAMILIES | {"resonant": resonant}


def question(seed, family):
    """(values, frequencies): random and low ones, multiples of the slow rate and the hand's resonance, and next to them."""
    r = np.random.default_rng(seed)
    values = RESPONSES[family](r)
    fast, ratio = values["rates.fast_hz"], values["rates.ratio"]
    frequency = [spread(r, 1e-3, 1.0), spread(r, 1e-2, 0.499 * fast), float(r.uniform(0, 0.499 * fast))]
    special = [m * fast / ratio for m in sorted({1, int(r.integers(1, max(2, ratio // 2)))}) if m < ratio / 2]
    if family == "resonant":
        stiffness, mass = values["operator.stiffness"], values["device.mass"] + values["operator.mass"]
        own = np.sqrt(stiffness / mass) / 2 / np.pi
        special += [own] if 0 < own < 0.499 * fast else []
        frequency += [1e-6, spread(r, 1e-7, 1e-3)]
        frequency += [f * (1 + s * spread(r, 1e-12, 1e-6)) for f in special for s in (-1, 1)]
    return values, np.array(frequency + special)


def judge(seed, family) -> list[Judged] | None:
    """Every response of this number; None where there is no answer to give."""
    values, frequency = question(seed, family)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            loop = loop_of(values)
        except IllPosedLoopError:
            return None
        found = respond(loop, frequency)
    judged = []
    for i, f in enumerate(frequency):
        truth = exact(values, float(f))
        if truth is not None:
            ours = (complex(found.admittance[i]), complex(found.impedance[i]))
            bound = (float(found.admittance_error[i]), float(found.impedance_error[i]))
            judged.append(Judged(float(f), tuple(map(relative, ours, truth)), bound))
    return judged


def verdicts(seed) -> list[Verdict]:
    """One per response of the family "resonant": right if no number is further off than it says."""
    found = judge(seed, "resonant")
    if found is None:
        return [Verdict("refused", certified=False)]
    return [_verdict(judged) for judged in found]


def _verdict(judged):
    sure = max(judged.bound) <= SPARED
    numbers = ([judged.frequency, *judged.error], [*judged.bound])
    return Verdict("wrong" if judged.excess > 1 else "right", sure, 1, "" if sure else "rounding", max(judged.error), *numbers)


def relative(ours, truth):
    """Relative error, of a zero too."""
    if truth == 0:
        return 0.0 if ours == 0 or np.isnan(ours) else np.inf
    return abs(ours - truth) / abs(truth)


def exact(values, frequency):
    """(admittance, impedance) to double precision, or None where the bits do not do."""
    multiple = frequency * values["rates.ratio"] / values["rates.fast_hz"]
    sides = (-1, 1) if multiple == round(multiple) else (0,)
    for bits in BITS:
        ctx.prec = bits
        try:
            both = [balls.response(values, arb(frequency) * (1 + s * STEP)) for s in sides]
        except ZeroDivisionError:  # so says python-flint of a matrix that may be singular for all that these bits know
            continue
        pair = [sum(part) / len(sides) for part in zip(*both, strict=True)]
        zero = NOTHING / pair[0].abs_lower() if pair[0].is_finite() and not pair[0].contains(0) else 0
        if all(
            p.is_finite() and p.real.rad() + p.imag.rad() < 1e-18 * (p.abs_lower() + tiny)
            for p, tiny in zip(pair, (0, zero), strict=True)
        ):
            return complex(pair[0]), 0j if pair[1].abs_lower() < zero else complex(pair[1])
    return None


def exact_gain(values, frequency):
    """The largest singular value of the map from a frame's forces to its positions, or None where the bits do not do."""
    for bits in BITS:
        ctx.prec = bits
        try:
            entries = [[complex(e) for e in row] for row in balls.lifted(values, arb(frequency)).tolist()]
        except (ZeroDivisionError, ValueError):
            continue
        return float(np.linalg.svd(np.array(entries), compute_uv=False)[0])
    return None
