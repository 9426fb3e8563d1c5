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

from wavesweep.engine.doubles import EPS
from wavesweep.engine.frames import Bounded, sum_rounding

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


def edges_of(frames: Any, ahead: int, spread: int) -> list[Edge] | None:
    """Return the frames between nodes that know the next `ahead` frames; None if no bound on all
    rests is found. frames: see `WallFrames`. spread: directions in which rests differ that are
    vertices; the others are errors."""
    n = frames.changes.shape[-1] - 1
    words = _words(frames.follows, ahead)
    number = {word: at for at, word in enumerate(words)}
    if not frames.drifts:
        nothing = np.zeros((1, n)), np.zeros(n)
        return [
            Edge(number[word[:-1]], word[0], number[word[1:]], (0.0, 0.0), *nothing)
            for word in _words(frames.follows, ahead + 1)
        ]
    whole = Bounded(frames.changes, frames.changes_error)
    backward = whole.part(..., slice(n), slice(n)).mT + Bounded.exact(np.eye(n))
    step = whole.part(..., [n], slice(n)).mT
    pushed = whole.part(..., slice(n + 1), n)
    every = _every_rest(backward, step, frames.follows)
    if every is None:
        return None
    edges = []
    for word in _words(frames.follows, ahead + 1):
        later = every
        for frame in reversed(word[1:]):
            later = later.before(backward.part(frame), step.part(frame))
        own = later.before(backward.part(word[0]), step.part(word[0]))
        turned = later.turned(pushed.part(word[0]))
        edges.append(Edge(number[word[:-1]], word[0], number[word[1:]], turned, *own.hull(spread)))
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

    def before(self, A: Bounded, step: Bounded) -> _Rests:
        """Return the rests before a frame, `step + A omega`, A and step `(n, 1)` of the frame."""
        middle = (step + A @ self.middle[:, None]).part(..., 0)
        G = A @ self.G
        errors = middle.error + G.error.sum(1) + A.size @ self.errors
        return _Rests(middle.value, G.value, errors * (1 + (2 * self.errors.size + 8) * EPS))

    def turned(self, pushed: Bounded) -> tuple[float, float]:
        """Return the least and the largest of `r + omega' b`; pushed `(n + 1,)`: b and r."""
        n = self.errors.size
        omega = np.append(self.middle, 1.0)
        value = pushed @ omega
        turns = pushed.part(slice(n)) @ self.G
        off = value.error + turns.size.sum() + pushed.size[:n] @ self.errors
        off = off * (1 + (2 * n + 8) * EPS) + EPS * np.abs(value.value)
        return float(value.value - off), float(value.value + off)

    def hull(self, spread: int) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices, and bounds on the errors that they leave: so many of the largest columns
        of G span the vertices."""
        sizes = np.abs(self.G).max(0)
        order = np.argsort(-sizes)
        spanning = [at for at in order[:spread] if sizes[at] > SPREAD_SHARE * sizes.max()]
        spanning = [at for at in spanning if sizes[at] > SPREAD_SHARE * np.abs(self.middle).max()]
        vertices = self.middle[None]
        for at in spanning:
            vertices = np.concatenate([vertices - self.G[:, at], vertices + self.G[:, at]])
        others = np.delete(self.G, spanning, axis=1)
        reach = np.abs(self.middle) + np.abs(self.G).sum(1)
        rounding = sum_rounding(self.G.shape[1] + 4)  # of vertices, and of this bound
        return vertices, self.errors + np.abs(others).sum(1) + rounding * reach


def _every_rest(own: Bounded, own_step: Bounded, follows: np.ndarray) -> _Rests | None:
    """The rests of all sequences of frames, in coordinates in which a set that holds them is found;
    None if none is.

    own, own_step: of each frame, as in `_Rests.before`. follows: which may follow which. Where a
    single frame turns what it shrinks, no box holds what it makes of it; several in a row may.
    """
    # a basis of the real and imaginary parts of eigenvectors
    matrix = own.value.mean(0)
    values, vectors = np.linalg.eig(matrix)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
        elif value.imag > 0:
            columns += [vector.real, vector.imag]
    bases = np.array(columns).T, np.eye(own.value.shape[-1])
    A = own
    step = own_step
    last = np.arange(len(follows))
    while True:
        for T in bases:
            found = _rests_in(A, step, T)
            if found:
                return found
        first, following = np.nonzero(follows[last])
        # Frames in a row that a set of all rests is tried with: 6 of four kinds.
        if first.size > 5000:
            return None
        before = A.part(first)
        step = before @ own_step.part(following) + step.part(first)
        A = before @ own.part(following)
        last = following


@np.errstate(all="ignore")  # a box that grows for ever holds nothing
def _rests_in(A: Bounded, step: Bounded, T: np.ndarray) -> _Rests | None:
    """A set that `omega -> step + A omega` does not leave for any of several A, `(words, n, n)`, and
    step, `(words, n, 1)`; None if none is found.

    In the coordinates `s = T^-1 omega` it is a box from low to high. With the parts of `M = T^-1 A T`
    above and below 0, the least of an entry is `T^-1 step + M+ low + M- high`.
    """
    back = Bounded.exact(T).inverse()
    M = back @ A @ T
    moved = (back @ step).part(..., 0)
    if not np.isfinite(M.error).all():
        return None
    n = len(T)
    above = np.maximum(M.value, 0.0)
    below = np.minimum(M.value, 0.0)
    try:
        low = np.linalg.solve(np.eye(n) - M.value.mean(0), moved.value.mean(0))
    except np.linalg.LinAlgError:
        return None
    high = low.copy()
    for _ in range(200):  # rounds of the enclosure of all rests
        reach = np.maximum(np.abs(low), np.abs(high))
        off = moved.with_rounding(2 * n + 4) + M.with_rounding(2 * n + 4) @ reach
        off = off * (1 + (n + 8) * EPS)
        least = (moved.value + above @ low + below @ high - off).min(0)
        most = (moved.value + above @ high + below @ low + off).max(0)
        if (low <= least).all() and (most <= high).all():
            middle = Bounded.exact((low + high) / 2)
            half = (high - low) / 2 + 2 * EPS * reach
            omega = T @ middle.value
            error = sum_rounding(n) * (np.abs(T) @ reach) * (1 + (n + 4) * EPS)
            return _Rests(omega, T * half, error + EPS * (np.abs(T) @ half))
        # Room on each side of an enclosure that is tried.
        room = 1e-3 * (most - least) + 1e-13 * (np.abs(most) + np.abs(least)).max()
        low = np.minimum(low, least - room)
        high = np.maximum(high, most + room)
    return None
