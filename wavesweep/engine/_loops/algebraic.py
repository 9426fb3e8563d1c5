"""The solution of a loop of direct terms."""

from collections.abc import Sequence

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError

WORST_CONDITION = 1e12  # a closed loop beyond it keeps fewer than 4 digits


def loop_inverse(
    loop: np.ndarray, sizes: np.ndarray, reached: np.ndarray, name: str, ports: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inverse of the return difference of torn ports, its condition number and its
    determinant.

    sizes: of the terms that the loop's entries are sums of. reached: entries of the inverse that
    are not zero by structure. Errors: IllPosedLoopError if the condition number shows that the loop
    is ill-posed. The number is that of the best units, the spectral radius of |L^-1| |L| (Bauer
    1963), which the norm of a power overestimates by a small factor: a wave impedance of 1e-9 makes
    entries of very different sizes and no ill-posed loop.
    """
    identity, several = np.eye(len(reached)), len(reached) > 1
    loop = identity - loop
    overflown = ~np.isfinite(loop).all((-1, -2))  # a frame that overflows is for the caller to see
    with np.errstate(all="ignore"):
        try:
            inverse = (
                np.linalg.inv(np.where(overflown[..., None, None], np.nan, loop))
                if several
                else 1 / loop
            )
        except np.linalg.LinAlgError:
            inverse = np.full_like(loop, np.inf)
        for _ in range(2 if several else 0):  # refined: small entries have lost their digits
            inverse = inverse + inverse @ (identity - loop @ inverse)
        inverse[..., ~reached] = 0.0
        power = np.abs(inverse) @ (identity + sizes)
        for _ in range(3 if several else 0):
            power = power @ power
        condition = power.sum(-1).max(-1, initial=0) ** (1 / 8 if several else 1)
        condition, pivot = (
            np.where(np.isnan(condition), np.inf, condition),
            np.linalg.det(loop) if several else loop[..., 0, 0],
        )
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition, pivot
