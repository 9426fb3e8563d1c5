"""Where a device that floats freely would come to rest, whatever frames come.

Without its wall a loop moves by `eta+ = A eta`, `p+ = p + l' eta`, with A and l of the frame that
comes. So it comes to rest at `p + omega' eta` with `omega = l + A' omega+`, where omega+ is that of
the frames after it. It depends on all frames to come, and on the later ones less and less: here a
node stands for the next few of them, and omega is enclosed for all that may follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from wavesweep.contact.wall_loop import BOUNDS_OF_DOUBLES
from wavesweep.engine.doubles import EPS

SPREAD = 2  # directions in which rests differ that are vertices; the others are errors
SPREAD_SHARE = 1e-4  # of the rest's size, below which a direction is an error


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A frame between two nodes.

    turned: what a force of 1 in this frame moves the rest by, from the least to the largest.
    vertices `(vertices, n)`: of a hull of omega, up to errors `(n,)`.
    """

    source: int
    frame: int
    target: int
    turned: tuple[float, float]
    vertices: np.ndarray
    errors: np.ndarray


def edges_of(frames: Any, ahead: int) -> list[Edge] | None:
    """Return the frames between nodes that know the next `ahead` frames; None if no bound on all
    rests is found. frames: see `WallFrames`."""
    n = frames.changes.shape[-1] - 1
    words = _words(frames.follows, ahead)
    number = {word: at for at, word in enumerate(words)}
    if not frames.drifts:
        nothing = np.zeros((1, n)), np.zeros(n)
        return [
            Edge(number[word[:-1]], word[0], number[word[1:]], (0.0, 0.0), *nothing)
            for word in _words(frames.follows, ahead + 1)
        ]
    every = _every_rest(frames)
    if every is None:
        return None
    edges = []
    for word in _words(frames.follows, ahead + 1):
        later = every
        for frame in reversed(word[1:]):
            later = later.before(frames, frame)
        own = later.before(frames, word[0])
        turned = later.turned(frames, word[0])
        edges.append(Edge(number[word[:-1]], word[0], number[word[1:]], turned, *own.hull()))
    return edges


def _words(follows, length):
    """All sequences of so many frames that are allowed."""
    words = [()]
    for _ in range(length):
        words = [
            (*word, i)
            for word, i in product(words, range(len(follows)))
            if not word or follows[word[-1], i]
        ]
    return words


