"""Entries of the frames of loops along a number: polynomials on panels of it, each entry with a
bound on what it misses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._stability.arc_panels import LEBESGUE, OVERLAP, PANEL_ELLIPSE, RIM
from wavesweep.engine._stability.sampled_frames import Frames, level, pole_inside
from wavesweep.engine.doubles import EPS, LEAST_NORMAL
from wavesweep.engine.rows import Rows

# of the polynomials; the points of the lower one are points of the higher one, too
DEGREES = (14, 28)
TAYLOR_ORDER = 4  # of the remainder of Taylor's expansions of the polynomials
# of the largest entry: by how much the polynomials of a panel may miss the entries of its frames.
# With more tests of dominance fail, with less panels are halved more often.
MOST_MISSED = 1e-11
# the same of polynomials of the highest degree, where the values themselves have larger errors
MOST_MISSED_OF_NOISY = 1e-8
# times MOST_MISSED: with less predicted for the higher degree it is tried, since coefficients fall
# unevenly
PREDICTED = 100
EXTENT = (PANEL_ELLIPSE + 1 / PANEL_ELLIPSE) / 2  # of its real axis
BETWEEN_PLACES = 4.0  # times the bounds at these places: that at any other point of the panel
# ratio of the largest entries at places of a panel, unless they are below 1: errors are relative to
# the largest
ENTRY_RATIO = 1e3
NARROWEST_PANEL = 1e-9  # of the span: a panel this narrow that is not followed is given up
MOST_PANELS = 1024  # of a column, beyond which the rest is given up
# Of columns at values of the number: frames; and frames less identity, `(values, n, n)`, with bounds
# on the errors of their entries.
FramesAt = Callable[[np.ndarray, np.ndarray], Frames]
FramesOf = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, slots=True)
class Panels(Rows):
    """Polynomials in `x = (p - middle)/half`, for x from -1 to 1, of the entries of frames less
    identity.

    column, low, high: the part of the span of a column that a panel is for; the polynomials reach a
    bit farther. coefficients: of Chebyshev polynomials, `(panels, DEGREES[-1] + 1, n, n)`. error:
    of each entry, all over the panel, by interpolation and by rounding of the frames, `(panels, n,
    n)`. rest: bound on the derivative of order TAYLOR_ORDER over its factorial.
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    coefficients: np.ndarray
    error: np.ndarray
    rest: np.ndarray

    @classmethod
    def joined(cls, batches: list[Panels]) -> Panels:
        """Return the panels of all batches, filled up to as many states as the largest has;
        those added have z = 0."""
        states = max(batch.error.shape[-1] for batch in batches)
        return cls.join(
            [
                batch if batch.error.shape[-1] == states else batch.filled(states)
                for batch in batches
            ]
        )

    def filled(self, order: int) -> Panels:
        """The same with as many states.

        Those that are added are 0 at the end of every frame: eigenvalues z = 0, which are `z - 1 =
        -1` of a frame less identity. So the constant coefficient is -1 on their diagonal, and
        everything else of them is 0.
        """
        n = self.error.shape[-1]

        def padded(entries: np.ndarray) -> np.ndarray:
            larger = np.zeros((*entries.shape[:-2], order, order))
            larger[..., :n, :n] = entries
            return larger

        coefficients = padded(self.coefficients)
        new = np.arange(n, order)
        coefficients[:, 0, new, new] = -1
        return replace(
            self, coefficients=coefficients, error=padded(self.error), rest=padded(self.rest)
        )

    def of_states(self, states: np.ndarray) -> Panels:
        """The same without all other states."""

        def chosen(entries: np.ndarray) -> np.ndarray:
            return np.ascontiguousarray(entries[..., states[:, None], states])

        return replace(
            self,
            coefficients=chosen(self.coefficients),
            error=chosen(self.error),
            rest=chosen(self.rest),
        )

    def without_forgotten(self) -> list[tuple[Panels, np.ndarray]]:
        """Return the panels without states that are 0 at the end of every frame, or that nothing
        reads at its beginning, and the indices of those that are left; panels that have the same
        ones together.

        A row or a column of the frame is then 0, but for rounding on the diagonal, and the matrix
        is block-triangular.
        """
        n = self.error.shape[-1]
        rest = self.error + sizes_of(self.coefficients[:, 1:])
        nonzero = np.abs(self.coefficients[:, 0]) + rest > 0
        moved = np.abs(self.coefficients[:, 0] + np.eye(n)) + rest
        nonzero[:, range(n), range(n)] = moved[:, range(n), range(n)] >= 0.5
        remembered = {}
        groups: dict[tuple[int, ...], list[int]] = {}
        for panel, entries in enumerate(nonzero):
            kind = entries.tobytes()
            if kind not in remembered:
                remembered[kind] = tuple(_remembered(entries))
            groups.setdefault(remembered[kind], []).append(panel)
        results = []
        for kept_states, of_group in groups.items():
            states = np.array(kept_states)
            results.append((self.take(np.array(of_group)).of_states(states), states))
        return results


