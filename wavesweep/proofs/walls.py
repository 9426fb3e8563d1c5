"""The claims of rows and verdicts through contact: multipliers of walls that push and never pull, and
sums of squares that show that they serve."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.checker import balls, contact, file
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader import for_all
from wavesweep.proofs.cells import Cell, exactly, tree
from wavesweep.proofs.drifts import drifts_and_rest
from wavesweep.proofs.forms import form_of
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
        lines += _pieces(family, ends)
    return [head, *lines]


def claim_of_motion(tables: dict, numbers: Mapping[str, str], ends: Ends, text: str) -> Lines:
    """Return the line of a claim that the forces of a wall, as they are printed, go on for ever.

    ends: the wall's numbers. Errors: Refused for another text, or if the checker does not find them
    to; Unreadable.
    """
    if not text.startswith("a wall through "):
        raise Refused(f"what refutes it is no motion that repeats: {text}")
    forces = re.findall(r"\(\S+, (\S+)\)", text)
    others = {name: value for name, value in numbers.items() if name not in ends}
    claim = file.Claim("goes on", {name: Fraction(value) for name, value in others.items()}, ends)
    claim.drifts, claim.rest = drifts_and_rest(tables, claim, {})
    family = file.family_of(tables, claim)
    loop = file.opened_at(family, {name: low for name, (low, _) in ends.items()})
    if not contact.goes_on(loop, [*map(Fraction, forces)]):
        raise Refused(f"no wall is found that has the forces of {text}")
    sides = {name: [decimals(low), decimals(high)] for name, (low, high) in ends.items()}
    head = {"claim": "goes on", "numbers": others, "sides": sides, "forces": forces}
    own = {"drifts": claim.drifts, "states": family.states}
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


def _opened(family: file.Family, point: Mapping[str, Fraction]) -> contact.Opened:
    return file.opened_at(family, point)


def _weights(given: np.ndarray) -> list[Fraction]:
    return [Fraction(f"{x:.{DIGITS}f}") for x in given]
