"""Connecting blocks: junctions, algebraic loops, and loops that have no solution."""

import mpmath
import numpy as np
import pytest

from wavesweep.engine._loops.block import Block
from wavesweep.engine._monodromy.interconnect import connect
from wavesweep.engine.errors import IllPosedLoopError


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


def test_a_loop_without_solution_is_refused_with_its_condition_and_a_cure():
    blocks = (first_order("p", 0.9, 0.5),)
    with pytest.raises(IllPosedLoopError, match=r"p\.u is ill-posed: condition number inf, expected below 1e\+12"):
        connect("fast", blocks, {"p.u": {"r": 1, "p.y": 2.0}}, ("r",), ("p.y",))


@pytest.mark.parametrize("seed", range(8))
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
@pytest.mark.parametrize("seed", range(2))
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


@pytest.mark.parametrize(("gain", "off"), [(1.0, 1e-14), (1e9, 1e-13), (1e11, 1e-10)])
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
