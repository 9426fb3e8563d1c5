"""Whether every motion comes to rest at a wall that pushes and never pulls.

Its force is u = phi(y), y = K x + B v, with any phi that has phi(0) = 0 and slopes from 0 to 1, the same in all frames. The rest
of the loop is linear. In a frame its memory eta moves with A, b, c and d, with f = y - u:

    eta+ = A eta + b u,   p+ = p + l eta + r u,   f = k p + c eta + (d - 1) u,

where p is what drifts while the wall is not touched, if anything does. There it comes to rest at q = p + w eta, w = l + w A, so

    q+ = q + R u,   R = r + w b,   f = k q + (c - k w) eta + (d - 1) u.

Theorem (Zames and Falb 1968; docs/proof.md, "A wall that pushes and never pulls", has a proof with q): let all modes of A be
inside the unit circle, k R < 0 or k = 0, and e_j, h_j >= 0 for j = 1 .. N with a sum below 1. As u rises with f, the sum of

    f_t u_t - sum of e_j f_t u_(t-j) - sum of h_j f_(t-j) u_t                                                          (1)

over all frames t is not negative. If (1) is negative for all u that turn on the unit circle, with what the loop makes of them,
then all u are square summable: forces and speeds decay, and p converges. That (1) is negative there is shown by a sum of squares:
with a symmetric P of any signs and xi = (eta_(t-N), u_(t-N), ..., u_(t-1)), xi+ the same of the next frame,

    xi' P xi - xi+' P xi+ - (1) > 0   for all (xi, u_t) but 0,                                                         (2)

as |xi| is the same in all frames of such u (Yakubovich 1962, Kalman 1963, Popov 1964). Of k q in (1) this is left,

    k R (-(1 - sum of e_j + h_j)/2 u_t^2 - sum of e_j u_t (u_t + ... + u_(t-j+1)) + sum of h_j u_t (u_(t-1) + ... + u_(t-j))),

since q_t is q_(t-j) and R times the forces in between, and q_t u_t = (q_(t+1)^2 - q_t^2)/(2 R) - R u_t^2/2.

A, b, w and R do not depend on K and B, and all else is linear in them. So what holds with one P at one end of a side, and with
another P at its other end, holds between them.

Where frames vary, the rows of a frame are those of its kind, and q would depend on the frames to come: here is no q. Let x and v
be what K and B multiply in y, read last, x less what p is now, so that f_before = K (x + p) + B v - u_before and f - f_before has
no p. As u rises with f, it is the slope of a convex function Phi >= 0 of f, with Phi(0) = 0 (Lur'e and Postnikov 1944, Jury and Lee 1965):

    u f >= 0,   u (f - f_before) >= Phi(f) - Phi(f_before),   u_before (f_before - f) >= Phi(f_before) - Phi(f).

With P_i >= 0 at the nodes of a graph of frames, zeta = (eta, x, v, u_before), h >= 0, and on each edge, from i to j, g >= 0 and a >= 0,
where g = 0 if p drifts, let

    zeta' P_i zeta - zeta+' P_j zeta+ - g f u - (h + a) u (f - f_before) - a u_before (f_before - f) > 0   for all (zeta, u) but 0.   (3)

Then zeta' P_i zeta + h Phi(f_before) >= 0 falls in each frame by more than some share of |zeta|^2 + u^2, the least of all
edges, so the sums of these are finite: zeta and u decay in any order of frames, and so does the loop without its wall, with
u = 0. Phi(f_before) converges, so the values that p comes near are an interval in which u = 0, and p converges: within it u would
be 0 from then on. By its entry of u^2 each frame has one u. Up to sums that cancel from frame to frame (3) is (2) with e_1 = a,
h_1 = h + a and g = 1 - e_1 - h_1. With the same weights it is linear in P, K and B as well.

How (3) stands in a file. The only equation with the wall's numbers gives u in place of its terms with them. u is the memory
"@force of the wall", with which a frame begins; its row in the matrix of a frame is y. What K_VE multiplies in that equation, of all
that it multiplies the sum, is written to the memory "@last read by the wall with K_VE" there; what it is more than this was before
is x or v of f less that of f_before. All rows are taken without the drifts and without "rest", whose shares follow from the
equations of the loop with K = 0 as those of a drift do. "states" are eta, x and v by their names, sorted, with "@force of the wall"
left out; a form has a row for each of them in this order, and a last one for u_before. L has a matrix at the low end of the side
that has a range, and one at its high end; one alone if no side has a range. P_i = L' L, and what is (3) at an end takes the numbers
of the wall, the matrices of frames and P_i of that end. The line has h, and each edge g and a behind its nodes; without "rest" f is
the row of y less u, and with it what g multiplies is left out. The walk over frames is that of other graphs.

Of a motion that goes on the forces u_0 .. u_(P-1) are in the file, two of them different. eta_0 is what they lead back to after P
frames, q_(t+1) = q_t + R (u_t less the mean of all), which a push makes up for, and q_0 = 0, as a constant more in f is a push. It is
proved if f_t = k q_t + (c - k w) eta_t + (d - 1) u_t does not fall in the order of u_t, and of f_t where some are the same: then a
phi with slopes from 0 to 1 goes through all points (y_t, u_t). Where frames vary "word" names the frames, of one kind.
"""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from . import form
from .balls import ONE, POINT, Cell, Number, Refused, add, ball, negative, number
from .drifts import Form, reduced
from .reader.loops import OUTPUT, Instant, Schedule

