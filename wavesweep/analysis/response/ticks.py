"""Sums over the ticks of a frame under a sinusoidal force, by doubling, and what rounding can have made of them."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.diagram.block import Block

ROUNDING = 2 * np.finfo(float).eps  # of a sum of products, relative to the sum of their sizes
ENTRIES = 4 * np.finfo(float).eps  # of the entries of a block, relative, before its algebraic loops were closed


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """Some ticks in a row, begun in the state x (held inputs included, which stay), under the hand's force `z^i`.

    The state becomes `x + E x + g`; the outputs, each times z^-i, sum up to `r x + s`. No pole is divided by. Shapes:
    E `(..., n, n)`, g `(..., n, points)`, r `(..., p, points, n)`, s `(..., p, points)`.
    """

    count: int
    E: np.ndarray
    g: np.ndarray
    r: np.ndarray
    s: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """E of the same ticks; bounds for every frequency on the sizes of the others, without points, and on errors (d...)."""

    E: np.ndarray
    g: np.ndarray
    r: np.ndarray
    s: np.ndarray
    dE: np.ndarray
    dg: np.ndarray
    dr: np.ndarray
    ds: np.ndarray


def holding(fast: Block, outputs: int) -> Block:
    """The tick with its held inputs as states that stay: from the hand's force, its first input, to its first outputs."""
    n, held, batch = len(fast.states), len(fast.inputs) - 1, fast.batch
    E, B = np.zeros((*batch, n + held, n + held)), np.zeros((*batch, n + held, 1))
    C, D = np.zeros((*batch, outputs, n + held)), np.zeros((*batch, outputs, 1))
    E[..., :n, :n], E[..., :n, n:], B[..., :n, :] = fast.E, fast.B[..., 1:], fast.B[..., :1]
    C[..., :n], C[..., n:], D[...] = fast.C[..., :outputs, :], fast.D[..., :outputs, 1:], fast.D[..., :outputs, :1]
    return replace(fast, inputs=fast.inputs[:1], outputs=fast.outputs[:outputs], states=(*fast.states, *fast.inputs[1:]),
                   E=E, B=B, C=C, D=D)


def tick(fast: Block, points: int) -> Ticks:
    """One tick of such a block."""
    ones = np.ones((points, 1))
    return Ticks(1, fast.E, fast.B * ones[:, 0] + 0j, fast.C[..., None, :] * ones + 0j, fast.D * ones[:, 0] + 0j)


def then(first: Ticks, second: Ticks, turn) -> Ticks:
    """One run of ticks after the other; turn: gives `z^count` at every point."""
    ahead = turn(first.count)
    back = ahead.conj()
    met = (second.r * np.swapaxes(first.g, -1, -2)[..., None, :, :]).sum(-1)
    return Ticks(
        first.count + second.count,
        first.E + second.E + second.E @ first.E,
        first.g + second.E @ first.g + ahead * second.g,
        first.r + back[:, None] * (second.r + second.r @ first.E[..., None, :, :]),
        first.s + second.s + back * met,
    )


def size_of_tick(fast: Block) -> Sizes:
    """The same of one tick."""
    parts = (fast.E, fast.B, fast.C, fast.D)
    unsure = (ENTRIES * np.asarray(fast.condition, float))[..., None, None]
    return Sizes(fast.E, *map(np.abs, parts[1:]), *(unsure * np.abs(part) for part in parts))


def size_of_both(first: Sizes, second: Sizes) -> Sizes:
    """The same of one run after the other."""
    eye = np.eye(first.E.shape[-1])
    E, one, two = first.E + second.E + second.E @ first.E, np.abs(first.E), np.abs(second.E)
    before, ahead, seen = np.abs(eye + first.E), np.abs(eye + second.E), second.r @ (eye + one)
    s = first.s + second.s + second.r @ first.g
    return Sizes(
        E, ahead @ first.g + second.g, first.r + second.r @ before, s,
        ahead @ first.dE + second.dE @ before + ROUNDING * (one + two + two @ one),
        ahead @ first.dg + second.dg + second.dE @ first.g + ROUNDING * (first.g + second.g + two @ first.g),
        first.dr + second.dr @ before + second.r @ first.dE + ROUNDING * (first.r + seen),
        first.ds + second.ds + second.dr @ first.g + second.r @ first.dg + ROUNDING * s,
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
    """Of `count` ticks of a block with its held inputs as states, as such pairs: what the output shows of the state in each,
    `C A^i` `(..., count, n)`, and what a force leaves in the state after i more, `A^i B` `(..., n, count)`."""
    one = size_of_tick(fast)
    unsure = (ENTRIES * np.asarray(fast.condition, float))[..., None, None]
    reads, force = ((part, unsure * np.abs(part)) for part in (fast.C, fast.B))
    for _ in range((count - 1).bit_length()):
        A = (np.eye(one.E.shape[-1]) + one.E, one.dE)
        reads, force = joined((reads, times(reads, A)), -2), joined((force, times(A, force)), -1)
        one = size_of_both(one, one)
    return tuple(part[..., :count, :] for part in reads), tuple(part[..., :count] for part in force)
