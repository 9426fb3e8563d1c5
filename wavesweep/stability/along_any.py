"""Stable intervals along any number of a loop, from its eigenvalues."""

from dataclasses import replace
from functools import partial

import numpy as np

from wavesweep.stability.certificate import COUNTS, NONE, SEARCH
from wavesweep.stability.frames import NODES, Frames, level, pole_inside
from wavesweep.stability.guardian_maps import (
    EPS,
    MOST_ERROR,
    MOST_ORDER,
    PAIR,
    SURELY_UNSTABLE,
    from_coefficients,
    from_eigenvalues,
    surely_unstable_by_traces,
)
from wavesweep.stability.interpolated import interpolated_loop
from wavesweep.stability.labelled import LOST, NARROWEST, UNKNOWN, UNSTABLE, labelled_parts
from wavesweep.stability.non_nilpotent import MoreStatesError, RecalledError, living, typical
from wavesweep.stability.panels import RIM, ROUGH, panel_roots
from wavesweep.stability.polishing import ATTACHED, polished
from wavesweep.stability.regions import NEAR_ZERO, count_where_clear, cut_span
from wavesweep.stability.spans import are_in, weight_touching
from wavesweep.stability.stable import MOST_STATES, Intervals, doubts_of, intervals_of, uneven_units

MANY, FEW = 512, 8  # so many open panels of one column are, too; in parts that may be surely unstable
TURN = 10.0  # of a span, where a bent variable turns from one that is even to its logarithm
WIDE = 3.0  # ratio of the span's ends above which its logarithm is the variable
FINE = 1e-6  # error of a value over the largest of its panel, up to which its roots can be told
UNSOLVED = 1e8  # condition of loops of direct terms so near to a value without a solution that it may be given as an end
EXACT = 1e-9  # of an end, what rounding may move it by; and of a NEAR_ZERO-th of the span
BENT, FROM_ZERO = "bent", "from zero"  # variables that are not chosen by the span


def stable_along_any(evaluate, span, columns: int, period, bounds=(-np.inf, np.inf), variable="") -> Intervals:
    """All stable intervals of every column within span = (low, high) of a parameter p that may enter in any smooth way.

    evaluate(column, p): `Frames` of these columns at these values, real or complex, one after the other; or matrices `(...,
    order, order)` without poles, analytic in p. p: `(n,)` as column, or `(m, k)` if column is `(m, 1)`. columns: number of
    columns. period: of the frame, in s, `(columns,)`. bounds: p beyond them has no loop, a number or `(columns,)` each.
    variable: BENT, the logarithm of the distance from the low end and a TURN-th of the span, as stiffnesses and dampings have
    poles below zero; FROM_ZERO, the logarithm of p from ATTACHED of the span on, for a span from 0, at which the loop need not
    be analytic and eigenvalues may leave z = 1 as any power of p; otherwise it is the logarithm of p if high > WIDE low > 0, as
    masses, impedances and cutoffs act by their ratios, or else p.

    With eigenvalues z_i of the frame, `prod_{i<j} (1 - z_i z_j)`, `prod (1 - z_i)` and `prod (1 + z_i)` are real analytic
    functions of p that vanish if a complex pair, z = 1 or z = -1 is on the unit circle (the first also if two real
    eigenvalues are reciprocal: then the counts do not change). They follow from the characteristic polynomial (`critical`),
    which is interpolated between a few values of p (`interpolated`). The roots are found and proved on Chebyshev
    panels, with the size of the functions beside the real axis as the bound on the parts that the samples do not show
    (`panels`); polished on the eigenvalue itself; and the counts of unstable eigenvalues in every region must change by 2 or 1
    accordingly. If the sum of their fourth powers (of their sixteenth for large frames), or of the products of two of these,
    proves that one lies outside all over a panel, its crossings are not searched for.
    A part of the span that could not be proved has no label; its column is in doubt, and the rest of it is given.
    Accuracy: ends to 1e-9 relative, usually 1e-13; those within 1e-9 of the span of its low end are given as that end, and as
    its high end those that are as near to it as ends are exact.
    """
    low, high = span
    if variable == FROM_ZERO:
        low = ATTACHED * high
    if variable == BENT:
        unit, slope = (high - low) / TURN, lambda t: unit * np.exp(t)
        into, out = lambda p: np.log1p((p - low) / unit), lambda t: low + unit * np.expm1(t)
    elif low > 0 and high > WIDE * low:
        unit, into, out, slope = low, np.log, np.exp, None
    else:
        unit, into, out, slope = np.inf, _same, _same, np.ones_like
    ends = into(low), into(high)
    with np.errstate(all="ignore"):  # of the logarithm of what has none
        bounds = np.stack([np.zeros(columns) + end for end in bounds])
        bounds = np.where(bounds > low - unit, into(bounds), -np.inf)

    def slack(t):
        return EXACT + 0 * t if slope is None else EXACT * (np.abs(out(t)) + NEAR_ZERO * (high - low)) / slope(t)

    found = _by_recalled_states(partial(_through, evaluate, out), ends[:2], columns, period, bounds, slack)
    # The range's own ends are given back as they were, not as they come out, and 0 within it as what it is but for rounding.
    nothing = EPS * (high - low) if low < 0 < high else 0.0
    lows, highs = (
        np.where(part == end, own, np.where(np.abs(out(part)) <= nothing, 0.0, out(part)))
        for part, end, own in zip((found.low, found.high), ends[:2], span, strict=True)
    )
    return replace(found, low=lows, high=highs)


