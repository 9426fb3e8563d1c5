"""Loops with long delays, most of whose states only hand on what another state was a frame ago."""

from dataclasses import dataclass

import numpy as np

from wavesweep.lifted.circle import on_circle, solve


@dataclass(frozen=True, slots=True)
class Shifts:
    """States with `z x_i = x_j` and nothing else, of all loops of a batch.

    kept: all other states. delayed: these, each after the one that it hands on, which is `before` it. source: the place in
    `kept` of the state at which its chain begins; frames: how many frames ago it was what this state is now.
    On the unit circle `x_i = z^-frames x_source`, so that a solve is one with the states that are kept, and nothing cancels.
    """

    kept: np.ndarray
    delayed: np.ndarray
    before: np.ndarray
    source: np.ndarray
    frames: np.ndarray

    @staticmethod
    def of(E, B) -> "Shifts":
        """The shifts of `x' - x = E x + B u`; E: `(..., n, n)`, B: `(..., n, 1)`."""
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
        """`(w I - E)^-1 B` at `w = exp(j theta) - 1`, the states first: `(n, ...)`.

        E: `(..., n, n)`, B: `(..., n, 1)`, theta: `(...)`, complex or not.
        """
        turn = np.exp(-1j * theta[..., None] * self.frames)
        kept = solve(self._closed(E, turn, on_circle(theta)), B[..., self.kept, :] + 0j * theta[..., None, None])[..., 0]
        found = np.empty((E.shape[-1], *kept.shape[:-1]), complex)
        found[self.kept] = np.moveaxis(kept, -1, 0)
        found[self.delayed] = np.moveaxis(turn * kept[..., self.source], -1, 0)
        return found

    def read(self, E, C, theta):
        """`C (w I - E)^-1` in the same way; C: `(..., 1, n)`."""
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
        """`w I - E` of the states that are kept, with what the others hand on."""
        whole = w[..., None, None] * np.eye(self.kept.size) - E[..., self.kept[:, None], self.kept]
        into = E[..., self.kept[:, None], self.delayed]
        for place, some in self._chains():
            whole[..., place] -= (into[..., some] * turn[..., None, some]).sum(-1)
        return whole

    def _chains(self):
        """Which of the states that are kept are handed on, and by which of `delayed`."""
        return [(place, np.flatnonzero(self.source == place)) for place in np.unique(self.source)]
