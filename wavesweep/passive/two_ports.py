"""Absolute stability of loops with two ports: stable with every pair of passive terminations, one
at each port.

H is the lifted map from the forces f at both ports, held over each tick of a frame, to the
displacements y in the ticks. At an angle of the frame each port has one component for each of its M
ticks, at the frequencies that alias to the same: the basis F. A linear termination that does not
change in time acts on each component alone, by a number with a positive real part. So the loop is
absolutely stable if it is stable and at each angle there are positive weights R, one per component,
with

    He(R Z R^-1) > 0,   Z = (F* H F)^-1.

Conversely, if some displacements have a negative power in all components, passive terminations
destabilise the loop; these are found at the best weights. If a frame has one tick, this is
Llewellyn's criterion, `2 Re z11 Re z22 > |z12 z21| + Re(z12 z21)`. Source: F. B. Llewellyn, Some
fundamental properties of transmission systems, Proc. IRE 40(3), 271-283, 1952; with scattering
matrices and structured singular values J. E. Colgate, IEEE Transactions on Robotics and Automation
9(4), 365-374, 1993.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine.blocks import OUTPUT, POSITION, Ports
from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.drawing import ENVIRONMENT
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import inverse, on_circle, solve
from wavesweep.engine.intervals import FunctionValues
from wavesweep.engine.norms import LiftedMap, TickMaps
from wavesweep.engine.poles import eigenvalues, is_stable
from wavesweep.engine.response import Port
from wavesweep.haptics.held_loop import HeldLoop
from wavesweep.passive.over_ranges import (
    ENTRY_ROUNDINGS,
    Covering,
    away_from_0,
    inner_numbers,
    pivots_of,
    remembered,
    with_sizes,
)

OTHER = OUTPUT + ENVIRONMENT[1]  # the junction of the displacement at the port of the environment
LONGEST_TWO_PORT_FRAME = 100  # ticks of a frame
STEPS, SETTLED = 40, 1e-9  # of balancing, and changes of the logarithms of weights that end it
ANGLES = (0.0, 0.03, 0.3, 1.0, 2.0, np.pi)  # rad per frame: ends of the first boxes of a proof
NEAR_REST = 1e-4  # rad per frame: in place of 0, where forces that move nothing leave no impedance
TRIED = np.concatenate(
    [np.geomspace(NEAR_REST, 0.03, 8), np.linspace(0.06, np.pi, 40)]
)  # rad per frame
ZOOMS, POINTS = 7, 9  # to a worst angle between those
BOXES, MOST = 1000, 400  # of a proof, and values of the number and the angle in each
NARROWEST_PORT_PART = 4e-5  # of an interval: narrower parts that are not proved stay open


@dataclass(frozen=True, slots=True, eq=False)
class PairMap:
    """Loops with two ports over a frame.

    h: what constant forces do at rest, the displacements or, if these are 0, the positions,
    `(loops, 2, 2)`. zeros: how many pairs of forces move nothing at rest. There He(R H R^-1) has so
    many double zeros if the weights have the `ratio`.
    """

    lifted: LiftedMap
    h: np.ndarray
    zeros: int
    pivots: np.ndarray

    @property
    def still(self) -> np.ndarray:
        """The forces that move nothing at rest, orthonormal and constant over a frame, `(loops,
        2 M, zeros)`."""
        M, turned = (
            self.lifted.T.shape[-1] // 2,
            np.stack([self.h[:, 0, 1], -self.h[:, 0, 0]], -1)[:, :, None],
        )
        if self.zeros == 1:
            pair = turned / np.sqrt((turned**2).sum(1, keepdims=True))
        else:
            pair = np.broadcast_to(np.eye(2), self.h.shape)
        return np.tile(pair[:, :, : self.zeros], (1, M, 1)) * M**-0.5

    def apart(self) -> LiftedMap:
        """The map from forces that are multiplied by `1/(1/z - 1)` in the direction of those
        that move nothing at rest."""
        (E, T, O, G), e = ((lifted := self.lifted).E, lifted.T, lifted.O, lifted.G), self.still
        across, r = e.mT, -solve(E, G @ e)
        P = np.eye(T.shape[-1]) - e @ across
        return LiftedMap(E, T @ P + O @ r @ across, O, G @ P + (r + E @ r) @ across)

    @property
    def ratio(self) -> np.ndarray:
        """R1^2/R2^2 of the components at rest, NaN where any will do."""
        if self.zeros:
            return self.h[:, 1, 0] / self.h[:, 0, 1]
        return np.full(len(self.h), np.nan)


Pairs = Callable[[np.ndarray], PairMap]
"""From values of a number `(n,)`, real or complex, to the loops."""


def pairs_of(loop: HeldLoop, path: str, span: tuple[float, float], damping: float = 0.0) -> Pairs:
    """From values of a number to the loops, with damping (N*s/m) taken away at both ports:
    `f + damping y/T` in place of f, y the displacement in a tick."""
    drift = loop.changed({path: inner_numbers(span)}).drift(watched=(POSITION, OTHER))
    ports = Ports(loop.drawing.hand[0], POSITION, others=((loop.drawing.environment[0], OTHER),))

    if (ticks := loop.drawn().ticks) > LONGEST_TWO_PORT_FRAME:
        raise UsageError(
            f"expected a frame of at most {LONGEST_TWO_PORT_FRAME} ticks for two ports, found {ticks}"
        )

    def maps(p):
        at = loop.changed({path: away_from_0(p, span)})
        drawn, tick_maps = at.drawn(), []
        with np.errstate(all="ignore"):
            port = Port.of(drawn, ports, drift)
            for E, B, C, D in port.maps:
                # y = C x + D g of g = f + damping y/T, so g = f + back (C x + D f)
                back = inverse(np.ravel(drawn.period)[0] * np.eye(2) - damping * D) * damping
                tick_maps.append(
                    (E + B @ back @ C, B + B @ back @ D, C + D @ back @ C, D + D @ back @ D)
                )
            lifted = TickMaps.of(tick_maps, port.kind, p.shape).lifted(measured=False)
            constant = np.tile(np.eye(2), port.kind.size).T  # a force at each port in all ticks
            at_rest = -solve(lifted.E, lifted.G @ constant)  # 0 = E x + G f
            if port.drifts:
                h = constant.T @ (lifted.T @ constant + lifted.O @ at_rest)
            else:
                h = port.position @ at_rest
        return PairMap(lifted, h, 2 - port.drifts, pivots_of(at, path, port.pivot, p.shape))

    return remembered(maps)


def basis(theta: np.ndarray, M: int, sign: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """F at `sign` times the angles, real or complex, and its inverse, `(points, 2 M, 2 M)` both;
    the conjugate for -1."""
    F = np.kron(np.exp(sign * 2j * np.pi / M * np.outer(range(M), range(M))) / M**0.5, np.eye(2))
    turn = np.exp(sign * 1j / M * theta[:, None] * np.arange(M)).repeat(2, axis=1)
    return turn[:, :, None] * F, F.conj().T / turn[:, None, :]


def components_with_sizes(
    lifted: LiftedMap, theta: np.ndarray, sign: int
) -> tuple[np.ndarray, np.ndarray]:
    """`F^-1 H F` at `sign` times the angles, see `basis`, and the sizes of the terms of its
    entries."""
    H, size = with_sizes(lifted, sign * theta)
    M = H.shape[-1] // 2
    F, back = basis(theta, M, sign)
    across = (
        np.abs(back).max((-1, -2))[:, None, None] * size * np.abs(F).max((-1, -2))[:, None, None]
    )
    return back @ H @ F, np.tile(across.reshape(-1, M, 2, M, 2).sum((1, 3)), (1, M, M))


@dataclass(frozen=True, slots=True, eq=False)
class WorstWeights:
    """At some points: the damping (N per m in a tick) that can be taken away at both ports,
    `(points,)`, the logarithms of the weights with which it can, and the components of
    displacements that bear no more, `(points, 2 M)` both."""

    shunt: np.ndarray
    log_w: np.ndarray
    y: np.ndarray


def worst(Z: np.ndarray, log_w: np.ndarray | None = None) -> WorstWeights:
    """The least eigenvalues of `He(R Z R^-1)` at the best weights, or given ones.

    Weights that balance the rows and columns of Z are the best ones if the ports act on each other
    in one way only, as those of single rates and of links do, and good ones otherwise (E. E.
    Osborne, Journal of the ACM 7(4), 338-345, 1960).
    """
    if log_w is None:
        log_w = np.zeros(Z.shape[:2])
        sizes = np.abs(Z) ** 2
        sizes[:, range(Z.shape[-1]), range(Z.shape[-1])] = NEXT_TO_ZERO
        for _ in range(STEPS):
            square = np.exp(2 * log_w)
            of_columns = (square[:, None] @ sizes)[:, 0]
            of_rows = (sizes @ (1 / square)[:, :, None])[..., 0]
            step = np.log(of_columns / of_rows) / 8 - log_w / 2
            log_w += step
            if np.abs(step).max(initial=0.0) < SETTLED:
                break
    R = np.exp(log_w)
    S = R[:, :, None] * Z / R[:, None, :]
    values, vectors = np.linalg.eigh((S + S.conj().mT) / 2)
    return WorstWeights(values[:, 0], log_w, vectors[:, :, 0] / R)


def least_shunt(pairs: Pairs, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least shunt over all angles (N per m in a tick), -inf of unstable loops, and its angle
    (rad per frame)."""
    lifted = pairs(p).lifted
    shunts, theta = np.full((2, len(p)), -np.inf)
    stable = np.isfinite(lifted.E).all((-1, -2)) & np.isfinite(lifted.T).all((-1, -2))
    stable[stable] = is_stable(lifted.E[stable])
    at = np.flatnonzero(stable)
    angle = np.clip(np.abs(np.angle(1 + eigenvalues(lifted.E[at])[0])), NEAR_REST, np.pi)
    angles = np.sort(
        np.concatenate([np.broadcast_to(TRIED, (at.size, TRIED.size)), angle], axis=-1)
    )
    for _ in range(1 + ZOOMS if at.size else 0):
        Z = impedances(lifted, np.repeat(at, angles.shape[1]), angles.ravel())
        shunt = worst(Z).shunt.reshape(angles.shape)
        best = shunt.argmin(-1)[:, None]
        shunts[at], theta[at] = (
            np.take_along_axis(array, best, -1)[:, 0] for array in (shunt, angles)
        )
        below, above = (
            np.take_along_axis(angles, np.clip(best + step, 0, angles.shape[1] - 1), -1)
            for step in (-1, 1)
        )
        angles = below + (above - below) * np.linspace(0, 1, POINTS)
    return shunts, theta


