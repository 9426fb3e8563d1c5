"""The kernel's connections, losses and units against numpy, which is its reference."""

import numpy as np
import pytest
from support.nets import SINGULAR, first_order, random_net

from wavesweep import kernel
from wavesweep.diagram import draw
from wavesweep.diagram.block import Block, loss
from wavesweep.errors import IllPosedLoopError
from wavesweep.lifted.connect import connect
from wavesweep.lifted.frame import lifted_system
from wavesweep.lifted.periodic import Change
from wavesweep.lifted.plan import plan_of
from wavesweep.lifted.rounding import SWEEPS, balance, measured_frame

pytest.importorskip("numba")


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("batch", [(), (1,), (150,)])
@pytest.mark.parametrize("seed", range(12))
def test_the_kernel_connects_as_numpy_does(seed, batch, kind):
    """Real loops that need no inverse of several ports bit for bit; otherwise the last digits may differ."""
    net, found = random_net(seed, batch, kind), []
    for name in (kernel.NUMPY, kernel.NUMBA):
        with kernel.using(name):
            found.append(connect("net", *net, terms=True))
    torn = plan_of(*net, terms=True)[0].torn
    rounding = 0.0 if kind is float and torn <= 1 else 1e-13 * found[0].condition.max()
    parts = [(*(getattr(block, part) for part in "EBCD"), *block.terms) for block in found]
    for one, other in zip(*parts, strict=True):
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
        assert (np.abs(one - other) <= rounding * (1 + np.abs(one).max(initial=0))).all()
    for fact in ("condition", "pivot"):
        np.testing.assert_allclose(getattr(found[1], fact), getattr(found[0], fact), rtol=1e-9)


def test_a_loop_has_the_same_bits_in_any_batch_of_the_kernel():
    blocks, sums, inputs, outputs = random_net(3, (150,))
    with kernel.using(kernel.NUMBA):
        whole = connect("net", blocks, sums, inputs, outputs)
        few = [Block(b.name, b.inputs, b.outputs, b.states, *(getattr(b, part)[70:73] for part in "EBCD")) for b in blocks]
        own = {port: {s: g if np.ndim(g) == 0 else g[70:73] for s, g in terms.items()} for port, terms in sums.items()}
        part = connect("net", few, own, inputs, outputs)
    for name in "EBCD":
        assert np.array_equal(getattr(part, name), getattr(whole, name)[70:73])


def test_a_loop_without_a_solution_has_none_by_the_kernel_either():
    gain = np.array([1.0, 2.0, 3.0])
    with kernel.using(kernel.NUMBA), pytest.raises(IllPosedLoopError):
        connect("fast", (first_order("p", 0.9, 0.5),), {"p.u": {"r": 1, "p.y": gain}}, ("r",), ("p.y",))
    with kernel.using(kernel.NUMBA), pytest.raises(IllPosedLoopError, match="condition number"):
        lifted_system(draw(SINGULAR), 20, 500.0, 75.0)


@pytest.mark.parametrize("kind", [float, complex])
def test_the_kernel_finds_the_losses_that_numpy_finds(kind):
    from wavesweep.lifted.compiled.closing import losses

    random, shape = np.random.default_rng(5), (200, 4, 4)
    tick = random.normal(size=shape) + (1j * random.normal(size=shape) if kind is complex else 0.0)
    E = random.normal(size=shape) * 10.0 ** random.uniform(-6, 1, shape) + 0 * tick
    E[:20, 0, 0], E[20:40, 1, 2], E[40, 2, 2] = 0.0, 0.0, np.nan
    expected = loss(E, 20 * np.abs(tick))
    assert (expected > 1e3).sum() > 20
    np.testing.assert_allclose(losses(E, tick, 20), expected, rtol=1e-14)


@pytest.mark.parametrize("kind", [float, complex])
def test_the_kernel_balances_as_numpy_does(kind):
    """Units are powers of two: equal, but where a sum in another order is rounded to the other side of a half."""
    random = np.random.default_rng(11)
    E = random.normal(size=(300, 7, 7)) * 10.0 ** random.uniform(-5, 5, (300, 7, 1)) * (random.random((300, 7, 7)) < 0.6)
    E = E + 1j * E[::-1] if kind is complex else E
    E[0], E[1, 2, 3] = 0.0, np.nan
    expected = balance(E, SWEEPS)
    with kernel.using(kernel.NUMBA):
        found = balance(E, SWEEPS)
    same = (found[1] == expected[1]).all(-1)
    assert same.sum() >= 297
    assert np.array_equal(found[0][same], expected[0][same], equal_nan=True)


def test_the_kernel_sees_the_states_that_numpy_sees_forgotten():
    random = np.random.default_rng(12)
    E = random.normal(size=(50, 5, 5))
    E[:, 0], E[:30, :, 2], E[10, 3] = 0.0, 0.0, 0.0
    E[:, 0, 0], E[:30, 2, 2], E[10, 3, 3] = -1, -1, -1
    E[40, 4, 4] = -1  # in a row and a column with other entries
    expected = Change.of(E)
    with kernel.using(kernel.NUMBA):
        found = Change.of(E)
    for name in ("unread", "unset"):
        states, loops = zip(*getattr(expected, name), strict=True)
        assert tuple(state for state, _ in getattr(found, name)) == states
        assert all(np.array_equal(*pair) for pair in zip((each for _, each in getattr(found, name)), loops, strict=True))
    assert [state for state, _ in expected.unset] == [0, 3]


@pytest.mark.parametrize("links", [None, "open"])
def test_the_kernel_measures_frames_as_numpy_does(links):
    """Loops with inputs of which the last becomes a ramp: the moment of the response is that of a sum tick by tick."""
    random = np.random.default_rng(13)
    changes = [random.normal(scale=scale, size=(40, 4, 7 if links else 4)) for scale in (0.5, 0.1)]
    if links:
        for E in changes:
            E[..., 6] = 0.0
        links = np.abs(random.normal(size=(5, 5)))
    changes[0][7, 0, 0] = np.nan
    kind = np.array([0, 1, 1, 1, 1, 1])
    expected = measured_frame(kind, changes, links, ramp=links is not None)
    with kernel.using(kernel.NUMBA):
        found = measured_frame(kind, changes, links, ramp=links is not None)
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-15)
    assert np.isinf(expected[2][7])
    assert np.isfinite(np.delete(expected[2], 7)).all()
    if links is not None:
        x = np.zeros((40, 4))
        for tick, at in enumerate(kind):
            x = x + (changes[at][..., :4] @ x[..., None])[..., 0] + tick * changes[at][..., 5]
        np.testing.assert_allclose(np.delete(expected[0][..., 6], 7, 0), np.delete(x, 7, 0), rtol=1e-12)
