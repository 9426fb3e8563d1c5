"""Matrices of frames in balls against the march of the same equations, which solves and multiplies them in doubles."""

import random
import tomllib
from fractions import Fraction

import numpy as np
import pytest
from checker.test_balls import EXACT, real
from meaning import doubles
from meaning.machine import Machine
from meaning.specs import linkage, spec_text, toml

from wavesweep.checker import balls
from wavesweep.checker.frame import Flow, Frames, steps_of
from wavesweep.checker.reader import loop_of, unknown_key, with_numbers


def enclosed(text: str, values: dict, sides: dict) -> tuple[list[str], np.ndarray, np.ndarray]:
    """States, middles and radii of a frame in the middle of a cell."""
    tables = tomllib.loads(text, parse_float=balls.decimal)
    loop = loop_of(with_numbers(tables, values | {name: balls.side(name, ends) for name, ends in sides.items()}), balls)
    frames = Frames(steps_of({"": loop.schedule()}))
    assert unknown_key(tables, loop) is None
    A = frames.matrix("", balls.Cell(sides))
    names = sorted(frames.live)
    entries = [[A[row].get(column, (0, 0)) for column in names] for row in names]
    whole = [[[part / balls.ONE for part in entry] for entry in row] for row in entries]
    return (
        names,
        np.array([[entry[1] for entry in row] for row in whole]),
        np.array([[entry[0] for entry in row] for row in whole]),
    )


def marched(text: str, names: list[str]) -> np.ndarray:
    machine = Machine(loop_of(tomllib.loads(text), doubles).schedule())
    places = [machine.memory[name] for name in names]
    return machine.monodromy()[np.ix_(places, places)]


def agree(text: str) -> None:
    names, middle, radius = enclosed(text, {}, {})
    march = marched(text, names)
    assert radius.max(initial=0.0) < 1e-15 * max(1.0, abs(middle).max(initial=0.0))
    np.testing.assert_allclose(middle, march, rtol=1e-9, atol=1e-9 * abs(march).max(initial=0.0))


@pytest.mark.parametrize("number", [0, 1, 2, 3, 5, 6, 9, 17, 19, 59, 69])
def test_a_frame_is_that_of_the_march(number):
    agree(spec_text(number, quick=True))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 300, 20))
def test_frames_are_those_of_the_march(first):
    for number in range(first, first + 20):
        agree(spec_text(number, quick=True))


@pytest.mark.parametrize(("kind", "seed"), [("five-bar", 3), ("pantograph", 4), ("delta", 1)])
def test_a_device_of_several_axes_is_that_of_the_march(kind, seed):
    agree(toml(linkage(seed, kind)))


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_motion_is_enclosed_by_its_exponential(size):
    """Of 100 digits, at a point and at points of a cell, in which it is as narrow as its order allows."""
    draw = random.Random(size)  # noqa: S311
    names = [f"x{row}" for row in range(size)]
    k = balls.side("k", (Fraction(1, 2), Fraction(3, 4)))
    for fast, widest in ((1, 1 << 30), (10**6, 1 << 60)):
        A = [[Fraction(draw.randint(-fast, fast), 10**3) for _ in names] for _ in names]
        rows = {name: {other: k * x for other, x in zip(names, row, strict=True)} for name, row in zip(names, A, strict=True)}
        flow = Flow(rows, balls.number(Fraction(1, 100)))
        cell = balls.Cell({"k": (Fraction(1, 2), Fraction(1, 2) + Fraction(1, 100 * fast))})
        point = balls.Cell({"k": (Fraction(1, 2),) * 2})
        for found, share, values in ((flow.map(point), 0, [Fraction(1, 2)]), (flow.map(cell), 1, cell_points(cell))):
            for s, value in zip((0, -1, Fraction(1, 3)), values, strict=False):
                exact = EXACT.expm(EXACT.matrix([[real(x * value / 100) for x in row] for row in A]))
                for i, name in enumerate(names):
                    for j, other in enumerate(names):
                        radius, *parts = found[name].get(other, (0, 0))
                        middle = sum(part * s**power for power, part in enumerate(parts))
                        assert abs(Fraction(str(exact[i, j] * balls.ONE)) - middle) <= radius < (widest << 20 * share)


def cell_points(cell) -> list[Fraction]:
    centre, half = (Fraction(part, balls.ONE) for part in cell.powers["k", 1][1:])
    return [centre, centre - half, centre + half / 3]


@pytest.mark.parametrize("number", [0, 2, 4, 6, 8, 10])
def test_a_cell_encloses_its_members(number):
    """A polynomial along a wall's stiffness, with its error, against frames at points of it."""
    text = spec_text(number, quick=True)
    tables = tomllib.loads(text, parse_float=balls.decimal)
    low, high = Fraction(90), Fraction(110)
    loop = loop_of(with_numbers(tables, {"K_VE": balls.side("K_VE", (low, high))}), balls)
    frames = Frames(steps_of({"": loop.schedule()}))
    cell = balls.Cell({"K_VE": (low, high)})
    whole = frames.matrix("", cell)
    for share in (-1, Fraction(-1, 3), Fraction(7, 8)):
        value = (low + high) / 2 + share * (high - low) / 2
        at = frames.matrix("", balls.Cell({"K_VE": (value, value)}))
        for name, row in at.items():
            for column, (radius, middle) in row.items():
                error, *parts = whole[name].get(column, (0, 0))
                polynomial = sum(part * share**power for power, part in enumerate(parts))
                assert abs(polynomial - middle) <= error + radius + 1
