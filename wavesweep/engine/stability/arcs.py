"""Crossings by adaptive arcs: slower than one polynomial, and reliable even if the poles crowd at several scales."""

from typing import NamedTuple

import numpy as np

from wavesweep.engine.monodromy.cut import LinearFractional
from wavesweep.engine.monodromy.resolvent import FEW_SOLVED, DelayLines, ManyStates, TriangularForm
from wavesweep.engine.monodromy.unit_circle import on_circle
from wavesweep.engine.stability.arc_panels import panel_roots
from wavesweep.engine.stability.boundary import polish, polish_of_many_states
from wavesweep.engine.stability.crossings import Crossings, at_both_ends, poles_at_one
from wavesweep.engine.stability.spectrum import count_outside
from wavesweep.engine.state_space import StateSpace

SMALLEST = 1e-9  # rad; an arc this small that proves nothing is given up
END_BIT = 1e-7  # rad; so near to z = +-1 a crossing is not distinguished from one at the end itself
MANY = 256  # so many open arcs of one column, and the column is given up
RIM, WIDEST = 32, 0.01  # points of a circle about theta = 0, and its radius at most
TINY = 1e-300
MOST = 500_000  # states at points that are computed together
MANY_STATES = 100  # beyond, columns are followed one by one, without inverses of their frames
MOST_ERROR = 1e300  # of a value, in roundings of itself
CAUTION = 20  # roundings of what is added up that two solves may cost


