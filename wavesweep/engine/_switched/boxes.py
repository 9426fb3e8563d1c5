"""Boxes of unknown numbers while frames vary: in every box all frames shrink, in norms that depend
on its numbers.

Unknown means constant in time, and the proof has to use it: in one norm for the whole box, numbers
that jump from frame to frame would be proved as well, and often these are not stable. In each part
of the box the norms are found for its middle, and their slopes from the same equations: the form of
node i at s is `P_i + sum_k s_k D_ik`. `norm_check` proves what is found here. A part that is not
proved is divided along the side that moves the slack most.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from heapq import heapify
from itertools import count, pairwise
from operator import itemgetter
from typing import NamedTuple, Protocol

import numpy as np

from wavesweep.engine._sets.enclosed_loop import Side
from wavesweep.engine._sets.taylor_models import Polynomials, monomials
from wavesweep.engine._switched.average import (
    ALONE,
    ALWAYS,
    OnAverage,
    forms_of_each,
    forms_on_average,
)
from wavesweep.engine._switched.frames_over import constant_frames
from wavesweep.engine._switched.graph import Family, Graph
from wavesweep.engine._switched.norm_check import outside_each, shrink_over
from wavesweep.engine._switched.norms import CALLS, Centre, find_norms, recentred
from wavesweep.engine._switched.patterns import Word, growing, growth
from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.loop import Loops

# Margin by which the frames in the middle of a box are made to shrink more than necessary: so much,
# at most so much of what the spectral radii of frames and words leave. A graph is made finer up to
# the second share, and used up to the first one.
MARGIN, SHARES = 1e-3, (0.5, 0.1)
BACK = 0.5  # of the margin that norms have, with which they are centred
OPERATIONS_OF_CENTRE = 4e9  # see `cover`
OPERATIONS_OF_CONSTANT = 1e11  # of a proof of `cover_constant`
NEWTON_OF_GRAPH = 200  # steps of Newton's method on the smallest graph
# of the slack: what the rest of a box's polynomials may cost for its halves to go on with them
SHARED = 0.05
SLACK_OF_ERRORS = 0.1  # of the slack: errors from which on they count for which side is halved
# times the slack: errors from which on a part is divided further without a trial, if the halves
# along its side have at most OF_SIDE of them
HOPELESS_ERRORS = 10.0
OF_SIDE = 0.5
OF_OWN = 1e9  # operations that take as long as a search of `OwnForms`
ENCLOSED = 2e7  # operations that take as long as an enclosure of the frames of a box
EACH = 280  # operations that take as long as what is done with each entry of the polynomials
NARROWEST_SIDE = 1e-6  # of a side, below which a box is not divided along it
# parts that are enclosed together: fewer take longer each, and of more the arrays do not fit the
# cache
CELLS_AT_ONCE = 16
# of a box: rounding of the share of each part, if the ends of a side are 500 times its width at
# most
VOLUME_ROUNDING = 1e-13

Box = np.ndarray
Forms = tuple[Centre, np.ndarray]  # for the middle of a part, and their further terms, or slopes
Kept = list[tuple[Box, Forms]]


class InBox(Protocol):
    """What encloses the matrices of frames in a box, see `Enclosed`."""

    @property
    def matrices(self) -> Polynomials:
        """Those in all of it."""

    @property
    def due(self) -> np.ndarray:
        """How much of what is left out is due to each of the wide sides."""

    def within(self, box: np.ndarray) -> Polynomials:
        """Those in a part of it."""


class Frames(Protocol):
    """The frames of loops over boxes."""

    def over(self, boxes: np.ndarray) -> Sequence[InBox | int]:
        """Return what encloses the frames in boxes that are wide along the same sides and the same
        along all others, `(boxes, 2, sides)`; for those without a bound the side along which they
        have to be divided first."""


class OwnForms(Protocol):
    """A rule for what follows that finds forms itself."""

    @property
    def whole(self) -> Family:
        """The matrices, and which may follow which."""

    def found(self, A: Polynomials) -> tuple[Centre, np.ndarray] | None:
        """Forms for the matrices in a cell, and their slopes; None if none are found."""


Rule = np.ndarray | OnAverage | OwnForms
# the same, with the graph and the weights of a chain in place of what is on average
OneRule = np.ndarray | OwnForms | tuple[Graph, np.ndarray]
# whether a box is proved, how much each side moves the slack, the errors as shares of it, operations
Judged = tuple[bool, np.ndarray, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Covering:
    """What is known of a box, `(2, sides)`.

    open: the parts that are not proved, as boxes, which are the box with what is proved. end: all
    is proved up to this value of the first side. used: operations. point, word: a place at which
    the word grows, if one was met.
    """

    open: tuple[Box, ...]
    end: float
    used: float
    point: np.ndarray | None = None
    word: Word = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Outcome:
    """What a trial of a part gave.

    parts: those of it that remain to be proved, None if it cannot be divided or a word grows. used:
    operations. forms: in which all of it shrinks, with their further terms.
    """

    parts: list["_Part"] | None
    used: float
    word: Word = ()
    forms: Forms | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A part of the box that is still to be proved.

    known: what encloses the frames in it, or in a box around it if that is good enough; start:
    norms of a box around it; barren: how often no norms were found in a row, for it and for the
    boxes around it.
    """

    box: Box
    known: InBox | None = None
    start: Centre | None = None
    barren: int = 0


