"""The hand's port of a batch of loops: a piece of work for a worker."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity import port_margin

PORT = np.dtype([
    ("column", "<i8"), ("port_margin", "<f8"), ("port_omega", "<f8"), ("port_passive", "?"), ("certified", "?"),
])  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class PortWork:
    """Loops of one drawing; column: their numbers, values: flat keys, arrays over them where they differ."""

    column: np.ndarray
    values: Mapping[str, object]

    def first(self, count: int) -> "PortWork":
        """The same for the first few loops."""
        return PortWork(self.column[:count], {path: v[:count] if np.ndim(v) else v for path, v in self.values.items()})

    def records(self) -> np.ndarray:
        """Compute it; a record per loop."""
        found = port_margin(self.values)
        records = np.empty(self.column.size, PORT)
        records["column"], records["port_margin"], records["port_omega"] = self.column, found.margin, found.omega
        # A loop that keeps no digit has no margin, and with it no frequency of one.
        records["port_omega"][np.isnan(records["port_margin"])] = np.nan
        records["port_passive"], records["certified"] = found.passive, found.certified
        return records
