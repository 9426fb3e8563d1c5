"""Discs about the eigenvalues of matrices, and whether these are all in their place: within a
spiral, or on the unit circle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import balance, inverse, sum_rounding
from wavesweep.engine.poles import GONE
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, SAFE

ZERO_EIGENVALUES = 1e-3  # up to which eigenvalues may be 0 but for rounding
# Of the largest coefficient of a characteristic polynomial, by how much it may differ read
# backwards.
CONSERVING = 1e-10
OWN, LOWEST, HIGHEST = range(3)  # lines of a mode: the strongest, and those that it may be
GROWN_ENTRY = 1e4  # entry of a frame, from which on nothing is left of that


@dataclass(frozen=True, slots=True)
class Spiral:
    """The eigenvalues of modes with at least the damping ratio `ratio`, above 0 and below 1.

    A frame of T seconds shows a mode `exp(s t)` as its eigenvalue `z = exp(s T)`, which has the
    frequency up to whole turns: of all `Im s T = angle + 2 pi m` it is that of the strongest line
    in the spectrum of the states, the number `turns` (rad, not negative; the own, the lowest and
    the highest one that may be it, see `FramesAlong.turns`; without any, the angle). Its damping
    ratio is `-Re s/|s|`. So with `c = ratio/sqrt(1 - ratio^2)` and w = turns it has the ratio where

        log |z| + c w <= 0,

    or where z is within `gone` of 0, a number or `(columns, 1)`. In a disc of radius r about z the
    logarithm moves by less than `-log(1 - r/|z|)`, which is less than the distance `|log |z| + c
    w|/sqrt(1 + c^2)` from that line for `r < |z| (1 - exp(-|log |z| + c w|/sqrt(1 + c^2)))`: then
    the whole disc is on one side, whatever branch w is of. Where several lines are about as strong,
    turns has the lowest and the highest one: a mode has the ratio if it has it by the highest, and
    has not if it has not by the lowest. Every w is at least the angle of z, and at most half a turn
    per tick.

    ticks: of a frame. pairs: whether complex pairs alone have to, and real eigenvalues below 0 only
    within the unit circle. One that is alone in a disc about a real number is real, as its
    conjugate is in the disc too.
    """

    ratio: float
    gone: object = GONE
    pairs: bool = False
    ticks: int = 1
    turns: np.ndarray | None = None
    smooth: ClassVar[bool] = True

    def at(self, columns: np.ndarray) -> Spiral:
        """The same for some of the columns, by an index or a mask."""
        gone = self.gone[columns] if np.ndim(self.gone) else self.gone
        turns = None if self.turns is None else self.turns[columns]
        return replace(self, gone=gone, turns=turns)

    def told(self, turns: np.ndarray) -> Spiral:
        """The same with what modes turn, `(n, r, 3)`."""
        return replace(self, turns=turns)

    @property
    def c(self) -> float:
        """The slope of the spiral in the logarithm."""
        return self.ratio / np.sqrt(1 - self.ratio**2)

    @property
    def least(self) -> float:
        """The size up to which eigenvalues may turn by any number: at most half a turn per tick."""
        return np.maximum(self.gone, np.exp(-np.pi * self.c * self.ticks))

    @property
    def small(self) -> float:
        """The size up to which eigenvalues are taken together."""
        return min(ZERO_EIGENVALUES, float(np.min(self.least)) / 4)

    def refuse(self, E: np.ndarray) -> None:
        """Every loop can be damped."""

    def turning(self, delta: np.ndarray) -> np.ndarray:
        """Of which eigenvalues `1 + delta` it matters what they turn: they have the ratio by
        their angles, and not by any turns."""
        with np.errstate(all="ignore"):
            size = np.log(np.abs(1 + delta))
            by_angle = size + self.c * np.abs(np.angle(1 + delta)) <= 0
            return by_angle & (size > np.log(self.least))

    def beyond(self, delta: np.ndarray, line: int = OWN) -> np.ndarray:
        """By how much eigenvalues `1 + delta` are outside, in the logarithm, by their own line,
        the lowest or the highest."""
        if self.turns is None:
            turns = np.abs(np.angle(1 + delta))
        else:
            turns = self.turns[..., line]
        with np.errstate(all="ignore"):
            size = np.log(np.abs(1 + delta))
            of_spiral = size + self.c * np.where(self._free(delta), 0.0, turns)
            of_gone = size - np.log(self.gone)
            return np.where(delta == -1, -np.inf, np.minimum(of_spiral, of_gone))

    def _free(self, delta: np.ndarray) -> np.ndarray:
        """Eigenvalues less 1 that need no damping ratio, since they are real and below 0."""
        return self.pairs & (delta.imag == 0) & (delta.real < -1)

    def room(self, delta: np.ndarray) -> np.ndarray:
        """How large discs may be that are on one side."""
        z = np.abs(1 + delta)
        lowest = self.beyond(delta, LOWEST)
        highest = self.beyond(delta, HIGHEST)
        slope = np.sqrt(1 + self.c**2)
        with np.errstate(invalid="ignore"):
            inside = -z * np.expm1(np.minimum(highest, 0.0) / slope)
            outside = -z * np.expm1(-np.maximum(lowest, 0.0) / slope)
        room = np.where(lowest > 0, outside, np.where(highest < 0, inside, 0.0))
        if self.pairs:
            # Outside, a pair of a negative real part must not become real; real ones may be
            # anywhere in the circle.
            becoming_real = (lowest > 0) & (delta.real < -1)
            room = np.where(becoming_real, np.minimum(room, np.abs(delta.imag)), room)
            # A real one above 0 is no pair, and yet it may turn by whole turns: it is not told what
            # it needs.
            alone = (lowest > 0) & (z < 1) & (delta.imag == 0) & (delta.real > -1)
            room = np.where(alone, 0.0, room)
            room = np.where(self._free(delta), 1 - z, room)
        return np.fmax.reduce([room, self.least - z, z - 1])

    def label(self, delta: np.ndarray, radius: np.ndarray, room: np.ndarray) -> np.ndarray:
        """The labels of panels whose eigenvalues less 1 are in discs, `(n, r)`; room: see there."""
        z = 1 + delta
        clear = radius < room
        outside = self.beyond(delta, LOWEST) > 0
        free = self._free(delta)
        if free.any():
            alone = ~_meeting(z, radius, z, radius)
            clear &= ~free | alone | (np.abs(z) + radius < self.least)
        good = clear.all(-1) & ~outside.any(-1)
        # Discs that meet have their eigenvalues together, and the line of each is of its own disc.
        bad = (outside & ~_with_others(delta, radius, ~clear | ~outside)).any(-1)
        return np.where(good, GOOD, np.where(bad, BAD, OPEN))


@dataclass(frozen=True, slots=True)
class RequiredCircle:
    """The eigenvalues of a loop that conserves, if all are on the unit circle and no two are the
    same: nothing grows.

    Such a loop has with z also 1/conj(z) as an eigenvalue, except for 0 of held values. So one that
    is alone in its disc, and whose image at the circle is in no other disc, is on the circle.
    """

    small: ClassVar[float] = ZERO_EIGENVALUES
    smooth: ClassVar[bool] = False

    def at(self, columns: np.ndarray) -> RequiredCircle:  # noqa: ARG002
        """The same for all columns."""
        return self

    def refuse(self, E: np.ndarray) -> None:
        """Raise UsageError for frames less identity, `(points, r, r)`, of a loop that does not
        conserve but for rounding."""
        for A in E + np.eye(E.shape[-1]):
            polynomial = np.poly(A)
            rounding = CONSERVING * np.abs(polynomial).max()
            polynomial = np.where(np.abs(polynomial) > rounding, polynomial, 0.0)
            polynomial = np.trim_zeros(polynomial, "b")
            backwards = np.sign(polynomial[-1]) * polynomial[::-1]
            conserves = np.abs(polynomial - backwards).max() <= rounding
            if np.abs(A).max() < GROWN_ENTRY and not conserves:
                raise UsageError(
                    "sweep.require.bounded: expected a loop that conserves, whose eigenvalues are z and 1/z in pairs, found "
                    "one that takes or gives energy; leave bounded out, and stable intervals are found"
                )

    def beyond(self, delta: np.ndarray) -> np.ndarray:
        """By how much eigenvalues are outside."""
        return np.abs(1 + delta) - 1

    def room(self, delta: np.ndarray) -> np.ndarray:
        """How large discs may be that meet no other."""
        apart = np.abs(delta[:, :, None] - delta[:, None, :])
        index = np.arange(delta.shape[-1])
        apart[:, index, index] = np.inf
        return np.minimum(apart.min(-1) / 2.5, np.abs(1 + delta) / 2)

    def label(self, delta: np.ndarray, radius: np.ndarray, _: np.ndarray) -> np.ndarray:
        """The labels of panels whose eigenvalues less 1 are in discs, `(n, r)`: GOOD if all are on or inside
        the circle.

        With z also 1/conj(z) is an eigenvalue. A disc that meets no other one, and no image of another
        one under z -> 1/conj(z), has a single eigenvalue, which is its own image: on the circle.
        """
        z = 1 + delta
        size = np.abs(z)
        alone = ~_meeting(z, radius, z, radius)
        with np.errstate(all="ignore"):
            # The image of a disc is in one of this radius about z/|z|^2.
            image = np.where(radius < size, radius / (size * (size - radius)), np.inf)
            alone &= ~_meeting(z / size**2, image, z, radius)
        good = (alone | (size + radius < 1)).all(-1)  # what is inside is 0, if nothing is outside
        reaching_circle = _with_others(delta, radius, radius >= np.abs(size - 1))
        bad = ((size > 1) & ~reaching_circle).any(-1)
        return np.where(bad, BAD, np.where(good, GOOD, OPEN))


class LinesOfModes(Protocol):
    """What the modes of eigenvalues less 1 turn in a frame (rad), `(n, r, 3)`, see `Spiral`."""

    def __call__(
        self, delta: np.ndarray, wanted: np.ndarray, of_discs: np.ndarray | None = None, /
    ) -> np.ndarray:
        """Of the eigenvalues delta in the middles of panels, `(n, r)`, those that are asked about, a
        mask; of_discs: the radii of discs in which they are on the panels; None: in the middles."""


def _beside(
    E: np.ndarray, dE: np.ndarray, rims: np.ndarray, delta: np.ndarray, V: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on what stands beside the eigenvalues delta `(n, r)` in the frames of panels, `(n, r, r)`, and
    on `|W V - 1|`, `(n,)`; E, dE, rims: see `verdicts`.

    With eigenvectors V of E and W nearly their inverse, the frame E(p) of any p of a panel has the
    eigenvalues of `W E(p) V (W V)^-1`. Of `W (E(p) - E) V`, which is 0 in the middle and analytic on
    the circle, an entry is at most half of its largest on the circle (Schwarz's lemma); the rest is
    rounding.
    """
    n = E.shape[-1]
    rounding = sum_rounding(2 * n, of_complex=True)  # of products of three
    W = inverse(V)
    sizes_W = np.abs(W)
    sizes_V = np.abs(V)
    off = np.abs(W @ V - np.eye(n)) + rounding * (sizes_W @ sizes_V)
    loss = off.sum(-1).max(-1)
    change = np.zeros(E.shape)
    for rim in (rims, rims.conj()):
        moved = W[:, None] @ (rim - E[:, None]) @ V[:, None]
        change = np.maximum(change, np.abs(moved).max(1))
    residual = np.abs(W @ (E @ V - V * delta[:, None, :]))
    error = dE + rounding * np.abs(E)
    defect = residual + sizes_W @ error @ sizes_V
    entries = SAFE / 2 * change + defect + off * np.abs(delta[:, None, :])
    return entries / (1 - loss)[:, None, None], loss


