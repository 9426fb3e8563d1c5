"""Whether a loop is stable where its wall is not touched."""

from __future__ import annotations

from contextlib import suppress
from itertools import islice, product
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.program.analyses.mode_in_the_way import SAME_EIGENVALUE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wavesweep.program.reading.axes import Axis
    from wavesweep.program.spec import Spec

LOOPS = 64  # of a sweep, that are looked at without their wall


def first_unstable_without_wall(
    spec: Spec, axes: Sequence[Axis] = ()
) -> tuple[tuple[Any, ...], float] | None:
    """The values of the axes of the first loop of a sweep that is unstable with its wall's numbers
    0, and its spectral radius per frame then; None if none of the first LOOPS loops is, or is known
    to be, or has a wall."""
    from wavesweep.engine.errors import IllPosedLoopError
    from wavesweep.engine.poles import radius_of
    from wavesweep.program.sweep.grid import drawn_groups, own_loop

    if not spec.wall:
        return None
    without_wall = dict.fromkeys(spec.wall, 0.0)
    paths = [axis.path for axis in axes]
    combinations = list(islice(product(*(axis.values for axis in axes)), LOOPS))
    columns = dict(zip(paths, map(np.array, zip(*combinations, strict=True)), strict=True))
    unstable = np.ones(len(combinations), bool)
    for members, loops in drawn_groups(spec, columns, len(combinations)):
        with suppress(IllPosedLoopError):  # then each loop is looked at by itself
            free = loops.read.changed(without_wall)
            # Also with drifts from frame to frame, which take longer to find.
            rough = radius_of(*free.frames_with_reliability(free.drift()))
            unstable[members] = rough > 1 + SAME_EIGENVALUE
    for index in np.flatnonzero(unstable).tolist():
        changes = dict(zip(paths, combinations[index], strict=True))
        loop = own_loop(spec.with_values(changes) if changes else spec)
        with suppress(IllPosedLoopError):
            radius = float(loop.changed(without_wall).radii()[0])
            if 1 + SAME_EIGENVALUE < radius < float("inf"):
                return combinations[index], radius
    return None


def radius_without_wall(spec: Spec) -> float | None:
    """The radius of the spec's own loop that `first_unstable_without_wall` gives."""
    unstable = first_unstable_without_wall(spec)
    return unstable and unstable[1]


def without_wall_in_words(radius: float) -> str:
    """That a loop is unstable where its wall is not touched."""
    return f"without its wall the loop is unstable: spectral radius {radius:.6g} per frame"
