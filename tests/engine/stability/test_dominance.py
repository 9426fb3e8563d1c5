"""What dominance proves about random families of matrices at the edge of the circle, against their eigenvalues."""

import numpy as np
import pytest

from wavesweep.engine._stability import along_any, covering
from wavesweep.engine._stability.along_any import stable_along_any
from wavesweep.engine._stability.dominance import DominanceTests
from wavesweep.engine._stability.entries import panels_of
from wavesweep.engine._stability.sampled_frames import ParametricFrames

SPAN = (-1.0, 1.0)
KINDS = "touches", "crosses", "meets", "wild"


def family(seed):
    """Matrices less identity with a pair of eigenvalues on a path that crosses the circle, touches it or nearly does, or with
    two pairs that meet and part beside it; and others, anywhere. All are in states that are mixed more or less well.
    """
    r = np.random.default_rng(seed)
    kind, n = r.choice(KINDS), int(r.integers(4, 9))
    least = r.choice([-1, 0, 1], p=[0.45, 0.1, 0.45]) * 10.0 ** r.uniform(-13, -1)  # of the path from the circle
    at, turn, speed = r.uniform(-0.9, 0.9), r.uniform(0, np.pi), r.choice([-1, 1]) * 10.0 ** r.uniform(-3, 0.5)
    gap = r.choice([-1, 1]) * 10.0 ** r.uniform(-6, 0)
    others = r.normal(size=(2, n, n)) / np.sqrt(n) * r.uniform(0.1, 1.0)
    mixed = np.linalg.qr(r.normal(size=(n, n)))[0] * 10.0 ** r.uniform(-2, 2, n)
    mixed = mixed if r.random() < 0.5 else np.eye(n) + r.uniform(0, 1) * mixed / np.abs(mixed).max()
    back, paths = np.linalg.inv(mixed), np.diag([1.0, 0.3])
    if kind == "meets":
        paths, around = np.array([[0, gap], [gap * r.choice([-1, 1]), 0]]), r.uniform(0.5, 2) * np.diag([1, -r.uniform(0.2, 1)])

    def matrices(_, p):
        p = np.ravel(p)[:, None, None]
        A = others[0] + others[1] * (np.sin(3 * p) if kind == "wild" else p)
        if kind != "wild":
            A[:, :4, 4:] = 0  # triangular, so the paths are those of eigenvalues
            if kind == "meets":
                P = (1 + least - abs(gap) * (gap * paths[1, 0] > 0)) * np.eye(2) + paths + around * (p - at)
            else:
                P = paths * (1 + least + speed * ((p - at) ** 2 if kind == "touches" else p - at))
            c, s = np.cos(turn + 0.1 * p), np.sin(turn + 0.1 * p)
            A[:, :4, :4] = np.block([[c * P, s * P], [-s * P, c * P]])
        return mixed @ A @ back - np.eye(n)

    return matrices


def late_family(seed):
    """The same with delay lines that take over what its states had, and that it reads after so many frames.

    Several lines of one state differ by what is forgotten, and a gain of nothing leaves all of a line at 0: these eigenvalues
    have one eigenvector together. Others are on rings inside the circle, or outside.
    """
    plain, r = family(seed), np.random.default_rng(seed + 10**6)
    k, lines = plain(0, 0.0).shape[-1], r.integers(2, 16, int(r.integers(1, 4)))
    n, ends = k + lines.sum(), k + np.cumsum(lines)
    late = np.zeros((2, n, n))
    into = r.normal(size=k)
    for last, line in zip(ends, lines, strict=True):
        first, gain = last - line, r.choice([0.0, 1e-6, 1e-2, 0.5])
        late[0, first, :k] = into if r.random() < 0.6 else r.normal(size=k)
        late[0, first, last - 1] = r.choice([0.0, 0.0, 0.5, 1.02])
        late[0, range(first + 1, last), range(first, last - 1)] = 1
        late[:, :k, last - 1] = gain * r.normal(size=(2, k)) * [[1], [0.3]]
        late[0, :k, first:last] += r.choice([0.0, 1.0]) * gain * r.normal(size=(k, line)) / line
    mixed = np.linalg.qr(r.normal(size=(n, n)))[0] if r.random() < 0.5 else np.eye(n)

    def matrices(_, p):
        A = late[0] + late[1] * np.ravel(p)[:, None, None]
        A[:, :k, :k] += plain(_, p) + np.eye(k)
        return mixed @ A @ mixed.T - np.eye(n)

    return matrices