def _same(p):
    return p


def _by_recalled_states(evaluate, span, columns, period, bounds, slack) -> Intervals:
    """The intervals in the variable, the columns whose frames forget the same states together; slack: see `_of_columns`."""
    recurring, sizes = typical(evaluate, span, columns)
    units = uneven_units(sizes)
    if (units != 1).any():
        evaluate, ratio = partial(_in_units, evaluate, units), units[:, None, :] / units[:, :, None]
        recurring, sizes = recurring * ratio, sizes * ratio
    kept, done = living(recurring), []
    pending = np.arange(columns)
    while pending.size:
        names = pending[(kept[pending] == kept[pending[0]]).all(1)]
        mask = kept[names[0]]
        try:
            part = _of_columns(
                partial(_of, evaluate, names), span, names.size, period[names], bounds[:, names], slack, sizes[names], mask
            )
        except RecalledError as error:
            kept[names[error.columns]] = True
            continue
        done.append(replace(part, column=names[part.column]))
        pending = np.setdiff1d(pending, names)
    whole = Intervals.join(done)
    return whole.take(np.argsort(whole.column, kind="stable"))


def _through(evaluate, out, column, t):
    with np.errstate(over="ignore"):  # beside the largest doubles
        p = out(t)
    return evaluate(column, p)


def _in_units(evaluate, units, column, p):
    """Frames in other units of the states; those of other states than the typical ones are left as they are."""
    found = Frames.of(evaluate(column, p))
    if found.E.shape[-1] != units.shape[-1]:
        return found
    own = units[np.broadcast_to(column, p.shape).ravel()]
    with np.errstate(all="ignore"):  # a loop may overflow beside the real axis
        return replace(found, E=found.E * (own[:, None, :] / own[:, :, None]))


def _of(evaluate, names, column, p):
    return evaluate(names[column], p)


def _of_columns(evaluate, span, columns, period, bounds, slack, sizes, kept) -> Intervals:
    """The intervals of columns whose frames forget the same states.

    slack(p): by how much rounding may move an end. sizes, kept: see `interpolated_loop`. The others: see `stable_along_any`.
    """
    loop, found = _roots(evaluate, span, columns, bounds, sizes, kept)
    ends = polished(evaluate, loop, found, span, slack)
    ends, labelled = labelled_parts(evaluate, span, found, ends, partial(_surely_unstable, loop, columns, bounds))
    return intervals_of(*_counted_regions(evaluate, span, columns, ends, labelled, slack), period)