def columns_together(order: int) -> int:
    """How many columns of loops of so many states `arc_crossings` is to be given at once, in little memory."""
    return 1 if order > MANY_STATES else max(1, 4 * MOST // order**3)


def arc_crossings(cut: LinearFractional, along: str, fixed, span) -> Crossings:
    """Return the crossings of a few columns (loops `cut`, one per column), from Chebyshev interpolants on arcs of the circle.

    fixed: `(columns,)`, see `columns_together`. On each arc the boundary equation, without its poles and its zeros at z = +-1,
    is interpolated at points of state space; see `panel_roots` for the proof. An arc is left out if the number is proved to be
    beyond the span on it: if a filter transmits nothing there, the equation vanishes to a high order.
    """
    opened = cut.open_in(along, fixed)
    lines = DelayLines.of(opened[0])
    poles = np.linalg.eigvals(opened[0]).astype(complex)
    form, system = None, opened
    if lines.solved.size > FEW_SOLVED:
        form = TriangularForm.of(opened[0])
        system = form.system(opened)
    edges = np.linspace(0, np.pi, 5)
    column = np.repeat(np.arange(fixed.size), 4)

    @np.errstate(all="ignore")  # samples of a loop whose entries overflow are not known
    def sampled(column, theta):
        of = np.zeros(1, int) if fixed.size == 1 else column  # many states are not copied for each panel
        systems = StateSpace(*(matrix[of][:, None] for matrix in system))
        value, size, beyond, unsure = _boundary(systems, lines if form is None else form, theta, max(map(abs, span)), of)
        # The poles' distances from both z and 1/z, whose product is |z - pole|^2 on the circle and analytic beside it.
        poles_of = poles[of][:, None, :]
        distance = [on_circle(theta)[..., None] - poles_of, on_circle(-theta)[..., None] - poles_of.conj()]
        magnitude, far = np.maximum(np.abs([value, beyond]), TINY), [np.maximum(np.abs(d), TINY) for d in distance]
        phase, log = np.array([value, beyond], complex) / magnitude, np.log(magnitude)
        phase *= (distance[0] / far[0] * (distance[1] / far[1])).prod(-1)
        log += sum(np.log(d).sum(-1) for d in far)
        return phase, log, np.minimum([size, unsure] / magnitude, MOST_ERROR)

    def sample(column, theta):
        step = max(1, MOST // (theta.shape[-1] * cut.order))
        parts = [sampled(column[i : i + step], theta[i : i + step]) for i in range(0, column.size, step)]
        return tuple(np.concatenate(part, axis=1) for part in zip(*parts, strict=True))

    low, high = np.tile(edges[:-1], fixed.size), np.tile(edges[1:], fixed.size)
    roots = panel_roots(sample, column, low, high, fixed.size, SMALLEST, MANY, end_bit=END_BIT, settling=1)
    if (at := np.flatnonzero(roots.open_low)).size:
        roots.open_low[at] = ~_is_clear_next_to_one(StateSpace(*(matrix[at] for matrix in opened)), lines, poles[at])
    return _collect(cut, along, fixed, span, lambda theta: _boundary(opened, lines, theta).value, roots)


@np.errstate(all="ignore")
def _is_clear_next_to_one(opened, lines, poles):
    """Whether no crossing is within END_BIT of z = 1, whatever poles the loop has there, `(columns,)`.

    With m eigenvalues that are 1 by the pattern of E, H has a pole of order m at most there. Its imaginary part is odd in
    theta, so `f = Im K/sin(theta) |H|^2` has one of an even order q <= m + 1, and `F = theta^q f` is analytic on a disc that no
    other eigenvalue is in. F(0) is the mean of its rim, and by Schwarz's lemma F is off from that by at most the largest
    difference on the rim times the part of the way there.
    """
    E, m = opened.E, poles_at_one(opened.E)
    away = np.sort(np.abs(poles), axis=-1)
    radius = np.minimum(WIDEST, away[:, m] / 4) if m < away.shape[-1] else np.full(len(E), WIDEST)
    count, clear = count_outside(E / (2 * radius[:, None, None]) - np.eye(E.shape[-1]))
    theta = radius[:, None] * np.exp(2j * np.pi * np.arange(RIM) / RIM)
    value, size, _, _ = _boundary(StateSpace(*(matrix[:, None] for matrix in opened)), lines, theta)
    q = m + m % 2
    F, noise = value * theta**q, (np.finfo(float).eps * size * np.abs(theta) ** q).max(-1)
    middle = F.mean(-1)
    off = 2 * np.abs(F - middle[:, None]).max(-1) * 2 * END_BIT / radius  # twice, for what is between two points of the rim
    return clear & (count == E.shape[-1] - m) & (np.abs(middle) > off + 2 * noise)


class _BoundaryFunctions(NamedTuple):
    """`Im K / sin(theta)` times |H|^2, H = 1/K, and the size of its terms; `1 - largest^2 |H|^2`, which is positive if |K| is
    larger than `largest`, and the size of its terms."""

    value: np.ndarray
    size: np.ndarray
    beyond: np.ndarray
    unsure: np.ndarray


@np.errstate(all="ignore")
def _boundary(opened, solver, theta, largest=0.0, of=None) -> _BoundaryFunctions:
    """Return the two functions of the boundary at angles theta; solver: delay lines of the loops, or their form, which they
    are the loops `of` of.

    `Im H(z) = -sin(theta) C (w(1/z) I - E)^-1 (w(z) I - E)^-1 B`, `w(z) = z - 1`, by the resolvent identity: nothing cancels,
    not even at the points of the circle on the real axis. theta may be complex.
    """
    E, B, C, D = opened
    left, right = solver.row(E, C, -theta), solver.reached(E, B, theta)
    terms = left * right, C[..., 0, :] * right, left * B[..., 0]
    value, forward, back = (term.sum(-1) for term in terms)
    size, *sizes = (np.abs(term).sum(-1) for term in terms)
    D = D[..., 0, 0]
    beyond = 1 - (largest * (forward + D)) * (largest * (back + D))
    parts = [largest * (part + np.abs(D)) for part in sizes]
    unsure = 1 + 2 * parts[0] * parts[1]
    if not np.iscomplexobj(theta):
        value, beyond = value.real, beyond.real
    if isinstance(solver, DelayLines):
        roundings = CAUTION + max(map(len, solver.lines), default=0)
        return _BoundaryFunctions(value, roundings * size, beyond, roundings * unsure)
    of_value, of_gain = _errors_of_form(solver, of, left, right, theta)
    roundings = CAUTION + E.shape[-1]
    of_beyond = largest * of_gain * (parts[0] + parts[1] + largest * of_gain * np.finfo(float).eps)
    return _BoundaryFunctions(value, roundings * size + of_value, beyond, roundings * unsure + of_beyond)


def _errors_of_form(form, of, left, right, theta):
    """Return how far the errors of a form may move `left right`, and `C right` as well as `left B`, in roundings of 1.

    of: the number of the loop in the form, `(panels,)`. Solves of T + X in place of T move the first to first order by
    `left X R right` and `left R X right`, R the resolvent at -theta and at theta, and the others by `left X right`. That of a
    diagonal T is 1 over the distance of the nearest eigenvalue. Schur's vectors are orthogonal, and the loop is real in its own
    states, in even units, so by the resolvent identity the size of `R right` is that of the imaginary part of `right` in these
    states, over sin(theta). On the rim, at complex theta, an order of magnitude is enough.
    """
    of_left, of_right = (np.linalg.norm(vectors, axis=-1) for vectors in (left, right))
    error = form.error[of, None] / np.finfo(float).eps
    of_gain = error * of_left * of_right
    if form.diagonal:
        apart = [np.abs(on_circle(at)[..., None] - form.frames[of]).min(-1) for at in (theta, -theta)]
        return of_gain * (1 / apart[0] + 1 / apart[1]), of_gain
    if np.iscomplexobj(theta):
        return of_gain, of_gain
    own = right @ np.swapaxes(form.V[of], -1, -2), left @ form.Z[of]
    further = [np.linalg.norm(vectors.imag, axis=-1) / np.abs(np.sin(theta)) for vectors in own]
    return error * (of_left * further[0] + further[1] * of_right), of_gain


def _collect(cut, along, fixed, span, boundary, roots):
    """Polish the crossings, drop those that overlapping arcs found twice, and add those at z = 1 and -1."""
    inside, complete = (roots.x > 0) & (roots.x < np.pi), np.ones(fixed.size, bool)
    for lost in (roots.lost, roots.overflown):
        complete[lost[0]] = False
    column, seed, jump = roots.column[inside], roots.x[inside], 2.0 * roots.slope_sign[inside]
    many, largest = None, max(map(abs, span))
    if cut.order > MANY_STATES:  # of a single column
        many, inverses = ManyStates.of(cut.at(0).E), np.zeros((0, *cut.E.shape[-2:]))
        polished = polish_of_many_states(cut.at(0), many, along, fixed[0], seed, largest)
    else:
        polished, inverses = polish(cut.at(column), along, fixed[column], seed, largest)
    theta, value, converged = polished
    astray = np.abs(theta - seed) > roots.within[inside] + 1e-9
    complete[column[~converged | astray]] = False
    order = np.lexsort((theta, column))
    column, theta, value, jump, at = (array[order] for array in (column, theta, value, jump, np.arange(column.size)))
    new = np.ones(column.size, bool)
    close_by = np.diff(theta) <= 1e-9 * np.minimum(theta[1:], np.pi - theta[1:])
    new[1:] = (np.diff(column) != 0) | ~close_by
    column, theta, value, jump, at = (array[new] for array in (column, theta, value, jump, at))
    first, last = np.full(fixed.size, np.pi), np.zeros(fixed.size)
    np.minimum.at(first, column, theta)
    np.maximum.at(last, column, theta)
    of, low, high = roots.settled  # what lies there is not known
    np.minimum.at(first, of[low > 0], low[low > 0])
    np.maximum.at(last, of[high < np.pi], high[high < np.pi])
    at_one, at_minus_one = (np.sign(boundary(a)) for a in (first / 2, (np.pi + last) / 2))
    ends, at_ends = at_both_ends(cut, np.arange(fixed.size), along, fixed, at_one, at_minus_one, many)
    complete &= ~(roots.open_low | roots.open_high)
    pairs = zip((column, value, theta, jump, at), ends, strict=True)
    column, value, theta, jump, at = (np.concatenate(pair) for pair in pairs)
    at[at.size - 2 * fixed.size :] += len(inverses)
    nothing = np.full(fixed.size, np.nan)
    return Crossings(column, value, theta, jump, at, np.concatenate([inverses, at_ends]), complete, nothing, many)
