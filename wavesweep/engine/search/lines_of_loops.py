"""What a spectrum of the states of drawn loops shows of their modes, a batch at a time."""

import numpy as np

from wavesweep.engine.drawing.drawing import Drawing
from wavesweep.engine.loops.batch import Loops
from wavesweep.engine.loops.from_drawing import PRODUCT
from wavesweep.engine.monodromy.drift import MarginalModes, counted_ticks
from wavesweep.engine.monodromy.hessenberg import in_even_units, polynomials, reduced
from wavesweep.engine.monodromy.periodic import frame_of, ticks_of
from wavesweep.engine.monodromy.rounding import balance
from wavesweep.engine.monodromy.unit_circle import inverse
from wavesweep.engine.search.open_loops import Opened
from wavesweep.engine.search.question import RequiredRegion
from wavesweep.engine.stability.boundary import times
from wavesweep.engine.stability.radii import drift_of, named_loops
from wavesweep.engine.stability.spectral_lines import lines_of, share_of_first
from wavesweep.engine.stability.spectrum import eigenvalues

MOST = 2**18  # numbers of states that are followed at once
BESIDE, ROUNDED = 1e-10, 4  # how far from an eigenvalue its vectors are looked for: of its size; roundings of the entries
FARTHER = (1.0, 1e2, 1e4)  # times that, tried in turn
APART = 1e-9  # of the largest participation in a mode, up to which a state takes no part


def lines_in_loops(loops: Loops, s) -> np.ndarray:
    """`lines_of` a mode of each loop of a batch, that whose eigenvalue is nearest to one of exp(s), `(loops, choices)`."""
    drawn, drift, size = loops.drawn(), drift_of(loops), len(s)
    period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
    if drawn.ticks == 1:
        return lines_of(np.ones((size, 1, 1)), s[:, 0], period)
    with named_loops(drawn), np.errstate(all="ignore"):
        ticks, _ = counted_ticks(ticks_of(drawn, alone=True, terms=True), drift)
        n, leads = len(ticks.states), [lead for lead, _ in drift.constant]
        inner = np.delete(np.arange(n), [*leads, *drift.unobserved])
        E = np.broadcast_to(frame_of(ticks), (size, n, n))
        own, units = balance(np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0)[:, inner[:, None], inner])
        delta, _ = eigenvalues(own)
        nearest = np.argmin(np.abs(delta[..., None] - np.expm1(s)[:, None]).min(-1), -1)
        delta = delta[np.arange(size), nearest]
        left, right = (part.reshape(units.shape) for part in vectors_of(own, delta))
        state, part = np.zeros((size, n, 1), complex), np.zeros((size, n))
        state[:, inner, 0], part[:, inner] = right * units, np.abs(left * right)
        for lead in leads:
            state[:, lead, 0] = np.where(delta == 0, 0.0, (E[:, lead] * state[..., 0]).sum(-1) / delta)
        rows, shown = _shown_by(loops.drawing, ticks.states, drift, part > APART * part.max(-1, keepdims=True))
        changes = [(np.eye(n) + each.E, None) for each in ticks.maps]
        moved = np.concatenate([*_in_ticks(ticks.kind.tolist(), changes, state, rows)], axis=-1)
        moved[~shown] = 0.0
        return lines_of(moved, np.log1p(delta).real + 1j * s[:, 0].imag, period)


def _shown_by(drawing: Drawing, states: tuple[str, ...], drift: MarginalModes, own) -> tuple[np.ndarray, np.ndarray]:
    """The states that a spectrum shows as rows over states that are counted from others, `(n, n)`, and which it shows of modes
    in which the states `own` take part, masks `(..., n)`.

    They are the states of plants, also a position of theirs that nothing else reads; what programs remember, a spectrum shows
    as stairs. Without a plant all are shown.
    """
    starts = [plant.start(block.name) for plant in drawing.plants for block in plant.members]
    starts += [f"{block.name}." for block in drawing.alone if block.plant]
    blocks, rows, own = np.array([name.rpartition(".")[0] for name in states]), np.eye(len(states)), own.copy()
    for lead, others in drift.constant:
        rows[[index for index, _ in others], lead] = [factor for _, factor in others]
        own[..., lead] = (own & (blocks == blocks[lead])).any(-1)
    plants = own & [name.startswith(tuple(starts)) for name in states]
    return rows, np.where(plants.any(-1, keepdims=True), plants, own)


def _in_ticks(kinds, changes, state, rows):
    """Yield `rows` times the states, complex `(..., n, columns)`, in each tick of a frame.

    kinds: of each tick. changes: per kind, the matrix, and what is added to each column, or None.
    """
    at = rows.argmax(-1)
    picked = (rows == np.eye(rows.shape[-1])[at]).all()  # which takes a tenth of a product's time
    for kind in kinds:
        yield state[..., at, :] if picked else times(rows, state)
        matrix, added = changes[kind]
        state = times(matrix, state)
        if added is not None:
            state += added


