"""The port's map at low frequencies, without aliases."""

import numpy as np

from wavesweep.analysis.passivity.hinf import DENSE, smallest_hermitian, some_below
from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.response.frame import prepare
from wavesweep.lifted.circle import on_circle

OVERFLOW = 1e100  # entries of a frame that overflows, or nearly
MOST = 5_000_000  # complex numbers of the points that are computed together


class AtRest:
    """The map of a `PortLoop` without aliases, `T + O (w - E)^-1 G`, which stays finite down to zero frequency.

    T is a Toeplitz matrix that no frequency changes (see `response.frame.Shown`): its symmetric part is diagonal in its own
    eigenvectors, found once, and the rest is of low rank.
    """

    def __init__(self, loop):
        diagram, K_VE, B_VE = loop.source
        frame = prepare(diagram, K_VE, B_VE, (diagram.hand.displacement,))
        E = frame.E.copy()
        if frame.lead is not None:  # if nothing reads the scene's position, its pole at 0 is in no response
            E[..., frame.lead, frame.lead] = np.where(frame.free, -1.0, E[..., frame.lead, frame.lead])
        impulse = np.where(frame.lost[..., None], np.nan, frame.shown.impulse[0][..., 0, :])
        states = E, frame.dE, frame.shown.seen[0][..., 0, :, :], frame.shown.left[0]
        self._put(_flattened(impulse[..., None, :], loop)[:, 0], *(_flattened(part, loop) for part in states))

    def _put(self, impulse, E, dE, seen, into, constant=None):
        """Keep the low rank and what no frequency changes, an array of all loops each.

        constant: `(loops,)`, a multiple of the matrix of ones beside T.
        """
        ratio = impulse.shape[-1]
        lag = np.abs(np.subtract.outer(*[np.arange(ratio)] * 2))
        known = np.isfinite(impulse).all(-1)
        different, which = np.unique(np.where(known[:, None], impulse, 0.0), axis=0, return_inverse=True)
        if constant is not None:
            seen = np.concatenate([seen, constant[:, None, None] + np.zeros((len(seen), ratio, 1))], axis=-1)
            into = np.concatenate([into, np.ones((len(into), 1, ratio))], axis=-2)
        self.E, self.dE, self.diagonal = E, dE, np.full((len(E), ratio), np.nan)
        self.left, self.right = np.empty_like(seen), np.empty_like(into)
        for number, each in enumerate(different):  # loops often share it
            diagonal, vectors = np.linalg.eigh(each[lag] * np.where(lag == 0, 1.0, 0.5))
            loops = np.flatnonzero(which.reshape(-1) == number)
            with np.errstate(over="ignore", invalid="ignore"):  # of a frame that overflows; see `_smallest`
                self.left[loops], self.right[loops] = vectors.T @ seen[loops], into[loops] @ vectors
            self.diagonal[loops] = diagonal
        self.diagonal[~known] = np.nan

    def smallest(self, owner, theta, ceiling=None):
        """Smallest eigenvalue of the Hermitian part (m/N) of the loops `owner` at `theta` (rad per frame).

        ceiling: infinity may stand for a value that is not below it.
        """
        step = max(1, MOST // (self.left.shape[-2] * (2 * self.left.shape[-1]) ** 2))
        parts = [slice(first, first + step) for first in range(0, owner.size, step)]
        each = [self._smallest(owner[part], theta[part], None if ceiling is None else ceiling[part]) for part in parts]
        return np.concatenate([*each, np.zeros(0)])

    def _smallest(self, owner, theta, ceiling):
        w, n = on_circle(theta)[:, None, None], self.E.shape[-1]
        with np.errstate(all="ignore"):
            A, right = w * np.eye(n) - self.E[owner], self.right[owner] + 0 * w
            state, _ = solved(A, self.dE[owner], right[:, :n], np.zeros((len(right), n, right.shape[-1])))
            parts = self.diagonal[owner] + 0j, self.left[owner] + 0j, np.concatenate([state, right[:, n:]], axis=-2)
            good = np.logical_and.reduce([(np.abs(part) < OVERFLOW).all(tuple(range(1, part.ndim))) for part in parts])
            found = np.full(owner.size, np.nan)
            if ceiling is not None and good.any() and self.left.shape[-2] > DENSE:
                found[good] = np.inf
                good[good] = some_below(*(part[good] for part in parts), ceiling[good])
            if good.any():
                found[good] = smallest_hermitian(*(part[good] for part in parts))
            return found


def _flattened(array, loop):
    """An array of matrices with its batch, broadcast to that of the loop, in one axis."""
    return np.broadcast_to(array, (*loop.batch, *array.shape[-2:])).reshape(loop.loops, *array.shape[-2:])