class _Waiting(NamedTuple):
    """A part in the queue of `cover`, by the first side at its front, which counts down where the
    proof goes down, and a number of its own."""

    order: float
    number: int
    part: _Part


def cover(
    frames: Frames,
    box: Box,
    follows: Rule,
    work: float,
    up: bool = True,
    words: Sequence[Word] = (),
    report: Callable[[float, float], None] | None = None,
    gain: float = 0.0,
    stretches: int = 1,
    stored: Kept | None = None,
    search: float = OPERATIONS_OF_CENTRE,
) -> Covering:
    """Prove that all frames of a box shrink in every order, or on average, except in the parts that
    are left open.

    The proof goes along the first side, up or down: the part that is tried next is always one that
    holds it up. It ends where a word is met that grows. work: operations after which it ends.
    words: those that grow fastest beyond the box. report: is called with the value of the first
    side that the proof has reached, and the share of the box that is proved. gain: of the first
    side, below which the proof ends at a part without norms in its middle, since it can reach no
    further than that middle. stretches: equal ones of the first side, with which the proof begins.
    stored: to which each part that is proved is added, with its forms. search: operations that one
    search for norms in the middle of a part may take, or those of NEWTON_OF_GRAPH steps, if they are more.
    Errors: RuntimeError if a part of the box is lost, which is neither proved nor open.
    """
    narrow = NARROWEST_SIDE * (box[1] - box[0])
    queue = _Queue.of(box, up, stretches, stored)
    trials = _Trials(frames, follows, words, narrow, work, search)
    word: Word = ()  # that grows
    while queue.waiting and trials.used < work:
        part = queue.waiting[0].part
        outcome = trials.outcome_of_first(queue)
        if outcome.parts is None:
            word = outcome.word
            break
        stretch = _stretch(part)
        no_norms = bool(outcome.parts) and outcome.parts[0].barren > 0
        if no_norms and stretch not in trials.divided:
            if stretch[1] - stretch[0] < gain:
                break
            if outcome.parts[0].box[0, 0] > part.box[0, 0]:
                trials.divided.add(stretch)
        queue.go_on(trials)
        if report and queue.waiting:
            report(queue.end(), queue.proved)
    open_ = queue.open()
    lost = 1 - queue.proved - sum(_share(piece, box) for piece in open_)
    if not abs(lost) <= VOLUME_ROUNDING * trials.used / ENCLOSED:
        raise RuntimeError(f"{lost:.3g} of a box is neither proved nor open: please report it")
    point = part.box.mean(0) if word else None
    return Covering(open_, queue.end(), trials.used, point, word)


def cover_constant(loop: Loops, sides: Sequence[Side], box: Box, up: bool) -> Covering:
    """Prove that all loops of a box of sides are stable whose frames are all alike, see `cover`."""
    # Of order 6 at most: with a complex factor there are twice as many states.
    return cover(constant_frames(loop, sides, box, 6), box, ALWAYS, OPERATIONS_OF_CONSTANT, up)


