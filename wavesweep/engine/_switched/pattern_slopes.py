"""How the growth of a pattern changes with each of its matrices.

With the product `Q A P` of a pattern, an eigenvalue z of it and the vectors x and y of that, `y' x =
1`, it is `dz = y' Q dA P x`: what a climb over patterns goes by.
"""

from collections.abc import Callable, Sequence

import numpy as np


def largest_modes(
    products: np.ndarray, size: Callable[[np.ndarray], np.ndarray] = np.abs
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of each of some products P `(patterns, n, n)` the eigenvalue z whose size is largest,
    `(patterns,)`, and its vectors x and y, `(patterns, n)`: `P x = z x`, `y P = z y`, `y x = 1`."""
    z, vectors = np.linalg.eig(products)
    largest = size(z).argmax(-1)
    index = np.arange(len(z))
    with np.errstate(all="ignore"):
        try:
            inverse = np.linalg.inv(vectors)
        except np.linalg.LinAlgError:
            inverse = np.linalg.pinv(vectors)
    return z[index, largest], vectors[index, :, largest], inverse[index, largest]


def slopes_of(
    choices: Sequence[np.ndarray],
    chosen: Sequence[np.ndarray],
    modes: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> list[np.ndarray]:
    """Return of each step of some patterns `y' Q A P x / z` for each matrix A that it may have,
    `(patterns, choices)`, NaN where z is 0.

    choices: of each step the matrices that it may have, `(choices, n, n)`; chosen: those of the
    patterns, `(patterns, n, n)`. modes: z, x and y, see `largest_modes`.
    """
    z, x, y = modes
    states = [x]
    for A in chosen[:-1]:
        states.append((A @ states[-1][..., None])[..., 0])
    slopes = []
    with np.errstate(all="ignore"):
        for of_step, A, state in zip(choices[::-1], chosen[::-1], states[::-1], strict=True):
            # As one matrix: of many small ones each product costs more than its numbers.
            moved = (of_step.reshape(-1, of_step.shape[-1]) @ state.T).reshape(
                *of_step.shape[:2], -1
            )
            slopes.append(np.real((moved * y.T).sum(1) / z).T)
            y = (y[:, None] @ A)[:, 0]
    return slopes[::-1]
