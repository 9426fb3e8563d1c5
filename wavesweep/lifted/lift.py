"""Lifting: blocks of the fast rate once per frame, with delayed held inputs, and without the states that nothing reads."""

from dataclasses import replace

import numpy as np

from wavesweep.diagram.block import Block, loss, unit_delay
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import latch
from wavesweep.lifted.batches import in_parts
from wavesweep.lifted.connect import connect


def growth(E, ticks: int):
    """Return `S = sum_{i<ticks} (I+E)^i`, so that `(I+E)^ticks - I = E S`; by doubling, which keeps the digits of E.

    E: `(..., n, n)`. If a locally unstable loop overflows, the result has infinities without a warning; the caller checks for
    them.
    """
    return in_parts(lambda part: _growth(E[part], ticks), *_shape(E))


def _shape(E):
    """Return the shape, the size and the kind of matrices, for `in_parts`."""
    return E.shape[:-2], E.shape[-1], E.dtype


def _growth(E, ticks):
    one = np.eye(E.shape[-1])
    total = one + np.zeros_like(E) if ticks else np.zeros_like(E)
    for number, bit in enumerate(f"{ticks:b}"[1:]):
        total = 2 * total + total @ E @ total if number else 2 * one + E  # S_2n = S_n (2I + E S_n)
        if bit == "1":
            total = total + E @ total + one
    return total


def steps(E, B, ticks: int):
    """Return `growth(E, ticks)`, and the states after `ticks` ticks from rest under a constant 1 and under 1 more each tick.

    These are `sum_i (I+E)^(ticks-1-i) B` and `sum_i i (I+E)^(ticks-1-i) B`, `(..., n, m)` each, computed by doubling.
    """
    total, constant, growing, done = np.zeros_like(E), np.zeros_like(B), np.zeros_like(B), 0
    with np.errstate(over="ignore", invalid="ignore"):
        for bit in f"{ticks:b}":
            if done:  # S the sum of the powers: what has grown grows on, and from here by more
                change = total @ E
                growing = 2 * growing + change @ growing + done * constant
                constant = 2 * constant + change @ constant
                total, done = 2 * total + change @ total, 2 * done
            if bit == "1":
                growing = growing + constant
                constant = constant + E @ constant + B
                total, done = total + E @ total + np.eye(E.shape[-1]), done + 1
    return total, constant, growing


def lift_held(fast: Block, ratio: int, delay: int, held, sampled, whole=None) -> Block:
    """Return one frame of `fast` as a block of the slow rate.

    held: input signals that change once a frame, at phase `delay`; each becomes two inputs, `old` (its value before that phase)
    and `new` (from then on). sampled: output signals whose value at phase 0 is the output. Other inputs are left at zero. The
    input `name` is called `name.old` or `name.new` if the corresponding part of the frame exists. whole: `growth` over the
    frame, if it is known.
    """
    columns = [fast.inputs.index(name) for name in held]
    rows = [fast.outputs.index(name) for name in sampled]
    B, C, D = fast.B[..., columns], fast.C[..., rows, :], fast.D[..., rows, :][..., columns]
    with np.errstate(over="ignore", invalid="ignore"):
        late, old = whole if whole is not None and not delay else growth(fast.E, ratio - delay), None
        if delay:
            early = growth(fast.E, delay)
            whole, held_early = early + late + late @ fast.E @ early, early @ B
            old = held_early + fast.E @ (late @ held_early)  # A^(M-D) S_D B
        E, new = fast.E @ (whole if delay else late), late @ B
        condition = fast.condition
        if ratio > 1:
            condition = condition * _loss(E, fast.E, ratio)
    parts = [("old", old, D)] if delay > 0 else []
    if delay < ratio:
        parts.append(("new", new, D if delay == 0 else np.zeros_like(D)))
    return Block(
        "frame",
        tuple(f"{name}.{part}" for part, _, _ in parts for name in held),
        tuple(sampled),
        fast.states,
        E,
        B=np.concatenate([b for _, b, _ in parts], axis=-1),
        C=C,
        D=np.concatenate([d for _, _, d in parts], axis=-1),
        condition=condition,
        pivot=fast.pivot,
    )


def _loss(E, tick, ratio):
    """Return `loss` of frames of so many equal ticks."""
    return in_parts(lambda part: loss(E[part], ratio * np.abs(tick[part])), *_shape(E))


def prune(block: Block) -> tuple[Block, tuple[str, ...]]:
    """Return the block without the states that no output reads, directly or through other states, and their names.

    An entry counts as zero only if it is zero for every element of the batch. States that are left out here are a position with
    no spring and no position feedback (the drift of a wave loop), the avatar of a local model with K_LM = 0, and a held value
    that nothing reads; the remaining block has the same transfer function.
    """
    reads = np.any(block.E != 0, axis=tuple(range(block.E.ndim - 2)))
    kept = np.any(block.C != 0, axis=tuple(range(block.C.ndim - 1)))
    before = 0
    while before < np.count_nonzero(kept):
        before = np.count_nonzero(kept)
        kept = kept | reads[kept].any(0)
    if kept.all():
        return block, ()
    index = np.flatnonzero(kept)
    names = tuple(block.states[i] for i in index)
    smaller = Block(
        block.name,
        block.inputs,
        block.outputs,
        names,
        # Contiguous, since the bits of a product depend on the memory, and with it on the batch.
        E=np.ascontiguousarray(block.E[..., index[:, None], index]),
        B=np.ascontiguousarray(block.B[..., index, :]),
        C=np.ascontiguousarray(block.C[..., index]),
        D=block.D,
        condition=block.condition,
        pivot=block.pivot,
        terms=_kept(block.terms, index),
    )
    return smaller, tuple(s for s, keep in zip(block.states, kept, strict=True) if not keep)


