"""Stable intervals along a number that is no wall of one of the controllers: the loop is compiled again at every value."""

from dataclasses import replace

import numpy as np

from wavesweep.analysis.doubt import NONE
from wavesweep.analysis.intervals import Intervals, stable_along_any
from wavesweep.analysis.intervals.frames import Frames
from wavesweep.analysis.spectrum import count_outside
from wavesweep.diagram import WALL, draw, keys_read
from wavesweep.lifted import close, cut_at_wall, with_batch
from wavesweep.lifted.cut import moves_on, wall_pivot
from wavesweep.sweep.grid import FAST, selected

TINY = 1e-300  # in place of a zero, which would take a state out of the loop


def along_any_number(task, values, own):
    """Return the intervals of the loops `values`, each closed with every wall of `own`, in a task along such a number.

    own: path -> value of both numbers of the wall, `(loops, walls)`. A loop is compiled again at every value, once for all
    walls. One that is nowhere stable by its drawing is given as such if its numbers, in the middle of the range, agree.
    """
    size, walls = own[WALL[0]].shape

    def evaluate(number, p):
        number, p = (each.ravel() for each in np.broadcast_arrays(number, p))
        loop, wall = np.divmod(number, walls)
        first, back = _different(loop, p) if walls > 1 else (slice(None), slice(None))
        at, p = loop[first], np.where(p[first] == 0, TINY, p[first])
        changed = varied(task, values, at, p)
        with np.errstate(all="ignore"):  # a loop may overflow beside the real axis; the panels look for such numbers
            cuts = with_batch(cut_at_wall(draw(changed)), p.size).at(back)
            there = [p[back] if path == task.along else own[path][loop, wall] for path in WALL]
            return Frames(close(cuts, *there), (cuts.pivot * wall_pivot(cuts, *there))[:, None], cuts.condition)

    rate = np.broadcast_to(np.asarray(values["rates.fast_hz"], float), (size,))
    period, bounds = np.repeat(draw(values).ratio / rate, walls), [np.repeat(end, walls) for end in _bounds(task, values, rate)]
    restless = np.flatnonzero(_restless(task, values, own))
    if restless.size:  # their numbers have to agree
        restless = restless[~count_outside(evaluate(restless, np.full(restless.size, sum(task.span) / 2)).E)[1]]
    if not restless.size:
        return _in_own_time(task, stable_along_any(evaluate, task.span, size * walls, period, bounds), rate, walls)
    open_, found = np.setdiff1d(np.arange(size * walls), restless), [_nowhere(restless)]
    if open_.size:
        between = [end[open_] for end in bounds]
        part = stable_along_any(lambda column, p: evaluate(open_[column], p), task.span, open_.size, period[open_], between)
        found.append(replace(part, column=open_[part.column]))
    whole = Intervals.join(found)
    return _in_own_time(task, whole.take(np.argsort(whole.column, kind="stable")), rate, walls)


def _restless(task, values, own):
    """Which columns are nowhere stable by their drawing, whatever their numbers are; see `moves_on`."""
    p = max(task.span, key=abs)
    structure = draw(varied(task, values, np.zeros(1, int), np.array([p]))).structure
    there = [np.ravel(own[path] != 0) if path != task.along else np.full(own[path].size, p != 0) for path in WALL]
    if structure is None:
        return np.zeros(there[0].size, bool)
    return np.array([moves_on(structure, wall) for wall in zip(*(part.tolist() for part in there), strict=True)])


def _nowhere(column):
    """These columns without a stable interval, certified."""
    nothing, none = np.full(column.size, np.nan), np.zeros(column.size, int)
    return Intervals(column, none - 1, none, nothing, nothing, nothing, nothing, none + NONE, np.zeros(column.size))


def varied(task, values, at, p):
    """The values of some loops at other values of the parameter, with those that follow it."""
    changed = selected(values, at) | {task.along: p}
    return changed | {path: changed[path] * p for path in getattr(task, "ties", ())}


def _different(loop, p):
    """Indices of the different pairs of loop and value, and for each pair the place of its equal among these.

    With a single wall there are no equal ones.
    """
    order = np.lexsort((p.imag, p.real, loop))
    new = np.append(True, (loop[order[1:]] != loop[order[:-1]]) | (p[order[1:]] != p[order[:-1]]))[: p.size]
    back = np.empty(p.size, int)
    back[order] = np.cumsum(new) - 1
    return order[new], back


def _bounds(task, values, rate):
    """The bounds of the parameter in each loop: a cutoff may go half way from the span to half the fast rate (Hz), and so may
    that rate to twice the cutoffs."""
    low, high = (np.broadcast_to(end, rate.shape) for end in task.bounds)
    if task.along.endswith("cutoff_hz"):
        high = np.minimum(high, (task.span[1] + rate / 2) / 2)
    if task.along == FAST:
        for path in keys_read(values):
            name, _, key = path.rpartition(".")
            if key == "cutoff_hz" and values[f"{name}.order"]:  # of order 0 it is no filter
                low = np.maximum(low, (task.span[0] + 2 * values[path]) / 2)
    return low, high


def _in_own_time(task, found, rate, walls):
    """The intervals, each omega of one along the fast rate with the rate at its end."""
    if task.along != FAST:
        return found
    own = rate[found.column // walls]
    return replace(found, low_omega=found.low_omega * (found.low / own), high_omega=found.high_omega * (found.high / own))