def _counted_regions(evaluate, span, columns, ends, labelled, slack):
    """The regions between ends and labelled parts with their counts of unstable eigenvalues, and the doubt of each column."""
    owner = np.concatenate([part for some in labelled for part in (some[0], some[0])])
    edge = np.concatenate([part for some in labelled for part in some[1:3]])
    nowhere = np.full(edge.size, np.nan)
    jump = np.concatenate([np.where(ends.function == PAIR, 2.0, 1.0), nowhere])
    error = np.abs(np.concatenate([ends.miss, np.zeros(edge.size)]))
    attached = ATTACHED * (span[1] - span[0]), slack(span[1])
    parts = cut_span(
        span,
        columns,
        np.concatenate([ends.column, owner]),
        np.concatenate([ends.value, edge]),
        np.concatenate([ends.theta, nowhere]),
        jump,
        slack=attached,
    )
    label, doubt = _given(parts, labelled)
    counted = np.flatnonzero(label == 0)
    unstable = label.copy()

    def matrices(some, value):
        return Frames.of(evaluate(parts.column[some], value)).E

    unstable[counted] = count_where_clear(parts, counted, lambda some, value: (matrices(some, value), None))
    hidden = counted[unstable[counted] < 0]  # by the rounding of an eigenvalue that is very large, for one
    if hidden.size:
        surely, _ = surely_unstable_by_traces(matrices(hidden, parts.at(0.5)[hidden]))
        label[hidden[surely]] = unstable[hidden[surely]] = UNSTABLE
    unstable = _as_beside(parts, label, unstable)
    before, after = parts.has_next, parts.has_previous
    gain = parts.gain[after]
    uncounted = (label[before] == UNSTABLE) & (unstable[after] > 0) | (label[after] == UNSTABLE) & (unstable[before] > 0)
    fits = np.isnan(gain) | (np.abs(unstable[after] - unstable[before]) == gain) | uncounted
    found = parts.labelled(unstable, doubt, np.where(fits, NONE, COUNTS), error[parts.order])
    found = replace(found, unstable=np.where(found.doubt == COUNTS, UNKNOWN, unstable))
    return found, doubts_of(found, _doubts_at_ends(evaluate, span, columns, attached, labelled[LOST]))


def _as_beside(parts, label, unstable):
    """Counts of regions, those that are not known but go on from a part that is unstable throughout as of one eigenvalue.

    Nothing crosses in a region, nor at an end that no crossing makes.
    """
    before, after = np.flatnonzero(parts.has_next), np.flatnonzero(parts.has_previous)
    open_, found = np.isnan(parts.gain[after]), unstable.copy()
    for one, other in ((before, after), (after, before)):
        found[one[open_ & (label[one] == 0) & (unstable[one] < 0) & (label[other] == UNSTABLE)]] = 1
    return found


def _doubts_at_ends(evaluate, span, columns, attached, lost):
    """SEARCH for columns whose loop has no solution at an end of the span, or next to it.

    attached: distances up to which a part is given as the end itself, as a crossing is. lost: parts, see `_labelled_parts`.
    """
    doubt, (owner, left, right, *_) = np.zeros(columns, int), lost
    beside = left - span[0] <= attached[0], span[1] - right <= attached[1]
    for end, touching in zip(span, beside, strict=True):
        some = np.unique(owner[touching])
        if some.size:
            unsolved = ~(Frames.of(evaluate(some, np.full(some.size, end))).condition < UNSOLVED)
            doubt[some[unsolved]] = SEARCH
    return doubt


def _roots(evaluate, span, columns, bounds, sizes, kept, order=0):
    """The loop as it is interpolated, the roots of its critical functions, and the panels on which these are settled or lost.

    order: of the largest frames, if it is known.
    """
    smallest = NARROWEST * (span[1] - span[0])
    try:
        loop = interpolated_loop(evaluate, span, columns, bounds, sizes, kept, order)
        first = loop.pieces.column, loop.pieces.low, loop.pieces.high
        return loop, panel_roots(_sampler(loop), *first, columns, smallest, MANY, bounds, settling=SURELY_UNSTABLE)
    except MoreStatesError as more:
        return _roots(evaluate, span, columns, bounds, sizes, kept, more.order)


def _surely_unstable(loop, columns, bounds, column, low, high):
    """Whether SURELY_UNSTABLE is proved to be positive all over these parts, whatever crosses there."""
    functions, smallest = _sampler(loop), NARROWEST * (loop.span[1] - loop.span[0])

    def sample(column, p):
        phase, log, error = functions(column, p)
        return phase, log, np.concatenate([np.full_like(error[:SURELY_UNSTABLE], MOST_ERROR), error[SURELY_UNSTABLE:]])

    found = panel_roots(sample, column, low, high, columns, smallest, FEW, bounds, settling=SURELY_UNSTABLE)
    left = [np.concatenate(some) for some in zip(found.lost, found.overflown, strict=True)]
    return weight_touching(column, low, high, *left, np.ones(left[0].size)) == 0


def _given(parts, labelled):
    """Label and doubt of every region that lies in a part which is not to be counted; 0 and NONE elsewhere."""
    label, doubt = np.zeros(parts.column.size, int), np.zeros(parts.column.size, int)
    for owner, left, right, what, why in labelled:
        inside = are_in(parts.column, parts.at(0.5), owner, left, right)
        label, doubt = np.where(inside, what, label), np.where(inside, why, doubt)
    return label, doubt


