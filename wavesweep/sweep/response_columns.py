"""A complex response as the four columns that tables show of it."""

import numpy as np


def parts_of(name: str, response) -> dict[str, np.ndarray]:
    """Columns `name_re`, `name_im`, `name_abs` (in the response's unit) and `name_deg`."""
    parts = {"re": response.real, "im": response.imag, "abs": np.abs(response), "deg": np.degrees(np.angle(response))}
    return {f"{name}_{part}": column for part, column in parts.items()}
