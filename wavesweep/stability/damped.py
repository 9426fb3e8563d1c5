"""Intervals in which every mode of a loop has a damping ratio, along any number, by discs about its eigenvalues."""

from dataclasses import dataclass

import numpy as np

from wavesweep.monodromy.circle import inverse
from wavesweep.monodromy.product import ROUNDING
from wavesweep.monodromy.rounding import balance
from wavesweep.stability.along_any import EXACT
from wavesweep.stability.certificate import CROWDED, NONE, SEARCH
from wavesweep.stability.certificate import ROUNDING as ROUNDED
from wavesweep.stability.frames import level, pole_inside
from wavesweep.stability.polishing import ATTACHED
from wavesweep.stability.regions import NEAR_ZERO
from wavesweep.stability.stable import Intervals

PANELS, MANY = 16, 512  # panels of a column to begin with; so many that are open, beyond which it is given up
NARROW = 256.0  # so many of the narrowest panels are as wide as an end is exact: eigenvalues may move along the spiral
RIM = np.exp(1j * np.pi * (np.arange(8) + 0.5) / 8)  # of a disc; its lower half is the conjugate
SAFE = 1.5  # on the largest value at these points, for those between
TYPICAL = (0.53, 0.37, 0.71, 0.13, 0.91)  # of the span, where the structure of the frames is looked at
NOTHING = 1e-14  # of the largest singular value, up to which one is 0
SMALL = 1e-3  # up to which eigenvalues may be 0 but for rounding
FINE = 0.1  # what an inverse of eigenvectors may be off by
ENTRIES = 2_000_000  # of matrices at a time
GOOD, OPEN, LOST, BAD = range(4)  # of two that overlap the larger one holds


def damped_along_any(frames, errors, span, columns: int, period, bounds, ratio: float) -> Intervals:
    """All intervals of a number p within span = (low, high) in which every mode has at least the damping ratio, per column.

    A mode of the frame's eigenvalue z has s = log(z)/T, the principal logarithm, T being the time of the frame, and the damping
    ratio `-Re s/|s|`. So z has to be within the spiral `r = exp(-c |angle|)`, `c = ratio/sqrt(1 - ratio^2)`.

    frames(column, p): `Frames` of these columns at these values, real or complex, of which the pivots are read. errors(column,
    p): frames less identity, perhaps in other states, and bounds on the errors of their entries. period: of the frame, s,
    `(columns,)`. bounds: p beyond them has no loop, two arrays `(columns,)`. ratio: above 0 and below 1.

    No eigenvalue crosses the spiral within a panel of p if no Gershgorin disc touches it, of the frames in the eigenvectors of
    that in the middle. The entries there are bounded by the frames on a circle about the panel, as they are analytic and vanish
    in the middle (Schwarz's lemma), and by the errors of the frames. If all discs are inside, all of the panel is; if one that
    is outside is apart from those that touch, none of it is; otherwise the panel is halved. What is left are the ends, each in
    a gap as narrow as ends are exact, and panels in doubt. Eigenvalues that are 0 all along, of delays and held values, are
    taken out before, and diagonal blocks are treated by themselves.
    Accuracy: ends to 1e-9 of themselves and of a hundred-thousandth of the span; those within 1e-9 of the span of its low end
    are given as that end.
    """
    loops, known = _loops_of(frames, errors, span, columns)
    c = ratio / np.sqrt(1 - ratio**2)
    panels = [[(np.full(1, span[0]), np.full(1, GOOD if known[column] else LOST))] for column in range(columns)]
    for each in loops:
        owner, low, label = each.panels(span, [part[each.columns] for part in bounds], c)
        for at, column in enumerate(each.columns.tolist()):
            own = owner == at
            order = np.argsort(low[own])
            panels[column].append((low[own][order], label[own][order]))
    rows = [_intervals(column, *_merged(some, span), loops, span, period[column], c) for column, some in enumerate(panels)]
    names = ("column", "index", "count", "low", "high", "low_omega", "high_omega", "doubt", "residual")
    parts = zip(*(row for some in rows for row in some), strict=True)
    kinds = (int, int, int, float, float, float, float, int, float)
    return Intervals(**{name: np.array(part, kind) for name, part, kind in zip(names, parts, kinds, strict=True)})


