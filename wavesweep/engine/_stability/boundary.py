"""The stability boundary as a curve on the unit circle: point by point, polished to rounding, with
its rounding errors.

The characteristic equation is `unit = K x + B v` at each point, K and B being the first and the
second number, as stiffness and damping of a wall: `1 = K G_x + B G_v`, multiplied by w if the loop
integrates. If the numbers are d frames late, x and v have the factor `z^-d`. On the circle that is
of size 1, and known to d roundings: those of z, and of the angle of a crossing, turn it d times as
far. Its derivative by w is `-d/z` times itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.cut import ADVANCE, FIRST, OFFSET, VELOCITY, LinearFractional
from wavesweep.engine._monodromy.resolvent import InForm, InLines, Inverse, ManyStates
from wavesweep.engine._monodromy.unit_circle import inverse, on_circle
from wavesweep.engine.doubles import EPS

Resolvent = Inverse | InLines | InForm

NEWTON_STEPS = 12  # Newton from a seed of 8 digits needs 2
# of the distance to the nearer end of the circle, a step after which an angle is exact: errors are
# its square
LAST_STEP_OF_ANGLE = 1e-9
NEAREST_END = 1e-3  # of that distance, what a step leaves of it at least
# of a state, by which it may change from where an inverse was taken for one refinement to make up
# for it
REFINABLE = 1e-8


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms of `unit = K*x + B*v` at points of the circle, scaled alike; each an array over
    the points."""

    unit: np.ndarray
    x: np.ndarray
    v: np.ndarray

    def along(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return (term of the number that is solved for, term of the fixed number)."""
        return (self.x, self.v) if name == FIRST else (self.v, self.x)


def terms_of(
    cut: LinearFractional, w: np.ndarray, G: np.ndarray, unit: np.ndarray | float = 1.0
) -> Terms:
    """Return the terms from the rows VELOCITY, ADVANCE, OFFSET of G at `w = z - 1`; arrays of sizes
    give the sizes of terms.

    unit: a factor that the rows of G have as well.
    """
    if cut.late:
        G = G * turned_back(cut, w)[..., None]
    if not cut.integrates:
        return Terms(unit + 0 * G[..., VELOCITY], G[..., OFFSET], G[..., VELOCITY])
    return Terms(
        w * unit + 0 * G[..., VELOCITY], G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., VELOCITY]
    )


def turned_back(cut: LinearFractional, w: np.ndarray) -> np.ndarray:
    """Return `z^-late` at `w = z - 1`, exactly 1 or -1 at both ends of the circle."""
    return (1 + w) ** -float(cut.late)


def terms(cut: LinearFractional, w: np.ndarray) -> Terms:
    """Return the terms of the characteristic equation at `w = z - 1`; cut: one loop per point
    (leading axes as `w`).

    Accuracy: a refined solve in delta form, so relative to the distance of the nearest pole, even
    if many poles crowd at z = 1.
    """
    return terms_and_inverse(cut, w)[0]


def terms_and_inverse(cut: LinearFractional, w: np.ndarray) -> tuple[Terms, np.ndarray]:
    """Return the terms of the characteristic equation (see `terms`), and the inverse of `w I -
    E` for `end_errors`."""
    w = np.asarray(w)
    resolvent = Inverse(inverse(_shifted(cut, w)))
    return terms_of(cut, w, _outputs(cut, _states(cut, w, resolvent))), resolvent.matrix


def real_terms(cut: LinearFractional, w: float, states: ManyStates) -> Terms:
    """Return the terms of the characteristic equation of a single loop of many states at a real
    point, arrays of one."""
    point = np.array([w])
    G = _outputs(cut, _states(cut, point, states.at(point)))
    return terms_of(cut, point, G.real)


def _states(cut: LinearFractional, w: np.ndarray, resolvent: Resolvent) -> np.ndarray:
    """Return the states for a unit force.

    One step of refinement makes the backward error small entry by entry (R. D. Skeel, Math. Comp.
    35, 1980). That of a plain solve is small only relative to the largest entry, and states may
    differ in size by ten decades.
    """
    state = resolvent.reached(cut.B)
    return state + resolvent.reached(_left(cut, w, state))


def _left(cut: LinearFractional, w: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Return what states leave of their equations, `B - (w I - E) state`."""
    return cut.B - w[..., None, None] * state + _moved(cut.E, state)


def _moved(E: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Return `E state`; states of one loop at many points as one product."""
    if E.ndim > 2 or state.ndim < 3:
        return times(E, state)
    return np.ascontiguousarray(times(E, state[..., 0].T).T)[..., None]


def _shifted(cut: LinearFractional, w: np.ndarray) -> np.ndarray:
    """Return `w I - E`."""
    w = np.asarray(w)
    n = cut.E.shape[-1]
    A = np.empty((*np.broadcast_shapes(w.shape, cut.E.shape[:-2]), n, n), np.result_type(w, cut.E))
    np.negative(cut.E, out=A)
    A.reshape(*A.shape[:-2], n * n)[..., :: n + 1] += w[..., None]
    return A


def times(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the product of matrices and columns `(..., n, 1)`, without a complex copy of real
    matrices.

    BLAS rounds what is contiguous in another way than what is not, and last digits must not follow
    from how memory is laid out.
    """
    matrix = np.ascontiguousarray(matrix)
    columns = np.ascontiguousarray(columns)
    if np.iscomplexobj(matrix):
        return matrix @ columns
    return (matrix @ columns.view(float)).view(columns.dtype)


def _outputs(cut: LinearFractional, state: np.ndarray) -> np.ndarray:
    """Return `C state + D`, `(..., 3)`."""
    return (times(cut.C, state) + cut.D)[..., 0]


def residual(t: Terms, K: np.ndarray, B: np.ndarray, least: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the relative residual of the characteristic equation: 0 exact, 1 meaningless;
    least: size of a further term."""
    size = np.abs(t.unit) + np.abs(K * t.x) + np.abs(B * t.v) + least
    return np.abs(t.unit - K * t.x - B * t.v) / size


class PolishedCrossings(NamedTuple):
    """theta: the angles (rad per frame). value: the number there. converged: whether Newton's
    last step is at rounding."""

    theta: np.ndarray
    value: np.ndarray
    converged: np.ndarray


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def polish(
    cut: LinearFractional, parameter: str, fixed: np.ndarray, theta: np.ndarray, scale: float
) -> tuple[PolishedCrossings, np.ndarray]:
    """Solve `Im K(theta) = 0`, `K = (unit - fixed*fixed_term)/solved`, by Newton's method from the
    seeds theta.

    cut: one loop per seed. fixed: the other number, per seed. scale: the largest value of interest;
    if K is beyond it, Newton's method is applied to 1/K, since a crossing at a very large K lies
    next to a pole of K. Returns the crossings, and the inverses of `w I - E` there or next to them,
    `(seeds, n, n)`. Accuracy: value good to about 1e-13 relative, less if the curve crosses the
    real axis at a grazing angle.
    """
    theta = theta.astype(float)
    value = np.full(theta.shape, np.nan)
    done = np.zeros(theta.shape, bool)
    far_off = np.zeros(theta.shape, bool)
    inverses = np.empty((theta.size, *cut.E.shape[-2:]), complex)
    active = np.arange(theta.size)
    for _ in range(NEWTON_STEPS):
        if not active.size:
            break
        loops = cut if active.size == theta.size else cut.at(active)
        w = on_circle(theta[active])
        resolvent = Inverse(inverse(_shifted(loops, w)))
        curve, speed = _value_and_slope(loops, parameter, fixed[active], w, resolvent)
        step = _newton(*curve, theta[active], scale)
        theta[active] = step.theta
        value[active] = step.value
        done[active] = step.converged
        inverses[active] = resolvent.matrix
        far_off[active] = step.size * speed > REFINABLE
        active = active[~step.last]
    moved = np.flatnonzero(far_off)
    if moved.size:  # by more than what one refinement makes up for
        inverses[moved] = inverse(_shifted(cut.at(moved), on_circle(theta[moved])))
    return PolishedCrossings(theta, value, done), inverses


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def polish_of_many_states(
    cut: LinearFractional,
    states: ManyStates,
    parameter: str,
    fixed: float,
    theta: np.ndarray,
    scale: float,
) -> PolishedCrossings:
    """`polish` for a single loop of many states, without inverses, and so in little memory."""
    theta = theta.astype(float)
    value = np.full(theta.shape, np.nan)
    done = np.zeros(theta.shape, bool)
    for first in range(0, theta.size, states.most):
        active = np.arange(first, min(first + states.most, theta.size))
        for _ in range(NEWTON_STEPS):
            if not active.size:
                break
            w = on_circle(theta[active])
            curve, _ = _value_and_slope(cut, parameter, fixed, w, states.at(w))
            step = _newton(*curve, theta[active], scale)
            theta[active] = step.theta
            value[active] = step.value
            done[active] = step.converged
            active = active[~step.last]
    return PolishedCrossings(theta, value, done)


class _Step(NamedTuple):
    """theta, value, converged: see `PolishedCrossings`. size: of the step. last: whether no
    other one is needed."""

    theta: np.ndarray
    value: np.ndarray
    converged: np.ndarray
    size: np.ndarray
    last: np.ndarray


def _newton(now: np.ndarray, slope: np.ndarray, theta: np.ndarray, scale: float) -> _Step:
    """A step of Newton's method from K(theta) and dK/dtheta; see `polish`."""
    far = np.abs(now) > scale
    slope = np.where(far, -slope / now**2, slope)
    now = np.where(far, 1 / now, now)
    step = -now.imag / slope.imag
    step = np.where(np.isfinite(step), step, 0.0)
    size = np.abs(step)
    small = size <= LAST_STEP_OF_ANGLE * np.minimum(theta, np.pi - theta)
    least = NEAREST_END * theta
    highest = np.pi - NEAREST_END * (np.pi - theta)
    estimate = now.real + step * slope.real  # its error is the square of the step
    value = np.where(far, 1 / estimate, estimate)
    return _Step(
        np.clip(theta + step, least, highest), value, small & (slope.imag != 0), size, small
    )


def _value_and_slope(
    cut: LinearFractional,
    parameter: str,
    fixed: np.ndarray | float,
    w: np.ndarray,
    resolvent: Resolvent,
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return K(theta) and dK/dtheta, complex, as a pair; and the relative change of the states
    per angle."""
    state = _states(cut, w, resolvent)
    turn = resolvent.reached(state)
    G = _outputs(cut, state)
    dG = -times(cut.C, turn)[..., 0]
    with np.errstate(all="ignore"):
        speed = np.fmax.reduce((np.abs(turn) / np.abs(state))[..., 0], axis=-1, initial=0)
    slopes = Terms(np.zeros(()), dG[..., OFFSET], dG[..., VELOCITY])  # by w
    if cut.integrates:
        of_x = dG[..., ADVANCE] + w * dG[..., OFFSET] + G[..., OFFSET]
        slopes = Terms(np.ones(()), of_x, w * dG[..., VELOCITY] + G[..., VELOCITY])
    values = terms_of(cut, w, G)
    if cut.late:
        turn = turned_back(cut, w)
        by_turn = -cut.late / (1 + w)
        slopes = Terms(
            slopes.unit, turn * slopes.x + by_turn * values.x, turn * slopes.v + by_turn * values.v
        )
    return _solved(values, slopes, parameter, fixed, w), speed


def _solved(
    t: Terms, slopes: Terms, parameter: str, fixed: np.ndarray | float, w: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the number that solves the equation, and its derivative by theta, complex."""
    solved, fixed_term = t.along(parameter)
    d_solved, d_fixed = slopes.along(parameter)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = (t.unit - fixed * fixed_term) / solved
        by_w = (slopes.unit - fixed * d_fixed - value * d_solved) / solved
        return value, by_w * (1j * (1 + w))


def end_errors(
    cut: LinearFractional,
    parameter: str,
    fixed: np.ndarray,
    value: np.ndarray,
    w: np.ndarray,
    on_axis: np.ndarray,
    resolvent: Resolvent | None = None,
    least: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the residuals of the characteristic equation at crossings, and two effects of
    rounding.

    The residual is relative to the equation's terms and to that of the value `least`, since an end
    next to zero, as a mode without damping has one, has few digits of itself. The second result
    bounds the change of the value by the errors of the loop's entries. The third is the residual
    that a rounding of every entry leaves.

    cut: one loop per crossing. value: of the number. w: `exp(j theta) - 1` there. on_axis: whether
    the crossing is held at z = 1 or -1. resolvent: there or next to it. To first order an entry's
    change reaches the equation as `y dE R B`, R the resolvent and y what it makes of the row that
    the numbers read, and so does the value; if that grazes the real axis, the angle changes by `Im
    dK/Im K'`, which moves K by `Re K'` times as much.
    """
    w = np.asarray(w)
    pair = (value, fixed) if parameter == FIRST else (fixed, value)
    if resolvent is None:
        resolvent = Inverse(inverse(_shifted(cut, w)))
    state = _states(cut, w, resolvent)
    G = _outputs(cut, state)
    t = terms_of(cut, w, G)
    turn = turned_back(cut, w) if cut.late else 1.0
    turned = pair[0] * turn, pair[1] * turn
    adjoint = _adjoint(cut, w, _read_row(cut, w, turned, cut.C), resolvent)
    slope = (adjoint * state[..., 0]).sum(-1)
    if cut.integrates:
        slope = slope + 1 - turned[0] * G[..., OFFSET] - turned[1] * G[..., VELOCITY]
    if cut.late:
        slope = slope + cut.late / (1 + w) * (pair[0] * t.x + pair[1] * t.v)
    with np.errstate(all="ignore"):
        solved, _ = t.along(parameter)
        by_angle = slope / solved * (1j * (1 + w))
        grazing = np.where(on_axis, 1.0, np.abs(by_angle) / np.abs(by_angle.imag))
        further = least * np.abs(solved)
        size = np.abs(t.unit) + np.abs(pair[0] * t.x) + np.abs(pair[1] * t.v) + further
        size = np.where(size > 0, size, 1)  # at K = 0 the equation is 0 = 0 by structure
        numbers = np.abs(pair[0]), np.abs(pair[1])
        sizes = _Sizes(np.abs(w), numbers, np.abs(adjoint), np.abs(state))
        rounding, error = _errors_of_equation(cut, sizes, _left(cut, w, state))
        late_terms = np.abs(pair[0] * t.x) + np.abs(pair[1] * t.v)
        of_turn = np.where(on_axis, 0.0, cut.late * EPS * late_terms)
        rounding = rounding + of_turn
        error = error + of_turn
        moved = error / np.abs(solved) * grazing
        return residual(t, *pair, further), moved, rounding / size


def _read_row(
    cut: LinearFractional, w: np.ndarray, pair: tuple[np.ndarray, np.ndarray], rows: np.ndarray
) -> np.ndarray:
    """Return the row that the two numbers read, `(..., n)`; rows: those of C, `(..., 3, n)`."""
    K = np.asarray(pair[0])[..., None]
    B = np.asarray(pair[1])[..., None]
    w = w[..., None]
    if not cut.integrates:
        return K * rows[..., OFFSET, :] + B * rows[..., VELOCITY, :]
    return K * rows[..., ADVANCE, :] + K * w * rows[..., OFFSET, :] + B * w * rows[..., VELOCITY, :]


def _adjoint(
    cut: LinearFractional, w: np.ndarray, row: np.ndarray, resolvent: Resolvent
) -> np.ndarray:
    """Return `row (w I - E)^-1`, `(..., n)`, refined."""
    adjoint = resolvent.row(row)
    missed = row - w[..., None] * adjoint + _moved(cut.E.mT, adjoint[..., None])[..., 0]
    change = resolvent.row(missed)
    smaller = np.abs(change).max(-1, keepdims=True) < np.abs(adjoint).max(-1, keepdims=True)
    # Next to a pole of the loop itself, as a mode without damping is one, the change would be
    # rounding of another scale.
    return adjoint + np.where(smaller, change, 0.0)


class _Sizes(NamedTuple):
    """Absolute values of what makes the characteristic equation at crossings, `(...)`.

    w: `z - 1`. numbers: K and B, which read the row q of the states and the force. adjoint: `l = q C
    (w I - E)^-1`, `(..., n)`. states: `s = (w I - E)^-1 B`, `(..., n, 1)`.
    """

    w: np.ndarray
    numbers: tuple[np.ndarray, np.ndarray]
    adjoint: np.ndarray
    states: np.ndarray

    def moved_by(
        self, cut: LinearFractional, E: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
    ) -> np.ndarray:
        """What errors of the matrices that are no larger than E, B, C and D move the equation by:
        `|l| (E |s| + B) + |q| (C |s| + D)`."""
        of_states = (self.adjoint * (E @ self.states + B)[..., 0]).sum(-1)
        of_outputs = (_read_row(cut, self.w, self.numbers, C) * self.states[..., 0]).sum(-1)
        return of_states + of_outputs + _read_row(cut, self.w, self.numbers, D)[..., 0]


def _errors_of_equation(
    cut: LinearFractional, sizes: _Sizes, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what moves the characteristic equation, twice `(...)`: a rounding of every entry, and
    the bounds on the errors of the entries.

    Both have with them the residual of the solve, `r = B - (w I - E) s`, `(..., n, 1)`, which moves
    the equation by `|l| |r|`.
    """
    of_solve = (sizes.adjoint * np.abs(residual)[..., 0]).sum(-1)
    terms = sizes.moved_by(cut, np.abs(cut.E), np.abs(cut.B), np.abs(cut.C), np.abs(cut.D))
    rounding = EPS * terms + of_solve
    return rounding, rounding + sizes.moved_by(cut, cut.dE, cut.dB, cut.dC, cut.dD)
