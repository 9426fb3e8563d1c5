"""What comes out of loops in time, between two numbers each: overshoot and settling of a step, and
the mean square under white noise.

In frames a loop is `x+ = A x + G u`, `y = O x + T u`, u and y having a value for each tick, so that
an input of 1 in a tick gives T in its frame and `O A^k G` in the k-th one after it.

    step from tick l on   y_k = y_end + O A^(k-1) (x_1 - x_end),   x_end = (1 - A)^-1 G 1
    white noise           mean_i (T T' + O X O')_ii,   X = A X A' + G G'   (of sums over a frame: `maps.squares_over_frame`)

Each is asked of a disc of complex numbers about a panel, half as wide as the disc: what is analytic
in the number differs there from its value in the middle by at most half of what it does on the rim
(Schwarz's lemma), as does y over its end, if that is not 0 in the disc.

The first S blocks of frames are summed. With u the largest state of these, entry by entry, and
`|A^S| u <= q u`, q < 1, all later ones together are at most

    sum_(k >= S) |O A^k G| <= (sum_(k < S) |O A^k| u) max |A^S G/u| / (1 - q).

In the middle, errors of the matrices and rounding are as if each block had added at most e to the
states, which moves no sample by more than `sum_k |O A^k| e`, and what the first state is off by, d, moves
none by more than `max_k |O A^k| d`; those of later blocks are as above with `|A^S| (e + d)` in place of that
of states. These bounds are computed to first order.

A step may come to rest by a slow mode, near 1 + w in all of a panel, -1 < w < 0, long after all others
are gone. Of the samples y_k of a tick, `d_k = (y_(k+1) - (1 + w) y_k)/(-w)` hardly has that mode, and

    y_(k+1) = (1 + w) y_k - w d_k

is between y_k and d_k: if y_S and all d_k from there on are at most a level, so are all y_k. With u not
less than `|A^S| u` and the states after S frames, every later state after a multiple of S frames is at
most u, and so is d_k at most `max_(k < S) |O (A - 1 - w) A^k| u/(-w)`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine.frames import Bounded, inverse, sum_rounding
from wavesweep.engine.response import BAND
from wavesweep.engine.rows import distinct
from wavesweep.require.between import determinants, poles_inside
from wavesweep.require.disc_panels import SAFE
from wavesweep.require.maps import in_order

ROWS_OF_BLOCK = 64  # outputs of a block of frames, at least
MOST_DOUBLINGS = 48  # of frames in which noise has acted
MOST_BLOCKS = 4096  # that are looked at
LITTLE = 1e-5  # of a mode that is left when a step is no longer looked at, unless that is proved
KNOWN = 1e-10  # of a mean square, and of 1 and a value of a step, to which they are known
# of the end of a step, which samples may be off; the first of these that their bound is below
UNSURE = 10.0 ** np.arange(-13, -1.5, 0.25)


class Enclosed(NamedTuple):
    """What is known of a value on each panel: it is between these two numbers. slow: whether it was
    given up since the loop comes to rest too slowly, or rounding hides its samples. looked_at: so
    many outputs of each."""

    low: np.ndarray
    high: np.ndarray
    slow: np.ndarray | bool = False
    looked_at: int = 0

    @staticmethod
    def unknown(count: int) -> Enclosed:
        """Nothing is known."""
        return Enclosed(np.zeros(count), np.full(count, np.inf))

    def decided(self, level: float | None) -> np.ndarray:
        """Whether the values are on one side of the level, or known without one."""
        if level is None:
            return np.isfinite(self.high) & (self.high - self.low <= KNOWN * (1 + self.high))
        return (self.high <= level) | (self.low > level)


def moved_from_middle(values: np.ndarray) -> np.ndarray:
    """By how much functions of the number, `(panels, points, ...)`, differ from their value in
    the middle on the panels."""
    if values.shape[1] == 1:
        return np.zeros_like(values[:, 0].real)
    off = values[:, 1:] - values[:, :1].real
    return SAFE / 2 * np.sqrt((off.real**2 + off.imag**2).max(1))


def _largest_on(values: np.ndarray) -> np.ndarray:
    """The largest size of such functions on the panels."""
    return np.abs(values[:, 0]) + moved_from_middle(values)


def _units(size: np.ndarray) -> np.ndarray:
    """Units in which states of such sizes are at most 1; those that never move have their own."""
    return np.where(size > 0, size, 1.0)


def mean_square(squares: Sequence[Bounded], ticks: int) -> Enclosed:
    """The mean square of the output under noise of variance 1 in each tick, on panels.

    squares: E, Q, W and t, see `squares_over_frame`, of a frame of so many ticks, at the middle of each panel and
    on its rim, `(panels, points, ...)`, each with a bound on its error.

        mean square = (sum_ij W_ij X_ij + t)/ticks,   X_2N = X_N + A^N X_N (A^N)'

    What misses in the equation in the middle, R, is seen in the mean square as `sum_ij R_ij P_ij`,
    `P = A' P A + W`. What N frames of noise leave is less than what all do.
    """
    E, Q, W, t = (matrix for matrix, _ in squares)
    e, g, w, direct = (part.part(slice(None), 0).real for part in squares)
    n = E.shape[-1]
    low = np.zeros(len(E))
    with np.errstate(all="ignore"):
        X = Q
        power = E  # A^N - 1
        so_far = g
        rough = e
        for _ in range(MOST_DOUBLINGS):
            moved = moved_from_middle((W * X).sum((-1, -2)) + t[..., 0, 0])
            seen = (w * so_far).sum((-1, -2)) + direct.part(..., 0, 0)
            low = np.fmax(low, seen.value - seen.error - moved)
            over_frames = Bounded.exact(np.eye(n)) + rough
            so_far = so_far + over_frames @ so_far @ over_frames.mT
            rough = rough.then(rough)
            X = 2 * X + X @ power.mT + power @ X + power @ X @ power.mT
            power = 2 * power + power @ power
            size = _largest_on(power + np.eye(n))
            middle = X[:, 0].real
            u = _units(np.sqrt(np.abs(np.diagonal(middle, axis1=-2, axis2=-1))))
            q = ((size @ u[..., None])[..., 0] / u).max(-1)
            if not ((q > KNOWN) & np.isfinite(q)).any():
                break
        uu = u[:, :, None] * u[:, None, :]
        ratio_of_forms = (_largest_on(X) / uu).max((-1, -2))
        rest = q**2 / (1 - q**2) * ratio_of_forms * (_largest_on(W) * uu).sum((-1, -2))

        middle = Bounded.exact(middle)
        changed = e @ middle
        missed = (g + changed + changed.mT + changed @ e.mT).size
        more = (missed * np.abs(_summed(e.value.mT, w.value))).sum((-1, -2))
        square = (w * middle).sum((-1, -2)) + direct.part(..., 0, 0)

        unsure = moved_from_middle((W * X).sum((-1, -2)) + t[..., 0, 0]) + more + square.error
        low = np.fmax(low, square.value - unsure) / ticks
        high = (square.value + unsure + np.where(q < 1, rest, np.inf)) / ticks
    return Enclosed(low, np.where(np.isfinite(high), high, np.inf))


def _summed(E: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """`sum_k A^k Y (A^k)'`, by doubling."""
    power = E
    for _ in range(MOST_DOUBLINGS):
        more = Y + Y @ power.mT + power @ Y + power @ Y @ power.mT
        Y = Y + more
        power = 2 * power + power @ power
        if not (np.abs(more).max((-1, -2)) > KNOWN * np.abs(Y).max((-1, -2))).any():
            break
    return Y


class _Rest(NamedTuple):
    """What later blocks add, and how far samples are off, by outputs of a block of each panel.

    largest: later sample. off_so_far, off: of the samples that were seen, and of all.
    """

    largest: np.ndarray
    off_so_far: np.ndarray
    off: np.ndarray


def _over_blocks(
    E: Bounded, O: Bounded, start: Bounded, seen: _Step, level: float | None
) -> Enclosed:
    """Return what is known of a value of the outputs that follow from states, whose columns are
    cases, block by block.

    start: the states before the first block. seen: `look` takes the outputs of the next block,
    `(panels, points, outputs, columns)`; `known` says where it is of use to look at more; `value`
    gives what is known, if a `_Rest` comes after, and then `most` is what may have been seen. A
    panel of which that is above the level can only be shown to be above it: for this it is looked
    at for as long again.
    """
    n = E.value.shape[-1]
    identity = np.eye(n)
    frames = -(-ROWS_OF_BLOCK // O.value.shape[-2])
    no_inputs = E.part(..., slice(0)), O.part(..., slice(0))
    E, _, O, _ = in_order([(E, no_inputs[0], O, no_inputs[1])], np.zeros(frames, int))
    of_O = O.part(slice(None), 0).with_rounding(n)
    rough = E.part(slice(None), 0).with_rounding(n + 2) + sum_rounding(n + 2) * identity
    E = E.value
    O = O.value
    X, dX = start
    last, slow = _last_blocks(E, O.shape[-2] * n * (X.shape[-1] + n) * E.shape[1])

    rows = O
    power = E  # A^S - 1
    largest = np.zeros((len(E), n))
    shown = np.zeros(rows[:, 0].shape)  # sum_k |O A^k| on the panels, and in the middle
    shown_middle = shown
    most_shown = shown  # max_k |O A^k| in the middle
    enclosed = Enclosed.unknown(len(E))
    again = np.full(len(E), np.inf)  # blocks of a panel that may be above the level
    done = 0
    count = 1
    while True:
        for _ in range(count - done):
            seen.look(O @ X)
            size = np.abs(X[:, 0])
            largest = np.maximum(largest, size.max(-1))
            of_rows = np.abs(rows[:, 0])
            shown_middle = shown_middle + of_rows
            most_shown = np.maximum(most_shown, of_rows)
            shown = shown + of_rows + moved_from_middle(rows)
            X = X + E @ X
            rows = rows + rows @ E
        done = count
        u = _units(largest)
        kappa = _all_shown(shown, _largest_on(power + identity), u)
        a = (_largest_on(X) / u[..., None]).max(-2)
        pushed = (rough @ u[..., None])[..., 0]
        begun = dX[:, 0].max(-1)
        grown = np.abs(power[:, 0] + identity)
        later = _all_shown(shown_middle, grown, u)
        so_far = (of_O @ u[..., None])[..., 0] + (shown_middle @ pushed[..., None])[..., 0]
        so_far = so_far + (most_shown @ begun[..., None])[..., 0]
        carried = ((grown @ (pushed + begun)[..., None])[..., 0] / u).max(-1)
        rest = _Rest(kappa * a.max(-1)[:, None], so_far, so_far + later * carried[:, None])
        better = seen.value(rest)
        enclosed = Enclosed(np.fmax(enclosed.low, better.low), np.fmin(enclosed.high, better.high))
        if count == 1:
            slow = slow | (better.slow & (last > 1))  # a middle that grows tells nothing of others
            last = np.where(better.slow | ~seen.known, 1.0, last)
        if level is not None:
            again = np.where(seen.most > level, np.minimum(again, 2 * count), again)
        if (enclosed.decided(level) | (count >= np.minimum(last, again))).all():
            looked_at = count * O[:, :, :, 0].size // len(O) * X.shape[-1]
            slow &= ~enclosed.decided(level) & (again > count) & seen.known
            return enclosed._replace(slow=slow, looked_at=looked_at)
        power = 2 * power + power @ power
        count = 2 * count


def _all_shown(shown: np.ndarray, power: np.ndarray, u: np.ndarray) -> np.ndarray:
    """A bound on `sum_k |O A^k| u` over all k, from that of S blocks and one on A^S; NaN without."""
    q = ((power @ u[..., None])[..., 0] / u).max(-1)
    return (shown @ u[..., None])[..., 0] / np.where(q < 1, 1 - q, np.nan)[:, None]


def _last_blocks(E: np.ndarray, cost: int) -> tuple[np.ndarray, np.ndarray]:
    """The blocks after which nothing more is seen of each panel, and whether these are too many, of
    loops that are alike; cost: multiplications of one."""
    with np.errstate(all="ignore"):
        finite = np.where(np.isfinite(E), E, 0.0)
        size = np.abs(1 + np.linalg.eigvals(finite)).max(-1, initial=0.0)
        # Size of a mode, at which nothing more is seen of it.
        middle = np.log(1e-13) / np.log(size[:, 0])
        middle = np.where(size[:, 0] < 1, middle, 1.0)
        rim = size[:, 1:].max(-1, initial=0.0)
        # Loops of a rim lose at least a quarter of what that in the middle loses in a block.
        alike = 1 - rim > 0.25 * (1 - size[:, 0])
        # Size at which a mode has grown.
        grown = np.where(rim > 1, np.log(1e6) / np.log(rim), np.inf)
    # Blocks that are looked at, and multiplications of a panel in all of them.
    most_blocks = min(MOST_BLOCKS, 4e9 / cost)
    last = np.minimum(middle, grown)
    slow = (middle > most_blocks) & alike
    # Of these blocks, in which the value may be too large where panels of it rest too slowly.
    given_up = most_blocks * (1 / 16) if E.shape[1] > 1 else most_blocks
    return np.clip(np.where(last > most_blocks, given_up, last), 1.0, most_blocks), slow


class _Step:
    """Responses to an input of 1 from each tick of a frame on, over the value at which they end,
    the mean of their ticks there.

    first: outputs of the first frame. steps: the ticks. ends: of the ticks of a frame, each with a bound on its
    error. settling: whether the ticks are looked for from the step until all samples are within `band`, in place
    of the overshoot; or, if `after` is given, how far samples are from the end that come more than so many ticks
    after the step. scale: what samples are shares of in place of their end, which then counts as 1. unsure: see
    UNSURE.
    """

    def __init__(
        self,
        first: np.ndarray,
        steps: np.ndarray,
        ends: Bounded,
        *,
        settling: bool,
        band: float,
        after: float | None,
        unsure: np.ndarray,
        scale: float | None = None,
    ) -> None:
        self.settling = settling
        self.band = band
        self.in_ticks = settling and after is None
        self.after = -np.inf if after is None else after
        self.unsure = unsure
        self.steps = steps
        final = ends[0].mean(-1)
        self.scale = final if scale is None else np.full_like(final, scale)
        rest = 1 - final / self.scale
        self.inverse = _largest_on(1 / self.scale)
        self.known = np.isfinite(self.inverse) & ~poles_inside(self.scale[..., None])
        self.ends = ends[0] / self.scale[..., None] + rest[..., None]
        self.off = ends[1][:, 0].max(-1)
        self.largest = np.ones(len(self.ends))
        self.most = np.zeros(len(self.ends))
        self.low = np.zeros((len(self.ends), self.unsure.size))
        self.high = np.zeros((len(self.ends), self.unsure.size))
        self.frame = self.ends.shape[-1]
        self.tick = 0
        self._take(first / self.scale[..., None, None] + rest[..., None, None])

    def look(self, outputs: np.ndarray) -> None:
        ends = np.tile(self.ends, outputs.shape[-2] // self.frame)
        self._take(outputs / self.scale[..., None, None] + ends[..., None])

    def _take(self, shares: np.ndarray) -> None:
        """Take the next samples, as shares of the final value, `(panels, points, ticks, steps)`."""
        middle = shares[:, 0].real
        moved = moved_from_middle(shares)
        self.largest = np.maximum(self.largest, np.abs(middle).max((-1, -2)))
        since = self.tick + np.arange(middle.shape[-2])[:, None] - self.steps
        self.tick += middle.shape[-2]
        off = self._off(middle)
        if self.in_ticks:
            least = off - moved
            farthest = off + moved
            for values, size, band in (
                (self.low, least, self.band + self.unsure),
                (self.high, farthest, self.band - self.unsure),
            ):
                for sample in np.flatnonzero(size.max() > band):  # the others are settled
                    last = np.where(size > band[sample], since + 1, 0).max((-1, -2))
                    values[:, sample] = np.maximum(values[:, sample], last)
        else:
            off = np.where(since > self.after, off, -np.inf)
            self.low = np.maximum(self.low, (off - moved).max((-1, -2))[:, None])
            self.high = np.maximum(self.high, (off + moved).max((-1, -2))[:, None])

    def _off(self, middle: np.ndarray) -> np.ndarray:
        """How far samples are from the end, or above it."""
        return np.abs(middle - 1) if self.settling else middle - 1

    def value(self, rest: _Rest) -> Enclosed:
        middle = np.tile(self.ends[:, 0].real, rest.largest.shape[-1] // self.frame)
        moved = np.tile(moved_from_middle(self.ends), rest.largest.shape[-1] // self.frame)
        low, _, low_known = self._of_bound(-self.low, rest.off_so_far)
        low = -low
        self.most, _, _ = self._of_bound(self.high, rest.off_so_far)
        high, unsure, high_known = self._of_bound(self.high, rest.off)
        later = moved + unsure[:, None] + rest.largest * self.inverse[:, None]
        later = (self._off(middle) + later).max(-1)
        if self.in_ticks:
            high = np.where(later <= self.band, high, np.inf)
        else:
            high = np.fmax(high, later)
        high_known &= ~np.isnan(later)
        low = np.where(low_known, np.nan_to_num(low), 0.0)
        return Enclosed(low, np.where(high_known, high, np.inf), self.known & ~low_known)

    def _of_bound(
        self, values: np.ndarray, each_off: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The largest value of each panel by the bound on what samples are off, how much that is of
        the end, and whether it is known."""
        off = each_off.max(-1) + (1 + self.largest) * self.off
        share = off / np.abs(self.scale[:, 0])
        if not self.in_ticks:
            return values[:, 0] + share, share, self.known & (share <= self.unsure[-1])
        place = np.searchsorted(self.unsure, share)  # NaN is behind all
        bounded = self.known & (place < self.unsure.size)
        place = np.minimum(place, self.unsure.size - 1)
        return values[np.arange(len(values)), place], self.unsure[place], bounded


