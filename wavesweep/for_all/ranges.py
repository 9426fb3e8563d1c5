"""Boxes of unknown numbers while frames vary: in every box all frames shrink, in norms that depend on its numbers.

Unknown means constant in time, and the proof has to use it: in one norm for the whole box, numbers that jump from frame to
frame would be proved as well, and often these are not stable. In each part of the box the norms are found for its middle, and
their slopes from the same equations: the form of node i at s is `P_i + sum_k s_k D_ik`. `norm_check` proves what is found here.
A part that is not proved is divided along the side that moves the slack most.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import count

import numpy as np

from wavesweep.for_all.average import OnAverage, forms_on_average
from wavesweep.for_all.loop_numbers import FramesOver
from wavesweep.for_all.norm_check import shrink_over
from wavesweep.for_all.norms import CALLS, Centre, find_norms, recentred, sloped
from wavesweep.for_all.patterns import Word, growing, growth
from wavesweep.for_all.polynomials import Polynomials, monomials

# Margin by which the frames in the middle of a box are made to shrink more than necessary: so much, at most so much of what
# the spectral radii of frames and words leave. A graph is made finer up to the second share, and used up to the first one.
MARGIN, SHARES = 1e-3, (0.5, 0.1)
BACK = 0.5  # of the margin that norms have, with which they are centred
SEARCH = 4e9  # operations of one search for norms in the middle of a box, or more where these are fewer than
NEWTON = 200  # steps on the smallest graph
STEPS = 3  # of Newton's method for the middle of a box, from the norms of the box that it is a half of
SHARED = 0.05  # of the slack: what the rest of a box's polynomials may cost for its halves to go on with them
HOPELESS = 4  # times the number of sides: parts of parts without norms, after which a proof ends
EACH = 280  # operations that take as long as what is done with each entry of the polynomials
NARROW = 1e-6  # of a side, below which a box is not divided along it

Box = np.ndarray
FramesAt = Callable[[Box], "FramesOver | int"]


@dataclass(frozen=True, slots=True, eq=False)
class Covering:
    """What is known of a box, `(2, sides)`.

    open: the parts that are not proved, as boxes. end: all is proved up to this value of the first side. used: operations.
    point, word: a place at which the word grows, if one was met.
    """

    open: tuple[Box, ...]
    end: float
    used: float
    point: np.ndarray | None = None
    word: Word = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A part of the box that is still to be proved.

    frames: of it, or of a box around it; known: polynomials of a box around it that are good enough, with that box; start:
    norms of that; barren: how often no norms were found in a row, for it and for the boxes around it.
    """

    box: Box
    frames: FramesOver | None = None
    known: tuple[Box, Polynomials] | None = None
    start: Centre | None = None
    barren: int = 0


def cover(
    frames_at: FramesAt,
    box: Box,
    follows: np.ndarray | OnAverage,
    work: float,
    up: bool = True,
    words: Sequence[Word] = (),
    report: Callable[[float], None] | None = None,
) -> Covering:
    """Prove that all frames of a box shrink in every order, or on average, except in the parts that are left open.

    The proof goes along the first side, up or down: the part that is tried next is always one that holds it up. It ends where a
    word is met that grows. work: operations after which it ends. words: those that grow fastest beyond the box. report: is
    called with the value of the first side that the proof has reached.
    """
    number, queue, used, word = count(), [(0.0, 0, _Part(box))], 0.0, ()
    divided = set()  # stretches of the first side in whose middle there were no norms: they are divided for all other numbers
    while queue and used < work:
        part = queue[0][-1]
        stretch = tuple(part.box[:, 0].tolist())
        if stretch in divided:
            parts = [replace(part, box=half) for half in _halves(part.box, 0)[::-1]]
        else:
            with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not proved
                parts, spent, word = _tried(frames_at, part, follows, work - used, NARROW * (box[1] - box[0]), words)
            used += spent
            if parts is None:
                break
            if parts and parts[0].barren and parts[0].box[0, 0] > part.box[0, 0]:
                divided.add(stretch)
        heappop(queue)
        for half in parts:
            heappush(queue, (half.box[0, 0] if up else -half.box[1, 0], -next(number), half))
        if report and queue and queue[0][-1].box[1 - up, 0] != stretch[1 - up]:
            report(float(queue[0][-1].box[1 - up, 0]))
    end = float(queue[0][-1].box[1 - up, 0] if queue else box[int(up), 0])
    return Covering(tuple(rest.box for *_, rest in queue), end, used, part.box.mean(0) if word else None, word)