def tiles_of(matrices, off):
    """What is proved of a family whose entries may be off by so much, or left open, part by part."""
    found = []

    def keep(*given, **more):
        found.append(covering.tiles_of(*given, **more))
        return found[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(along_any, "tiles_of", keep)
        errors = lambda _, p: (matrices(_, p), np.broadcast_to(np.abs(off), matrices(_, p).shape))  # noqa: E731
        stable_along_any(ParametricFrames(matrices, np.ones(1), errors=errors), SPAN)
    return found[0] if found else covering.Tiles.of(np.zeros(0, int), *np.zeros((2, 0)), 0)


def conditioned(A):
    """The eigenvalues, and to what each is known; what may be at 0 is not on the circle."""
    z, X = np.linalg.eig(A)
    w, Y = np.linalg.eig(A.swapaxes(1, 2))
    known = np.empty(z.shape)
    for one, other, x, y, off in zip(z, w, X, Y, known, strict=True):
        own = np.abs(one[:, None] - other).argmin(1)
        off[:] = 1e-13 / np.maximum(np.abs((y[:, own] * x).sum(0)), 1e-300)
    return z, np.where(np.abs(z) < 0.9, 0.05, known)


def look(seeds, many, make=family):
    """The number of places in proved parts, most of them beside an end, that were looked at, and of those that are wrong.

    The entries are off by what they are said to be off by at most."""
    looked = wrong = 0
    for seed in seeds:
        matrices, r = make(seed), np.random.default_rng(seed)
        n = matrices(0, 0.0).shape[-1]
        off = 10.0 ** r.uniform(-16, -3) * r.normal(size=(n, n))
        tiles = tiles_of(matrices, off)
        tile = np.repeat(np.flatnonzero(tiles.outside >= 0), many)
        share = np.where(r.random(tile.size) < 0.4, r.random(tile.size), 10.0 ** r.uniform(-9, 0, tile.size))
        share = np.where(r.random(tile.size) < 0.5, share, 1 - share)
        A = matrices(0, tiles.low[tile] + share * (tiles.high[tile] - tiles.low[tile]))
        z, known = conditioned(A + off + np.eye(n))
        sure = (np.abs(np.abs(z) - 1) > known).all(-1)
        count, proved = (np.abs(z) > 1).sum(-1), tiles.outside[tile]
        # Where a larger circle than the unit circle was taken, at least so many are outside.
        looked, wrong = looked + sure.sum(), wrong + (sure & ((count < proved) | ((proved == 0) & (count > 0)))).sum()
    return looked, wrong


def test_eigenvalues_are_where_they_are_proved_to_be():
    looked, wrong = look(range(4), 5)
    assert looked > 125
    assert wrong == 0


@pytest.mark.slow
def test_so_they_are_with_delay_lines():
    looked, wrong = look(range(2), 5, late_family)
    assert looked > 250
    assert wrong == 0


@pytest.mark.slow
@pytest.mark.parametrize("spoilt", [lambda h: np.inf + 0 * h, lambda h: -h])
def test_crossings_that_are_looked_for_in_the_wrong_place_are_never_missed(monkeypatch, spoilt):
    """Where a crossing is expected decides only what is tried: what is proved of the parts beside it holds without it."""
    crossings = DominanceTests.crossings
    monkeypatch.setattr(DominanceTests, "crossings", lambda self: spoilt(crossings(self)))
    looked, wrong = look(range(200, 203), 5)
    assert looked > 50
    assert wrong == 0


def polynomial(C, p):
    """The sum of C_k p^k."""
    return sum(c * np.asarray(p)[..., None, None] ** k for k, c in enumerate(C))


def panels_of_polynomial(C):
    """The panels of the matrices of `polynomial`."""

    def frames(_, p):
        return polynomial(C, p) - np.eye(C.shape[-1])

    def errors(column, p):
        E = frames(column, np.ravel(p))
        return E, 4e-16 * np.abs(E)

    return panels_of(frames, errors, SPAN, 1, np.array([[-np.inf], [np.inf]]))[0]


@pytest.mark.slow
def test_what_traces_prove_unstable_is():
    """Polynomials in the number whose largest eigenvalues are between 0.3 and 100."""
    r, looked = np.random.default_rng(5), 0
    for _ in range(60):
        n, terms = int(r.integers(1, 7)), int(r.integers(2, 9))
        C = r.normal(size=(terms, n, n)) * 10.0 ** r.uniform(-2, 2, (terms, 1, 1))
        largest = np.abs(np.linalg.eigvals(polynomial(C, np.linspace(-1, 1, 9)))).max()
        C *= 10.0 ** r.uniform(-0.5, 2) / largest
        panels = panels_of_polynomial(C)
        if panels is None:  # followed nowhere
            continue
        unstable, _ = covering._unstable_by_traces(panels)
        for low, high in zip(unstable.low, unstable.high, strict=True):
            looked += 20
            assert np.abs(np.linalg.eigvals(polynomial(C, np.linspace(low, high, 20)))).max(1).min() > 1
    assert looked > 500