class _SlowMode(NamedTuple):
    """The slowest mode of loops, where it is real and far from the others: its eigenvalue less 1, its left and right
    vector, `(panels, points, ...)`, and the frames after which the others are gone beside
    what it changes in one."""

    w: np.ndarray
    left: np.ndarray
    right: np.ndarray
    frames: np.ndarray

    @staticmethod
    def of(E: np.ndarray) -> tuple[np.ndarray, _SlowMode]:
        """Return the panels with one, and theirs.

        On the rim it alone is within a circle about 0. It is so in all of the disc if no eigenvalue is on the circle
        there, and if `det(r - E)` does not wind about 0 along the rim, there is none.
        """
        n = E.shape[-1]
        w, V = np.linalg.eig(np.where(np.isfinite(E), E, 0.0))
        order = np.abs(w).argsort(-1)
        w, V = np.take_along_axis(w, order, -1), np.take_along_axis(V, order[..., None, :], -1)
        radius = SAFE * np.abs(w[..., 0]).max(-1)
        fading = np.abs(1 + w[:, 0, 1:]).max(-1, initial=0.0)
        there = (w[:, 0, 0].real < 0) & (fading < 1)
        there &= SAFE * radius < np.abs(w[..., 1:]).min((1, 2), initial=1.0)
        there &= ~poles_inside(determinants(radius[:, None, None, None] * np.eye(n) - E)[..., None])
        frames = np.log(1e-2 * np.abs(w[:, 0, 0])) / np.log(np.maximum(fading, 1e-6))
        mode = _SlowMode(w[..., 0], inverse(V)[..., 0, :], V[..., 0], np.clip(frames, 1, 1024))
        there = np.flatnonzero(there)
        return there, _SlowMode(*(part[there] for part in mode))


