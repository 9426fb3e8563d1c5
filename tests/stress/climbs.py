"""Loops whose certified ends are as wrong as a search can make them: random steps that keep what enlarges the error."""

import numpy as np
from stress.judge import NEAR_ZERO, SAME, Verdict
from stress.judge import judge as verdict_of
from stress.specs import Question, maybe, spread, usual

STEPS = 40  # tries of one climb; a long run asks for more
HEAVIEST, FEEBLEST = 100.0, 1e-3  # kg, and N*s/m of a wave impedance
RANGES = {
    "device.mass": (1e-3, HEAVIEST), "device.damping": (1e-3, 1e2), "operator.mass": (1e-3, HEAVIEST),
    "operator.damping": (1e-3, 1e2), "operator.stiffness": (1e-2, 1e4), "controller.b": (FEEBLEST, 1e3),
    "controller.Kp": (1e-3, 1e3), "local_model.K_LM": (1e-1, 1e5), "rates.fast_hz": (500.0, 1e5),
}  # fmt: skip
CUTOFFS = tuple(f"filters.{name}.cutoff_hz" for name in ("lp1", "hp", "lp2"))


def start(r) -> Question:
    """A loop within the ranges, and one column."""
    values = usual(r) | {key: spread(r, *span) for key, span in RANGES.items() if not key.startswith("operator")}
    values |= {key: maybe(r, spread(r, *RANGES[key]), 0.5) for key in RANGES if key.startswith("operator")}
    values |= {f"filters.{name}.order": int(r.integers(0, 13)) for name in ("lp1", "hp", "lp2")}
    values |= {key: spread(r, 1e-3, 0.49) * values["rates.fast_hz"] for key in CUTOFFS}
    along = str(r.choice(["K_VE", "B_VE"]))
    span = (0.0, float(r.choice([2e4, 1e5] if along == "K_VE" else [15.0, 500.0])))
    return Question(values, along, span, (spread(r, 1e-2, 1e2 if along == "K_VE" else 1e6),))


def moved(r, question) -> Question:
    """The same with a few numbers changed, by factors from 1.001 to 10."""
    values = dict(question.values)
    for key in r.choice([*RANGES, *CUTOFFS], 3):
        factor = np.exp(r.normal() * 10.0 ** r.uniform(-3, 0.4))
        low, high = RANGES.get(key, (1e-3 * values["rates.fast_hz"], 0.49 * values["rates.fast_hz"]))
        values[key] = float(np.clip(values[key] * factor, low, high)) if values[key] else values[key]
    for key in CUTOFFS:
        values[key] = min(values[key], 0.49 * values["rates.fast_hz"])
    fixed = tuple(float(f * np.exp(r.normal() * 0.3)) for f in question.fixed)
    return Question(values, question.along, question.span, fixed)


def judge(seed, steps=STEPS) -> list[Verdict]:
    """The verdict on the column of the way whose certified ends were farthest off."""
    r = np.random.default_rng(seed)
    here = start(r)
    best, worst = _height(here)
    for _ in range(steps):
        there = moved(r, here)
        height, verdict = _height(there)
        if height >= best:
            here, best, worst = there, height, verdict
    return [worst]


def _height(question):
    """How far a certified end is off, in units of what is promised, below zero where nothing is certified; the verdict."""
    verdict = verdict_of(question)[0]
    if not verdict.certified or verdict.kind == "undecided":
        return -1.0, verdict
    if verdict.kind == "wrong":
        return np.inf, verdict
    ours, theirs = (np.array([row[:2] for row in rows]) for rows in (verdict.answered, verdict.truth))
    if not ours.size or ours.size != theirs.size:  # none, or all but slivers at an end of the span
        return 0.0, verdict
    low, high = question.span
    return float((np.abs(ours - theirs) / (SAME * (np.abs(theirs) + NEAR_ZERO * (high - low)))).max()), verdict
