"""The modes of a single loop, and the states that take part in each."""

from typing import NamedTuple

import numpy as np

from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.unit_circle import inverse
from wavesweep.engine._stability.spectrum import BOUNDED_STATES, NEIGHBOURHOOD, states_of_blocks

INVERTED_MODES = 1e-8  # of the identity, by which eigenvectors times their inverse may miss it


class Modes(NamedTuple):
    """Eigenvalues less 1 of a frame, `(modes,)`, and the share of each state in each mode,
    `(modes, states)`, from 0 to 1."""

    delta: np.ndarray
    shares: np.ndarray


def modes_of(E: np.ndarray) -> Modes:
    """Return the modes of `I + E`, `(n, n)`, those that decay most slowly or grow most first; none
    if E is not finite.

    The share of a state is the size of its participation factor, the product of its entries in the
    right and in the left eigenvector (I. J. Perez-Arriaga, G. C. Verghese, F. C. Schweppe, IEEE
    Trans. Power Apparatus and Systems 101, 1982), over the sum of these: it does not depend on the
    units of the states. Loops of which one acts on another, but none on itself by way of others,
    have their own modes. Accuracy: eigenvalues as `eigenvalues` has them; shares to rounding, but
    of eigenvalues that nearly meet.
    """
    n = E.shape[-1]
    if not np.isfinite(E).all():
        return Modes(np.zeros(0, complex), np.zeros((0, n)))
    delta = np.zeros(n, complex)
    shares = np.zeros((n, n))
    first = 0
    for block in states_of_blocks(E):
        values, right = np.linalg.eig(E[np.ix_(block, block)])
        left = _left_eigenvectors(right)
        participation = np.abs(right.T * left)
        delta[first : first + block.size] = values
        shares[first : first + block.size, block] = participation / participation.sum(
            1, keepdims=True
        )
        first += block.size
    order = np.lexsort((-delta.imag, -np.round(np.abs(1 + delta), 12)))
    return Modes(delta[order], shares[order])


def _left_eigenvectors(right: np.ndarray) -> np.ndarray:
    """Return the inverse of the right eigenvectors, or what is nearest to it: of a double
    eigenvalue there is none."""
    if len(right) >= BOUNDED_STATES:
        left_vectors = inverse(right)  # in a tenth of the time
        if np.abs(left_vectors @ right - np.eye(len(right))).max() < INVERTED_MODES:
            return left_vectors
    return np.linalg.pinv(right)


def named_modes(
    E: np.ndarray, drawn: MultirateLoop, drift: MarginalModes
) -> tuple[list[str], Modes]:
    """Return the names of the states of a loop, without those of its drift, and their modes; see
    `modes_of`."""
    labels = drawn.labels()
    order = len(drift.remaining)
    return [labels[drift.states[index]] for index in drift.remaining], modes_of(E[:order, :order])


def certain_modes(delta: np.ndarray, *, clear: bool) -> np.ndarray:
    """Return whether rounding cannot take each mode across the unit circle; clear: it can take
    none of them."""
    near = np.abs(np.abs(1 + delta) - 1) <= NEIGHBOURHOOD
    return np.full(delta.shape, clear) | ~(near | ~near.any())