@dataclass(slots=True, eq=False)
class _Queue:
    """The parts of a box that are still to be proved; the first is the one that holds the proof up.

    up: whether the proof goes up along the first side. numbers: those of the parts to come.
    kept: see `cover`. proved: the share of the box that is.
    """

    box: Box
    up: bool
    waiting: list[_Waiting]
    numbers: Iterator[int]
    kept: Kept | None
    proved: float = 0.0

    @staticmethod
    def of(box: Box, up: bool, stretches: int, stored: Kept | None) -> "_Queue":
        """The queue at the begin of a proof, of equal stretches of the first side."""
        queue = _Queue(box, up, [], count(), stored)
        ends = np.linspace(box[0, 0], box[1, 0], 1 + stretches).tolist()
        for low, high in pairwise(ends if up else ends[::-1]):
            stretch = box.copy()
            stretch[:, 0] = sorted((low, high))
            queue.waiting.append(
                _Waiting(queue.order(stretch), next(queue.numbers), _Part(stretch))
            )
        return queue

    def front(self, box: Box) -> float:
        """The value of the first side at which the proof enters a box."""
        return float(box[0, 0] if self.up else box[1, 0])

    def order(self, box: Box) -> float:
        """What is least of the box that the proof enters first."""
        if self.up:
            return self.front(box)
        return -self.front(box)

    def go_on(self, trials: "_Trials") -> None:
        """Take what is proved or divided out of the queue, in any order, and put the halves into
        it. A part that ends the proof waits until it is first."""
        remaining = []
        for waiting in self.waiting:
            outcome = trials.outcomes.get(waiting.number)
            if outcome is None or outcome.parts is None:
                remaining.append(waiting)
                continue
            trials.forget(waiting.number)
            if not outcome.parts:
                self.proved += _share(waiting.part.box, self.box)
                if self.kept is not None and outcome.forms:
                    self.kept.append((waiting.part.box, outcome.forms))
            for half in outcome.parts:
                # Of equal fronts the youngest is first, so that few parts wait.
                remaining.append(_Waiting(self.order(half.box), -next(self.numbers), half))
        self.waiting = remaining
        heapify(self.waiting)

    def end(self) -> float:
        """The value of the first side up to which all is proved."""
        if self.waiting:
            return self.front(self.waiting[0].part.box)
        return float(self.box[int(self.up), 0])

    def open(self) -> tuple[Box, ...]:
        """The boxes that wait, in their order."""
        in_order = sorted(self.waiting, key=itemgetter(0, 1))
        return tuple(waiting.part.box for waiting in in_order)


