"""Boxes of unknown numbers while frames vary: every proof is attacked by a program that shares no code with it."""

import tomllib
from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from meaning.attacked import contradictions, growth
from meaning.members import Frame
from support.frames import plan_of_controller
from support.specs import nested, values_of

import wavesweep
from wavesweep.engine._sets.enclosed_loop import Side
from wavesweep.engine._sets.taylor_models import Polynomials, monomials
from wavesweep.engine._switched import boxes
from wavesweep.engine._switched.boxes import cover
from wavesweep.engine._switched.frames_over import Enclosed
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.norm_check import shrink_over
from wavesweep.engine._switched.patterns import following, joined, written
from wavesweep.engine.switched import ALWAYS
from wavesweep.for_all.frame_families import FramesInAnyOrder, SlowFrames, plan_of
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

HAND = "operator.mass", "operator.damping", "operator.stiffness"


def polynomial(rng, numbers=2, order=3, n=3):
    terms = rng.normal(size=(len(monomials(numbers, order)[0]), n, n)) / 4
    return Polynomials(terms, np.abs(rng.normal(size=(n, n))) * 1e-3, numbers, order)


def at(poly, s):
    return np.tensordot((s**poly.exponents).prod(1), poly.terms, (0, 0))


def test_products_and_parts_of_polynomials_enclose_what_they_stand_for():
    rng = np.random.default_rng(1)
    one, other = polynomial(rng), polynomial(rng)
    both, middle, half = one @ other, np.array([0.3, -0.2]), np.array([0.5, 0.1])
    part = both.within(middle, half)
    basis = rng.normal(size=(3, 3))
    seen = one.similar(basis, np.linalg.inv(basis))
    for s in rng.uniform(-1, 1, (200, 2)):
        first, second = (at(each, s) + rng.choice([-1, 1], (3, 3)) * each.rest for each in (one, other))
        assert (np.abs(first @ second - at(both, s)) <= both.rest).all()
        inner = middle + half * s
        assert (np.abs(at(both, inner) - at(part, s)) <= part.rest - both.rest + 1e-15).all()
        assert (np.abs(np.linalg.solve(basis, at(one, s) @ basis) - at(seen, s)) <= seen.rest).all()


def scalar(*terms, rest=0.0):
    """A polynomial of one number and 1 by 1 matrices, at one node or for one symbol."""
    return Polynomials(np.array([*terms, *[0.0] * (4 - len(terms))]).reshape(4, 1, 1, 1), np.full((1, 1, 1), rest), 1, 3)


@pytest.mark.parametrize(
    ("matrix", "form", "holds"),
    [
        (scalar(0.9), scalar(1.0), True),
        (scalar(0.9, 0.09), scalar(1.0), True),
        (scalar(0.9, 0.11), scalar(1.0), False),  # 1.01 at one end of the box
        (scalar(0.9, 0, 0.11), scalar(1.0), False),
        (scalar(0.9, 0, 0, 0.11), scalar(1.0), False),
        (scalar(0.9, rest=0.11), scalar(1.0), False),
        (scalar(0.9), scalar(1.0, 0.9), True),
        (scalar(0.9), scalar(1.0, 1.1), False),  # negative at one end
        (scalar(1.1), scalar(-1.0), False),  # a form that is negative decreases along what grows
    ],
)
def test_what_is_proved_over_a_box_holds_at_its_ends(matrix, form, holds):
    follows = np.ones((1, 1), bool)
    assert shrink_over(form, Graph.least(follows), matrix, follows)[0] == holds


def test_numbers_that_jump_from_frame_to_frame_do_not_count_as_constant_ones():
    """A rotation by an angle, in a form that depends on a number: for each number by itself it shrinks, for two of them in turn
    it does not, so a form that is the same for all of them must fail."""
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    slope = np.diag([1.0, -1.0])
    follows = np.ones((1, 1), bool)
    # exp(-s D) R exp(s D) with D = diag(1, -1) is R exp(2 s D): to first order R + 2 s R D.
    exact = [np.linalg.matrix_power(slope, k) * 0.3**k / np.prod(range(1, k + 1)) for k in range(4)]
    A = Polynomials(0.9 * turn @ np.array(exact)[:, None], np.full((1, 2, 2), 0.01), 1, 3)
    forms = np.zeros((4, 1, 2, 2))
    forms[0], forms[1] = np.eye(2), 0.3 * slope
    nothing = np.zeros((1, 2, 2))
    assert shrink_over(Polynomials(forms, nothing, 1, 3), Graph.least(follows), A, follows)[0]
    forms[1] = 0
    assert not shrink_over(Polynomials(forms, nothing, 1, 3), Graph.least(follows), A, follows)[0]


