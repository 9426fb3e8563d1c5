"""Sums over the ticks of a frame under a sinusoidal force, by doubling, and what rounding can have made of them."""

from dataclasses import dataclass

import numpy as np

from wavesweep.diagram.block import Block

ROUNDING = 2 * np.finfo(float).eps  # of a sum of products, relative to the sum of their sizes
ENTRIES = 4 * np.finfo(float).eps  # of the entries of a block, relative, before its algebraic loops were closed


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """Some ticks in a row, begun in the state x, under the hand's force `z^i` and constant held inputs h.

    The state becomes `x + E x + k h + g`; the outputs, each times z^-i, sum up to `r x + t h + s`. No pole is divided by.
    Shapes: E `(..., n, n)`, k `(..., n, held)`, g `(..., n, points)`, r `(..., p, points, n)`, s `(..., p, points)`,
    t `(..., p, points, held)`.
    """

    count: int
    E: np.ndarray
    k: np.ndarray
    g: np.ndarray
    r: np.ndarray
    s: np.ndarray
    t: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """Bounds for every frequency on the sizes of the sums of `Ticks`, without its points, and on their errors (d...)."""

    E: np.ndarray
    k: np.ndarray
    g: np.ndarray
    r: np.ndarray
    s: np.ndarray
    t: np.ndarray
    dE: np.ndarray
    dk: np.ndarray
    dg: np.ndarray
    dr: np.ndarray
    ds: np.ndarray
    dt: np.ndarray


def tick(fast: Block, rows, points: int) -> Ticks:
    """One tick of a block whose first input is the hand's force; rows: which of its outputs."""
    C, D = fast.C[..., rows, :], fast.D[..., rows, :]
    ones = np.ones((points, 1))
    return Ticks(
        1, fast.E, fast.B[..., 1:], fast.B[..., :1] * ones[:, 0], C[..., None, :] * ones,
        D[..., 0, None] * ones[:, 0], D[..., None, 1:] * ones,
    )


def then(first: Ticks, second: Ticks, turn) -> Ticks:
    """One run of ticks after the other; turn: gives `z^count` at every point."""
    ahead = turn(first.count)
    back = ahead.conj()[:, None]
    return Ticks(
        first.count + second.count,
        first.E + second.E + second.E @ first.E,
        first.k + second.k + second.E @ first.k,
        first.g + second.E @ first.g + ahead * second.g,
        first.r + back * (second.r + second.r @ first.E[..., None, :, :]),
        first.s + second.s + back[:, 0] * (second.r * np.swapaxes(first.g, -1, -2)[..., None, :, :]).sum(-1),
        first.t + back * (second.t + second.r @ first.k[..., None, :, :]),
    )


def size_of_tick(fast: Block, rows) -> Sizes:
    """The same of one tick."""
    parts = (fast.E, fast.B[..., 1:], fast.B[..., :1], fast.C[..., rows, :], fast.D[..., rows, :1], fast.D[..., rows, 1:])
    unsure = (ENTRIES * np.asarray(fast.condition, float))[..., None, None]
    return Sizes(fast.E, *map(np.abs, parts[1:]), *(unsure * np.abs(part) for part in parts))


def size_of_both(first: Sizes, second: Sizes) -> Sizes:
    """The same of one run after the other."""
    E = first.E + second.E + second.E @ first.E
    ahead, before = (np.abs(np.eye(E.shape[-1]) + part) for part in (second.E, first.E))
    grown, seen = np.abs(second.E), np.eye(E.shape[-1]) + np.abs(first.E)
    k, g = (getattr(first, name) + getattr(second, name) for name in "kg")
    r, s, t = first.r + second.r @ seen, first.s + second.s + second.r @ first.g, first.t + second.t + second.r @ first.k
    return Sizes(
        E, ahead @ first.k + second.k,
        ahead @ first.g + second.g, first.r + second.r @ before, s, t,
        ahead @ first.dE + second.dE @ before + ROUNDING * (np.abs(first.E) + grown + grown @ np.abs(first.E)),
        ahead @ first.dk + second.dk + second.dE @ first.k + ROUNDING * (k + grown @ first.k),
        ahead @ first.dg + second.dg + second.dE @ first.g + ROUNDING * (g + grown @ first.g),
        first.dr + second.dr @ before + second.r @ first.dE + ROUNDING * r,
        first.ds + second.ds + second.dr @ first.g + second.r @ first.dg + ROUNDING * s,
        first.dt + second.dt + second.dr @ first.k + second.r @ first.dk + ROUNDING * t,
    )


def repeated(one, count: int, join):
    """A run of ticks `count` times, by doubling; None if that is never."""
    total = None
    for bit in f"{count:b}" if count else "":
        total = total and join(total, total)
        if bit == "1":
            total = join(total, one) if total else one
    return total


def times(a, b):
    """Product of two matrices, each a pair with a bound on the error of its entries."""
    size = np.abs(b[0])
    return a[0] @ b[0], a[1] @ size + np.abs(a[0]) @ (b[1] + ROUNDING * size)


def plus(a, b):
    """Sum of two such pairs."""
    return a[0] + b[0], a[1] + b[1] + ROUNDING * (np.abs(a[0]) + np.abs(b[0]))


def joined(parts, axis):
    """Such pairs side by side."""
    return tuple(np.concatenate(part, axis=axis) for part in zip(*parts, strict=True))


def unrolled(fast: Block, count: int):
    """Of `count` ticks from 0 on, as such pairs: what the first output shows of the state then, `C A^i` `(..., count, n)`;
    what a force leaves in the state, `A^i B` `(..., n, count)`; and what held inputs do, `(1 + ... + A^(i-1)) B`,
    `(..., count, n, held)`."""
    one = size_of_tick(fast, slice(0, 1))
    unsure = (ENTRIES * np.asarray(fast.condition, float))[..., None, None]
    reads, force, held = ((part, unsure * np.abs(part)) for part in (fast.C[..., :1, :], fast.B[..., :1], fast.B[..., 1:]))
    holds, batch = tuple(0 * part[..., None, :, :] for part in held), np.broadcast_shapes(fast.E.shape[:-2], fast.batch)
    reads, force, held, holds = (
        tuple(np.broadcast_to(part, (*batch, *part.shape[-tail:])) for part in pair)
        for pair, tail in ((reads, 2), (force, 2), (held, 2), (holds, 3))
    )
    for _ in range((count - 1).bit_length()):
        A = (np.eye(one.E.shape[-1]) + one.E, one.dE)
        reads, force = joined((reads, times(reads, A)), -2), joined((force, times(A, force)), -1)
        later = plus(times(tuple(part[..., None, :, :] for part in A), holds), tuple(part[..., None, :, :] for part in held))
        holds, held = joined((holds, later), -3), plus(times(A, held), held)
        one = size_of_both(one, one)
    return (
        tuple(part[..., :count, :] for part in reads), tuple(part[..., :count] for part in force),
        tuple(part[..., :count, :, :] for part in holds),
    )