def _loops_of(frames, errors, span, columns):
    """The loops' diagonal blocks without eigenvalues that are 0 all along, and whether the frames of each column are known."""
    points = span[0] + (span[1] - span[0]) * np.array(TYPICAL)
    E, _ = errors(np.repeat(np.arange(columns), points.size), np.tile(points, columns))
    E = E.reshape(columns, points.size, *E.shape[1:])
    finite = np.isfinite(E).all((-1, -2))
    E = np.where(finite[..., None, None], E, -np.eye(E.shape[-1]))
    loops = []
    for block in _blocks((E + np.eye(E.shape[-1]) != 0).any((0, 1))):
        bases = [_living(each[:, block[:, None], block]) for each in E]
        for size in sorted({each.shape[-1] for each in bases} - {0}):
            some = np.flatnonzero([each.shape[-1] == size for each in bases])
            loops.append(_Loops(frames, errors, some, E.shape[-1], block, np.stack([bases[at] for at in some])))
    return loops, finite.any(-1)


def _blocks(there):
    """The states of each diagonal block: those that act on one another."""
    from scipy.sparse.csgraph import connected_components

    name = connected_components(there, connection="strong")[1]
    return [np.flatnonzero(name == each) for each in np.unique(name)]


def _living(E):
    """Bases on the left and on the right, `(2, n, r)`, in which frames have their eigenvalues other than 0.

    E: frames less identity, `(points, n, n)`.
    """
    units = balance(np.abs(E).max(0)[None])[1][0]
    left, right = np.diag(1 / units), np.diag(units)
    A = left @ (E + np.eye(len(units))) @ right
    size = np.inf
    while 0 < A.shape[-1] < size:
        size = A.shape[-1]
        for each in (A, np.swapaxes(A, -1, -2)):
            U, sizes, _ = np.linalg.svd(np.concatenate(list(each), axis=-1), full_matrices=False)
            U = U[:, sizes > NOTHING * sizes.max(initial=0.0)]
            if U.shape[-1] < U.shape[0] == A.shape[-1]:
                A, left, right = U.T @ A @ U, left @ U, right @ U
    return np.stack([left, right])


