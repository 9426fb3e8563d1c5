"""Values that are several arrays over the same rows, the columns of complex numbers, and numbers that a call gives."""

from dataclasses import fields
from numbers import Real

import numpy as np


class Rows:
    """Base of dataclasses whose fields are arrays with the same first axis."""

    __slots__ = ()

    def take(self, index):
        """Return some of the rows in the given order; index: a mask, indices or a slice."""
        return type(self)(*(getattr(self, field.name)[index] for field in fields(self)))

    @classmethod
    def join(cls, parts):
        """Return the rows of several such values, one after the other."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


def complex_columns(name: str, values) -> dict[str, np.ndarray]:
    """Return the columns `name_re`, `name_im`, `name_abs` (in the unit of the values) and `name_deg` of complex numbers.

    A number that is not known, or beyond double precision, is NaN in all four.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        known = np.where(np.isfinite(np.abs(values)), values, complex(np.nan, np.nan))
        parts = {"re": known.real, "im": known.imag, "abs": np.abs(known), "deg": np.degrees(np.angle(known))}
    return {f"{name}_{part}": column for part, column in parts.items()}


def real_numbers(values) -> np.ndarray | None:
    """Return a number, or nested lists or an array of numbers, as an array; None if some are no real numbers.

    Texts, booleans and masked numbers are none, since it is not certain what they mean. Numbers that no array has a type for,
    such as fractions, become doubles.
    """
    try:
        found = np.asarray(values)
        each = () if hasattr(values, "dtype") and found.dtype != object else np.asarray(values, dtype=object).ravel()
        if found.dtype == object and all(isinstance(item, Real) for item in each):
            found = found.astype(float)
    except (ValueError, OverflowError):  # lists of unlike lengths; a whole number beyond all doubles
        return None
    unsure = np.ma.is_masked(values) or any(isinstance(item, (bool, np.bool_)) for item in each)
    return found if found.dtype.kind in "iuf" and not unsure else None
