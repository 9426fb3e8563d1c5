"""Two ports of loops without further ranges: checked margins, Llewellyn's index, and
terminations that destabilise."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import eigenvalues
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop, device_of, with_hand
from wavesweep.passive.port_ranges import cover_of
from wavesweep.passive.two_ports import NEAR_REST, Pair, impedances, least_shunt, pairs_of, worst
from wavesweep.program.analyses.claims import SETTLED_WITHIN
from wavesweep.program.number_words import in_all_digits

ENVIRONMENT = tuple(
    f"environment.{path.partition('.')[2]}" for path in HAND
)  # the numbers of what is at the second port
ZERO_EIGENVALUE = 1e-100  # of an eigenvalue, in place of 0
ALONE = (0.0, 0.0)  # the range of a number that does not vary
LIMITS = np.array(
    [(-4.0, -1.0) * 2, (2.0, 6.0) * 2]
)  # decimal logarithms of mass and stiffness at both ports
BRED = 200  # pairs of a generation of that search
SURELY_NEGATIVE = 1e-7  # size of a damping ratio that is surely negative
CURVE, HALVINGS = 300, 22  # frequencies of an index, and of its range
LEAST_INDEX = 0.001  # that is looked for; the largest is its reciprocal


class PairMargin(NamedTuple):
    """Two ports of a loop, as the columns of its row.

    damping: N*s/m that both ports may lose, NaN of an unstable loop; if negative, the loop is
    stable with all terminations that have so much each. omega: the frequency that decides, rad/s.
    stable: with every pair of passive terminations. certified: that is checked or refuted for all
    frequencies, and the damping checked but for SETTLED_WITHIN. counterexample: terminations, in
    words.
    """

    damping: float
    omega: float
    stable: bool = False
    certified: bool = False
    counterexample: str = ""


def pair_margin(loop: HeldLoop) -> PairMargin:
    """The margin of a single loop."""
    drawn, cover = loop.drawn(), cover_of(loop, "")
    period = float(np.ravel(drawn.period)[0])
    pairs = pairs_of(loop, "", ALONE)
    (shunt,), (theta,) = least_shunt(pairs, np.zeros(1))
    if shunt == -np.inf:
        return PairMargin(np.nan, np.nan)
    damping = float(shunt) * period
    less = pairs_of(loop, "", ALONE, damping - SETTLED_WITHIN * abs(damping))
    certified, words = Pair(less).open_in(0.0, 0.0, cover) == [], ""
    if damping < 0:
        sign, _, error, _ = Pair(pairs).witness(0.0, 0.0).values(np.zeros((1, 1)), None)
        certified &= bool(((sign.real > 0) & (EPS * error < 1)).all())
        words = counterexample(loop)
    omega = 0.0 if theta == NEAR_REST else float(theta) / (period * drawn.ticks)
    return PairMargin(damping, omega, damping > 0, certified, words)


def curve(loop: HeldLoop) -> dict[str, np.ndarray]:
    """Frequencies (Hz), Llewellyn's index and the damping that can be taken away at both ports
    (N*s/m) there, of one loop.

    The index is the factor by which the product of the transmissions between the ports, as
    impedances, may be larger: `2 Re z11 Re z22 / (|z12 z21| + Re z12 z21)` with one tick in a
    frame.
    """
    drawn = loop.drawn()
    period = float(np.ravel(drawn.period)[0])
    theta = np.geomspace(1e-3 * np.pi, np.pi, CURVE)
    lifted = pairs_of(loop, "", (0.0, 0.0))(np.zeros(1)).lifted
    Z = impedances(lifted, np.zeros(CURVE, int), theta)
    hz = theta / (2 * np.pi * period * drawn.ticks)
    return {"frequency_hz": hz, "llewellyn": index(Z), "damping_margin": period * worst(Z).shunt}


def index(Z: np.ndarray) -> np.ndarray:
    """The index above, from LEAST_INDEX to its reciprocal, of impedances between components `(points, 2 M, 2
    M)`."""
    across = np.add.outer(range(Z.shape[-1]), range(Z.shape[-1])) % 2 == 1
    logarithm, step = np.zeros(len(Z)), -np.log10(LEAST_INDEX)
    for _ in range(HALVINGS):
        good = worst(Z * np.where(across, 10 ** (logarithm[:, None, None] / 2), 1.0)).shunt > 0
        logarithm, step = logarithm + np.where(good, step, -step) / 2, step / 2
    return 10**logarithm


def counterexample(loop: HeldLoop) -> str:
    """A mass and a spring for each port with which the loop is unstable, by its own poles; empty if
    the search finds none.

    The search breeds those with the least damped pole. It needs ports at masses.
    """
    devices = (
        device_of(loop.drawing),
        device_of(replace(loop.drawing, hand=loop.drawing.environment)),
    )
    if None in devices:
        return ""
    drawing = with_hand(with_hand(loop.drawing, devices[0], HAND), devices[1], ENVIRONMENT)
    rng, best, wide = np.random.default_rng(1), np.zeros((0, 4)), 3.0

    def ratios(logs):
        """The least damping ratio of the poles with each pair of terminations."""
        m, k, n, s = 10.0**logs.T
        numbers = dict(zip((*HAND, *ENVIRONMENT), (m, 0.0, k, n, 0.0, s), strict=True))
        loops = Loops(drawing, {**loop.values, **numbers})
        z = 1 + eigenvalues(loops.frames(loops.drift_of_frames()))[0]
        poles = np.log(np.where(np.abs(z) > ZERO_EIGENVALUE, z, ZERO_EIGENVALUE))
        return (-poles.real / np.abs(poles)).min(-1)

    for _ in range(14):  # generations
        if len(best):
            parents = best[rng.integers(len(best), size=BRED)]
        else:
            parents = LIMITS.mean(0)
        logs = np.concatenate(
            [best, np.clip(parents + wide * rng.uniform(-1, 1, (BRED, 4)), *LIMITS).round(3)]
        )
        best = logs[np.argsort(ratios(logs))[:20]]  # those that are kept
        wide /= 1.35
    if ratios(best[:1])[0] > -SURELY_NEGATIVE:
        return ""
    m, k, n, s = 10.0 ** best[0]
    m, k, n, s = map(in_all_digits, (m, k, n, s))
    return f"hand {m} kg and {k} N/m, environment {n} kg and {s} N/m"
