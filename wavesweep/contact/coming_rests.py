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
    kinds = range(len(frames.follows))
    # Rests are told apart by so many words of frames to come.
    while every.first.size * len(kinds) <= 2200:
        every = _Rests.joined([every.before(frames, i, backward, step) for i in kinds])
    edges = []
    for word in _words(frames.follows, ahead + 1):
        later = every
        for frame in reversed(word[1:]):
            later = later.before(frames, frame, backward, step)
        later = later.after(frames, word[0])
        own = later.before(frames, word[0], backward, step)
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
    """All rests, by the words of frames that come: `middle + G s` with s from -1 to 1 in each entry, up
    to errors of the entries.

    first `(words,)`: the frame that comes first, -1 of any; middle, errors `(words, n)`; G `(words, n,
    n)`.
    """

    first: np.ndarray
    middle: np.ndarray
    G: np.ndarray
    errors: np.ndarray

    @staticmethod
    def joined(parts: list[_Rests]) -> _Rests:
        """Those of all parts."""
        fields = [[rests.first, rests.middle, rests.G, rests.errors] for rests in parts]
        return _Rests(*map(np.concatenate, zip(*fields, strict=True)))

    def after(self, frames: Any, frame: int) -> _Rests:
        """Those before which a frame may come."""
        may = (self.first < 0) | frames.follows[frame, self.first]
        return _Rests(self.first[may], self.middle[may], self.G[may], self.errors[may])

    def before(self, frames: Any, frame: int, backward: Bounded, steps: Bounded) -> _Rests:
        """Return the rests before a frame, `step + A omega`."""
        later = self.after(frames, frame)
        A = backward.part(frame)
        middle = (steps.part(frame) + A @ later.middle[..., None]).part(..., 0)
        G = A @ later.G
        errors = middle.error + G.error.sum(-1) + later.errors @ A.size.T
        errors = errors * (1 + (2 * errors.shape[-1] + 8) * EPS)
        return _Rests(np.full(len(errors), frame), middle.value, G.value, errors)

    def turned(self, pushed: Bounded) -> tuple[float, float]:
        """Return the least and the largest of `r + omega' b`; pushed `(n + 1,)`: b and r."""
        n = self.errors.shape[-1]
        omega = np.pad(self.middle, ((0, 0), (0, 1)), constant_values=1.0)
        column = pushed.part(slice(None), None)
        value = (Bounded.exact(omega) @ column).part(..., 0)
        turns = (Bounded.exact(self.G.mT) @ column.part(slice(n))).part(..., 0)
        off = value.error + turns.size.sum(-1) + self.errors @ pushed.size[:n]
        off = off * (1 + (2 * n + 8) * EPS) + EPS * np.abs(value.value)
        return float((value.value - off).min()), float((value.value + off).max())

    def hull(self, spread: int) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices of a box that has them all, along the principal axes of their middles, and
        bounds on the errors that the vertices leave: so many of its longest sides span them."""
        centre = self.middle.mean(0)
        n = centre.size
        apart = self.middle - centre
        spans = np.concatenate([apart, self.G.mT.reshape(-1, n)])
        _, _, axes = np.linalg.svd(spans, full_matrices=False)
        back = Bounded.exact(axes.T).inverse()
        place = (back @ apart[..., None]).part(..., 0)
        off = (back @ self.G).size.sum(-1) + (self.errors + 2 * EPS * self.size) @ back.size.T
        off = (off + place.error + EPS * np.abs(place.value)) * (1 + (4 * n + 8) * EPS)
        low = (place.value - off).min(0)
        high = (place.value + off).max(0)
        middle = centre + axes.T @ ((low + high) / 2)
        G = axes.T * ((high - low) / 2)
        sizes = np.abs(G).max(0)
        order = np.argsort(-sizes)
        spanning = [at for at in order[:spread] if sizes[at] > SPREAD_SHARE * sizes.max()]
        spanning = [at for at in spanning if sizes[at] > SPREAD_SHARE * np.abs(middle).max()]
        vertices = middle[None]
        for at in spanning:
            vertices = np.concatenate([vertices - G[:, at], vertices + G[:, at]])
        others = np.delete(G, spanning, axis=1)
        reach = np.abs(centre) + np.abs(axes.T) @ (np.abs(low) + np.abs(high))
        rounding = sum_rounding(2 * n + 8)  # of vertices, and of this bound
        return vertices, np.abs(others).sum(1) + rounding * reach

    @property
    def size(self) -> np.ndarray:
        """Bounds on the entries of each word's."""
        return np.abs(self.middle) + np.abs(self.G).sum(-1) + self.errors


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
            errors = error + EPS * (np.abs(T) @ half)
            return _Rests(np.array([-1]), omega[None], (T * half)[None], errors[None])
        # Room on each side of an enclosure that is tried.
        room = 1e-3 * (most - least) + 1e-13 * (np.abs(most) + np.abs(least)).max()
        low = np.minimum(low, least - room)
        high = np.maximum(high, most + room)
    return None
