"""Connecting blocks: junctions, algebraic loops, and loops that have no solution."""

import numpy as np
import pytest
from support.lifted import transfer
from support.specs import values_of

from wavesweep.analysis.response import prepare
from wavesweep.diagram import draw
from wavesweep.diagram.block import Block
from wavesweep.errors import IllPosedLoopError
from wavesweep.lifted import close, cut_at_wall
from wavesweep.lifted.connect import connect
from wavesweep.lifted.frame import lifted_system


def first_order(name, pole, through):
    return Block(name, ("u",), ("y",), ("s",), E=[[pole - 1]], B=[[1.0]], C=[[0.5]], D=[[through]])


def test_feedback_with_direct_terms_is_closed_exactly():
    """`G = P/(1 + k P Q)`, both P and Q with direct terms."""
    blocks = (first_order("p", 0.9, 0.3), first_order("q", -0.2, 2.0))
    sums = {"p.u": {"r": 1, "back": -1}, "back": {"q.y": 3.0}, "q.u": {"p.y": 1}}
    closed = connect("loop", blocks, sums, ("r",), ("p.y", "back"))
    w = -0.3 + 0.5j
    P, Q = (transfer(block, w)[0, 0] for block in blocks)
    loop = 3 * P * Q
    np.testing.assert_allclose(transfer(closed, w)[:, 0], [P / (1 + loop), loop / (1 + loop)], rtol=1e-14)
    assert closed.states == ("p.s", "q.s")


def test_an_external_signal_may_pass_straight_through():
    sums = {"p.u": {"r": 1}, "sum": {"r": 2, "p.y": 1}}
    closed = connect("wire", (first_order("p", 0.9, 0.0),), sums, ("r",), ("sum",))
    assert np.array_equal(closed.D, [[2.0]])


def test_a_signal_that_nothing_makes_is_named():
    with pytest.raises(ValueError, match="nothing makes the signal 'ghost'"):
        connect("loop", (first_order("p", 0.9, 0.0),), {"p.u": {"ghost": 1}}, (), ("p.y",))


def test_a_loop_without_solution_is_refused_with_its_condition_and_a_cure():
    blocks = (first_order("p", 0.9, 0.5),)
    with pytest.raises(IllPosedLoopError, match=r"p\.u is ill-posed: condition number inf, expected below 1e\+12"):
        connect("fast", blocks, {"p.u": {"r": 1, "p.y": 2.0}}, ("r",), ("p.y",))


def test_one_loop_without_solution_is_found_in_a_batch():
    gain = np.array([1.0, 2.0, 3.0])
    with pytest.raises(IllPosedLoopError):
        connect("fast", (first_order("p", 0.9, 0.5),), {"p.u": {"r": 1, "p.y": gain}}, ("r",), ("p.y",))


# Both branches reflect half of the wave, turned round: v_m = -v_m/2 - v_m/2 + ..., which has no solution.
SINGULAR = values_of(
    "pmw-lm", integration="explicit", B_VE=75.0, B_LM=75.0, lp1_order=0, hp_order=0, lp2_order=0,
    **{"local_model.integration": "explicit", "local_model.delay": 0},
)  # fmt: skip


def test_two_branches_that_answer_each_other_at_once_are_refused():
    """With F_s and F_l of three times the impedance each, u_m does not determine v_m."""
    with pytest.raises(IllPosedLoopError, match="condition number"):
        lifted_system(draw(SINGULAR), 20, 500.0, 75.0)
    with pytest.raises(IllPosedLoopError, match="condition number"):
        prepare(draw(SINGULAR), 500.0, 75.0)


def test_the_same_branches_are_fine_a_little_further():
    cut = cut_at_wall(draw(SINGULAR))
    whole = lifted_system(draw(SINGULAR), 20, 500.0, 76.0)
    assert np.isfinite(close(cut, 500.0, 76.0)).all()
    assert np.isfinite(whole.E).all()
