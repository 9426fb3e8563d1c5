"""Loops over a frame: what each tick shows of the state at the frame's start, and what its force leaves, with errors."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.monodromy.periodic import in_a_row, then, ticks_of
from wavesweep.engine.monodromy.rounding import ENTRIES, ROUNDING, both
from wavesweep.engine.monodromy.unit_circle import solve
from wavesweep.engine.response.bordered import Bordered
from wavesweep.engine.response.bounded_sums import joined, long_sum, plus, times
from wavesweep.engine.response.circle import Circle, circle_of
from wavesweep.engine.response.modal import Modal
from wavesweep.engine.response.port import Port, reached

LEAF = 64  # ticks up to which the outputs for forces of the same stretch are kept as a matrix
HUGE = 1e100  # entries whose squares are next to overflow


@dataclass(frozen=True, eq=False)
class Stretch:
    """Some ticks in a row; all arrays come as pairs with bounds on the errors of their entries.

    E `(..., n, n)`: the change of the state. seen `(..., p, ticks, n)`: the outputs in each tick for the state before the
    first. left `(..., n, ticks)`: what the force of each tick adds to the state after the last. For forces of the same stretch:
    own `(..., p, ticks)` has the sums of outputs over equal numbers of ticks since a force, and inner `(..., ticks, ticks)`
    the last output in each tick. A stretch of more than LEAF ticks has two parts, `first` and `second`, in place of these.
    kept, rows: which of their states and outputs it has, if not all.
    """

    E: tuple
    seen: tuple
    left: tuple
    own: tuple | None
    inner: tuple | None
    first: "Stretch | None" = None
    second: "Stretch | None" = None
    kept: np.ndarray | slice | None = None
    rows: slice = field(default_factory=lambda: slice(None))

    @staticmethod
    def of(port: Port) -> "Stretch":
        """Return the port's frame; repeated stretches are joined once."""
        ticks = []
        for parts, sizes in zip(port.maps, port.sizes, strict=True):
            E, B, C, D = (np.broadcast_arrays(part, ENTRIES * size) for part, size in zip(parts, sizes, strict=True))
            ticks.append(Stretch(E, [part[..., None, :] for part in C], B, D, [part[..., -1:, :] for part in D]))
        return in_a_row(port.kind.tolist(), ticks, _joined)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return self.left[0].shape[-1]

    def showing(self, rows: slice) -> "Stretch":
        """Return the frame with some outputs, and the states that these need to know of it."""
        n, seen = self.E[0].shape[-1], [part[..., rows, :, :] for part in self.seen]
        reads = ((self.E[0] + np.eye(n)) != 0).reshape(-1, n, n).any(0)
        kept = reached((seen[0] != 0).reshape(-1, n).any(0), reads)
        E, left = [part[..., kept[:, None], kept] for part in self.E], [part[..., kept, :] for part in self.left]
        own = self.own and [part[..., rows, :] for part in self.own]
        return replace(self, E=E, seen=[part[..., kept] for part in seen], left=left, own=own, kept=kept, rows=rows)

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Sums over the ticks of the sizes of `seen`, `(..., p, n)`, and of `left`, `(..., n, 1)`."""
        return np.abs(self.seen[0]).sum(-2), np.abs(self.left[0]).sum(-1, keepdims=True)

    @cached_property
    def size_of_own(self) -> np.ndarray:
        """Sum of the sizes of the terms of the outputs for forces of the same stretch, `(..., p)`."""
        if self.own:
            return np.abs(self.own[0]).sum(-1)
        across = (self.second.sizes[0] @ self.first.sizes[1])[..., 0]
        return (self.first.size_of_own + self.second.size_of_own + across)[..., self.rows]

    def whole(self, part: int = 0) -> np.ndarray:
        """Return the map from all forces to the last output in each tick, for the state 0; part: 1 for errors."""
        if self.inner:
            return self.inner[part]
        first, second, across = self.first.whole(part), self.second.whole(part), self.across[part]
        return _triangular(first, across, second)

    @property
    def across(self) -> tuple:
        """The map from forces of the first part to the last output in the second, a pair."""
        return times([part[..., -1, :, :] for part in self.second.seen], self.first.left)


def _joined(first, second):
    """Return one stretch after the other."""
    eye = np.eye(first.E[0].shape[-1])
    before, after = ((eye + each.E[0], each.E[1]) for each in (first, second))
    E = then(first.E[0], second.E[0]), both(first.E, second.E)[1]
    seen = joined((first.seen, times(second.seen, [part[..., None, :, :] for part in before])), -2)
    left = joined((times(after, first.left), second.left), -1)
    if first.ticks + second.ticks > LEAF:
        return Stretch(E, seen, left, None, None, first, second)
    later = times(second.seen, [part[..., None, :, :] for part in first.left])
    own = plus(plus(_padded(first.own, second.ticks), _padded(second.own, first.ticks)), _over_lags(later))
    across = [part[..., -1, :, :] for part in later]
    return Stretch(E, seen, left, own, [_triangular(*parts) for parts in zip(first.inner, across, second.inner, strict=True)])


def _triangular(first, across, second):
    """Return the map of two stretches from those of both, and from the first to the second."""
    batch, rows = np.broadcast_shapes(*(part.shape[:-2] for part in (first, across, second))), first.shape[-1]
    whole = np.zeros((*batch, rows + second.shape[-1], rows + second.shape[-1]))
    whole[..., :rows, :rows], whole[..., rows:, :rows], whole[..., rows:, rows:] = first, across, second
    return whole


def _padded(pair, count):
    return tuple(np.concatenate([part, np.zeros((*part.shape[:-1], count))], axis=-1) for part in pair)


def _over_lags(later):
    """Return sums over equal numbers of ticks between a force in the first stretch, and an output in the second.

    later: a pair of `(..., second, first)`. Their ticks together are the length of the result.
    """
    found = []
    for part in (later[0], later[1] + ROUNDING * np.abs(later[0])):
        second, first = part.shape[-2:]
        wide = np.zeros((*part.shape[:-2], second, first + second))  # each row, put into shorter ones, is shifted by one more
        wide[..., :first] = part[..., ::-1]
        wide = wide.reshape(*part.shape[:-2], -1)[..., : second * (first + second - 1)]
        sums = wide.reshape(*part.shape[:-2], second, first + second - 1).sum(-2)
        found.append(np.concatenate([np.zeros((*sums.shape[:-1], 1)), sums], axis=-1))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Sums:
    """A stretch under the force z^i in tick i: the outputs' sums over its ticks, each times z^-i, are `rows X + own`.

    rows `(..., p, points, n)`; own `(..., p, points)`; left `(..., n, points)`: what the force adds to the state. Each is
    followed by a bound on its error, drows `(..., p, n)`, down `(..., p, points)`, dleft `(..., n, 1)`.
    """

    rows: np.ndarray
    drows: np.ndarray
    own: np.ndarray
    down: np.ndarray
    left: np.ndarray
    dleft: np.ndarray

    @staticmethod
    def of(stretch: Stretch, points, known: dict | None = None) -> "Sums":
        """Return the sums at these points of the circle (see `Circle`); known: those of its parts, by identity."""
        known = {} if known is None else known
        if id(stretch) not in known:
            known[id(stretch)] = _of_leaf(stretch, points) if stretch.own else _of_parts(stretch, points, known)
        return known[id(stretch)]


def _of_leaf(stretch, points):
    z, rough = points.ladder(stretch.ticks), long_sum(stretch.ticks)
    real, imag = z.real.copy(), z.imag.copy()  # contiguous, as BLAS wants them
    (seen, dseen), (own, down), (left, dleft) = stretch.seen, stretch.own, stretch.left
    size, most = stretch.sizes
    return Sums(
        real.T @ seen - 1j * (imag.T @ seen),
        dseen.sum(-2) + rough * size,
        own @ real - 1j * (own @ imag),
        (down + rough * np.abs(own)).sum(-1, keepdims=True),
        left @ real + 1j * (left @ imag),
        dleft.sum(-1, keepdims=True) + rough * most,
    )


def _of_parts(stretch, points, known):
    (first, second), eye = (stretch.first, stretch.second), np.eye(stretch.first.E[0].shape[-1])
    a, b = (Sums.of(each, points, known) for each in (first, second))
    (before, dbefore), (after, dafter) = ((eye + each.E[0], each.E[1]) for each in (first, second))
    turn, size, most = points.turn(first.ticks), second.sizes[0], first.sizes[1]
    unsure = dbefore + ROUNDING * np.abs(before), dafter + ROUNDING * np.abs(after)
    back = turn.conj()
    shown = (b.rows * np.swapaxes(a.left, -1, -2)[..., None, :, :]).sum(-1)
    kept, some = slice(None) if stretch.kept is None else stretch.kept, stretch.rows
    rounding = [ROUNDING * part for part in stretch.sizes]
    return Sums(
        (a.rows + back[:, None] * (b.rows @ before[..., None, :, :]))[..., some, :, kept],
        (a.drows + b.drows @ np.abs(before) + size @ unsure[0])[..., some, kept] + rounding[0],
        (a.own + b.own + back * shown)[..., some, :],
        (a.down + b.down + b.drows @ most + size @ (a.dleft + ROUNDING * most))[..., some, :],
        (after @ a.left + turn * b.left)[..., kept, :],
        (np.abs(after) @ a.dleft + b.dleft + unsure[1] @ most)[..., kept, :] + rounding[1],
    )


@dataclass(frozen=True, eq=False)
class Lifted:
    """Loops over a frame, ready for any frequency.

    whole: their ticks in a row, with the outputs of the port and the position at the beginning of each tick. frame: the same
    without the position and all that only this depends on. lost: which loops overflow in it, and are left at 0.
    """

    port: Port
    whole: Stretch
    frame: Stretch
    lost: np.ndarray

    @staticmethod
    def of(port: Port) -> "Lifted":
        """Return the loops over the port's frame."""
        with np.errstate(all="ignore"):  # a frame that overflows is found here
            whole = Stretch.of(_with_position(port))
            lost = np.broadcast_to(~_all(whole, np.isfinite), port.batch)
            if lost.any():
                whole = Stretch.of(_with_position(_without(port, lost)))
        return Lifted(port, whole, whole.showing(slice(0, port.outputs)), lost)

    @property
    def order(self) -> int:
        """Number of states."""
        return self.frame.E[0].shape[-1]

    @property
    def weight(self) -> int:
        """Numbers that each frequency takes."""
        return self.lost.size * self.port.outputs * (self.order + 2) + min(self.frame.ticks, LEAF)

    @cached_property
    def modal(self) -> Modal:
        """The modes of the frame."""
        return Modal(*self.frame.E)

    @cached_property
    def bordered(self) -> Bordered:
        """The larger system, for what modes do not give."""
        return Bordered(self.port.seen(), Stretch.of, Sums.of)

    @cached_property
    def of_positions(self) -> "tuple[Stretch, np.ndarray]":
        """The frame with the position as its only output, and which loops have numbers there whose squares overflow."""
        frame = self.whole.showing(slice(self.port.outputs, None))
        huge = ~_all(frame, lambda part: np.abs(part) < HUGE) & ~self.lost
        if huge.any():
            frame = Stretch.of(_with_position(_without(self.port, huge | self.lost))).showing(slice(self.port.outputs, None))
        return frame, huge | self.lost

    def stable_for_sure(self) -> np.ndarray:
        """Return which loops are stable whatever rounding does, `(...)`, by Gershgorin's discs about their eigenvalues."""
        n = self.port.maps[0][0].shape[-1]
        E, dE = (part[..., :n, :n] for part in self.whole.E)
        with np.errstate(all="ignore"):
            poles, V = np.linalg.eig(E)
            into = solve(V.astype(complex), np.broadcast_to(np.eye(n), V.shape))
            left = np.abs(into @ E @ V - poles[..., None, :] * np.eye(n)) + np.abs(into) @ dE @ np.abs(V)
            sure = (np.abs(1 + poles) + 2 * left.sum(-1) < 1).all(-1)
        return sure & ~self.lost

    def circle(self, frequency_hz) -> Circle:
        """Return the frequencies (Hz) on the circles of this loop."""
        return circle_of(np.asarray(frequency_hz, float).tobytes(), self.port.rate, self.frame.ticks)


