"""Lifting: a block of the fast rate seen once a frame, its inputs held with a delay inside the frame."""

import numpy as np

from wavesweep.diagram.block import Block


def growth(E, ticks: int):
    """`S = sum_{i<ticks} (I+E)^i`, so that `(I+E)^ticks - I = E S`; by doubling, without losing the digits of E.

    E: `(..., n, n)`. Overflow of a locally unstable loop gives infinities, silently: the caller looks at them.
    """
    n = E.shape[-1]
    total, done = np.zeros_like(E), 0
    for bit in f"{ticks:b}" if ticks else "":
        if done:
            total, done = 2 * total + total @ E @ total, 2 * done  # S_2n = S_n (2I + E S_n)
        if bit == "1":
            total, done = total + E @ total + np.eye(n), done + 1
    return total


def lift_held(fast: Block, ratio: int, delay: int, held, sampled) -> Block:
    """One frame of `fast` as a block of the slow rate.

    held: input signals that change once a frame, at phase `delay`; each becomes two inputs, `old` (shown before) and
    `new` (from then on). sampled: output signals whose value at phase 0 is the output. Other inputs are left at zero.
    The input `name` is called `name.old` or `name.new` when the corresponding part of the frame exists.
    """
    columns = [fast.inputs.index(name) for name in held]
    rows = [fast.outputs.index(name) for name in sampled]
    B, C, D = fast.B[..., columns], fast.C[..., rows, :], fast.D[..., rows, :][..., columns]
    with np.errstate(over="ignore", invalid="ignore"):
        whole, late, early = (growth(fast.E, ticks) for ticks in (ratio, ratio - delay, delay))
        held_early = early @ B
        old = held_early + fast.E @ (late @ held_early)  # A^(M-D) S_D B
        E, new = fast.E @ whole, late @ B
    parts = [("old", old, D)] if delay > 0 else []
    if delay < ratio:
        parts.append(("new", new, D if delay == 0 else np.zeros_like(D)))
    return Block(
        "frame", tuple(f"{name}.{part}" for part, _, _ in parts for name in held), tuple(sampled), fast.states, E,
        B=np.concatenate([b for _, b, _ in parts], axis=-1), C=C,
        D=np.concatenate([d for _, _, d in parts], axis=-1), condition=fast.condition,
    )
