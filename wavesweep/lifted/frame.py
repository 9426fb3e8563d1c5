"""The whole lifted system: from the hand's forces of a frame to the positions of the frame."""

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.connect import connect
from wavesweep.lifted.lift import latches, slow_sums, wall_sum


def lifted_system(diagram: Diagram, ratio: int, K_VE, B_VE, output: str | None = None) -> Block:
    """Return the closed loop as one block per frame of `ratio` ticks: inputs `f_h[0..ratio-1]` (N), outputs `x[0..ratio-1]`.

    K_VE (N/m), B_VE (N*s/m): the wall. output: a signal of the fast side, by default the position of the hand's device (m).
    Position is a state here, its drift included. Nothing is left out, so the poles are those of the tick-by-tick loop.
    """
    output, force = output or diagram.hand.position, diagram.hand.force
    if diagram.ratio == 1 and ratio > 1:  # one tick is the loop's own frame: close it, then repeat it
        tick = lifted_system(diagram, 1, K_VE, B_VE, output)
        return unrolled(tick, np.eye(ratio)[:, None, :], _numbered(force, ratio), _numbered(_short(output), ratio))
    sampled = tuple(dict.fromkeys(diagram.samples.values()))
    fast = connect("fast", diagram.fast, diagram.sums, (force, *diagram.holds), (output, *sampled))
    forces = _numbered(force, ratio)
    held, picks = _inputs_of_ticks(diagram)
    frame = unrolled(fast, picks, (*held, *forces), _numbered(_short(output), ratio), sampled)
    sums = slow_sums(diagram) | wall_sum(diagram, K_VE, B_VE)
    sums |= {f"frame.{name}": {name: 1} for name in forces}
    outputs = tuple(f"frame.{name}" for name in _numbered(_short(output), ratio))
    return connect("lifted", (frame, *diagram.slow, *latches(diagram)), sums, forces, outputs)


def unrolled(tick: Block, picks, inputs, each, first=()) -> Block:
    """Return several ticks of one block in a row, as a block named "frame".

    picks: `(ticks, inputs of the tick, inputs of the frame)`, the map from the inputs of the frame to those of each tick.
    inputs: names of the frame's inputs. each: names of the tick's first output in every tick; first: names of its other
    outputs, which are taken in the first tick only.
    """
    n = len(tick.states)
    state, drive, change = np.eye(n), np.zeros((*tick.E.shape[:-1], len(inputs))), np.zeros_like(tick.E)
    C, D = [], []
    for pick in picks:
        C.append(tick.C @ state)
        D.append(tick.C @ drive + tick.D @ pick)
        drive = drive + tick.E @ drive + tick.B @ pick
        change = change + tick.E @ state  # the sum of the steps, so that the digits of E survive in (I + E)^ticks - I
        state = state + tick.E @ state
    C, D = ([rows[0][..., 1:, :]] + [row[..., :1, :] for row in rows] for rows in (C, D))
    batch = np.broadcast_shapes(*(part.shape[:-2] for part in (*C, *D)))
    C, D = (np.concatenate([np.broadcast_to(row, (*batch, *row.shape[-2:])) for row in rows], axis=-2) for rows in (C, D))
    return Block("frame", tuple(inputs), (*first, *each), tick.states, change, drive, C, D)


def _inputs_of_ticks(diagram):
    """Return the names of the held inputs of a frame, and the map from its inputs to those of each tick (see `unrolled`)."""
    M, D, names = diagram.ratio, diagram.delay, tuple(diagram.holds)
    shown = (("old",) if D > 0 else ()) + (("new",) if D < M else ())
    held = [f"{name}.{part}" for part in shown for name in names]
    picks = np.zeros((M, 1 + len(names), len(held) + M))
    for tick in range(M):
        picks[tick, 0, len(held) + tick] = 1
        for row, name in enumerate(names, start=1):
            picks[tick, row, held.index(f"{name}.{'old' if tick < D else 'new'}")] = 1
    return held, picks


def _numbered(name, count):
    return tuple(f"{name}[{i}]" for i in range(count))


def _short(output):
    return output.split(".")[-1]