@dataclass(slots=True, eq=False)
class _Trials:
    """The trials of a proof.

    narrow: widths of sides below which they are not divided. work: operations of the proof, search:
    of one in a middle; used: those so far. outcomes, enclosed: of parts in the queue, by their numbers. norms: of the part
    that was proved last. divided: stretches of the first side in whose middle there were no norms:
    they are divided for all other numbers. sides: along which single matrices had to be divided, by
    the width along the first side and the box of the others. width: along the first side, beyond which a part is not
    tried but divided; in_a_row: parts that were proved one after the other.
    """

    frames: Frames
    follows: Rule
    words: Sequence[Word]
    narrow: np.ndarray
    work: float
    search: float
    used: float = 0.0
    outcomes: dict[int, _Outcome] = field(default_factory=dict)
    enclosed: dict[int, InBox | int] = field(default_factory=dict)
    norms: Centre | None = None
    divided: set[tuple[float, ...]] = field(default_factory=set)
    sides: dict[tuple[bool, float, bytes], np.ndarray] = field(default_factory=dict)
    width: float = np.inf
    in_a_row: int = 0

    def outcome_of_first(self, queue: _Queue) -> _Outcome:
        """The outcome of the first part of a queue, which is tried if it was not."""
        first = queue.waiting[0]
        low, high = _stretch(first.part)
        if (low, high) in self.divided or high - low > (1 + 1e-6) * self.width:  # but for rounding
            halves = [replace(first.part, box=half) for half in _halves(first.part.box, 0)[::-1]]
            self.outcomes[first.number] = _Outcome(halves, 0.0)
        elif first.number not in self.outcomes:
            if _shape(first.part) in self.sides:
                self.outcomes[first.number] = _Outcome(self._as_before(first.part), 0.0)
            else:
                self._try(queue)
        return self.outcomes[first.number]

    def forget(self, number: int) -> None:
        """Forget a part that left the queue."""
        del self.outcomes[number]
        self.enclosed.pop(number, None)

    def _as_before(self, part: _Part) -> list[_Part]:
        """The parts of a part as others of its shape, of other values of the first side, had to be
        divided."""
        pieces = [part]
        for side in self.sides.get(_shape(part), ()):
            boxes = [half for piece in pieces for half in _halves(piece.box, side)]
            pieces = [replace(part, box=box) for box in boxes]
        if len(pieces) == 1:
            return pieces
        return [smaller for piece in pieces for smaller in self._as_before(piece)]

    def _ready(self, queue: _Queue) -> dict[int, _Part]:
        """The parts of a queue to be tried next, in order, one of each shape, but for those whose
        halves will be.

        Where they are few, the next part that is divided as others were is divided now.
        """
        first = queue.waiting[0]
        while True:
            ready = {first.number: first.part}
            shapes = {_shape(first.part)}
            later = None
            for waiting in sorted(queue.waiting):
                if waiting.number in self.outcomes or _stretch(waiting.part) in self.divided:
                    continue
                shape = _shape(waiting.part)
                if shape in self.sides:
                    later = later or waiting
                elif shape not in shapes:
                    shapes.add(shape)
                    ready[waiting.number] = waiting.part
                if len(ready) == CELLS_AT_ONCE:
                    return ready
            if later is None:
                return ready
            self.outcomes[later.number] = _Outcome(self._as_before(later.part), 0.0)
            queue.go_on(self)

    def _try(self, queue: _Queue) -> None:
        """Enclose the parts that are next, and try them all, or the first one if a trial takes
        long."""
        ahead = self._ready(queue)
        self.used += _enclose(self.frames, ahead, self.enclosed)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not proved
            if _alone(self.follows):
                outcomes = _tried_together(ahead, self.enclosed, self.narrow)
                for number, outcome in outcomes.items():
                    if outcome.parts and outcome.parts[0].known is None:
                        narrower = np.ptp(outcome.parts[0].box, 0) < np.ptp(ahead[number].box, 0)
                        self.sides[_shape(ahead[number])] = np.flatnonzero(narrower)
            else:
                first = queue.waiting[0].number
                outcomes = {first: self._tried_alone(first, ahead[first])}
        self.used += sum(outcome.used for outcome in outcomes.values())
        self.outcomes |= outcomes

    def _tried_alone(self, number: int, part: _Part) -> _Outcome:
        """The outcome of a part, from the norms of the one before if it has none."""
        begun = replace(part, start=part.start or self.norms)
        rest = self.work - self.used
        enclosed = self.enclosed.get(number)
        tried = _tried(begun, enclosed, self.follows, rest, self.narrow, self.words, self.search)
        self.norms = tried.forms[0] if tried.forms else self.norms
        self.in_a_row += 1
        low, high = _stretch(part)
        if tried.parts:
            self.in_a_row = 0
        elif self.in_a_row >= 3:  # after three parts in a row the next ones are tried twice as wide
            self.width = 2 * (high - low)
        else:
            self.width = high - low
        return tried


def _stretch(part: _Part) -> tuple[float, float]:
    low, high = part.box[:, 0].tolist()
    return low, high


def _shape(part: _Part) -> tuple[bool, float, bytes]:
    """The width of a part along the first side, and its box of the others."""
    width = part.box[1, 0] - part.box[0, 0]
    return (
        part.known is None,
        round(np.log2(max(width, NEXT_TO_ZERO)), 6),
        part.box[:, 1:].tobytes(),
    )


def _alone(follows: Rule) -> bool:
    """Whether it is about a single matrix, whose powers decay."""
    return isinstance(follows, OnAverage) and follows.graph is ALONE


def _share(part: Box, box: Box) -> float:
    """Which share of a box a part is."""
    wide = box[0] < box[1]
    return float(((part[1] - part[0])[wide] / (box[1] - box[0])[wide]).prod())


