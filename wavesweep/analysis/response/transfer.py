"""Frequency response of one block, through its modes or by a solve per frequency."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.lifted.circle import solve


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """A block and its modal form `C V (w - poles)^-1 V^-1 B`, computed once for any number of frequencies."""

    block: Block
    poles: np.ndarray
    out: np.ndarray
    into: np.ndarray


def modes_of(block: Block) -> Modes:
    """Eigenvalues and modes; a defective matrix (pure delays) gives huge ones, which the caller finds out from `size`.

    A loop that overflowed within its frame has no response: NaN, by way of D.
    """
    lost = ~np.logical_and.reduce([np.isfinite(getattr(block, part)).all((-1, -2)) for part in "EBCD"])
    if lost.any():
        fills = {"E": -1.0, "B": 0.0, "C": 0.0, "D": np.nan}
        kept = {part: np.where(lost[..., None, None], fill, getattr(block, part)) for part, fill in fills.items()}
        block = replace(block, **kept)
    poles, vectors = np.linalg.eig(block.E)
    vectors = vectors.astype(complex)
    B = np.broadcast_to(block.B, vectors.shape[:-1] + block.B.shape[-1:])
    return Modes(block, poles, block.C @ vectors, _coordinates(vectors, B))


def _coordinates(vectors, B):
    """`V^-1 B`; NaN where the modes are so few directions that V is singular, which the caller finds doubtful too."""
    try:
        return np.linalg.solve(vectors, B)
    except np.linalg.LinAlgError:
        singular = (np.linalg.slogdet(vectors)[0] == 0)[..., None, None]
        return np.where(singular, np.nan, np.linalg.solve(np.where(singular, np.eye(vectors.shape[-1]), vectors), B))


def modal_response(modes: Modes, w):
    """`C (w I - E)^-1 B + D` at `w = z - 1`, `(..., points, p, m)`, and the sum of the sizes of its terms.

    A few flops per point. Relative error about eps * size/|response|: what cancels among the modes is lost.
    """
    with np.errstate(all="ignore"):
        factor = 1 / (w[..., None] - modes.poles[..., None, :])
        D = modes.block.D[..., None, :, :]
        G = (modes.out[..., None, :, :] * factor[..., None, :]) @ modes.into[..., None, :, :] + D
        size = (np.abs(modes.out)[..., None, :, :] * np.abs(factor)[..., None, :]) @ np.abs(modes.into)[..., None, :, :]
    return G, size + np.abs(D)


def solved_response(modes: Modes, w):
    """The same by one solve per point, backward stable whatever the modes are; the size is that of the response."""
    E, B, C, D = (part[..., None, :, :] for part in (modes.block.E, modes.block.B, modes.block.C, modes.block.D))
    A = w[..., None, None] * np.eye(E.shape[-1]) - E
    G = C @ solve(A, B + 0 * A[..., :1]) + D
    return G, np.abs(G)