FORCE, READ, LAST = "@force of the wall", "read by the wall", "@last read by the wall with "
LAGS = 64  # N at most

Ball = tuple[int, int]
Balls = list[Ball]


def _place_of_wall(schedule: Schedule) -> tuple[object, str]:
    """The kind of instant and the signal of the only equation that has the wall's numbers."""
    places = []
    for kind, instant in (*schedule.kinds.items(), ("", schedule.motion)):
        for rows in (instant.equations, instant.writes):
            for name, terms in rows.items():
                if any(number(c).moves for c in terms.values()):
                    places.append((kind, rows is instant.equations, name))
    kind, is_equation, name = places[0] if len(places) == 1 else ("", False, "")
    if not is_equation or sum(of_time == kind for _, of_time in schedule.times) != 1:
        raise Refused("the wall's numbers are not those of one force that acts once in a frame")
    return kind, name


def _split_by_sides(c: Number, stiffness: str) -> tuple[Number, Number]:
    """Of a coefficient linear in the wall's numbers: the terms with one of these, and those with the damping alone."""
    if c.exact is None or any([power for _, power in term] not in ([], [1]) for term in c.exact):
        raise Refused("the wall's force is not linear in its numbers")
    with_sides = {term: share for term, share in c.exact.items() if term}
    of_damping = {t: share for t, share in with_sides.items() if t[0][0] != stiffness}
    return Number(with_sides), Number(of_damping)


def opened(
    schedule: Schedule, stiffness: str, *, remembers: bool = False
) -> tuple[Schedule, Schedule]:
    """The loop cut at its wall: FORCE has u as a frame begins, and y as it ends; and the same with stiffness 0, where p drifts.

    The wall's numbers are the sides: one equation has them, once in a frame, and each coefficient is linear in them. remembers:
    of what each of them multiplies, LAST has what was read last, and OUTPUT by how much more is read now.
    """
    kind, name = _place_of_wall(schedule)
    instant = schedule.kinds[kind]
    reads: dict[str, Number] = {}
    damps: dict[str, Number] = {}
    remaining: dict[str, Number] = {FORCE: number(1)}
    for name_read, factor in instant.equations[name].items():
        c = number(factor)
        reads[name_read], damps[name_read] = _split_by_sides(c, stiffness)
        remaining[name_read] = c - reads[name_read]
    writes = {**instant.writes, FORCE: {READ: 1}}
    equations = {**instant.equations, name: remaining}
    sides: list[str] = []
    if remembers:
        sides = sorted({term[0][0] for c in reads.values() for term in c.exact})
    for side in sides:
        last, risen, now = LAST + side, OUTPUT + side, f"{READ} with {side}"
        shares = {key: c.exact.get(((side, 1),), Fraction(0)) for key, c in reads.items()}
        equations[now] = {name_read: number(share) for name_read, share in shares.items() if share}
        writes |= {last: {now: 1}, risen: {now: 1, last: -1}}
    cuts = []
    for y in (reads, damps):
        cut = Instant({**equations, READ: y}, writes)
        cuts.append(replace(schedule, kinds={**schedule.kinds, kind: cut}))
    return cuts[0], cuts[1]


class Opened(NamedTuple):
    """The loop in a frame, see above. moved: A and b side by side; read: c - k w and d - 1; turns: k R, 0 if nothing drifts."""

    moved: list[Balls]
    read: Balls
    turns: Ball


