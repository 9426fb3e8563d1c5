"""The steady response from one system that holds both the fast states at the hand's frequency and the frame's states."""

from dataclasses import replace

import numpy as np

from wavesweep.analysis.response.circle import Circle
from wavesweep.analysis.response.frame import Loop, shown
from wavesweep.analysis.response.ticks import entries_errors, holding
from wavesweep.lifted.circle import solve
from wavesweep.lifted.rounding import ROUNDING

CLOSE = 0.1  # by how much an inverse may be off for the error of what it gives to be bounded with it


def bordered(loop: Loop, points: Circle):
    """Return (displacement, force) at the hand's frequency, `(..., p, points)`, and bounds on their errors.

    Unknowns: the outputs o and the fast states Y at the hand's frequency w, and the frame's state X at its start. The equations
    are `w Y = E Y + B_h (sigma h) + B_f` (the tick's own equation), `M Y = r X + t h + s` (Y is X's component at w), and those
    of the slow states, with `h = H X`. Together they are equivalent to `(w - E) X = g`. If a mode of the fast side has an alias
    at w, it costs no digit of Y, even if it has little or no damping; neither does a mode at w itself.
    """
    A, dA, b, db, still, dstill = _system(loop, points)
    found, error = (part[..., 0] for part in solved(A, dA, b[..., None], db[..., None]))
    p = loop.outputs
    o, do = found[..., :p], error[..., :p]
    return np.swapaxes(o + still, -1, -2), np.swapaxes(do + dstill, -1, -2)


def _system(loop, points):
    """Return matrix, errors, right side and errors of the system, and the outputs' part from the drift, with its error."""
    fast, n, f, p, P = loop.fast, loop.E.shape[-1], len(loop.fast.states), loop.outputs, points.frequency.size
    (rows, drows), (alone, dalone), _, law = shown(loop, _showing_states(fast)).sums(points.ladder, alone=True)
    batch = loop.E.shape[:-2]
    A = np.zeros((*batch, P, p + f + n, p + f + n), complex)
    dA = np.zeros(A.shape)
    b, db = np.zeros((*batch, P, p + f + n), complex), np.zeros((*batch, P, p + f + n))
    out, own, sums, slow = slice(0, p), slice(p, p + f), slice(p + f, p + 2 * f), slice(p + 2 * f, None)
    Y, X = own, slice(p + f, None)
    w, z = points.tick[:, None, None], points.frame[:, None, None]
    dE, dB, dC, dD = entries_errors(fast)
    H, dH = loop.H, loop.dH
    shares = _shares(points, loop.diagram.delay)
    held = shares[0] * loop.latched + shares[1] * H[..., None, :, :]
    held_size = np.abs(shares[0]) * loop.latched + np.abs(shares[1]) * np.abs(H)[..., None, :, :]
    dheld = np.abs(shares[1]) * dH[..., None, :, :] + ROUNDING * held_size
    C, D, B = fast.C[..., :p, :], fast.D[..., :p, :], fast.B
    # what the outputs and the fast states are at the hand's frequency
    A[..., out, out] = np.eye(p)
    A[..., out, Y], A[..., out, X] = -C[..., None, :, :], -(D[..., None, :, 1:] @ held)
    dA[..., out, Y] = dC[..., None, :p, :]
    dA[..., out, X] = np.abs(D[..., None, :, 1:]) @ dheld + dD[..., None, :p, 1:] @ held_size
    b[..., out], db[..., out] = D[..., None, :, 0], dD[..., None, :p, 0]
    A[..., own, Y] = w * np.eye(f) - fast.E[..., None, :, :]
    A[..., own, X] = -(B[..., None, :, 1:] @ held)
    dA[..., own, Y] = dE[..., None, :, :]
    dA[..., own, X] = np.abs(B[..., None, :, 1:]) @ dheld + dB[..., None, :, 1:] @ held_size
    b[..., own], db[..., own] = B[..., None, :, 0], dB[..., None, :, 0]
    hand = loop.diagram.hand
    if hand.position in fast.states and fast.outputs[0] == hand.displacement:  # which is w times the position
        x = p + fast.states.index(hand.position)
        for array in (A, dA, b[..., None], db[..., None]):
            array[..., x, :] = 0
        A[..., x, x], A[..., x, 0] = points.tick, -1
    # the component at w of the fast states in the frame
    A[..., sums, Y] = points.ratio * np.eye(f)
    A[..., sums, X] = -rows.swapaxes(-3, -2)
    dA[..., sums, X] = drows[..., None, :, :]
    b[..., sums], db[..., sums] = np.swapaxes(alone, -1, -2), dalone[..., None, :, 0]
    # the slow states
    A[..., slow, X] = z * np.eye(n)[f:] - loop.rows[..., None, f:, :]
    dA[..., slow, X] = loop.drows[..., None, f:, :]
    return (A, dA, b, db, *_with_drift(loop, points, (A, b, db), (own, slow), law))


