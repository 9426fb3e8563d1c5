"""Loops with long delays, in which most states only take over the value that another state had a frame ago."""

from dataclasses import dataclass

import numpy as np

from wavesweep.monodromy.circle import on_circle, solve


@dataclass(frozen=True, slots=True)
class Shifts:
    """States with `z x_i = x_j` and nothing else, in all loops of a batch.

    kept: all other states. delayed: the states with this property, each after the one whose value it takes over, which is its
    entry in `before`. source: place in `kept` of the state at which its chain begins. frames: number of frames ago at which the
    source had the value that this state has now. On the unit circle `x_i = z^-frames x_source`, so only the states that are
    kept have to be solved for, and nothing cancels.
    """

    kept: np.ndarray
    delayed: np.ndarray
    before: np.ndarray
    source: np.ndarray
    frames: np.ndarray

    @staticmethod
    def of(E, B) -> "Shifts":
        """Return the shifts of `x' - x = E x + B u`; E: `(..., n, n)`, B: `(..., n, 1)`."""
        n = E.shape[-1]
        rows = np.concatenate([E + np.eye(n), B], axis=-1).reshape(-1, n, n + 1)
        used = (rows != 0).any(0)
        hands_on = used.argmax(-1)
        single = (used.sum(-1) == 1) & (hands_on < n) & (hands_on != np.arange(n))
        single &= (rows[:, np.arange(n), hands_on] == 1).all(0)
        frames, source = np.zeros(n, int), np.arange(n)
        for first in np.flatnonzero(single):
            state, path = first, []
            while single[state] and not frames[state] and state not in path:
                path.append(state)
                state = hands_on[state]
            if state in path:  # handed on in a ring: one of its states has to be kept
                single[state] = False
                path.remove(state)
            for each in reversed(path):
                source[each], frames[each] = source[hands_on[each]], frames[hands_on[each]] + 1
        kept, delayed = np.flatnonzero(~single), np.argsort(frames, kind="stable")
        delayed = delayed[single[delayed]]
        return Shifts(kept, delayed, hands_on[delayed], np.searchsorted(kept, source[delayed]), frames[delayed])

    def reached(self, E, B, theta):
        """Return `(w I - E)^-1 B` at `w = exp(j theta) - 1`, with the states in the first axis: `(n, ...)`.

        E: `(..., n, n)`, B: `(..., n, 1)`, theta: `(...)`, complex or not.
        """
        turn = np.exp(-1j * theta[..., None] * self.frames)
        kept = solve(self._closed(E, turn, on_circle(theta)), B[..., self.kept, :] + 0j * theta[..., None, None])[..., 0]
        found = np.empty((E.shape[-1], *kept.shape[:-1]), complex)
        found[self.kept] = np.moveaxis(kept, -1, 0)
        found[self.delayed] = np.moveaxis(turn * kept[..., self.source], -1, 0)
        return found

    def read(self, E, C, theta):
        """Return `C (w I - E)^-1` at `w = exp(j theta) - 1`, with the states in the first axis: `(n, ...)`.

        E: `(..., n, n)`, C: `(..., 1, n)`, theta: `(...)`, complex or not.
        """
        turn, z = np.exp(-1j * theta[..., None] * self.frames), 1 + on_circle(theta)
        read = C[..., 0, self.kept] + 0j * theta[..., None]
        for place, some in self._chains():
            read[..., place] += (C[..., 0, self.delayed[some]] * turn[..., some]).sum(-1)
        kept = solve(np.swapaxes(self._closed(E, turn, on_circle(theta)), -1, -2), read[..., None])[..., 0]
        found = np.zeros((E.shape[-1], *kept.shape[:-1]), complex)
        found[self.kept] = np.moveaxis(kept, -1, 0)
        into = np.ascontiguousarray(np.swapaxes(E[..., self.kept[:, None], self.delayed], -1, -2))
        found[self.delayed] = np.moveaxis((into * kept[..., None, :]).sum(-1) + C[..., 0, self.delayed], -1, 0)
        of_kept = np.isin(self.before, self.kept)
        for state, before, ends in zip(self.delayed[::-1], self.before[::-1], of_kept[::-1], strict=True):
            found[state] /= z
            if not ends:
                found[before] += found[state]
        return found

    def _closed(self, E, turn, w):
        """Return `w I - E` of the states that are kept, with the effect of the delayed states on them."""
        whole = w[..., None, None] * np.eye(self.kept.size) - E[..., self.kept[:, None], self.kept]
        into = E[..., self.kept[:, None], self.delayed]
        for place, some in self._chains():
            whole[..., place] -= (into[..., some] * turn[..., None, some]).sum(-1)
        return whole

    def _chains(self):
        """Return the states that are kept and begin a chain, each with the indices of its states in `delayed`."""
        return [(place, np.flatnonzero(self.source == place)) for place in np.unique(self.source)]


@dataclass(frozen=True, slots=True)
class DelayLines:
    """States of a frame with `z x_i = x_j`, but for terms of states that are kept and of the force, as those of a delay.

    kept: all other states. levels: indices of the delayed states that have the same number of such states before them. before:
    for each level but the first, places in the level before of the states whose values these take over.
    """

    kept: np.ndarray
    levels: tuple[np.ndarray, ...]
    before: tuple[np.ndarray, ...]

    @staticmethod
    def of(E) -> "DelayLines":
        """Return the delay lines of a frame less identity `(n, n)`.

        The state with the most entries that a delay does not have is kept, then the next one, until there are none.
        """
        passed = E + np.eye(len(E))
        delayed = E.diagonal() == -1
        while True:
            some = (passed != 0) & delayed & delayed[:, None]
            other = some & ((passed != 1) | (some.sum(1, keepdims=True) > 1))
            entries = np.maximum(other.sum(0), other.sum(1))
            if not entries.any():
                break
            delayed[np.argmax(entries)] = False
        source = np.where(some.any(1), some.argmax(1), -1)
        levels, before = [np.flatnonzero(delayed & (source < 0))], []
        while True:
            found = np.flatnonzero(delayed & np.isin(source, levels[-1]))
            if not found.size:
                break
            before.append(np.searchsorted(levels[-1], source[found]))
            levels.append(found)
        # States in a ring, and those behind one, are not reached and are kept.
        return DelayLines(np.setdiff1d(np.arange(len(E)), np.concatenate(levels)), tuple(levels), tuple(before))

    @property
    def delayed(self) -> np.ndarray:
        """Indices of the delayed states, level by level."""
        return np.concatenate(self.levels)

    def along(self, added, z):
        """Return the delayed states, `(points, delayed, k)`, if all others are 0; added: the same, to `z x_i - x_j`.

        z: `(points, 1, 1)`.
        """
        cuts = np.cumsum([level.size for level in self.levels])[:-1]
        found = np.split(added, cuts, axis=-2)
        found[0] = found[0] / z
        for at, before in enumerate(self.before, 1):
            found[at] = (found[at] + found[at - 1][..., before, :]) / z
        return np.concatenate(found, axis=-2)

    def read(self, out, z):
        """Return `out @ along`, `(points, rows, delayed)`; out: the same, the factors of the delayed states."""
        cuts = np.cumsum([level.size for level in self.levels])[:-1]
        found = [part / z for part in np.split(out, cuts, axis=-1)]
        for at, before in reversed([*enumerate(self.before, 1)]):
            np.add.at(found[at - 1], (..., before), found[at] / z)
        return np.concatenate(found, axis=-1)