@dataclass(frozen=True, slots=True, eq=False)
class _Rests:
    """All rests `middle + G s` with s from -1 to 1 in each entry, up to errors of the entries."""

    middle: np.ndarray
    G: np.ndarray
    errors: np.ndarray

    def before(self, frames: Any, i: int) -> _Rests:
        """Return the rests before a frame, `l + A' omega`."""
        n = self.middle.size
        change = frames.changes[i, :n, :n].T
        step = frames.changes[i, n, :n]
        size = np.abs(np.eye(n) + change)
        reach = np.abs(self.middle) + np.abs(self.G).sum(1) + self.errors
        middle = step + self.middle + change @ self.middle
        G = self.G + change @ self.G
        errors = frames.changes_error[i, n, :n] + size @ self.errors
        errors = errors + frames.changes_error[i, :n, :n].T @ reach
        rounding = BOUNDS_OF_DOUBLES * EPS * (2 * n + 8)
        size_of_sums = reach + np.abs(change) @ reach + np.abs(step)
        return _Rests(middle, G, errors + rounding * size_of_sums)

    def turned(self, frames: Any, i: int) -> tuple[float, float]:
        """Return the least and the largest of `r + omega' b`."""
        n = self.middle.size
        b = frames.changes[i, :n, n]
        r = frames.changes[i, n, n]
        reach = np.abs(self.middle) + np.abs(self.G).sum(1) + self.errors
        value = r + self.middle @ b
        rounding = BOUNDS_OF_DOUBLES * EPS * (2 * n + 8)
        off = np.abs(b @ self.G).sum() + np.abs(b) @ self.errors
        off = off + frames.changes_error[i, n, n] + frames.changes_error[i, :n, n] @ reach
        off = off + rounding * (abs(r) + np.abs(b) @ reach)
        return float(value - off), float(value + off)

    def hull(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices, and bounds on the errors that they leave: the largest columns of G span
        the vertices."""
        sizes = np.abs(self.G).max(0)
        order = np.argsort(-sizes)
        spanning = [at for at in order[:SPREAD] if sizes[at] > SPREAD_SHARE * sizes.max()]
        spanning = [at for at in spanning if sizes[at] > SPREAD_SHARE * np.abs(self.middle).max()]
        vertices = self.middle[None]
        for at in spanning:
            vertices = np.concatenate([vertices - self.G[:, at], vertices + self.G[:, at]])
        others = np.delete(self.G, spanning, axis=1)
        reach = np.abs(self.middle) + np.abs(self.G).sum(1)
        rounding = EPS * (len(spanning) + 2)
        return vertices, self.errors + np.abs(others).sum(1) + rounding * reach


def _every_rest(frames: Any) -> _Rests | None:
    """The rests of all sequences of frames, in coordinates in which a set that holds them is found;
    None if none is."""
    n = frames.changes.shape[-1] - 1
    mean = np.eye(n) + frames.changes[:, :n, :n].mean(0)
    for T in (_modes(mean.T), np.eye(n)):
        found = _rests_in(frames, T)
        if found:
            return found
    return None


def _rests_in(frames, T) -> _Rests | None:
    """A set that `omega -> l + A' omega` does not leave for any frame; None if none is
    found.

    In the coordinates `s = T^-1 omega` it is a box from low to high. With the parts of `M =
    T^-1 A' T` above and below 0, the least of an entry is `T^-1 l + M+ low + M- high`.
    """
    n = frames.changes.shape[-1] - 1
    A = np.eye(n) + frames.changes[:, :n, :n]
    step = frames.changes[:, n, :n]
    try:
        back = np.linalg.inv(T)
    except np.linalg.LinAlgError:
        return None
    rounding = BOUNDS_OF_DOUBLES * EPS * (2 * n + 8)
    size_of_back = np.abs(back)
    lost = np.abs(np.eye(n) - back @ T) + rounding * (size_of_back @ np.abs(T))
    share = lost.sum(-1).max()
    if not share < 0.1:  # what a matrix times its inverse may be off by from 1
        return None
    # The inverse of `back` is T (1 - D)^-1 with |D| <= lost.
    off_of_inverse = np.full((n, n), share / (1 - share))
    M = back @ A.mT @ T
    A_error = frames.changes_error[:, :n, :n].mT + rounding * np.abs(A.mT)
    M_error = size_of_back @ A_error @ np.abs(T) + rounding * (
        size_of_back @ np.abs(A.mT) @ np.abs(T)
    )
    M_error = M_error + (np.abs(M) + M_error) @ off_of_inverse
    moved = step @ back.T
    moved_error = frames.changes_error[:, n, :n] @ size_of_back.T
    moved_error = moved_error + rounding * (np.abs(step) @ size_of_back.T)
    above = np.maximum(M, 0.0)
    below = np.minimum(M, 0.0)
    try:
        low = np.linalg.solve(np.eye(n) - M.mean(0), moved.mean(0))
    except np.linalg.LinAlgError:
        return None
    high = low.copy()
    for _ in range(200):  # rounds of the enclosure of all rests
        off = moved_error + M_error @ np.maximum(np.abs(low), np.abs(high))
        off = off + rounding * (np.abs(moved) + np.abs(M) @ np.maximum(np.abs(low), np.abs(high)))
        least = (moved + above @ low + below @ high - off).min(0)
        most = (moved + above @ high + below @ low + off).max(0)
        if (low <= least).all() and (most <= high).all():
            middle = (low + high) / 2
            half = (high - low) / 2
            reach = np.abs(T) @ (np.abs(middle) + half)
            errors = np.abs(T) @ off_of_inverse @ (np.abs(middle) + half)
            return _Rests(T @ middle, T * half, errors + rounding * reach)
        # Room on each side of an enclosure that is tried.
        room = 1e-3 * (most - least) + 1e-13 * (np.abs(most) + np.abs(least)).max()
        low = np.minimum(low, least - room)
        high = np.maximum(high, most + room)
    return None


def _modes(matrix):
    """A basis of the real and imaginary parts of eigenvectors."""
    values, vectors = np.linalg.eig(matrix)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
        elif value.imag > 0:
            columns += [vector.real, vector.imag]
    return np.array(columns).T
