"""That no matrix of an enclosure has an eigenvalue on or outside the unit circle."""

import numpy as np

from wavesweep.analysis.passivity.enclosure import Enclosure

ROOM = 1e-9  # of a weighted row: what rounding may add to it
SECTORS = 4  # of the upper half of the plane, one about each of the largest eigenvalues
SWEEPS = 8  # of the power iteration that tells which parameter does most


def excluded(A: Enclosure) -> tuple[np.ndarray, np.ndarray]:
    """Whether every `I + A` is stable, `(pieces,)`, and which parameter adds most to the bound, `(pieces,)`.

    A: real matrices, near to diagonal in some basis that is common to them. For z outside, `z - I - A` is invertible
    where it is diagonally dominant in some weights: `sum_j |A_ij| d_j < |z - 1 - A_ii| d_i`. That is asked of each sector
    `|z| >= 1, a <= arg z <= b` of the upper half plane (the lower one is its image), with the least of the right side
    in it; the weights d are solved for (A. Berman, R. Plemmons, Nonnegative matrices in the mathematical sciences,
    1979: they exist exactly for a nonsingular M-matrix) and then tried.
    """
    centre, slopes, bends, rest = _flattened(A)
    finite = np.logical_and.reduce([np.isfinite(part).all(tuple(range(1, part.ndim))) for part in A.parts])
    moves = np.abs(slopes)
    radius = moves.sum(1) + rest
    d = np.arange(centre.shape[-1])
    own = 1 + centre[:, d, d]
    inside = 1 - _modulus(1 + A.centre[:, d, d], slopes[:, :, d, d], A.curves[:, :, d, d]) - A.rest[:, d, d]
    away = np.maximum(inside[:, None], _distances(own) - radius[:, None, d, d])
    off = np.abs(centre) + radius
    off[:, d, d] = 0
    finite &= np.isfinite(off).all((-1, -2)) & np.isfinite(away).all((-1, -2))
    off, away = np.where(finite[:, None, None], off, 1.0), np.where(finite[:, None, None], away, 0.0)
    clear = _dominant(off, away)
    worst = np.argmin(np.where(clear, 10.0, 0.0) + away.min(-1), axis=-1)
    least = np.take_along_axis(away, worst[:, None, None], 1)[:, 0]
    return finite & clear.all(-1), _costliest(off, least, moves, bends, np.where(finite[:, None, None], A.rest, 0.0))


def _flattened(A):
    """Centre, slopes, what pairs of parameters add at most, and all that no slope says."""
    i, j = np.triu_indices(A.slopes.shape[1])
    centre = A.centre + A.curves[:, i == j].sum(1) / 2  # e^2 is within a half of a half
    bends = np.abs(A.curves) * np.where(i == j, 0.5, 1.0)[:, None, None]
    return centre, A.slopes, bends, A.rest + bends.sum(1)


def _modulus(centre, slopes, curves):
    """At most how large `centre + sum slopes_k e_k + sum curves_ij e_i e_j` is, to second order in the square of it.

    A mode that only turns with the parameters grows by its third order alone.
    """
    i, j = np.triu_indices(slopes.shape[1])
    linear = 2 * (centre[:, None].conj() * slopes).real
    square = 2 * (centre[:, None].conj() * curves).real
    square += np.where(i == j, 1, 2)[:, None] * (slopes[:, i].conj() * slopes[:, j]).real
    own, mixed = square[:, i == j], np.abs(square[:, i != j]).sum(1)
    size = np.abs(linear)  # the most of l e + q e^2: in a corner, unless q < 0 bends it down before
    hump = np.where(size < -2 * own, linear**2 / np.maximum(-4 * own, 1e-300), size + own)
    first, second = np.abs(slopes).sum(1), np.abs(curves).sum(1)
    return np.sqrt(np.maximum(np.abs(centre) ** 2 + hump.sum(1) + mixed + 2 * first * second + second**2, 0))


def _distances(own):
    """From each of `own` to each sector: `(pieces, sectors, n)`; the sectors meet midway between the largest of them."""
    upper = np.where(own.imag >= 0, np.abs(own), -1.0)
    largest = np.argsort(-upper, axis=-1, kind="stable")[:, :SECTORS]
    chosen = np.where(np.take_along_axis(upper, largest, -1) < 0, -1, np.take_along_axis(own, largest, -1))
    angles = np.sort(np.angle(chosen))
    between = (angles[:, 1:] + angles[:, :-1]) / 2
    first = np.concatenate([np.zeros((len(own), 1)), between], -1)[..., None]
    last = np.concatenate([between, np.full((len(own), 1), np.pi)], -1)[..., None]
    z, angle = own[:, None], np.angle(own)[:, None]
    edge = np.minimum(np.abs(z - np.exp(1j * first)), np.abs(z - np.exp(1j * last)))
    return np.where((angle >= first) & (angle <= last) | (np.abs(z) >= 1), 1 - np.abs(z), edge)


def _dominant(off, away):
    """In which sectors weights d > 0 with `off d < away d` were found, `(pieces, sectors)`."""
    positive = (away > ROOM).all(-1)
    diagonal = np.where(positive[..., None], away, 1.0) * (1 - ROOM)
    matrix = diagonal[..., None] * np.eye(off.shape[-1]) - np.where(positive[..., None, None], off[:, None], 0.0)
    d = _solved(matrix)
    return positive & (d > 0).all(-1) & ((off[:, None] @ d[..., None])[..., 0] < diagonal * d).all(-1)


def _solved(matrix):
    """`matrix^-1 1`, or -1 where a matrix is singular."""
    ones = np.ones((*matrix.shape[:-1], 1))
    try:
        return np.linalg.solve(matrix, ones)[..., 0]
    except np.linalg.LinAlgError:
        regular = (np.linalg.slogdet(matrix)[0] != 0)[..., None]
        solved = np.linalg.solve(np.where(regular[..., None], matrix, np.eye(matrix.shape[-1])), ones)[..., 0]
        return np.where(regular, solved, -1.0)


def _costliest(off, away, moves, bends, rest):
    """The parameter that raises the spectral radius of the weighted bound most, to first order.

    Of each bend all those that have a part in it have the whole; of the rest, a part as of the bends.
    """
    i, j = np.triu_indices(moves.shape[1])
    bent = np.stack([bends[:, (i == k) | (j == k)].sum(1) for k in range(moves.shape[1])], axis=1)
    size = 1 / (np.maximum(away, 0) + 1e-3 * off.sum(-1) + 1e-300)
    bound = size[..., None] * (off + (moves + bent).sum(1) * np.eye(off.shape[-1]))
    right, left = np.ones((*bound.shape[:-1], 1)), np.ones((len(bound), 1, bound.shape[-1]))
    for _ in range(SWEEPS):
        right, left = bound @ right, left @ bound
        right, left = right / right.max(-2, keepdims=True), left / left.max(-1, keepdims=True)
    left = left * size[:, None]
    straight, curved = ((left[:, None] @ part @ right[:, None])[..., 0, 0] for part in (moves, bent))
    beyond = (left @ rest @ right)[..., 0] / np.maximum(curved.sum(-1, keepdims=True), 1e-300)
    gain = straight + curved * (1 + beyond)
    return np.argmax(np.where(np.isfinite(gain), gain, -1), axis=-1)
