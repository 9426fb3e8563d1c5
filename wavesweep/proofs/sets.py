"""Cells of a box with forms for frames in any order or at random, found as [for_all] finds its own.

The matrices are those of the checker, so nothing has to be carried from other states into its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import matrix_balance

from wavesweep.checker import balls, file, form
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader.for_all import TICK
from wavesweep.engine.sets import Polynomials, Side
from wavesweep.engine.switched import ALWAYS, Centre, Graph, OnAverage, cover
from wavesweep.proofs.cells import written
from wavesweep.proofs.ticks import AtPlaces

ORDER = form.KEPT  # of single matrices in doubles, whose forms leave no terms of the slack up to it
OF_SEVERAL = 2  # of several: the checker counts terms of a slack beyond it as errors
LOGARITHMIC = 4.0  # ratio of the ends of a positive side above which it is divided by factors
NARROWEST = 1e-6  # of a side: a cell whose forms the checker refuses is not divided below it
WORK, SEARCH = 1e13, 1e11  # operations of a proof, and of a search for norms in a middle
MOST = 4000  # cells that are tried: of long frames, some minutes
LEFT_OPEN = 1e-4  # of a side, from its low end on: where a loop only just decays
LEAST = 1e-300  # width of a side
POINTS = (1, -1, 1), (1, 0, -1), (1, 1, 1)  # Bernstein's of c0 + c1 s + c2 s^2, -1 <= s <= 1
DIGITS = 8, 12, 17  # of the entries of forms, that are tried
Ends = dict[str, tuple[Fraction, Fraction]]
Lines = list[dict[str, Any]]


class Frame(NamedTuple):
    """A frame after which the same may follow: its letter, its kind, and the state that it leads to;
    of a tick that takes any time of a part, a control point."""

    letter: str
    kind: str
    after: Any
    point: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """A cell with its forms: from low to high of the sides, as doubles, `(2, sides)`."""

    box: np.ndarray
    line: dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """The checker's matrices over the sides of a claim, see `for_all.ranges.Frames`.

    sides: in what its sides are divided. frames: whose matrices they are. rule: which of them may
    follow which, or the chain in which they do at random. units: of the states, in which entries are
    alike, and forms are searched. left: one for each cell that may be tried.
    """

    family: file.Family
    claim: file.Claim
    sides: Sequence[Side]
    frames: Sequence[Frame]
    rule: np.ndarray | OnAverage | AtPlaces
    units: np.ndarray
    left: Iterator[int] = field(default_factory=lambda: iter(range(MOST)))

    @staticmethod
    def of(family: file.Family, claim: file.Claim, refuted: float = np.inf) -> Cells:
        """Those of a claim. refuted: a number beyond the first side, next to which cells are narrow.
        Errors: Refused for chances that depend on a side."""
        sides = []
        for name, (low, high) in claim.sides.items():
            wide = low > 0 and high > LOGARITHMIC * low
            sides.append(Side(name, 0.0) if wide else Side(name))
        if sides and np.isfinite(refuted):
            first = sides[0]
            zero = (
                first.zero if first.zero == 0 else 2 * float(claim.sides[first.path][0]) - refuted
            )
            sides[0] = Side(first.path, zero, refuted)
        if claim.claim == "mean square":
            frames, rule = _chain(family)
        elif "" in family.frames.words:
            frames, rule = [Frame("", "", None)], ALWAYS
        else:
            frames, rule = _any_order(family, len(POINTS) if claim.times else 1)
            if claim.times:
                rule = AtPlaces(rule, len(family.moves))
        return Cells(family, claim, sides, frames, rule, _units(family, claim))

    @property
    def order(self) -> int:
        """That of the matrices in doubles."""
        return ORDER if self.rule is ALWAYS else OF_SEVERAL

    @property
    def ends(self) -> Ends:
        """The sides of the claim."""
        return self.claim.sides

    @property
    def whole(self) -> np.ndarray:
        """The box of places, `(2, sides)`, with one that is a point where there is no side."""
        places = [
            [float(side.place(np.array([float(end)]))[0]) for end in ends]
            for side, ends in zip(self.sides, self.ends.values(), strict=True)
        ]
        return np.array(places).reshape(-1, 2).T if places else np.zeros((2, 1))

    def number(self, at: int, place: float) -> Fraction:
        """The number at a place of a side; exactly the end at an end."""
        name = list(self.ends)[at]
        for end, known in zip(self.ends[name], self.whole[:, at], strict=True):
            if place == known:
                return end
        return Fraction(repr(float(self.sides[at].number(np.array([place]))[0])))

    def cell(self, box: np.ndarray) -> Ends:
        """The ends of the sides of a box."""
        ends = {}
        for at, name in enumerate(self.ends):
            low, high = box[:, at].tolist()
            ends[name] = self.number(at, low), self.number(at, high)
        return ends

    def wide_ends(self, box: np.ndarray) -> np.ndarray:
        """The ends of the wide sides of a box, as doubles, `(2, sides)`."""
        ends = np.array([[float(low), float(high)] for low, high in self.cell(box).values()]).T
        return ends[:, ends[0] < ends[1]]

    def word(self, letters: Sequence[str]) -> tuple[int, ...]:
        """The frames of a pattern of letters that may be repeated for ever, () if it is none."""
        place = {frame: at for at, frame in enumerate(self.frames)}
        for state in self.family.moves:
            now = state
            frames = []
            for letter in list(letters) * (1 + len(self.family.moves)):
                if letter not in self.family.moves[now]:
                    break
                kind, now, _ = self.family.moves[now][letter]
                frames.append(place[Frame(letter, kind, now)])
            else:
                return tuple(frames[-len(letters) :])
        return ()

    @property
    def cycle(self) -> tuple[int, ...]:
        """Frames that can be repeated for ever, the first ones of all that may follow."""
        now = self.family.start
        seen = []
        letters = []
        while now not in seen:
            seen.append(now)
            letter, (_, now, _) = next(iter(self.family.moves[now].items()))
            letters.append(letter)
        return self.word(letters[seen.index(now) :])

    def over(self, boxes: np.ndarray) -> list[_InBox | int]:
        """The matrices in boxes, or the side along which one is divided that has none."""
        found: list[_InBox | int] = []
        for box in boxes:
            if next(self.left, None) is None:
                raise Refused(f"no forms are found in {MOST} cells")
            try:
                found.append(self.in_box(box))
            except Refused:
                found.append(int(np.argmax(np.ptp(box, 0) / np.ptp(self.whole, 0).clip(LEAST))))
        return found

    def in_box(self, box: np.ndarray) -> _InBox:
        """The matrices of the frames in a box, `(frames, n, n)`. Errors: Refused without a bound."""
        ends = self.cell(box)
        cell = balls.Cell(ends)
        times = self.claim.times.items()
        cells = {letter: balls.Cell(ends | {TICK: time}) for letter, time in times}
        found = {}
        due = np.full(cell.width, LEAST)
        for letter, kind in {(frame.letter, frame.kind) for frame in self.frames}:
            own = cells.get(letter, cell)
            A = self.family.matrix(kind, own)
            found[kind] = [polynomials_of(A, own, self.order)]
            if times:
                found[kind] = _at_control_points(found[kind][0])
            for powers, part in A.parts.items():
                if sum(powers) > self.order:
                    shares = 1 - 0.5 ** np.array(powers[: cell.width])
                    due += np.abs(np.array(part, float)).sum() * shares
        in_units = self.units / self.units[:, None]
        each = [found[frame.kind][frame.point] for frame in self.frames]
        terms = np.stack([one.terms for one in each], 1) * in_units
        rest = np.stack([one.rest for one in each]) * in_units
        return _InBox(self, box, Polynomials(terms, rest, cell.width, self.order), due)

    def line(self, box: np.ndarray, centre: Centre, further: np.ndarray) -> dict[str, Any] | None:
        """What the file says of a box with forms, None if the checker refuses it."""
        ends = self.cell(box)
        cell = balls.Cell(ends)
        exponents = exponents_of(cell.width, self.order)[1:]
        roots = np.linalg.cholesky(centre.P).mT
        L = roots @ centre.inverse / self.units
        back = np.linalg.inv(roots)
        slopes = [back.mT @ each @ back for each in further]
        largest = np.abs(L).max()
        for digits in DIGITS:
            nodes: list[dict[str, Any]] = []
            for node, rows in enumerate(L / largest):
                nodes.append({"L": written(rows, digits)})
                if slopes:
                    nodes[-1]["Q"] = [
                        [[*powers], written((each[node] + each[node].T) / 2, digits)]
                        for powers, each in zip(exponents, slopes, strict=False)
                    ]
            line = self._of_nodes(nodes, centre.graph)
            try:
                file.check_cells(self.family, replace(self.claim, sides=ends), iter([line]))
            except Refused:
                continue
            return line
        return None

    def _of_nodes(self, nodes, graph):
        if graph is ALWAYS.graph:
            return nodes[0] | {"signs": "+" * len(self.family.states)}
        if isinstance(self.rule, OnAverage):
            return {"nodes": nodes}
        edges = []
        leaving: list[set[Frame]] = [set() for _ in nodes]
        for source, symbol, target in zip(
            graph.source.tolist(), graph.symbol.tolist(), graph.target.tolist(), strict=True
        ):
            leaving[source].add(self.frames[symbol])
            edge = [source, self.frames[symbol].letter, target]
            if edge not in edges:  # of several control points
                edges.append(edge)
        moves = self.family.moves[self.family.start]
        first = {Frame(letter, kind, after) for letter, (kind, after, _) in moves.items()}
        start = next(node for node, frames in enumerate(leaving) if first <= frames)
        return {"nodes": nodes, "edges": edges, "start": start}


@dataclass(frozen=True, slots=True, eq=False)
class _InBox:
    """The matrices in a box, see `engine.switched`'s `cover`."""

    cells: Cells
    box: np.ndarray
    matrices: Polynomials
    due: np.ndarray

    def within(self, box: np.ndarray) -> Polynomials:
        """The matrices in a part of the box."""
        if np.array_equal(box, self.box):
            return self.matrices
        if self.cells.rule is not ALWAYS:  # enclosures of few orders, and tight ones pay
            return self.cells.in_box(box).matrices
        whole = self.cells.wide_ends(self.box)
        part = self.cells.wide_ends(box)
        half = np.ptp(whole, 0) / 2
        return self.matrices.within(
            (part.mean(0) - whole.mean(0)) / half, np.ptp(part, 0) / 2 / half
        )


