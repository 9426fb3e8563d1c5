"""The equations of drawn loops at rest in residues: arithmetic, and the shifts that the blocks themselves have."""

import tomllib
from fractions import Fraction

import pytest
from support.drawn import NETWORK, as_blocks, random_tables
from support.specs import KINDS

from wavesweep.diagram.elimination import PRIME
from wavesweep.diagram.rest import Residue, _Equations
from wavesweep.spec import load
from wavesweep.spec.expressions import parse
from wavesweep.sweep.drawn_loops import drift_of


def residue(exact):
    return exact.numerator * pow(exact.denominator, -1, PRIME) % PRIME


def value(text, decimals=False, **numbers):
    spec = load(tomllib.loads(NETWORK))
    equations = _Equations(spec.drawing, {f"numbers.{name}": number for name, number in numbers.items()}, "", decimals)
    return equations._value(parse(text)).value


NUMBERS = {"a": 0.1, "b": -1.7e-9, "c": 123456.789}
A, B, C = map(Fraction, NUMBERS.values())


@pytest.mark.parametrize(
    ("text", "exact"),
    [
        ("a + b - 3*c", A + B - 3 * C),
        ("a/b/c", A / B / C),
        ("-(a - 2)**3/(1 - c)**2", -((A - 2) ** 3) / (1 - C) ** 2),
        ("a**-2 + b**40", A**-2 + B**40),
        ("1/(a*b) - 1/a/b", Fraction(0)),
    ],
)
def test_expressions_are_those_of_fractions(text, exact):
    assert value(text, **NUMBERS) == residue(exact)


def test_constants_are_doubles_or_decimals():
    assert value("0.1 + 0.2 - 0.3") != 0
    assert value("0.1 + 0.2 - 0.3", decimals=True) == 0
    assert value("0.5 + 0.25 - 0.75") == 0


def test_roots_and_broken_powers_are_some_number_each():
    assert value("sqrt(a) - sqrt(a)", a=2.0) == value("a**0.5 - a**0.5", a=2.0) == 0
    assert value("sqrt(a) - sqrt(b)", a=2.0, b=3.0) != 0
    with pytest.raises(ZeroDivisionError):
        value("1/(a - a)", a=2.0)


@pytest.mark.parametrize("seed", range(40))
def test_random_loops_have_the_drift_that_their_blocks_have(seed):
    tables, *_ = random_tables(seed) if isinstance(random_tables(seed), tuple) else (random_tables(seed),)
    spec = load(tables)
    assert not drift_of(spec.drawing, spec.values, spec.values).vague


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("velocity", ["exact", "difference"])
@pytest.mark.parametrize("integration", ["explicit", "implicit", "trapezoidal"])
def test_the_drift_of_a_controller_drawn_as_blocks_is_exact(kind, velocity, integration):
    for wall in (0.0, 500.0):
        values = load(
            {
                "controller": {"kind": kind},
                "device": {"velocity": velocity},
                "environment": {"integration": integration, "K_VE": wall},
            }
        ).values
        spec = load(as_blocks(values))
        assert not drift_of(spec.drawing, spec.values, spec.values).vague


def test_residues_compute_with_floats_from_both_sides():
    one = Residue.of(0.75)
    assert ((1.0 / one).value, (2.0 * one).value, (one - 0.75).value) == (residue(Fraction(4, 3)), residue(Fraction(3, 2)), 0)
