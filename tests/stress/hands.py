"""Walls for every hand of a wide box, against a search for a hand that breaks them which knows nothing of how they came.

python -m tests.stress --family hands --specs 256
"""

import warnings
from dataclasses import dataclass

import numpy as np
from stress.judge import Verdict
from stress.specs import maybe, spread
from support import exact
from support.held import box_intervals, ends_of, worst_modes
from support.specs import random_values

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.for_all.hand_box import HandBox
from wavesweep.haptics.held_loop import HAND as OPERATOR

SPAN = (0.0, 20000.0)
SHARES = np.array([1e-6, 1e-3, 0.01, 0.1, 0.25, 0.4, 0.55, 0.7, 0.8, 0.88, 0.94, 0.97, 0.99, 0.997, 0.9995, 1 - 1e-6])
HANDS = 1000  # tried at each of these shares of an interval
BEST = 6  # of these, how many are improved, half of them by radius and half by damping ratio
ROUNDS = 20  # of the improvement, each with
TRIALS = 10  # hands about each, ever nearer
BROKEN = 1e-9  # beyond 1, of a spectral radius


@dataclass(frozen=True)
class Question:
    """Flat values and the box."""

    values: dict
    box: HandBox


def question(seed) -> Question:
    """A loop that somebody might build, with a light device more often than not, and a box of one to four decades."""
    r = np.random.default_rng(seed)
    values = random_values(int(r.integers(2**31))) | dict.fromkeys(OPERATOR, 0.0)
    if r.random() < 0.5:
        values |= {"device.mass": spread(r, 0.01, 0.2), "rates.fast_hz": float(r.choice([1000.0, 5000.0, 10000.0, 31600.0])),
                   "controller.kind": str(r.choice(["dc", "dc-slow", "dc-slow", "dc-lm"]))}  # fmt: skip

    def between(low, high, widest, never):
        start = spread(r, low, high)
        return maybe(r, start, never), start * spread(r, 10, widest)

    return Question(values, HandBox(between(1e-3, 0.05, 300, 0.2), between(0.01, 2, 300, 0.1), between(1, 1e3, 1e4, 0.15)))


def judge(seed) -> list[Verdict]:
    """One verdict: "right" where the search finds no hand that breaks an interval; certified here means settled."""
    asked = question(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = box_intervals(asked.values, SPAN, asked.box)
        except IllPosedLoopError:
            return [Verdict("refused", certified=False)]
    rows = [(float(row["low"]), float(row["high"])) for row in found if row["intervals"]]
    broken = [hit for row in rows if (hit := breaking(asked, *row, seed)) is not None]
    settled = bool(found["settled"].all())
    why = "" if settled else asked.values["controller.kind"]
    return [Verdict("wrong" if broken else "right", settled, max(len(rows), 1), why, 0.0, rows, broken)]


def breaking(asked, low, high, seed):
    """(radius, hand, wall) where a hand of the box is unstable within the interval, else None; confirmed in 50 digits."""
    r = np.random.default_rng(seed)
    walls = low + (high - low) * SHARES
    hands = np.broadcast_to(_tried(asked, r), (SHARES.size, HANDS, 3))
    radius, damping = _modes(asked.values, hands, walls)
    chosen = np.concatenate([np.argsort(-radius, -1)[:, : BEST // 2], np.argsort(damping, -1)[:, : BEST // 2]], -1)
    share = np.take_along_axis(_shares(asked.box, hands), chosen[..., None], 1)
    for by in (0, 1):
        share, hands, radius = _improved(asked, r, share, walls, by)
    wall, hand = np.unravel_index(np.argmax(radius), radius.shape)
    if not radius[wall, hand] > 1 + BROKEN:
        return None
    held = asked.values | {"environment.K_VE": float(walls[wall])}
    held |= dict(zip(OPERATOR, hands[wall, hand].tolist(), strict=True))
    sure = float(exact.spectral_radius(held))
    return (sure, hands[wall, hand].tolist(), float(walls[wall])) if sure > 1 + BROKEN / 2 else None


def _tried(asked, r):
    """Hands of the box: evenly, in the logarithm, on faces and edges, and along resonances that alias."""
    least, high = ends_of(asked.box)
    low = np.maximum(least, 1e-4 * high)
    share = r.random((HANDS, 3))
    share = np.where(r.random((HANDS, 3)) < 0.4, np.round(share), share)
    even, log = least + share * (high - least), low * (high / low) ** share
    hands = np.where(r.random((HANDS, 3)) < 0.7, log, even)
    hands = np.where(share == 0, least, hands)
    rate = asked.values["rates.fast_hz"] / asked.values["rates.ratio"]
    some = slice(0, HANDS // 3)  # the natural frequency anywhere between two multiples of the slow rate, the lowest ten
    w = 2 * np.pi * rate * 10 * r.random(HANDS // 3)
    hands[some, 2] = np.clip(w**2 * (hands[some, 0] + asked.values["device.mass"]), least[2], high[2])
    return np.clip(hands, least, high)


def _shares(box, hands):
    low, high = ends_of(box)
    return (hands - low) / np.where(high > low, high - low, 1)


def _modes(values, hands, walls):
    shape = hands.shape[:-1]
    each = np.broadcast_to(walls[:, None], shape).reshape(-1)
    return (found.reshape(shape) for found in worst_modes(values, hands.reshape(-1, 3), each, values["environment.B_VE"]))


def _improved(asked, r, share, walls, by):
    """Random steps about the best, ever smaller, in each number by itself and in all together."""
    (low, high), hands, best, radii = ends_of(asked.box), None, None, None
    for step in 0.3 * 0.55 ** np.arange(ROUNDS):
        moves = step * r.standard_normal((*share.shape[:2], TRIALS, 3)) * (r.random((TRIALS, 3)) < 0.6)
        moves[:, :, 0] = 0
        scale = np.where(r.random((TRIALS, 1)) < 0.5, 1.0, share[:, :, None] + 1e-3)
        trial = np.clip(share[:, :, None] + moves * scale, 0, 1)
        hands = low + trial * (high - low)
        radius, damping = _modes(asked.values, hands.reshape(len(walls), -1, 3), walls)
        radius, worse = radius.reshape(trial.shape[:-1]), (radius, -damping)[by].reshape(trial.shape[:-1])
        best = worse.argmax(-1)[..., None]
        share = np.take_along_axis(trial, best[..., None], 2)[:, :, 0]
        hands = np.take_along_axis(hands, best[..., None], 2)[:, :, 0]
        radii = np.take_along_axis(radius, best, 2)[..., 0]
    return share, hands, radii
