"""Proved intervals against closed forms, against another ball program, and against those that doubles certify."""

import tomllib
from itertools import groupby

import numpy as np
import pytest
from meaning.reading import radius_of, with_numbers
from support.certified import Witness
from support.drawn import ARM, CORNER, JOINT, NETWORK, NEXT_TO_ONE, PD, WALL, as_blocks, random_feedback, random_tables
from support.plants import bodies
from support.specs import random_values

import wavesweep

NAN = float("nan")
SPANS = {"k": (0, 300), "d": (-2, 400), "k0": (0, 3000), "g": (0.05, 2), "m0": (0.01, 3), "rates.tick_hz": (700.0, 5000.0)}


def close(one, other):
    return one == pytest.approx(other, rel=1e-9, abs=1e-12, nan_ok=True)


def read(text):
    """The tables of a text without its sweep."""
    return {name: table for name, table in tomllib.loads(text).items() if name != "sweep"}


@pytest.mark.parametrize(
    ("text", "number", "span", "limit"),
    [
        (PD, "kp", (0.0, 1e4), 2 * 3.0 * 1000),
        (JOINT, "kp", (0.0, 2e6), (4 * 0.2 + 2 * 1e-3 * 3.0) / 1e-6),
        (NETWORK, "K", (0.0, 400.0), 2 * 1.5 / 0.02),  # half a period late
    ],
    ids=["pd", "joint", "network"],
)
def test_limits_that_are_known_in_closed_form(prove, text, number, span, limit):
    """A drift that the number stops ends each at 0 with a frequency of 0."""
    proof = prove(read(text), number, span)
    ((low, high, low_omega, _),) = proof.intervals
    assert (low, low_omega) == (0.0, 0.0)
    assert close(high, limit)
    assert proof.bits <= 256


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_plants_of_several_blocks(prove, seed):
    """Bodies with springs between them, as products, multiplied out and as blocks, beside one state-space model."""
    found, expected = (prove(tables, "kp", (0.1, 2e4)).intervals for tables in bodies(seed)[:2])
    assert close(np.ravel(found), np.ravel(expected))


def test_direct_terms_within_a_plant(prove):
    ring = {"a": {"type": "tf", "num": [1, 5], "den": [1, 3]}, "b": {"type": "tf", "num": [1, 1], "den": [1, 2]}}
    wires = {"a.u": "-g*b.y + h.y", "b.u": "a.y", "h.u": "-k*b.y"}
    tables = {
        "rates": {"tick_hz": 10},
        "numbers": {"g": 0.5, "k": 1.0},
        "block": ring | {"h": {"type": "delay"}},
        "wire": wires,
    }
    ((low, high, *_),) = prove(tables, "k", (0.0, 100.0)).intervals
    (row,) = wavesweep.compile(tables).stable_intervals("k", (0.0, 100.0)).itertuples()
    assert row.certified
    assert close((low, high), (row.low, row.high))


def test_a_block_that_nothing_acts_on(prove):
    block = {"type": "ss", "discrete": True, "inputs": [], "outputs": ["y"], "A": [["p"]], "B": [], "C": [[1]], "D": []}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"p": 0.5}, "block": {"s": block}}
    assert [row[:2] for row in prove(tables, "p", (0.0, 2.0)).intervals] == [(0.0, 1.0)]


@pytest.mark.parametrize("n", [1, 3, 12])
def test_a_wall_behind_any_delay(prove, n):
    """With R = 4 sin^2(t/2)/cos(t/2), B T/m = R sin((n+1/2)t)/sin t and K T^2/m = R cos((n+1/2)t) - (B T/m)(1 - cos t)."""
    t, m, T = 0.3 / n, 0.1, 1e-3
    R = 4 * np.sin(t / 2) ** 2 / np.cos(t / 2)
    B = R * np.sin((n + 0.5) * t) / np.sin(t) * m / T
    K = (R * np.cos((n + 0.5) * t) - B * T / m * (1 - np.cos(t))) * m / T**2
    proof = prove(read(WALL), "K", (0.0, 1e5), {"B": float(B), "n": n})
    ((low, high, low_omega, high_omega),) = proof.intervals
    assert (low, low_omega) == (0.0, 0.0)
    assert close((high, high_omega), (K, t / T))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5])
def test_controllers_drawn_as_blocks_have_the_intervals_of_another_ball_program(prove, seed):
    values = random_values(seed, ("pmw", "pmw-lm", "dc-lm")[seed % 3])
    proof, B = prove(as_blocks(values), "K_VE", (0.0, 20000.0)), values["environment.B_VE"]
    runs = groupby(Witness(values).regions("K_VE", (0.0, 20000.0), B), key=lambda region: region.unstable == 0)
    expected = [[each[0].low, each[-1].high] for stable, run in runs if stable and (each := list(run))]
    assert [pytest.approx([float(end.mid()) for end in ends], rel=1e-12, abs=1e-12) for ends in expected] == [
        list(each[:2]) for each in proof.intervals
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "seed", "number"),
    [(random_tables, 0, "g"), (random_tables, 55, "m0"), (random_feedback, 8, "d")],
)  # fmt: skip
def test_doubles_that_are_certified_agree(prove, make, seed, number):
    """Along gains, which give polynomials, and along numbers of plants and filters, which are interpolated."""
    tables = make(seed)
    table = wavesweep.compile(tables).stable_intervals(number, SPANS[number])
    assert table.certified.all()
    rows = table[table.intervals > 0][["low", "high", "low_omega", "high_omega"]].to_numpy()
    assert close(np.array(prove(tables, number, SPANS[number]).intervals).ravel(), rows.ravel())


