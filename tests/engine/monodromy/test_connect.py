"""Connecting blocks: junctions, algebraic loops, and loops that have no solution."""

import mpmath
import numpy as np
import pytest
from support.responses import loop_of
from support.specs import values_of

from wavesweep.engine._loops.block import Block
from wavesweep.engine._monodromy.interconnect import connect
from wavesweep.engine.errors import IllPosedLoopError


def transfer(block, w):
    """`C (w - E)^-1 B + D` at one `w = z - 1`."""
    n = len(block.states)
    return block.C @ np.linalg.solve(w * np.eye(n) - block.E, block.B + 0j) + block.D


def first_order(name, pole, through):
    return Block(name, ("u",), ("y",), ("s",), E=[[pole - 1]], B=[[1.0]], C=[[0.5]], D=[[through]])


def random_net(seed, batch=(), kind=float):
    """Blocks with direct terms that feed each other at random, so that several loops of these are closed, and their sums."""
    random = np.random.default_rng(seed)
    sizes = [(int(n), int(m), int(p)) for n, m, p in random.integers((0, 1, 1), (4, 3, 4), (5, 3))]

    def entries(*shape):
        values = random.normal(size=(*batch, *shape)) + (1j * random.normal(size=(*batch, *shape)) if kind is complex else 0)
        return values * (random.random(shape) < 0.6)

    blocks = [
        Block(
            f"b{i}", tuple(f"u{k}" for k in range(m)), tuple(f"y{k}" for k in range(p)), tuple(f"s{k}" for k in range(n)),
            entries(n, n), entries(n, m), entries(p, n), 0.4 * entries(p, m),
        )
        for i, (n, m, p) in enumerate(sizes)
    ]  # fmt: skip
    sources = [f"b{i}.y{k}" for i, (_, _, p) in enumerate(sizes) for k in range(p)] + ["r", "q"]
    ports = [f"b{i}.u{k}" for i, (_, m, _) in enumerate(sizes) for k in range(m)]

    def gain():
        return random.normal(size=batch) if batch and random.random() < 0.5 else float(random.normal())

    sums = {port: {sources[i]: gain() for i in random.choice(len(sources), 3, replace=False)} for port in ports}
    sums["seen"] = {sources[i]: gain() for i in random.choice(len(sources), 3, replace=False)}
    return blocks, sums, ("r", "q"), ("seen", sources[0])


# Both branches reflect half of the wave, turned round: v_m = -v_m/2 - v_m/2 + ..., which has no solution.
SINGULAR = values_of(
    "pmw-lm", integration="explicit", B_VE=75.0, B_LM=75.0, lp1_order=0, hp_order=0, lp2_order=0,
    **{"local_model.integration": "explicit", "local_model.delay": 0},
)  # fmt: skip


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


def test_a_signal_that_nothing_makes_is_named():
    with pytest.raises(ValueError, match="nothing makes the signal 'ghost'"):
        connect("loop", (first_order("p", 0.9, 0.0),), {"p.u": {"ghost": 1}}, (), ("p.y",))


def test_a_loop_without_solution_is_refused_with_its_condition_and_a_cure():
    blocks = (first_order("p", 0.9, 0.5),)
    with pytest.raises(IllPosedLoopError, match=r"p\.u is ill-posed: condition number inf, expected below 1e\+12"):
        connect("fast", blocks, {"p.u": {"r": 1, "p.y": 2.0}}, ("r",), ("p.y",))


