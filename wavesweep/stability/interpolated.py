"""Characteristic polynomials of a loop over a range of a parameter: a few are computed, others interpolated, with a bound."""

from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from wavesweep.columns import Rows
from wavesweep.monodromy.rounding import balance
from wavesweep.stability.frames import level, pole_inside
from wavesweep.stability.guardian_maps import (
    EPS,
    LARGEST_ENTRY,
    MOST_ORDER,
    characteristic,
    from_polynomials,
    surely_unstable,
)
from wavesweep.stability.non_nilpotent import of_order
from wavesweep.stability.panels import EXTENT, LEBESGUE, OVERLAP, RIM

DEGREES = (14, 28, 56)  # of an interpolant; its points are kept when it is raised
PIECES = 16  # a piece narrower than this part of the span that is not followed is computed at every point
HOPELESS, WIDE = 0.05, 4  # last coefficients over the largest: a piece that is no wider than a WIDE-th of the span is given up
ROUNDED = 32  # roundings of all its terms that the sums of an interpolant cost
LOOSE = 64.0  # roundings, as many as the values are off by themselves, that an interpolant may be off by besides
MARGIN = 1e3  # of what a higher degree is expected to leave, since coefficients fall unevenly


@cache
def nodes(degree):
    """Return Chebyshev points of the second kind in [-1, 1], and the map from values there to Chebyshev coefficients.

    Every other point is one of half the degree.
    """
    number = np.arange(degree + 1)
    # Whole turns, and then halves, are taken out first: the cosine of a large angle has lost digits with the angle.
    turn = np.outer(number, number) % (2 * degree)
    turn = np.minimum(turn, 2 * degree - turn)
    short = np.cos(np.pi * np.minimum(turn, degree - turn) / degree)
    transform = np.where(2 * turn > degree, -short, short) * (2 / degree)
    transform[:, [0, -1]] /= 2
    transform[[0, -1]] /= 2
    x = np.cos(np.pi * number / degree)
    for array in (x, transform):
        array.flags.writeable = False
    return x, transform


def chebyshev(x, degree):
    """Return the Chebyshev polynomials to that degree at x, in a last axis, and the polynomial that vanishes at the nodes."""
    parts = [np.ones_like(x), x]
    for _ in range(degree - 1):
        parts.append(2 * x * parts[-1] - parts[-2])
    return np.stack(parts, axis=-1), x * parts[-1] - parts[-2]


@cache
def _rim(degree):
    """Return `chebyshev` on the rim of the ellipse, with the least size there of the polynomial that vanishes at the nodes."""
    basis, vanishing = chebyshev(RIM, degree)
    return basis, np.abs(vanishing).min()


