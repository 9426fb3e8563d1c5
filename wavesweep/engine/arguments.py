"""Arguments of library calls: numbers and switches."""

from numbers import Real
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError


def real_numbers(values: Any) -> np.ndarray | None:
    """Return a number, or nested lists or an array of numbers, as an array; None if an item is not a real number.

    Texts, booleans and masked numbers are refused, since their meaning is uncertain. Numbers
    without an array type, such as fractions, become doubles.
    """
    try:
        array = np.asarray(values)
        items = (
            ()
            if hasattr(values, "dtype") and array.dtype != object
            else np.asarray(values, dtype=object).ravel()
        )
        if array.dtype == object and all(isinstance(item, Real) for item in items):
            array = array.astype(float)
    except (
        ValueError,
        OverflowError,
    ):  # lists of unlike lengths; a whole number beyond all doubles
        return None
    unsure = np.ma.is_masked(values) or any(isinstance(item, (bool, np.bool_)) for item in items)
    return array if array.dtype.kind in "iuf" and not unsure else None


def boolean(name: str, value: object) -> bool:
    """Return a switch of a call; UsageError for anything but True and False: the text "no" would be true."""
    if not isinstance(value, (bool, np.bool_)):
        raise UsageError(f"{name}: expected True or False, found {value!r:.60}")
    return bool(value)
