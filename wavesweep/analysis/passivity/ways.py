"""The wave channel taken out of its loop: the way to the environment and the way back, as drawn."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.aliases import flattened
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.connect import connect


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """The channel of `pmw` or `pmw-lm`, one block a way, both at the fast rate; their batch is in one axis.

    outward: `u_m` -> what is sampled for `u_s`, and `u_h` when there is a local model.
    inward: `v_l` -> its part of `v_m`; the other part is the held `v_s` itself (None without a local model).
    ratio, delay: ticks in a frame; phase from which a new `v_s` is held. period: of the frame, s, in the shape
    of the batch.
    """

    outward: Block
    inward: Block | None
    ratio: int
    delay: int
    period: np.ndarray


OUTWARD, INWARD = ("lp1", "hp"), ("lp2", "late")


def ways_of(diagram: Diagram) -> Ways | None:
    """Cut the drawing at the channel's ports: None for a controller without waves.

    The ports are `(u_m, v_s, v_l)` in and `(u_s, u_h, v_m)` out: the filters, the samplers and the holds. The device,
    both environments and the position feedback Kp (x_s - x), which reads positions and no wave, are outside.
    """
    fast = {block.name: block for block in diagram.fast}
    if "lp1" not in fast:
        return None
    local = "local.u" in diagram.sums
    outward = connect("outward", [fast[n] for n in OUTWARD if n in fast], diagram.sums, ("u_m",),
                      ("lp1.y", "local.u") if local else ("lp1.y",))
    inward = _inward(diagram, [fast[n] for n in INWARD if n in fast]) if local else None
    period = np.asarray(diagram.period * diagram.ratio)
    batch = np.broadcast_shapes(outward.batch, inward.batch if inward else (), period.shape)
    return Ways(flattened(outward, batch), flattened(inward, batch) if inward else None, diagram.ratio, diagram.delay,
                np.broadcast_to(period, batch))


def _inward(diagram, blocks) -> Block:
    """v_l -> v_m, all that is no wave of the local model left at zero."""
    others = tuple(name for name in diagram.sums["v_m"] if not name.startswith(("late.", "lp2.")))
    block = connect("inward", blocks, diagram.sums, ("local.v", *others), ("v_m",))
    return Block("inward", ("local.v",), ("v_m",), block.states, block.E, block.B[..., :1], block.C, block.D[..., :1])
