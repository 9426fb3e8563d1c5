"""The transfer functions of loops of one input as quotients of polynomials, from one orthogonal
reduction of each loop.

The loops are the last axis of the arrays here, along which a processor adds and multiplies many at
a time.
"""

from collections.abc import Sequence

import numpy as np

LOOPS_IN_CACHE = 512  # loops at once, for which the recurrence stays in a processor's cache


def even_units(E: np.ndarray) -> np.ndarray:
    """Return units of the states of loops `(loops, n, n)` in which the largest entries of each row and
    its column are alike, `(n, loops)`.

    They are powers of two, and rough: a fast relative of `balance`.
    """
    n = E.shape[-1]
    index = np.arange(n)
    units = np.zeros((n, len(E)), np.float32)
    with np.errstate(all="ignore"):
        size = np.log2(np.abs(np.moveaxis(E, 0, -1), dtype=np.float32))
        size[index, index] = -np.inf
        # Rounds towards units in which entries of a row and of a column are alike.
        for _ in range(5):
            now = size + (units - units[:, None])
            # Of what would make the largest of them equal, since every state takes its step at
            # once.
            step = 0.25 * (now.max(1) - now.max(0))
            units += np.where(np.isfinite(step), step, 0)
    return np.exp2(np.round(units).astype(float))


def in_units(units: np.ndarray, E: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return loops `(loops, n, n)`, `(loops, n, 1)`, `(loops, outputs, n)` in units of their states as
    one matrix [[B, E], [0, C]], `(n + outputs, n + 1, loops)`."""
    n = len(units)
    system = np.zeros((n + C.shape[-2], n + 1, len(E)))
    system[:n, :1] = np.moveaxis(B, 0, -1)
    system[:n, 1:] = np.moveaxis(E, 0, -1)
    system[n:, 1:] = np.moveaxis(C, 0, -1)
    system[:, 1:] *= units
    system[:n] /= units[:, None]
    return system


def reduced(system: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return loops [[B, E], [0, C]] in controller-Hessenberg form: H, C and the input's gain.

    H `(n, n, loops)`: upper Hessenberg; what is below its diagonal is 1, its entries above are
    multiplied by what was there. So is C, and the input acts on the first state alone, by the gain,
    `(loops,)`. Householder's reflections (C. C. Paige, IEEE Trans. Automat. Control 26, 1981).
    Accuracy: exact for matrices that differ from the given ones by some roundings of their largest
    entries.
    """
    if system.shape[-1] == 1:  # whose sums numpy would take in another order
        H, C, gain = reduced(np.repeat(system, 2, axis=-1))
        return H[..., :1], C[..., :1], gain[:1]
    n = system.shape[1] - 1
    system = system.copy()
    for k in range(n - 1):
        v = system[k:n, k].copy()
        size = np.sqrt((v * v).sum(0))
        v[0] += np.copysign(size, v[0])
        length = (v * v).sum(0)
        v *= np.sqrt(2 / np.where(length > 0, length, np.inf))
        right = system[k:n, k:]
        right -= v[:, None] * (v[:, None] * right).sum(0)
        below = system[:, k + 1 :]
        below -= (below * v).sum(1)[:, None] * v
    H = system[:n, 1:]
    C = system[n:, 1:]
    scale = np.zeros(H.shape)
    scale[-1, -1] = 1.0
    for k in range(n - 2, -1, -1):
        scale[k, k] = 1.0
        scale[k, k + 1 :] = H[k + 1, k] * scale[k + 1, k + 1 :]
    return H * scale, C * scale[0], system[0, 0]


def polynomials(form: Sequence[np.ndarray], w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pole polynomials `det(w I - E)`, `(loops, points)`, and with them `C (w I - E)^-1 B`
    times these, for each output.

    form: of `reduced`; w: `(loops, points)`. Hyman's recurrence.
    Accuracy: that of Hessenberg matrices each of whose entries differs by some roundings.
    """
    if len(w) > LOOPS_IN_CACHE:
        values = []
        for begin in range(0, len(w), LOOPS_IN_CACHE):
            batch = slice(begin, begin + LOOPS_IN_CACHE)
            part = [array[..., batch] for array in form]
            values.append(polynomials(part, w[batch]))
        poles, zeros = zip(*values, strict=True)
        return np.concatenate(poles), np.concatenate(zeros)
    H, C, gain = form
    n = len(H)
    H = np.ascontiguousarray(np.moveaxis(H, -1, 0))
    C = np.ascontiguousarray(np.moveaxis(gain * C, -1, 0))
    Q = np.empty((len(H), n, w.shape[-1]), complex)
    Q[:, -1] = 1.0
    pairs = Q.view(float)  # real and imaginary halves
    for k in range(n - 1, 0, -1):
        np.multiply(w, Q[:, k], out=Q[:, k - 1])
        pairs[:, k - 1] -= (H[:, k : k + 1, k:] @ pairs[:, k:])[:, 0]
    pole = w * Q[:, 0]
    pole.view(float)[...] -= (H[:, :1] @ pairs)[:, 0]
    return pole, (C @ pairs).view(complex)
