"""Loops of a sweep in groups that one drawing serves."""

from collections.abc import Iterator, Mapping

import numpy as np

from wavesweep.spec import Spec, find_key


def groups(
    spec: Spec, changes: Mapping[str, np.ndarray], size: int, resolved=None
) -> Iterator[tuple[np.ndarray, dict]]:
    """Yield (members, values): indices into the `size` loops, and flat values with arrays where these differ.

    changes: path -> value per loop. Loops of one group differ in floats only, and where one is zero, which may take a branch
    out of the drawing, all are. Whole numbers and keys that others derive from go through the
    spec, once per distinct combination; resolved: a dict that remembers these from call to call.
    """
    structural = {path: column for path, column in changes.items() if not is_plain(spec, path)}
    plain = {path: column for path, column in changes.items() if path not in structural}
    for members, settled in _by_structure(spec, structural, size, {} if resolved is None else resolved):
        zeros = [column[members] == 0 for column in plain.values()]
        for part in _distinct(zeros, members.size):
            index = members[part]
            yield index, {**settled, **{path: column[index] for path, column in plain.items()}}


def is_plain(spec, path) -> bool:
    """Whether an array of floats may stand in for the value of that key."""
    return not find_key(path).structural and isinstance(spec.values.get(path), float)


def _by_structure(spec, structural, size, resolved):
    for part in _distinct(list(structural.values()), size):
        first = {path: column[part[0]].item() for path, column in structural.items()}
        key = tuple(first.items())
        if key not in resolved:
            resolved[key] = dict((spec.with_values(first) if first else spec).values)
        yield part, resolved[key]


def _distinct(columns, size):
    """Indices of the rows that agree in all columns, in order of first appearance."""
    if not columns:
        return [np.arange(size)] if size else []
    _, label = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    label = label.reshape(-1)
    order = np.argsort(label, kind="stable")
    return sorted(np.split(order, np.flatnonzero(np.diff(label[order])) + 1), key=lambda part: part[0])