def _tried(frames_at, part, follows, work, narrow, words):
    """The parts of a part that remain to be proved, None if it cannot be divided or a word grows; the work; and that word."""
    box, used = part.box, 0.0
    if part.frames is None:
        frames = frames_at(box)
        if isinstance(frames, int):
            narrow = box[1, frames] - box[0, frames] <= narrow[frames]
            return None if narrow else [replace(part, box=half) for half in _halves(box, frames)], 10 * CALLS, ()
        part, used = replace(part, frames=frames), 10 * CALLS
    wide = np.flatnonzero(box[0] < box[1])
    if part.known is None:
        part = replace(part, frames=part.frames.part(box))
        A = part.frames.polynomials()
    else:
        around, A = part.known
        half = (around[1] - around[0])[wide] / 2
        A = A.within((box.mean(0) - around.mean(0))[wide] / half, (box[1] - box[0])[wide] / 2 / half)
    rule = follows.chain(part.frames.symbols) if isinstance(follows, OnAverage) else follows
    try:
        found, spent = _forms(A, rule, part.start, work, words)
    except np.linalg.LinAlgError:  # singular to rounding
        found, spent = None, CALLS
    used += spent
    if found is None:
        if isinstance(follows, OnAverage):
            return None, used, (0,)
        basis = part.start.basis if part.start else np.eye(A.terms.shape[-1])
        known = np.isfinite(A.terms).all()  # no pole was met on a rim
        if known and (words := growing(A.terms[0], follows, basis)):
            return None, used, words[0]
        if part.barren > HOPELESS * wide.size:
            return None, used, ()
        moves, keep = np.abs(A.terms[1 : 1 + wide.size]).sum((1, 2, 3)), part.known is not None
        if part.barren % 2 == 0 and wide.size and wide[0] == 0:  # norms exist further from the end of the proof
            moves[0] = np.inf
        part = replace(part, barren=part.barren + 1)
    else:
        proved, moves, keep, spent = _judged(A, found, rule)
        used += spent
        if proved:
            return (), used, ()
        part = replace(part, start=found[0], barren=0)
    moves = np.where((box[1] - box[0] > narrow)[wide], moves, -1.0)
    if not wide.size or moves.max() < 0:
        return None, used, ()
    side, starts = int(np.argmax(moves)), [part.start, part.start]
    if found is not None:  # where the slopes lead in the middles of the halves
        starts = [replace(found[0], P=found[0].P + move * found[1][side]) for move in (-0.5, 0.5)]
    part = replace(part, known=(part.known or (box, A)) if keep else None)
    halves = zip(_halves(box, int(wide[side])), starts, strict=True)
    return [replace(part, box=half, start=start) for half, start in halves][::-1], used, ()


