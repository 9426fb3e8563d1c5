"""Frames over cells of numbers: which side a cell is divided along."""

from dataclasses import replace

import numpy as np
import pytest

from wavesweep.engine._sets.taylor_models import monomials
from wavesweep.engine._switched import boxes
from wavesweep.engine.sets import Side, UnresolvedError
from wavesweep.engine.switched import ALWAYS, FramesOver, constant_frames
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

SPRING = {
    "rates": {"tick_hz": 100},
    "numbers": {"m": 0.2, "k": 100.0},
    "block": {"mass": {"type": "mass", "mass": "m", "damping": 4.0}, "h": {"type": "hold", "every": 2}},
    "wire": {"h.u": "mass.x", "mass.f": "-k*mass.x - 20*h.y"},
}
SIDES = [Side("numbers.m"), Side("numbers.k")]
BOX = np.array([[0.1, 50.0], [0.4, 200.0]])


def frames_of_spring(order=8):
    return constant_frames(own_loop(load(SPRING)), SIDES, BOX, order)


@pytest.mark.parametrize(
    ("number", "cell", "side"),
    [(-1, [[0.14, 55.0], [0.36, 195.0]], 0), (0, [[0.14, 55.0], [0.14, 195.0]], 1)],
    ids=["the mass, though the stiffness is 600 times as wide: a gain leaves nothing out", "the one that is wide"],
)
def test_a_frame_without_a_bound_is_divided_along_the_side_that_it_is_due_to(number, cell, side, monkeypatch):
    def no_bound(*_):
        raise UnresolvedError(np.ones(1, bool), number)

    monkeypatch.setattr(FramesOver, "_frames", no_bound)
    assert frames_of_spring().over(np.array([cell])) == [side]


def test_the_product_of_pieces_of_a_frame_is_the_frame():
    cell = np.array([[[0.2, 100.0], [0.2001, 100.1]]])
    loop = own_loop(load(SPRING | {"rates": {"tick_hz": 100}, "block": SPRING["block"] | {"h": {"type": "hold", "every": 5}}}))
    (whole,) = constant_frames(loop, SIDES, BOX, 4).over(cell)
    (pieces,) = constant_frames(loop, SIDES, BOX, 4, pieces=2).over(cell)
    product = np.eye(pieces.matrices.rest.shape[-1])
    for piece in pieces.matrices.terms[0]:
        product = piece @ product
    found, expected = (np.sort(np.abs(np.linalg.eigvals(A)))[::-1] for A in (product, whole.matrices.terms[0, 0]))
    assert found[: expected.size] == pytest.approx(expected, rel=1e-9)
    assert found[expected.size :] == pytest.approx(0, abs=1e-9)


def test_cells_that_are_enclosed_together_are_what_each_of_them_is_alone():
    """One of them has no bound."""
    frames, rng = frames_of_spring(), np.random.default_rng(4)
    middles = rng.uniform([0.15, 60.0], [0.35, 190.0], (5, 1, 2))
    half = np.array([0.02, 5.0])
    cells = np.concatenate([middles - half, middles + half], 1)
    cells[2] = [[-0.1, 50.0], [0.4, 200.0]]
    together = frames.over(cells)
    assert isinstance(together[2], int)
    for cell, found in zip(cells, together, strict=True):
        (alone,) = frames.over(cell[None])
        if isinstance(found, int):
            assert alone == found
            continue
        assert found.matrices.terms == pytest.approx(alone.matrices.terms, rel=1e-13, abs=1e-16)
        assert found.matrices.rest == pytest.approx(alone.matrices.rest, rel=1e-6)
        assert found.due == pytest.approx(alone.due, rel=1e-6)


