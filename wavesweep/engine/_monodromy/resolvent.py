"""The resolvent `(w I - E)^-1` at points of the circle, `w = z - 1`: of loops of few states by
inverses, of one loop of many along its delay lines or in triangular form.

Each of the three has `reached(columns)`, the states that columns `(..., n, 1)` make, and
`row(rows)`, what rows `(..., n)` read of them. In long delays most states only take over the value
that another state had a frame ago; in states in which a loop is diagonal, or triangular, what an
input reaches takes few operations at each point.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wavesweep.engine._monodromy.batches import NUMBERS_AT_ONCE
from wavesweep.engine._monodromy.rounding import balance
from wavesweep.engine._monodromy.unit_circle import inverse, solve
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import EPS


@dataclass(frozen=True, slots=True)
class DelayLines:
    """States of a frame with `z x_i = x_j`, but for terms of the states `solved` and of the input,
    as those of a delay.

    solved: all other states, which alone have to be solved for. lines: the delayed states, each
    after the one that it takes over. steps: of each delayed state, line by line, how many frames
    pass in it: `z^steps x_i = x_j`.
    """

    solved: np.ndarray
    lines: tuple[np.ndarray, ...]
    steps: np.ndarray

    @staticmethod
    def of(E: np.ndarray) -> "DelayLines":
        """Return the delay lines that all frames less identity of a batch have, `(..., n, n)`.

        The state with the most entries that a delay does not have is solved for, then the next one,
        and so on; then those that several states take over from.
        """
        passed = (E + np.eye(E.shape[-1])).reshape(-1, *E.shape[-2:])
        entries = (passed != 0).any(0)
        passed_on = (passed == 1).all(0)
        delayed = (passed.diagonal(axis1=1, axis2=2) == 0).all(0)
        # First no row may have two entries, or one that is not 1; then no column: two states that
        # take over the same one.
        for branches in (False, True):
            while True:
                # links[i, j]: state i takes over j, z x_i = x_j, both delayed
                links = entries & delayed & delayed[:, None]
                several = links.sum(0) > 1 if branches else links.sum(1, keepdims=True) > 1
                branching = links & (~passed_on | several)
                if not branching.any():
                    break
                delayed[np.argmax(np.maximum(branching.sum(0), branching.sum(1)))] = False
        after = np.where(links.any(0), links.argmax(0), -1)  # after[j]: what takes over j, or -1
        lines = []
        for first in np.flatnonzero(delayed & ~links.any(1)).tolist():
            line = [first]
            while after[line[-1]] >= 0:
                line.append(after[line[-1]])
            lines.append(np.array(line))
        # States in a ring are not reached, and are solved for.
        solved = np.setdiff1d(np.arange(len(links)), np.concatenate([*lines, []]))
        return DelayLines(solved, tuple(lines), np.ones(sum(map(len, lines)), int))

    def condensed(self, system: StateSpace) -> tuple["DelayLines", StateSpace]:
        """Return the same lines and loops, `(loops, ...)`, with one state in place of a run of those
        that do nothing but take over a value: its first alone takes others in, its last alone is
        read."""
        E, B, C, D = system
        passed = (E + np.eye(E.shape[-1]) != 0).any(0)
        handed = (passed.sum(1) == 1) & ~(B != 0).any((0, 2))
        unread = (passed.sum(0) == 1) & ~(C != 0).any((0, 1))
        first = [self.solved]
        last = [self.solved]
        lines = []
        steps = [np.zeros(0, int)]
        begin = self.solved.size
        for line in self.lines:
            cut = np.flatnonzero(~(unread[line[:-1]] & handed[line[1:]])) + 1
            ends = np.append(cut, line.size)
            starts = np.append(0, cut)
            first.append(line[starts])
            last.append(line[ends - 1])
            steps.append(ends - starts)
            lines.append(begin + np.arange(ends.size))
            begin += ends.size
        rows = np.concatenate(first)[:, None]
        columns = np.concatenate(last)
        solved = np.arange(self.solved.size)
        states = StateSpace(E[:, rows, columns], B[:, rows[:, 0]], C[..., columns], D)
        return DelayLines(solved, tuple(lines), np.concatenate(steps)), states

    @property
    def delayed(self) -> np.ndarray:
        """Indices of the delayed states, line by line."""
        return np.concatenate([*self.lines, np.zeros(0, int)])

    @property
    def longest(self) -> int:
        """Steps of the longest line."""
        return max((int(self.steps[places].sum()) for places in self._places()), default=0)

    def along(self, added: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the delayed states, `(..., delayed, k)`, if all others are 0; added: the same, to
        `z x_i - x_j`.

        z: `(..., 1, 1)`.
        """
        return self._summed(added.mT, z, 1).mT

    def read(self, out: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return `out @ along`, `(..., rows, delayed)`; out: the same, the factors of the
        delayed states."""
        return self._summed(out, z, -1)

    def _summed(self, inputs: np.ndarray, z: np.ndarray, step: int) -> np.ndarray:
        """Sums of what enters lines, or is read of them, up to each of their states, or back
        from the end; step: 1 or -1."""
        result = np.zeros(np.broadcast_shapes(inputs.shape, z.shape), complex)
        nonzero = np.flatnonzero(inputs.mT.any(tuple(range(inputs.ndim - 1))))
        if not nonzero.size:
            return result
        for places in self._places():
            of_state = z[..., 0] ** self.steps[places]
            behind = np.cumprod(of_state, axis=-1)
            before = (behind / of_state)[..., None, :]
            behind = behind[..., None, :]
            forward, back = (before, 1 / behind) if step > 0 else (1 / behind, before)
            sums = inputs[..., nonzero, places] * forward
            np.cumsum(sums[..., ::step], -1, out=sums[..., ::step])
            result[..., nonzero, places] = sums * back
        return result

    def _places(self) -> list[slice]:
        """The places of each line in `delayed`."""
        ends = np.cumsum([0, *(line.size for line in self.lines)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    def reached(self, E: np.ndarray, B: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return `(w I - E)^-1 B` at w `(...)`, `(..., n)`; E: `(..., n, n)`, B: `(..., n, 1)`."""
        k = self.solved
        d = self.delayed
        w = w[..., None, None]
        entered = np.broadcast_to(E[..., d[:, None], k], (*w.shape[:-2], d.size, k.size))
        alone = np.broadcast_to(B[..., d, :], (*w.shape[:-2], d.size, 1))
        into = self.along(np.concatenate([entered, alone], -1), 1 + w)
        gained = E[..., k[:, None], d] @ into
        A = w * np.eye(k.size) - E[..., k[:, None], k] - gained[..., :-1]
        solved = solve(A, B[..., k, :] + gained[..., -1:])
        delayed = into[..., :-1] @ solved + into[..., -1:]
        states = np.empty((*w.shape[:-2], E.shape[-1]), complex)
        states[..., k] = solved[..., 0]
        states[..., d] = delayed[..., 0]
        return states

    def row(self, E: np.ndarray, C: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return `C (w I - E)^-1`, `(..., n)`; C: `(..., 1, n)`, E and w as for `reached`."""
        k = self.solved
        d = self.delayed
        w = w[..., None, None]
        rows = np.broadcast_to(E[..., k[:, None], d], (*w.shape[:-2], k.size, d.size))
        alone = np.broadcast_to(C[..., d], (*w.shape[:-2], 1, d.size))
        out = self.read(np.concatenate([rows, alone], -2), 1 + w)
        gained = out @ E[..., d[:, None], k]
        A = w * np.eye(k.size) - E[..., k[:, None], k] - gained[..., :-1, :]
        solved = solve(A.mT, (C[..., k] + gained[..., -1:, :]).mT).mT
        delayed = solved @ out[..., :-1, :] + out[..., -1:, :]
        states = np.empty((*w.shape[:-2], E.shape[-1]), complex)
        states[..., k] = solved[..., 0, :]
        states[..., d] = delayed[..., 0, :]
        return states


MODAL_ERROR = 1e-9  # of a frame in its eigenvectors, the error up to which these serve


@dataclass(frozen=True, slots=True, eq=False)
class TriangularForm:
    """Frames less identity as `u V T V^-1 u^-1`, T diagonal or upper triangular, u units of the
    states.

    T, V, Z: `(loops, n, n)`, complex, Z being what is computed of V^-1. units: `(loops, n)`. error:
    `(loops,)`, of all solves with T: what they give is that of `T + X`, the Frobenius norm of X
    being at most so large. diagonal: whether T is.
    """

    T: np.ndarray
    V: np.ndarray
    Z: np.ndarray
    units: np.ndarray
    error: np.ndarray
    diagonal: bool

    @staticmethod
    def of(E: np.ndarray, B: np.ndarray, C: np.ndarray) -> "TriangularForm":
        """Return the form of each of some loops by eigenvectors, or Schur's if these are nearly
        dependent; E: `(loops, n, n)`, B: `(loops, n, 1)`, C: `(loops, outputs, n)`.

        Units of the states are even with B and C as well: E alone leaves those of a state open that
        hardly acts on any other one, as one of a filter that forgets all within a frame, and the
        product of what reaches it and what is read of it would be large in some and small in others.

        With `E V = V T + R` the frame is `V (T + V^-1 R) V^-1`. If the norm f of `1 - Z V` is below
        1/2, that of V^-1 is at most twice that of Z. Z moves the states that are reached and read
        by f of themselves, and rounding of sums of n terms by as many roundings, times the
        condition of V.
        """
        n = E.shape[-1]
        system = np.zeros((len(E), n + 1, n + 1))
        system[:, :n, :n] = E
        system[:, :n, n:] = B
        system[:, n, :n] = np.abs(C).max(-2)
        units = balance(system)[1]
        units = units[:, :n] / units[:, n:]
        balanced = E * (units[:, None, :] / units[:, :, None])
        T, V, Z, error = _with_error(balanced, *_eigenvectors(balanced))
        diagonal = bool((error <= MODAL_ERROR).all())
        if not diagonal:
            T, V, Z, error = _with_error(balanced, *_schur(balanced))
        return TriangularForm(T, V, Z, units, error, diagonal)

    def system(self, system: StateSpace) -> StateSpace:
        """Return these loops in these states; of a diagonal E the diagonal alone, `(loops, 1,
        n)`."""
        B = system.B / self.units[:, :, None]
        C = system.C * self.units[:, None, :]
        return StateSpace(self.frames, self.Z @ B, C @ self.V, system.D)

    @property
    def frames(self) -> np.ndarray:
        """T, or of a diagonal one the diagonal alone, `(loops, 1, n)`."""
        return np.diagonal(self.T, axis1=-2, axis2=-1)[:, None] if self.diagonal else self.T

    def reached(self, E: np.ndarray, B: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return `(w I - E)^-1 B`, `(..., n)`; E, B: of `system`. See `DelayLines.reached`."""
        right = B[..., 0]
        if self.diagonal:
            return right / (w[..., None] - E[..., 0, :])
        return _forward(E[..., ::-1, ::-1], right[..., ::-1], w)[..., ::-1]

    def row(self, E: np.ndarray, C: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return `C (w I - E)^-1`, `(..., n)`."""
        row = C[..., 0, :]
        if self.diagonal:
            return row / (w[..., None] - E[..., 0, :])
        return _forward(E.mT, row, w)


def _forward(T: np.ndarray, right: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return `(w I - T)^-1 right`, `(..., n)`; T: lower triangular, `(..., n, n)`."""
    n = T.shape[-1]
    T = np.moveaxis(T, (-2, -1), (0, 1))
    states = np.empty((n, *w.shape), complex)
    states[...] = np.moveaxis(np.broadcast_to(right, (*w.shape, n)), -1, 0)
    for k in range(n):
        states[k] /= w - T[k, k]
        states[k + 1 :] += T[k + 1 :, k] * states[k]
    return np.moveaxis(states, 0, -1)


@np.errstate(all="ignore")
def _with_error(
    E: np.ndarray, T: np.ndarray, V: np.ndarray, Z: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """T, V and Z, and the error of the form that they are of E, see `TriangularForm.of`."""
    identity = np.eye(E.shape[-1])
    rounding = 2 * (len(identity) + 8) * EPS
    of_T = _norm(T)
    of_V = _norm(V)
    of_Z = _norm(Z)
    off = _norm(identity - Z @ V) + rounding * of_Z * of_V
    missed = _norm(E @ V - V @ T) + rounding * of_V * (_norm(E) + of_T)
    error = 2 * of_Z * missed + 2 * (off + rounding * (1 + of_Z * of_V)) * (2 + of_T)
    return T, V, Z, np.where(off < 0.5, error, np.inf)


def _eigenvectors(E: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    values, V = np.linalg.eig(E)
    V = V.astype(complex)
    return values[:, :, None] * np.eye(E.shape[-1]), V, inverse(V)


def _schur(E: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    from scipy.linalg import schur

    T, V = np.empty((2, *E.shape), complex)
    for loop, matrix in enumerate(E):
        T[loop], V[loop] = schur(matrix, output="complex")
    return T, V, V.conj().mT


def _norm(matrices: np.ndarray) -> np.ndarray:
    return np.linalg.norm(matrices, axis=(-1, -2))


# states that are no delays, up to which these are eliminated; of more, a triangular form is faster
FEW_SOLVED = 12


@dataclass(frozen=True, slots=True, eq=False)
class Inverse:
    """Of a loop at each point: `matrix`, `(points, n, n)`, there or so near that one refinement
    corrects for the distance."""

    matrix: np.ndarray

    def reached(self, columns: np.ndarray) -> np.ndarray:
        return self.matrix @ columns

    def row(self, rows: np.ndarray) -> np.ndarray:
        return (self.matrix.mT @ rows[..., None])[..., 0]


@dataclass(frozen=True, slots=True, eq=False)
class InLines:
    """Of one loop at several points, along its delay lines; E: `(n, n)`, w: `(points,)`."""

    lines: DelayLines
    E: np.ndarray
    w: np.ndarray

    def reached(self, columns: np.ndarray) -> np.ndarray:
        return self.lines.reached(self.E, columns, self.w)[..., None]

    def row(self, rows: np.ndarray) -> np.ndarray:
        return self.lines.row(self.E, rows[..., None, :], self.w)


@dataclass(frozen=True, slots=True, eq=False)
class InForm:
    """Of one loop at several points, in states in which it is diagonal or triangular; w:
    `(points,)`."""

    form: TriangularForm
    w: np.ndarray

    def reached(self, columns: np.ndarray) -> np.ndarray:
        form = self.form
        units = form.units[0]
        right = (columns[..., 0] / units) @ form.Z[0].T
        states = form.reached(form.frames, right[..., None], self.w)
        return (units * (states @ form.V[0].T))[..., None]

    def row(self, rows: np.ndarray) -> np.ndarray:
        form = self.form
        units = form.units[0]
        read = form.row(form.frames, ((rows * units) @ form.V[0])[..., None, :], self.w)
        return (read @ form.Z[0]) / units


@dataclass(frozen=True, slots=True, eq=False)
class ManyStates:
    """One loop of many states, of which no inverses are kept: `at` gives its resolvent at up to
    `most` points together."""

    E: np.ndarray
    form: DelayLines | TriangularForm
    most: int

    @staticmethod
    def of(E: np.ndarray, B: np.ndarray, C: np.ndarray) -> "ManyStates":
        """E: `(n, n)`, B: `(n, 1)`, C: `(outputs, n)`."""
        lines = DelayLines.of(E)
        if lines.solved.size <= FEW_SOLVED:
            numbers = len(E) * (1 + lines.solved.size)  # at a point
            return ManyStates(E, lines, max(1, NUMBERS_AT_ONCE // numbers))
        form = TriangularForm.of(E[None], B[None], C[None])
        return ManyStates(E, form, max(1, NUMBERS_AT_ONCE // len(E)))

    def at(self, w: np.ndarray) -> InLines | InForm:
        """w: `(points,)`."""
        if isinstance(self.form, DelayLines):
            return InLines(self.form, self.E, w)
        return InForm(self.form, w)
