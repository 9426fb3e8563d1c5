"""Arrays with the same first axis, and their different values."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np


def different(values: np.ndarray) -> np.ndarray:
    """The different values, sorted. `np.unique` alone would import numpy.ma, which takes a fiftieth of a small run."""
    return np.unique(values, return_counts=True)[0]


@dataclass(frozen=True, slots=True)
class Rows:
    """Base of dataclasses whose fields are arrays with the same first axis."""

    def take(self, index: Any) -> Self:
        """Return some of the rows in the given order; index: a mask, indices or a slice."""
        return type(self)(*(getattr(self, field.name)[index] for field in fields(self)))

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of several such values, one after the other."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(rows, field.name) for rows in parts]) for field in fields(cls)))