def opened_at(
    cell: Cell, A, rest: Form | None, states: list[str], stiff: bool, is_held: bool
) -> Opened:
    """At a point of the sides. A: the rows of a frame; rest: p first, and what moves with it; stiff: whether K is not 0.

    is_held: whether a drift has the force 1. It keeps (A - 1) v + b = 0 with p in v, so (w, 1) b = 0: R is 0, and k q a constant, as of
    a push.
    """
    ring = cell.ring
    zero = (0, 0)
    y = A[FORCE]
    read = [y.get(name, zero) for name in (*states, FORCE)]
    read[-1] = add(read[-1], (0, -ONE))
    free = reduced(cell, A, [rest] if rest else [])
    moved = [
        [free[name].get(column_name, zero) for column_name in (*states, FORCE)] for name in states
    ]
    if not (rest and stiff):
        return Opened(moved, read, zero)
    p = next(iter(rest))
    k = _dot(cell, y, {name: share.value(cell) for name, share in rest.items()})
    *l, r = (A[p].get(name, zero) for name in (*states, FORCE))
    transposed = [
        [negative(row[column]) for row in moved] for column in range(len(states))
    ]  # 1 - A'
    for index, row in enumerate(transposed):
        row[index] = add(row[index], (0, ONE))
    w = dict(enumerate(_solved(cell, transposed, l)))
    R = add(r, _dot(cell, w, {index: row[-1] for index, row in enumerate(moved)}))
    turns = zero if is_held else ring.multiply(k, R)
    if not is_held and turns[0] + turns[1] >= 0:
        raise Refused("a force of the wall does not move the rest away from it")
    for index, share in w.items():
        read[index] = add(read[index], negative(ring.multiply(k, share)))
    return Opened(moved, read, turns)


def _dot(cell: Cell, row: dict, right: dict) -> Ball:
    total = (0, 0)
    for name in row.keys() & right.keys():
        total = add(total, cell.ring.multiply(row[name], right[name]))
    return total


