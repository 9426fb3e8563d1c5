"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.errors import IllPosedLoopError
from wavesweep.lifted.plan import plan_of
from wavesweep.lifted.tape import entries_of

WORST_CONDITION = 1e12  # beyond it a closed loop keeps fewer than 4 digits, which is no answer

REFINED = 2  # steps of refinement of an inverse


def connect(name: str, blocks, sums, inputs, outputs, terms: bool = False) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the signals `outputs`.

    name: of the block. blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs: external signals. outputs:
    any signals. terms: whether the block has the sizes of the terms of its entries' sums (see `Block`).
    Errors: IllPosedLoopError if the algebraic loop through the direct terms is singular to working precision.

    The ports are visited in the order in which their direct terms need each other. If this comes to a port again, the port is
    torn: it is unknown until all others are sums of states, inputs and torn ports, and then found from as many equations as
    ports are torn (G. Kron, Diakoptics, 1963). The sums follow from the structure alone, and are planned once for all loops
    that have it.
    """
    plan, values, batch, kind = plan_of(blocks, sums, tuple(inputs), tuple(outputs), terms)
    own = [block.E for block in blocks]
    sizes = [block.terms[0] if block.terms else np.abs(block.E) for block in blocks] if terms else []
    n, m, condition, pivot, pattern = plan.states, len(inputs), 1.0, 1.0, b""
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        if plan.torn:
            (loop, of_terms), values = plan.loop.run(values, batch, kind, (plan.torn,), (plan.torn,))
            inverse, condition, pivot = _loop_inverse(loop, of_terms, plan.reached, name, plan.closed)
            pattern = entries_of((inverse,), values)
        widths = (n, m, n, m)
        parts, _ = plan.ending(pattern).run(values, batch, kind, widths, widths if terms else (), own, sizes)
    for block in blocks:
        condition, pivot = condition * block.condition, pivot * block.pivot
    states = tuple(f"{block.name}.{state}" for block in blocks for state in block.states)
    facts = {"condition": condition, "pivot": pivot, "terms": tuple(parts[4:]) or None}
    return Block(name, tuple(inputs), tuple(outputs), states, *parts[:4], **facts)


def _loop_inverse(loop, sizes, reached, name, ports):
    """Return the inverse of the return difference of torn ports, its condition number and its determinant.

    sizes: of the terms that the loop's entries are sums of. reached: entries of the inverse that are not zero by structure.
    Errors: IllPosedLoopError if the condition number shows that the loop is ill-posed.
    """
    one = np.eye(loop.shape[-1])
    loop = one - loop
    overflown = ~np.isfinite(loop).all((-1, -2))  # a frame that overflows is for the caller to see
    with np.errstate(all="ignore"):
        inverse, pivot = (1 / loop, loop[..., 0, 0]) if loop.shape[-1] == 1 else _inverse(loop, overflown, reached)
    condition = _condition(inverse, one + sizes)
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition, pivot


def _inverse(loop, overflown, reached):
    """Return the inverse and the determinant of a return difference; see `_loop_inverse`."""
    try:
        inverse = np.linalg.inv(np.where(overflown[..., None, None], np.nan, loop))
    except np.linalg.LinAlgError:
        inverse = np.full_like(loop, np.inf)
    for _ in range(REFINED):  # entries that are small beside the largest have lost their digits
        inverse = inverse + inverse @ (np.eye(loop.shape[-1]) - loop @ inverse)
    inverse[..., ~reached] = 0.0
    return inverse, np.linalg.det(loop)


def _condition(inverse, sizes):
    """Return the condition number for the best choice of units, the spectral radius of |L^-1| |L| (Bauer 1963).

    With it, a wave impedance of 1e-9, which makes entries of very different sizes, is no ill-posed loop. The number is
    overestimated by a small factor, since it is found from the norm of a power.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        power = np.abs(inverse) @ sizes
        for _ in range(3 if power.shape[-1] > 1 else 0):
            power = power @ power
        condition = power.sum(-1).max(-1, initial=0) ** (0.125 if power.shape[-1] > 1 else 1.0)
    return np.where(np.isnan(condition), np.inf, condition)
