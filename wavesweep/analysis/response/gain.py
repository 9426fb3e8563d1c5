"""Worst-case gain: the largest singular value of the lifted response, without forming it tick by tick."""

import numpy as np

from wavesweep.analysis.response.direct import inverse_map, is_direct
from wavesweep.analysis.response.steady import Loop, frame_angle, held_response, held_share
from wavesweep.analysis.response.transfer import modal_response, solved_response
from wavesweep.lifted.circle import on_circle

DENSE = 32  # up to this ratio LAPACK's singular values of the whole matrix are the quicker way
STEPS = 40  # of the Lanczos process beyond; it stops earlier when nothing moves any more
REFERENCE = "frame.device.x"  # what the drawings without waves count positions from
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
        if is_direct(loop.diagram):
            parts.append(_largest_of_inverse(*inverse_map(loop, ticks[chunk], ratio)))
        else:
            parts.append(_largest(*_diagonal_and_mixture(loop, ticks[chunk], aliases[chunk])))
    gain = np.concatenate(parts, axis=-1)
    return np.where(at_slow_rate & _drifts(loop), np.nan, gain)


def _drifts(loop):
    """Whether nothing in the loop holds the position: then a constant force, aliased or not, moves it for ever."""
    if loop.diagram.ratio > 1 and loop.diagram.reference != REFERENCE and "x_s" not in loop.fast.block.inputs:
        return True
    return (np.asarray(loop.wall[0]) == 0)[..., None] & ~np.asarray(loop.diagram.held_by_spring)


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
        value = _lanczos(*_products(diagonal, left, right), np.abs(diagonal) + np.abs(right).sum(-2))
    return np.where(finite, value, np.nan)


def _largest_of_inverse(s, h, a):
    """Largest singular value of the inverse of `diag(s) + h a^T`."""
    if h is None:
        return 1 / np.abs(s).min(-1)
    if s.shape[-1] <= DENSE:
        matrix = h[..., :, None] * a[..., None, :]
        index = np.arange(s.shape[-1])
        matrix[..., index, index] += s
        return 1 / np.linalg.svd(matrix, compute_uv=False)[..., -1]
    return _lanczos(_solver(s, h, a), _solver(s.conj(), a.conj(), h.conj()), 1 / (np.abs(s) + np.abs(h * a)))


def _solver(s, h, a):
    """x of `diag(s) x + h (a^T x) = f`, the alias of least s by itself: a free device's answer to it cancels otherwise."""
    s, h, a = np.broadcast_arrays(s, h, a)
    least = np.argmin(np.abs(s), axis=-1)[..., None]
    others = np.ones(s.shape)
    np.put_along_axis(others, least, 0.0, axis=-1)
    weight = others * a / np.where(others > 0, s, 1)
    through = 1 + (weight * h).sum(-1, keepdims=True)
    s0, h0, a0 = (np.take_along_axis(part, least, axis=-1) for part in (s, h, a))

    def solve(f):
        seen = (weight * f).sum(-1, keepdims=True)
        x0 = (np.take_along_axis(f, least, axis=-1) * through - h0 * seen) / (s0 * through + h0 * a0)
        x = (f - h * ((a0 * x0 + seen) / through)) / np.where(others > 0, s, 1)
        np.put_along_axis(x, least, x0, axis=-1)
        return x

    return solve


def _products(diagonal, left, right):
    """Functions that multiply by `diag(d) + left right` and by its adjoint."""
    def forward(v):
        return diagonal * v + (left @ (right @ v[..., None]))[..., 0]

    def backward(u):
        inner = np.swapaxes(left.conj(), -1, -2) @ u[..., None]
        return diagonal.conj() * u + (np.swapaxes(right.conj(), -1, -2) @ inner)[..., 0]

    return forward, backward


def _lanczos(forward, backward, start):
    """Golub-Kahan-Lanczos with full reorthogonalisation, all points at once; start: where the gain is likely to be."""
    v, best = start + 0j, np.zeros(start.shape[:-1])
    basis, band = [], []
    for _ in range(min(STEPS, start.shape[-1])):
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
