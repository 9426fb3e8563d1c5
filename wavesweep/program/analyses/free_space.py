"""Whether a loop is stable where its wall is not touched."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.program.analyses.mode_in_the_way import SAME_EIGENVALUE

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def radius_without_wall(spec: Spec) -> float | None:
    """The spectral radius per frame of the spec's loop with its wall's numbers 0, if it is unstable
    then; None if it is not, or not known to be, or has no wall."""
    from wavesweep.engine.errors import IllPosedLoopError
    from wavesweep.engine.poles import radius_of
    from wavesweep.program.sweep.grid import own_loop

    if not spec.wall:
        return None
    loop = own_loop(spec).changed(dict.fromkeys(spec.wall, 0.0))
    try:
        rough = radius_of(*loop.frames_with_reliability(loop.drift()))
        if not (
            rough > 1 + SAME_EIGENVALUE
        ).all():  # also with drifts from frame to frame, which take longer to find
            return None
        radius = float(loop.radii()[0])
    except IllPosedLoopError:
        return None
    return radius if 1 + SAME_EIGENVALUE < radius < float("inf") else None


def without_wall_in_words(radius: float) -> str:
    """That a loop is unstable where its wall is not touched."""
    return f"without its wall the loop is unstable: spectral radius {radius:.6g} per frame"
