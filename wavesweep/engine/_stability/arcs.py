"""Crossings by adaptive arcs: slower than one polynomial, and reliable even if the poles crowd
at several scales."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.engine._monodromy.batches import NUMBERS_AT_ONCE
from wavesweep.engine._monodromy.cut import CutColumns, LinearFractional
from wavesweep.engine._monodromy.resolvent import FEW_SOLVED, DelayLines, ManyStates, TriangularForm
from wavesweep.engine._monodromy.unit_circle import on_circle
from wavesweep.engine._stability.arc_panels import MOST_BEYOND, PanelLimits, panel_roots
from wavesweep.engine._stability.boundary import polish, polish_of_many_states
from wavesweep.engine._stability.crossings import Crossings, at_both_ends, poles_at_one
from wavesweep.engine._stability.spectrum import count_outside, eigenvalues
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import EPS, NEXT_TO_ZERO

if TYPE_CHECKING:
    from wavesweep.engine._stability.arc_panels import PanelRoots

SMALLEST_ARC = 1e-9  # rad; an arc this small that proves nothing is given up
END_BIT = 1e-7  # rad; so near to z = +-1 a crossing is not distinguished from one at the end itself
MOST_OPEN_ARCS = 256  # so many open arcs of one column, and the column is given up
WIDE = 8.0  # sum of the half axes of an ellipse about a circle of NARROW half widths
NARROW = (WIDE - 1 / WIDE) / 2
RIM, WIDEST = 32, 0.01  # points of a circle about theta = 0, and its radius at most
MANY_STATES = 100  # beyond, columns are followed one by one, without inverses of their frames
REST_OF_PI = np.sin(np.pi)  # by which pi is larger than its double
CAUTION = 20  # roundings of what is added up that two solves may cost


def columns_together(cut: LinearFractional) -> int:
    """How many columns of such loops `arc_crossings` is to be given at once, in little memory."""
    order = cut.order - cut.late
    return 1 if order > MANY_STATES else max(1, 4 * NUMBERS_AT_ONCE // order**3)


def arc_crossings(columns: CutColumns, span: tuple[float, float]) -> Crossings:
    """Return the crossings of a few columns, each with a loop of its own (see `columns_together`),
    from Chebyshev interpolants on arcs of the circle.

    On each arc the boundary equation, without its poles and its zeros at z = +-1, is interpolated
    at points of state space; see `panel_roots` for the proof. An arc is left out if the number is
    proved to be beyond the span on it, as where a filter transmits nothing: the equation vanishes to
    a high order there.
    """
    equations = _BoundaryEquations.of(columns, max(map(abs, span)))
    E = equations.opened.E
    degree = E.shape[-1] + columns.cut.late + 1
    # Of the two functions that are sampled, 0 vanishes at crossings, and 1 is positive where the
    # number is beyond the span, which settles an arc.
    panels = panel_roots(
        equations.sample,
        np.linspace(0, np.pi, 5),
        columns.fixed.size,
        PanelLimits(SMALLEST_ARC, MOST_OPEN_ARCS, END_BIT),
        settling=1,
        degree=degree,
    )
    # Next to z = 1, where poles may hide the first function from panels.
    unproved = np.flatnonzero(panels.open_low)
    if unproved.size:
        panels.open_low[unproved] = ~_is_clear_next_to_one(
            E[unproved],
            StateSpace(*(matrix[unproved] for matrix in equations.condensed)),
            equations.lines,
            equations.poles[unproved],
            equations.late_of((unproved, None)),
            partial(panels.leaves.bound, unproved),
        )
    return _collect(columns, span, equations, panels)


@dataclass(frozen=True, slots=True)
class _BoundaryEquations:
    """The boundary equations of columns, see `_boundary`, as `panel_roots` samples them.

    opened: the loops without their numbers. lines, condensed: their delay lines, and the loops in the
    states of these. solver, solved: what resolvents are solved by, the lines or a form, and the loops
    in its states. poles: eigenvalues of the loops less 1, but those at z = 0, `(columns, poles)`.
    late, fixed: by how many frames numbers are late, and the fixed number of each column. largest:
    absolute value of a number in the span.
    """

    opened: StateSpace
    lines: DelayLines
    condensed: StateSpace
    solver: DelayLines | TriangularForm
    solved: StateSpace
    poles: np.ndarray
    late: int
    fixed: np.ndarray
    largest: float

    @staticmethod
    def of(columns: CutColumns, largest: float) -> _BoundaryEquations:
        """Those of columns."""
        late = columns.cut.late
        fixed = columns.fixed
        if late:
            opened = columns.cut.open_late(columns.along)
        else:
            opened = columns.cut.open_in(columns.along, fixed)
        lines, condensed = DelayLines.of(opened.E).condensed(opened)
        solver: DelayLines | TriangularForm = lines
        solved = condensed
        if lines.solved.size > FEW_SOLVED:
            form = TriangularForm.of(opened.E, opened.B, opened.C)
            solver = form
            solved = form.system(opened)
        poles, _ = eigenvalues(opened.E)
        poles = poles[
            :, (poles != -1).any(0)
        ]  # at z = 0 they are equally far from all of the circle
        return _BoundaryEquations(
            opened, lines, condensed, solver, solved, poles, late, fixed, largest
        )

    def late_of(self, index: Any) -> _Late | None:
        """What is late of some columns; index: gives `fixed` the axes of angles."""
        if not self.late:
            return None
        return _Late(self.late, self.fixed[index] if np.any(self.fixed) else None)

    def boundary(self, theta: np.ndarray) -> np.ndarray:
        """`value` of `_boundary` at an angle of each column."""
        late = self.late_of(slice(None))
        return _boundary(self.condensed, self.lines, theta, late=late).value

    def sample(
        self, column: np.ndarray, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sign, logarithm and rounding error of `value` and `beyond`, see `panel_roots`; a few panels
        at a time."""
        step = max(1, NUMBERS_AT_ONCE // (theta.shape[-1] * self.solved.B.shape[-2]))
        parts = []
        for first in range(0, column.size, step):
            chunk = slice(first, first + step)
            parts.append(self._sampled(column[chunk], theta[chunk]))
        sign, log, error = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
        return sign, log, error

    @np.errstate(all="ignore")  # samples of a loop whose entries overflow are not known
    def _sampled(
        self, column: np.ndarray, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # Many states are not copied for each panel.
        loops = np.zeros(1, int) if self.fixed.size == 1 else column
        systems = StateSpace(*(matrix[loops][:, None] for matrix in self.solved))
        value, value_off, beyond, beyond_off = _boundary(
            systems, self.solver, theta, self.largest, loops, self.late_of((column, None))
        )
        values = np.array([value, beyond])
        magnitude = np.maximum(np.abs(values), NEXT_TO_ZERO)
        # The poles' distances from both z and 1/z, whose product is |z - pole|^2 on the circle.
        distance = np.abs(on_circle(theta)[..., None] - self.poles[loops][:, None, :])
        distance = np.maximum(distance, NEXT_TO_ZERO)
        log = np.log(magnitude) + 2 * np.log(distance).sum(-1)
        off = [value_off, beyond_off] / magnitude + len(distance.T) * (1 / distance).sum(-1)
        return np.sign(values), log, np.minimum(off, 1 / NEXT_TO_ZERO)


@np.errstate(all="ignore")
def _is_clear_next_to_one(
    E: np.ndarray,
    condensed: StateSpace,
    lines: DelayLines,
    poles: np.ndarray,
    late: _Late | None,
    bound: Callable[..., np.ndarray],
) -> np.ndarray:
    """Whether no crossing is within END_BIT of z = 1, whatever poles are there, `(columns,)`.

    With m eigenvalues that are 1 by the pattern of E, H has a pole of order m at most there. Its
    imaginary part is odd in theta, so `f = Im K/sin(theta) |H|^2` has one of an even order q <= m +
    1, or of 2 m at most if products of two responses are in it (see `_of_late`), and `F = theta^q
    f` is analytic on a disc that no other eigenvalue is in. F is at most G on a circle of twice the
    radius r by the bound on f times the distances of all eigenvalues, so by Schwarz's lemma it is off
    from F(0) by at most G theta/r, and that from the mean of RIM points at r by 2 G 2^-RIM. condensed:
    the loops in the states of the lines. bound: see `Leaves`.
    """
    m = poles_at_one(E)
    away = np.sort(np.abs(poles), axis=-1)
    longest = max(late.frames if late else 1, lines.steps.max(initial=1))
    radius = np.full(len(E), min(WIDEST, 1 / (4 * longest)))  # of a part of a turn
    if m < away.shape[-1]:
        radius = np.minimum(radius, away[:, m] / 4)
    count, clear = count_outside(E / (3 * radius[:, None, None]) - np.eye(E.shape[-1]))
    theta = radius[:, None] * np.exp(2j * np.pi * np.arange(RIM) / RIM)
    at_angles = StateSpace(*(matrix[:, None] for matrix in condensed))
    value, off_in_roundings, _, _ = _boundary(at_angles, lines, theta, late=late)
    q = m + m % 2
    if late and late.fixed is not None:
        q = 2 * m
    F = value * theta**q
    noise = (EPS * off_in_roundings * np.abs(theta) ** q).max(-1)
    middle = F.mean(-1)
    log, *_ = bound(0 * radius, 2 * radius / NARROW, WIDE)
    apart = np.abs(away - 2 * radius[:, None]) - 0.05 * radius[:, None]  # chords beside angles
    log = log + q * np.log(2 * radius) - 2 * np.log(apart).sum(-1)
    off = MOST_BEYOND * np.exp(log) * (2 * END_BIT / radius + 2 * 0.5**RIM)
    return clear & (count == E.shape[-1] - m) & (np.abs(middle) > off + 2 * noise)


class _BoundaryFunctions(NamedTuple):
    """The functions `value` and `beyond` of the boundary, see `_boundary`, and how far each may
    be off, in roundings of 1."""

    value: np.ndarray
    value_off: np.ndarray
    beyond: np.ndarray
    beyond_off: np.ndarray


@np.errstate(all="ignore")
def _boundary(
    opened: StateSpace,
    solver: DelayLines | TriangularForm,
    theta: np.ndarray,
    largest: float = 0.0,
    loops: np.ndarray | None = None,
    late: _Late | None = None,
) -> _BoundaryFunctions:
    """Return two functions of the boundary at angles theta, which may be complex, of H = 1/K, K the
    number at the boundary:

        H(z) = C (w(z) I - E)^-1 B + D,   z = e^(i theta),   w(z) = z - 1,
        value = Im K/sin(theta) |H|^2 = C (w(1/z) I - E)^-1 (w(z) I - E)^-1 B,
        beyond = 1 - largest^2 H(z) H(1/z),

    the first by the resolvent identity: nothing cancels, not even at the points of the circle on
    the real axis. It is 0 where K is real; the second is positive on the circle where |K| is larger
    than `largest`. solver: delay lines of the loops, or their form, which they are the `loops` of.
    late: see `_of_late`.
    """
    right = solver.reached(opened.E, opened.B, on_circle(theta))
    H = _response(opened, solver, right, theta, loops)
    value = H.turning
    value_off = H.turning_off
    beyond = 1 - (largest * H.forward) * (largest * H.back)
    beyond_off = H.roundings + largest * (largest * H.square_off)
    if late:
        G = None
        if late.fixed is not None:
            G = _response(opened, solver, right, theta, loops, row=1)
        value, value_off, more, more_off = _of_late(late, theta, H, G)
        beyond = beyond + more
        beyond_off = beyond_off + more_off
    if not np.iscomplexobj(theta):
        value = value.real
        beyond = beyond.real
    return _BoundaryFunctions(value, value_off, beyond, beyond_off)


class _Response(NamedTuple):
    """H at theta and at -theta, `forward` and `back`, and `turning`, -Im H/sin(theta).

    roundings: of the terms of a sum, that it may be off by. size: of the terms of the mean of both,
    and turning_size of those of `turning`. off, turning_off, square_off: how far the mean, `turning`
    and the product of both may be off, in roundings of 1.
    """

    forward: np.ndarray
    back: np.ndarray
    turning: np.ndarray
    roundings: int
    size: np.ndarray
    turning_size: np.ndarray
    off: np.ndarray
    turning_off: np.ndarray
    square_off: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Re H on the circle."""
        return (self.forward + self.back) / 2


def _response(
    opened: StateSpace,
    solver: DelayLines | TriangularForm,
    right: np.ndarray,
    theta: np.ndarray,
    loops: np.ndarray | None,
    row: int = 0,
) -> _Response:
    """The response of a row of C and D; right: what B reaches. See `_boundary`."""
    C = opened.C[..., row : row + 1, :]
    D = opened.D[..., row, 0]
    observed = solver.row(opened.E, C, on_circle(-theta))
    terms = observed * right
    # H at theta, by what B reaches, and at -theta, by what C reads.
    forward = C[..., 0, :] * right
    back = observed * opened.B[..., 0]
    size_forward = np.abs(forward).sum(-1) + np.abs(D)
    size_back = np.abs(back).sum(-1) + np.abs(D)
    if isinstance(solver, DelayLines):
        roundings = CAUTION + solver.longest
        of_gain: np.ndarray | float = 0.0
        terms, of_turning = _with_turned_runs(solver, terms, theta)
    else:
        roundings = CAUTION + opened.E.shape[-1]
        some: np.ndarray = loops  # type: ignore[assignment]  # which a form always has
        of_turning, of_gain = _errors_of_form(solver, some, observed, right, theta)
    size = np.abs(terms).sum(-1)
    both = size_forward + size_back
    return _Response(
        forward=forward.sum(-1) + D,
        back=back.sum(-1) + D,
        turning=terms.sum(-1),
        roundings=roundings,
        size=both / 2,
        turning_size=size,
        off=roundings * both / 2 + of_gain,
        turning_off=roundings * size + of_turning,
        square_off=2 * roundings * size_forward * size_back + of_gain * (both + of_gain * EPS),
    )


def _with_turned_runs(
    lines: DelayLines, terms: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray | float]:
    """Return the products `(..., n)` of what reaches the states and what is read of them, with those
    of the runs of delay lines, which are those of a run's ends, turned; and the error of their sum."""
    long = lines.steps > 1
    runs = lines.delayed[long]
    if not runs.size:
        return terms, 0.0
    _, turned, _, unsure = _turned(lines.steps[long], theta[..., None])
    error = (np.abs(terms[..., runs]) * unsure).sum(-1)
    terms[..., runs] *= turned
    return terms, error


class _Late(NamedTuple):
    """What is late: by so many frames, and the number that is fixed, of which the second row of C is;
    None if it is 0."""

    frames: int
    fixed: np.ndarray | None


def _of_late(
    late: _Late, theta: np.ndarray, H: _Response, G: _Response | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | float, np.ndarray | float]:
    """Return `value` of `_boundary` with its error, and what is added to `beyond` with the error of
    that, for numbers that are d frames late.

    With the fixed number F and its response G, `z^d = K H + F G`, so on the circle `K H` is
    `z^d - F G`. With R = Re, and I = -Im/sin(theta), of H and of G,

        Im K/sin(theta) |H|^2 = cos(d theta) I_H + sin(d theta)/sin(theta) R_H - F (R_G I_H - I_G R_H),
        |K H|^2 - 1 = F^2 |G|^2 - 2 F (cos(d theta) R_G - sin(d theta)/sin(theta) sin(theta)^2 I_G).
    """
    turn, per_turn, unsure, unsure_per_turn = _turned(late.frames, theta)
    value = turn * H.turning + per_turn * H.mean
    value_off = np.abs(turn) * H.turning_off + np.abs(per_turn) * H.off
    value_off = value_off + unsure * H.turning_size + unsure_per_turn * H.size
    F = late.fixed
    if G is None or F is None:
        return value, value_off, 0.0, 0.0
    square = np.sin(theta) ** 2
    size_of_square = np.abs(square)
    value = value - F * (G.mean * H.turning - G.turning * H.mean)
    value_off = value_off + np.abs(F) * (
        _off_in_product(G.size, G.off, H.turning_size, H.turning_off)
        + _off_in_product(G.turning_size, G.turning_off, H.size, H.off)
    )
    shared = turn * G.mean - per_turn * square * G.turning
    shared_off = np.abs(turn) * G.off + np.abs(per_turn) * size_of_square * G.turning_off
    shared_off = shared_off + unsure * G.size + unsure_per_turn * size_of_square * G.turning_size
    beyond = F**2 * (G.forward * G.back) - 2 * F * shared
    return value, value_off, beyond, F**2 * G.square_off + 2 * np.abs(F) * shared_off


def _off_in_product(
    a: np.ndarray, a_off: np.ndarray, b: np.ndarray, b_off: np.ndarray
) -> np.ndarray:
    """How far a product may be off, in roundings of 1; a, b: sizes of the terms of its factors."""
    return a * b_off + a_off * b + EPS * a_off * b_off + a * b


def _turned(
    late: np.ndarray | int, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return `cos(d theta)` and `sin(d theta)/sin(theta)`, d being `late`, and how far each may be
    off, in roundings of 1.

    Beyond a quarter of a turn they are those of a = pi - theta, which is computed to a rounding of
    itself:

        cos(d theta) = (-1)^d cos(d a),   sin(d theta)/sin(theta) = -(-1)^d sin(d a)/sin(a).

    So in both halves `d a` is known to two roundings of itself, sin(a) to one, and on the circle a is
    at most pi/2 sin(a). A derivative of sin and cos at complex angles is at most exp of the imaginary
    part, which is |sin(a)| at least as well, if small; of the second function, at large ones, an order
    of magnitude is enough, as they are on the rim.
    """
    far = theta.real > np.pi / 2
    a = np.where(far, (np.pi - theta) + REST_OF_PI, theta)
    sign = np.where(far & (late % 2 == 1), -1.0, 1.0)
    size = np.exp(late * np.abs(np.imag(theta)))
    turn = sign * np.cos(late * a)
    per_turn = np.where(far, -sign, sign) * np.sin(late * a) / np.sin(a)
    unsure = 2 * (late * np.abs(a) + 1) * size
    return turn, per_turn, unsure, np.pi * late * size + 4 * np.abs(per_turn)


def _errors_of_form(
    form: TriangularForm, loops: np.ndarray, left: np.ndarray, right: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the errors of a form may move `left right`, and `C right` as well as `left B`,
    in roundings of 1.

    loops: their numbers in the form, `(panels,)`. Solves of T + X in place of T move the first to
    first order by `left X R right` and `left R X right`, R the resolvent at -theta and at theta,
    and the others by `left X right`. That of a diagonal T is 1 over the distance of the nearest
    eigenvalue. Schur's vectors are orthogonal, and the loop is real in its own states, in even
    units, so by the resolvent identity the size of `R right` is that of the imaginary part of
    `right` in these states, over sin(theta).
    """
    of_left = np.linalg.norm(left, axis=-1)
    of_right = np.linalg.norm(right, axis=-1)
    error = form.error[loops, None] / EPS
    of_gain = error * of_left * of_right
    if form.diagonal:
        poles = form.frames[loops]
        apart = np.abs(on_circle(theta)[..., None] - poles).min(-1)
        apart_back = np.abs(on_circle(-theta)[..., None] - poles).min(-1)
        return of_gain * (1 / apart + 1 / apart_back), of_gain
    own_right = right @ form.V[loops].mT
    own_left = left @ form.Z[loops]
    R_right = np.linalg.norm(own_right.imag, axis=-1) / np.abs(np.sin(theta))
    left_R = np.linalg.norm(own_left.imag, axis=-1) / np.abs(np.sin(theta))
    return error * (of_left * R_right + left_R * of_right), of_gain


def _outermost(
    columns: int, column: np.ndarray, theta: np.ndarray, panels: PanelRoots
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the last angle of each column at which it may cross, `(columns,)`: the
    ends of settled panels, on which nothing is known, count as crossings."""
    owner, low, high = panels.settled
    first = np.full(columns, np.pi)
    np.minimum.at(first, column, theta)
    np.minimum.at(first, owner[low > 0], low[low > 0])
    last = np.zeros(columns)
    np.maximum.at(last, column, theta)
    np.maximum.at(last, owner[high < np.pi], high[high < np.pi])
    return first, last


def _collect(
    columns: CutColumns,
    span: tuple[float, float],
    equations: _BoundaryEquations,
    panels: PanelRoots,
) -> Crossings:
    """Polish the crossings, drop those that overlapping arcs found twice, and add those at z = 1
    and -1."""
    cut = columns.cut
    fixed = columns.fixed
    complete = panels.complete & ~(panels.open_low | panels.open_high)
    roots = panels.roots
    inside = (roots.x > 0) & (roots.x < np.pi)
    column = roots.column[inside]
    seed = roots.x[inside]
    jump = 2.0 * roots.slope_sign[inside]
    start = columns.along, fixed[column], seed, max(map(abs, span))
    many = None
    if cut.order - cut.late > MANY_STATES:  # of a single column
        loop = cut.at(0)
        many = ManyStates.of(loop.E, loop.B, loop.C)
        inverses = np.zeros((0, *cut.E.shape[-2:]))
        polished = polish_of_many_states(loop, many, columns.along, fixed[0], seed, start[-1])
    else:
        polished, inverses = polish(columns.loops(column), *start)
    astray = np.abs(polished.theta - seed) > roots.within[inside] + 1e-9
    complete[column[~polished.converged | astray]] = False

    new = _without_copies(column, polished.theta)
    column = column[new]
    theta = polished.theta[new]

    first, last = _outermost(fixed.size, column, theta, panels)
    at_one = np.sign(equations.boundary(first / 2))
    at_minus_one = np.sign(equations.boundary((np.pi + last) / 2))
    ends, at_ends = at_both_ends(columns, at_one, at_minus_one, many)
    return Crossings(
        column=np.concatenate([column, ends.column]),
        value=np.concatenate([polished.value[new], ends.value]),
        theta=np.concatenate([theta, ends.theta]),
        jump=np.concatenate([jump[new], ends.jump]),
        inverse=np.concatenate([new, len(inverses) + ends.inverse]),
        inverses=np.concatenate([inverses, at_ends]),
        complete=complete,
        growth_to_infinity=np.full(fixed.size, np.nan),
        many=many,
    )


def _without_copies(column: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Indices of the angles, sorted by column, without those that overlapping arcs found twice."""
    order = np.lexsort((theta, column))
    theta = theta[order]
    new = np.ones(order.size, bool)
    close_by = np.diff(theta) <= 1e-9 * np.minimum(theta[1:], np.pi - theta[1:])
    new[1:] = (np.diff(column[order]) != 0) | ~close_by
    return order[new]
