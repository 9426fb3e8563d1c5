"""Worst-case gain: the largest singular value of the lifted response, without forming it tick by tick."""

import numpy as np

from wavesweep.analysis.response.steady import Loop, frame_angle, held_response, held_share
from wavesweep.analysis.response.transfer import modal_response, solved_response
from wavesweep.lifted.circle import on_circle

DENSE = 32  # up to this ratio LAPACK's singular values of the whole matrix are the quicker way
STEPS = 40  # of the Lanczos process beyond; it stops earlier when nothing moves any more
ASIDE = 1e-6  # cycles per frame
BLOCK = 4_000_000  # entries of one batch of matrices


def worst_gain(loop: Loop, frequency_hz, ratio: int) -> np.ndarray:
    """Largest singular value (m/N) of the lifted map from the frame's hand forces to its positions, `(..., points)`.

    ratio: ticks in a frame. In the unitary basis of the aliases `w + 2 pi m/T_s` the map is a diagonal (the fast way of
    each alias) plus a matrix of rank one or two (the way over the slow side, which mixes them), so a product with it costs
    O(ratio). NaN where it is unbounded, at multiples of the slow rate when the position may drift.
    Accuracy: 1e-9 relative, less where a position that no spring holds makes diagonal and mixture cancel.
    """
    ticks = np.asarray(frequency_hz, float) * loop.diagram.period
    at_slow_rate = frame_angle(ticks, ratio) == 0
    # One alias is then a constant force, whose own way to the position is infinite although the loop's is not. The gain
    # is even about that frequency: a small step aside costs its square.
    ticks = np.where(at_slow_rate, ticks + ASIDE / ratio, ticks)
    aliases = ticks[:, None] + np.arange(ratio) / ratio
    parts = []
    width = max(1, BLOCK // ratio**2) if ratio <= DENSE else max(1, BLOCK // (8 * ratio))
    for start in range(0, ticks.size, width):
        chunk = slice(start, start + width)
        parts.append(_largest(*_diagonal_and_mixture(loop, ticks[chunk], aliases[chunk])))
    gain = np.concatenate(parts, axis=-1)
    return np.where(at_slow_rate & _drifts(loop), np.nan, gain)


def _drifts(loop):
    """Whether nothing in the loop holds the position: then a constant force, aliased or not, moves it for ever."""
    has_waves = loop.diagram.reference != "frame.device.x"
    return has_waves and "x_s" not in loop.fast.block.inputs and loop.diagram.ratio > 1


def _diagonal_and_mixture(loop, ticks, aliases):
    """d `(..., points, M)`, left `(..., points, M, held)` and right `(..., points, held, M)` of `diag(d) + left right`."""
    ratio = aliases.shape[-1]
    w = on_circle(2 * np.pi * (aliases - np.round(aliases)))
    respond = modal_response if _modes_hold(loop, w) else solved_response
    fast = respond(loop.fast, w.reshape(-1))[0]
    fast = fast.reshape(*fast.shape[:-3], *aliases.shape, *fast.shape[-2:])
    with np.errstate(divide="ignore", invalid="ignore"):
        diagonal = fast[..., 0, 0] / w
        if loop.diagram.ratio == 1:  # no slow side: every alias keeps to itself, over the held wall force
            held = held_response(loop, 2 * np.pi * aliases.reshape(-1), respond)[0]
            held = held.reshape(*held.shape[:-3], *aliases.shape, *held.shape[-2:])
            share = held_share(aliases, loop.diagram)
            return diagonal + (fast[..., :1, 1:] @ held @ fast[..., 2:, :1])[..., 0, 0] * share / w, None, None
        held = held_response(loop, frame_angle(ticks, ratio), solved_response)[0]
        left = fast[..., 0, 1:] * (held_share(aliases, loop.diagram) / w)[..., None]
        right = held @ np.swapaxes(fast[..., 2:, 0], -1, -2)
    return diagonal, left, right


def _modes_hold(loop, w):
    """Whether the modal form is good enough for every alias (see `steady_state`)."""
    probe = np.unique(np.linspace(0, w.size - 1, 16).astype(int))
    points = w.reshape(-1)[probe]
    if np.any(points == 0):
        return False
    found, exact = modal_response(loop.fast, points)[0], solved_response(loop.fast, points)[0]
    return bool(np.all(np.abs(found - exact)[..., 0, :] <= 1e-10 * np.abs(exact[..., 0, :]).max(-1, keepdims=True)))


def _largest(diagonal, left, right):
    """Largest singular value of `diag(d) + left right`; NaN where an entry is not finite."""
    if left is None:
        return np.abs(diagonal).max(-1)
    finite = np.isfinite(diagonal).all(-1) & np.isfinite(left).all((-1, -2)) & np.isfinite(right).all((-1, -2))
    diagonal = np.where(finite[..., None], diagonal, 0)
    left, right = (np.where(finite[..., None, None], part, 0) for part in (left, right))
    if diagonal.shape[-1] <= DENSE:
        matrix = left @ right
        index = np.arange(diagonal.shape[-1])
        matrix[..., index, index] += diagonal
        value = np.linalg.svd(matrix, compute_uv=False)[..., 0]
    else:
        value = _lanczos(diagonal, left, right)
    return np.where(finite, value, np.nan)


def _lanczos(diagonal, left, right):
    """Golub-Kahan-Lanczos on `diag(d) + left right` with full reorthogonalisation, all points at once."""
    def forward(v):
        return diagonal * v + (left @ (right @ v[..., None]))[..., 0]

    def backward(u):
        inner = np.swapaxes(left.conj(), -1, -2) @ u[..., None]
        return diagonal.conj() * u + (np.swapaxes(right.conj(), -1, -2) @ inner)[..., 0]

    v = np.abs(diagonal) + np.abs(right).sum(-2) + 0j  # leans to where the gain is
    basis, band, best = [], [], np.zeros(diagonal.shape[:-1])
    for _ in range(min(STEPS, diagonal.shape[-1])):
        v = v / _norm(v)
        basis.append(v)
        band.append(forward(v))
        span = np.stack(band, axis=-1)
        value = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(span.conj(), -1, -2) @ span)[..., -1], 0))
        if np.all(np.abs(value - best) <= 1e-13 * value):
            break
        best = value
        v = backward(band[-1])
        for known in basis * 2:
            v = v - known * (known.conj() * v).sum(-1, keepdims=True)
    return value


def _norm(v):
    size = np.sqrt((np.abs(v) ** 2).sum(-1, keepdims=True))
    return np.where(size > 0, size, 1)