def polynomials_of(A: form.Matrix, cell: balls.Cell, order: int = ORDER) -> Polynomials:
    """Return a matrix of the checker in doubles, `(n, n)`, up to an order."""
    rest = np.array(A.error, float)
    for powers, part in A.parts.items():
        if sum(powers) > order:
            rest += np.abs(np.array(part, float))
    nothing = np.zeros_like(rest)
    parts = [
        np.array(A.parts.get(each, nothing), float) for each in exponents_of(cell.width, order)
    ]
    return Polynomials(np.array(parts) / balls.ONE, rest / balls.ONE, cell.width, order)


def _at_control_points(A: Polynomials) -> list[Polynomials]:
    """Matrices at the control points of their last number, as polynomials of the others."""
    numbers = A.numbers - 1
    wanted = exponents_of(numbers, A.order)
    found = []
    for point in POINTS:
        terms = np.zeros((len(wanted), *A.rest.shape))
        for powers, part in zip(A.exponents.tolist(), A.terms, strict=True):
            terms[wanted.index(tuple(powers[:-1]))] += point[powers[-1]] * part
        found.append(Polynomials(terms, A.rest, numbers, A.order))
    return found


def exponents_of(width: int, order: int = ORDER) -> list[tuple[int, ...]]:
    """Return the monomials of matrices in so many sides, up to an order."""
    return [*map(tuple, Polynomials.constant(np.zeros(0), width, order).exponents.tolist())]