def _with_slow_mode(
    E: Bounded, O: Bounded, start: Bounded, seen: _Step, mode: _SlowMode
) -> Enclosed:
    """The same as `_over_blocks`, where a slow mode is the last."""
    n = E.value.shape[-1]
    # The mode is the first state; the others are those of the loop, without their part in it.
    lead = np.abs(mode.left * mode.right)[:, 0].argmax(-1)[:, None]
    fast_states = np.argsort(np.arange(n) == lead, axis=-1, kind="stable")[:, :-1]
    right, left_vectors = (
        part / np.take_along_axis(part, lead[:, None], -1) for part in (mode.right, mode.left)
    )
    rows = np.arange(len(lead))[:, None]
    units = np.zeros(E.value.shape, complex)
    units[..., 0] = right
    units[rows, :, fast_states, np.arange(1, n)] = 1.0
    units[rows, :, lead, np.arange(1, n)] = -np.take_along_axis(
        left_vectors, fast_states[:, None], -1
    ).mT
    units = Bounded.exact(units)
    back = units.inverse()
    whole = E
    E = back @ E @ units
    O = O @ units
    w = mode.w[..., None, None]
    filtered = (O @ (E + Bounded.exact(-w * np.eye(n)))).over(Bounded.exact(-w))
    X, dX = back @ start
    of_O, of_filtered = (pair.part(slice(None), 0).with_rounding(n) for pair in (O, filtered))
    # what w may be off in the middle, to first order
    of_w = (
        np.abs(left_vectors[:, :1])
        @ whole.part(slice(None), 0).with_rounding(n + 2)
        @ np.abs(right[:, 0, :, None])
    )
    of_w = of_w / np.abs((left_vectors * right)[:, 0].sum(-1))[:, None, None]
    of_filtered = of_filtered + np.abs((O @ E).value[:, 0]) * of_w / np.abs(w[:, 0]) ** 2
    rough = E.part(slice(None), 0).with_rounding(n + 2) + sum_rounding(n + 2) * np.eye(n)
    E, O, filtered = (pair.value for pair in (E, O, filtered))

    # Frames until the others are gone, of the slowest of these.
    frames = int(mode.frames.max())
    power = np.zeros_like(E)  # A^k - 1
    largest = np.zeros((len(E), n))
    largest_powers = np.zeros((len(E), n, n))  # of |A^k|
    summed = largest_powers
    shown = np.zeros(O[:, 0].shape)
    for _ in range(frames):
        seen.look(O @ X)
        largest = np.maximum(largest, np.abs(X[:, 0]).max(-1))
        grown = power + np.eye(n)
        size = _largest_on(grown)
        largest_powers = np.maximum(largest_powers, size)
        summed = summed + size
        shown = np.maximum(shown, _largest_on(filtered @ grown))
        X = X + E @ X
        power = power + E + E @ power
    of_all = _largest_on(power + np.eye(n))
    pushed = summed @ (rough @ largest[..., None])
    begun = dX[:, 0].max(-1, keepdims=True)
    u = _largest_on(X).max(-1, keepdims=True) + of_all @ begun + pushed
    of_all = of_all + summed @ rough
    for _ in range(30):
        u = np.maximum(u, of_all @ u * (1 + 1e-3))
    holds = (of_all @ u <= u).all((1, 2))
    later = shown @ u + _largest_on(filtered) @ (summed @ (rough @ u)) + of_filtered @ u
    off = (of_O @ largest[..., None] + np.abs(O[:, 0]) @ (largest_powers @ begun + pushed))[..., 0]
    return seen.value(_Rest(np.where(holds[:, None], later[..., 0], np.nan), off, off))


