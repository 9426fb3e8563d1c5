"""No form is accepted of a cell in which the count of modes changes, however it was found."""

import numpy as np
import pytest
from checker.test_hand_made import SPEC, STATES, TWO_NUMBERS

from wavesweep.checker import balls, file, form

END = 0.75**0.5


def rows(matrix) -> list[list[str]]:
    return [[f"{x:.17g}" for x in row] for row in matrix]


def accepted(spec: str, sides: dict, line: dict) -> bool:
    claim = file.Claim("modes", {}, sides, 0, [], STATES)
    cell = balls.Cell(sides)
    P = file.form_from(line, cell, [1 if sign == "+" else -1 for sign in line["signs"]])
    A = file.family_of(file.spec_of(spec.encode()), claim).matrix("", cell)
    return form.decreases(P, [(None, A, P)], line.get("turn", 0))


@pytest.mark.parametrize("seed", range(4))
def test_a_cell_with_an_end_in_it_has_no_form(seed):
    """Forms of one side of the end, of the other and of both, with slopes that follow them, turned and not."""
    random = np.random.default_rng(seed)
    for _ in range(12):
        width = 10 ** random.uniform(-12, -0.5)
        low, high = (balls.decimal(f"{END + width * step:.17g}") for step in (-random.uniform(0, 1), random.uniform(0, 1)))
        signs = random.choice(["++", "--", "+-"])
        L = np.linalg.qr(random.normal(size=(2, 2)))[0] if random.random() < 0.5 else np.eye(2)
        slope = np.diag(random.normal(size=2)) * 10 ** random.uniform(-3, 1)
        line = {"L": rows(L), "signs": signs, "Q": [[[1], rows(slope)], [[2], rows(random.normal() * np.eye(2))]]}
        line["turn"] = int(random.choice([0, 1, -1]))
        assert not accepted(SPEC, {"k": (low, high)}, line)


def test_a_cell_beside_an_end_has_one():
    for low, high, signs in ((END - 1e-3, END - 1e-9, "++"), (END + 1e-9, END + 1e-3, "--")):
        sides = {"k": (balls.decimal(repr(low)), balls.decimal(repr(high)))}
        assert accepted(SPEC, sides, {"L": rows(np.eye(2)), "signs": signs})


def test_a_box_with_a_border_in_it_has_no_form():
    """Modes a +- k j leave the circle at a^2 + k^2 = 1: boxes whose corner is outside by a little, and one that is inside."""
    for corner, stable in ((0.70710678, True), (0.70710679, False)):
        sides = {name: (balls.decimal("0.7"), balls.decimal(repr(corner))) for name in ("a", "k")}
        assert accepted(TWO_NUMBERS, sides, {"L": rows(np.eye(2)), "signs": "++"}) == stable
