"""Loops that explode within every frame in a narrow window of a parameter, and leave no trace beside it.

A sampled velocity feedback `b v` has the damping `d + b sin(w T)/(w T)` on a hand's spring, w its frequency: negative for
`w T` between pi and 2 pi. Beside the window the mode decays so fast within a frame that the frame's matrix keeps nothing of it.
"""

import warnings

import numpy as np
from stress.judge import Verdict
from stress.numbers import points, verdict_on
from stress.specs import spread
from support.specs import DEFAULTS, nested

import wavesweep

PATHS = ("operator.stiffness", "device.mass")
SCANNED = 400  # values at which the eigenvalues are looked at
CLEAR = 1e-9  # of a spectral radius beside 1


def question(seed):
    """(values, path, span)."""
    r = np.random.default_rng(seed)
    fast, mass = 1000.0, spread(r, 0.02, 0.5)
    narrow = r.random() < 0.6  # about w T = pi alone, and damped so well that the mode is gone elsewhere
    turn = float(r.uniform(0.95, 1.05) if narrow else r.uniform(0.6, 2.4)) * np.pi  # w T somewhere in the span
    b = spread(r, 1.0, 100.0)
    values = DEFAULTS | {
        "rates.ratio": int(r.choice([400, 1000] if narrow else [100, 200, 400, 1000])),
        "controller.kind": str(r.choice(["pmw", "pmw-lm", "dc-lm"])), "controller.b": b,
        "device.mass": mass, "device.damping": b * (r.uniform(0.35, 0.6) if narrow else r.uniform(0.05, 0.8)),
        "operator.stiffness": (turn * fast) ** 2 * mass,
        "local_model.B_LM": b * r.uniform(0.1, 1.0), "local_model.K_LM": spread(r, 1.0, 2e3),
    }  # fmt: skip
    path, decades = str(r.choice(PATHS)), r.uniform(0.9, 1.5 if narrow else 4.0)
    low = values[path] * 10.0 ** (-decades * r.random())
    return values, path, (low, low * 10.0**decades)


def judge(seed) -> list[Verdict]:
    """One verdict, of the only column: certified counts about every end and in every part, and wherever in a scan the
    eigenvalues contradict the answer."""
    values, path, span = question(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loop = wavesweep.compile(nested(values))
        table = loop.stable_intervals(path, span)
    rows = [(low, high) for low, high in zip(table["low"], table["high"], strict=True) if np.isfinite(low)]
    sure = bool(table["certified"].all())
    scan = np.geomspace(*span, SCANNED + 2)[1:-1]
    inside = np.array([any(a < p < b for a, b in rows) for p in scan])
    radius = loop.spectral_radius(**{path: scan})
    claims = [(p, True) for p in scan[inside & (radius > 1 + CLEAR)]]
    claims += [(p, False) for p in scan[~inside & (radius < 1 - CLEAR)]] if sure else []
    claims += [(p, claim) for p, claim in points(seed, rows, span) if claim or sure]
    return [verdict_on(claims, values, path, table)]
