"""The benchmark's table: a row per measurement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from wavesweep.results import Field

FIELDS = (
    Field("part", "string", "", "stiffness, response, compile, slices, workers, start, profile or accuracy"),
    Field("problem", "string", "", "what is computed"),
    Field("method", "string", "", "how"),
    Field("setting", "string", "", "grid, tolerance, or what was varied"),
    Field("size", "number", "1", "columns, frequencies, ticks of a frame, filter order, or slices"),
    Field("seconds", "number", "s", "median run time"),
    Field("seconds_each", "number", "s", "run time per column or frequency"),
    Field("ratio", "number", "1", "run time over the yardstick's, median of pairs that were run in turn"),
    Field("yardstick", "string", "", "what the ratio is to"),
    Field("pairs", "number", "1", "number of such pairs"),
    Field("error_max", "number", "1", "largest relative error against 50 digits"),
    Field("error_median", "number", "1", "median relative error against 50 digits"),
    Field("found", "number", "1", "stable intervals found, each by exactly one"),
    Field("there", "number", "1", "stable intervals that there are"),
    Field("wrong", "number", "1", "columns with another number of intervals than there are"),
)

Row = Mapping[str, Any]


def columns_of(rows: Iterable[Row]) -> dict[str, np.ndarray]:
    """The rows as columns; what a row does not say is missing."""
    rows = list(rows)
    out = {}
    for field in FIELDS:
        if field.kind == "string":
            out[field.name] = np.array([row.get(field.name, "") for row in rows], dtype=object)
        else:
            out[field.name] = np.array([row.get(field.name, np.nan) for row in rows], dtype=float)
    return out