def _units(family, claim) -> np.ndarray:
    """Powers of 2 that balance the mean size of all frames in the middle of the sides."""
    sides = claim.sides
    if claim.times:
        sides = sides | {TICK: claim.times["0"]}
    middle = balls.Cell({name: ((low + high) / 2,) * 2 for name, (low, high) in sides.items()})
    sizes = []
    for kind in family.frames.words:
        A = family.matrix(kind, middle)
        sizes.append(np.abs(np.array(A.parts[()], float)) / balls.ONE)
    _, (units, _) = matrix_balance(np.mean(sizes, 0), permute=False, separate=True)
    return units


def _any_order(family, points):
    """The frames that differ in what follows, and which may follow which. points: of a frame."""
    frames = []
    for moves in family.moves.values():
        for letter, (kind, after, _) in moves.items():
            frames += [Frame(letter, kind, after, point) for point in range(points)]
    frames = list(dict.fromkeys(frames))
    place = {frame: at for at, frame in enumerate(frames)}
    follows = np.zeros((len(frames), len(frames)), dtype=bool)
    for at, frame in enumerate(frames):
        for letter, (kind, after, _) in family.moves[frame.after].items():
            for point in range(points):
                follows[at, place[Frame(letter, kind, after, point)]] = True
    return frames, follows