def _enclose(frames: Frames, parts: dict[int, _Part], enclosed: dict[int, InBox | int]) -> float:
    """Enclose the parts, by their numbers, of which no box around is known well enough; return
    the operations."""
    new = []
    for number, part in parts.items():
        if part.known is None and number not in enclosed:
            new.append(number)
    if new:
        enclosures = frames.over(np.array([parts[number].box for number in new]))
        enclosed |= zip(new, enclosures, strict=True)
    return ENCLOSED * len(new)


def _tried_together(
    parts: dict[int, _Part], enclosed: dict[int, InBox | int], narrow: np.ndarray
) -> dict[int, _Outcome]:
    """The outcomes of parts of single matrices, by their numbers."""
    outcomes = {}
    around = {}
    for number, part in parts.items():
        enclosure = part.known or enclosed[number]
        if isinstance(enclosure, int):
            outcomes[number] = _without_bound(part, enclosure, narrow)
        else:
            around[number] = enclosure
    if not around:
        return outcomes
    A = _side_by_side([enclosure.within(parts[number].box) for number, enclosure in around.items()])
    forms_of_parts, spent = forms_of_each(A)
    decaying = []
    for i, (number, enclosure) in enumerate(around.items()):
        own_forms = forms_of_parts[i]
        if own_forms is None:
            outcomes[number] = _Outcome(None, spent, (0,))
        else:
            decaying.append((i, number, enclosure, own_forms))
    if not decaying:
        return outcomes
    seen = A.of([i for i, *_ in decaying])
    judged = _judged_each(seen, [forms for *_, forms in decaying])
    for (i, number, enclosure, forms), verdict in zip(decaying, judged, strict=True):
        of_part = A.of([i])
        outcome = _judgement(parts[number], enclosure, of_part, forms, verdict, narrow, alone=True)
        outcomes[number] = replace(outcome, used=outcome.used + spent)
    return outcomes


def _without_bound(part: _Part, side: int, narrow: np.ndarray) -> _Outcome:
    """The outcome of a part that has to be divided along a side first."""
    if part.box[1, side] - part.box[0, side] <= narrow[side]:
        return _Outcome(None, 0.0)
    return _Outcome([replace(part, box=half) for half in _halves(part.box, side)], 0.0)


def _side_by_side(matrices: list[Polynomials]) -> Polynomials:
    """Single matrices `(1, n, n)` of several parts as one array of them, `(parts, n, n)`."""
    terms = np.concatenate([matrix.terms for matrix in matrices], 1)
    rest = np.concatenate([matrix.rest for matrix in matrices])
    return Polynomials(terms, rest, matrices[0].numbers, matrices[0].order)


def _judged_each(A: Polynomials, forms_of_parts: list[Forms]) -> list[Judged]:
    """`_judged` of single matrices `(parts, n, n)`, each with a form of its own."""
    of_each = []
    for centre, further in forms_of_parts:
        of_each.append(np.concatenate([centre.P[None], further]))
    P = np.concatenate(of_each, 1)
    forms = Polynomials((P + P.mT) / 2, np.zeros(P.shape[1:]), A.numbers, A.order)
    basis = np.stack([centre.basis for centre, _ in forms_of_parts])
    inverse = np.stack([centre.inverse for centre, _ in forms_of_parts])
    outside, slack = outside_each(forms, A.similar(basis, inverse))
    pairs = monomials(A.numbers, A.order)[1].size
    spent = 8 * CALLS + 3 * EACH * pairs * P.shape[-1] ** 2
    judged = []
    for part, proved in enumerate((outside == 0).tolist()):
        size = np.sqrt(
            _largest_sum(slack.terms[:, part], -1) * _largest_sum(slack.terms[:, part], -2)
        )
        moves = size @ (1 - 0.5**A.exponents)  # what is gone of the terms when a side is halved
        judged.append((proved, moves, float(slack.errors[part]), spent))
    return judged


def _largest_sum(terms: np.ndarray, axis: int) -> np.ndarray:
    """The largest sum of sizes along an axis of matrices."""
    return np.abs(terms).sum(axis).max(-1)


