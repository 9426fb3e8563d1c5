"""Matrices in any order: published joint spectral radii, all short words, and what the check of a proof refuses."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest

from wavesweep.engine._switched.any_order import Verdict, bracket, decide, nearest_refuted
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.norm_check import Norms, shrink, shrink_along
from wavesweep.engine._switched.patterns import _of_walks, nearest
from wavesweep.engine._switched.remembered import Remembered

ONE = Graph.least(np.ones((1, 1), bool))
GOLDEN = (1 + 5**0.5) / 2
PAIR = np.array([[[1.0, 1.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0]]])


ROUNDING = 4 * np.finfo(float).eps  # of the terms of a sum of two products


@dataclass(frozen=True, slots=True, eq=False)
class Affine:
    """Matrices `constant + x slope`, as they stand; constant, slope: `(symbols, n, n)`; follows: see `Family`."""

    constant: np.ndarray
    slope: np.ndarray
    follows: np.ndarray

    @staticmethod
    def of(constant, slope=None, follows=None) -> "Affine":
        """Return the family; by default x changes nothing, and every matrix may come after every other one."""
        constant = np.asarray(constant, float)
        slope = np.zeros_like(constant) if slope is None else np.asarray(slope, float)
        return Affine(constant, slope, np.ones((len(constant),) * 2, bool) if follows is None else np.asarray(follows, bool))

    def at(self, x: float) -> np.ndarray:
        """See `Family`."""
        return self.constant + x * self.slope

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`."""
        eye = np.eye(self.constant.shape[-1])
        return self.at(x) - eye, ROUNDING * (np.abs(self.constant) + np.abs(x * self.slope) + eye)

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`."""
        return tuple(map(np.stack, zip(self.enclosed(low), self.enclosed(high), strict=True)))


def scaled(matrices):
    """The family of the matrices times a number: it decays up to 1 over their joint spectral radius."""
    matrices = np.array(matrices, float)
    return Affine.of(0 * matrices, matrices)


def largest_of_words(A, longest):
    """The largest spectral radius per matrix of all words up to a length."""
    found = 0.0
    for length in range(1, longest + 1):
        for word in product(range(len(A)), repeat=length):
            whole = np.linalg.multi_dot([*(A[i] for i in word), np.eye(A.shape[-1])])
            found = max(found, np.abs(np.linalg.eigvals(whole)).max() ** (1 / length))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("matrices", "radius"),
    [
        (PAIR, GOLDEN),
        # Ahmadi, Jungers, Parrilo and Roozbehani, SIAM J. Control Optim. 52 (2014)
        # Gripenberg, Linear Algebra Appl. 234 (1996); no word of fewer than 13 matrices grows so fast
        # Parrilo and Jadbabaie, Linear Algebra Appl. 428 (2008): one quadratic norm proves no less than the root of 2
        ([[[1, 0], [1, 0]], [[0, 1], [0, -1]]], 1.0),
    ],
)
def test_published_joint_spectral_radii(matrices, radius):
    found = bracket(scaled(matrices), 0.1, (0.0, 3.0), 1e-4)
    assert found.high < 1 / radius * (1 + 1e-7)
    assert found.above.x == pytest.approx(1 / radius, rel=1e-6)
    assert found.high > found.above.x * (1 - 1e-4)


def test_the_golden_pair_to_a_millionth():
    family = scaled(PAIR / GOLDEN)
    assert decide(family, 1 - 5e-7).verdict == Verdict.PROVED
    refuted = decide(family, 1 + 5e-7)
    assert (refuted.verdict, sorted(refuted.word)) == (Verdict.REFUTED, [0, 1])


def test_norms_are_of_all_states_though_the_search_leaves_out_what_all_matrices_forget():
    rng = np.random.default_rng(3)
    lost, (turned, _) = 30 * rng.normal(size=(2, 2, 2)), np.linalg.qr(rng.normal(size=(4, 4)))
    whole = np.concatenate([np.concatenate([PAIR, lost], 1), np.zeros((2, 4, 2))], 2)
    family = scaled(turned @ whole @ turned.T)
    assert Remembered.of(family, [0.3]).at(0.3).shape == (2, 2, 2)
    found = bracket(family, 0.1, (0.0, 3.0), 1e-3)
    assert found.above.x * (1 - 1e-3) < found.high < 1 / GOLDEN < found.above.x
    for stretch in found.stretches:
        ends = zip(stretch.norms, (stretch.low, stretch.high), strict=True)
        assert all(shrink(norms, *family.enclosed(x), family.follows) for norms, x in ends)


def test_a_proof_and_a_refutation_that_are_cheap_to_bring_together_are_nearer_than_was_asked():
    found = bracket(scaled(PAIR), 0.5, (0.5, 0.65), 0.01)
    assert found.above.x * (1 - 3e-4) < found.high < 1 / GOLDEN < found.above.x


def test_a_slow_oscillation_is_pumped_by_a_pattern_of_many_matrices():
    """A turn by 1/29.43, and one that decays and is wider by m along one axis: this one comes at the phases at which it grows.

    Of a circle of twice the phase, these are those with m cos(phase) > b, the decay; what they add is the integral over them.
    Half a period is 14.715 matrices, so that patterns of less than 103, which are 7 halves, fall out of step.
    """
    angle, m, b = 2 * np.pi / 29.43, 2e-3, 1e-3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    family = scaled([turn, np.exp(-b) * np.diag([1 + m, 1 - m]) @ turn])
    widest = np.arccos(b / m)
    limit = np.exp(-(m * np.sin(widest) - b * widest) / np.pi)
    refuted = decide(family, limit + 5e-6)
    assert (refuted.verdict, len(refuted.word)) == (Verdict.REFUTED, 103)
    assert decide(family, limit - 3e-5).verdict == Verdict.PROVED


def test_an_order_that_is_forbidden_may_be_what_grows():
    matrices, alternating = np.array([[[2.0]], [[0.4]]]), np.array([[False, True], [True, True]])
    assert decide(Affine.of(matrices)).verdict == Verdict.REFUTED
    assert decide(Affine.of(matrices, follows=alternating)).verdict == Verdict.PROVED
    others = ~np.eye(3, dtype=bool)
    graph = Graph.least(others)
    norms = Norms(np.broadcast_to(np.eye(2), (graph.nodes, 2, 2)), graph)
    found = _of_walks(np.random.default_rng(1).normal(size=(3, 2, 2)), others, norms)
    assert found
    assert all(one != other for word in found for one, other in pairwise((*word, word[0])))


@pytest.mark.slow
def test_stretches_of_a_proof_join_and_hold_between_their_ends():
    A, B = (np.random.default_rng(seed).normal(size=(2, 3, 3)) for seed in (7, 8))
    family = Affine.of(0.3 * A / np.abs(A).max(), B)
    told = []
    found = bracket(family, 0.0, (-5.0, 5.0), report=lambda *each: told.append(each))
    assert all(found.low <= low <= high <= found.high for low, high, _ in told)
    assert all(0 <= share <= 100 for *_, share in told)
    assert {low == 0.0 for low, *_ in told} == {True, False}  # up, then down
    ends = [(each.low, each.high) for each in found.stretches]
    assert (ends[0][0], ends[-1][1]) == (found.low, found.high)
    assert all(one[1] == other[0] for one, other in pairwise(ends))
    for stretch in found.stretches:
        for x in np.linspace(stretch.low, stretch.high, 5):
            share = (x - stretch.low) / (stretch.high - stretch.low)
            first, last = stretch.norms
            norms = Norms(first.P + share * (last.P - first.P), first.graph)
            assert shrink(norms, *family.enclosed(x), family.follows)
            assert largest_of_words(family.at(x), 3) < 1


def test_norms_that_hold_at_both_ends_of_a_stretch_and_not_between_them_prove_nothing():
    """A frame of 1 - 0.9 s between nodes with the forms 1 and 0.9 + 8 s: 1 - A^2 P is 0.1 and 0.9 at the ends, -0.8 at 0.3."""
    graph, follows = Graph(np.array([0, 1]), np.array([0, 1]), np.array([1, 0])), np.array([[False, True], [True, False]])
    norms = [Norms(np.array([[[1.0]], [[last]]]), graph) for last in (0.9, 8.9)]
    E = np.array([[[[0.0]], [[-1.0]]], [[[-0.9]], [[-1.0]]]])
    assert all(shrink(each, *point, follows) for each, point in zip(norms, zip(E, 0 * E, strict=True), strict=True))
    assert not shrink_along(norms, E, 0 * E, follows)
    assert shrink_along(norms[:1] * 2, E, 0 * E, follows)


def exact_minimum(P, Q, A):
    """The signs of the leading minors of P - A' Q A in exact numbers."""
    P, Q, A = ([[Fraction(float(entry)) for entry in row] for row in part] for part in (P, Q, A))
    n = len(A)
    F = [[P[i][j] - sum(A[k][i] * Q[k][m] * A[m][j] for k in range(n) for m in range(n)) for j in range(n)] for i in range(n)]
    for k in range(n):
        if F[k][k] <= 0:
            return False
        for i in range(k + 1, n):
            F[i] = [F[i][j] - F[i][k] / F[k][k] * F[k][j] for j in range(n)]
    return True


def test_what_is_checked_holds_in_exact_arithmetic_and_nothing_beside_it_passes():
    """Norms that are barely good enough pass or do not; those that pass are right in exact numbers."""
    passed = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 6))
        A, root = rng.normal(size=(n, n)), rng.normal(size=(n, n))
        units = 10.0 ** rng.uniform(-6, 6, n)
        P = units[:, None] * (root @ root.T + 1e-6 * np.eye(n)) * units
        P = (P + P.T) / 2
        A = A / units[:, None] * units
        # A times the largest factor with which it shrinks, but for a few roundings
        L = np.linalg.cholesky(P)
        A /= np.linalg.norm(np.linalg.solve(L, A.T @ L), 2) * (1 + 10.0 ** rng.uniform(-17, -8))
        holds = shrink(Norms(P[None], ONE), A[None] - np.eye(n), np.zeros((1, n, n)), np.ones((1, 1), bool))
        if holds:
            passed += 1
            assert exact_minimum(P, P, (A - np.eye(n)) + np.eye(n))
    assert passed > 20


def test_a_check_needs_every_sequence_small_errors_and_symmetric_forms():
    E, follows = np.array([[[-0.5]], [[-0.4]]]), np.ones((2, 2), bool)
    norms, exact = Norms(np.ones((1, 1, 1)), Graph.least(np.ones((2, 2), bool))), np.zeros((2, 1, 1))
    assert shrink(norms, E, exact, follows)
    assert not shrink(norms, E, exact + 0.6, follows)
    assert not shrink(Norms(norms.P, Graph(*(np.array([0]) for _ in range(3)))), E, exact, follows)
    one_way = Graph(np.array([0, 0]), np.array([0, 1]), np.array([0, 1]))  # nothing leaves the second node
    assert not shrink(Norms(np.ones((2, 1, 1)), one_way), E, exact, follows)
    assert not shrink(Norms(-norms.P, norms.graph), E, exact, follows)
    lopsided = np.array([[[1.0, 0.1], [0.0, 1.0]]])
    assert not shrink(Norms(lopsided, ONE), -np.eye(2)[None], np.zeros((1, 2, 2)), np.ones((1, 1), bool))


def test_matrices_that_grow_everywhere_are_refuted_at_the_start():
    found = nearest_refuted(Affine.of([[[1.5]], [[0.5]]]), 1.0, 2.0, 0.01)
    assert 0 in found.word
    assert found.x == pytest.approx(1.0, abs=1e-9)


def test_a_refutation_is_the_nearest_number_at_which_its_own_word_grows():
    """`(0.6 + x) (1.5 - x)` is 1 or more from 0.13 to 0.77, and again in size from 1.9 on."""
    family = Affine.of([[[0.6]], [[1.5]]], [[[1.0]], [[-1.0]]])
    assert nearest(family, (0, 1), 0.0, 4.5) == pytest.approx((0.9 - 0.41**0.5) / 2, rel=1e-7)
    assert nearest(family, (0, 1), 1.0, 4.5) == pytest.approx((0.9 + 8.41**0.5) / 2, rel=1e-7)
