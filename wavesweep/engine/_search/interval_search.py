"""Stable intervals of loops of one drawing along any of their numbers, a batch at a time.

The methods are tried in their order: one that applies answers for the slices, and asks those after
it about smaller questions, and about the columns that it leaves in doubt.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from types import ModuleType

import numpy as np

from wavesweep.engine._search import (
    dead_time_pieces,
    dominance,
    gain_bound,
    one_gain,
    required_region,
    subloops,
)
from wavesweep.engine._search.at_ends import AtPort, lines_at_ends
from wavesweep.engine._search.interval_records import (
    FAILURES,
    LINES,
    RECORD,
    records_of,
    unanswered,
)
from wavesweep.engine._search.open_loops import Opened, varied_beside
from wavesweep.engine._search.question import Prover, Question, RequiredRegion, Slices
from wavesweep.engine._stability.intervals import Intervals, by_slice
from wavesweep.engine.loop import Loops

# Each has `applies(question, slices)` and `find(question, slices, rest)`; what it proves stands at
# its head.
METHODS = (dead_time_pieces, gain_bound, subloops, required_region, one_gain, dominance)

ENDS, OMEGAS = ("low", "high"), ("low_omega", "high_omega")
Groups = tuple[tuple[np.ndarray, Loops], ...]  # (members, loops) pairs, see `drawn_groups`


def intervals_of(
    question: Question, slices: Slices, methods: Sequence[ModuleType] = METHODS
) -> Intervals:
    """The intervals of slices by the first of the methods that applies, which asks the ones
    after it."""
    place = next(place for place, method in enumerate(methods) if method.applies(question, slices))
    return methods[place].find(
        question, slices, partial(intervals_of, methods=methods[place + 1 :])
    )


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """A search for the stable intervals of loops of one drawing along the number `along` within
    span = (low, high).

    groups: of the loops, which the members of all of them number. lines: whether to give the lines
    of a spectrum at the ends. checked: whether the numbers are known to make loops. prover, bound:
    see `Question`. at_port: what is computed of a port at the ends. dtype: of the records, with the
    fields of RECORD and those of at_port.
    """

    along: str
    span: tuple[float, float]
    groups: Groups
    lines: bool = True
    checked: bool = False
    prover: Prover | None = None
    bound: RequiredRegion | None = None
    at_port: AtPort | None = None
    dtype: np.dtype = RECORD

    @property
    def question(self) -> Question:
        """What is asked of the loops."""
        find_port = self.at_port.find_port if self.at_port else None
        return Question(self.along, self.span, self.prover, self.bound, find_port)

    def records(self) -> np.ndarray:
        """The intervals as records, with what is asked at their ends."""
        question = self.question
        groups = self.opened_groups()
        batches = []
        for members, slices in groups:
            intervals = intervals_of(question, slices)
            batches.append(replace(intervals, column=members[intervals.column]))
        records = records_of(by_slice(batches), self.dtype)
        passes = []
        if self.at_port:
            passes.append((self.at_port.fields, self.at_port.values))
        if self.lines:
            passes.append((LINES, lines_at_ends))
        for members, slices in groups if passes else ():
            rows = np.flatnonzero(records["intervals"] > 0)
            if len(groups) > 1:
                rows = rows[np.isin(records["slice"][rows], members)]
            place = np.searchsorted(members, records["slice"][rows])
            p = np.stack([records[name][rows] for name in ENDS])
            omega = np.stack([records[name][rows] for name in OMEGAS])
            for fields, values_at in passes:
                values = values_at(question, slices.loops, slices.opened, place, p, omega)
                for name, column in zip(fields, values, strict=True):
                    records[name][rows] = column
        return records

    def opened_groups(self) -> list[tuple[np.ndarray, Slices]]:
        """The members and the slices of each group; groups that may have a loop without the
        number in common are one."""
        question = self.question
        groups = self.groups
        for _, loops in () if self.checked else groups:
            loops.refuse_unsuitable()
        batches = []
        paired: set[int] = set()

        def opened(members: np.ndarray, loops: Loops) -> Slices:
            size = members.size
            opened_loops = Opened.of(loops, question.number, size, find_port=question.find_port)
            return Slices(loops, size, opened_loops)

        for pair in combinations(range(len(groups)), 2):
            both = paired.isdisjoint(pair) and self._with_zeros(*(groups[index] for index in pair))
            if not both:
                continue
            slices = opened(*both)
            if slices.opened and slices.opened.loops.second:
                batches.append((both[0], slices))
                paired.update(pair)
        for index, (members, loops) in enumerate(groups):
            if index not in paired:
                batches.append((members, opened(members, loops)))
        return batches

    def _with_zeros(
        self, group: tuple[np.ndarray, Loops], second_group: tuple[np.ndarray, Loops]
    ) -> tuple[np.ndarray, Loops] | None:
        """Two groups as one, that are apart since a number which loops may be without is 0 in
        one of them; else None."""
        (first, loops), (second, second_loops) = group, second_group
        arrays = [path for path, v in loops.values.items() if np.ndim(v)]
        zero = [
            path
            for path in arrays
            if np.any(loops.values[path]) != np.any(second_loops.values[path])
        ]
        alike = all(
            loops.values[path] == second_loops.values[path]
            for path in loops.values.keys() - {*arrays}
        )
        question = self.question
        if not alike or zero != [varied_beside(loops, question.number)]:
            return None
        if any(
            len(subloops.subloops_along(question, group)) > 1 for group in (loops, second_loops)
        ):
            return None
        members = np.concatenate([first, second])
        order = np.argsort(members)
        values = {
            path: np.concatenate([loops.values[path], second_loops.values[path]])[order]
            for path in arrays
        }
        return members[order], loops.changed(values)

    @property
    def in_pieces(self) -> bool:
        """Whether loops are built in another way at other values of the number, as dead times of
        other whole ticks are."""
        loops = self.groups[0][1]
        return dead_time_pieces.applies(self.question, Slices(loops, 1))

    def about(self, value: float, work: float) -> tuple[np.ndarray, tuple[float, float]]:
        """The intervals of a single loop about a value of the number; see
        `dead_time_pieces.about`."""
        ((_, loop),) = self.groups
        return dead_time_pieces.about(
            self.question, loop, value, work, partial(intervals_of, methods=METHODS[1:])
        )


@dataclass(frozen=True, slots=True, eq=False)
class Searches:
    """Searches for loops of different drawings along the same range, whose members number the
    loops of all."""

    searches: tuple[Search, ...]

    def records(self) -> np.ndarray:
        """The intervals of all loops as records, sorted by slice.

        Loops whose search fails in arithmetic are searched apart, and one that fails alone is in
        doubt everywhere.
        """
        try:
            batches = [search.records() for search in self.searches]
        except FAILURES as error:
            apart = [
                replace(search, groups=(group,))
                for search in self.searches
                for group in search.groups
            ]
            if len(apart) == 1:
                search = apart[0]
                ((members, loops),) = search.groups
                if members.size == 1:
                    return unanswered(search.dtype, int(members[0]), search.span, error)
                halves = np.array_split(np.arange(members.size), 2)
                parts = [(members[half], loops.some(half)) for half in halves]
                apart = [replace(search, groups=(part,)) for part in parts]
            batches = [Searches((search,)).records() for search in apart]
        records = np.concatenate(batches)
        return records[np.argsort(records["slice"], kind="stable")]
