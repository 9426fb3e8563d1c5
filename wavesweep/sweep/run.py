"""What a sweep hands on: the table's columns and the facts of the run."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """columns: name -> array, in the table's order. facts: JSON-able, see `results`."""

    columns: Mapping[str, np.ndarray]
    facts: Mapping[str, object]


def facts_of(spec, methods, slices, timings, notices=()) -> dict:
    """The facts of a run over one spec: versions, the resolved spec and its digest, methods, counts, timings in s."""
    from wavesweep import __version__

    return {
        "schema_version": 1, "tool_version": __version__, "spec": spec.tables(), "spec_sha256": spec.sha256,
        "methods": dict(methods), "slices": dict(slices), "notices": list(notices),
        "timings": {name: round(seconds, 6) for name, seconds in timings.items()},
    }