def strongest_in_cut(drawing: Drawing, opened: Opened, at, omega, bound: RequiredRegion | None) -> np.ndarray:
    """The strongest line (Hz) of the modes of frequency omega, `(n,)`, of the slices `at` of loops that are cut at a number.

    A mode is what a product of 1 moves, `(z - A)^-1 B`, whatever the number. bound: see `Search`.
    """
    loops, which, found = opened.loops, opened.which[at], np.abs(omega) / (2 * np.pi)
    frame, ticks, count = loops.frame, loops.frame.ticks, int(opened.which.max()) + 1
    kinds, n, leads = ticks.kind.tolist(), len(ticks.states), [lead for lead, _ in loops.drift.constant]
    if len(kinds) == 1:
        return found
    cut = loops.batch(count)
    period = np.broadcast_to(np.asarray(cut.period), cut.batch)[which]
    s = (np.log(bound.radius_of(period)) if bound else 0.0) + 1j * omega * period
    kept, force = np.array([ticks.states.index(name) for name in cut.states]), loops.drawn.inputs.index(PRODUCT)
    rows, shown = cut.remembered("shown", lambda: _shown_by(drawing, ticks.states, loops.drift, np.isin(np.arange(n), kept)))
    rows = rows[shown]

    def form(some):
        return reduced(in_even_units(cut.E[some], cut.B[some], np.broadcast_to(np.eye(kept.size), cut.E[some].shape)))

    def in_one_product():
        """What is shown in all ticks, as rows over the states and the product of a single loop, `(ticks, rows, n + 1)`."""
        whole = np.tile(np.eye(n + 1), (len(ticks.maps), 1, 1))
        for matrix, each in zip(whole, ticks.maps, strict=True):
            matrix[:n] += np.append(each.E.reshape(n, n), each.B[..., force].reshape(n, 1), axis=-1)
        shown = _in_ticks(kinds, [(matrix, None) for matrix in whole], np.eye(n + 1), np.append(rows, 0 * rows[:, :1], axis=-1))
        return np.stack([*shown])

    def followed(some, w):
        """What is shown in each tick, of some loops `(k,)` and the modes of their eigenvalues 1 + w, `(k, columns)`."""

        def of(part):
            return part[some] if part.ndim > 2 and len(part) > 1 else part

        alone = count == 1 and some.size == 1 and len(kinds) * len(rows) * max(n, w.shape[-1]) <= MOST
        pole, mode = polynomials(cut.remembered("form", lambda: form(some)) if alone else form(some), w)
        state = np.zeros((some.size, n, w.shape[-1]), complex)
        state[:, kept] = mode / pole[:, None]
        for lead in leads:
            moved = (of(frame.E)[..., lead, :, None] * state).sum(-2) + of(frame.B)[..., lead, :1]
            state[:, lead] = np.where(w == 0, 0.0, moved / w)
        if alone:
            all_ticks = cut.remembered("ticks", in_one_product)
            moved = times(all_ticks.reshape(-1, n + 1), np.append(state[0], np.ones((1, w.shape[-1])), axis=0))
            return moved.reshape(len(kinds), 1, len(rows), -1)
        forces = [of(each.B)[..., force, None] if np.any(each.B[..., force]) else None for each in ticks.maps]
        changes = [(np.eye(n) + of(each.E), added) for each, added in zip(ticks.maps, forces, strict=True)]
        return _in_ticks(kinds, changes, state, rows)

    order = np.argsort(which, kind="stable")
    order = order[s[order] != 0] if cut.integrates else order  # there nothing moves but the integrator
    first, begins, counts = np.unique(which[order], return_index=True, return_counts=True)
    row, place = np.repeat(np.arange(first.size), counts), np.arange(order.size) - np.repeat(begins, counts)
    index = np.repeat(order[begins][:, None], counts.max(initial=1), axis=1)  # of each loop's modes, filled up with its first
    index[row, place] = order
    share, few = np.empty(index.shape), max(1, MOST // (index.shape[-1] * n))
    with np.errstate(all="ignore"):
        for part in (slice(begin, begin + few) for begin in range(0, first.size, few)):
            seen = followed(first[part], np.expm1(s[index[part]]))
            share[part] = share_of_first(seen, len(kinds), s[index[part]])
        rest = order[~(share[row, place] > 1 / 2)]
        for own in (rest[begin : begin + few] for begin in range(0, rest.size, few)):
            moved = np.concatenate([*followed(which[own], np.expm1(s[own, None]))], axis=-1)
            found[own] = lines_of(moved, s[own], period[own])[:, 0]
    return found


def vectors_of(E, w):
    """Return the left and the right eigenvector next to w of each matrix, `(..., 1, n)` and `(..., n, 1)`, of product 1.

    They follow from this eigenvalue alone: the states of a delay make others that have too few vectors.
    """
    # Not quite at w: at an eigenvalue there is no inverse, and next to two of them the inverse is not known.
    beside, back = BESIDE * np.abs(w) + ROUNDED * np.finfo(float).eps * np.abs(E).max((-1, -2)), np.full(E.shape, np.nan + 0j)
    for farther in FARTHER:
        some = np.flatnonzero(~np.isfinite(back).all((-1, -2)))
        if some.size:
            back[some] = inverse(E[some] - (w + farther * beside)[some, None, None] * np.eye(E.shape[-1]))
    start = np.cos(np.arange(1, E.shape[-1] + 1))
    right, left = back @ start[:, None], start @ back
    right, left = (part / np.abs(part).max((-1, -2) if part.ndim > 2 else -1, keepdims=True) for part in (right, left))
    right, left = back @ right, left[:, None] @ back
    right, left = (part / np.abs(part).max((-1, -2), keepdims=True) for part in (right, left))
    return left / (left @ right), right
