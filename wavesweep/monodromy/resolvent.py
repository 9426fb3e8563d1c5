"""The resolvent of a block, `C (w I - E)^-1 B + D`: by a solve per point, or through modes at all aliases of a frequency."""

import math
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.loops.block import Block
from wavesweep.monodromy.circle import on_circle, solve

GOOD = 1e-3  # relative error of the modal form, seen at the probes, up to which one refinement makes it exact
PROBES = np.pi * np.array([1e-5, 1e-3, 0.01, 0.05, 0.3, 0.9])
CHUNK = 100_000  # matrices of one batch of solves


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A block of `(loops,)` batch, ready for evaluation at any point of any of its loops.

    modes: (poles, vectors, inverse of the vectors), `(loops, ...)`; None if they are not accurate enough.
    """

    block: Block
    modes: tuple[np.ndarray, np.ndarray, np.ndarray] | None

    def at(self, owner, theta):
        """Return `C (w I - E)^-1 B + D` of the loops `owner` at angles `theta` (rad per tick): `(points, more, p, m)`.

        owner `(points,)`, theta `(points, more)`.
        """
        width = max(1, CHUNK // max(1, theta.shape[-1]))
        cuts = range(width, owner.size, width)
        parts = zip(np.split(owner, cuts), np.split(on_circle(theta), cuts), strict=True)
        return np.concatenate([self._respond(*part) for part in parts])

    def _respond(self, owner, w):
        solved = self.modes is None
        state = _solved_state(self.block, owner, w) if solved else _refined_state(self.block, self.modes, owner, w)
        return self.block.C[owner][:, None] @ state + self.block.D[owner][:, None]


def response_of(block: Block, loops: int) -> Response:
    """Prepare a block of `(loops,)` batch."""
    return Response(block, _good_modes(block, loops))


def flattened(block: Block, batch) -> Block:
    """Return the block with its batch, broadcast to `batch`, in one axis."""
    parts = {}
    for name in "EBCD":
        tail = getattr(block, name).shape[-2:]
        parts[name] = np.broadcast_to(getattr(block, name), (*batch, *tail)).reshape(math.prod(batch), *tail)
    return replace(block, **parts)


def alias_angles(theta, ratio: int):
    """Return `(theta + 2 pi m)/ratio` for every alias m, in (-pi, pi]: `(points, ratio)`."""
    shift = np.arange(ratio) - (ratio - 1) // 2
    return (np.asarray(theta)[..., None] + 2 * np.pi * shift) / ratio


def _good_modes(block, loops):
    """Return the modes if they agree with a solve at the probes in every loop; None for crowded poles and pure delays."""
    poles, vectors = np.linalg.eig(block.E)
    vectors = vectors.astype(complex)
    modes = poles, vectors, solve(vectors, np.broadcast_to(np.eye(vectors.shape[-1]), vectors.shape) + 0j)
    owner = np.arange(loops)
    w = np.broadcast_to(on_circle(PROBES), (loops, PROBES.size))
    exact, rough = _solved_state(block, owner, w), _modal_state(block.B[:, None], modes, owner, w)
    error = np.abs(rough - exact).max(-2, initial=0)
    return modes if np.all(error <= GOOD * np.abs(exact).max(-2, initial=0)) else None


def _refined_state(block, modes, owner, w):
    """Return `(w I - E)^-1 B` through the modes, with one correction for the residual.

    It is as exact as a solve, and cheaper.
    """
    B = block.B[owner][:, None]
    state = _modal_state(B, modes, owner, w)
    residual = B - w[..., None, None] * state + block.E[owner][:, None] @ state
    return state + _modal_state(residual, modes, owner, w)


def _modal_state(B, modes, owner, w):
    poles, vectors, inverse = (part[owner][:, None] for part in modes)
    with np.errstate(all="ignore"):
        return vectors @ ((inverse @ B) / (w[..., None] - poles)[..., None])


def _solved_state(block, owner, w):
    E, B = block.E[owner][:, None], block.B[owner][:, None]
    A = w[..., None, None] * np.eye(E.shape[-1]) - E
    return solve(A, B + 0 * w[..., None, None])


def solved_response(block: Block, w):
    """Return `C (w I - E)^-1 B + D` at `w = z - 1`, `(..., points, p, m)`, backward stable."""
    E, B, C, D = (part[..., None, :, :] for part in (block.E, block.B, block.C, block.D))
    A = w[..., None, None] * np.eye(E.shape[-1]) - E
    return C @ solve(A, B + 0 * A[..., :1]) + D