@pytest.mark.sample(10)
@pytest.mark.parametrize("seed", range(30))
def test_blocks_that_feed_each_other_at_once_do_what_their_equations_say(seed):
    """All equations of ports and outputs as one system, solved at once."""
    blocks, sums, inputs, outputs = random_net(seed)
    closed = connect("net", blocks, sums, inputs, outputs, terms=True)
    random = np.random.default_rng(seed)
    x, r = random.normal(size=len(closed.states)), dict(zip(inputs, random.normal(size=2), strict=True))
    names = [f"{b.name}.{port}" for b in blocks for port in (*b.inputs, *b.outputs)]
    at = {name: i for i, name in enumerate(names)}
    A, right, first = np.eye(len(names)), np.zeros(len(names)), 0
    for block in blocks:
        own = x[first : first + len(block.states)]
        first += len(block.states)
        for port in block.inputs:
            row = at[f"{block.name}.{port}"]
            for source, gain in sums[f"{block.name}.{port}"].items():
                if source in r:
                    right[row] += gain * r[source]
                else:
                    A[row, at[source]] -= gain
        for i, port in enumerate(block.outputs):
            row = at[f"{block.name}.{port}"]
            right[row] = block.C[i] @ own
            for k, source in enumerate(block.inputs):
                A[row, at[f"{block.name}.{source}"]] -= block.D[i, k]
    signals = dict(zip(names, np.linalg.solve(A, right), strict=True)) | r
    change, first = [], 0
    for block in blocks:
        own = x[first : first + len(block.states)]
        first += len(block.states)
        change.append(block.E @ own + block.B @ [signals[f"{block.name}.{port}"] for port in block.inputs])
    seen = [sum(gain * signals[source] for source, gain in sums["seen"].items()), signals[outputs[1]]]
    scale = np.linalg.cond(A)
    np.testing.assert_allclose(closed.E @ x + closed.B @ list(r.values()), np.concatenate(change), atol=1e-13 * scale)
    np.testing.assert_allclose(closed.C @ x + closed.D @ list(r.values()), seen, atol=1e-13 * scale)
    for part, terms in zip("EBCD", closed.terms, strict=True):
        assert (np.abs(getattr(closed, part)) <= terms * (1 + 1e-12) + 1e-300).all()
    assert 1 <= closed.condition < 1e6


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("seed", range(8))
def test_a_loop_of_a_batch_has_the_same_bits_alone(seed, kind):
    blocks, sums, inputs, outputs = random_net(seed, (37,), kind)
    whole = connect("net", blocks, sums, inputs, outputs, terms=True)
    for at in (slice(0, 1), slice(5, 8), slice(36, 37)):
        few = [Block(b.name, b.inputs, b.outputs, b.states, *(getattr(b, part)[at] for part in "EBCD")) for b in blocks]
        own = {port: {s: g if np.ndim(g) == 0 else g[at] for s, g in terms.items()} for port, terms in sums.items()}
        part = connect("net", few, own, inputs, outputs, terms=True)
        for name in "EBCD":
            assert np.array_equal(getattr(part, name), getattr(whole, name)[at])
        for one, all_ in zip(part.terms, whole.terms, strict=True):
            assert np.array_equal(one, all_[at])


def static(D, outputs="stuvw"):
    p, m = np.shape(D)[-2:]
    return Block("b", tuple("abcde"[:m]), tuple(outputs[:p]), (), np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)), D)


@pytest.mark.parametrize(("gain", "off"), [(1.0, 1e-14), (1e6, 1e-14), (1e9, 1e-13), (1e11, 1e-10)])
def test_small_entries_of_a_loop_keep_their_digits_beside_large_ones(gain, off):
    """Ports of three rows that feed each other, one gain large: the inverse of `I - D`, entry by entry, in 60 digits."""
    random, tried = np.random.default_rng(3), 0
    for _ in range(40):
        D = random.normal(size=(3, 3))
        D[tuple(random.integers(0, 3, 2))] *= gain
        with mpmath.workdps(60):
            exact = np.array((mpmath.matrix((np.eye(3) - D).tolist()) ** -1).tolist(), float)
        if (np.abs(exact) @ np.abs(np.eye(3) - D)).sum(1).max() > 1e4:
            continue
        tried += 1
        sums = {f"b.{port}": {f"b.{output}": 1.0, f"r{port}": 1.0} for port, output in zip("abc", "stu", strict=True)}
        found = connect("loop", (static(D),), sums, ("ra", "rb", "rc"), ("b.a", "b.b", "b.c")).D
        np.testing.assert_allclose(found, exact, rtol=off * 1e2, atol=0)
    assert tried > 20


def test_the_pivot_is_zero_where_a_loop_has_no_solution():
    """Two loops, `1 - g` and `1 + 3 g`, at complex g: their product is analytic."""
    g = np.array([0.3, 1.0 + 1e-9j, -1 / 3 + 0.2j])
    D = np.zeros((3, 2, 2), complex)
    D[:, 0, 0], D[:, 1, 1] = g, -3 * g
    sums = {"b.a": {"b.s": 1, "r": 1}, "b.b": {"b.t": 1}}
    assert connect("loop", (static(D),), sums, ("r",), ("b.s",)).pivot == pytest.approx((1 - g) * (1 + 3 * g), rel=1e-12)


def test_two_branches_that_answer_each_other_at_once_are_refused():
    """With F_s and F_l of three times the impedance each, u_m does not determine v_m."""
    with pytest.raises(IllPosedLoopError, match="no solution"):
        loop_of(SINGULAR | {"environment.K_VE": 500.0, "environment.B_VE": 75.0})
