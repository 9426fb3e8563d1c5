"""Intervals along other numbers than the wall's, against certified counts just inside and just outside of every end."""

import warnings
from itertools import pairwise

import numpy as np
from stress.judge import Verdict
from stress.specs import FAMILIES, spread
from support import certified
from support.specs import nested

import wavesweep
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.haptics.controller_page import keys_of_page

ASIDE = 1e-7  # relative: how far from an end the counts are taken
RANGES = {
    "local_model.K_LM": (0.0, 1e2, 1e6), "local_model.B_LM": (0.0, 1.0, 1e3), "controller.Kp": (0.0, 1.0, 1e3),
    "controller.b": (1e-6, 1e2, 1e6), "device.mass": (1e-6, 1e-1, 1e2), "device.damping": (0.0, 1.0, 1e4),
}  # fmt: skip
BITS = (512, 1024, 2048)  # a count that these do not decide is not asked for


def question(seed):
    """(values, path, span)."""
    r = np.random.default_rng(seed)
    values = FAMILIES[str(r.choice(["usual", "usual", "wild", "long_filters", "feeble"]))](r)
    known = keys_of_page(values)
    path = str(r.choice([path for path in (*RANGES, "filters.lp1.cutoff_hz", "filters.lp2.cutoff_hz") if path in known]))
    if path.startswith("filters"):
        return values, path, (1e-3 * values["rates.fast_hz"], 0.499 * values["rates.fast_hz"])
    lowest, *highs = RANGES[path]
    high = spread(r, *highs)
    return values, path, (lowest and spread(r, lowest, high / 10), high)


def judge(seed) -> list[Verdict]:
    """One verdict, of the only column."""
    values, path, span = question(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            table = wavesweep.compile(nested(values)).stable_intervals(path, span)
        except IllPosedLoopError:
            return [Verdict("refused", certified=False)]
    rows = [(low, high) for low, high in zip(table["low"], table["high"], strict=True) if np.isfinite(low)]
    sure = bool(table["certified"].all())
    assert np.isfinite(rows).all()
    claims = [(p, inside) for p, inside in points(seed, rows, span) if inside or sure]
    return [verdict_on(claims, values, path, table)]


def verdict_on(claims, values, path, table) -> Verdict:
    """The verdict from claims (value, whether it is stable), each held against the certified count."""
    rows = [(low, high) for low, high in zip(table["low"], table["high"], strict=True) if np.isfinite(low)]
    wrong = [(p, count) for p, claim in claims if (count := unstable(values | {path: p})) is not None and (count == 0) != claim]
    why = table["doubt"][0]
    return Verdict("wrong" if wrong else "right", not why, max(len(rows), 1), why, 0.0, rows, wrong)


def points(seed, rows, span):
    """(value, whether it is claimed to be stable): about every end, in the middle of every part, and at random."""
    low, high = span
    ends = sorted({low, high, *(end for row in rows for end in row)})
    found = [(a + b) / 2 for a, b in pairwise(ends)]
    found += [end * (1 + s * ASIDE) for end in ends for s in (-1, 1)]
    r = np.random.default_rng(seed)
    found += [*r.uniform(low, high, 6), *(spread(r, max(low, 1e-6 * high), high) for _ in range(6))]
    return [(float(p), any(a < p < b for a, b in rows)) for p in found if low < p < high]


def unstable(values):
    """The certified count, or None."""
    try:
        return certified.Witness(values, BITS).unstable(values["environment.K_VE"], values["environment.B_VE"])
    except certified.Undecided:
        return None
