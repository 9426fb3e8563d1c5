"""Loops with long delays, in which most states only take over the value that another state had a frame ago."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wavesweep.engine.monodromy.unit_circle import on_circle, solve


@dataclass(frozen=True, slots=True)
class DelayLines:
    """States of a frame with `z x_i = x_j`, but for terms of the states `solved` and of the input, as those of a delay.

    solved: all other states, which alone have to be solved for. lines: the delayed states, each after the one that it takes
    over.
    """

    solved: np.ndarray
    lines: tuple[np.ndarray, ...]

    @staticmethod
    def of(E) -> "DelayLines":
        """Return the delay lines that all frames less identity of a batch have, `(..., n, n)`.

        The state with the most entries that a delay does not have is solved for, then the next one, and so on; then those that
        several states take over from.
        """
        passed = (E + np.eye(E.shape[-1])).reshape(-1, *E.shape[-2:])
        entries, passed_on, delayed = (
            (passed != 0).any(0),
            (passed == 1).all(0),
            (passed.diagonal(axis1=1, axis2=2) == 0).all(0),
        )
        for branches in (False, True):
            while True:
                links = entries & delayed & delayed[:, None]
                several = links.sum(0) > 1 if branches else links.sum(1, keepdims=True) > 1
                branching = links & (~passed_on | several)
                if not branching.any():
                    break
                delayed[np.argmax(np.maximum(branching.sum(0), branching.sum(1)))] = False
        after = np.where(links.any(0), links.argmax(0), -1)
        lines = []
        for first in np.flatnonzero(delayed & ~links.any(1)).tolist():
            lines.append([first])
            while after[lines[-1][-1]] >= 0:
                lines[-1].append(after[lines[-1][-1]])
        # States in a ring are not reached, and are solved for.
        lines = tuple(map(np.array, lines))
        return DelayLines(np.setdiff1d(np.arange(len(links)), np.concatenate([*lines, []])), lines)

    @property
    def delayed(self) -> np.ndarray:
        """Indices of the delayed states, line by line."""
        return np.concatenate([*self.lines, np.zeros(0, int)])

    def along(self, added, z):
        """Return the delayed states, `(..., delayed, k)`, if all others are 0; added: the same, to `z x_i - x_j`.

        z: `(..., 1, 1)`.
        """
        return np.swapaxes(self._summed(np.swapaxes(added, -1, -2), z, 1), -1, -2)

    def read(self, out, z):
        """Return `out @ along`, `(..., rows, delayed)`; out: the same, the factors of the delayed states."""
        return self._summed(out, z, -1)

    def _summed(self, inputs, z, step):
        """Sums of what enters lines, or is read of them, up to each of their states, or back from the end; step: 1 or -1."""
        result = np.zeros(np.broadcast_shapes(inputs.shape, z.shape), complex)
        nonzero = np.flatnonzero(np.swapaxes(inputs, -1, -2).any(tuple(range(inputs.ndim - 1))))
        if not nonzero.size:
            return result
        for at in self._places():
            power = np.repeat(z[..., 0], at.stop - at.start, axis=-1)
            power[..., 0] = 1
            power = np.cumprod(power, axis=-1, out=power)[..., None, :]
            forward, back = (power, 1 / power) if step > 0 else (1 / power, power)
            sums = inputs[..., nonzero, at] * forward
            np.cumsum(sums[..., ::step], -1, out=sums[..., ::step])
            sums *= back / z
            result[..., nonzero, at] = sums
        return result

    def _places(self):
        """The places of each line in `delayed`."""
        ends = np.cumsum([0, *(line.size for line in self.lines)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    def reached(self, E, B, theta):
        """Return `(w I - E)^-1 B` at `w = exp(j theta) - 1`, `(..., n)`; E: `(..., n, n)`, B: `(..., n, 1)`, theta: `(...)`."""
        k, d, w = self.solved, self.delayed, on_circle(theta)[..., None, None]
        into = self.along(np.concatenate([E[..., d[:, None], k], B[..., d, :]], -1), 1 + w)
        gained = E[..., k[:, None], d] @ into
        solved = solve(w * np.eye(k.size) - E[..., k[:, None], k] - gained[..., :-1], B[..., k, :] + gained[..., -1:])
        states = np.empty((*theta.shape, E.shape[-1]), complex)
        states[..., k], states[..., d] = solved[..., 0], (into[..., :-1] @ solved + into[..., -1:])[..., 0]
        return states

    def row(self, E, C, theta):
        """Return `C (w I - E)^-1` at `w = exp(j theta) - 1`, `(..., n)`; C: `(..., 1, n)`, E and theta as for `reached`."""
        k, d, w = self.solved, self.delayed, on_circle(theta)[..., None, None]
        out = self.read(np.concatenate([E[..., k[:, None], d], C[..., d]], -2), 1 + w)
        gained = out @ E[..., d[:, None], k]
        A = w * np.eye(k.size) - E[..., k[:, None], k] - gained[..., :-1, :]
        solved = np.swapaxes(solve(np.swapaxes(A, -1, -2), np.swapaxes(C[..., k] + gained[..., -1:, :], -1, -2)), -1, -2)
        states = np.empty((*theta.shape, E.shape[-1]), complex)
        states[..., k], states[..., d] = solved[..., 0, :], (solved @ out[..., :-1, :] + out[..., -1:, :])[..., 0, :]
        return states