def test_two_loops_that_become_unstable_together(prove):
    """Both cross at k = 2 m1/T, which is 2 sin(pi/10) m2/T but for the rounding of m1."""
    limit = 2 * np.sin(np.pi / 10) * 0.2 * 1000
    ((_, high, _, _),) = prove(read(CORNER.format(m1=float(limit / 2000))), "k", (0.001, 1000.0)).intervals
    assert close(high, limit)


TURNED = {
    "rates": {"tick_hz": 1000.0},
    "numbers": {"p": 1.0},
    "block": {
        "g": {
            "type": "ss",
            "discrete": True,
            "A": [[-0.5, 2.25, 0.0], [0.0, 1.0, 0.0], [-2.9999999999999982, 4.499999999999999, 0.9999999999999991]],
            "B": [[0.5], [0.0], [1.0]],
            "C": [[3.125, -2.25, -0.75]],
            "D": [[0.0]],
        }
    },
    "wire": {"g.u": "-p*0.3*g.y"},
}
WEAK = {  # a spring that pushes away, with 1e-12 N/m between masses of a tonne
    "rates": {"tick_hz": 1.0},
    "numbers": {"p": 1.0},
    "block": {name: {"type": "mass", "mass": mass, "damping": 1e-6} for name, mass in (("a", 1000.0), ("b", 2000.0))},
    "wire": {
        "a.f": "-(1000.0*p*(a.x-b.x) + 1000.0*(a.v-b.v)) + 1e-12*a.x",
        "b.f": "1000.0*p*(a.x-b.x) + 1000.0*(a.v-b.v)",
    },
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tables", "span", "expected"),
    [(TURNED, (0.2, 0.4), [(0.2, 0.4, NAN, NAN)]), (WEAK, (0.1, 1.0), [])],
    ids=["turned", "weak"],
)
def test_loops_at_the_edge_are_proved(tables, span, expected):
    table = wavesweep.compile(tables).stable_intervals("p", span)
    assert table.certified.all()
    rows = table[table.intervals > 0][["low", "high", "low_omega", "high_omega"]].to_numpy()
    assert close(rows.ravel(), np.array(expected).ravel())


def test_modes_next_to_1(prove):
    """With sqrt(q + 2) in place of p the end is q = 25.0738317139, from 320 bits."""
    ((low, high, _, omega),) = prove(NEXT_TO_ONE, "p", (1.5, 36.0)).intervals
    assert (low, omega) == (1.5, 0.0)
    assert high**2 - 2 == pytest.approx(25.0738317139, rel=1e-11)


def test_a_mode_that_stays_on_the_circle_is_never_stable_or_in_doubt(prove):
    """An integrator that nothing reads back is drift; a double one is none. An oscillator without damping stays in doubt."""
    tables = read(PD) | {"wire": {"m.f": "-kp*m.x - kd*m.v", "i.u": "0*i.y"}}
    tables["block"] = tables["block"] | {"i": {"type": "integrator"}}
    span = (1.0, 100.0)
    assert prove(tables, "kp", span).intervals == ((*span, pytest.approx(NAN, nan_ok=True), pytest.approx(NAN, nan_ok=True)),)
    swinging = tables | {"block": tables["block"] | {"o": {"type": "mass", "mass": 1.0, "stiffness": 9.0}}}
    swinging["wire"] = swinging["wire"] | {"o.f": "0*m.x"}
    assert prove(swinging, "kp", span, precisions=(128, 256)) is None


def test_a_proof_that_takes_too_many_operations_is_none(prove):
    assert prove(read(ARM), "c", (-1.0, 20.0), operations=1e3) is None
    assert prove(read(ARM), "c", (-1.0, 20.0)).intervals


BETWEEN_TWO_BODIES = """
[rates]
tick_hz = 5
[block.dev]
type = "mass"
mass = "m"
stiffness = 44.0
[block.l]
type = "delay"
steps = 2
[block.pf]
type = "hold"
[wire]
"l.u" = "dev.v"
"pf.u" = "-0.5*l.y"
"dev.f" = "pf.y"
[numbers]
m = 0.57
"""


@pytest.mark.slow
def test_stretches_of_no_width_between_unstable_ones_need_no_proof():
    """Ends where the delayed damping meets the circle, by eigenvalues of a sampled oscillator with two ticks of delay."""
    found = wavesweep.compile(read(BETWEEN_TWO_BODIES)).stable_intervals(along="m", span=(0.0285, 5))
    assert found["certified"].all()
    ends = [(0.0380367, 0.0445813), (0.0571126, 0.0826611), (0.2207754, 0.4516109), (4.6148616, 5.0)]
    np.testing.assert_allclose(found[["low", "high"]], ends, atol=6e-8)
    radius = lambda m: radius_of(with_numbers(read(BETWEEN_TWO_BODIES), {"m": float(m)}), 0)  # noqa: E731
    for low, high in ends[:3]:
        assert radius(np.nextafter(low + 1e-6, 1)) < 1 < radius(low - 1e-6)
        assert radius(high - 1e-6) < 1 < radius(high + 1e-6)
