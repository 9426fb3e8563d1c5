"""What a response or a cut of a loop comes to, by marches of its periods: gains, steps, noise, and what a factor at a cut does.

A march of unit inputs in each tick of a period gives z+ = A z + B w, y = C z + D w of all ticks of it in turn.
"""

import math

import numpy as np
from meaning.machine import radius
from scipy.optimize import minimize_scalar

LONGEST = 20_000  # ticks of a march
GONE = 1e-12  # of the largest sample, below which all samples of as many frames as there is memory mean that none follows
FREQUENCIES = 200  # of a grid, beside the angles of all modes, about whose best ones a peak is looked for
BEST = 4
FACTORS = 25  # of a range, at which the radius is looked at
STILL = 1e-5  # rad; nearer to 0 modes at 1 that nothing reads leave no digits
AT_REST = 1e-9  # of the largest change of memory in a period, below which it stays as it is
MOVES = 1e-9  # of a final value, by which it may differ from tick to tick


def samples(lifted) -> np.ndarray | None:
    """H[j]: outputs of a period for a unit input in each tick of the j-th one before; None if they go on for long."""
    A, B, C, D = lifted
    found = [D]
    moved = B
    largest = abs(D).max()
    quiet = 0
    while quiet <= len(A):
        if len(found) * len(D) > LONGEST:
            return None
        found.append(C @ moved)
        moved = A @ moved
        size = abs(found[-1]).max()
        largest = max(largest, size)
        quiet = quiet + 1 if size <= GONE * largest else 0
    return np.array(found)


def steps(pulses) -> tuple[np.ndarray, float] | None:
    """(y, final value): y[j, p, q] in tick p of the j-th frame, after a step in tick q of the first; None if ripples stay."""
    count = pulses.shape[1]
    begun = np.tril(np.ones((count, count)))  # [tick, q]: from tick q on
    before = np.concatenate([np.zeros((1, count)), pulses.sum(axis=2).cumsum(axis=0)])[:-1]
    shown = before[:, :, None] + pulses @ begun
    final = pulses.sum(axis=(0, 2))
    if np.ptp(final) > MOVES * abs(final).max() or abs(final).max() < MOVES * abs(shown).max():
        return None
    return shown, float(final.mean())


def overshoot(pulses) -> float | None:
    found = steps(pulses)
    if found is None:
        return None
    shown, final = found
    return float((shown / final).max() - 1)


def away(pulses) -> np.ndarray | None:
    """How far a step is at most from its final value so many ticks after it or later, as a share of that."""
    found = steps(pulses)
    if found is None:
        return None
    shown, final = found
    frames, count, _ = shown.shape
    later = abs(shown / final - 1).reshape(frames * count, count)
    farthest = np.zeros(frames * count)
    for tick in range(count):
        farthest[: frames * count - tick] = np.maximum(farthest[: frames * count - tick], later[tick:, tick])
    return np.maximum.accumulate(farthest[::-1])[::-1]


def rms(pulses) -> float:
    """Variances of independent inputs add up; the mean over the ticks of a frame."""
    return math.sqrt((pulses**2).sum() / pulses.shape[1])


IN_TIME = {"overshoot": overshoot, "rms": rms}  # and step_settling


def drifts(lifted) -> bool:
    """Whether the outputs have another value for memory that stays as it is without an input, or moves such memory alone."""
    A, _, C, _ = lifted
    change = A - np.eye(len(A))
    stays = _kernel(change)
    moves = _kernel(np.hstack([change, stays]))[: len(A)]
    found = np.hstack([stays, moves])
    return bool((abs(C @ found) > AT_REST * abs(C).max()).any())


def _kernel(matrix) -> np.ndarray:
    """Columns that it takes to nothing."""
    _, sizes, directions = np.linalg.svd(matrix)
    filled = np.append(sizes, np.zeros(len(directions) - len(sizes)))
    return directions[filled < AT_REST * sizes.max(initial=1.0)].T


def at_angle(lifted, angle: float) -> np.ndarray:
    """C (z - A)^-1 B + D at z = exp(j angle)."""
    A, B, C, D = lifted
    return C @ np.linalg.solve(np.exp(1j * angle) * np.eye(len(A)) - A, B) + D