def _all(frame, test):
    parts = (*frame.E, *frame.left, *(part.reshape(*part.shape[:-3], -1, part.shape[-1]) for part in frame.seen))
    return np.logical_and.reduce(np.broadcast_arrays(*(test(part).all((-1, -2)) for part in parts)))


def _without(port, lost):
    """Return the port with zeros in place of the loops that are lost."""
    gone = lost[..., None, None]
    maps, sizes = (
        tuple(tuple(np.where(gone, 0.0, part) for part in each) for each in parts) for parts in (port.maps, port.sizes)
    )
    return replace(port, maps=maps, sizes=sizes)


def _with_position(port):
    """Return the port with the position at the beginning of each tick as a further output, a state more if it drifts."""
    drifts, n = port.position is None, port.maps[0][0].shape[-1]
    found = []
    for parts, sign in ((port.maps, 1), (port.sizes, -1)):
        several = []
        for E, B, C, D in parts:
            batch = np.broadcast_shapes(*(part.shape[:-2] for part in (E, B, C, D)))
            wide, more = np.zeros((*batch, n + drifts, n + drifts)), np.zeros((*batch, n + drifts, 1))
            wide[..., :n, :n], more[..., :n, :] = E, B
            C_wide, D_wide = np.zeros((*batch, port.outputs + 1, n + drifts)), np.zeros((*batch, port.outputs + 1, 1))
            C_wide[..., :-1, :n], D_wide[..., :-1, :] = C, D
            if drifts:
                wide[..., n, :n], more[..., n, :], C_wide[..., -1, n] = C[..., 0, :], D[..., 0, :], 1.0
            else:
                C_wide[..., -1:, :] = port.position if sign > 0 else np.abs(port.position)
            several.append((wide, more, C_wide, D_wide))
        found.append(tuple(several))
    return replace(port, maps=found[0], sizes=found[1])


