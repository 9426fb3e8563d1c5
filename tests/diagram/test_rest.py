"""The equations of drawn loops at rest in residues: arithmetic, and the shifts that the blocks themselves have."""

import tomllib
from contextlib import suppress
from fractions import Fraction

import pytest
from support.drawn import NETWORK, as_blocks, random_tables
from support.specs import KINDS
from wavesweep.diagram.residues import PRIMES, Field, NoRoot, Residue

import wavesweep
from wavesweep.diagram.elimination import PRIME
from wavesweep.diagram.rest import _Equations
from wavesweep.spec import load
from wavesweep.spec.expressions import parse
from wavesweep.sweep.drawn_loops import drift_of


def residue(exact):
    return exact.numerator * pow(exact.denominator, -1, PRIME) % PRIME


def value(text, decimals=False, **numbers):
    spec = load(tomllib.loads(NETWORK))
    given = {f"numbers.{name}": number for name, number in numbers.items()}
    for prime in PRIMES:
        with suppress(NoRoot):
            return _Equations(spec.drawing, given, "", Field(prime, decimals))._value(parse(text)).value
    raise AssertionError("no prime has these roots")


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


@pytest.mark.parametrize(
    ("text", "zero"),
    [
        ("sqrt(a)*sqrt(a) - a", True),
        ("sqrt(a) - a**0.5", True),
        ("sqrt(a) - sqrt(c)", False),
        ("sqrt(a) + sqrt(a)", False),
        ("sqrt(2*a)*sqrt(2/a) - 2", True),
        ("sqrt(2*a)*sqrt(2/a) + 2", False),
        ("sqrt(a)*sqrt(c) - sqrt(a*c)", True),
        ("sqrt(a)*sqrt(c) + sqrt(a*c)", False),
        ("sqrt(a)*sqrt(c)*sqrt(7) - sqrt(7*a*c)", True),
        ("sqrt(a)*sqrt(c)*sqrt(7*a) - a*sqrt(7*c)", True),
        ("sqrt(a)*sqrt(c)*sqrt(7)*sqrt(11)*sqrt(13) - sqrt(13)*sqrt(11)*sqrt(7)*sqrt(a)*sqrt(c)", True),
        ("sqrt(a)*sqrt(c)*sqrt(7)*sqrt(11)*sqrt(13) + sqrt(13)*sqrt(11)*sqrt(7)*sqrt(a)*sqrt(c)", False),
        ("sqrt(9*a) - 3*sqrt(a)", True),
        ("sqrt(9*a) + 3*sqrt(a)", False),
        ("sqrt(2.25) - 1.5", True),
        ("sqrt(2.25) + 1.5", False),
        ("sqrt(a - a)", True),
        ("sqrt(2.5*c)/c - 2.5/sqrt(2.5*c)", True),
        ("sqrt(sqrt(a)) - sqrt(sqrt(a))", True),
        ("a**0.3 - a**0.3", True),
        ("a**0.3 - c**0.3", False),
    ],
)
def test_roots_keep_what_is_zero_of_real_roots_and_nothing_else(text, zero):
    assert (value(text, **NUMBERS) == 0) == zero
    assert (value(text, a=2.0, c=3.0) == 0) == zero
    assert (value(text, a=0.1, c=0.4) == 0) == (zero or text == "sqrt(c) - 2*sqrt(a)")


def test_numbers_without_a_fraction_or_a_root_are_refused():
    with pytest.raises(ZeroDivisionError):
        value("1/(a - a)", a=2.0)
    with pytest.raises(ValueError, match="nonnegative"):
        value("sqrt(-a)", a=2.0)


def test_any_residue_is_a_root_where_no_prime_has_them():
    field = Field(PRIME, scattered=True)
    roots = [field.of(value).sqrt().value for value in (2.0, 3.0, 5.0, 7.0, 11.0, 13.0)]
    assert len({*roots}) == 6
    assert field.of(2.0).sqrt().value == roots[0]
    assert (field.of(2.0).sqrt() * field.of(2.0).sqrt() - 2).value != 0


def test_the_primes_are_primes_of_which_half_of_all_fractions_have_roots():
    for prime in PRIMES:
        assert prime % 4 == 3
        # A factor of p - 1 that is not known leaves a composite number this chance: 1 in 4**20.
        assert all(pow(base, (prime - 1) // 2, prime) in (1, prime - 1) for base in range(2, 60))


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
    one = Field(PRIME).of(0.75)
    assert isinstance(one, Residue)
    assert ((1.0 / one).value, (2.0 * one).value, (one - 0.75).value) == (residue(Fraction(4, 3)), residue(Fraction(3, 2)), 0)


BILATERAL = """
[rates]
tick_hz = 1000
[numbers]
b = 5.0
kh = 50.0
ke = 100.0
[block.master]
type = "mass"
mass = 0.2
damping = 0.3
stiffness = "kh"
[block.sent]
type = "wave"
b = "b"
[block.there]
type = "delay"
steps = 10
[block.received]
type = "wave"
b = "b"
gives = "velocity"
[block.back]
type = "delay"
steps = 10
[block.slave]
type = "integrator"
method = "explicit"
[wire]
"sent.v" = "master.v"
"sent.in" = "back.y"
"master.f" = "-sent.force"
"there.u" = "sent.out"
"received.in" = "there.y"
"slave.u" = "received.v"
"received.f" = "ke*slave.y + 0.5*received.v"
"back.u" = "received.out"
[sweep]
along = "ke"
ke = { start = 0, stop = 20000 }
"""


def test_a_sprung_master_and_a_slave_on_a_spring_share_a_force_that_nothing_changes():
    # At rest the waves carry any force; the two springs follow it, and so the shift has the root of 2b in it.
    loop = wavesweep.compile(tomllib.loads(BILATERAL))
    for name, span in (("ke", (0, 20000)), ("b", (0.1, 500))):
        (row,) = loop.stable_intervals(name, span).itertuples()
        assert row.certified
        below, above = loop.spectral_radius(**{name: [row.high * (1 - 1e-6), row.high * (1 + 1e-6)]})
        assert below < 1 < above
