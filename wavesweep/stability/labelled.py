"""Parts of the span whose eigenvalues outside the unit circle are not counted, and what is known of them.

On some the panels prove that an eigenvalue is outside throughout, or prove nothing; others lie about roots whose place rounding
hides.
"""

import numpy as np

from wavesweep.stability.certificate import NONE, OVERFLOW, SEARCH
from wavesweep.stability.frames import Frames
from wavesweep.stability.guardian_maps import PAIR
from wavesweep.stability.spans import are_in, merged, weight_touching
from wavesweep.stability.spectrum import count_outside

NARROWEST = 1e-10  # of the span; a panel this narrow that proves nothing is given up
HALVINGS = 24  # of the disc of a root that is not certain, from its end on
LOOKS = 9  # at a part that may be unstable throughout, from end to end
UNSTABLE, UNKNOWN = 1, -1  # labels of parts of the span that are not counted
LOST = 1  # place of the parts that were not proved among these


def labelled_parts(evaluate, span, found, ends, surely_unstable):
    """The ends that are certain and in no part of the span that is labelled, and these parts: column, low, high, label, doubt.

    found: of the panels, see `panel_roots`; ends: polished roots. A reciprocal pair of real eigenvalues crosses nothing.
    """
    unsure = ends.take(~ends.good)
    doubtful = merged(unsure.column, *_about(evaluate, span, unsure))
    crossed = never_stable(evaluate, found, *doubtful)
    crossed[~crossed] = surely_unstable(*(part[~crossed] for part in doubtful))
    labelled = [
        (*merged(*some), label, doubt)
        for some, label, doubt in (
            (found.settled, UNSTABLE, NONE),
            (found.lost, UNKNOWN, SEARCH),
            (found.overflown, UNKNOWN, OVERFLOW),
            ([part[~crossed] for part in doubtful], UNKNOWN, SEARCH),
            ([part[crossed] for part in doubtful], UNSTABLE, NONE),
        )
    ]
    ends = ends.take(ends.good & ((ends.function != PAIR) | (ends.theta > 0)))
    for owner, left, right, _, _ in labelled:
        ends = ends.take(~are_in(ends.column, ends.value, owner, left, right))
    return ends, labelled


def never_stable(evaluate, found, column, left, right):
    """Whether these parts are unstable throughout, wherever the crossings in them are.

    found: of the panels. From one end of a part to the other the count of unstable eigenvalues goes up or down by 2 or 1 at
    each root, and so by no more than their sum. If the counts at both ends together are larger than that, it does not reach 0
    between them; nor does it if it is odd and only pairs cross. Every root counts whose disc touches the part, as often as it
    was found; no panel without all of its roots may touch it. A part of which that does not say enough is cut at LOOKS places.
    """
    never = np.zeros(column.size, bool)
    for looks in (2, LOOKS):
        some = np.flatnonzero(~never)
        if some.size:
            places = np.linspace(left[some], right[some], looks, axis=-1)
            never[some] = _never_stable_between(evaluate, found, column[some], places)
    return never


def _never_stable_between(evaluate, found, column, places):
    """See `never_stable`; places: of each part, in order, `(parts, looks)`, its ends first and last."""
    looks, at = places.shape[1], np.arange(places.shape[1])
    count, clear = (part.reshape(places.shape) for part in count_outside(Frames.of(evaluate(column[:, None], places)).E))
    # Stretches from each place to the next, or wider where the count at one of these is not clear.
    from_ = np.maximum.accumulate(np.where(clear, at, 0), -1)[:, :-1]
    to = np.minimum.accumulate(np.where(clear, at, looks - 1)[:, ::-1], -1)[:, ::-1][:, 1:]
    low, high, one, other = (np.take_along_axis(part, index, -1).ravel() for part in (places, count) for index in (from_, to))
    stretches = np.repeat(column, looks - 1), low, high
    discs, pair = (found.column, found.x - found.within, found.x + found.within), found.function == PAIR
    pairs, singles = (
        weight_touching(*stretches, *(part[kind] for part in discs), np.ones(kind.sum())) for kind in (pair, ~pair)
    )
    open_ = sum(
        weight_touching(*stretches, *part, np.ones(part[0].size)) for part in (found.lost, found.overflown, found.settled)
    )
    odd = (singles == 0) & (one % 2 == 1) & (other % 2 == 1)
    never = ((one + other > 2 * pairs + singles) | odd) & (open_ == 0)
    return clear[:, 0] & clear[:, -1] & never.reshape(-1, looks - 1).all(-1)


def _about(evaluate, span, unsure):
    """The parts about uncertain ends: low, high.

    They go beyond the end by NARROWEST of the span, and on a side as far as its disc if the count of unstable eigenvalues is
    not clear there, or another one than at the end of the disc: then the root may be between. Halving takes off what has the
    same count as that end, since the disc has one root only.
    """

    def counted(column, places):
        return count_outside(Frames.of(evaluate(column, places)).E)

    width, parts = NARROWEST * (span[1] - span[0]), []
    for side, ends in ((-1, np.minimum(unsure.first, unsure.value)), (1, np.maximum(unsure.last, unsure.value))):
        near, far = np.clip(unsure.value + side * width, *span), np.clip(ends, *span)
        some = np.flatnonzero(side * (far - near) > 0)
        if some.size:
            column, inner, outer = unsure.column[some], near[some], far[some]
            (beyond, sure), (count, clear) = counted(column, outer), counted(column, inner)
            open_ = ~(sure & clear & (count == beyond))
            for _ in range(HALVINGS):
                middle = (inner + outer) / 2
                count, clear = counted(column, middle)
                same = sure & clear & (count == beyond)
                inner, outer = np.where(same, inner, middle), np.where(same, middle, outer)
            near[some] = np.where(open_, outer, near[some])
        parts.append(near)
    return parts
