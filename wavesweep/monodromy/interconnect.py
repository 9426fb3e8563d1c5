"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

from math import prod

import numpy as np

from wavesweep.errors import IllPosedLoopError
from wavesweep.loops.block import Block, numbers
from wavesweep.monodromy.substitution import ANY, NOTHING, ONE, plan_of

WORST_CONDITION = 1e12  # beyond it a closed loop keeps fewer than 4 digits, which is no answer


def connect(name: str, blocks, sums, inputs, outputs, terms: bool = False) -> Block:
    """Close every junction among `blocks` and return one block from the signals `inputs` to the signals `outputs`.

    name: of the block. blocks: `Block`s of one rate. sums: signal -> {source signal: gain}. inputs: external signals. outputs:
    any signals. terms: whether the block has the sizes of the terms of its entries' sums (see `Block`).
    Errors: IllPosedLoopError if the algebraic loop through the direct terms is singular to working precision.

    Ports are visited in the order in which their direct terms need each other. If this comes to a port again, the port is torn:
    it is unknown until all others are sums of states, inputs and torn ports, and then found from as many equations as ports are
    torn (G. Kron, Diakoptics, 1963). The sums follow from the structure alone and are planned once for all loops that have it.
    """
    gains = {(to, source): gain for to, sources in sums.items() for source, gain in sources.items()}
    varied = {at: numbers(gain)[..., None, None] for at, gain in gains.items() if not isinstance(gain, int | float)}
    work = _entries([part for block in blocks for part in (block.B, block.C, block.D, *(block.terms or ())[1:])])
    patterns = [ANY if not isinstance(each, float) else NOTHING if each == 0 else ONE if each == 1 else ANY for each in work]
    work += [_entries([varied[at]])[0] if at in varied else float(gain) for at, gain in gains.items()]
    patterns += [ONE if isinstance(gain, float) and gain == 1 else ANY for gain in work[len(patterns) :]]
    shapes = tuple([(each.name, each.inputs, each.outputs, len(each.states), each.terms is not None) for each in blocks])
    wires = tuple([(signal, tuple(sources)) for signal, sources in sums.items()])
    plan = plan_of(shapes, wires, tuple(inputs), tuple(outputs), terms, bytes(patterns))
    arrays = [part for block in blocks for part in (block.E, block.B, block.C, block.D)]
    arrays += [gain for (to, _), gain in varied.items() if to in plan.used]
    batch = np.broadcast_shapes(*{array.shape[:-2] for array in arrays})
    kind = np.result_type(float, *{array.dtype for array in arrays})
    own = {0: [each.E for each in blocks], 4: [each.terms[0] if each.terms else np.abs(each.E) for each in blocks if terms]}
    states = tuple(f"{block.name}.{state}" for block in blocks for state in block.states)
    n, m, p = len(states), len(inputs), len(outputs)
    shapes, kinds, condition, pivot = 2 * [(n, n), (n, m), (p, n), (p, m)], 4 * [kind] + 4 * [float], 1.0, 1.0
    work += [1.0, *[None] * (plan.places - len(work) - 1)]
    with np.errstate(over="ignore", invalid="ignore"):  # a frame that overflows is for the caller to see
        for late, steps in enumerate(plan.stages):
            if late and plan.loop:
                loop, sizes = (_filled(plan.loop[at], work, plan.reached.shape, batch, kinds[4 * at]) for at in (0, 1))
                inverse, condition, pivot = _loop_inverse(loop, sizes, plan.reached, name, plan.closed)
                work += _entries([inverse])
            for operation, one, other, place in steps:
                work[place] = operation(work[one], work[other])
        parts = [_filled(part, work, shapes[at], batch, kinds[at], own.get(at, ())) for at, part in enumerate(plan.parts)]
    for block in blocks:
        condition, pivot = condition * block.condition, pivot * block.pivot
    facts = {"condition": condition, "pivot": pivot, "terms": tuple(parts[4:]) or None}
    return Block(name, tuple(inputs), tuple(outputs), states, *parts[:4], **facts)


