"""Expressions are read by the parser's own grammar: precedence, signals and gains."""

import math
import random
import sys

import mpmath
import numpy as np
import pytest

from wavesweep.engine._drawing.expressions import FUNCTIONS, Fault
from wavesweep.engine._drawing.parsing import MOST_TOKENS, parse

NUMBERS = {"a": 1.5, "b": -0.7, "kp": 3.25}
NAMES = {"__builtins__": {}, "pi": math.pi} | {name: getattr(math, name) for name in FUNCTIONS}


def random_text(r, depth):
    """Arithmetic in numbers, names, pi and roots, with signs, parentheses and blanks."""
    if depth == 0 or r.random() < 0.15:
        return r.choice(["2", "0.5", ".25", "3.", "1e-1", "2E+1", "a", "b", "kp", "pi"])
    kind, inner = r.randrange(8), lambda: random_text(r, depth - 1)
    if kind < 4:
        blank = " " * r.randrange(2)
        return f"{inner()}{blank}{'+-*/'[kind]}{blank}{inner()}"
    if kind == 4:
        return f"{r.choice('+-')}{inner()}"
    if kind == 5:
        return f"({inner()})"
    if kind == 6:
        return f"{r.choice(FUNCTIONS)}(({inner()})**2)"
    return f"({inner()})**{r.choice(['2', '3', '-1', '-2', '0'])}"


def test_a_thousand_random_texts_have_the_value_that_python_gives_them():
    r, compared = random.Random(3), 0  # noqa: S311 - arithmetic, no secrets
    while compared < 1000:
        text = random_text(r, 4)
        try:
            wanted = eval(text, NAMES, NUMBERS)  # noqa: S307 - the test's own text
        except (ArithmeticError, ValueError):
            continue
        assert parse(text).evaluate(NUMBERS) == pytest.approx(wanted, rel=1e-12, abs=1e-12 * abs(wanted)), text
        compared += 1


def test_the_text_of_a_tree_has_its_value_to_the_bit():
    r, compared = random.Random(4), 0  # noqa: S311 - arithmetic, no secrets
    while compared < 1000:
        tree = parse(random_text(r, 4))
        try:
            wanted = tree.evaluate(NUMBERS)
        except (ArithmeticError, ValueError):
            continue
        assert parse(tree.text).evaluate(NUMBERS) == wanted, tree.text
        compared += 1


@pytest.mark.parametrize("text", ["a - (b - kp)", "a*(b + 2)/kp", "-a", "(a + b)**2", "sqrt(a + 1)", "a/(b/kp)", "2*pi", "0.1"])
def test_a_text_has_no_more_parentheses_than_it_needs(text):
    assert parse(text).text == text


def test_values_may_be_arrays_and_complex():
    p = np.array([1.0, 2.0 + 1j, -3.0])
    found = parse("(p**3 - 1/p)*sqrt(2)/kp").evaluate({"p": p, "kp": 2.0}, np)
    np.testing.assert_allclose(found, (p**3 - 1 / p) * np.sqrt(2) / 2, rtol=1e-14)


def gains(text, signals=("arm.x", "arm.v", "f")):
    return {name: gain.evaluate(NUMBERS) for name, gain in parse(text).linear(set(signals))}


def test_a_text_is_a_sum_of_signals_times_gains():
    assert gains("-kp*arm.x - 2*(arm.v - a*arm.x)/4 + f") == {"arm.x": -3.25 + 0.75, "arm.v": -0.5, "f": 1.0}
    assert gains("a*(b*(arm.x + f) - f)") == {"arm.x": -1.5 * 0.7, "f": pytest.approx(-1.5 * 1.7)}
    assert gains("0") == {}
    assert gains("arm.x*sqrt(4)**-1") == {"arm.x": 0.5}


def test_a_text_too_long_or_too_deep_is_refused():
    for text in ("+".join(["a"] * MOST_TOKENS), "(" * 51 + "a" + ")" * 51, "-" * 51 + "a", "a" + "**a" * 51):
        with pytest.raises(Fault, match="at most"):
            parse(text)


def test_texts_that_are_not_refused_are_read_from_deep_in_a_program():
    def deep(levels, text):
        return deep(levels - 1, text) if levels else parse(text).evaluate(NUMBERS)

    below = sys.getrecursionlimit() // 3
    assert deep(below, "(" * 50 + "a" + ")" * 50) == 1.5
    assert deep(below, "-" * 50 + "a") == 1.5
    assert deep(below, "+".join(["(-a)"] * 60)) == -1.5 * 60
    assert deep(below, "+".join(["a"] * (MOST_TOKENS // 2))) == 1.5 * (MOST_TOKENS // 2)


def test_divisors_roots_and_broken_powers_are_where_a_text_is_not_analytic():
    trees = list(parse("1/(a - 1) + sqrt(b) + kp**0.5 + a**2 + 2**b + sin(a)*exp(a) + log(kp) + tan(a)").singular())
    assert [tree.evaluate(NUMBERS) for tree, _ in trees] == [0.5, -0.7, 3.25, 2.0, 3.25, math.cos(1.5)]
    assert [root and root.operation for _, root in trees] == [None, "sqrt", "**", "**", None, None]


@pytest.mark.parametrize(
    "text",
    [
        "sin(p)",
        "cos(p)",
        "tan(p)",
        "exp(p)",
        "log(p)",
        "1 - cos(p/1e6)",
        "sin(355*p) - p",
        "tan(p - 1.5) - exp(-40*p)",
        "log(1 + p/1e9)",
    ],
)
@pytest.mark.parametrize("p", [1e-9, 1.1, 37.5])
def test_functions_are_right_to_a_few_roundings_where_doubles_lose_digits(text, p):
    names = {name: getattr(mpmath, name) for name in FUNCTIONS}
    with mpmath.workdps(80):
        wanted = eval(text, names, {"p": mpmath.mpf(p)})  # noqa: S307 - the test's own text
        found = [parse(text).value({"p": p}), parse(text).values({"p": np.array([p])})[0]]
        assert [float(abs(each / wanted - 1)) < 1e-15 for each in found] == [True, True]
        wanted = eval(text, names, {"p": mpmath.mpc(p, 0.4)})  # noqa: S307 - the test's own text
        assert abs(parse(text).exactly({"p": p + 0.4j}) / complex(wanted) - 1) < 1e-15


def test_towers_of_powers_of_whole_numbers_are_as_those_of_doubles():
    """Whole numbers below 2^64 have all their digits, and larger ones those of a double."""
    power = parse("n**n")
    assert power.evaluate({"n": 15}) == 15**15
    assert power.evaluate({"n": 40}) == 40.0**40
    tower = parse("n**n**n**n")
    with pytest.raises(OverflowError):
        tower.evaluate({"n": 9})
