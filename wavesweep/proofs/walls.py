"""The claims of rows and verdicts through contact: multipliers of walls that push and never pull, and
sums of squares that show that they serve."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.checker import balls, contact, file
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader import for_all
from wavesweep.program.tables.refuters import Refuter
from wavesweep.proofs.cells import Cell, exactly, tree, written
from wavesweep.proofs.drifts import drifts_and_rest
from wavesweep.proofs.forms import form_of
from wavesweep.proofs.refuted import word_of
from wavesweep.proofs.sets import decimals

DIGITS = 9  # of the weights of a multiplier
Ends = dict[str, tuple[Fraction, Fraction]]
Lines = list[dict[str, Any]]


def claim_of_walls(tables: dict, numbers: Mapping[str, str], ends: Ends) -> Lines:
    """Return the lines of a claim that every motion comes to rest at every wall that pushes.

    ends: of stiffness and damping of the wall, of which one at most has a range. Errors: Refused,
    Unreadable.
    """
    others = {name: value for name, value in numbers.items() if name not in ends}
    claim = file.Claim("contact", {name: Fraction(value) for name, value in others.items()}, ends)
    sides = {name: [decimals(low), decimals(high)] for name, (low, high) in ends.items()}
    head: dict[str, Any] = {"claim": "contact", "numbers": others, "sides": sides}
    lines: Lines = []
    for member in for_all.read(tables, balls.exact).members:
        claim.drifts, claim.rest = drifts_and_rest(tables, claim, member)
        family = file.family_of(tables, claim, member)
        own: dict[str, Any] = {"drifts": claim.drifts, "states": family.states}
        if claim.rest:
            own["rest"] = claim.rest
        if member:
            lines.append({"member": {name: decimals(each) for name, each in member.items()}, **own})
        else:
            head |= own
        vary = "" not in family.frames.words
        lines += _pieces_in_frames(family, claim) if vary else _pieces(family, ends)
    return [head, *lines]


def claim_of_motion(tables: dict, numbers: Mapping[str, str], ends: Ends, text: str) -> Lines:
    """Return the line of a claim that the forces of a wall, as they are printed, go on for ever.

    ends: the wall's numbers. Errors: Refused for another text, or if the checker does not find them
    to; Unreadable.
    """
    motion = re.match(
        r"a wall(?:, in frames of (\d+) ticks(?: and a (delay) of (\d+))?,)? through ", text
    )
    if not motion:
        raise Refused(f"what refutes it is no motion that repeats: {text}")
    forces = re.findall(r"\(\S+, (\S+)\)", text)
    others = {name: value for name, value in numbers.items() if name not in ends}
    exact = {name: Fraction(value) for name, value in others.items()}
    claim = file.Claim("goes on", exact, ends)
    ticks, *delay = motion.groups()
    if ticks:
        refuter = Refuter(frames=[(int(ticks), " ".join(filter(None, delay)))])
        claim.word = word_of(tables, replace(claim, claim="for all"), refuter)
    claim.drifts, claim.rest = drifts_and_rest(tables, claim, {})
    family = file.family_of(tables, claim)
    loop = file.opened_at(family, {name: low for name, (low, _) in ends.items()})
    if not contact.goes_on(loop, [*map(Fraction, forces)]):
        raise Refused(f"no wall is found that has the forces of {text}")
    sides = {name: [decimals(low), decimals(high)] for name, (low, high) in ends.items()}
    head = {"claim": "goes on", "numbers": others, "sides": sides, "forces": forces}
    own = {"drifts": claim.drifts, "states": family.states}
    if claim.word:
        own["word"] = claim.word
    return [head | own | ({"rest": claim.rest} if claim.rest else {})]


def _pieces(family: file.Family, ends: Ends) -> Lines:
    """The tree of cells of one loop."""
    squares = offered("sums_of_squares")
    names = [*ends]
    along = next((at for at, (low, high) in enumerate(ends.values()) if low < high), 0)
    name = names[along]
    by_stiffness = _opened(family, dict.fromkeys(names, Fraction(0)) | {names[0]: Fraction(1)})
    by_damping = _opened(family, dict.fromkeys(names, Fraction(0)) | {names[-1]: Fraction(1)})
    moved = squares.doubles_of(by_stiffness.moved, len(by_stiffness.read))
    alone = form_of([moved[:, :-1]]) if len(moved) else None
    if len(moved) and not (alone and (alone.signs > 0).all()):
        raise Refused("no form is found of the loop without its wall")
    L = [[repr(x) for x in row] for row in alone.L.tolist()] if alone else []
    read = squares.doubles_of([by_stiffness.read, by_damping.read], len(by_stiffness.read))
    read[:, -1] += 1.0  # y = f + u
    read[1:] *= len(names) - 1
    turns = by_stiffness.turns[1] / balls.ONE
    fixed = float(ends[names[1 - along]][0]) if len(names) > 1 else 0.0
    low, high = map(float, ends[name])
    pieces = offered("stretches").pieces_of(moved, read, turns, (along, fixed), (low, high))
    if not pieces:
        raise Refused(f"no multiplier is found from {name} = {low:.6g} to {high:.6g}")
    cells = []
    for piece in reversed(pieces):
        e, h = (_weights(each) for each in (piece.multiplier.after, piece.multiplier.before))
        line = {"L": L, "e": [decimals(x) for x in e], "h": [decimals(x) for x in h], "P": []}
        for value in dict.fromkeys((piece.low, piece.high)):
            point = {each: pair[0] for each, pair in ends.items()} | {name: exactly(value)}
            P = squares.sum_of_squares(_opened(family, point), e, h)
            if P is None:
                raise Refused("no sum of squares is found")
            line["P"].append(P)
        cells.append(Cell(piece.low, piece.high, line, 0))
    return list(tree(name, cells))


def _pieces_in_frames(family: file.Family, claim: file.Claim) -> Lines:
    """The tree of cells of one loop whose frames vary in any order."""
    if len(family.moves) > 1:
        raise Refused("results that are lost")
    in_frames = offered("rows_in_frames")
    names = [*claim.sides]
    along = next((at for at, (low, high) in enumerate(claim.sides.values()) if low < high), 0)
    samples, states = _samples(family, names)
    loop = in_frames.InFrames.in_doubles(samples)
    fixed = float(claim.sides[names[1 - along]][0]) if len(names) > 1 else 0.0
    walls = in_frames.Along(loop, along, fixed)
    low, high = map(float, claim.sides[names[along]])

    def cell(piece):
        high, *others = [walls.value(wall) for wall in piece.walls]
        line = _in_file(family, piece, states, loop.scale)
        return Cell(others[0] if others else high, high, line, 0)

    def serves(piece):
        found = cell(piece)
        ends = claim.sides | {names[along]: (exactly(found.low), exactly(found.high))}
        try:
            file.check_cells(family, replace(claim, sides=ends), iter([found.line]))
        except Refused:
            return False
        return True

    for graph in loop.graphs[::-1]:
        cells = [cell(piece) for piece in reversed(walls.down(graph, high, low, serves))]
        if cells and cells[0].low == low:
            return list(tree(names[along], cells))
    raise Refused(f"no forms are found from {names[along]} = {low:.6g} to {high:.6g}")


def _samples(family: file.Family, names: Sequence[str]):
    """The frames in doubles, as forms are searched, and the places of its memory among the states."""
    last = [contact.LAST + name for name in names]
    eta = [index for index, name in enumerate(family.states) if name not in last]
    places = [family.states.index(name) for name in last]
    columns = [*eta, len(family.states)]
    moved = []
    read = []
    slide = []
    # At the wall of stiffness 1 alone, and of damping 1 alone, whose forces are position and speed.
    kinds = []
    for unit in names:
        wall = {name: Fraction(name == unit) for name in names}
        kinds.append(file.sampled_at(family, wall).values())
    for frames in zip(*kinds, strict=True):
        rows = np.array(frames[0].moved, float)[..., 1] / balls.ONE
        rise = np.array([frame.rise for frame in frames], float)[..., 1][:, columns] / balls.ONE
        moved.append(rows[np.ix_(eta, columns)])
        read.append(np.pad(rise, ((0, 2 - len(rise)), (0, 0))))
        slide.append((rise[0] - rows[places[0], columns]) * bool(family.rest))
    follows = np.ones((len(moved),) * 2, bool)
    fields = map(np.array, (moved, read, slide))
    samples = offered("stored_search").WallSamples(*fields, bool(family.rest), follows)
    return samples, [*eta, *places]


def _in_file(family: file.Family, piece: Any, states: Sequence[int], scale: np.ndarray):
    """What a file says of walls between which all are proved. states: places of the memory of the forms."""
    letters = {kind: letter for letter, (kind, *_) in family.moves[family.start].items()}
    names = [letters[kind] for kind in family.frames.words]
    size = len(states) + 1
    nodes = []
    for roots in zip(*piece.stored.L[::-1], strict=True):
        forms = []
        for root in roots:
            columns = np.empty((len(root), size))
            columns[:, [*states, size - 1]] = (root / scale)[:, [*range(size - 1), -1]]
            forms.append(written(np.linalg.qr(columns)[1]))
        nodes.append({"L": forms})
    edges = []
    weights = piece.stored.weights.tolist()
    for (source, frame, target), pair in zip(piece.graph.edges.tolist(), weights, strict=True):
        edges.append([source, names[frame], target, *(decimals(exactly(x)) for x in pair)])
    return {"nodes": nodes, "edges": edges, "start": 0, "h": decimals(exactly(piece.stored.h))}


def _opened(family: file.Family, point: Mapping[str, Fraction]) -> contact.Opened:
    return file.opened_at(family, point)


def _weights(given: np.ndarray) -> list[Fraction]:
    return [Fraction(f"{x:.{DIGITS}f}") for x in given]
