"""What a sweep hands on: the table's columns, at once or block by block, and the facts of the run."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """columns: name -> array, in the table's order. facts: JSON-able, see `results`."""

    columns: Columns
    facts: Mapping[str, object]


@dataclass(frozen=True, slots=True, eq=False)
class LongRun:
    """A run whose table need not fit into memory.

    axes: name -> values of each leading column. along: name of the axis that the intervals lie on. blocks: gives the
    columns in blocks of consecutive rows, as often as it is called. facts: as for `Run`. forget: removes what the rows
    are made from, once they are safe elsewhere. extra: names of columns that not every table of its kind has.
    """

    axes: Mapping[str, tuple[float, ...]]
    along: str
    blocks: Callable[[], Iterator[Columns]]
    facts: Mapping[str, object]
    forget: Callable[[], None]
    extra: tuple[str, ...] = ()

    @property
    def columns(self) -> Columns:
        """The whole table."""
        return joined(self.blocks())


def joined(blocks: Iterable[Columns]) -> Columns:
    """Blocks of rows as one table."""
    parts = list(blocks)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def facts_of(spec, methods, slices, timings, notices=()) -> dict:
    """The facts of a run over one spec: versions, the resolved spec and its digest, methods, counts, timings in s."""
    from wavesweep import __version__

    return {
        "schema_version": 1, "tool_version": __version__, "spec": spec.tables(), "spec_sha256": spec.sha256,
        "methods": dict(methods), "slices": dict(slices), "notices": list(notices),
        "timings": {name: round(seconds, 6) for name, seconds in timings.items()},
    }
