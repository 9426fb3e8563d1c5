"""Arrays with the same first axis: rows, their different values, and which of them are alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np


def different(values: np.ndarray) -> np.ndarray:
    """The different values, sorted.

    `np.unique` alone would import numpy.ma, which takes a fiftieth of a small run.
    """
    return np.unique(values, return_counts=True)[0]


@dataclass(frozen=True, slots=True)
class Rows:
    """Base of dataclasses whose fields are arrays with the same first axis."""

    def take(self, index: Any) -> Self:
        """Return some of the rows in the given order; index: a mask, indices or a slice."""
        return type(self)(*(getattr(self, field.name)[index] for field in fields(self)))

    def with_others(self, index: np.ndarray, others: Self) -> Self:
        """Return the rows with others in place of some of them."""
        place = np.arange(len(getattr(self, fields(self)[0].name)))
        place[index] = place.size + np.arange(index.size)
        return self.join([self, others]).take(place)

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of several such values, one after the other."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            *(
                np.concatenate([getattr(rows, field.name) for rows in parts])
                for field in fields(cls)
            )
        )


def distinct(columns: Sequence[np.ndarray], size: int) -> list[np.ndarray]:
    """Indices of the rows that agree in all columns, in order of first appearance."""
    if not size:
        return []
    varied = [alike for column in columns if not (alike := column == column[0]).all()]
    if not varied:
        return [np.arange(size)]
    if len(varied) == 1 and all(column.dtype == bool for column in columns):
        return [np.flatnonzero(varied[0]), np.flatnonzero(~varied[0])]
    label = distinct_rows(dict(enumerate(columns)), size)[1]
    order = np.argsort(label, kind="stable")
    return sorted(
        np.split(order, np.flatnonzero(np.diff(label[order])) + 1), key=lambda part: part[0]
    )


def distinct_rows(columns: Mapping[Any, np.ndarray], size: int) -> tuple[np.ndarray, np.ndarray]:
    """The first of each distinct row of `size` rows, in the order of their values, and the number
    of its distinct row for each.

    columns: arrays `(size,)` of numbers; none: all rows are the same. Of every run of equal rows
    the first is looked at: many neighbours of a sweep have the same loop.
    """
    begins = np.append(True, np.zeros(size - 1, bool))
    for column in columns.values():
        begins[1:] |= column[1:] != column[:-1]
    starts = np.flatnonzero(begins)
    label = np.zeros(starts.size, int)
    for column in columns.values():
        values, place = np.unique(column[starts], return_inverse=True)
        label = np.unique(label * values.size + place, return_inverse=True)[1]
    first = np.unique(label, return_index=True)[1]
    return starts[first], np.repeat(label, np.diff(starts, append=size))


def of_each(facts: np.ndarray, index: np.ndarray) -> np.ndarray:
    """The fact with its own index of each row, `(rows,)`; facts: `(rows, n)`."""
    return np.take_along_axis(facts, index[:, None], 1)[:, 0]


def items_of(values: Mapping[str, object]) -> tuple[tuple[str, Any], ...]:
    """The pairs of flat values, by which a loop is remembered; arrays of one as tuples."""
    return tuple(
        (path, _as_tuples(value.tolist()) if isinstance(value, np.ndarray) else value)
        for path, value in values.items()
    )


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def selected(values: Mapping[str, Any], part: Any) -> dict[str, Any]:
    """The flat values of some of the loops; part: an index, a slice or an array of indices."""
    return {path: v[part] if np.ndim(v) else v for path, v in values.items()}