@dataclass(frozen=True, slots=True)
class Pieces(Rows):
    """Interpolants of the coefficients of characteristic polynomials in `w/size`, without the leading one, piece by piece.

    column, low, high: of each piece. middle, half: of the sampled range. degree: `(pieces,)`, 0 if the piece is not followed.
    coefficients: `(pieces, DEGREES[-1] + 1, n)`. reach: `(pieces, n)`, the error of each by rounding, at the nodes and between
    them; beside: its error on the ellipse's rim; both in roundings of 1. rim: the coefficients on the rim, computed at RIM,
    `(pieces, OUTER, n)`, and vague: their errors. size: `(pieces,)`.
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    degree: np.ndarray
    coefficients: np.ndarray
    reach: np.ndarray
    beside: np.ndarray
    rim: np.ndarray
    vague: np.ndarray
    size: np.ndarray

    @staticmethod
    def none(column, low, high, bounds, order) -> "Pieces":
        """Return pieces that are not followed yet, with their overlap within the bounds."""
        over, pieces = OVERLAP * (high - low), column.size
        left, right = np.maximum(low - over, bounds[0][column]), np.minimum(high + over, bounds[1][column])
        rim = np.zeros((pieces, RIM.size, order))
        empty = np.zeros((pieces, DEGREES[-1] + 1, order)), *np.zeros((2, pieces, order)), rim + 0j, rim, np.ones(pieces)
        return Pieces(column, low, high, (left + right) / 2, (right - left) / 2, np.zeros(pieces, int), *empty)

    def at(self, place):
        """Return points of all pieces, `(pieces, points)`; place: position on [-1, 1], or beside it."""
        return self.middle[:, None] + self.half[:, None] * place


@dataclass(frozen=True, slots=True)
class InterpolatedLoop:
    """A loop over a span.

    pieces: sorted by column and place. units: `(columns, n)`, of the states, see `balance`.
    """

    evaluate: object
    span: tuple[float, float]
    pieces: Pieces
    units: np.ndarray

    def piece(self, column, p):
        """Return the piece that points `p`, `(panels, points)`, of these columns lie in, `(panels,)`."""
        width = self.span[1] - self.span[0]
        place = np.clip((p.mean(-1).real - self.span[0]) / width, 0, 1 - 1e-9)
        start = self.pieces.column + (self.pieces.low - self.span[0]) / width
        return np.searchsorted(start, column + place, side="right") - 1

    def polynomials(self, piece, p):
        """Return the characteristic polynomials at `p`, `(panels, points)`, in these pieces, which are followed.

        They are coefficients `(n + 1, panels * points)`, their errors and sizes, as `critical.from_polynomials` takes them.
        """
        pieces, (panels, count), n = self.pieces, p.shape, self.units.shape[-1]
        c, reach = np.ones((panels, count, n + 1), p.dtype), np.ones((panels, count, n + 1))
        middle, half, degrees = (part[piece] for part in (pieces.middle, pieces.half, pieces.degree))
        x = (p - middle[:, None]) / half[:, None]
        for degree in DEGREES:
            at = np.flatnonzero(degrees == degree)
            if not at.size:
                continue
            mine, (basis, vanishing) = piece[at], chebyshev(x[at], degree)
            c[at, :, :n] = basis @ pieces.coefficients[mine, : degree + 1]
            # Noise at the nodes grows beside the real axis as a polynomial of that degree does.
            noise = 2 * np.abs(basis[..., -1:]) if np.iscomplexobj(p) else np.ones((1, 1, 1))
            missed = np.abs(vanishing[..., None]) / _rim(degree)[1]
            reach[at, :, :n] = pieces.reach[mine, None] * np.maximum(noise, 1) + pieces.beside[mine, None] * missed
        at = np.flatnonzero(self._rims(piece, p))
        if at.size:
            c[at, :, :n], reach[at, :, :n] = pieces.rim[piece[at]], pieces.vague[piece[at]]
        c, reach = (np.moveaxis(part, -1, 0).reshape(n + 1, -1) for part in (c, reach))
        return c, reach, np.repeat(pieces.size[piece], count)

    def functions(self, piece, p):
        """Return the critical functions at `p`, `(panels, points)`, in these pieces, which are followed.

        They are phase, logarithm of the size and error, `(4, panels, points)` each, see `critical.from_polynomials`.
        """
        return [part.reshape(4, *p.shape) for part in from_polynomials(*self.polynomials(piece, p))]

    def _rims(self, piece, p):
        """Return which panels are pieces themselves, whose rim was computed."""
        if p.shape[1] != RIM.size or not np.iscomplexobj(p):
            return np.zeros(piece.size, bool)
        return (p == self.pieces.middle[piece, None] + self.pieces.half[piece, None] * RIM).all(-1)

    def computed(self, column, p):
        """Return frames less identity at `p`, `(panels, points)`, of these columns, `(panels, points, n, n)`, and pivots."""
        found = self.evaluate(column[:, None], p)
        return found.E.reshape(*p.shape, *found.E.shape[1:]), found.pivots.reshape(*p.shape, -1)


def interpolated_loop(evaluate, span, columns: int, bounds, sizes, kept, order: int = 0) -> InterpolatedLoop:
    """Follow the characteristic polynomial of every column over the span.

    evaluate, bounds: see `stable_along_any`. sizes: of the entries of typical frames, `(columns, n, n)`, which give the units;
    kept: `(n,)`, the states that are not forgotten. order: of the largest frames, if it is known.
    Errors: MoreStatesError, RecalledError.

    Each coefficient is interpolated at the Chebyshev points of a piece. The error, divided by the polynomial that vanishes at
    these points, is analytic. So on the piece this quotient is at most as large as on the rim of an ellipse about it. Frames
    are computed there at complex values (see `panel_roots`), and no pole is inside (see `pole_inside`). The vanishing
    polynomial is at most 1 on the piece, and 10^5 on the rim for 15 points and 10^22 for 57. A piece that is not followed to
    LOOSE roundings is cut in two.
    """
    width, few = span[1] - span[0], int(kept.sum())
    column, low, high = np.arange(columns), *(np.full(columns, float(end)) for end in span)
    order, bounds = max(order, few), [np.broadcast_to(end, columns) for end in bounds]
    evaluate = partial(of_order, evaluate, order, kept)
    whole = np.zeros((columns, order, order))
    whole[:, :few, :few] = sizes[:, kept][:, :, kept]
    units = balance(whole)[1]
    done = []
    while column.size:
        pieces = Pieces.none(column, low, high, bounds, order)
        inside = (pieces.middle - EXTENT * pieces.half >= bounds[0][column]) & (
            pieces.middle + EXTENT * pieces.half <= bounds[1][column]
        )
        hopeless, unstable = np.zeros((2, column.size), bool)
        if order <= MOST_ORDER:
            with np.errstate(all="ignore"):
                hopeless[inside], unstable[inside] = _follow(evaluate, pieces, np.flatnonzero(inside), units)
        share = (high - low) / width
        kept = (
            (pieces.degree > 0) | (order > MOST_ORDER) | (share * PIECES <= 1.01) | hopeless & (share * WIDE <= 1.01) | unstable
        )
        done.append(pieces.take(kept))
        column, low, high = (part[~kept] for part in (column, low, high))
        cut_at = (low + high) / 2
        column, low, high = np.tile(column, 2), np.append(low, cut_at), np.append(cut_at, high)
    pieces = Pieces.join(done)
    return InterpolatedLoop(evaluate, span, pieces.take(np.lexsort((pieces.low, pieces.column))), units)


class _Samples:
    """Characteristic polynomials of frames on some pieces; size: of each piece, set by its first samples."""

    def __init__(self, evaluate, pieces, units):
        self.evaluate, self.pieces, self.size = evaluate, pieces, None
        units = units[pieces.column]
        self.ratio = (units[:, None, :] / units[:, :, None])[:, None]

    def at(self, which, x):
        """Return coefficients and their errors at places x of the pieces `which`, `(pieces, points, n)`, and pivots.

        The coefficients are complex if x is.
        """
        some = self.pieces.take(which)
        found = self.evaluate(some.column[:, None], some.at(x))
        n = found.E.shape[-1]
        E = found.E.reshape(which.size, x.size, n, n) * self.ratio[which]
        largest = np.abs(E).max((1, 2, 3), initial=1)
        known = largest < LARGEST_ENTRY
        if not known.all():
            E[~known], largest = 0.0, np.where(known, largest, 1)
        if self.size is None:
            self.size = np.exp2(np.ceil(np.log2(largest)))
        E /= self.size[which, None, None, None]
        c, reach, more = characteristic(E.reshape(-1, n, n))
        power = more ** np.arange(n, 0, -1)[:, None]
        c, reach = (np.ascontiguousarray((part[:-1] * power).T).reshape(which.size, x.size, n) for part in (c, reach))
        c[~known] = np.nan
        return c, reach, found.pivots.reshape(which.size, x.size, -1)


def _follow(evaluate, pieces, index, units):
    """Fill in those of the pieces `index` that can be followed, and return which are hopeless, or seem surely unstable."""
    samples, n = _Samples(evaluate, pieces.take(index), units), units.shape[-1]
    hopeless, unstable = np.zeros((2, index.size), bool)
    rim, vague = np.full((index.size, RIM.size, n), np.nan, complex), np.zeros((index.size, RIM.size, n))
    open_, poles, c, unsure = np.arange(index.size), np.zeros(index.size, bool), None, None
    for degree in DEGREES:
        if not open_.size:
            break
        x, transform = nodes(degree)
        if c is None:
            c, unsure, pivots = samples.at(open_, x)
            inner = level(pivots, np.where(np.abs(x) == 1, 0.5, 1.0))
        else:
            c, unsure = (_between(*pair) for pair in zip((c, unsure), samples.at(open_, x[1::2])[:2], strict=True))
        found, least = transform @ c, np.finfo(float).tiny
        reach = np.maximum(LEBESGUE * unsure.max(1) + ROUNDED * np.abs(found).sum(1), least)
        last = np.abs(found[:, -2:]).max(1)
        share = (last / reach).max(1)  # NaN where a value is lost
        if degree == DEGREES[0]:
            hopeless = ~((last / np.maximum(np.abs(c).max(1), least)).max(1) <= HOPELESS)
            unstable = surely_unstable(c, unsure, samples.size).all(1)
        ready = np.flatnonzero(share <= LOOSE * EPS)
        if ready.size:
            mine = open_[ready]
            new = mine[np.isnan(rim[mine, 0, 0])]
            if new.size:
                rim[new], vague[new], pivots = samples.at(new, RIM)
                poles[new] = pole_inside(pivots, inner[new])
            basis, vanishing = _rim(degree)
            # Twice, since between two points of the rim it may be larger than at both.
            missed = (2 * np.abs(rim[mine] - basis @ found[ready]) / EPS + vague[mine]).max(1)
            good = (missed <= LOOSE * vanishing * reach[ready]).all(1) & ~poles[mine]
            ready, mine, at = ready[good], mine[good], index[mine[good]]
            pieces.degree[at], pieces.size[at], pieces.coefficients[at, : degree + 1] = degree, samples.size[mine], found[ready]
            pieces.reach[at], pieces.beside[at] = reach[ready], missed[good]
            pieces.rim[at], pieces.vague[at] = rim[mine], vague[mine]
        going = share ** (DEGREES[-1] / degree) <= MARGIN * LOOSE * EPS
        going[ready] = False
        going &= ~unstable[open_]
        open_, c, unsure = open_[going], c[going], unsure[going]
    return hopeless, unstable


def _between(known, new):
    """Return values at every point from those at every other one and those between, `(pieces, points, n)`."""
    whole = np.empty((known.shape[0], known.shape[1] + new.shape[1], known.shape[2]))
    whole[:, ::2], whole[:, 1::2] = known, new
    return whole
