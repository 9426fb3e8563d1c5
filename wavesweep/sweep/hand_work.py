"""A chunk of guaranteed intervals: the piece of work that a worker does."""

from dataclasses import dataclass

import numpy as np

from wavesweep.diagram import WALL
from wavesweep.sweep.guarantees import Guarantee
from wavesweep.sweep.slices import Work


@dataclass(frozen=True, slots=True, eq=False)
class HandWork(Work):
    """Intervals of a guarantee, a loop and a wall at a time; each takes from tenths of a second to some seconds."""

    guarantee: Guarantee | None = None

    def records(self) -> np.ndarray:
        """Solve it; columns are numbered as those of `solve`."""
        walls = len(self.walls[WALL[0]])
        found = {}
        for members, values in self.groups:
            for place, loop in enumerate(members.tolist()):
                for wall in range(walls):
                    records = self.guarantee.records(self._values(values, place, wall), self.along, self.span)
                    records["column"] = column = loop * walls + wall
                    found[column] = records
        return np.concatenate([found[column] for column in sorted(found)])

    def _values(self, values, place, wall):
        """Flat keys, numbers, of one loop and wall."""
        own = {path: v[place].item() if np.ndim(v) else v for path, v in values.items()}
        return own | {path: column[wall].item() for path, column in self.walls.items()}