def _kept(terms, index):
    """Return the sizes of the terms of the states that are kept."""
    if terms is None:
        return None
    E, B, C, D = terms
    return E[..., index[:, None], index], B[..., index, :], C[..., index], D


def fast_side(diagram: Diagram, outputs, terms: bool = False) -> Block:
    """Return the tick, from the hand's force and the held signals to `outputs`, without the states that these do not read.

    terms: see `connect`.
    """
    inputs = (diagram.hand.force, *diagram.holds)
    block, _ = prune(connect("fast", diagram.fast, diagram.sums, inputs, tuple(outputs), terms))
    return block


def slow_side(diagram: Diagram, outputs, injected=False, wall=None, whole=None) -> tuple[Block, tuple[str, ...]]:
    """Return the frame, cut at the wall, from the wall's force to the slow signals `outputs`, and the names of unread states.

    injected: adds an input `inject.NAME` for every sample, which is added to the signal that the sampler reads (the hand's
    force reaches the slow side by no other way). wall: a junction that makes the wall's force, which closes the loop. whole:
    the result of `frame_at_rest`, if it is known; it contains this side.
    """
    if whole is not None:
        block, unread = prune(only(whole, (diagram.wall_force,), outputs))
        return block, _unknown(diagram, whole) + unread
    sampled = tuple(dict.fromkeys(diagram.samples.values()))
    frame = lift_held(fast_side(diagram, sampled), diagram.ratio, diagram.delay, tuple(diagram.holds), sampled)
    sums = slow_sums(diagram)
    if injected:
        sums |= {name: sums[name] | {f"inject.{name}": 1} for name in diagram.samples}
    sums |= wall or {}
    inputs = (() if wall else (diagram.wall_force,)) + (tuple(f"inject.{name}" for name in diagram.samples) if injected else ())
    block, unread = prune(connect("slow", (frame, *diagram.slow, *latches(diagram)), sums, inputs, tuple(outputs)))
    return block, _unknown(diagram, frame, "frame.") + unread


def _unknown(diagram, block, prefix=""):
    """Return the states of the fast side that are not among those of a block."""
    known = {prefix + name for name in block.states}
    return tuple(name for b in diagram.fast for s in b.states if (name := f"frame.{b.name}.{s}") not in known)


def frame_at_rest(diagram: Diagram) -> Block:
    """Return the frame, cut at the wall, with all of its states.

    Its inputs are the wall's force, a constant force of the hand, and a force of the hand that grows by 1 a tick. Its outputs
    are the signals that the wall reads, the hand's position and the control force.
    """
    hand = diagram.hand
    fast = fast_side(diagram, tuple(dict.fromkeys((hand.position, hand.reaction, *diagram.samples.values()))))
    total, *moved = steps(fast.E, fast.B[..., :1], diagram.ratio)
    frame = lift_held(fast, diagram.ratio, diagram.delay, tuple(diagram.holds), fast.outputs, total)
    constant = fast.D[..., :1] + np.zeros((*frame.D.shape[:-1], 1))
    frame = replace(
        frame,
        inputs=(*frame.inputs, "force", "growing"),
        B=np.concatenate([frame.B, *moved], -1),
        D=np.concatenate([frame.D, constant, 0 * constant], -1),
    )
    sums = slow_sums(diagram) | {"frame.force": {"force": 1}, "frame.growing": {"growing": 1}}
    outputs = (*diagram.wall, f"frame.{hand.position}", f"frame.{hand.reaction}")
    inputs = (diagram.wall_force, "force", "growing")
    return connect("rest", (frame, *diagram.slow, *latches(diagram)), sums, inputs, outputs)


def only(block: Block, inputs, outputs) -> Block:
    """Return the block with some of its inputs and outputs."""
    columns, rows = ([names.index(name) for name in some] for names, some in ((block.inputs, inputs), (block.outputs, outputs)))
    D = block.D[..., rows, :][..., columns]
    return replace(block, inputs=tuple(inputs), outputs=tuple(outputs), B=block.B[..., columns], C=block.C[..., rows, :], D=D)


def latches(diagram: Diagram) -> tuple[Block, ...]:
    """Return the delays that keep the held signals of the frame before, if they are applied with a delay."""
    delayed = diagram.holds if diagram.delay > 0 else ()
    return tuple(unit_delay(latch(name).removesuffix(".u_before")) for name in delayed)


def wall_sum(diagram: Diagram, K_VE, B_VE) -> dict:
    """Return the junction that makes the wall's force; `K_VE` (N/m) and `B_VE` (N*s/m): numbers or arrays."""
    return {diagram.wall_force: {diagram.wall[0]: K_VE, diagram.wall[1]: B_VE}}


def slow_sums(diagram: Diagram) -> dict:
    """Return the drawing's junctions and those that connect the lifted block "frame" to samplers and holds."""
    sums = dict(diagram.sums)
    for name, source in diagram.holds.items():
        sums |= {f"frame.{name}.old": {f"hold_{name}.y": 1}, f"frame.{name}.new": {source: 1}, f"hold_{name}.u": {source: 1}}
    return sums | {name: {f"frame.{source}": 1} for name, source in diagram.samples.items()}