def _entries(matrices) -> list:
    """Return the entries of matrices, `(..., rows, columns)`, by rows, each an array, or a float if it is the same real number
    in the whole batch. (Complex numbers stay in arrays, since Python multiplies them differently.)"""
    found, groups = [], {}
    for at, each in enumerate(matrices):
        found.append(each.ravel().tolist() if each.ndim == 2 and each.dtype.kind != "c" else None)
        if found[at] is None:  # many at once, since a call costs as much as the arithmetic of many loops
            groups.setdefault((each.shape[:-2], each.dtype.char), []).append(at)
    for (batch, _), members in groups.items():
        flat = [matrices[at].reshape(prod(batch), prod(matrices[at].shape[-2:])) for at in members]
        widths, flat = [each.shape[-1] for each in flat], np.concatenate(flat, -1)
        first = flat[0] if len(flat) else np.zeros(flat.shape[-1])
        values = first.real.tolist()
        for at in np.flatnonzero((flat != first).any(0) | (first.imag != 0)).tolist():
            values[at] = flat[:, at].copy().reshape(batch)
        for at, width in zip(members, widths, strict=True):
            found[at], values = values[:width], values[width:]
    return [entry for entries in found for entry in entries]


def _filled(part, work, shape, batch, kind, own=()) -> np.ndarray:
    """Return a matrix of a plan, `(..., *shape)`, and matrices along its diagonal, `own`, added up.

    If the batch has several axes, each axis along which nothing varies has length 1.
    """
    if len(batch) > 1:
        shapes = {np.shape(work[place]) for _, place in part} | {matrix.shape[:-2] for matrix in own}
        batch = np.broadcast_shapes((1,) * len(batch), *shapes)
    out, first = np.zeros((*batch, *shape), kind), 0
    by_entry = out.reshape(*batch, prod(shape)).transpose(-1, *range(len(batch)))
    for entry, place in part:
        by_entry[entry] = work[place]
    for matrix in own:
        inside = slice(first, first + matrix.shape[-1])
        out[..., inside, inside] += matrix
        first = inside.stop
    return out


def _loop_inverse(loop, sizes, reached, name, ports):
    """Return the inverse of the return difference of torn ports, its condition number and its determinant.

    sizes: of the terms that the loop's entries are sums of. reached: entries of the inverse that are not zero by structure.
    Errors: IllPosedLoopError if the condition number shows that the loop is ill-posed. It is that of the best units, the
    spectral radius of |L^-1| |L| (Bauer 1963), which the norm of a power overestimates by a small factor: a wave impedance of
    1e-9, which makes entries of very different sizes, is no ill-posed loop.
    """
    one, several = np.eye(len(reached)), len(reached) > 1
    loop = one - loop
    overflown = ~np.isfinite(loop).all((-1, -2))  # a frame that overflows is for the caller to see
    with np.errstate(all="ignore"):
        try:
            inverse = np.linalg.inv(np.where(overflown[..., None, None], np.nan, loop)) if several else 1 / loop
        except np.linalg.LinAlgError:
            inverse = np.full_like(loop, np.inf)
        for _ in range(2 if several else 0):  # refined: entries that are small beside the largest have lost their digits
            inverse = inverse + inverse @ (one - loop @ inverse)
        inverse[..., ~reached] = 0.0
        power = np.abs(inverse) @ (one + sizes)
        for _ in range(3 if several else 0):
            power = power @ power
        condition = power.sum(-1).max(-1, initial=0) ** (1 / 8 if several else 1)
        condition, pivot = np.where(np.isnan(condition), np.inf, condition), np.linalg.det(loop) if several else loop[..., 0, 0]
    if not np.all((condition < WORST_CONDITION) | overflown):
        raise IllPosedLoopError(
            f"the algebraic loop of the {name} side through {', '.join(ports)} is ill-posed: condition number "
            f"{float(np.max(condition)):.1e}, expected below {WORST_CONDITION:.0e}; give the loop a delay "
            "(environment.delay or local_model.delay) or change the gain that closes it"
        )
    return inverse, condition, pivot