def peak(lifted, low: float, high: float, size_at) -> float | None:
    """The largest `size_at(angle)` for angles of z from low to high, near the angles of modes and in between.

    None if it grows without end towards 0, as of what drifts.
    """
    if size_at(STILL / 4) > 2 * size_at(STILL):
        return None
    turns = abs(np.angle(np.linalg.eigvals(lifted[0])))
    if high > math.pi:  # of a sine, whose angle in a frame may be that of a mode by whole turns
        count = len(lifted[3])
        turns = np.concatenate([sign * turns + 2 * math.pi * at for at in range(count) for sign in (1, -1)])
    angles = np.concatenate([np.linspace(low, high, FREQUENCIES), turns[(low < turns) & (turns < high)]])
    angles.sort()
    sizes = [size_at(angle) for angle in angles]
    largest = max(sizes)
    for at in np.argsort(sizes)[-BEST:]:
        ends = (angles[max(at - 1, 0)], angles[min(at + 1, len(angles) - 1)])
        best = minimize_scalar(lambda angle: -size_at(angle), bounds=ends, method="bounded", options={"xatol": 1e-9})
        largest = max(largest, -best.fun)
    return float(largest)


def gain(lifted, period: float, wanted: dict) -> float | None:
    """The largest singular value of all ticks of a frame."""
    low, high = wanted.get("band_hz", (0.0, 0.5 / period))
    ends = max(2 * math.pi * low * period, STILL), 2 * math.pi * high * period
    return peak(lifted, *ends, lambda angle: np.linalg.norm(at_angle(lifted, angle), 2))


def of_sines(lifted) -> float | None:
    """How much of a sine comes out as the same sine at most, of those below half of the rate at which the input is read."""
    _, B, _, D = lifted
    count = len(D)
    read = np.flatnonzero((B != 0).any(0) | (D != 0).any(0))
    apart = np.gcd.reduce(np.append(read - read[:1], count))

    def at(angle):
        sine = np.exp(1j * angle * np.arange(count) / count)
        return abs(sine.conj() @ at_angle(lifted, angle) @ sine) / count

    return peak(lifted, STILL, math.pi * count / apart, at)


def sensitivity(lifted, less: float = 0.0) -> float | None:
    """The largest size of 1/(1 + L) - less, which is what comes of an input that is added at the cut to it."""
    part = less * np.eye(len(lifted[3]))
    return peak(lifted, STILL, math.pi, lambda angle: np.linalg.norm(at_angle(lifted, angle) - part, 2))


def worst_factor(lifted, drift: int, factors) -> float:
    """The largest radius of the loop with a factor f at its cut, of those that `factors(share)` gives for shares from 0 to 1.

    The cut is f times what is computed there, so w = (f - 1) y if y = C z + (D - 1) w is that.
    """
    A, B, C, D = lifted
    one = np.eye(len(D))

    def at(share):
        more = factors(share) - 1
        return radius(A + more * B @ np.linalg.solve(one - more * (D - one), C), drift)

    shares = np.linspace(0, 1, FACTORS)
    sizes = [at(share) for share in shares]
    best = int(np.argmax(sizes))
    ends = (shares[max(best - 1, 0)], shares[min(best + 1, FACTORS - 1)])
    found = minimize_scalar(lambda share: -at(share), bounds=ends, method="bounded", options={"xatol": 1e-6})
    return float(max(*sizes, -found.fun))


def margin_used(kind: str, wanted: float, lifted, drift: int) -> float | None:
    """What has to be below 1 for a margin at a cut: peaks over their levels, or the radius of the worst factor."""
    if kind in {"Ms", "disk"}:
        largest = sensitivity(lifted, 0.5 if kind == "disk" else 0.0)
        level = 1 / wanted if kind == "disk" else wanted
        return None if largest is None else largest / level
    if kind == "gain":
        return worst_factor(lifted, drift, lambda share: wanted ** (2 * share - 1))
    return worst_factor(lifted, drift, lambda share: np.exp(1j * math.radians(wanted) * share))