def _seen_over_blocks(E: Bounded, O: Bounded, start: Bounded, seen: _Step) -> Enclosed:
    """The same in doubles with no bound on what follows, until little is left of all modes."""
    changed = E.value
    rows = O.value
    while rows.shape[-2] < ROWS_OF_BLOCK:
        rows = np.concatenate([rows, rows + rows @ changed], -2)
        changed = 2 * changed + changed @ changed
    X = start.value
    size = np.abs(1 + np.linalg.eigvals(changed[:, 0])).max(-1, initial=0.0)
    blocks = np.log(LITTLE) / np.log(size)
    finite_panels = seen.known & (blocks <= MOST_BLOCKS)
    for _ in range(1 + int(blocks[finite_panels].max(initial=-1))):
        seen.look(rows @ X)
        X = X + changed @ X
    low = seen.low[:, 0]
    return Enclosed(low, np.where(finite_panels, low, np.inf))


def step(
    maps: Sequence[Bounded],
    level: float | None = None,
    *,
    settling: bool = False,
    band: float = BAND,
    after: float | None = None,
    read: np.ndarray | None = None,
    scale: float | None = None,
    proved: bool = True,
) -> Enclosed:
    """The overshoot of a step, of its final value, for the worst tick of a frame at which it may
    come; or the ticks from the step until all samples are within `band` of that value, as a share of it; or, more than
    `after` ticks after the step, how far samples are from it, as a share of it.

    maps: E, G, O and T, see `over_frame`, at the middle of each panel and on its rim, `(panels, points, ...)`, each
    with a bound on its error; read: the ticks of their inputs, None for all. level: about which the value is asked, None
    if it is; scale: what `band` is a share of in place of the final value; proved: whether all later samples are
    bounded, else it is what is seen of some loops, whose E is finite, in doubles. Without a final value, or next to 0,
    nothing is known, unless there is a scale.
    """
    E, G, O, T = maps
    ticks = T.value.shape[-2]
    read = np.arange(ticks) if read is None else read
    # Behind a tick in which nothing reads the input, the step from there on is the same.
    steps = np.append(0, 1 + read[read < ticks - 1])
    begun = (read[:, None] >= steps).astype(float)
    with np.errstate(all="ignore"):
        ones = np.ones((read.size, 1))
        end = (-E).solved(G @ ones)
        regular = ~poles_inside(determinants(E.value)[..., None])
        starts = G @ begun - end
        first = T.value @ begun
        ends = O @ end + T @ ones
        ends = ends.part(..., 0)

        def found(method: Callable[..., Any], panels: np.ndarray, *more: Any) -> Enclosed:
            unsure = UNSURE if proved else UNSURE[:1]
            seen = _Step(
                first[panels],
                steps,
                ends.part(panels),
                settling=settling,
                band=band,
                after=after,
                unsure=unsure,
                scale=scale,
            )
            seen.known &= regular[panels]
            return method(*(pair.part(panels) for pair in (E, O, starts)), seen, *more)

        open_ = np.ones(len(E.value), bool)
        value = Enclosed.unknown(open_.size)
        if level is not None and not settling:
            there, mode = _SlowMode.of(E.value)
            for alike in distinct([np.ceil(np.log2(mode.frames))], there.size):
                panels = there[alike]
                slowly = found(_with_slow_mode, panels, _SlowMode(*(part[alike] for part in mode)))
                value.low[panels] = slowly.low.real
                value.high[panels] = slowly.high.real
            # Where the others are gone before the mode changes, only narrower panels tell more.
            open_[there] &= np.abs(mode.w[:, 0]) * mode.frames > 1
        open_ = np.flatnonzero(open_ & ~value.decided(level))
        if not open_.size:
            return value
        slow = np.zeros(len(value.low), bool)
        groups = [open_]
        if level is None:  # loops that come to rest as late as each other
            last = -1 / np.log(np.abs(1 + np.linalg.eigvals(E.value[open_, 0])).max(-1, initial=0))
            groups = [open_[alike] for alike in distinct([np.ceil(np.log2(last))], open_.size)]
        for panels in groups:
            by_blocks = (
                found(_over_blocks, panels, level) if proved else found(_seen_over_blocks, panels)
            )
            slow[panels] = by_blocks.slow
            value.low[panels] = np.fmax(value.low[panels], by_blocks.low.real)
            value.high[panels] = np.fmin(value.high[panels], by_blocks.high.real)
        return value._replace(slow=slow, looked_at=by_blocks.looked_at)
