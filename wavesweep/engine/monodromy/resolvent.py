"""The resolvent `(w I - E)^-1` at points of the circle, `w = z - 1`: of loops of few states by inverses, of one loop of many
along its delay lines or in triangular form.

Each has `reached(columns)`, the states that columns `(..., n, 1)` make, and `row(rows)`, what rows `(..., n)` read of them.
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.monodromy.delay_lines import DelayLines
from wavesweep.engine.monodromy.triangular import TriangularForm
from wavesweep.engine.monodromy.unit_circle import inverse

FEW_SOLVED = 12  # states that are no delays, up to which these are eliminated; of more, a triangular form is faster
MOST = 500_000  # numbers of states, or of what they enter and read, that are computed together


@dataclass(frozen=True, slots=True, eq=False)
class Inverse:
    """Of a loop at each point: `matrix`, `(points, n, n)`, there or so near that one refinement corrects for the distance."""

    matrix: np.ndarray

    def reached(self, columns):
        return self.matrix @ columns

    def row(self, rows):
        return (np.swapaxes(self.matrix, -1, -2) @ rows[..., None])[..., 0]


@dataclass(frozen=True, slots=True, eq=False)
class InLines:
    """Of one loop at several points, with its delays eliminated; see `DelayLines`.

    into, out: what the states `solved` enter of the delayed ones, `(points, delayed, k)`, and read of them, `(points, k,
    delayed)`. back: the inverse that is left for these states, `(points, k, k)`.
    """

    lines: DelayLines
    E: np.ndarray
    z: np.ndarray
    into: np.ndarray
    out: np.ndarray
    back: np.ndarray

    @staticmethod
    def at(lines: DelayLines, E, w) -> "InLines":
        """E `(n, n)`; w `(points,)`."""
        k, d, w = lines.solved, lines.delayed, w[:, None, None]
        into = lines.along(E[np.ix_(d, k)] + 0 * w, 1 + w)
        out = lines.read(E[np.ix_(k, d)] + 0 * w, 1 + w)
        back = inverse(w * np.eye(k.size) - E[np.ix_(k, k)] - E[np.ix_(k, d)] @ into)
        return InLines(lines, E, 1 + w, into, out, back)

    def reached(self, columns):
        k, d = self.lines.solved, self.lines.delayed
        alone = self.lines.along(columns[..., d, :] + 0 * self.z, self.z)
        states = np.empty((len(self.z), len(self.E), 1), complex)
        states[:, k] = self.back @ (columns[..., k, :] + self.E[np.ix_(k, d)] @ alone)
        states[:, d] = alone + self.into @ states[:, k]
        return states

    def row(self, rows):
        k, d = self.lines.solved, self.lines.delayed
        alone = self.lines.read(rows[..., None, d] + 0 * self.z, self.z)
        read = np.empty((len(self.z), 1, len(self.E)), complex)
        read[..., k] = (rows[..., None, k] + alone @ self.E[np.ix_(d, k)]) @ self.back
        read[..., d] = alone + read[..., k] @ self.out
        return read[:, 0]


@dataclass(frozen=True, slots=True, eq=False)
class InForm:
    """Of one loop at several points, in states in which it is diagonal or triangular; w: `(points,)`."""

    form: TriangularForm
    w: np.ndarray

    def reached(self, columns):
        V, Z, units = self.form.V[0], self.form.Z[0], self.form.units[0]
        states = self.form.solved(self.form.frames, (columns[..., 0] / units) @ Z.T, self.w)
        return (units * (states @ V.T))[..., None]

    def row(self, rows):
        V, Z, units = self.form.V[0], self.form.Z[0], self.form.units[0]
        return (self.form.read(self.form.frames, (rows * units) @ V, self.w) @ Z) / units


@dataclass(frozen=True, slots=True, eq=False)
class ManyStates:
    """One loop of many states, of which no inverses are kept: `at` gives its resolvent at up to `most` points together."""

    E: np.ndarray
    form: DelayLines | TriangularForm
    most: int

    @staticmethod
    def of(E) -> "ManyStates":
        """E: `(n, n)`."""
        lines = DelayLines.of(E)
        if lines.solved.size <= FEW_SOLVED:
            return ManyStates(E, lines, max(1, MOST // (len(E) * (1 + lines.solved.size))))
        return ManyStates(E, TriangularForm.of(E[None]), max(1, MOST // len(E)))

    def at(self, w) -> InLines | InForm:
        """w: `(points,)`."""
        if isinstance(self.form, DelayLines):
            return InLines.at(self.form, self.E, w)
        return InForm(self.form, w)