def impedances(lifted: LiftedMap, owner: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Z of the loops `owner` at angles, `(points, 2 M, 2 M)`, in N per m in a tick."""
    F, back = basis(theta, lifted.T.shape[-1] // 2)
    return inverse(back @ lifted.response(owner, theta) @ F)


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Loops with two ports along a number, of which absolute stability is asked; see
    `passive_ranges` for what asks."""

    pairs: Pairs

    def passive(self, p: np.ndarray) -> np.ndarray:
        """Whether loops at values of the number are absolutely stable, `(n,)`."""
        return least_shunt(self.pairs, p)[0] > 0

    def deciding(self, p: float) -> tuple[float, float]:
        """The least shunt (N per m in a tick), and its angle (rad per frame)."""
        (shunt,), (theta,) = least_shunt(self.pairs, np.array([p]))
        return float(shunt), 0.0 if theta == NEAR_REST else float(theta)

    def witness(self, low: float, high: float) -> "PairWitness":
        """What takes energy in all components between two values, about as the worst forces do
        at these and in the middle."""
        p = np.array([low, (low + high) / 2, high])
        lifted, theta = (
            (at := self.pairs(p)).lifted,
            np.append(TRIED, least_shunt(self.pairs, p[1:2])[1]),
        )
        worst_weights = worst(impedances(lifted, np.ones(theta.size, int), theta))
        share = (np.abs(worst_weights.y * np.exp(worst_weights.log_w)) ** 2).min(
            -1
        )  # of a component in the power, which may drown in rounding
        theta = theta[np.argmin(worst_weights.shunt * share)]
        Z = impedances(lifted, np.arange(3), np.full(3, theta))
        y = worst(Z).y[:, :, None]
        y /= np.take_along_axis(y, np.abs(y[1:2]).argmax(1, keepdims=True), 1)
        e, force = at.still, basis(np.full(3, theta), Z.shape[-1] // 2)[0] @ Z @ y
        force += e @ (e.mT @ force) * (on_circle(-theta) - 1)
        slopes = np.stack(
            [force[1], (force[2] - force[0]) / 2, (force[0] + force[2]) / 2 - force[1]]
        )[..., 0]
        return PairWitness(self.pairs, np.array([theta]), p, slopes)

    def open_in(self, low: float, high: float, cover: Covering) -> list[np.ndarray] | float | None:
        """The parts of an interval that are not proved, a value at which the opposite is so, or
        None without a proof.

        The interval times the circle is divided into boxes, each with its own weights.
        """
        queue = [(low, high, *pair) for pair in pairwise(ANGLES)]
        open_ = []
        if not is_stable(self.pairs(np.array([(low + high) / 2])).lifted.E).all():
            return None
        for _ in range(BOXES):
            if not queue:
                return open_
            first, last, below, above = box = queue.pop()
            p = (first + last) / 2
            theta = (below + above) / 2
            shunts, functions = self._weighted(box)
            if functions is None:
                return p
            if shunts.min() > 0 and functions.positive(p, theta) and functions.covered(box, cover):
                continue
            drops = shunts[1, 1] - shunts[[0, 2], 1].min(), shunts[1, 1] - shunts[1, [0, 2]].min()
            if drops[0] > drops[1] and last - first > NARROWEST_PORT_PART * (high - low):
                queue += [(first, p, below, above), (p, last, below, above)]
            elif drops[0] <= drops[1] and above - below > NEAR_REST:
                queue += [(first, last, below, theta), (first, last, theta, above)]
            else:
                open_.append(np.array([first, last]))
        return None

    def _weighted(self, box):
        """The shunts that the weights of a box allow at nine points of it, and its function;
        None where no weights do."""
        p, theta = np.linspace(*box[:2], 3), np.maximum(np.linspace(*box[2:], 3), NEAR_REST)
        at, rest = self.pairs(p), box[2] == 0
        Z = impedances(at.lifted, np.repeat(np.arange(3), 3), np.tile(theta, 3))
        middle = worst(Z[3:4] if rest else Z[4:5])
        log_w = np.repeat(
            weights(middle.log_w[0], at.ratio if rest else np.full(3, np.nan)), 3, axis=0
        )
        function = PairDeterminant(self.pairs, middle.log_w[0], rest)
        return worst(Z, log_w).shunt.reshape(3, 3), function if middle.shunt[0] > 0 else None


def weights(log_w: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """Logarithms of weights for each of some loops, `(loops, 2 M)`; those of the components at
    rest have the ratio if known."""
    broadcast = np.broadcast_to(log_w, (len(ratio), len(log_w))).astype(
        np.result_type(ratio, float)
    )
    half = np.where(np.isnan(ratio), log_w[0] - log_w[1], np.log(ratio) / 2) / 2
    broadcast[:, 0], broadcast[:, 1] = log_w[:2].sum() / 2 + half, log_w[:2].sum() / 2 - half
    return broadcast


class HermitianPart(NamedTuple):
    """The Hermitian part at points and the sizes of its terms.

    lifted: the maps at the points. loops: those of different numbers; place: the index of each
    point in them.
    """

    matrix: np.ndarray
    size: np.ndarray
    lifted: Any
    loops: Any
    place: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class PairDeterminant:
    """`det He(R H R^-1) |det(w - E)|^2` over number and angle, for the same weights; see
    `Functions` in `robust.boxes`.

    rest: the weights have the ratio at rest, and the zeros there are divided out.
    """

    pairs: Pairs
    log_w: np.ndarray
    rest: bool

    def units(self, middle) -> None:
        """There are none."""

    def values(self, x, units):  # noqa: ARG002
        """Phase, logarithm, error and pivots at points `(n, 2)`."""
        part = self.hermitian(x[:, 0], x[:, 1])
        steps = on_circle(np.stack([x[:, 1], -x[:, 1]]))
        E = part.lifted.E
        matrices = [
            (part.matrix, part.size),
            *((A, np.abs(A)) for A in steps[..., None, None] * np.eye(E.shape[-1]) - E),
        ]
        determinants = [np.linalg.slogdet(matrix) for matrix, _ in matrices]
        # to first order, the relative change of a determinant is the trace of the inverse times the
        # change of the matrix
        error = sum(
            ENTRY_ROUNDINGS * (np.abs(inverse(matrix).mT) * terms).sum((-1, -2))
            for matrix, terms in matrices
        )
        zeros = (steps[0] * steps[1]) ** (self.rest * part.loops.zeros)
        phase = np.prod([sign for sign, _ in determinants], axis=0) * np.abs(zeros) / zeros
        log = sum(log for _, log in determinants) - np.log(np.abs(zeros))
        return FunctionValues(phase[None], log[None], error[None], part.loops.pivots[part.place])

    def positive(self, p: float, theta: float) -> bool:
        """Whether all eigenvalues of the Hermitian part are positive at a point."""
        part = self.hermitian(np.array([p]), np.array([theta]))
        return bool(np.linalg.eigvalsh(part.matrix[0])[0] > 1e-12 * part.size.max())

    def covered(self, box: tuple[float, float, float, float], cover: Covering) -> bool:
        """Whether a proof covers all of a box of the number and the angle."""
        first, last, below, above = box
        covered = cover(self, [[first, below or -above / 2], [last, above]], MOST)
        return covered is not None and not len(covered.open) and not len(covered.negative)

    def hermitian(self, numbers, theta) -> HermitianPart:
        """The Hermitian part `(R Z(z) R^-1 + (R Z(1/z) R^-1)')/2` at numbers and angles, `(points,)` each,
        which may be complex, and the sizes of its terms; R: the weights."""
        unique, place = np.unique(numbers, return_inverse=True)
        pairs = self.pairs(unique if unique.imag.any() else unique.real)
        ratio = pairs.ratio if self.rest else np.full(unique.shape, np.nan)
        R = np.exp(weights(self.log_w, ratio))[place]
        scale = R[:, :, None] / R[:, None, :]
        lifted = pairs.lifted.at(place)
        Z, size = components_with_sizes(lifted, theta, 1)
        back, size_back = components_with_sizes(lifted, theta, -1)
        hermitian = scale * Z + (scale * back).mT
        size = np.abs(scale) * size + (np.abs(scale) * size_back).mT
        return HermitianPart(hermitian / 2, size / 2, lifted, pairs, place)


@dataclass(frozen=True, slots=True, eq=False)
class PairWitness:
    """What takes energy in all components at one angle, as functions of the number: `-Re f* y` of
    each, for forces f.

    theta: `(1,)`. span: low, middle and high. force: `(3, 2 M)`, coefficients of the powers of `2
    (p - middle)/(high - low)` in the forces of `PairMap.apart`: next to rest all others drown in
    rounding.
    """

    pairs: Pairs
    theta: np.ndarray
    span: np.ndarray
    force: np.ndarray

    def units(self, middle) -> None:
        """There are none."""

    def values(self, x, units):  # noqa: ARG002
        """Phase, logarithm, error and pivots at points `(n, 1)`."""
        at = self.pairs(x[:, 0])
        apart, e = at.apart(), at.still
        powers, components = (
            ((x - self.span[1]) * 2 / ((self.span[2] - self.span[0]) or 1.0)) ** np.arange(3),
            [],
        )
        for sign, force in ((1, self.force), (-1, self.force.conj())):
            H, size = with_sizes(apart, sign * self.theta)
            f = (powers @ force)[:, :, None]
            _, back = basis(self.theta, f.shape[1] // 2, sign)
            y, rough = back @ H @ f, np.abs(back) @ size @ np.abs(f)
            step = e @ (e.mT @ f) * (1 / on_circle(-sign * self.theta) - 1)
            components.append(
                (back @ (f + step), y, np.abs(back) @ (np.abs(f) + np.abs(step)), rough)
            )
        (f, y, size, rough), (g, v, *_) = components
        value = -(g * y + f * v)[..., 0].T / 2
        error = ENTRY_ROUNDINGS * (np.abs(f) * rough + np.abs(y) * size)[..., 0].T / np.abs(value)
        return FunctionValues(value / np.abs(value), np.log(np.abs(value)), error, at.pivots)
