"""The laws of lifting, on random blocks."""

import numpy as np
import pytest
from support.lifted import poles, same_spectrum, transfer

from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.frame import lifted_system
from wavesweep.lifted.lift import growth, lift_held


def random_block(seed, name, n=3, m=1, p=1):
    r = np.random.default_rng(seed)
    E = 0.4 * r.standard_normal((n, n)) / np.sqrt(n) - 0.3 * np.eye(n)
    parts = (r.standard_normal(shape) for shape in ((n, m), (p, n), (p, m)))
    inputs, outputs = tuple(f"u{i}" for i in range(m)), tuple(f"y{i}" for i in range(p))
    return Block(name, inputs, outputs, tuple(f"s{i}" for i in range(n)), E, *parts)


def lifted(blocks, ratio):
    """The chain of single-input blocks as one lifted system, a frame of inputs in and a frame of outputs out."""
    sums, source = {}, "f_h"
    for block in blocks:
        sums[f"{block.name}.u0"] = {source: 1}
        source = f"{block.name}.y0"
    drawing = Diagram(blocks, (), sums, {}, {}, ("none", "none"), ratio, 0, 1.0)
    return lifted_system(drawing, ratio, 0.0, 0.0, output=source)


def by_hand(block, ratio):
    """The lifted system from its textbook form: powers, and a block Toeplitz matrix."""
    A, n = np.eye(len(block.states)) + block.E, len(block.states)
    powers = [np.linalg.matrix_power(A, i) for i in range(ratio + 1)]
    D = np.zeros((ratio, ratio))
    for i in range(ratio):
        D[i, i] = block.D[0, 0]
        for j in range(i):
            D[i, j] = (block.C @ powers[i - 1 - j] @ block.B)[0, 0]
    B = np.hstack([powers[ratio - 1 - j] @ block.B for j in range(ratio)])
    C = np.vstack([block.C @ powers[i] for i in range(ratio)])
    return powers[ratio] - np.eye(n), B, C, D


@pytest.mark.parametrize("seed", range(4))
def test_lifting_by_one_changes_nothing(seed):
    """`lift(P, 1) = P`, to the bit, for both ways of lifting."""
    block = random_block(seed, "p")
    for found in (lifted((block,), 1), lift_held(block, 1, 0, ("u0",), ("y0",))):
        assert all(np.array_equal(getattr(found, part), getattr(block, part)) for part in "EBCD")


@pytest.mark.parametrize("ratio", [2, 3, 7, 20])
def test_poles_are_raised_to_the_ratio(ratio):
    block = random_block(5, "p", n=4)
    for found in (lifted((block,), ratio), lift_held(block, ratio, 0, ("u0",), ("y0",))):
        assert same_spectrum(poles(found), poles(block) ** ratio, 1e-13)


@pytest.mark.parametrize("ratio", [1, 2, 5, 20])
def test_a_lifted_block_is_the_toeplitz_matrix_of_its_markov_parameters(ratio):
    block = random_block(6, "p")
    found = lifted((block,), ratio)
    for part, wanted in zip("EBCD", by_hand(block, ratio), strict=True):
        np.testing.assert_allclose(getattr(found, part), wanted, atol=1e-13)


@pytest.mark.parametrize("ratio", [1, 2, 5, 20])
@pytest.mark.parametrize("seed", range(3))
def test_lifting_commutes_with_series_connection(seed, ratio):
    """`lift(P2 P1) = lift(P2) lift(P1)`, as transfer matrices at a point off the circle."""
    first, second = random_block(seed, "p"), random_block(seed + 50, "q", n=2)
    w = 0.3 + 0.9j
    apart = transfer(lifted((second,), ratio), w) @ transfer(lifted((first,), ratio), w)
    np.testing.assert_allclose(transfer(lifted((first, second), ratio), w), apart, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize(("ratio", "delay"), [(1, 0), (1, 1), (2, 1), (5, 0), (5, 1), (5, 3), (5, 5), (20, 7)])
def test_held_inputs_change_at_their_phase_of_the_frame(ratio, delay):
    """A frame of `lift_held` is `ratio` ticks of the block, the old input before the delay and the new one after."""
    block, r = random_block(7, "p", m=2, p=2), np.random.default_rng(8)
    frame = lift_held(block, ratio, delay, ("u0", "u1"), ("y0", "y1"))
    state, old, new = r.standard_normal(3), r.standard_normal(2), r.standard_normal(2)
    values = {f"u{i}.old": old[i] for i in range(2)} | {f"u{i}.new": new[i] for i in range(2)}
    given = np.array([values[name] for name in frame.inputs])
    after = state
    for i in range(ratio):
        u = old if i < delay else new
        if i == 0:
            np.testing.assert_allclose(frame.C @ state + frame.D @ given, block.C @ after + block.D @ u, atol=1e-13)
        after = after + block.E @ after + block.B @ u
    np.testing.assert_allclose(state + frame.E @ state + frame.B @ given, after, atol=1e-13)


@pytest.mark.parametrize("ticks", [0, 1, 2, 3, 13, 200])
def test_slow_poles_keep_their_distance_from_one(ticks):
    """`(1 + e)^n - 1` for e = 1e-13, which a power of 1 + e would round to three digits."""
    E = np.array([[1e-13]])
    assert (E @ growth(E, ticks))[0, 0] == pytest.approx(np.expm1(ticks * np.log1p(1e-13)), rel=1e-14, abs=0)


def test_a_tick_that_explodes_gives_infinities_in_silence():
    """Powers of a locally unstable loop overflow: the analyses call that unstable, so no warning and no error."""
    block = Block("p", ("u0",), ("y0",), ("s",), E=[[1e9]], B=[[1.0]], C=[[1.0]], D=[[0.0]])
    assert not np.isfinite(lift_held(block, 200, 3, ("u0",), ("y0",)).E).all()