def sizes_of(coefficients: np.ndarray) -> np.ndarray:
    """Return the sum of the sizes of the coefficients of each entry of panels; one by one, since
    all take much memory."""
    return sum(np.abs(coefficients[:, k]) for k in range(coefficients.shape[1]))


def _remembered(entries: np.ndarray) -> list[int]:
    """The states that remain of frames in which only these entries may be nonzero; at least one."""
    states = np.arange(len(entries))
    while True:
        nonzero = entries[states[:, None], states]
        coupled = nonzero & ~np.eye(states.size, dtype=bool)
        gone = ~nonzero.diagonal() & (~coupled.any(0) | ~coupled.any(1))
        if not gone.any() or gone.all():
            return states.tolist()
        states = states[~gone]


def panels_of(
    frames: FramesAt,
    errors: FramesOf,
    span: tuple[float, float],
    columns: int,
    bounds: np.ndarray,
    resolved: Callable[..., Any] | None = None,
    order: int = 1,
) -> tuple[Panels | None, tuple[np.ndarray, ...]]:
    """Return panels on which the frames are followed, and the parts of the spans that are not:
    column, low, high, overflown.

    bounds: `(2, columns)`, between which frames are analytic. resolved(column, low, high): whether frames have
    no narrow features there. order: of the frames, by which panels are followed in portions. A
    panel that is not followed is halved.
    """
    column = np.arange(columns)
    low, high = (np.full(columns, float(end)) for end in span)
    least = NARROWEST_PANEL * (span[1] - span[0])
    count = np.ones(columns, int)
    # Entries of frames at the nodes of panels at a time.
    few = max(1, 2**18 // ((DEGREES[-1] + 1) * order**2))
    done = []
    lost = []
    while column.size:
        low_ends, high_ends, inside = _with_overlap(low, high, bounds[:, column])
        middle = (low_ends + high_ends) / 2
        half = (high_ends - low_ends) / 2
        good = np.zeros(column.size, bool)
        overflown = np.zeros(column.size, bool)
        hopeless = np.zeros(column.size, bool)
        chosen = np.flatnonzero(inside)
        if resolved is not None and chosen.size:
            chosen = chosen[resolved(column[chosen], low_ends[chosen], high_ends[chosen])]
        for first in range(0, chosen.size, few):
            portion = chosen[first : first + few]
            places = (fact[portion] for fact in (column, low, high, middle, half))
            with np.errstate(all="ignore"):
                followed, in_portion, finite = _followed(_Spans(frames, errors, *places))
            good[portion[in_portion]] = True
            overflown[portion] = ~finite.all(1)
            hopeless[portion] = ~finite.any(1)
            done += followed
        # What is not followed is given up, or halved.
        np.add.at(count, column[~good], 1)
        many = count[column] > MOST_PANELS
        narrow = hopeless | ~good & ((high - low <= least) | many)
        lost.append((column[narrow], low[narrow], high[narrow], overflown[narrow]))
        again = ~good & ~narrow
        low = low[again]
        high = high[again]
        cut_at = (low + high) / 2
        column = np.tile(column[again], 2)
        low = np.append(low, cut_at)
        high = np.append(cut_at, high)
    parts_lost = tuple(np.concatenate(facts) for facts in zip(*lost, strict=True))
    return Panels.joined(done) if done else None, parts_lost


def _with_overlap(
    low: np.ndarray, high: np.ndarray, bounds: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The ends of the panels for parts of the spans, and whether frames are analytic in the ellipses
    about them.

    A polynomial reaches beyond the part that it is for, as far as frames are analytic, from
    bounds[0] to bounds[1].
    """
    lowest, highest = bounds
    over = OVERLAP * (high - low)
    low_ends = np.maximum(low - over, lowest)
    high_ends = np.minimum(high + over, highest)
    middle = (low_ends + high_ends) / 2
    half = (high_ends - low_ends) / 2
    inside = (middle - EXTENT * half >= lowest) & (middle + EXTENT * half <= highest)
    return low_ends, high_ends, inside


class _Spans(NamedTuple):
    """Parts of columns in which frames may be polynomials, as fields of `Panels`; frames, errors:
    see `panels_of`."""

    frames: FramesAt
    errors: FramesOf
    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray
    half: np.ndarray

    def places(self, index: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The numbers at places x of some spans, `(spans, points)`."""
        return self.middle[index, None] + self.half[index, None] * x

    def sample(self, index: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frames at places x of some spans, `(spans, points, n, n)`, and their pivots."""
        sampled = Frames.of(self.frames(self.column[index, None], self.places(index, x)))
        shape = index.size, x.size
        E = sampled.E.reshape(*shape, *sampled.E.shape[1:])
        return E, sampled.pivots.reshape(*shape, *sampled.pivots.shape[1:])

    def error_of(
        self, index: np.ndarray, degree: int, A: np.ndarray, c: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """By how much entries of polynomials of a degree may be off in some spans, what the frames
        themselves are off there, each `(spans, n, n)`, and the pivots on the rim; None if frames
        have other states on the rim.

        A, c: frames at the nodes, and coefficients of what goes through them.

        The error of the polynomial f_n that has the values of f at n + 1 Chebyshev points, divided
        by the polynomial q that vanishes there, is analytic where f is. So on the panel, where |q|
        <= 1, it is at most as large as on the rim of an ellipse about it, where |q| > 10^5: entries
        are computed there at complex p. What lies between the points of the rim is taken as at most
        twice as large. This holds if f has no pole inside (`pole_inside`). Rounding of the values
        adds as much as LEBESGUE allows; its bounds are taken at both ends and in the middle.
        """
        n = A.shape[-1]
        x, _ = nodes(degree)
        rim, pivots = self.sample(index, RIM)
        # Quarters of a panel, times two, at which errors of entries are bounded.
        quarters = np.array((0, 1, 2)) * (degree // 2)
        exact, off = self.errors(self.column[index, None], self.places(index, x[quarters]))
        if not rim.shape[2:] == exact.shape[1:] == (n, n):
            return None
        basis, vanishing = _rim(degree)
        on_rim = np.einsum("rk,pkmn->prmn", basis, c, optimize=True)
        missed = 2 * np.abs(rim - on_rim).max(1) / vanishing
        off = off + np.abs(exact - A[:, quarters].reshape(exact.shape))
        off = off.reshape(index.size, -1, n, n).max(1)
        return missed, off, pivots


def _followed(spans: _Spans) -> tuple[list[Panels], np.ndarray, np.ndarray]:
    """Return panels, those among the spans that are followed, which these are, and which frames are
    finite, `(spans, points)`.

    A polynomial of the next degree is tried where the last coefficients are not small enough, but
    shall be by how they fall.
    """
    done = []
    followed = []
    open_ = np.arange(spans.column.size)
    A = None
    for degree in DEGREES:
        x, transform = nodes(degree)
        if A is None:
            A, pivots = spans.sample(open_, x)
            inner = level(pivots, np.where(np.abs(x) == 1, 0.5, 1.0))
            finite = np.isfinite(A).all((2, 3))
        else:
            between, _ = spans.sample(open_, x[1::2])
            if between.shape[2:] != A.shape[2:]:
                break
            all_nodes = np.empty((open_.size, x.size, *A.shape[2:]))
            all_nodes[:, ::2] = A
            all_nodes[:, 1::2] = between
            A = all_nodes
        c = np.einsum("kj,pjmn->pkmn", transform, A, optimize=True)
        size = np.maximum(np.abs(A).max((1, 2, 3)), LEAST_NORMAL)
        last = np.abs(c[:, -2:]).max((1, 2, 3)) / size
        least = np.abs(A).max((2, 3)).min(1)
        calm = size < ENTRY_RATIO * np.maximum(1, least)
        enough = MOST_MISSED if degree < DEGREES[-1] else MOST_MISSED_OF_NOISY
        ready = np.flatnonzero((last < enough) & calm)
        errors = spans.error_of(open_[ready], degree, A[ready], c[ready]) if ready.size else None
        if errors is None:
            ready = ready[:0]
        else:
            missed, off, pivots = errors
            fine = missed.max((1, 2)) < np.maximum(MOST_MISSED * size[ready], off.max((1, 2)))
            fine &= ~pole_inside(pivots, inner[open_[ready]])
            fine &= np.isfinite(off).all((1, 2))
            rounding = 2 * degree * EPS * np.abs(c[ready]).sum(1)
            error = missed + LEBESGUE * BETWEEN_PLACES * off + rounding
            ready = ready[fine]
            done.append(_panels(spans, open_[ready], c[ready], error[fine]))
            followed.append(open_[ready])
        going = last ** (DEGREES[-1] / degree) < PREDICTED * MOST_MISSED
        going[ready] = False
        going &= calm
        open_ = open_[going]
        A = A[going]
        if not open_.size:
            break
    return done, np.concatenate([*followed, np.zeros(0, int)]), finite


def _panels(spans: _Spans, index: np.ndarray, c: np.ndarray, error: np.ndarray) -> Panels:
    """Panels of some spans. The derivative of order TAYLOR_ORDER of the Chebyshev polynomial of
    degree k, over its factorial, is largest at x = 1 (Markov 1892): `prod (k^2 - i^2)/((2 i + 1)(i
    + 1))`."""
    k = np.arange(c.shape[1])
    steepest = np.ones(k.size)
    for i in range(TAYLOR_ORDER):
        steepest = steepest * ((k**2 - i**2) / ((2 * i + 1) * (i + 1)))
    padded = np.zeros((index.size, DEGREES[-1] + 1, *c.shape[2:]))
    padded[:, : c.shape[1]] = c
    rest = np.einsum("k,pkmn->pmn", np.abs(steepest), np.abs(c))
    places = spans.column, spans.low, spans.high, spans.middle, spans.half
    column, low, high, middle, half = (fact[index] for fact in places)
    return Panels(column, low, high, middle, half, padded, error, rest)


@cache
def nodes(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev points of the second kind in [-1, 1], and the map from values there to
    Chebyshev coefficients."""
    number = np.arange(degree + 1)
    # Whole turns, and then halves, are taken out first: the cosine of a large angle has lost digits
    # with the angle.
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


@cache
def _rim(degree: int) -> tuple[np.ndarray, float]:
    """Return the Chebyshev polynomials on the rim, and the least size there of the polynomial
    that vanishes at the nodes."""
    basis = [np.ones_like(RIM), RIM]
    for _ in range(degree - 1):
        basis.append(2 * RIM * basis[-1] - basis[-2])
    return np.stack(basis, axis=-1), np.abs(RIM * basis[-1] - basis[-2]).min()


def taylor(x: np.ndarray, degree: int) -> np.ndarray:
    """Return the Taylor coefficients about x of the Chebyshev polynomials, `(points,
    TAYLOR_ORDER, degree + 1)`."""
    coefficients = np.zeros((TAYLOR_ORDER, degree + 1, x.size))
    coefficients[0, 0] = 1
    coefficients[0, 1] = x
    coefficients[1, 1] = 1
    for k in range(2, degree + 1):
        coefficients[:, k] = 2 * x * coefficients[:, k - 1] - coefficients[:, k - 2]
        coefficients[1:, k] += 2 * coefficients[:-1, k - 1]
    return np.ascontiguousarray(coefficients.transpose(2, 0, 1))
