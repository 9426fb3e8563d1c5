"""The solution of a loop of direct terms."""

from collections.abc import Sequence

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError

# condition number of an algebraic loop, without unit; beyond it fewer than 4 digits remain
WORST_CONDITION = 1e12


def loop_inverse(
    loop: np.ndarray, sizes: np.ndarray, reached: np.ndarray, name: str, ports: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inverse of the return difference `L = 1 - loop` of torn ports, its condition
    number and its determinant.

    sizes: of the terms that the loop's entries are sums of. reached: entries of the inverse that
    are not zero by structure. Errors: IllPosedLoopError if the condition number shows that the loop
    is ill-posed. The number is that of the best units, the spectral radius of |L^-1| |L| (Bauer
    1963), of which the 8th root of the norm of the 8th power is a bound that is larger by a small
    factor: a wave impedance of 1e-9 makes entries of very different sizes and no ill-posed loop.
    """
    identity = np.eye(len(reached))
    difference = identity - loop
    # a frame that overflows is for the caller to see
    overflown = ~np.isfinite(difference).all((-1, -2))
    with np.errstate(all="ignore"):
        if len(reached) == 1:
            inverse = 1 / difference
            determinant = difference[..., 0, 0]
        else:
            inverse = _refined_inverse(difference, overflown)
            determinant = np.linalg.det(difference)
        inverse[..., ~reached] = 0.0
        power = np.abs(inverse) @ (identity + sizes)
        exponent = 1
        if len(reached) > 1:
            for _ in range(3):
                power = power @ power
                exponent = 2 * exponent
        condition = power.sum(-1).max(-1, initial=0) ** (1 / exponent)
        condition = np.where(np.isnan(condition), np.inf, condition)
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition, determinant


def _refined_inverse(difference: np.ndarray, overflown: np.ndarray) -> np.ndarray:
    """The inverse with two steps of Newton's, since small entries have lost their digits;
    infinite if one of the batch is singular."""
    try:
        inverse = np.linalg.inv(np.where(overflown[..., None, None], np.nan, difference))
    except np.linalg.LinAlgError:
        inverse = np.full_like(difference, np.inf)
    for _ in range(2):
        inverse = inverse + inverse @ (np.eye(difference.shape[-1]) - difference @ inverse)
    return inverse