def verdicts(
    E: np.ndarray,
    dE: np.ndarray,
    rims: np.ndarray,
    place: Spiral | RequiredCircle,
    lines: LinesOfModes | None = None,
) -> np.ndarray:
    """The labels of panels; E, dE: in the middle, `(n, r, r)`; rims: the frames on circles of twice
    the size about them, `(n, points, r, r)`. lines: where a spiral asks for them.

    The row sums of what `_beside` gives bound discs about the eigenvalues delta of E (Gershgorin),
    also in units in which they are smaller.
    """
    delta, V = eigenvectors(E, place.small)
    with np.errstate(all="ignore"):
        entries, loss = _beside(E, dE, rims, delta, V)
        # What an inverse of eigenvectors may be off by.
        finite_panels = np.isfinite(entries).all((-1, -2)) & (loss < 0.1)
        entries, _ = balance(np.where(finite_panels[:, None, None], entries, 1.0))
        wanted = None
        if lines:
            wanted = place.turning(delta) & finite_panels[:, None]
            place = place.told(lines(delta, wanted))
        radius, in_units = _radii(delta, entries, place)
        if lines:
            largest = np.where(radius < place.room(delta), np.maximum(radius, in_units), in_units)
            place = place.told(lines(delta, wanted, largest))
        room = place.room(delta)
        label = place.label(delta, radius, room)
        label_in_units = place.label(delta, in_units, room)
    return np.where(finite_panels, np.where(label == OPEN, label_in_units, label), OPEN)


