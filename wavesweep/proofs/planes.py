"""Planes of two or three numbers: the parts of a map, each with a form that has the count of its part."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from wavesweep.checker import balls, file, form
from wavesweep.checker.balls import Refused
from wavesweep.engine.switched import inertia_of_cells
from wavesweep.proofs.cells import exactly, written
from wavesweep.proofs.sets import DIGITS, Ends, Leaf, exponents_of, polynomials_of, tree

DEEPEST = 40  # times a part that has to be proved is halved
MOST_CELLS = 1000  # of such a part
SMALLER = 5  # times a part of a map is halved before it stays open


class Part(NamedTuple):
    """A part of a map: its ends as doubles, `(2, numbers)`, and how many modes are outside; None if
    it is open."""

    box: np.ndarray
    outside: int | None


def lines_of(
    family: file.Family, names: Sequence[str], parts: Sequence[Part]
) -> tuple[float, list[dict[str, Any]]]:
    """Return the share of a map of some numbers that is proved, and the tree of its cells. Its parts
    are smaller where the checker's polynomials, of a lower order, ask for it."""
    leaves: list[Leaf] = []
    for part in parts:
        leaves += _leaves(family, names, part, SMALLER)
    sizes = np.array([np.ptp(leaf.box, 0).prod() for leaf in leaves])
    proved = np.array(["L" in leaf.line for leaf in leaves])
    return float(sizes[proved].sum() / sizes.sum()), list(tree(names, leaves))


def lines_within(
    family: file.Family, names: Sequence[str], box: np.ndarray
) -> list[dict[str, Any]]:
    """Return the tree of cells of a box all over which no mode is outside. Errors: Refused."""
    leaves: list[Leaf] = []
    for leaf in _leaves(family, names, Part(box, 0), DEEPEST):
        if "L" not in leaf.line or len(leaves) == MOST_CELLS:
            places = ", ".join(
                f"{name} = {x:.6g}" for name, x in zip(names, leaf.box[0], strict=True)
            )
            raise Refused(f"no forms are found next to {places}")
        leaves.append(leaf)
    return list(tree(names, leaves))


def _leaves(family, names, part: Part, halvings: int) -> Iterator[Leaf]:
    """Yield the cells of a part with a form of the checker's digits, halved as often as is needed; those
    that stay without one are open."""
    if part.outside is None:
        yield Leaf(part.box, {"open": True})
        return
    ends = {}
    for name, (low, high) in zip(names, part.box.T.tolist(), strict=True):
        ends[name] = exactly(low), exactly(high)
    line, side = _line(family, ends, part.outside)
    if line is not None:
        yield Leaf(part.box, line)
    elif not halvings:
        yield Leaf(part.box, {"open": True})
    else:
        middle = part.box[:, side].mean()
        for half in (0, 1):
            box = part.box.copy()
            box[1 - half, side] = middle
            yield from _leaves(family, names, part._replace(box=box), halvings - 1)


def _line(family, ends: Ends, outside: int) -> tuple[dict[str, Any] | None, int]:
    """What the file says of a cell, None without; and the side along which it is halved then."""
    cell = balls.Cell(ends)
    try:
        A = family.matrix("", cell)
    except Refused:
        return None, 0
    found = inertia_of_cells(polynomials_of(A, cell).of(None))
    side = int(np.nan_to_num(found.moves[0], nan=np.inf).argmax())
    if found.outside[0] != outside:
        return None, side
    for digits in DIGITS:
        line = _of_form(found, exponents_of(cell.width)[1:], digits)
        signs = [1 if sign == "+" else -1 for sign in line["signs"]]
        P = file.form_from(line, cell, signs)
        if form.decreases(P, [(None, A, P)]):
            return line, side
    return None, side


def _of_form(found, exponents, digits) -> dict[str, Any]:
    """A form as a file has it, in so many digits: `L' (signs + sum of s^exponents Q) L`, with L of
    the eigenvectors of its middle and Q its further terms in the same coordinates."""
    P, *further = found.forms[:, 0, 0]
    values, vectors = np.linalg.eigh(P)
    roots = np.sqrt(np.abs(values))[:, None] * vectors.T
    back = np.linalg.inv(roots)
    L = roots @ np.linalg.inv(found.basis[0, 0])
    slopes = []
    for powers, term in zip(exponents, further, strict=False):
        Q = back.T @ term @ back
        slopes.append([[*powers], written((Q + Q.T) / 2, digits)])
    return {
        "L": written(L / np.abs(L).max(), digits),
        "signs": "".join("+" if value > 0 else "-" for value in values),
        "Q": slopes,
    }