def test_frames_in_units_that_turn_with_numbers_are_those_of_members_in_these_units():
    frames = frames_of_spring()
    cell = np.array([[0.14, 55.0], [0.2, 90.0]])
    units, about = np.array([[0.0, 9.0, -4.0], [0.01, 0.0, 0.02]]), np.array([0.2, 60.0])
    (found,) = replace(frames, units=units, about=about).over(cell[None])
    exponents = monomials(2, found.matrices.order)[0]
    for share in ([0.0, 0.0], [-1.0, 1.0], [1.0, 1.0], [0.4, -0.7]):
        member = cell.mean(0) + np.array(share) * np.ptp(cell, axis=0) / 2
        (alone,) = frames.over(np.array([[member, member]]))
        sizes = np.exp((member - about) @ units)
        exact = sizes[:, None] * alone.matrices.terms[0, 0] / sizes
        value = np.tensordot(np.prod(np.array(share) ** exponents, axis=1), found.matrices.terms[:, 0], 1)
        assert (np.abs(value - exact) <= found.matrices.rest[0] + 1e-11).all()
    assert found.matrices.rest.max() < 1e-4


def test_what_is_proved_and_what_is_open_is_the_whole_box():
    shares = []
    found = boxes.cover(frames_of_spring(2), BOX, ALWAYS, 1e12, report=lambda _, share: shares.append(share))
    assert not found.open
    assert len(shares) > 2
    assert shares == sorted(shares)
    assert 0 < shares[-1] < 1
    part = boxes.cover(frames_of_spring(2), BOX, ALWAYS, 1e8)
    assert part.open


def test_a_queue_that_drops_a_part_proves_nothing(monkeypatch):
    halves = boxes._halves
    dropped = []

    def all_but_one(box, side):
        lower, upper = halves(box, side)
        if len(dropped) == 3:
            upper[0] = upper[1] = lower[1]
        dropped.append(side)
        return [lower, upper]

    monkeypatch.setattr(boxes, "_halves", all_but_one)
    with pytest.raises(RuntimeError, match="neither proved nor open"):
        boxes.cover(frames_of_spring(2), BOX, ALWAYS, 1e12)


FILTERED = {
    "rates": {"tick_hz": "f"},
    "numbers": {"f": 100.0, "share": 0.1, "m": 0.2, "k": 20.0},
    "block": {
        "mass": {"type": "mass", "mass": "m", "damping": 4.0},
        "smooth": {"type": "butterworth", "order": 3, "cutoff_hz": "share*f"},
        "slope": {"type": "difference"},
    },
    "wire": {"smooth.u": "mass.x", "slope.u": "smooth.y", "mass.f": "-k*slope.y"},
}


@pytest.mark.parametrize(("number", "ends", "own_units"), [("share", (0.3, 0.4999), True), ("f", (90.0, 110.0), False)])
def test_states_of_a_filter_have_own_units_but_where_they_drift_with_others_by_a_fixed_factor(number, ends, own_units):
    """Nothing holds the mass, and the filter's states follow it by factors that depend on the filter's share of the rate alone.

    While f varies these are fixed: the drift takes the states out, and they have to keep their units. While the share varies
    they may be in units that depend on it. A trace does not depend on units: that of the enclosed frames is that of members.
    """
    loop = own_loop(load(FILTERED))
    box = np.array(ends)[:, None]
    frames = constant_frames(loop, [Side(f"numbers.{number}")], box)
    ((enclosed, _), *_) = frames.ticks
    assert ("smooth" in enclosed.own_units) == own_units
    (found,) = frames.over(box[None])
    trace = np.trace(found.matrices.terms, axis1=-2, axis2=-1)[:, 0]
    off = 1e-11 + np.trace(found.matrices.rest[0])
    for unit in (-1.0, -0.3, 0.5, 1.0):
        value = box.mean() + unit * np.ptp(box) / 2
        member = loop.changed({f"numbers.{number}": np.array([value])})
        # frames less identity, of five states without those of the drift
        exact = np.trace(np.eye(5) + member.frames(member.drift_of_frames())[0])
        assert np.polynomial.polynomial.polyval(unit, trace) == pytest.approx(exact, abs=off)
