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
from typing import Protocol

import numpy as np

from wavesweep.engine.sets import LEAST, UNIT, Polynomials, monomials
from wavesweep.for_all.average import OnAverage, forms_of_one, forms_on_average
from wavesweep.for_all.norm_check import shrink_over
from wavesweep.for_all.norms import CALLS, Centre, find_norms, recentred, sloped
from wavesweep.for_all.patterns import Word, growing, growth

# Margin by which the frames in the middle of a box are made to shrink more than necessary: so much, at most so much of what
# the spectral radii of frames and words leave. A graph is made finer up to the second share, and used up to the first one.
MARGIN, SHARES = 1e-3, (0.5, 0.1)
BACK = 0.5  # of the margin that norms have, with which they are centred
SEARCH = 4e9  # operations of one search for norms in the middle of a box, or more where these are fewer than
NEWTON = 200  # steps on the smallest graph
STEPS = (
    3  # of Newton's method for the middle of a box, from the norms of the box that it is a half of
)
SHARED = 0.05  # of the slack: what the rest of a box's polynomials may cost for its halves to go on with them
OF_ERRORS = 0.1  # of the slack: errors from which on they count for which side is halved
FAR = 10.0  # times the slack: errors with which a part is divided further without a trial,
OF_SIDE = 0.5  # by sides whose halves have less than this share of them
HOPELESS = 4  # times the number of sides: parts of parts without norms, after which a proof ends
ENCLOSED = 2e7  # operations that take as long as an enclosure of the frames of a box
EACH = 280  # operations that take as long as what is done with each entry of the polynomials
NARROW = 1e-6  # of a side, below which a box is not divided along it

Box = np.ndarray


