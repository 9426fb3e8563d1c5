"""Stable intervals along the wall in ball arithmetic: every crossing isolated, every count proved."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import pi

from flint import acb, arb, arb_poly, ctx

from support import balls

PRECISIONS = (512, 1024, 2048, 4096, 8192)


class Undecided(Exception):
    """These bits do not tell."""


@dataclass(frozen=True)
class Region:
    """A part of the span between crossings: ends and angles as floats (angle None at an end of the span), its count of
    eigenvalues outside the circle."""

    low: arb
    high: arb
    low_theta: float | None
    high_theta: float | None
    unstable: int


class Witness:
    """One loop's certified answers; compiled at as many bits as a question needs, and kept."""

    def __init__(self, values, precisions=PRECISIONS):
        self.values, self.frames, self.level, self.precisions = values, {}, 0, precisions

    def ask(self, question):
        """`question(compiled frame)` at the first precision that decides it; Undecided where none does."""
        while True:
            ctx.prec = self.precisions[self.level]
            if self.level not in self.frames:
                self.frames[self.level] = Compiled(self.values)
            try:
                return question(self.frames[self.level])
            except Undecided:
                if self.level + 1 == len(self.precisions):
                    raise
                self.level += 1

    def regions(self, along, span, fixed):
        """All regions of one column."""
        return self.ask(lambda compiled: compiled.regions(along, span, fixed))

    def unstable(self, K, B):
        """How many eigenvalues lie outside the circle, drift set aside (1 where there are some, and how many is hard)."""
        along, fixed, value = ("K_VE", B, K) if K != 0 else ("B_VE", K, B)
        return self.regions(along, (value, value), fixed)[0].unstable


class Compiled:
    """A frame at one precision, and its polynomials once they are asked for."""

    def __init__(self, values):
        self.values, self.frame, self.polynomials = values, balls.frame(values), None

    def regions(self, along, span, fixed):
        """All regions of one column."""
        if self.hopeless(along, span, fixed):
            return [Region(*map(arb, span), None, None, 1)]
        if self.polynomials is None:
            self.polynomials = self.frame.polynomials()
        shape = structure(self.values, along, fixed == 0)
        p, q = (divided(r, 1, shape.common) for r in open_wall(self.polynomials, along, fixed))
        return _regions(p, q, shape, span)

    def hopeless(self, along, span, fixed):
        """Whether the eigenvalues' sum exceeds their number all over the span: a quotient of linear functions, it is
        monotonic where its denominator keeps its sign."""
        ends = [self.frame.trace(*((end, fixed) if along == "K_VE" else (fixed, end))) for end in span]
        (a, s), (b, t) = ends
        n = self.frame.size
        return bool(s * t > 0 and abs(a) > n * abs(s) and abs(b) > n * abs(t) and a * s * b * t > 0)


def open_wall(polynomials, along, fixed):
    """(p, q) of the characteristic polynomial `p - value q`."""
    d, N_x, N_v = polynomials
    return (d - N_v * arb(fixed), N_x) if along == "K_VE" else (d - N_x * arb(fixed), N_v)


@dataclass(frozen=True)
class Structure:
    """What vanishes whatever the numbers are: how often z = 1 is a root of p and q both (drift); whether q vanishes at 1
    and at -1 then; how often the boundary polynomial vanishes at each."""

    common: int
    q_at_one: bool
    q_at_minus_one: bool
    boundary_at_one: int
    boundary_at_minus_one: int


ZEROS = (
    "device.damping",
    "operator.damping",
    "operator.stiffness",
    "environment.K_VE",
    "controller.Kp",
    "local_model.K_LM",
    "local_model.B_LM",
)


