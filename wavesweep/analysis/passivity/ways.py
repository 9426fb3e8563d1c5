"""The wave channel taken out of its loop: the way to the environment and the way back, as drawn."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.aliases import flattened
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.errors import WavesweepError
from wavesweep.lifted.connect import connect
from wavesweep.lifted.lift import prune


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """The wave channel, one block a way, both at the fast rate; their batch is in one axis.

    outward: `u_m` -> what is sampled for the slow environment, and what reaches a local model if there is one.
    inward: the local model's wave -> its part of `v_m`; the other part is the held wave of the slow environment itself (None
    without a local model).
    ratio, delay: ticks in a frame; phase from which a new held wave is shown. period: of the frame, s, in the shape
    of the batch.
    """

    outward: Block
    inward: Block | None
    ratio: int
    delay: int
    period: np.ndarray


def ways_of(diagram: Diagram) -> Ways | None:
    """Cut the drawing at the channel's ports: None for a drawing without waves.

    The ports are `(u_m, v_s, v_l)` in and `(u_s, u_h, v_m)` out: those that the drawing and its blocks name as carrying waves.
    Between them lie filters, samplers and holds. The device, both environments and what else the returned wave is made of,
    positions for one, are outside. Raises WavesweepError for a channel of another shape than one environment at the slow
    rate, whose wave is held and added as it is, and at most one local model at the fast rate.
    """
    if diagram.waves is None:
        return None
    outgoing, returning = diagram.waves
    (slow,), local = _ends(diagram.slow), _ends(diagram.fast)
    ends = {block.name for block in local} | {diagram.hand.device}
    channel = [block for block in diagram.fast if block.name not in ends]
    sampled = diagram.samples.get(_only(diagram.sums, f"{slow.name}.{slow.waves[0]}"))
    held = [name for name, source in diagram.holds.items() if source == f"{slow.name}.{slow.waves[1]}"]
    if sampled is None or len(local) > 1 or len(held) != 1 or diagram.sums[returning].get(held[0]) != 1:
        raise WavesweepError("the wave channel is not of a shape whose norm is known: expected a sampled wave to the slow "
                             "environment, its returned wave held and added as it is, and at most one local model")
    outward = _way(diagram, channel, outgoing, (sampled, *(f"{block.name}.{block.waves[0]}" for block in local)))
    inward = _way(diagram, channel, f"{local[0].name}.{local[0].waves[1]}", (returning,)) if local else None
    period = np.asarray(diagram.period * diagram.ratio)
    batch = np.broadcast_shapes(outward.batch, inward.batch if inward else (), period.shape)
    return Ways(flattened(outward, batch), flattened(inward, batch) if inward else None, diagram.ratio, diagram.delay,
                np.broadcast_to(period, batch))


def _ends(blocks):
    return [block for block in blocks if block.waves]


def _only(sums, signal):
    """The signal that alone makes this one, with a gain of 1; None where it is made otherwise."""
    made = sums.get(signal, {})
    return next(iter(made)) if list(made.values()) == [1] else None


def _way(diagram, channel, source, sinks) -> Block:
    """From one wave to others through the channel's filters, all that is no wave on this way left at zero."""
    own = {f"{block.name}.{port}" for block in channel for port in block.outputs}
    inputs, sums, left = [source], {}, [*sinks, *(f"{block.name}.{port}" for block in channel for port in block.inputs)]
    while left:
        signal = left.pop()
        if signal in diagram.sums and signal != source and signal not in sums:
            sums[signal] = diagram.sums[signal]
            left += list(sums[signal])
        elif signal not in own and signal not in inputs and signal not in sums:
            inputs.append(signal)
    block, _ = prune(connect("way", channel, sums, inputs, sinks))
    return Block("way", (source,), sinks, block.states, block.E, block.B[..., :1], block.C, block.D[..., :1])
