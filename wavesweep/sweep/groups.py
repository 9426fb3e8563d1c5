"""Loops of a sweep in groups that one drawing serves."""

from collections.abc import Iterator, Mapping

import numpy as np

from wavesweep.diagram import ZERO_MATTERS
from wavesweep.spec import Spec, find_key


def groups(spec: Spec, changes: Mapping[str, np.ndarray], size: int, decides=()) -> Iterator[tuple[np.ndarray, dict]]:
    """Yield (members, values): indices into the `size` loops, and flat values with arrays where these differ.

    changes: path -> value per loop. Loops of one group differ in floats only, and where zero decides the drawing they are
    zero together; decides: further paths whose zero does. Whole numbers and keys that others derive from go through the spec, once per distinct combination.
    """
    structural = {path: column for path, column in changes.items() if not _is_plain(spec, path)}
    plain = {path: column for path, column in changes.items() if path not in structural}
    for members, settled in _by_structure(spec, structural, size):
        zeros = [plain[path][members] == 0 for path in (*ZERO_MATTERS, *decides) if path in plain]
        for part in _distinct(zeros, members.size):
            index = members[part]
            yield index, {**settled.values, **{path: column[index] for path, column in plain.items()}}


def _is_plain(spec, path):
    return not find_key(path).structural and isinstance(spec.values.get(path), float)


def _by_structure(spec, structural, size):
    for part in _distinct(list(structural.values()), size):
        first = {path: column[part[0]].item() for path, column in structural.items()}
        yield part, spec.with_values(first) if first else spec


def _distinct(columns, size):
    """Indices of the rows that agree in all columns, in order of first appearance."""
    if not columns:
        return [np.arange(size)] if size else []
    _, label = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    label = label.reshape(-1)
    order = np.argsort(label, kind="stable")
    return sorted(np.split(order, np.flatnonzero(np.diff(label[order])) + 1), key=lambda part: part[0])