def structure(values, along, fixed_is_zero):
    """Structure of all loops that are drawn alike, from one of them with tame numbers."""
    tame = {
        key: value if isinstance(value, str) or key.endswith("order") else TAME.get(key, value) for key, value in values.items()
    }
    tame |= {key: TAME[key] if values[key] else 0.0 for key in ZEROS}
    ratio, delay = values["rates.ratio"], values["environment.delay"]
    if ratio > MOST_TICKS:  # few enough to be quick, a delay that is no special part of the frame left so
        special = {0: 0, ratio: MOST_TICKS, ratio / 2: MOST_TICKS // 2}
        tame |= {"rates.ratio": MOST_TICKS, "environment.delay": special.get(delay, 7)}
    return _structure(tuple(sorted(tame.items())), along, fixed_is_zero)


MOST_TICKS = 40
TAME = {
    "rates.fast_hz": 1000.0, "device.mass": 0.3, "device.damping": 1.7, "operator.mass": 0.1, "operator.damping": 0.6,
    "operator.stiffness": 70.0, "environment.K_VE": 40.0, "environment.B_VE": 1.3, "controller.b": 21.0, "controller.Kp": 3.0,
    "filters.lp1.cutoff_hz": 83.0, "filters.hp.cutoff_hz": 61.0, "filters.lp2.cutoff_hz": 97.0,
    "local_model.K_LM": 130.0, "local_model.B_LM": 0.7,
}  # fmt: skip


@cache
def _structure(items, along, fixed_is_zero):
    before, ctx.prec = ctx.prec, 2000
    try:
        p, q = open_wall(balls.frame(dict(items)).polynomials(), along, 0.0 if fixed_is_zero else 2.5)
        common = 0
        while _vanishes(p, 1) and _vanishes(q, 1):
            p, q, common = divided(p, 1, 1), divided(q, 1, 1), common + 1
        P, often = boundary(p, q), []
        for x in (1, -1):
            often.append(0)
            while _vanishes(P, x):
                P, often[-1] = divided(P, x, 1), often[-1] + 1
        return Structure(common, _vanishes(q, 1), _vanishes(q, -1), *often)
    finally:
        ctx.prec = before


def _vanishes(p, x):
    """Whether p(x) = 0, nothing being left of it at half the bits."""
    value, size = p(arb(x)), sum((abs(c) for c in p.coeffs()), arb(0))
    assert not value.contains(0) or value.rad() < size * arb(2) ** (-ctx.prec // 2)
    return value.contains(0)


def divided(p, x, times):
    """`p / (z - x)^times`, by Horner, where the remainder is known to be 0."""
    for _ in range(times):
        carried, out = arb(0), []
        first, *rest = p.coeffs()
        for c in reversed(rest):
            carried = carried * x + c
            out.append(carried)
        assert (carried * x + first).contains(0)
        p = arb_poly(out[::-1])
    return p


def count_outside(p):
    """Roots of p outside the unit circle, by Schur and Cohn's recursion."""
    outside = 0
    while p.degree() > 0:
        coefficients = p.coeffs()
        first, last = coefficients[0], coefficients[-1]
        turned = arb_poly(coefficients[::-1])
        if abs(first) < abs(last):
            p = arb_poly((p * last - turned * first).coeffs()[1:])
            p = arb_poly(p.coeffs()[: len(coefficients) - 1])
        elif abs(first) > abs(last):
            p, outside = arb_poly((p * first - turned * last).coeffs()[: len(coefficients) - 1]), outside + 1
        else:
            raise Undecided
        scale = max(abs(c).upper() for c in p.coeffs())
        if not scale.is_finite():
            raise Undecided
        p = p * (1 / scale)
    return outside


def boundary(p, q):
    """`Im[p conj(q)] / sin(theta)` on the circle as a polynomial in cos(theta)."""
    n = max(p.degree(), q.degree())
    a, b = ([*r.coeffs(), *[arb(0)] * (n + 1 - len(r.coeffs()))] for r in (p, q))
    product = (arb_poly(a) * arb_poly(b[::-1])).coeffs()
    product += [arb(0)] * (2 * n + 1 - len(product))
    total, before, now = arb_poly([0]), arb_poly([0]), arb_poly([1])
    for k in range(1, n + 1):
        total = total + now * (product[n + k] - product[n - k])
        before, now = now, arb_poly([0, 2]) * now - before
    return total


def _sign(value):
    if value > 0:
        return 1
    if value < 0:
        return -1
    raise Undecided


def real_roots(P):
    """Roots in (-1, 1), each in a small ball: Descartes' rule of signs on parts, cut until it says 0 or 1."""
    work, found = [(arb(-1), arb(1), 0)], []
    while work:
        low, high, depth = work.pop()
        most, least = _variations(P, low, high)
        if most == 0:
            continue
        if most == least == 1:
            found.append(_refined(P, low, high))
            continue
        if depth > 300:
            raise Undecided
        middle = (low + (high - low) * (arb(125 + depth % 7) / 256)).mid()
        _sign(P(middle))
        work += [(low, middle, depth + 1), (middle, high, depth + 1)]
    return found


def _variations(P, low, high):
    """Largest and least number of sign changes of P on (low, high) after the map from (0, infinity)."""
    moved = P(arb_poly([low, high - low])).coeffs()
    moved += [arb(0)] * (P.degree() + 1 - len(moved))
    signs = [(c > 0) - (c < 0) for c in arb_poly(moved[::-1])(arb_poly([1, 1])).coeffs()]
    if not signs[0] or not signs[-1]:
        raise Undecided
    sure = [s for s in signs if s]
    least = sum(a != b for a, b in pairwise(sure))
    unsure = len(signs) - len(sure)
    return least + 2 * unsure, least


def _refined(P, low, high):
    """The one root in (low, high), by interval Newton steps and halving, to a quarter of the bits."""
    slope, at_low = P.derivative(), _sign(P(low))
    for _ in range(4 * ctx.prec):
        room = min((1 - high).lower(), (1 + low).lower())
        room = room if room > 0 else (high - low).lower()
        if high - low < room * arb(2) ** (-ctx.prec // 4):
            break
        whole = low.union(high)
        middle, steep = whole.mid(), slope(whole)
        if not steep.contains(0):
            step = middle - P(middle) / steep
            new_low, new_high = max(low, step.lower().mid()), min(high, step.upper().mid())
            if new_high - new_low < (high - low) / 2:
                low, high = new_low, new_high
                continue
        value = P(middle)
        if value.contains(0):
            break
        low, high = (middle, high) if _sign(value) == at_low else (low, middle)
    return low.union(high)


def _crossings(p, q, shape):
    """(value, angle) of every crossing."""
    found, P = [], divided(divided(boundary(p, q), 1, shape.boundary_at_one), -1, shape.boundary_at_minus_one)
    for x in real_roots(P):
        z = acb(x, (1 - x * x).sqrt())
        below = q(z)
        value = (p(z) / below).real if not below.contains(0) else None
        if value is None or not value.is_finite():
            raise Undecided
        found.append((value, float((2 * ((1 - x) / 2).sqrt().asin()).mid())))
    for x, angle, nowhere in ((1, 0.0, shape.q_at_one), (-1, pi, shape.q_at_minus_one)):
        if nowhere:
            assert q(arb(x)).contains(0)
        else:
            found.append((p(arb(x)) / q(arb(x)), angle))
    return found


def _regions(p, q, shape, span):
    low, high = map(arb, span)
    found = _crossings(p, q, shape) if low != high else []
    inside = [(value, angle) for value, angle in found if _is_inside(value, low, high)]
    inside.sort(key=lambda pair: pair[0].mid())
    for (a, _), (b, _) in pairwise(inside):
        if not a < b:
            raise Undecided
    at_low = next((angle for value, angle in found if value.contains(low)), None)  # K_VE = 0 at z = 1, by structure
    ends = [(low, at_low), *inside, (high, None)]
    parts = [Region(a, b, s, t, count_outside(p - q * ((a + b) / 2).mid())) for (a, s), (b, t) in pairwise(ends)]
    for one, other in pairwise(parts):  # the witness before itself: 1 at z = 1 and -1, else 2
        if abs(one.unstable - other.unstable) != (1 if other.low_theta in {0.0, pi} else 2):
            raise Undecided
    return parts


def _is_inside(value, low, high):
    """Whether the crossing is inside the span; K_VE = 0 at z = 1 is an end of it by structure."""
    if not value.is_finite():
        raise Undecided
    if value.contains(low) or value.contains(high):
        if value.rad() > arb(2) ** (-ctx.prec // 4) * max(high - low, abs(high)):
            raise Undecided
        return False
    return bool(low < value < high)
