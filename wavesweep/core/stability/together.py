"""Loops of other numbers of states in one batch: a call takes as long as some hundred loops."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from wavesweep.core.monodromy.cut import ERRORS, PARTS, Cut
from wavesweep.core.stability.bernstein import MOST
from wavesweep.core.stability.crossings import warp_scale
from wavesweep.core.stability.intervals import Intervals
from wavesweep.core.stability.stable import stable_intervals

LEAST = 0.5  # of the states, that a loop which is filled up has of its own


def may_join(cut: Cut, order: int) -> bool:
    """Whether loops may be filled up to `order` states: not if the numbers do not act on some, or if poles are exactly 1, or if
    the signs of so many coefficients prove nothing."""
    return LEAST * order <= cut.order <= order <= MOST and not (cut.others or cut.poles_at_one)


def filled_up(cuts: Sequence[Cut], order: int) -> Cut:
    """Return all the loops of several batches in one, with further states, `order` in all, that nothing acts on or reads.

    The further eigenvalues are as far from 1 as the poles are in the mean, so the scale of the warp remains (`warp_scale`). On
    the circle the characteristic equation gains a factor without a zero.
    """
    n, ends = order - cuts[0].integrates, np.cumsum([0, *(cut.batch[0] for cut in cuts)])
    shapes = {"E": (n, n), "B": (n, 1), "C": (3, n), "D": (3, 1)}
    found = {name: np.zeros((ends[-1], *shapes[name[-1]])) for name in (*PARTS, *ERRORS)}
    for cut, *loops in zip(cuts, ends[:-1], ends[1:], strict=True):
        for name, part in found.items():
            own = getattr(cut, name)
            part[slice(*loops), : own.shape[-2], : own.shape[-1]] = own
        further = np.arange(cut.E.shape[-1], n)
        found["E"][slice(*loops), further, further] = -warp_scale(cut)[:, None]
    period = np.concatenate([np.broadcast_to(cut.period, cut.batch) for cut in cuts])
    return replace(max(cuts, key=lambda cut: cut.order), **found, period=period)


def each_in_one_call(cuts: Sequence[Cut], along: str, span, fixed: Sequence[np.ndarray], order: int) -> list[Intervals]:
    """Return what `stable_intervals` does for each batch of loops, computed in one call for all.

    fixed: of each batch, `(loops, columns)`, equally many columns in all; loops: as `may_join` permits, which either all have
    an integrator or none. order: of the loops filled up.
    """
    whole = stable_intervals(filled_up(cuts, order), along, span, np.concatenate(fixed))
    begins = np.cumsum([0, *(each.size for each in fixed)])
    parts = [whole.take(slice(*pair)) for pair in pairwise(np.searchsorted(whole.column, begins))]
    return [replace(part, column=part.column - begin) for part, begin in zip(parts, begins[:-1], strict=True)]
