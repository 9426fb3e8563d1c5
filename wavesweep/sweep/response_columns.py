"""Responses as the columns that tables show of them."""

import numpy as np

SPARED = 1e-6  # relative error up to which a row is vouched for


def parts_of(name: str, response) -> dict[str, np.ndarray]:
    """Columns `name_re`, `name_im`, `name_abs` (in the response's unit) and `name_deg`."""
    parts = {"re": response.real, "im": response.imag, "abs": np.abs(response), "deg": np.degrees(np.angle(response))}
    return {f"{name}_{part}": column for part, column in parts.items()}


def doubt_of(errors, stable, lost) -> np.ndarray:
    """The word of each row (see `DOUBTS`); errors: bounds on relative errors, NaN where a number is not known.

    An unstable loop has no steady response, whatever its digits are; one that overflows within a frame has no number.
    """
    rounded = ~np.logical_and.reduce([error <= SPARED for error in errors])
    words = np.where(lost, "overflow", np.where(stable, np.where(rounded, "rounding", ""), "unstable"))
    return np.broadcast_to(words, rounded.shape).astype(object)
