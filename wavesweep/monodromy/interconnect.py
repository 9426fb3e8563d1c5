"""Connection of blocks of one rate through their summing junctions, with every algebraic loop closed exactly."""

from math import prod

import numpy as np

from wavesweep.loops.algebraic import loop_inverse
from wavesweep.loops.block import Block, numbers
from wavesweep.monodromy.substitution import ANY, NOTHING, ONE, plan_of


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
                inverse, condition, pivot = loop_inverse(loop, sizes, plan.reached, name, plan.closed)
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
