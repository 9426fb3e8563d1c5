"""Arrays with the same first axis, and their different values."""

from dataclasses import fields

import numpy as np


def different(values: np.ndarray) -> np.ndarray:
    """The different values, sorted. `np.unique` alone would import numpy.ma, which takes a fiftieth of a small run."""
    return np.unique(values, return_counts=True)[0]


class Rows:
    """Base of dataclasses whose fields are arrays with the same first axis."""

    __slots__ = ()

    def take(self, index):
        """Return some of the rows in the given order; index: a mask, indices or a slice."""
        return type(self)(*(getattr(self, field.name)[index] for field in fields(self)))

    @classmethod
    def join(cls, parts):
        """Return the rows of several such values, one after the other."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))
