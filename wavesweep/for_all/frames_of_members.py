"""The frames of members of a box of numbers, all in one batch and in plain doubles: for
searches."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from wavesweep.engine.frames import MarginalModes, Ticks
from wavesweep.engine.switched import Symbol, counted_from_rest, shift_of


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """Members of a box, whose frames vary.

    at: from points `(points, numbers)` to the matrices of all symbols, `(symbols, points, n, n)`,
    in `states` states. symbols, follows: see `LoopFrames`.
    """

    at: Callable[[np.ndarray], np.ndarray]
    states: int
    symbols: Sequence[Symbol]
    follows: np.ndarray


def frames_of_ticks(
    ticks: Ticks, drift: MarginalModes, rows: Sequence[Sequence[int]], samples: Sequence[int]
) -> np.ndarray:
    """Return the matrices of all symbols without drift, `(symbols, points, n, n)`.

    ticks: of members in a batch. rows, samples: see `LoopFrames`.
    """
    E = np.stack(np.broadcast_arrays(*(tick.E for tick in ticks.maps)))
    nothing = np.zeros_like(E)
    V, _ = shift_of(E, nothing, drift)
    maps, _ = counted_from_rest(E, nothing, V, np.zeros_like(V), drift)
    maps = maps + np.eye(maps.shape[-1])
    with np.errstate(all="ignore"):
        return np.stack(
            [
                reduce(
                    lambda whole, kind: maps[kind] @ whole, (*row, sample), np.eye(maps.shape[-1])
                )
                for row, sample in zip(rows, samples, strict=True)
            ]
        )