class Frames(Protocol):
    """The frames of loops over boxes."""

    def at(self, box: Box) -> Polynomials | int:
        """Return the matrices of all symbols in a box, or the side along which it has to be divided first."""

    def unresolved(self, box: Box) -> np.ndarray:
        """Return how much of what is left out in a box is due to each of its wide sides, `(sides,)`, relative to all."""


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

    known: polynomials of a box around it that are good enough, with that box; start: norms of that; barren: how often no norms
    were found in a row, for it and for the boxes around it.
    """

    box: Box
    known: tuple[Box, Polynomials] | None = None
    start: Centre | None = None
    barren: int = 0


def cover(
    frames: Frames,
    box: Box,
    follows: np.ndarray | OnAverage,
    work: float,
    up: bool = True,
    words: Sequence[Word] = (),
    report: Callable[[float], None] | None = None,
    gain: float = 0.0,
) -> Covering:
    """Prove that all frames of a box shrink in every order, or on average, except in the parts that are left open.

    The proof goes along the first side, up or down: the part that is tried next is always one that holds it up. It ends where a
    word is met that grows. work: operations after which it ends. words: those that grow fastest beyond the box. report: is
    called with the value of the first side that the proof has reached. gain: of the first side, below which the proof ends at a
    part without norms in its middle, since it can reach no further than that middle.
    """
    number = count()
    queue = [(0.0, 0, _Part(box))]
    used = 0.0
    word: Word = ()
    divided = set()  # stretches of the first side in whose middle there were no norms: they are divided for all other numbers
    while queue and used < work:
        part = queue[0][-1]
        stretch = tuple(part.box[:, 0].tolist())
        if stretch in divided:
            parts = [replace(part, box=half) for half in _halves(part.box, 0)[::-1]]
        else:
            with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not proved
                parts, spent, word = _tried(
                    frames, part, follows, work - used, NARROW * (box[1] - box[0]), words
                )
            used += spent
            if parts is None:
                break
            barren = bool(parts) and parts[0].barren > 0
            if barren and stretch[1] - stretch[0] < gain:
                break
            if barren and parts[0].box[0, 0] > part.box[0, 0]:
                divided.add(stretch)
        heappop(queue)
        for half in parts:
            heappush(queue, (half.box[0, 0] if up else -half.box[1, 0], -next(number), half))
        if report and queue and queue[0][-1].box[1 - up, 0] != stretch[1 - up]:
            report(float(queue[0][-1].box[1 - up, 0]))
    end = float(queue[0][-1].box[1 - up, 0] if queue else box[int(up), 0])
    return Covering(
        tuple(rest.box for *_, rest in queue), end, used, part.box.mean(0) if word else None, word
    )


def _tried(frames, part, follows, work, narrow, words):
    """The parts of a part that remain to be proved, None if it cannot be divided or a word grows; the work; and that word."""
    box = part.box
    used = 0.0
    wide = np.flatnonzero(box[0] < box[1])
    if part.known is None:
        A = frames.at(box)
        used = ENCLOSED
        if isinstance(A, int):
            narrow = box[1, A] - box[0, A] <= narrow[A]
            return (
                None if narrow else [replace(part, box=half) for half in _halves(box, A)],
                used,
                (),
            )
    else:
        around, A = part.known
        half = (around[1] - around[0])[wide] / 2
        middle = (box.mean(0) - around.mean(0))[wide] / half
        # Both middles are rounded: the part is taken wider by that, so that its ends are within.
        rounding = 4 * UNIT * (1 + np.abs(around[:, wide]).max(0) / half)
        A = A.within(middle, (box[1] - box[0])[wide] / 2 / half + rounding)
    rule = (follows.graph, follows.weight) if isinstance(follows, OnAverage) else follows
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
        moves = np.abs(A.terms[1 : 1 + wide.size]).sum((1, 2, 3))
        keep = part.known is not None
        if (
            part.barren % 2 == 0 and wide.size and wide[0] == 0
        ):  # norms exist further from the end of the proof
            moves[0] = np.inf
        part = replace(part, barren=part.barren + 1)
        left = 0.0, np.ones(wide.size)
    else:
        proved, moves, errors, spent = _judged(A, found, rule)
        used += spent
        if proved:
            return (), used, ()
        share, due = _left_out(A, found)
        keep = errors * (1 - share) < SHARED
        if errors > OF_ERRORS:
            if share < 1 - OF_ERRORS:  # the rest is that of A itself
                of_blocks = frames.unresolved(box)
                due = share * due + (1 - share) * of_blocks / max(of_blocks.sum(), LEAST)
            moves = moves + min(errors, 1 / LEAST) * due
        left = errors, 1 - due
        part = replace(part, start=found[0], barren=0)
    moves = np.where((box[1] - box[0] > narrow)[wide], moves, -1.0)
    if not wide.size or moves.max() < 0:
        return None, used, ()
    part = replace(part, known=(part.known or (box, A)) if keep else None)
    pieces = [part]
    for side in _divided(moves, left):
        halves = []
        for piece in pieces:
            lower, upper = _halves(piece.box, int(wide[side]))
            starts = piece.start, piece.start
            if found is not None and not isinstance(
                follows, OnAverage
            ):  # where the slopes lead in the middles of the halves
                starts = [
                    replace(piece.start, P=piece.start.P + move * found[1][side])
                    for move in (-0.5, 0.5)
                ]
            halves += [
                replace(piece, box=lower, start=starts[0]),
                replace(piece, box=upper, start=starts[1]),
            ]
        pieces = halves
    return pieces[::-1], used, ()


def _divided(moves, left):
    """Return the sides along which a part is halved: the one that moves the slack most, and the next
    ones as long as the errors without those before would be far too large.

    left: the errors, as multiples of the slack, and the share of them that halves of each side have.
    """
    errors, shares = left
    sides = []
    for side in np.argsort(-moves):
        if sides and (errors < FAR or moves[side] < 0 or shares[side] > OF_SIDE):
            break
        sides.append(side)
        errors = errors * shares[side]
    return sides


def units_of(frames: Frames, box: Box, follows: np.ndarray | OnAverage) -> np.ndarray | None:
    """Return exponents `(sides, n)` of units of the states in which norms hardly change over a box: see `FramesOver.of`.

    They follow from norms at both ends of each side, as energies do: half the logarithm of what a form has on its diagonal.
    """
    units = None
    for side in np.flatnonzero(box[0] < box[1]):
        logs = []
        for end in box[:, side]:
            place = box.mean(0)
            place[side] = end
            A = frames.at(np.stack([place, place]))
            if isinstance(A, int):
                return None
            if isinstance(follows, OnAverage):
                found = forms_on_average(A, follows.graph, follows.weight)[0]
                centre = found and found[0]
            else:
                centre, factor = find_norms(A.terms[0], follows, None, SEARCH)
                centre = centre if factor == 1 else None
            logs.append(np.log(np.abs(np.diagonal(centre.norms.P.sum(0)))) / 2 if centre else None)
        if units is None:
            units = np.zeros((box.shape[1], A.terms.shape[-1]))
        if logs[0] is not None and logs[1] is not None:
            change = (logs[1] - logs[0]) / (box[1, side] - box[0, side])
            units[side] = change - np.median(change)
    return units


def _forms(A, follows, start, work, words=()):
    """Norms for the middle of a box and their slopes, None if none are found; and the work. follows: or a chain."""
    if isinstance(follows, tuple):
        return forms_of_one(A) if A.terms.shape[1] == 1 else forms_on_average(A, *follows)
    at_middle = A.terms[0]
    repeated = at_middle[
        np.diagonal(follows)
    ]  # a message that may not be lost twice in a row keeps what it was meanwhile
    rates = [growth(at_middle, word) ** (1 / len(word)) for word in words]
    radius = max(np.abs(np.linalg.eigvals(repeated)).max(initial=0.5), *rates, 0.5)
    if not radius < 1:
        return None, 0.0
    n = at_middle.shape[-1]
    size = len(np.unique(follows, axis=0)) * n * (n + 1) / 2
    most = max(SEARCH, NEWTON * (size**3 / 3 + CALLS))
    most_room, least_room = (min(MARGIN, share * (1 / radius - 1)) for share in SHARES)
    grown = (1 + most_room) * at_middle
    enough = (1 + least_room) / (1 + most_room)
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
    """Whether a box is proved, how much each side moves the slack, the errors as shares of that, and the work."""
    centre, slopes = found
    seen = A.similar(centre.basis, centre.inverse)
    P = np.zeros((len(A.terms), *centre.P.shape))
    P[0] = centre.P
    P[1 : 1 + len(slopes)] = slopes
    forms = Polynomials(
        (P + np.swapaxes(P, -1, -2)) / 2, np.zeros(centre.P.shape), A.numbers, A.order
    )
    edges = centre.graph.source.size
    n = A.terms.shape[-1]
    pairs = monomials(A.numbers, A.order)[1].size
    spent = 8 * CALLS + EACH * (edges + 2 * A.terms.shape[1]) * pairs * n**2
    rule = (None, follows[1]) if isinstance(follows, tuple) else (follows,)
    proved, (terms, errors, higher) = shrink_over(forms, centre.graph, seen, *rule)
    if proved:
        return True, np.zeros(0), 0.0, spent
    size = np.sqrt(np.abs(terms).sum(-1).max(-1) * np.abs(terms).sum(-2).max(-1))
    worst = np.argmax(np.nan_to_num(size[1:].sum(0) + errors + higher, nan=np.inf))
    moves = size[:, worst] @ (
        1 - 0.5**A.exponents
    )  # what is gone of the terms when a side is halved
    return False, moves, float(errors.max()), spent


def _left_out(A, found):
    """Which part of the errors are terms of products beyond the order of A, and the shares of these that are gone if a side is
    halved."""
    centre, further = found
    seen = A.similar(centre.basis, centre.inverse)
    size = np.abs(seen.terms).reshape(len(A.terms), -1).sum(1)
    of_forms = np.zeros(len(A.terms))
    of_forms[0] = np.abs(centre.P).sum()
    of_forms[1 : 1 + len(further)] = np.abs(further).reshape(len(further), -1).sum(1)
    degree = A.exponents.sum(1)
    beyond = []
    for weight in (1.0, *(0.5**exponent for exponent in A.exponents.T)):
        one = np.bincount(degree, size * weight, A.order + 1)
        form = np.bincount(degree, of_forms * weight, A.order + 1)
        beyond.append(np.convolve(np.convolve(one, form), one)[A.order + 1 :].sum())
    whole, *halved = beyond
    rest = 2 * seen.rest.sum() * size.sum() * of_forms.sum()
    with np.errstate(invalid="ignore"):
        share = whole / (whole + rest)
    return share if np.isfinite(share) else 0.0, 1 - np.array(halved) / max(whole, LEAST)


def _halves(box, side):
    lower = box.copy()
    upper = box.copy()
    middle = box[:, side].mean()
    lower[1, side] = middle
    upper[0, side] = middle
    return [lower, upper]