def _tried(
    part: _Part,
    enclosed: InBox | int | None,
    follows: Rule,
    work: float,
    narrow: np.ndarray,
    words: Sequence[Word],
    search: float,
) -> _Outcome:
    """The outcome of a part of which several matrices occur."""
    enclosure: InBox | int = part.known or enclosed  # type: ignore[assignment]  # one is there
    if isinstance(enclosure, int):
        return _without_bound(part, enclosure, narrow)
    A = enclosure.within(part.box)
    rule: OneRule
    if isinstance(follows, OnAverage):
        rule = (follows.graph, follows.weight)
    else:
        rule = follows
    try:
        forms, used = _forms(A, rule, part.start, work, words, search)
    except np.linalg.LinAlgError:  # singular to rounding
        forms, used = None, CALLS
    if forms is not None:
        outcome = _judgement(part, enclosure, A, forms, _judged(A, forms, rule), narrow)
        return replace(outcome, used=outcome.used + used)
    if isinstance(follows, OnAverage):
        return _Outcome(None, used, (0,))
    return _without_norms(part, A, follows, narrow, used)


def _without_norms(
    part: _Part, A: Polynomials, follows: Rule, narrow: np.ndarray, used: float
) -> _Outcome:
    """The outcome of a part in the middle of which no norms are found: a word that grows there, its
    halves, or that the proof ends. A: its frames; used: operations."""
    wide = np.flatnonzero(part.box[0] < part.box[1])
    basis = part.start.basis if part.start else np.eye(A.terms.shape[-1])
    # Without a pole on a rim.
    if isinstance(follows, np.ndarray) and np.isfinite(A.terms).all():
        grow = growing(A.terms[0], follows, basis)
        if grow:
            return _Outcome(None, used, grow[0])
    # Parts of parts without norms for each side, after which a proof ends.
    if part.barren > 4 * wide.size:
        return _Outcome(None, used)
    moves = np.abs(A.terms[1 : 1 + wide.size]).sum((1, 2, 3))
    if part.barren % 2 == 0 and wide.size and wide[0] == 0:
        moves[0] = np.inf  # norms exist further from the end of the proof
    part = replace(part, barren=part.barren + 1)
    left = 0.0, np.ones(wide.size)
    return _Outcome(_parts_of(part, part.known, moves, left, narrow, None), used)


def _judgement(
    part: _Part,
    enclosure: InBox,
    A: Polynomials,
    forms: Forms,
    judged: Judged,
    narrow: np.ndarray,
    *,
    alone: bool = False,
) -> _Outcome:
    """The outcome of a part with forms, which were judged so. alone: whether they are those of a
    single matrix."""
    proved, moves, errors, used = judged
    if proved:
        return _Outcome([], used, forms=forms)
    share, due = _left_out(A, forms)
    keep = errors * (1 - share) < SHARED
    if errors > SLACK_OF_ERRORS:
        if share < 1 - SLACK_OF_ERRORS:  # the rest is that of A itself
            due = share * due + (1 - share) * enclosure.due / max(enclosure.due.sum(), NEXT_TO_ZERO)
        moves = moves + min(errors, 1 / NEXT_TO_ZERO) * due
    part = replace(part, start=forms[0], barren=0)
    slopes = None if alone else forms[1]
    remainder = errors, 1 - due
    return _Outcome(
        _parts_of(part, enclosure if keep else None, moves, remainder, narrow, slopes), used
    )


def _parts_of(
    part: _Part,
    enclosure: InBox | None,
    moves: np.ndarray,
    remainder: tuple[float, np.ndarray],
    narrow: np.ndarray,
    slopes: np.ndarray | None,
) -> list[_Part] | None:
    """The parts into which a part is divided; None if it cannot be. slopes: of its norms, which
    lead to those of its halves."""
    box = part.box
    wide = np.flatnonzero(box[0] < box[1])
    moves = np.where((box[1] - box[0] > narrow)[wide], moves, -1.0)
    if not wide.size or moves.max() < 0:
        return None
    pieces = [replace(part, known=enclosure)]
    for side in _divided(moves, remainder):
        halves = []
        for piece in pieces:
            for half, move in zip(_halves(piece.box, int(wide[side])), (-0.5, 0.5), strict=True):
                start = piece.start
                if start is not None and slopes is not None:
                    start = replace(start, P=start.P + move * slopes[side])
                halves.append(replace(piece, box=half, start=start))
        pieces = halves
    return pieces[::-1]


