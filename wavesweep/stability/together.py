"""Loops of other numbers of states in one batch: a call takes as long as some hundred loops."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from wavesweep.monodromy.cut import ERRORS, PARTS, Cut
from wavesweep.stability.crossings import warp_scale
from wavesweep.stability.stable import Intervals, stable_intervals

LEAST = 0.5  # of the states, that a loop which is filled up has of its own


def may_join(cut: Cut, order: int) -> bool:
    """Whether loops may be filled up to `order` states: not if the numbers do not act on some, or if poles are exactly 1."""
    return LEAST * order <= cut.order <= order and not (cut.others or cut.poles_at_one)


def filled_up(cut: Cut, order: int) -> Cut:
    """Return the loops with further states, `order` in all, that nothing acts on and nothing reads.

    Their eigenvalues are as far from 1 as the poles are in the mean, so the scale of the warp remains (`warp_scale`). On the
    circle the characteristic equation gains a factor without a zero.
    """
    n, more = cut.E.shape[-1], order - cut.order
    if not more:
        return cut
    own, after = np.arange(n, n + more), ((0, 0),) * len(cut.batch)
    rows, columns = (*after, (0, more), (0, 0)), (*after, (0, 0), (0, more))
    found = {}
    for E, B, C in (("E", "B", "C"), ("dE", "dB", "dC")):
        found[E] = np.pad(getattr(cut, E), (*after, (0, more), (0, more)))
        found[B], found[C] = np.pad(getattr(cut, B), rows), np.pad(getattr(cut, C), columns)
    found["E"][..., own, own] = -np.broadcast_to(warp_scale(cut), cut.batch)[..., None]
    return replace(cut, **found, states=(*cut.states, *[""] * more))


def each_in_one_call(cuts: Sequence[Cut], along: str, span, fixed: Sequence[np.ndarray], order: int) -> list[Intervals]:
    """Return what `stable_intervals` does for each batch of loops, computed in one call for all.

    fixed: of each batch, `(loops, columns)`, equally many columns in all; loops: as `may_join` permits, which either all have
    an integrator or none. order: of the loops filled up.
    """
    filled = [filled_up(cut, order) for cut in cuts]
    parts = {name: np.concatenate([getattr(each, name) for each in filled]) for name in (*PARTS, *ERRORS, "period")}
    whole = stable_intervals(replace(filled[0], **parts), along, span, np.concatenate(fixed))
    begins = np.cumsum([0, *(each.size for each in fixed)])
    ends = np.searchsorted(whole.column, begins)
    parts = [whole.take(slice(*pair)) for pair in pairwise(ends)]
    return [replace(part, column=part.column - begin) for part, begin in zip(parts, begins[:-1], strict=True)]