def eigenvectors(E: np.ndarray, small: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues less 1 and eigenvectors; for several eigenvalues of I + E up to `small`, which
    may have too few of these, the vectors of a Schur form.
    """
    from scipy.linalg import schur

    delta, V = np.linalg.eig(E)
    delta = delta.astype(complex)
    V = V.astype(complex)
    near = np.abs(1 + delta) <= small
    for panel in np.flatnonzero(near.sum(-1) > 1):
        A = E[panel] + np.eye(E.shape[-1])
        T, Q, count = schur(A, output="complex", sort=lambda z: abs(z) <= small)
        if count == near[panel].sum():
            far = ~near[panel]
            delta[panel] = np.append(np.diagonal(T)[:count] - 1, delta[panel][far])
            V[panel] = np.concatenate([Q[:, :count], V[panel][:, far]], axis=1)
    return delta, V


def _radii(
    delta: np.ndarray, entries: np.ndarray, place: Spiral | RequiredCircle
) -> tuple[np.ndarray, np.ndarray]:
    """The radii of discs about the eigenvalues of panels whose matrices differ from these by such
    entries, `(n, r, r)`, in two units.

    In the second ones the discs that are too large are small beside the others, they are as small
    as the eigenvalues' first derivatives let them be, however far from normal the frames are; the
    others may grow by half of their room.
    """
    room = place.room(delta)
    radius = entries.sum(-1)
    large = radius >= room
    into_large = np.where(large[:, None, :], entries, 0.0).sum(-1)
    among_others = np.where(large[:, None, :], 0.0, entries).sum(-1)
    room_left = room / 2 - among_others
    ratio = np.where(room / 2 > among_others, into_large / room_left, 1.0)
    ratio = np.where(large, 0.0, ratio).max(-1)
    units = np.where(large, 1.0, np.clip(ratio, 1e-12, 1.0)[:, None])
    in_units = (entries * units[:, None, :]).sum(-1) / units
    return radius, in_units


def _meeting(
    first: np.ndarray, small: np.ndarray, second: np.ndarray, large: np.ndarray
) -> np.ndarray:
    """Whether discs `(n, r)` meet another disc than that of their own number."""
    apart = np.abs(first[:, :, None] - second[:, None, :])
    meet = apart <= small[:, :, None] + large[:, None, :]
    index = np.arange(first.shape[-1])
    meet[:, index, index] = False
    return meet.any(-1)


def _with_others(delta: np.ndarray, radius: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Some discs, a mask `(n, r)`, and all that are connected with them."""
    apart = np.abs(delta[:, :, None] - delta[:, None, :])
    meet = apart <= radius[:, :, None] + radius[:, None, :]
    for _ in range(delta.shape[-1] - 1):
        some = some | (meet & some[:, None, :]).any(-1)
    return some