def _divided(moves: np.ndarray, remainder: tuple[float, np.ndarray]) -> list[int]:
    """Return the sides along which a part is halved: the one that moves the slack most, and the
    next ones as long as the errors without those before would be far too large.

    remainder: the errors, as multiples of the slack, and the share of them that halves of each side
    have.
    """
    errors, shares = remainder
    sides: list[int] = []
    for side in np.argsort(-moves).tolist():
        if sides and (errors < HOPELESS_ERRORS or moves[side] < 0 or shares[side] > OF_SIDE):
            break
        sides.append(side)
        errors = errors * shares[side]
    return sides


def units_of(frames: Frames, box: Box, follows: Rule) -> np.ndarray | None:
    """Return exponents `(sides, n)` of units of the states in which norms hardly change over a box:
    see `FramesOver.of`.

    They follow from norms at both ends of each side, as energies do: half the logarithm of what a
    form has on its diagonal.
    """
    wide = np.flatnonzero(box[0] < box[1])
    A = []
    for side in wide:
        for end in box[:, side]:
            place = box.mean(0)
            place[side] = end
            enclosed = frames.over(np.stack([place, place])[None])[0]
            if isinstance(enclosed, int):
                return None
            A.append(enclosed.matrices)
    if not A:
        return None
    units = np.zeros((box.shape[1], A[0].terms.shape[-1]))
    ends = list(zip(A[::2], A[1::2], strict=True))
    moves = [np.abs(high.terms[0] - low.terms[0]).max() for low, high in ends]
    for side, move, (low, high) in zip(wide, moves, ends, strict=True):
        # Norms hardly change along a side that moves the entries of frames a hundred times less.
        if move < 1e-2 * max(moves):
            continue
        before, after = (_log_of_forms(end, follows) for end in (low, high))
        if before is not None and after is not None:
            change = (after - before) / (box[1, side] - box[0, side])
            units[side] = change - np.median(change)
    return units


def _log_of_forms(A: Polynomials, follows: Rule) -> np.ndarray | None:
    """Half the logarithm of what forms for the middle of a box have on their diagonal; None
    without forms."""
    if isinstance(follows, OnAverage):
        forms = forms_on_average(A, follows.graph, follows.weight)[0]
        centre = forms and forms[0]
    else:
        symbols: np.ndarray = follows  # type: ignore[assignment]  # what has forms itself has no units
        centre, factor = find_norms(A.terms[0], symbols, None, OPERATIONS_OF_CENTRE)
        centre = centre if factor == 1 else None
    if centre:
        return np.log(np.abs(np.diagonal(centre.norms.P.sum(0)))) / 2
    return None


def _growth_of_words(A: np.ndarray, follows: np.ndarray, words: Sequence[Word]) -> float:
    """The fastest growth per frame of some words, and of frames that may repeat; 1/2 at the least."""
    # A message that may not be lost twice in a row keeps what it was meanwhile.
    repeated = A[np.diagonal(follows)]
    rates = [growth(A, word) ** (1 / len(word)) for word in words]
    return max(np.abs(np.linalg.eigvals(repeated)).max(initial=0.5), *rates, 0.5)


def _forms(
    A: Polynomials,
    follows: OneRule,
    start: Centre | None,
    work: float,
    words: Sequence[Word] = (),
    search: float = OPERATIONS_OF_CENTRE,
) -> tuple[Forms | None, float]:
    """Norms for the middle of a box and their slopes, None if none are found; and the work.
    follows: or a chain. search: see `cover`."""
    if isinstance(follows, tuple):
        return forms_on_average(A, *follows)
    if not isinstance(follows, np.ndarray):
        return follows.found(A), OF_OWN
    at_middle = A.terms[0]
    radius = _growth_of_words(at_middle, follows, words)
    if not radius < 1:
        return None, 0.0
    n = at_middle.shape[-1]
    size = len(np.unique(follows, axis=0)) * n * (n + 1) / 2
    most_work = max(search, NEWTON_OF_GRAPH * (size**3 / 3 + CALLS))
    most_room, least_room = (min(MARGIN, share * (1 / radius - 1)) for share in SHARES)
    grown = (1 + most_room) * at_middle
    enough = (1 + least_room) / (1 + most_room)
    room = _room_of(start, at_middle, least_room, most_room) if start else 0.0
    if start and room:
        centre = replace(start, work=0.0)
    else:
        centre, factor = find_norms(grown, follows, start, min(work, most_work), enough)
        if factor < enough:
            return None, centre.work
        room = factor * (1 + most_room) - 1
    # Three steps of Newton's method, from the norms of the box that this is a half of.
    centre = recentred(centre, (1 + BACK * room) * at_middle, 3)
    spent = centre.work
    terms = A.terms[: 1 + A.numbers]
    centre, slopes = centre.rounded().sloped((1 + BACK * room) * terms)
    return (centre, slopes), spent + centre.work