@pytest.mark.parametrize("stop", [1.0, 0.15])
def test_a_box_is_divided_about_a_pole_of_an_algebraic_loop_that_no_node_shows(stop):
    """What it adds to the frame, 5e-10/((p - 0.3)^2 + 1e-9), is 1/2 at 0.3 and next to nothing at the nodes."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"p": 0.1, "n": 2},
        "block": {
            "s": {"type": "ss", "discrete": True, "inputs": ["u"], "outputs": ["y"], "A": [[0.9]], "B": [[1]], "C": [[1]]},
            "one": {"type": "gain", "k": 1.0},
            "h": {"type": "hold", "every": "n"},
        },
        "wire": {"one.u": "(1 - (p - 0.3)**2 - 1e-9)*one.y + s.y", "h.u": "s.y", "s.u": "-0.3*h.y + 5e-10*one.y"},
    }
    tables["block"]["s"]["D"] = [[0]]
    loop = load(tables)
    plan = plan_of(loop.drawing, loop.values, FramesInAnyOrder((2, 3)), SlowFrames.of(loop.drawing, loop.values))
    box = np.array([[0.0], [stop]])
    found = plan.over([Side("numbers.p")], box).over(box[None])[0]
    assert found == 0 if stop == 1 else found.matrices.rest.max() < 1e-6


def values_at(kind):
    values = values_of(kind) | {"controller.b": 10.0, "filters.lp1.order": 1, "filters.lp1.cutoff_hz": 8.57}
    return values | {"environment.integration": "explicit", "environment.B_VE": 1.0, "device.velocity": "difference"}


def frames_of(kind, box):
    """The frames of 18 and 22 ticks over a box of the logarithm of K_VE and the numbers of a hand."""
    values = values_at(kind)
    paths = ["environment.K_VE", *HAND]
    plan = plan_of_controller(values, FramesInAnyOrder((18, 22)), paths)
    return plan.over([Side(paths[0], 0.0), *map(Side, paths[1:])], box)


@dataclass
class Counted:
    """Single numbers that shrink in parts of an eighth of the second side alone; boxes: enclosed so far."""

    boxes: int = 0

    def over(self, boxes):
        self.boxes += len(boxes)
        terms = np.zeros((len(monomials(2, 2)[0]), 1, 1, 1))
        terms[0] = 0.3
        rests = [np.full((1, 1, 1), 4 * np.ptp(box[:, 1])) for box in boxes]
        known = [Polynomials(terms, rest, 2, 2) for rest in rests]
        return [Enclosed(*each, np.array([0.0, 1.0])) for each in zip(boxes, known, strict=True)]


def test_parts_are_divided_as_their_neighbours_had_to_be():
    """The first of eight stretches is divided by trials, of 1, 2, 4 and 8 parts; the others have 8 each."""
    frames = Counted()
    box = np.array([[0.0, 0.0], [1.0, 1.0]])
    found = cover(frames, box, ALWAYS, 1e12, stretches=8)
    assert not found.open
    assert frames.boxes == 15 + 7 * 8


class Growing(Counted):
    """The matrices x and 0.5 in any order, x the number itself."""

    def over(self, boxes):
        enclosed = []
        for low, high in boxes[:, :, 0]:
            terms = np.zeros((len(monomials(1, 2)[0]), 2, 1, 1))
            terms[0] = [[[(low + high) / 2]], [[0.5]]]
            terms[1, 0] = (high - low) / 2
            enclosed.append(
                Enclosed(np.array([[low], [high]]), Polynomials(terms, np.full((2, 1, 1), 1e-15), 1, 2), np.ones(1))
            )
        return enclosed


def test_nothing_is_proved_beyond_the_number_from_which_on_an_order_grows():
    """The middle of the range decays."""
    found = cover(Growing(), np.array([[0.0], [1.5]]), np.ones((2, 2), bool), 1e9)
    assert found.end < 1
    assert found.word == (0,)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pmw", "dc-slow"])
def test_frames_over_a_box_enclose_those_of_a_march_at_each_of_its_hands(kind):
    """Their eigenvalues are those of the march, at K_h = 0 too, where nothing holds the position."""
    box = np.array([[np.log(150.0), 0.0, 0.0, 0.0], [np.log(180.0), 0.05, 1.0, 50.0]])
    frames = frames_of(kind, box).over(box[None])[0].matrices
    tables = nested(values_at(kind)) | {"for_all": {"rates.ratio": {"values": [18, 22], "varying": True}}}
    for s in product((-1.0, 0.3, 1.0), repeat=4):
        place = box.mean(0) + (box[1] - box[0]) / 2 * s
        numbers = dict(zip(("K_VE", *HAND), [np.exp(place[0]), *place[1:]], strict=True))
        for own, ticks in zip(at(frames, np.array(s)), (18, 22), strict=True):
            expected = growth(tables, (Frame(ticks, 1),), **numbers)
            assert np.abs(np.linalg.eigvals(own)).max() == pytest.approx(expected, abs=1e-4)


def test_a_frame_that_may_not_follow_itself_need_not_shrink_alone():
    """As that of a message that may not be lost twice in a row: what it holds is kept."""
    A = np.array([[[0.5, 0.1], [0.0, 0.4]], [[1.0, 0.2], [0.0, 1.0 + 1e-12]]])
    frames = Polynomials(np.stack([A, 1e-3 * A, 0 * A, 0 * A]), np.zeros_like(A), 1, 3)
    follows = np.array([[True, True], [True, False]])
    found, _ = boxes._forms(frames, follows, None, 4e9)
    assert boxes._judged(frames, found, follows)[0]
    assert boxes._forms(frames, np.ones((2, 2), bool), None, 4e9)[0] is None


def test_words_of_lost_results_are_the_products_of_their_frames_in_every_order():
    values = {**values_of(kind="pmw", delay=1, velocity="difference", integration="explicit"), "controller.b": 10.0}
    plan = plan_of_controller(values, FramesInAnyOrder((20,), (1,), 3), ("environment.K_VE",))
    follows = plan.along("environment.K_VE").follows
    words = joined(follows)
    assert words == ((0,), (1, 0), (1, 2, 0), (1, 2, 3, 0))
    assert following(words, follows).all()
    assert written((2, 0, 0, 1, 2, 3, 0, 1), words) == (0, 3, 2)
    box = np.log([[100.0, 0.1], [101.0, 0.1]])
    frames = plan.over([Side("environment.K_VE", 0.0), Side("device.mass", 0.0)], box)
    of_words = frames.of_words(words).over(box[None])[0].matrices.terms[0]
    single = frames.over(box[None])[0].matrices.terms[0]
    for word, found in zip(words, of_words, strict=True):
        expected = np.linalg.multi_dot([*single[list(word[::-1])], np.eye(single.shape[-1])])
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)


TWO_CHANNELS = """
rates.tick_hz = 1000
numbers = { k = 5.0, m = 1.0 }
block.mass = { type = "inertia", inertia = "m", damping = 2.0 }
block.up = { type = "channel", lost = 2, every = 10 }
block.gain = { type = "gain", k = "k", every = 10 }
block.down = { type = "channel", lost = 2, every = 10 }
wire = { "up.u" = "mass.x", "gain.u" = "-up.y", "down.u" = "gain.y", "mass.f" = "down.y" }
for_all.m = { start = 0.9, stop = 1.1 }
sweep = { along = "k", k = { start = 0, stop = 200 } }
"""


@pytest.mark.slow
def test_a_mass_that_is_not_known_beside_two_channels_is_settled(tmp_path, caplog):
    """The pattern that refutes: the position is sampled every third time, and acts two times later, for three."""
    (tmp_path / "spec.toml").write_text(TWO_CHANNELS)
    caplog.set_level("INFO", "wavesweep.proof")
    table = intervals(load(tmp_path / "spec.toml"), jobs=1, along="k").columns
    row = {name: column[1] for name, column in table.items()}
    assert row["certified"]
    assert row["settled"]
    assert row["low"] < 0.3
    assert f" to {row['high']:.4g} on " in caplog.messages[-1]
    assert contradictions(tomllib.loads(TWO_CHANNELS)) == []


@pytest.mark.slow
def test_members_that_doubles_leave_in_doubt_are_settled_in_balls():
    """Deadbeat current control over a range of speeds: two axes that a speed turns into each other."""
    motor = {"type": "ss", "A": [["-R/L", "w"], ["-w", "-R/L"]], "B": [["1/L", 0], [0, "1/L"]], "C": [[1, 0], [0, 1]]}
    ends = {"inputs": ["ud", "uq"], "outputs": ["id", "iq"]}
    tables = {
        "rates": {"tick_hz": 10000},
        "numbers": {"L0": 8.5e-4, "L": 8.5e-4, "R": 0.2, "w": 0.0, "T": 1e-4},
        "block": {"motor": motor | ends, "ud": {"type": "delay", "steps": 1}, "uq": {"type": "delay", "steps": 1}},
        "signals": {
            "pd": "motor.id + T/L0*(ud.y - R*motor.id + w*L0*motor.iq)",
            "pq": "motor.iq + T/L0*(uq.y - R*motor.iq - w*L0*motor.id)",
        },
        "wire": {
            "ud.u": "L0/T*(0 - pd) + R*pd - w*L0*pq",
            "uq.u": "L0/T*(0 - pq) + R*pq + w*L0*pd",
            "motor.ud": "ud.y",
            "motor.uq": "uq.y",
        },
        "sweep": {"along": "L0", "L0": {"start": 1e-5, "stop": 4e-3}},
        "for_all": {"w": {"start": 0, "stop": 3000}},
    }
    rows = wavesweep.stability_region(tables)
    (row,) = rows[rows["guarantee"] == "for_all"].itertuples()
    assert (row.intervals, row.certified, row.settled) == (1, True, True)
    assert 1.59e-3 < row.high < row.fails_from < 1.6e-3
    for L0, stable in ((row.low, True), (row.high, True), (row.fails_from * 1.001, False)):
        radii = wavesweep.compile(tables | {"for_all": {}}).spectral_radius(L0=L0, w=[0.0, 1500.0, 3000.0])
        assert (radii.max() < 1) == stable
