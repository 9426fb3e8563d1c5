"""Values that are several arrays over the same rows."""

from dataclasses import fields

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
