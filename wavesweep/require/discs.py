"""Discs about the eigenvalues of matrices, and whether these are all in their place: within a spiral, or on the unit circle."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import ROUNDING, balance, inverse
from wavesweep.engine.poles import GONE
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, SAFE

SMALL = 1e-3  # up to which eigenvalues may be 0 but for rounding
FINE = 0.1  # what an inverse of eigenvectors may be off by
CONSERVING = 1e-10  # of the largest coefficient of a characteristic polynomial, by how much it may differ read backwards
GROWN = 1e4  # entry of a frame, from which on nothing is left of that


@dataclass(frozen=True, slots=True)
class Spiral:
    """The eigenvalues of modes with at least the damping ratio `ratio`, above 0 and below 1.

    A mode of the frame's eigenvalue z has s = log(z)/T, the principal logarithm, T being the time of the frame, and the damping
    ratio `-Re s/|s|`. So z has to be within `r = exp(-c |angle|)`, `c = ratio/sqrt(1 - ratio^2)`, or within `gone` of 0, a
    number or `(columns, 1)`. pairs: whether complex pairs alone have to, and real eigenvalues only within the unit circle. One
    that is alone in a disc about a real number is real, as its conjugate is in the disc too.
    """

    ratio: float
    gone: object = GONE
    pairs: bool = False
    smooth: ClassVar[bool] = True

    def at(self, columns) -> "Spiral":
        """The same for some of the columns, by an index or a mask."""
        return replace(self, gone=self.gone[columns]) if np.ndim(self.gone) else self

    @property
    def c(self) -> float:
        """The slope of the spiral in the logarithm."""
        return self.ratio / np.sqrt(1 - self.ratio**2)

    @property
    def least(self) -> float:
        """The size up to which eigenvalues may have any angle."""
        return np.maximum(self.gone, np.exp(-np.pi * self.c))

    @property
    def small(self) -> float:
        """The size up to which eigenvalues are taken together."""
        return min(SMALL, float(np.min(self.least)) / 4)

    def refuse(self, E) -> None:
        """Every loop can be damped."""

    def beyond(self, delta):
        """By how much eigenvalues `1 + delta` are outside, in the logarithm."""
        with np.errstate(all="ignore"):
            s = np.log1p(delta)
            of_spiral = s.real + self.c * np.where(self._free(delta), 0.0, np.abs(s.imag))
            return np.where(delta == -1, -np.inf, np.minimum(of_spiral, s.real - np.log(self.gone)))

    def _free(self, delta):
        """Eigenvalues less 1 that need no damping ratio, since they are real and below 0."""
        return self.pairs & (delta.imag == 0) & (delta.real < -1)

    def room(self, delta):
        """How large discs may be that are on one side."""
        z, s, c = np.abs(1 + delta), np.log1p(delta), self.c
        x, y = s.real, np.abs(s.imag)
        apart = np.minimum(_distance(x, y, c), _distance(x, 2 * np.pi - y, c))  # from both sides of the spiral's end
        of_spiral = -z * np.expm1(-apart)
        outside = x + c * y > 0
        of_spiral = np.where(outside, np.minimum(of_spiral, z - self.gone), of_spiral)
        if self.pairs:  # outside, a pair of a negative real part must not become real; real ones may be anywhere in the circle
            becoming_real = outside & (delta.real < -1)
            of_spiral = np.where(becoming_real, np.minimum(of_spiral, np.abs(delta.imag)), of_spiral)
            of_spiral = np.where(self._free(delta), 1 - z, of_spiral)
        return np.fmax.reduce([of_spiral, self.least - z, z - 1])

    def label(self, delta, radius, room):
        """The labels of panels whose eigenvalues less 1 are in discs, `(n, r)`; room: see there."""
        clear, outside = radius < room, self.beyond(delta) > 0
        free = self._free(delta)
        if free.any():
            alone = ~_meeting(1 + delta, radius, 1 + delta, radius)
            clear &= ~free | alone | (np.abs(1 + delta) + radius < self.least)
        bad = (outside & ~_with_others(delta, radius, ~clear)).any(-1)
        return np.where(clear.all(-1) & ~outside.any(-1), GOOD, np.where(bad, BAD, OPEN))


@dataclass(frozen=True, slots=True)
class RequiredCircle:
    """The eigenvalues of a loop that conserves, if all are on the unit circle and no two are the same: nothing grows.

    Such a loop has with z also 1/conj(z) as an eigenvalue, except for 0 of held values. So one that is alone in its disc, and
    whose image at the circle is in no other disc, is on the circle.
    """

    small: ClassVar[float] = SMALL
    smooth: ClassVar[bool] = False

    def at(self, columns) -> "RequiredCircle":  # noqa: ARG002
        """The same for all columns."""
        return self

    def refuse(self, E) -> None:
        """Raise UsageError for frames less identity, `(points, r, r)`, of a loop that does not conserve but for rounding."""
        for A in E + np.eye(E.shape[-1]):
            polynomial = np.poly(A)
            polynomial = np.trim_zeros(
                np.where(np.abs(polynomial) > CONSERVING * np.abs(polynomial).max(), polynomial, 0.0), "b"
            )
            off = np.abs(polynomial - np.sign(polynomial[-1]) * polynomial[::-1]).max()
            if np.abs(A).max() < GROWN and off > CONSERVING * np.abs(polynomial).max():
                raise UsageError(
                    "sweep.require.bounded: expected a loop that conserves, whose eigenvalues are z and 1/z in pairs, found "
                    "one that takes or gives energy; leave bounded out, and stable intervals are found"
                )

    def beyond(self, delta):
        """By how much eigenvalues are outside."""
        return np.abs(1 + delta) - 1

    def room(self, delta):
        """How large discs may be that meet no other."""
        apart = np.abs(delta[:, :, None] - delta[:, None, :])
        apart[:, *2 * (np.arange(delta.shape[-1]),)] = np.inf
        return np.minimum(apart.min(-1) / 2.5, np.abs(1 + delta) / 2)

    def label(self, delta, radius, _):
        """The labels of panels whose eigenvalues less 1 are in discs, `(n, r)`."""
        z = 1 + delta
        size = np.abs(z)
        alone = ~_meeting(z, radius, z, radius)
        with np.errstate(all="ignore"):
            image = np.where(radius < size, radius / (size * (size - radius)), np.inf)
            alone &= ~_meeting(z / size**2, image, z, radius)
        good = (alone | (size + radius < 1)).all(-1)  # what is inside is 0, if nothing is outside
        bad = ((size > 1) & ~_with_others(delta, radius, radius >= np.abs(size - 1))).any(-1)
        return np.where(bad, BAD, np.where(good, GOOD, OPEN))


def verdicts(E, dE, rims, place):
    """The labels of panels; E, dE: in the middle, `(n, r, r)`; rims: the frames on circles of twice the size about them.

    place: `Spiral` or `RequiredCircle`.
    """
    n = E.shape[-1]
    delta, V = _vectors(E, place.small)
    with np.errstate(all="ignore"):
        W, sizes = inverse(V), np.abs(V)
        wide, off = np.abs(W), np.abs(W @ V - np.eye(n)) + n * ROUNDING * (np.abs(W) @ sizes)
        change = np.maximum(*(np.abs(W[:, None] @ (rim - E[:, None]) @ V[:, None]).max(1) for rim in (rims, rims.conj())))
        defect = np.abs(W @ (E @ V - V * delta[:, None, :])) + wide @ (dE + n * ROUNDING * np.abs(E)) @ sizes
        loss = off.sum(-1).max(-1)
        entries = (SAFE / 2 * change + defect + off * np.abs(delta[:, None, :])) / (1 - loss)[:, None, None]
        label, finite = np.full(len(E), OPEN), np.isfinite(entries).all((-1, -2)) & (loss < FINE)
        label[finite] = _of_entries(delta[finite], balance(entries[finite])[0], place.at(finite))
    return label


def _vectors(E, small):
    """Eigenvalues less 1 and eigenvectors; for several eigenvalues of I + E up to `small`, which may have too few of these, the
    vectors of a Schur form.
    """
    from scipy.linalg import schur

    delta, V = (array.astype(complex) for array in np.linalg.eig(E))
    near = np.abs(1 + delta) <= small
    for at in np.flatnonzero(near.sum(-1) > 1):
        T, Q, count = schur(E[at] + np.eye(E.shape[-1]), output="complex", sort=lambda z: abs(z) <= small)
        if count == near[at].sum():
            delta[at] = np.append(np.diagonal(T)[:count] - 1, delta[at][~near[at]])
            V[at] = np.concatenate([Q[:, :count], V[at][:, ~near[at]]], axis=1)
    return delta, V


def _of_entries(delta, entries, place):
    """The labels of panels whose matrices differ from their eigenvalues by these entries, `(n, r, r)`.

    In units in which the discs that are too large are small beside the others, they are as small as the eigenvalues' first
    derivatives let them be, however far from normal the frames are; the others may grow by half of their room.
    """
    room, radius = place.room(delta), entries.sum(-1)
    large = (radius >= room)[:, None, :]
    into, among = (np.where(large_or_not, entries, 0.0).sum(-1) for large_or_not in (large, ~large))
    ratio = np.where(large[:, 0], 0.0, np.where(room / 2 > among, into / (room / 2 - among), 1.0)).max(-1)
    units = np.where(large[:, 0], 1.0, np.clip(ratio, 1e-12, 1.0)[:, None])
    label_radius, label_weighted = (
        place.label(delta, size, room) for size in (radius, (entries * units[:, None, :]).sum(-1) / units)
    )
    return np.where(label_radius == OPEN, label_weighted, label_radius)


def _meeting(one, small, other, large):
    """Whether discs `(n, r)` meet another disc than that of their own number."""
    meet = np.abs(one[:, :, None] - other[:, None, :]) <= small[:, :, None] + large[:, None, :]
    meet[:, *2 * (np.arange(one.shape[-1]),)] = False
    return meet.any(-1)


def _with_others(delta, radius, some):
    """Some discs, a mask `(n, r)`, and all that are connected with them."""
    meet = np.abs(delta[:, :, None] - delta[:, None, :]) <= radius[:, :, None] + radius[:, None, :]
    for _ in range(delta.shape[-1] - 1):
        some = some | (meet & some[:, None, :]).any(-1)
    return some


def _distance(x, y, c):
    """The distance of points from the segment that the spiral's half with angles up to pi is in the logarithm."""
    at = np.clip((y - c * x) / (1 + c**2), 0, np.pi)
    return np.hypot(x + c * at, y - at)