@dataclass(frozen=True, slots=True, eq=False)
class _Loops:
    """A diagonal block of the frames of some columns, in bases `(columns, 2, n, r)`; frames, errors: of all columns.

    order: of whole frames.
    """

    frames: object
    errors: object
    columns: np.ndarray
    order: int
    block: np.ndarray
    bases: np.ndarray

    def _own(self, column, E, sizes=False):
        """The block of whole frames, `(n, ..., order, order)`, or bounds on its errors from those of whole frames."""
        if E.shape[-1] != self.order:  # states that are there at some values alone
            return np.full((*E.shape[:-2], *2 * self.bases.shape[-1:]), np.nan)
        left, right = (self.bases[column, side].reshape(-1, *(E.ndim - 3) * (1,), *self.bases.shape[2:]) for side in (0, 1))
        left, right = (np.abs(left), np.abs(right)) if sizes else (left, right)
        return np.swapaxes(left, -1, -2) @ E[..., self.block[:, None], self.block] @ right

    def at(self, column, p):
        """The frames less identity, `(n, r, r)`, and bounds on the errors of their entries."""
        E, dE = self.errors(self.columns[column], p)
        found, error = self._own(column, E), self._own(column, np.abs(dE), sizes=True)
        if self.bases.shape[-1] < self.bases.shape[-2]:
            error = error + NOTHING * np.abs(found + np.eye(found.shape[-1])).max((-1, -2), keepdims=True)
        return found, error

    def about(self, column, middle, radius):
        """`at` the middles of discs, and the frames on their rims, `(n, points, r, r)`, NaN if there may be a pole inside."""
        rim = middle[:, None] + radius[:, None] * RIM
        p, columns = np.concatenate([middle[:, None], rim], axis=1), self.columns[column][:, None]
        inside, pivots = (self.frames(columns, each).pivots for each in (middle[:, None], rim))
        pivots = pivots.reshape(*rim.shape, -1)
        poles = pole_inside(pivots, level(inside[:, None])) & (pivots != pivots[:, :1]).any((1, 2))
        E, dE = self.at(np.repeat(column, p.shape[1]), p.ravel())  # all in one call, so that they have the same states
        E, dE = (part.reshape(*p.shape, *part.shape[1:]) for part in (E, dE))
        return E[:, 0].real, dE[:, 0], np.where(poles[:, None, None, None], np.nan, E[:, 1:])

    def panels(self, span, bounds, c):
        """Panels that cover the span: their columns, low ends and labels."""
        edges, count = np.linspace(*span, PANELS + 1), len(self.columns)
        column, low, high = np.repeat(np.arange(count), PANELS), np.tile(edges[:-1], count), np.tile(edges[1:], count)
        done, width, few = [], span[1] - span[0], max(1, ENTRIES // (2 * RIM.size * self.bases.shape[-1] ** 2))
        while column.size:
            parts = [slice(first, first + few) for first in range(0, column.size, few)]
            label = np.concatenate([self._label(column[some], low[some], high[some], bounds, c) for some in parts])
            narrow = (NARROW * (high - low) <= _exact((low + high) / 2, width)) | (high - span[0] <= ATTACHED * width)
            label = np.where((label == OPEN) & ~narrow & (np.bincount(column, minlength=count)[column] > MANY), LOST, label)
            closed = (label != OPEN) | narrow
            done.append((column[closed], low[closed], label[closed]))
            column, low, high = (part[~closed] for part in (column, low, high))
            middle = (low + high) / 2
            column, low, high = np.tile(column, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
        return [np.concatenate(parts) for parts in zip(*done, strict=True)]

    def _label(self, column, low, high, bounds, c):
        """GOOD, BAD or OPEN of panels."""
        middle, half = (low + high) / 2, (high - low) / 2
        E, dE, rims = self.about(column, middle, 2 * half)
        known = (middle - 2 * half >= bounds[0][column]) & (middle + 2 * half <= bounds[1][column])
        known &= np.isfinite(E).all((-1, -2)) & np.isfinite(dE).all((-1, -2)) & np.isfinite(rims).all((-1, -2, -3))
        label = np.full(column.size, OPEN)
        some = np.flatnonzero(known)
        if some.size:
            label[some] = _by_discs(E[some], dE[some], rims[some], c)
        return label

    def worst(self, column, p, c):
        """Of each loop the eigenvalue less 1 that is farthest outside of the spiral, and by how much in the logarithm."""
        E, _ = self.at(np.full(p.size, np.searchsorted(self.columns, column)), p)
        delta = np.linalg.eigvals(np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0)).astype(complex)
        beyond = _beyond(delta, c)
        most = beyond.argmax(-1)[:, None]
        return np.take_along_axis(delta, most, -1)[:, 0], np.take_along_axis(beyond, most, -1)[:, 0]


def _by_discs(E, dE, rims, c):
    """The labels of panels; E, dE: in the middle, `(n, r, r)`; rims: the frames on circles of twice the size about them."""
    n = E.shape[-1]
    delta, V = _vectors(E, min(SMALL, np.exp(-np.pi * c) / 4))
    with np.errstate(all="ignore"):
        W, own = inverse(V), np.abs(V)
        wide, off = np.abs(W), np.abs(W @ V - np.eye(n)) + n * ROUNDING * (np.abs(W) @ own)
        change = np.maximum(*(np.abs(W[:, None] @ (each - E[:, None]) @ V[:, None]).max(1) for each in (rims, rims.conj())))
        defect = np.abs(W @ (E @ V - V * delta[:, None, :])) + wide @ (dE + n * ROUNDING * np.abs(E)) @ own
        loss = off.sum(-1).max(-1)
        entries = (SAFE / 2 * change + defect + off * np.abs(delta[:, None, :])) / (1 - loss)[:, None, None]
        label, finite = np.full(len(E), OPEN), np.isfinite(entries).all((-1, -2)) & (loss < FINE)
        label[finite] = _of_entries(delta[finite], balance(entries[finite])[0], c)
    return label


def _vectors(E, small):
    """Eigenvalues less 1 and eigenvectors; for several eigenvalues of I + E up to `small`, which may have too few of these, the
    vectors of a Schur form.
    """
    from scipy.linalg import schur

    delta, V = (part.astype(complex) for part in np.linalg.eig(E))
    near = np.abs(1 + delta) <= small
    for at in np.flatnonzero(near.sum(-1) > 1):
        T, Q, count = schur(E[at] + np.eye(E.shape[-1]), output="complex", sort=lambda z: abs(z) <= small)
        if count == near[at].sum():
            delta[at] = np.append(np.diagonal(T)[:count] - 1, delta[at][~near[at]])
            V[at] = np.concatenate([Q[:, :count], V[at][:, ~near[at]]], axis=1)
    return delta, V


def _of_entries(delta, entries, c):
    """The labels of panels whose matrices differ from their eigenvalues by these entries, `(n, r, r)`.

    In units in which the discs that touch the spiral are small beside the others, they are as small as the eigenvalues' first
    derivatives let them be, however far from normal the frames are; the others may grow by half of their distance from it.
    """
    z, s, nearest = 1 + delta, np.log1p(delta), np.exp(-np.pi * c)
    size, x, y = np.abs(z), s.real, np.abs(s.imag)
    apart = np.minimum(_distance(x, y, c), _distance(x, 2 * np.pi - y, c))  # from the spiral, from both sides of its end
    room = np.fmax.reduce([-size * np.expm1(-apart), nearest - size, size - 1])
    radius, outside = entries.sum(-1), _beyond(delta, c) > 0
    touching = (radius >= room)[:, None, :]
    into, among = (np.where(some, entries, 0.0).sum(-1) for some in (touching, ~touching))
    ratio = np.where(touching[:, 0], 0.0, np.where(room / 2 > among, into / (room / 2 - among), 1.0)).max(-1)
    units = np.where(touching[:, 0], 1.0, np.clip(ratio, 1e-12, 1.0)[:, None])
    one, other = (_of_discs(z, each, room, outside) for each in (radius, (entries * units[:, None, :]).sum(-1) / units))
    return np.where(one == OPEN, other, one)


def _of_discs(z, radius, room, outside):
    """The labels of panels whose eigenvalues are in discs about z, `(n, r)`, that have this room on one side of the spiral."""
    clear, meet = radius < room, np.abs(z[:, :, None] - z[:, None, :]) <= radius[:, :, None] + radius[:, None, :]
    touched = ~clear
    for _ in range(z.shape[-1] - 1):
        touched = touched | (meet & touched[:, None, :]).any(-1)
    good = clear.all(-1) & ~outside.any(-1)
    return np.where(good, GOOD, np.where((outside & ~touched).any(-1), BAD, OPEN))


def _distance(x, y, c):
    """The distance of points from the segment that the spiral's half with angles up to pi is in the logarithm."""
    at = np.clip((y - c * x) / (1 + c**2), 0, np.pi)
    return np.hypot(x + c * at, y - at)


def _beyond(delta, c):
    """By how much eigenvalues `1 + delta` are outside of the spiral in the logarithm."""
    with np.errstate(all="ignore"):
        s = np.log1p(delta)
        return np.where(delta == -1, -np.inf, s.real + c * np.abs(s.imag))


def _exact(p, width):
    """How exact an end is."""
    return EXACT * (np.abs(p) + NEAR_ZERO * width)


def _merged(panels, span):
    """Low ends and labels of runs of panels: of several partitions of the span, each as sorted low ends and labels."""
    edges = np.unique(np.concatenate([low for low, _ in panels]))
    label = np.max([some[np.searchsorted(low, edges, side="right") - 1] for low, some in panels], axis=0)
    edges, label = _runs(edges, label)
    size = np.diff(edges, append=span[1])
    beside = np.concatenate([[LOST], label, [LOST]])
    slivers = (beside[:-2] == OPEN) & (beside[2:] == OPEN) & (size <= _exact(edges, span[1] - span[0]) / 8)
    return _runs(edges, np.where(slivers, OPEN, label))  # in a gap a few panels may settle


def _runs(edges, label):
    """Neighbours with the same label as one."""
    new = np.append(True, label[1:] != label[:-1])
    return edges[new], label[new]


def _intervals(column, edges, label, loops, span, period, c):
    """Yield the rows of a column from its runs of panels; edges: their low ends."""
    width, runs = span[1] - span[0], list(zip(edges, [*edges[1:], span[1]], label, strict=True))
    doubt, found = NONE, []
    for at, (low, high, what) in enumerate(runs):
        sides = [runs[next_][2] for next_ in (at - 1, at + 1) if 0 <= next_ < len(runs)]
        if what == GOOD:
            found.append((low, high))
        elif what == LOST:
            doubt = max(doubt, SEARCH)
        elif what == OPEN:
            tight = high - low <= (ATTACHED * width if at == 0 else _exact(high, width))
            ends = {*sides} == {GOOD, BAD} or sides in ([GOOD], [BAD])
            doubt = max(doubt, CROWDED if not ends else NONE if tight else ROUNDED)
    gaps = {edge: (low, high) for low, high, what in runs if what == OPEN for edge in (low, high)}
    ends = [[_end(column, edge, gaps, loops, span, period, c) for edge in some] for some in found]
    for index, ((low, low_omega, one), (high, high_omega, other)) in enumerate(ends):
        yield column, index, len(ends), low, high, low_omega, high_omega, doubt, max(one, other)
    if not ends:
        yield column, -1, 0, *4 * (np.nan,), doubt, 0.0


def _end(column, edge, gaps, loops, span, period, c):
    """The end of an interval at the edge of a gap: its value, the frequency there (rad/s), and what is left of the equation."""
    if edge not in gaps:  # where the span ends, or where nothing is known beyond
        return edge, np.nan, 0.0
    low, high = gaps[edge]
    own = [each for each in loops if column in each.columns]

    def worst(p):
        found = [each.worst(column, np.array([p]), c) for each in own]
        return max(((delta[0], beyond[0]) for delta, beyond in found), key=lambda each: each[1])

    first, last = worst(low)[1], worst(high)[1]
    p = (low * last - high * first) / (last - first) if first * last < 0 else (low + high) / 2
    delta, left = worst(p)
    for end, side in zip(span, (low, high), strict=True):
        if side == end:
            return end, abs(np.angle(1 + delta)) / period, 0.0
    return p, abs(np.angle(1 + delta)) / period, abs(left)
