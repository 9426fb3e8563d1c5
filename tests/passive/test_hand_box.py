"""That a box of hands is proved where it is stable, and never where a hand of it is not."""

import numpy as np
import pytest
from support.held import WALL, box_intervals, held, prove, worst_modes
from support.search import quick_search

from wavesweep.passive.enclosure import excluded, over_box, solved_left, stacked
from wavesweep.passive.hand import HOLDING_A_DEVICE, HandBox
from wavesweep.passive.hand_box import MARGIN
from wavesweep.passive.hand_frame import basis, frame_over, hand_loop

quick = pytest.fixture(quick_search)
NARROW = HandBox((0.05, 0.1), (3.0, 4.0), (300.0, 400.0))


def at(found, e):
    """The middle of the enclosure at the points `e` `(points, k)`, and how far the truth may be from it."""
    i, j = np.triu_indices(e.shape[1])
    turned = np.tensordot(e, found.slopes, 1) + np.tensordot(e[:, i] * e[:, j], found.curves, 1)
    return found.centre + turned, found.rest


def points_of(seed, count=200):
    e = np.random.default_rng(seed).uniform(-1, 1, (count, 2))
    e[: count // 4] = np.sign(e[: count // 4])
    return e


def test_products_and_quotients_are_within_their_enclosure():
    x, y = (p for p in over_box(np.array([1.0, 3.0]), np.array([1.5, 4.0])))
    rows = [[x * y, x + 2.0], [1.0 - y, x * x * y]]
    A = stacked(rows)
    found = (A @ A - A, solved_left(A, stacked([[y, x]])))
    e = points_of(1)
    for (p, q), *middles in zip(np.array([1.25, 3.5]) + e * [0.25, 0.5], *(at(part, e)[0] for part in found), strict=True):
        truth = np.array([[p * q, p + 2], [1 - q, p * p * q]])
        for part, middle, wanted in zip(found, middles, (truth @ truth - truth, [[q, p]] @ np.linalg.inv(truth)), strict=True):
            assert np.all(np.abs(middle - wanted) <= part.rest + 1e-12)


@pytest.mark.sample(8)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_the_frame_of_every_hand_and_wall_is_within_its_enclosure(random_values, seed):
    """Against the frames of the loops hand by hand, with springs and without."""
    v = random_values(seed)
    r = np.random.default_rng(seed)
    low = np.array([0.01, 0.5, 50.0 * (seed % 3 > 0), v["environment.K_VE"]])
    high = low * (1 + 0.1 * r.random(4))
    loop = hand_loop(held(v), WALL, HandBox(*zip(low[:3], high[:3], strict=True)))
    ends = loop.points(low), loop.points(high)
    low, high = np.minimum(*ends), np.maximum(*ends)
    e = r.uniform(-1, 1, (50, 4))
    points = (low + high) / 2 + e * (high - low) / 2
    hands, walls = loop.hands_and_numbers(np.concatenate([[(low + high) / 2], points]))
    A = loop.frames(hands, walls)
    (V,), (back,) = basis(A[:1])
    (found,) = [frame_over(loop, low[None], high[None])[0]]
    middle, rest = at(type(found)(*(part[0] for part in found.parts)), e)
    assert np.all(np.abs(back @ A[1:] @ V - middle) <= rest + 1e-11 * np.abs(middle).max())
    assert rest.max() < 0.1 * np.abs(found.slopes).max()


def test_no_matrix_of_an_excluded_enclosure_has_an_eigenvalue_outside():
    """And the two modes that turn by more than they are inside, as a stiff spring's do, are no obstacle."""
    r = np.random.default_rng(3)
    (p, q) = over_box(np.array([[0.0, 0.0]]), np.array([[0.02, 0.3]]))
    V = np.array([[1.0, 1.0], [1j, -1j]])
    decided = 0
    for size in np.linspace(0.9, 1.01, 23):
        grow = size * (1.0 + p)
        turn = 1.0 + -0.5 * (q * q)
        A = stacked([[grow * turn, -grow * q], [grow * q, grow * turn]]) + -np.eye(2)
        stable, _ = excluded(np.linalg.inv(V) @ A @ V)
        points = r.random((400, 2)) * [0.02, 0.3]
        points[0] = [0.02, 0.3]
        radius = [size * (1 + a) * np.hypot(1 - b * b / 2, b) for a, b in points]
        decided += bool(stable[0])
        assert not stable[0] or max(radius) < 1
    assert 8 <= decided <= 18


LATE = {"velocity": "difference", "delay": 3}


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("kind", "changes"), [("dc", LATE), ("dc-slow", {}), ("dc-lm", LATE), ("pmw", {}), ("pmw", LATE), ("pmw-lm", {})]
)
def test_a_box_is_proved_up_to_where_a_hand_of_it_is_unstable(values, kind, changes):
    """Just inside the intervals all of it; a little beyond, never, and the hand that is told is unstable there."""
    v = values(kind, **changes)
    found = box_intervals(v, (0.0, 20000.0), NARROW)
    assert found.settled
    assert found.low.size
    inner = MARGIN * (found.high[0] - found.low[0])
    assert prove(v, NARROW, (found.low[0] + inner, found.high[0] - inner)).holds
    if found.high[0] < 20000.0:
        beyond = found.high[0] * 1.01
        proof = prove(v, NARROW, (found.low[0] + inner, beyond))
        assert not proof.holds
        told = np.concatenate([proof.unstable, found.high_hand[:1]])
        assert worst_modes(v, told, beyond, v["environment.B_VE"])[0].max() > 1


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_springs_from_none_on_are_proved_where_they_hold_nothing_else(values):
    """With waves and no position feedback the box is taken in two, hands with a spring and hands without."""
    loose = HandBox((0.05, 0.1), (3.0, 4.0), (0.0, 400.0))
    for kind in ("dc-slow", "pmw"):
        assert box_intervals(values(kind), (0.0, 20000.0), loose).settled


def test_what_takes_too_long_is_not_said_to_be_proved(values):
    v = values("dc-slow")
    proof = prove(v, HOLDING_A_DEVICE, (1.0, 150.0), work=100)
    assert not proof.holds
    assert not len(proof.unstable)
    assert proof.work <= 100


def test_a_loop_that_overflows_within_a_frame_is_not_proved_and_no_warning(values):
    v = values("dc-lm", ratio=1000, K_LM=5e5, velocity="difference")
    assert not prove(v, NARROW, (1.0, 10.0)).holds