def over_frame(port: Port, ticks: int, *, positions: bool) -> tuple[np.ndarray, ...]:
    """Return E, B, C and D of one loop over a frame, from the forces of its ticks (N) to the displacements in them (m).

    ticks: in a frame, if the loop's own is a single one. positions: to those at the starts of the ticks instead; one that
    drifts is then among the states.
    """
    port, row = (_with_position(port), slice(-1, None)) if positions else (port, slice(1))
    maps, sizes = (tuple((E, B, C[row], D[row]) for E, B, C, D in parts) for parts in (port.maps, port.sizes))
    kind = np.tile(port.kind, ticks // port.kind.size)
    frame = Stretch.of(replace(port, kind=kind, maps=maps, sizes=sizes)).showing(slice(None))
    return frame.E[0], frame.left[0], frame.seen[0][0], frame.whole()


def held_over_frame(drawn: MultirateLoop, inputs: Sequence[str], signals: tuple[str, ...]) -> tuple[np.ndarray, ...]:
    """Return A, B, C and D of one loop from frame to frame, of the states that the signals depend on.

    inputs: from outside, each held over the whole frame. signals: as the first tick of a frame shows them.
    """
    ticks = ticks_of(drawn, signals)
    columns = [ticks.maps[0].inputs.index(name) for name in inputs]
    n, first = len(ticks.states), ticks.maps[ticks.kind[0]]
    A, B = np.eye(n), np.zeros((n, len(columns)))
    for each in (ticks.maps[kind] for kind in ticks.kind.tolist()):
        A, B = A + each.E @ A, B + each.E @ B + each.B[:, columns]
    seen = reached((first.C != 0).any(0), A != 0)
    return A[np.ix_(seen, seen)], B[seen], first.C[:, seen], first.D[:, columns]
