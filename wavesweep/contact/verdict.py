"""Whether a spec's own wall may be any that pushes and never pulls."""

from __future__ import annotations

from wavesweep.contact.motions import motion_at
from wavesweep.contact.rows import FREE, LINEAR, wall_cut
from wavesweep.contact.stretches import Line
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.monodromy.cut import close
from wavesweep.engine.stability.spectrum import radius_of
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop


def verdict(spec: Spec) -> dict[str, str]:
    """What is known of the spec's own stiffness and damping, in words.

    verdict: "proved", "refuted" or "unknown"; counterexample: what refutes it, else empty.
    """
    wall = [float(spec.values[path]) for path in spec.wall]
    stiffness, damping = (*wall, 0.0)[:2]
    cut = wall_cut(own_loop(spec, spec.wall[0]))
    loop = WallLoop.of(cut) if cut else None
    if loop is None:
        return {"verdict": "unknown", "counterexample": ""}
    if loop.unstable:
        return {"verdict": "refuted", "counterexample": FREE}
    line = Line.of(WallsAlong(loop, 0, damping))
    if line.proved(stiffness, stiffness):
        return {"verdict": "proved", "counterexample": ""}
    if radius_of(close(cut, stiffness, damping)) > 1:
        return {"verdict": "refuted", "counterexample": LINEAR}
    motion = motion_at(line.walls, stiffness)
    found = str(motion) if motion else ""
    return {"verdict": "refuted" if found else "unknown", "counterexample": found}
