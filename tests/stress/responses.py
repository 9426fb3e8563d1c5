"""Responses at the extremes against ball arithmetic."""

import warnings

import numpy as np
from flint import arb, ctx
from stress.specs import FAMILIES, spread
from support import balls

from wavesweep.analysis.response import prepare, steady_state
from wavesweep.diagram import draw
from wavesweep.errors import IllPosedLoopError

BITS = (256, 512, 1024, 2048, 4096)
STEP = arb(10) ** -25  # relative, to either side of a frequency where the formula is 0/0


def question(seed, family):
    """(values, frequencies): three at random, and two multiples of the slow rate where there are any."""
    r = np.random.default_rng(seed)
    values = FAMILIES[family](r)
    fast, ratio = values["rates.fast_hz"], values["rates.ratio"]
    frequency = [spread(r, 1e-3, 1.0), spread(r, 1e-2, 0.499 * fast), float(r.uniform(0, 0.499 * fast))]
    frequency += [m * fast / ratio for m in sorted({1, int(r.integers(1, max(2, ratio // 2)))}) if m < ratio / 2]
    return values, np.array(frequency)


def judge(seed, family):
    """(largest relative error of the admittance, of the impedance, where it is) or None where there is no answer to give.

    The impedance's error is relative to a millionth of the wall at least: it may vanish.
    """
    values, frequency = question(seed, family)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            diagram = draw(values)
            loop = prepare(diagram, values["environment.K_VE"], values["environment.B_VE"])
        except IllPosedLoopError:
            return None
        found = np.stack(steady_state(loop, frequency), axis=-1)
    worst = (0.0, 0.0, 0.0)
    for f, ours in zip(frequency, found, strict=True):
        truth = exact(values, f)
        if truth is None:
            continue
        floor = np.array([0.0, 1e-6 * values["environment.K_VE"]])
        with np.errstate(invalid="ignore"):
            error = np.abs(ours - truth) / np.maximum(np.abs(truth), floor)
        error = np.where(np.isnan(error), np.inf, error)
        worst = max(worst, (float(error.max()), float(error[0]), float(f)))
    return worst


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
        if all(p.is_finite() and p.real.rad() + p.imag.rad() < 1e-18 * p.abs_lower() for p in pair):
            return np.array([complex(p) for p in pair])
    return None
