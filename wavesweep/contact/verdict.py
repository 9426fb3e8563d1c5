"""Whether a spec's own wall, and each of its saturations, may be any function with slopes from 0
to 1."""

from __future__ import annotations

from typing import Any

from wavesweep.capabilities import offered
from wavesweep.contact.motions import motion_at
from wavesweep.contact.rows import LINEAR, constant_members, of_member, wall_cut
from wavesweep.contact.rows_in_frames import verdict_in_frames
from wavesweep.contact.stretches import Line
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.drawing import GAIN, Drawing
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import LinearFractional, open_loops
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import radius_of
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import loops_of, own_loop

SATURATION = "saturation"  # the type of block
WITHIN = "no limit, the loop within its limits"
OPEN = "its output held, the loop that is open there"


def saturations(drawing: Drawing | None) -> list[str]:
    """The names of the blocks of a drawing that saturate and do nothing else."""
    if drawing:
        return [block.name for block in drawing.blocks if block.type == SATURATION]
    return []


def refuse(spec: Spec) -> None:
    """Raise UsageError if the spec has neither a wall nor a saturation."""
    if not spec.wall and not saturations(spec.drawing):
        expected = (
            "wall = { stiffness = ..., damping = ... } in [ports], or a block of type saturation"
        )
        raise UsageError(f"[for_all] contact: expected {expected}, found neither")


def of_wall(spec: Spec, rules: Any = None) -> dict[str, str]:
    """What is known of the spec's own stiffness and damping, in words.

    rules: of frames that vary, and of values of numbers, if there are any. verdict: "proved",
    "refuted" or "unknown"; counterexample: what refutes it, else empty.
    """
    own = loops_of(spec, dict(spec.values), spec.wall[0])
    if not rules:
        return _with_wall(own, spec)
    found = []
    for member, loop in constant_members(rules, own):
        found.append((member, _with_wall(loop, spec)))
    if not found:
        asked = offered("rules")
        for case in asked.cases_of(rules, "", (0.0, 0.0), own):
            in_frames = verdict_in_frames(rules, dict(case.values), list(spec.wall))
            found.append((asked.numbers_in_words(case.fixed), in_frames))
    worst_first = ("refuted", "unknown", "proved")
    member, known = min(found, key=lambda each: worst_first.index(each[1]["verdict"]))
    return known | {"counterexample": of_member(member, known["counterexample"])}


def _with_wall(loop: Loops, spec: Spec) -> dict[str, str]:
    """The verdict on one loop with the spec's own wall."""
    wall = [float(spec.values[path]) for path in spec.wall]
    stiffness, damping = (*wall, 0.0)[:2]
    return _verdict(wall_cut(loop), stiffness, damping, LINEAR)


def of_saturation(spec: Spec, block: str) -> dict[str, str]:
    """The same of a saturation, while all other blocks stay within their limits."""
    own = own_loop(spec)
    try:
        opened = open_loops(own.with_gain_at(f"{block}.y"), GAIN)
    except IllPosedLoopError:
        opened = None
    return _verdict(opened and opened.cut, 1.0, 0.0, WITHIN, OPEN)


def _verdict(cut: LinearFractional | None, K, B, linear, free="") -> dict[str, str]:
    """What is known of a cut with these numbers; linear, free: what the two extreme functions
    are called, the one without contact if that is another than no wall."""
    loop = WallLoop.of(cut) if cut else None
    if loop is None:
        return {"verdict": "unknown", "counterexample": ""}
    if loop.unstable:
        said = free or f"no contact at all: {loop.without_wall}"
        return {"verdict": "refuted", "counterexample": said}
    line = Line.of(WallsAlong(loop, 0, B))
    if line.proved(K, K):
        return {"verdict": "proved", "counterexample": ""}
    if radius_of(cut.closed(K, B)) > 1:
        return {"verdict": "refuted", "counterexample": linear}
    motion = motion_at(line.walls, K)
    found = str(motion) if motion else ""
    return {"verdict": "refuted" if found else "unknown", "counterexample": found}