def _showing_states(fast):
    """Return the fast side with its states as outputs."""
    f = len(fast.states)
    C, D = np.eye(f) + 0 * fast.E[..., :1], 0 * fast.B
    return holding(replace(fast, outputs=fast.states, C=C, D=D, terms=fast.terms and (*fast.terms[:2], C, D)), f)


def _shares(points, delay):
    """Return the components at w of the old and of the new held signals, each `(points, 1, 1)`."""

    def constant(count):  # the sum of exp(-j w i) over `count` ticks
        angle = points.steps(count)
        return np.where(points.tick == 0, count, angle.conj() / np.where(points.tick == 0, 1, points.tick.conj()))

    parts = constant(delay), points.turn(delay).conj() * constant(points.ratio - delay)
    return [(part / points.ratio)[:, None, None] for part in parts]


def _with_drift(loop, points, system, places, law):
    """Add the effect of the drift to the system, and return its part of the outputs, with its error."""
    (A, b, db), (own, slow) = system, places
    f, p = len(loop.fast.states), loop.outputs
    at_own, at_slow = points.share[:, None] * loop.shift[..., None, :f], loop.shift[..., None, f:]
    if law is not None:
        q, dq = (np.swapaxes(part, -1, -2) for part in law)
        b[..., own] -= at_own * q
        b[..., slow] -= at_slow * q
        unsure = np.abs(loop.shift)[..., None, :] * dq + loop.dshift[..., None, :] * np.abs(q)
        db[..., own] += unsure[..., :f] / points.ratio
        db[..., slow] += unsure[..., f:]
        return tuple(np.swapaxes(part, -1, -2) for part in conserved_output(loop, points, law))
    if loop.lead is not None:
        lead = p + f + loop.lead
        # Where the scene's position is read, it is the unknown; where nothing reads it, its step is, which stays finite.
        step = np.where(loop.free[..., None], 1.0, points.frame)[..., None]
        A[..., own, lead] += step * at_own
        A[..., slow, lead] = step * at_slow - loop.rows[..., None, f:, loop.lead]
    return 0.0, 0.0


def conserved_output(loop, points, law):
    """Return the outputs' part at the hand's frequency from the conserved combination, `(..., p, points)`, and its error."""
    share = loop.still[..., None] * (points.share / points.tick)
    return share * law[0], np.abs(share) * (law[1] + 8 * ROUNDING * np.abs(law[0]))


def solved(A, dA, b, db):
    """Return `X` of `A X = b` `(..., n, k)` and a bound on its error, entry by entry; dA, db: bounds on the errors of A and b.

    Rows and columns are scaled to a largest entry of 1. The inverse and the solution are refined, which makes the backward
    error small in every entry (Skeel 1980); the bound is `|A^-1| (|residual| + dA |X| + db)`. The bound is infinite if the
    inverse is not accurate enough.
    """
    row, column = _scales(A)
    S = A * row[..., :, None] * column[..., None, :]
    unsure = dA * row[..., :, None] * column[..., None, :]
    b, db = b * row[..., None], db * row[..., None]
    inverse = _refined_inverse(S)
    X = inverse @ b
    for _ in range(2):
        X = X + inverse @ (b - S @ X)
    left = np.abs(b - S @ X) + (ROUNDING * np.abs(S) + unsure) @ np.abs(X) + ROUNDING * np.abs(b) + db
    off = np.abs(np.eye(A.shape[-1]) - inverse @ S).sum(-1).max(-1, initial=0)[..., None, None]
    return X * column[..., None], error_of(inverse, off, left) * column[..., None]


def inverted(A, dA) -> tuple[np.ndarray, np.ndarray]:
    """Return the inverse of `A` `(..., n, n)`, and how far it is off, `(..., 1, 1)`: the norm of `I - A^-1 A`.

    Rows and columns are scaled to a largest entry of 1 for it. dA: bound on the error of A as it is computed.
    """
    row, column = _scales(A)
    scales = row[..., :, None] * column[..., None, :]
    S = A * scales
    inverse = _refined_inverse(S)
    off = np.abs(np.eye(A.shape[-1]) - inverse @ S) + np.abs(inverse) @ (dA * scales)
    return inverse * np.swapaxes(scales, -1, -2), off.sum(-1).max(-1, initial=0)[..., None, None]


def _scales(A):
    """Factors of rows and of columns that give A a largest entry of 1 in each."""
    column = 1 / _largest(A, -2)
    row = 1 / _largest(A * column[..., None, :], -1)
    return row, column / _largest(A * row[..., :, None] * column[..., None, :], -2)


def _refined_inverse(S):
    """The inverse, refined, so that small rows of it are right as well, and bound small unknowns."""
    eye = np.eye(S.shape[-1])
    inverse = solve(S, np.broadcast_to(eye, S.shape))
    return inverse + inverse @ (eye - S @ inverse)


def error_of(inverse, off, left) -> np.ndarray:
    """Return a bound on the error of a solution whose residual and errors are at most `left`; infinite if off is too large."""
    return np.where(off <= CLOSE, np.abs(inverse) @ left * (1 + 2 * off), np.inf)


def _largest(A, axis):
    size = np.abs(A).max(axis, initial=0)
    return np.where(size > 0, size, 1)