def units_of(frames_at: FramesAt, box: Box, follows: np.ndarray | OnAverage) -> np.ndarray | None:
    """Return exponents `(sides, n)` of units of the states in which norms hardly change over a box: see `FramesOver.of`.

    They follow from norms at both ends of each side, as energies do: half the logarithm of what a form has on its diagonal.
    """
    frames = frames_at(box)
    while isinstance(frames, int):
        box = _halves(box, frames)[1]
        frames = frames_at(box)
    units = np.zeros((box.shape[1], frames.states))
    for side in np.flatnonzero(box[0] < box[1]):
        logs = []
        for end in box[:, side]:
            place = box.mean(0)
            place[side] = end
            A = frames.part(np.stack([place, place])).polynomials()
            if isinstance(follows, OnAverage):
                found = forms_on_average(A, *follows.chain(frames.symbols))[0]
                centre = found and found[0]
            else:
                centre, factor = find_norms(A.terms[0], follows, None, SEARCH)
                centre = centre if factor == 1 else None
            logs.append(np.log(np.abs(np.diagonal(centre.norms.P.sum(0)))) / 2 if centre else None)
        if logs[0] is not None and logs[1] is not None:
            change = (logs[1] - logs[0]) / (box[1, side] - box[0, side])
            units[side, frames.kept] = change - np.median(change)
    return units


def _forms(A, follows, start, work, words=()):
    """Norms for the middle of a box and their slopes, None if none are found; and the work. follows: or a chain."""
    if isinstance(follows, tuple):
        return forms_on_average(A, *follows)
    at_middle = A.terms[0]
    repeated = at_middle[np.diagonal(follows)]  # a message that may not be lost twice in a row keeps what it was meanwhile
    rates = [growth(at_middle, word) ** (1 / len(word)) for word in words]
    radius = max(np.abs(np.linalg.eigvals(repeated)).max(initial=0.5), *rates, 0.5)
    if not radius < 1:
        return None, 0.0
    size = len(np.unique(follows, axis=0)) * at_middle.shape[-1] * (at_middle.shape[-1] + 1) / 2
    most = max(SEARCH, NEWTON * (size**3 / 3 + CALLS))
    most_room, least_room = (min(MARGIN, share * (1 / radius - 1)) for share in SHARES)
    grown, enough = (1 + most_room) * at_middle, (1 + least_room) / (1 + most_room)
    if start is not None and start.shrinks((1 + BACK * most_room) * at_middle):
        centre, factor = replace(start, work=0.0), 1.0
    else:
        centre, factor = find_norms(grown, follows, start, min(work, most), enough)
    if factor < enough:
        return None, centre.work
    room = factor * (1 + most_room) - 1
    centre = recentred(centre, (1 + BACK * room) * at_middle, STEPS)
    spent = centre.work
    centre, slopes = sloped(centre.rounded(), (1 + BACK * room) * A.terms[: 1 + A.numbers])
    return (centre, slopes), spent + centre.work


def _judged(A, found, follows):
    """Whether a box is proved, how much each side moves the slack, whether the polynomials serve its halves, and the work."""
    centre, slopes = found
    seen = A.similar(centre.basis, centre.inverse)
    P = np.zeros((len(A.terms), *centre.P.shape))
    P[0], P[1 : 1 + A.numbers] = centre.P, slopes
    forms = Polynomials((P + np.swapaxes(P, -1, -2)) / 2, np.zeros(centre.P.shape), A.numbers, A.order)
    edges, n, pairs = centre.graph.source.size, A.terms.shape[-1], monomials(A.numbers, A.order)[1].size
    spent = 8 * CALLS + EACH * (edges + 2 * A.terms.shape[1]) * pairs * n**2
    rule = (None, follows[1]) if isinstance(follows, tuple) else (follows,)
    proved, (terms, errors, higher) = shrink_over(forms, centre.graph, seen, *rule)
    if proved:
        return True, np.zeros(0), True, spent
    size = np.sqrt(np.abs(terms).sum(-1).max(-1) * np.abs(terms).sum(-2).max(-1))
    worst = np.argmax(np.nan_to_num(size[1:].sum(0) + errors + higher, nan=np.inf))
    moves = ((1 - 0.5**A.exponents) * size[:, worst, None]).sum(0)
    return False, moves, bool((errors < SHARED).all()), spent


def _halves(box, side):
    lower, upper = box.copy(), box.copy()
    lower[1, side] = upper[0, side] = box[:, side].mean()
    return [lower, upper]
