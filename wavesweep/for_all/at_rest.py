"""The stiffness that a hand feels at rest of all loops of [for_all]: the least of them.

A state in which no signal changes is at rest in every tick, whichever blocks run in it and however
long it takes: each block then gives what it would give if it ran, and no rule of a step that varies
moves it. So all frames, delays, lost results that are held, and lengths of ticks share their states at
rest, one for each force if nothing drifts at the hand. Where something does, as a wave line without
Kp, the place of rest depends on the frames during the push: then nothing is known here.

Of a box of constant numbers, each of which is one scalar gain, or the stiffness of a mass, the
stiffness at rest is N/P, where N, P and the determinant D of the equations at rest are affine in each
number. D has one sign if all loops of the box are stable, and so has P = D x if the position x has one at
all corners. Then N/P is monotone along each number, and least at a corner.
"""

from collections.abc import Sequence

import numpy as np

from wavesweep.engine.drawing import Drawing, name_of
from wavesweep.engine.switched import corners_of
from wavesweep.for_all.unknown import Case
from wavesweep.haptics.felt import dcgain_of, felt_along, felt_of

# keys of blocks, by their types, that nothing at rest depends on
OF_MOTION = {
    "mass": {"mass", "damping"},
    "inertia": {"inertia", "damping"},
    "spring": {"d"},
    "delay": {"seconds"},
    "channel": {"loss", "burst", "burst_end", "burst_loss"},
    "butterworth": {"cutoff_hz"},
    "lowpass": {"a", "cutoff_hz"},
    "lead": {"zero_hz", "pole_hz"},
    "notch": {"frequency_hz", "q", "depth"},
    "pid": {"kd", "tau"},
}
SPRINGS = ("mass", "inertia")


def least_felt(cases: Sequence[Case], values: np.ndarray, *, vary: bool) -> np.ndarray:
    """The least stiffness (N/m) that the hand feels at rest of all loops of some cases, where these
    are stable at values of their number, `(n,)`; NaN where it is not known. vary: whether frames,
    results or messages do."""
    return np.min([_of_case(case, values, vary=vary) for case in cases], axis=0)


def _of_case(case, values, *, vary):
    if not vary and not case.ranges:
        return felt_along(case.loop, case.along, values)
    unknown = np.full(values.shape, np.nan)
    kinds = [_at_rest(case.loop.drawing, name_of(axis.path)) for axis in case.ranges]
    sent = [dict(channel.keys)["missing"] for channel in case.loop.drawing.channels]
    if "" in kinds or "zero" in sent:
        return unknown
    counted = [number for number, kind in enumerate(kinds) if kind == "affine"]
    least = np.full(values.shape, np.inf)
    signs = set()
    for corner in corners_of(case.box[:, counted]):
        numbers = {case.ranges[i].path: float(end) for i, end in zip(counted, corner, strict=True)}
        loops = case.loop.changed({**numbers, case.along: values})
        at_rest = dcgain_of(loops)
        if at_rest is None:
            return unknown
        least = np.minimum(least, felt_of(loops, values.size))
        signs.update(np.sign(at_rest.shown.value[:, 0, 0]))
    return least if len(signs) == 1 else unknown


def _at_rest(drawing: Drawing, name: str) -> str:
    """How a number counts at rest: "not" at all, "affine", or otherwise, which is empty."""
    counts = []
    types = {block.name: block.type for block in drawing.blocks}
    for path, tree in drawing.trees():
        if not tree.reads(name):
            continue
        table, _, key = path.partition(".")
        block, _, key = key.partition(".")
        kind = types.get(block, "") if table == "block" else ""
        if key not in OF_MOTION.get(kind, ()):
            counts.append(kind in SPRINGS and key == "stiffness" and tree.text == name)
    if not counts:
        return "not"
    one_gain = drawing.scalar_place(name) and not drawing.seen_by_hand(name)
    return "affine" if one_gain or counts == [True] else ""