def _solved(cell: Cell, rows: list[Balls], right: Balls) -> Balls:
    """The solution of rows x = right, by Gauss and Jordan."""
    ring = cell.ring
    rows = [[*row, x] for row, x in zip(rows, right, strict=True)]
    for k in range(len(rows)):
        pivot = max(range(k, len(rows)), key=lambda i: abs(rows[i][k][1]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        inverse = ring.reciprocal(rows[k][k])
        rows[k] = [ring.multiply(x, inverse) for x in rows[k]]
        for i, row in enumerate(rows):
            if i != k:
                share = negative(row[k])
                rows[i] = [
                    add(x, ring.multiply(share, y)) for x, y in zip(row, rows[k], strict=True)
                ]
    return [row[-1] for row in rows]


def left_over(loop: Opened, e: list[Fraction], h: list[Fraction], P: form.Rows) -> form.Matrix:
    """The matrix of (2) over (xi, u_t), or one with the same symmetric part. e, h: from j = 1 on; P: over xi."""
    N = len(e)
    size = len(P) + 1
    last = size - 1  # the place of u_t; u_(t-j) is j places before
    rows = [[*row, *[(0, 0)] * N] for row in loop.moved]
    rows += [_unit(index, size) for index in range(len(rows) + 1, size)]
    S = _matrix(rows)
    f = [[*loop.read, *[(0, 0)] * N]]  # f_(t-N), and then f_(t-N+1) .. f_t
    for _ in range(N):
        f += _rows(form.multiplied(_matrix([f[-1][:-1]]), S))
    with_f = [[(0, 0)] * size for _ in f]  # what they are multiplied with in (1)
    with_f[N] = _unit(last, size)
    alone = [-(1 - sum(e) - sum(h)) / 2 - sum(e)]  # of u_t u_(t-j) in what is left of k q, over k R
    for j in range(1, N + 1):
        with_f[N][last - j] = negative(ball(e[j - 1]))
        with_f[N - j][last] = negative(ball(h[j - 1]))
        alone.append(sum(h[j - 1 :]) - sum(e[j:]))
    forces = [(0, 0)] * size
    for j, share in enumerate(alone):
        forces[last - j] = POINT.ring.multiply(ball(Fraction(share)), loop.turns)
    return _falls_by(P, P, S, [*zip(with_f, f, strict=True), (_unit(last, size), forces)])


def _falls_by(
    P: form.Rows, after: form.Rows, S: form.Matrix, products: list[tuple[Balls, Balls]]
) -> form.Matrix:
    """xi' P xi - xi+' P_after xi+ less products of two rows each, over (xi, u); S: xi+ of these."""
    size = len(P) + 1
    last = size - 1
    blank = [0] * size
    now = form.Matrix({(): [*([*row, 0] for row in P), blank]}, [blank] * size)
    moved = form.multiplied(form.Matrix({(): after}, [blank[1:]] * last), S)
    total = form.minus(now, form.multiplied(form.turned(S), moved))
    first, second = zip(*products, strict=True)
    return form.minus(total, form.multiplied(form.turned(_matrix(first)), _matrix(second)))


class Sampled(NamedTuple):
    """A frame of those that vary. moved: of (eta, x, v) over these and u; rise: y less K x + B v, over them; read: y, over them,
    if nothing drifts."""

    moved: list[Balls]
    rise: Balls
    read: Balls | None


def sampled_at(
    cell: Cell, A, point: Mapping[str, Fraction], states: list[str], drifts: bool
) -> Sampled:
    """A frame at numbers of the wall. A: its rows, without what drifts."""
    columns = [*states, FORCE]
    rise = [(0, 0)] * len(columns)
    for side, value in point.items():
        row = A.get(OUTPUT + side, {})
        for place, name in enumerate(columns):
            term = cell.ring.multiply(ball(value), row.get(name, (0, 0)))
            rise[place] = add(rise[place], term)
    rows = [[A[name].get(column, (0, 0)) for column in columns] for name in (*states, FORCE)]
    return Sampled(rows[:-1], rise, None if drifts else rows[-1])


def left_over_of(
    frame: Sampled, P: form.Rows, after: form.Rows, weights: tuple[Fraction, Fraction, Fraction]
) -> form.Matrix:
    """The matrix of (3) over (eta, x, v, u_before, u). weights: h, g and a."""
    if min(weights) < 0:
        raise Refused("the weights h, g and a are not below 0")
    h, g, a = map(ball, weights)
    size = len(P) + 1

    def wide(row: Balls) -> Balls:
        return [*row[:-1], (0, 0), row[-1]]

    S = _matrix([*map(wide, frame.moved), _unit(size - 1, size)])
    rise = wide(frame.rise)
    rise[-2:] = add(rise[-2], (0, ONE)), add(rise[-1], (0, -ONE))
    forces = [(0, 0)] * (size - 2) + [negative(a), add(h, a)]
    products = [(forces, rise)]
    if frame.read:
        f = wide(frame.read)
        f[-1] = add(f[-1], (0, -ONE))
        products.append(([(0, 0)] * (size - 1) + [g], f))
    return _falls_by(P, after, S, products)


def _unit(place: int, size: int) -> Balls:
    return [(0, ONE * (index == place)) for index in range(size)]


def _matrix(rows: list[Balls]) -> form.Matrix:
    middles = [[middle for _, middle in row] for row in rows]
    return form.Matrix({(): middles}, [[radius for radius, _ in row] for row in rows])


def _rows(matrix: form.Matrix) -> list[Balls]:
    pairs = zip(matrix.error, matrix.parts[()], strict=True)
    return [list(zip(*pair, strict=True)) for pair in pairs]


def stable(loop: Opened, P: form.Matrix) -> bool:
    """Whether all modes of A are inside the unit circle: a form P > 0 decreases."""
    A = _matrix([row[:-1] for row in loop.moved])
    return not loop.moved or form.decreases(P, [(None, A, P)])


def goes_on(loop: Opened, u: list[Fraction]) -> bool:
    """Whether forces that repeat are those of a wall of the kind: in their order, y rises by as much as u or more.

    Up to constants, which a push adds: eta_0 = eta_P solves (1 - A^P) eta_0 = what u_0 .. u_(P-1) make of no memory, and q changes
    by R times u less its mean.
    """
    ring = POINT.ring
    forces = [ball(x) for x in u]
    n = len(loop.moved)
    size = range(n)
    states = [[(0, ONE * (i == j)) for j in size] for i in size] + [[(0, 0)] * n]  # as columns
    for force in forces:
        states = [
            _moved(loop, column, force if index == n else (0, 0))
            for index, column in enumerate(states)
        ]
    difference = [[add((0, ONE * (i == j)), negative(states[j][i])) for j in size] for i in size]
    eta = _solved(POINT, difference, states[n])
    turned = (0, 0)
    points = []
    for x, force in zip(u, forces, strict=True):
        f = _dot(POINT, dict(enumerate(loop.read)), dict(enumerate([*eta, force])))
        points.append((add(f, turned), x))
        eta = _moved(loop, eta, force)
        turned = add(turned, ring.multiply(loop.turns, ball(x - sum(u) / len(u))))
    points.sort(key=lambda point: (point[1], point[0][1]))
    steps = [add(f, negative(before)) for (before, _), (f, _) in pairwise(points)]
    return len(set(u)) > 1 and all(middle >= radius for radius, middle in steps)


def _moved(loop: Opened, eta: Balls, force: Ball) -> Balls:
    whole = dict(enumerate([*eta, force]))
    return [_dot(POINT, dict(enumerate(row)), whole) for row in loop.moved]
