"""Expressions whose sums cancel keep their digits, held against mpmath at 80 digits."""

import random

import mpmath
import numpy as np
import pytest

from wavesweep.engine._drawing.parsing import parse

mp = mpmath.mp.clone()
mp.dps = 80

CANCELLING = (  # with a of some 1e-9, b next to a, and c next to 1
    "(1 + a) - 1",
    "sqrt(1 + a) - 1",
    "1 - 2*c + c**2",
    "(a**2 - b**2)/(a - b)",
    "1/(1 + a) - 1",
    "-(1 + a)**3 + (1 + 3*a)",
    "2 - (1 - a)**-2 - (1 + a)",
    "(1e20 + a) - 1e20",
    "5 + (1e3 - 1e3*c)*(pi - pi*c)",
    "a*((1 + 2**0.5*a) - 1)",
)


def reference(tree, numbers):
    """The value at 80 digits; constants are doubles."""
    if tree.is_leaf:
        return mp.mpmathify(tree.leaf if tree.operation == "number" else numbers[tree.leaf])
    values = [reference(operand, numbers) for operand in tree.operands]
    return {
        "negative": lambda a: -a,
        "sqrt": mp.sqrt,
        "+": lambda a, b: a + b,
        "-": lambda a, b: a - b,
        "*": lambda a, b: a * b,
        "/": lambda a, b: a / b,
        "**": lambda a, b: a ** (int(b) if b == int(b) else b),
    }[tree.operation](*values)


@pytest.mark.parametrize("text", CANCELLING)
@pytest.mark.parametrize("turn", [1.0, 1j])
def test_a_sum_that_cancels_keeps_its_digits(text, turn):
    tree, r = parse(text), np.random.default_rng(5)
    a = turn * 10 ** r.uniform(-12, -6, 20)
    numbers = {"a": a, "b": a * (1 + 1e-9), "c": 1 + a * (1 + 1e-7)}
    rows = [dict(zip(numbers, row, strict=True)) for row in zip(*(each.tolist() for each in numbers.values()), strict=True)]
    wanted = np.array([complex(reference(tree, row)) for row in rows])
    found = tree.values(numbers)
    np.testing.assert_allclose(found, wanted, rtol=1e-14)
    assert found.dtype == a.dtype
    if turn == 1:
        assert [tree.value(row) for row in rows] == found.tolist()
    alone = [tree.values({name: np.array([value]) for name, value in row.items()})[0] for row in rows]
    assert alone == found.tolist()


LARGE = (  # with n of 1e7
    "(1 + a)**n",
    "(1 - a)**-n",
    "(1 + a)**1e6",
    "(1 + a*c)**(0.5*n)",
    "(1 + a)**(n*c)",
    "1e-200*(c*1e-200)*1e300*(1e100*c)",
    "(a*1e-300)*1e300",
    "(b*1e-160)*(a*1e-160)/1e-300",
)


@pytest.mark.parametrize("text", LARGE)
def test_large_powers_and_tiny_products_keep_their_digits(text):
    tree, a = parse(text), 10 ** np.random.default_rng(8).uniform(-12, -8, 20)
    numbers = {"a": a, "b": 1.5 * a, "c": 1 + a, "n": np.full(20, 1e7)}
    rows = [dict(zip(numbers, row, strict=True)) for row in zip(*(each.tolist() for each in numbers.values()), strict=True)]
    wanted = np.array([float(reference(tree, row)) for row in rows])
    found = tree.values(numbers)
    np.testing.assert_allclose(found, wanted, rtol=2e-15)
    assert [tree.value(row) for row in rows] == found.tolist()
    rough = np.array([tree.evaluate(row) for row in rows])
    assert np.abs(rough / wanted - 1).max() > 1e-14


def random_text(r, depth):
    """Sums, products, roots and powers of names and constants next to 1."""
    if not depth or r.random() < 0.2:
        return r.choice(["1", "2", "a", "b", "c"])
    one, other = (random_text(r, depth - 1) for _ in range(2))
    kind = r.choice(["+", "-", "-", "*", "/", "sqrt", "**2", "**-1"])
    if kind == "sqrt":
        return f"sqrt({one})"
    return f"({one}){kind}" if len(kind) > 1 else f"({one}){kind}({other})"


def test_a_thousand_random_expressions_are_right_to_a_few_roundings():
    r, compared, cancelling = random.Random(7), 0, 0  # noqa: S311 - arithmetic, no secrets
    numbers = {"a": 1 + 3e-10, "b": 1 - 1e-13, "c": 1e-8 / 3}
    while compared < 1000:
        tree = parse(random_text(r, 5))
        try:
            rough, wanted = tree.evaluate(numbers), reference(tree, numbers)
            found = tree.value(numbers)
        except (ArithmeticError, ValueError):
            continue
        if isinstance(wanted, mp.mpc) or not 1e-100 < abs(wanted) < 1e100:
            continue
        assert float(abs(found / wanted - 1)) < 1e-12
        cancelling += abs(rough / wanted - 1) > 1e-9
        compared += 1
    assert cancelling > 20


def test_what_has_no_value_is_not_made_one():
    a = np.array([-1e-9, 0.0, 1e-9])
    with np.errstate(invalid="ignore", divide="ignore"):
        found = parse("sqrt((1 + a) - 1)/((1 + a) - 1)").values({"a": a})
    assert np.isnan(found[:2]).all()
    assert found[2] == pytest.approx(1e-9**-0.5, rel=1e-14)
