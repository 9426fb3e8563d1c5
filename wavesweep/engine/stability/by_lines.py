"""Loops with long delays in which nothing crosses the unit circle along a number: proved without their eigenvalues."""

import numpy as np

from wavesweep.engine.monodromy.delay_lines import DelayLines
from wavesweep.engine.monodromy.unit_circle import inverse, on_circle
from wavesweep.engine.stability.entries import panels_of
from wavesweep.engine.stability.spectrum import count_outside

LONG = 24  # states of delay lines, from which on this costs less than eigenvalues
TURN = 0.5  # rad by which the longest line turns over an arc at first
HALVED = 8  # times that the range is halved at most
WORK = 12  # times the arcs at first, after which a crossing is to be expected
SHRINKS = 0.95  # of weights, what is left of them at most
ROUNDED = 64 * np.finfo(float).eps  # of the terms of a sum, and so much for each state of a line
ROUNDS = 6  # of finding weights


def unstable_counts(frames, errors, span, columns: int, bounds, resolved=None) -> np.ndarray:
    """Return the number of unstable eigenvalues of each column all over a span of a number, `(columns,)`; -1 if not known.

    The others are as for `panels_of`. An eigenvalue z on the circle is where `S = z - A - C L(z) B` is singular: A, B
    and C of the states that no delay line has, closed by the lines L, which are of any length. Over an arc of the circle and a
    part of the range no entry of S changes by more than D. If `|S^-1| D` takes some weights to less, S is nonsingular there.
    """
    counts = np.full(columns, -1)
    for column in range(columns):
        samples = [lambda _, p, of=of, at=column: of(np.full(p.size, at), p.ravel()) for of in (frames, errors)]
        with np.errstate(all="ignore"):
            E = samples[0](0, np.linspace(*span, 3)).E
            lines = DelayLines.of(E) if np.isfinite(E).all() else DelayLines(np.arange(len(E)), ())
            if lines.delayed.size < max(LONG, E.shape[-1] / 2):
                continue
            narrow = resolved and (lambda at, low, high, column=column: resolved(at + column, low, high))
            panels, lost = panels_of(*samples, span, 1, bounds[:, column : column + 1], narrow)
            if panels is not None and not lost[0].size and all(_is_clear(lines, panels, at) for at in range(panels.low.size)):
                count, clear = count_outside(E[1:2])
                counts[column] = count[0] if clear[0] else -1
    return counts


def _is_clear(lines, panels, at):
    """Whether it is proved that no eigenvalue is on the circle on a panel."""
    k, d = lines.solved, lines.delayed
    places = (k[:, None], k), (k[:, None], d), (d[:, None], k)
    c = [panels.coefficients[at][..., rows, columns] for rows, columns in places]
    error = [panels.error[at][..., rows, columns] for rows, columns in places]
    order = np.arange(len(c[0]))
    steepest = [np.tensordot(order**2.0, np.abs(series), 1) for series in c]
    longest = max(map(len, lines.lines))
    count = int(np.ceil(np.pi * longest / (2 * TURN)))
    arcs = np.pi * np.arange(1, 2 * count, 2) / (2 * count), np.full(count, np.pi / (2 * count))
    ranges, work = [(0.0, 1.0, *arcs)], WORK * count
    while ranges:
        x, half, *arcs = ranges.pop()
        E = [np.tensordot(np.cos(order * np.arccos(x)), series, 1) for series in c]
        off = [half * slope + rounding for slope, rounding in zip(steepest, error, strict=True)]
        used, *arcs = _open_arcs(lines, longest, E, off, *arcs)
        work -= used
        if arcs[0].size:
            ranges += [(x - half / 2, half / 2, *arcs), (x + half / 2, half / 2, *arcs)]
            if half < 0.5**HALVED or work < 0:
                return False
    return True


def _open_arcs(lines, longest, E, off, theta, half):
    """The arcs, as their middles and their halves, for which a part of the range is too wide, and how many were looked at.

    Others are halved until they are proved. E, off: A, C and B in the middle of that part, and what they may be off in it.
    """
    (A, C, B), (dA, dC, dB) = E, off
    eye, at_most, used = np.eye(len(A)), np.ones((1, 1, 1)), 0
    size, of_B = lines.along(np.abs(B) + dB, at_most)[0].real, lines.along(dB, at_most)[0].real
    by_angle = eye + (np.abs(C) + dC) @ lines.along(size, at_most)[0].real
    rounded = (ROUNDED + longest * np.finfo(float).eps) * (2 * eye + np.abs(A) + np.abs(C) @ size)
    by_number, left = dA + dC @ size + np.abs(C) @ of_B + rounded, []
    while theta.size:
        used += theta.size
        w = on_circle(theta)[:, None, None]
        S = w * eye - A - C @ lines.along(B, 1 + w)
        back = np.abs(inverse(S))
        change = back @ (half[:, None, None] * by_angle + by_number)
        weight = np.ones((theta.size, len(A), 1))
        for _ in range(ROUNDS):
            weight = change @ weight
            weight = weight / weight.max((1, 2), keepdims=True) + 1e-3
        open_ = ~(change @ weight <= SHRINKS * weight).all((1, 2))
        wide = open_ & ~(back @ by_number @ weight <= SHRINKS / 2 * weight).all((1, 2))
        left.append((theta[wide], half[wide]))
        open_ &= ~wide
        half = np.repeat(half[open_] / 2, 2)
        theta = np.repeat(theta[open_], 2) + half * np.tile([-1, 1], half.size // 2)
    return used, *map(np.concatenate, zip(*left, strict=True))