def _chain(family):
    """The kinds of frames, and the chain in which they come at random."""
    frames = [Frame(kind, kind, None) for kind in family.frames.words]
    place = {frame.kind: at for at, frame in enumerate(frames)}
    states = list(family.moves)
    edges = []
    weight = []
    for source, moves in enumerate(family.moves.values()):
        for kind, after, chance in moves.values():
            if chance.moves:
                raise Refused("probabilities that depend on the number along which rows are")
            edges.append((source, place[kind], states.index(after)))
            weight.append(chance.value(balls.POINT)[1] / balls.ONE)
    graph = Graph(*np.array(edges).T)
    return frames, OnAverage(graph, np.array(weight))


def lines_over(cells: Cells, words: Sequence[tuple[int, ...]] = ()) -> tuple[float, Lines]:
    """Return the place of the first side from which on forms are found, and the tree of cells from
    there to its end. words: patterns of frames that grow beyond it. Errors: Refused without forms."""
    if not cells.family.states:
        raise Refused("a loop without states needs no form")
    leaves = []
    waiting = [cells.whole]
    begins = waiting[0][0, 0]
    while waiting:
        box = waiting.pop()
        proved: list[tuple] = []
        found = cover(
            cells, box, cells.rule, WORK, up=False, words=words, stored=proved, search=SEARCH
        )
        if found.open:
            first = next(iter(cells.cell(found.open[-1]).items()), None)
            end = cells.number(0, found.end) if cells.sides else 0
            low, high = cells.ends[first[0]] if first else (0, 0)
            if len(cells.sides) != 1 or not end - low <= LEFT_OPEN * (high - low):
                place = f" at {first[0]} = {float(first[1][1]):.6g}" if first else ""
                raise Refused(f"no forms are found{place}")
            begins = found.end
        for part, (centre, further) in proved:
            if centre.graph.nodes > file.NODES:
                raise Refused(f"forms of {centre.graph.nodes} nodes; at most {file.NODES}")
            line = cells.line(part, centre, further)
            if line is not None:
                ends = [tuple(map(float, each)) for each in cells.cell(part).values()]
                leaves.append(Leaf(np.array(ends).T, line))
                continue
            widths = np.ptp(part, 0) / np.ptp(cells.whole, 0).clip(LEAST)
            side = int(widths.argmax())
            if widths[side] < NARROWEST:
                raise Refused("the checker refuses all forms that are found")
            for half in (0, 1):
                waiting.append(part.copy())
                waiting[-1][1 - half, side] = part[:, side].mean()
    return begins, list(tree([*cells.ends], leaves))


def tree(names: Sequence[str], leaves: Sequence[Leaf]) -> Iterator[dict[str, Any]]:
    """Yield the lines of cells that divide a box, in the order of the file."""
    if len(leaves) == 1:
        yield leaves[0].line
        return
    side, cut = _cut(leaves)
    yield {"split": names[side], "at": repr(cut)}
    yield from tree(names, [leaf for leaf in leaves if leaf.box[1, side] <= cut])
    yield from tree(names, [leaf for leaf in leaves if leaf.box[0, side] >= cut])


def _cut(leaves):
    """The side and the place of a cut through no cell, of those that are there the most central one."""
    best = None
    for side in range(leaves[0].box.shape[1]):
        reached = -np.inf
        for count, (low, high) in enumerate(sorted(leaf.box[:, side].tolist() for leaf in leaves)):
            if count and low >= reached:
                away = abs(2 * count - len(leaves))
                best = min(best or (away, side, low), (away, side, low))
            reached = max(reached, high)
    return best[1:]


def decimals(number: Fraction) -> str:
    """Return a number of a spec, or a double, as the decimals that it is."""
    digits = 0
    while (number * 10**digits).denominator != 1:
        digits += 1
    whole = str(abs(int(number * 10**digits))).rjust(digits + 1, "0")
    sign = "-" if number < 0 else ""
    return sign + (f"{whole[:-digits]}.{whole[-digits:]}" if digits else whole)