def _room_of(start: Centre, A: np.ndarray, least: float, largest: float) -> float:
    """The margin that known norms have for matrices if they keep BACK of it, at most so much; 0 if
    it is below the least one."""
    room = largest
    while room >= least:
        if start.shrinks((1 + BACK * room) * A):
            return room
        room *= 0.8  # the margin that is tried next if known norms do not have this one
    return 0.0


def _judged(A: Polynomials, forms_in_middle: Forms, follows: OneRule) -> Judged:
    """Whether a box is proved, how much each side moves the slack, the errors as shares of that,
    and the work."""
    centre, slopes = forms_in_middle
    seen = A.similar(centre.basis, centre.inverse)
    P = np.zeros((len(A.terms), *centre.P.shape))
    P[0] = centre.P
    P[1 : 1 + len(slopes)] = slopes
    forms = Polynomials((P + P.mT) / 2, np.zeros(centre.P.shape), A.numbers, A.order)
    edges = centre.graph.source.size
    n = A.terms.shape[-1]
    pairs = monomials(A.numbers, A.order)[1].size
    spent = 8 * CALLS + EACH * (edges + 2 * A.terms.shape[1]) * pairs * n**2
    weight = None
    after = None
    if isinstance(follows, tuple):
        weight = follows[1]
    else:
        after = follows if isinstance(follows, np.ndarray) else follows.whole.follows
    proved, (terms, errors, higher) = shrink_over(forms, centre.graph, seen, after, weight)
    if proved:
        return True, np.zeros(0), 0.0, spent
    size = np.sqrt(np.abs(terms).sum(-1).max(-1) * np.abs(terms).sum(-2).max(-1))
    worst = np.argmax(np.nan_to_num(size[1:].sum(0) + errors + higher, nan=np.inf))
    moves = size[:, worst] @ (
        1 - 0.5**A.exponents
    )  # what is gone of the terms when a side is halved
    return False, moves, float(errors.max()), spent


def _left_out(A: Polynomials, forms: Forms) -> tuple[float, np.ndarray]:
    """Which part of the errors are terms of products beyond the order of A, and the shares of
    these that are gone if a side is halved."""
    centre, further = forms
    seen = A.similar(centre.basis, centre.inverse)
    size = np.abs(seen.terms).reshape(len(A.terms), -1).sum(1)
    of_forms = np.zeros(len(A.terms))
    of_forms[0] = np.abs(centre.P).sum()
    of_forms[1 : 1 + len(further)] = np.abs(further).reshape(len(further), -1).sum(1)
    degree = A.exponents.sum(1)
    beyond = []
    for weight in (1.0, *(0.5**exponent for exponent in A.exponents.T)):
        by_degree = np.bincount(degree, size * weight, A.order + 1)
        form = np.bincount(degree, of_forms * weight, A.order + 1)
        beyond.append(np.convolve(np.convolve(by_degree, form), by_degree)[A.order + 1 :].sum())
    whole, *halved = beyond
    rest = 2 * seen.rest.sum() * size.sum() * of_forms.sum()
    with np.errstate(invalid="ignore"):
        share = whole / (whole + rest)
    return share if np.isfinite(share) else 0.0, 1 - np.array(halved) / max(whole, NEXT_TO_ZERO)


def _halves(box: Box, side: int) -> list[Box]:
    lower = box.copy()
    upper = box.copy()
    middle = box[:, side].mean()
    lower[1, side] = middle
    upper[0, side] = middle
    return [lower, upper]
