"""The whole lifted system: a frame's hand forces in, the frame's positions out."""

from dataclasses import replace

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.connect import connect
from wavesweep.lifted.assemble import fast_side
from wavesweep.diagram.delay import unit_delay


def lifted_system(diagram: Diagram, ratio: int, K_VE, B_VE, output: str = "device.x") -> Block:
    """The closed loop as one block per frame of `ratio` ticks: inputs `f_h[0..ratio-1]` (N), outputs `x[0..ratio-1]`.

    K_VE (N/m), B_VE (N*s/m): the wall. output: a signal of the fast side, "device.x" (m), "device.dx" (m) or "f_m" (N).
    Position is a state here, its drift included. Nothing is left out, so poles are those of the tick-by-tick loop.
    """
    if diagram.ratio == 1 and ratio > 1:
        return _repeated(lifted_system(diagram, 1, K_VE, B_VE, output), ratio)
    sampled = tuple(dict.fromkeys(diagram.samples.values()))
    names = ("f_h", *diagram.holds)
    fast = connect("fast", diagram.fast, diagram.sums, names, (*sampled, output))
    frame = _frame(fast, diagram, sampled, output)
    latches = [unit_delay(f"hold_{name}", name in diagram.held_positions) for name in diagram.holds if diagram.delay > 0]
    sums = dict(diagram.sums) | {"F_s": {diagram.wall[0]: K_VE, diagram.wall[1]: B_VE}}
    for name, source in diagram.holds.items():
        sums |= {f"frame.{name}.old": {f"hold_{name}.y": 1}, f"frame.{name}.new": {source: 1}, f"hold_{name}.u": {source: 1}}
    for name, source in diagram.samples.items():
        sums[name] = {f"frame.{source}": 1}
    forces = tuple(f"f_h[{i}]" for i in range(ratio))
    sums |= {f"frame.{name}": {name: 1} for name in forces}
    short = output.split(".")[-1]
    return connect("lifted", (frame, *diagram.slow, *latches), sums, forces, tuple(f"frame.{short}[{i}]" for i in range(ratio)))


def _frame(fast: Block, diagram: Diagram, sampled, output) -> Block:
    """The fast side over a frame, every tick's force an input and every tick's output an output."""
    n, M, D = len(fast.states), diagram.ratio, diagram.delay
    held = [f"{name}.{part}" for part in (("old",) if D else ()) + (("new",) if D < M else ()) for name in diagram.holds]
    inputs = [*held, *(f"f_h[{i}]" for i in range(M))]
    state, drive = np.broadcast_to(np.eye(n), fast.E.shape).copy(), np.zeros((*fast.E.shape[:-1], len(inputs)))
    E_sum = np.zeros_like(fast.E)
    rows_C, rows_D = [], []
    for tick in range(M):
        shown = "old" if tick < D else "new"
        pick = np.zeros((len(fast.inputs), len(inputs)))
        pick[0, inputs.index(f"f_h[{tick}]")] = 1
        for column, name in enumerate(diagram.holds, start=1):
            pick[column, inputs.index(f"{name}.{shown}")] = 1
        C, D_now = fast.C, fast.C @ drive + fast.D @ pick
        keep = slice(None) if tick == 0 else slice(-1, None)
        rows_C.append((C @ state)[..., keep, :])
        rows_D.append(D_now[..., keep, :])
        drive = drive + fast.E @ drive + fast.B @ pick
        E_sum = E_sum + fast.E @ state
        state = state + fast.E @ state
    short = output.split(".")[-1]
    outputs = (*sampled, *(f"{short}[{i}]" for i in range(M)))
    return Block("frame", tuple(inputs), outputs, fast.states, E_sum, drive,
                 np.concatenate(rows_C, axis=-2), np.concatenate(np.broadcast_arrays(*rows_D), axis=-2) if M == 1 else np.concatenate(rows_D, axis=-2))


def _repeated(tick: Block, ratio: int) -> Block:
    """`ratio` ticks of a unirate loop as one frame."""
    n = len(tick.states)
    state, drive, rows_C, rows_D = np.eye(n), np.zeros((*tick.E.shape[:-1], ratio)), [], []
    E_sum = np.zeros_like(tick.E)
    for i in range(ratio):
        pick = np.zeros((1, ratio))
        pick[0, i] = 1
        rows_C.append(tick.C @ state)
        rows_D.append(tick.C @ drive + tick.D @ pick)
        drive = drive + tick.E @ drive + tick.B @ pick
        E_sum = E_sum + tick.E @ state
        state = state + tick.E @ state
    name = tick.outputs[0].removesuffix("[0]")
    return replace(
        tick, inputs=tuple(f"f_h[{i}]" for i in range(ratio)), outputs=tuple(f"{name}[{i}]" for i in range(ratio)),
        E=E_sum, B=drive, C=np.concatenate(rows_C, axis=-2), D=np.concatenate(rows_D, axis=-2),
    )