def _sampler(loop):
    """The function that `panel_roots` samples: the critical functions of these columns at these points.

    They come from interpolated characteristic polynomials; if their own error would be more than FINE, from those of frames,
    and then from eigenvalues.
    """

    def sample(column, p):
        most = ROUGH if np.iscomplexobj(p) else FINE
        found = [np.empty((4, *p.shape), kind) for kind in (complex, float, float)]
        piece = loop.piece(column, p)
        known = loop.pieces.degree[piece] > 0
        some, rest = np.flatnonzero(known), np.flatnonzero(~known)
        if some.size:
            parts = loop.functions(piece[some], p[some])
            for whole, part in zip(found, parts, strict=True):
                whole[:, some] = part
            rest = np.sort(np.append(rest, some[_too_rough(parts, most)]))
        if rest.size:
            E, pivots = loop.computed(column[rest], p[rest])
            parts = _of_frames(E, loop.units[column[rest]], most)
            for whole, part in zip(found, parts, strict=True):
                whole[:, rest] = part
            at = np.flatnonzero(~known[rest]) if np.iscomplexobj(p) else rest[:0]
            at = at[(pivots[at] != pivots[at][:, :1]).any((1, 2))]  # a pivot that is constant has no zero
            if at.size:  # the rim of a panel: with a pole inside it bounds nothing
                middle = p[rest[at]].real.mean(-1, keepdims=True)
                half = np.abs(p[rest[at]].real - middle).max(-1, keepdims=True) / RIM.real.max()
                _, inside = loop.computed(column[rest[at]], middle + half * NODES)
                found[1][:, rest[at[pole_inside(pivots[at], level(inside))]]] = np.inf
        return tuple(found)

    return sample


def _of_frames(E, units, most):
    """The same from frames, `(panels, points, n, n)`; most: error of the functions that is let pass."""
    panels, points, n, _ = E.shape
    E, units = E.reshape(-1, n, n), np.repeat(units, points, axis=0)
    if n > MOST_ORDER and not np.iscomplexobj(E):
        return _where_unsure(E, units, panels)
    if n > MOST_STATES:
        return [part.reshape(4, panels, points) for part in from_eigenvalues(E, units)]
    found = [part.reshape(4, panels, points) for part in from_coefficients(E, units)]
    again = np.flatnonzero(_too_rough(found, most))
    if again.size:
        rows = (again[:, None] * points + np.arange(points)).ravel()
        for part, better in zip(found, from_eigenvalues(E[rows], units[rows]), strict=True):
            part[:, again] = better.reshape(4, again.size, -1)
    return found


def _where_unsure(E, units, panels):
    """The functions from eigenvalues; of panels that seem surely unstable at every point the one that says so, and no other.

    The others are like it there, but not known. On panels that are not surely unstable in their middle that one is negative.
    """
    rows = np.arange(len(E)).reshape(panels, -1)
    found = [np.full((4, *rows.shape), each) for each in (-1.0 + 0j, 0.0, MOST_ERROR)]
    one = rows[:, rows.shape[1] // 2]
    some = np.flatnonzero(surely_unstable_by_traces(E[one], units[one])[0])
    unsure = np.ones(panels, bool)
    if some.size:
        sure, parts = surely_unstable_by_traces(E[rows[some].ravel()], units[rows[some].ravel()])
        for whole, part in zip(found, parts, strict=True):
            whole[:, some] = part.reshape(some.size, -1)
        found[2][:SURELY_UNSTABLE] = MOST_ERROR
        unsure[some] = ~sure.reshape(some.size, -1).all(1)
    rest = np.flatnonzero(unsure)
    if rest.size:
        at = rows[rest].ravel()
        traces = [part[SURELY_UNSTABLE, rest].ravel() for part in found]
        for part, better in zip(found, from_eigenvalues(E[at], units[at], traces), strict=True):
            part[:, rest] = better.reshape(4, rest.size, -1)
    return found


def _too_rough(found, most):
    """Whether some function of a panel, but for SURELY_UNSTABLE, has too large an error beside its largest value, or is not
    known; if frames overflow, nothing can be better."""
    _, log, error = (part[:SURELY_UNSTABLE] for part in found)
    with np.errstate(all="ignore"):
        relative = np.exp(log - log.max(-1, keepdims=True))
        known = (np.finfo(float).eps * (error * relative).max(-1) <= most) & (log > -np.inf).all(-1)
    return ~known.all(0) & (log < np.inf).all((0, -1))
