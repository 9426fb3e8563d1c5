"""Whether a loop is stable where its wall is not touched."""

from __future__ import annotations

from contextlib import suppress
from itertools import islice, product
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.program.analyses.mode_in_the_way import SAME_EIGENVALUE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wavesweep.engine.loop import Loops
    from wavesweep.program.reading.axes import Axis
    from wavesweep.program.spec import Spec

LOOPS = 64  # of a sweep, that are looked at without their wall


def first_unstable_without_wall(
    spec: Spec, axes: Sequence[Axis]
) -> tuple[tuple[Any, ...], float] | None:
    """The values of the axes of the first loop of a sweep with a `radius_without_wall`, and that
    radius; None if the first LOOPS loops have none."""
    from wavesweep.engine.errors import IllPosedLoopError
    from wavesweep.program.sweep.grid import drawn_groups

    paths = [axis.path for axis in axes]
    combinations = list(islice(product(*(axis.values for axis in axes)), LOOPS))
    columns = dict(zip(paths, map(np.array, zip(*combinations, strict=True)), strict=True))
    unstable = np.ones(len(combinations), bool)
    for members, loops in drawn_groups(spec, columns, len(combinations)):
        with suppress(IllPosedLoopError):  # then each loop is looked at by itself
            unstable[members] = _is_unstable(_without_wall(loops.read, spec))
    for index in np.flatnonzero(unstable).tolist():
        values = combinations[index]
        changes = dict(zip(paths, values, strict=True))
        radius = radius_without_wall(spec.with_values(changes) if changes else spec)
        if radius:
            return values, radius
    return None


def radius_without_wall(spec: Spec) -> float | None:
    """The spectral radius per frame of the spec's loop with its wall's numbers 0, if it is unstable
    then; None if it is not, or not known to be, or has no wall."""
    from wavesweep.engine.errors import IllPosedLoopError
    from wavesweep.program.sweep.grid import own_loop

    if not spec.wall:
        return None
    loop = _without_wall(own_loop(spec), spec)
    try:
        if not _is_unstable(loop).all():
            return None
        radius = float(loop.radii()[0])
    except IllPosedLoopError:
        return None
    return radius if 1 + SAME_EIGENVALUE < radius < float("inf") else None


def _without_wall(loops: Loops, spec: Spec) -> Loops:
    """The loops with the numbers of the wall 0."""
    return loops.changed(dict.fromkeys(spec.wall, 0.0))


def _is_unstable(loops: Loops) -> np.ndarray:
    """Whether loops are unstable but for drifts from frame to frame, which take longer to find,
    `(...)`."""
    from wavesweep.engine.poles import radius_of

    return radius_of(*loops.frames_with_reliability(loops.drift())) > 1 + SAME_EIGENVALUE


def without_wall_in_words(radius: float) -> str:
    """That a loop is unstable where its wall is not touched."""
    return f"without its wall the loop is unstable: spectral radius {radius:.6g} per frame"
