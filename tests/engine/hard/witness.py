"""The right ends of the columns of `families.toml`: characteristic equations written by hand, their roots in ball arithmetic.

If the polynomial of a frame is affine in the number, `D(z) + p N(z)`, all its crossings of the unit circle are among the roots
of `D N* - D* N`, N* being the polynomial of the conjugate reciprocal roots; otherwise the range is scanned. Between crossings
the recursion of Schur and Cohn decides. Nothing of the package is used.
"""

from fractions import Fraction
from itertools import pairwise, product

from flint import acb, acb_mat, acb_poly, arb, ctx
from support.certified import Witness
from support.specs import values_of

BITS = (256, 1024, 4096)
SCANNED = 1500  # values looked at along a number in which the polynomial is not affine
Z, ONE = acb_poly([0, 1]), acb_poly([1])


class UndecidedError(Exception):
    """These bits do not tell."""


def is_stable(polynomial):
    """Whether all roots are inside the unit circle (Schur and Cohn)."""
    a = list(polynomial)
    while len(a) > 1:
        top, low = a[-1], a[0]
        if abs(low) >= abs(top):
            return False
        if not abs(low) < abs(top):
            raise UndecidedError
        scale = 1 / abs(top)
        a = [(top.conjugate() * x - low * y.conjugate()) * scale for x, y in zip(a[1:], a[-2::-1], strict=True)]
    return True


def number(value):
    """A number of a spec as a ball about its decimal digits."""
    return value if isinstance(value, acb) else arb(str(value))


def mapped(A, B, T):
    """[F G; 0 1] of a continuous model over T, exact for a held input."""
    n = A.nrows()
    rows = [[*(T * A[i, j] for j in range(n)), T * B[i]] for i in range(n)]
    return acb_mat([*rows, [0] * (n + 1)]).exp()


def mass(m, T):
    """The map of a mass over T, with states x and v."""
    return mapped(acb_mat([[0, 1], [0, 0]]), [0, 1 / number(m)], T)


def opened(step, *rows):
    """det(z - F), and C adj(z - F) G for each row C, of a map with one input."""
    n = step.nrows() - 1

    def determinant(row):
        return acb_mat(n, n, [step[i, j] + step[i, n] * row[j] for i, j in product(range(n), repeat=2)]).charpoly()

    alone = determinant([0] * n)
    return alone, *(alone - determinant(row) for row in rows)


def lifted(n, run):
    """The characteristic polynomial of what a program does to n states in a frame, from rows of their sums."""
    after = run(*(acb_mat(1, n, [int(i == j) for j in range(n)]) for i in range(n)))
    return acb_mat(n, n, [row[0, j] for row in after for j in range(n)]).charpoly()


def without(polynomial, root=1):
    """Divided by z - root, which is known to be a factor."""
    kept = [acb(0)]
    for each in list(polynomial)[::-1]:
        kept.append(each + root * kept[-1])
    assert kept[-1].contains(0)
    return acb_poly(kept[-2:0:-1])


def lag(tau, T, late):
    """(pole, newer, older, whole) of tau y' = u - y over T, u coming late by a share of T: what its last two values add."""
    whole = int(late)
    part = 1 - (late - whole)
    pole, rest = (-T / tau).exp(), (-T * part.numerator / (part.denominator * tau)).exp()
    return pole, 1 - rest, rest - pole, whole


def line(g, n):
    return [Z**n * (Z - 1) + g * ONE]


def comb(g, n, q):
    return [Z**n * (Z - 1) + g * (Z**n + number(q) * ONE)]


def repetitive(g, n, Q):
    pole = number(-0.2).exp()
    return [(Z - pole) * (Z**n - number(Q)) + g * (1 - pole) * Z**n]


def pll(g, n):
    T, b = arb("0.02") / n, arb(2).sqrt() + 1
    law = 100 / b * (Z - 1) + 10000 / b**3 * T * Z
    return [Z ** (n - 1) * (Z - 1) ** 2 + g * T / n * acb_poly([1] * n) * law]


def window(B, n, K):
    T = number(0.001)
    return [Z**n * (Z - 1) ** 2 + (T * T / 2) * (Z + 1) * (number(K) * Z**n + B / (n * T) * (Z**n - 1))]


def teleoperation(B, Td, n):
    step, frames, found = mass(0.5, number(0.001)), round(Td * 1000) // n, []

    def run(x, v, spring):
        sent = spring * x
        for _ in range(n):
            force = sent - 200 * x - B * v
            x, v = x + step[0, 1] * v + step[0, 2] * force, v + step[1, 2] * force
        return x, v

    alone = lifted(2, lambda x, v: run(x, v, 0))
    for sign in (1, -1):  # the sum of the two arms, which may be anywhere, and their difference
        whole = Z**frames * alone + lifted(2, lambda x, v, s=sign: run(x, v, 200 * s)) - alone
        found.append(without(whole) if sign == 1 else whole)
    return found


def long(g, d, n):
    pole, newer, older, whole = lag(10, arb(1), Fraction(str(d)))
    return [(Z - pole) * (Z**n - arb(0.5)) * Z ** (whole + 1) + g * number(0.2) * (newer * Z + older) * Z**n]


def late(K, d, n):
    pole, newer, older, whole = lag(1, arb(n) / 100, Fraction(str(d)) * 100 / n)
    return [(Z - pole) * Z ** (whole + 1) + K * (newer * Z + older)]


def dead(a, r, G):
    ticks = (a + number(r)) * 1000
    whole = int(float(ticks.real.mid()))
    return [Z ** (whole + 1) * (Z - 1) + number(G) / 1000 * ((1 - ticks + whole) * Z + (ticks - whole))]


def smith(pole, n, g):
    own = number(-0.1).exp()
    return [(Z - own) * (Z - pole) * Z**n + g * ((1 - own) * (Z - pole) + (1 - pole) * (Z - own) * (Z**n - 1))]


def ring(h, n):
    tau, gain = number(0.3), number(0.5)
    A = acb_mat([[-1 / tau, 0, 0], [1, 0, 0], [0, 1, 0]])
    det, speed, place = opened(mapped(A, [1 / tau, 0, 0], arb(n) / 100), [0, 1, 0], [0, 0, 1])
    behind = Z ** (20 // n) * det
    found = [without(behind + gain * speed)]  # all cars alike, which never learn where they are
    return found + [h * behind - ((turn - 1 - gain * h) * speed + gain * (turn - 1) * place) for turn in (acb(0, 1), acb(-1))]


def wave(b, B_VE, span):
    """From the equations of the controller in ball arithmetic, see `support.certified`."""
    values = values_of("pmw", b=b, delay=0, lp1_order=1, lp1_cutoff_hz=8.57, integration="explicit")
    regions = Witness(values).regions("K_VE", span, B_VE)
    return joined([(float(r.low.mid()), float(r.high.mid())) for r in regions if r.unstable == 0])


def kicks(k, d, N):
    h, d = number(0.1), number(d)

    def run(x, v):
        v = v - N * h * k * x
        for _ in range(N):
            v = (v - h * x) * (1 / (1 + h * d))
            x = x + h * v
        return x, v

    return [lifted(2, run)]


def joint(kp, ks, kd):
    ks, m, link = number(ks), number(0.1), number(0.5)
    A = acb_mat([[0, 1, 0, 0], [-ks / m, -1, ks / m, 0], [0, 0, 0, 1], [ks / link, 0, -ks / link, 0]])
    det, place, speed = opened(mapped(A, [0, 1 / m, 0, 0], number(0.001)), [1, 0, 0, 0], [0, 1, 0, 0])
    return [det + number(kd) * speed + kp * place]


def stiff(kp, fast, slow):
    A = acb_mat([[-1 / number(slow), 1 / number(slow)], [0, -1 / number(fast)]])
    det, shown = opened(mapped(A, [0, 1 / number(fast)], number(0.01)), [1, 0])
    return [Z * det + kp * shown]


def frame(K, M, kd):
    step, kd = mass(1, number(0.001)), number(kd)
    braked = [[step[i, 0], step[i, 1] - kd * step[i, 2], step[i, 2]] for i in range(2)]
    det, place = opened(acb_mat([*braked, [0, 0, 1]]) ** M, [1, 0])
    return [det + number(K) * place]


def brake(kd, M, K):
    return frame(K, M, kd)


def network(K, M, k):
    return [Z * (Z - 1) + K / 1500 * ((M - k) * Z + k * ONE)]


def clocks(kp, other):
    pole = number(-0.1).exp()

    def run(x):
        for tick in range(33):
            one = -kp * x if tick % 3 == 0 else one  # noqa: F821
            two = -number(other) * x if tick % 11 == 0 else two  # noqa: F821
            x = pole * x + (1 - pole) * (one + two)
        return (x,)

    return [lifted(1, run)]


def cascade(k, h):
    step, h = mass(10, number(h)), number(h)

    def run(x, v, i):
        slow = -20 * x
        for _ in range(5):
            i = i + h * (slow - v)
            force = k * (slow - v + 2 * i)
            x, v = x + step[0, 1] * v + step[0, 2] * force, v + step[1, 2] * force
        return x, v, i

    return [lifted(3, run)]


def within(g, k):
    return [(1 + g + number(k)) * Z**2 - (2 + g) * Z + ONE]


def pole(g, M, k):
    def run(x, last):  # what was held a frame ago
        force = -number(k) * last
        for tick in range(M):
            x = (x + force) * (1 / (1 + g))
            last = x if tick == 0 else last
        return x, last

    return [lifted(2, run)]


def sliver(eps, s, span):
    """In closed form: what is read grows by the factor 1 + s ((p - 1)^2 - eps)."""
    ends = float(1 - arb(str(eps)).sqrt()), float(1 + arb(str(eps)).sqrt())
    return [ends] if s == 1 else [(span[0], ends[0]), (ends[1], span[1])]


pair = sliver  # the product of the pair, whose sum stays 1.25, is that factor

CLOSED = {"sliver": sliver, "pair": pair, "wave": wave}
SHAPES = {"smith": (lambda p: (-number(0.01) / p).exp(), lambda x: -number(0.01) / x.log())}  # what it is affine in, and back
BREAKS = {"dead": lambda r, **_: [k / 1000 - r for k in range(10)], "pole": lambda **_: [-1.0]}  # other polynomials behind


def joined(pieces):
    """Intervals, of which those are one that touch each other."""
    found = []
    for low, high in pieces:
        found.append((found.pop()[0] if found and low == found[-1][1] else low, high))
    return found


class Column:
    """A family with its numbers, along what is swept."""

    def __init__(self, family, numbers, span):
        self.family, self.numbers, self.span = family, numbers, span
        self.into, self.back = SHAPES.get(family, (lambda p: p, lambda x: x))

    def factors(self, x):
        """The polynomials whose roots are the eigenvalues of a frame."""
        return globals()[self.family](acb(x), **self.numbers)

    def is_stable(self, p):
        """Whether the loop is stable at a value; one that no bits tell from the circle is on it."""
        for ctx.prec in BITS:
            try:
                return all(map(is_stable, self.factors(self.into(arb(p)))))
            except UndecidedError:
                continue
        return False

    def ends(self):
        """All stable intervals within the span."""
        if self.family in CLOSED:
            return CLOSED[self.family](**self.numbers, span=self.span)
        breaks = BREAKS.get(self.family, lambda **_: [])(**self.numbers)
        found = []
        for low, high in pairwise([self.span[0], *(p for p in breaks if self.span[0] < p < self.span[1]), self.span[1]]):
            points = [low, *sorted(p for p in self.crossings(low, high) if low < p < high), high]
            found += [(a, b) for a, b in pairwise(points) if b > a and self.is_stable((a + b) / 2)]
        return joined(found)

    def crossings(self, low, high):
        """Where an eigenvalue may be on the circle, or be infinite, and perhaps other values."""
        for ctx.prec in BITS:
            try:
                one, two, three = (self.into(low + (high - low) * arb(share)) for share in (0.25, 0.375, 0.75))
                parts = []
                for P, Q, R in zip(*map(self.factors, (one, two, three)), strict=True):
                    N = acb_poly([0 if c.contains(0) else c for c in (R - P) * (1 / (three - one))])
                    parts.append((P - N * one, N))
                    if not all(c.contains(0) for c in P + N * (two - one) - Q):
                        return self.scanned(low, high)
                return [p for D, N in parts for p in self.on_circle(D, N)]
            except ValueError:  # these bits do not tell roots apart
                continue
        raise UndecidedError

    def on_circle(self, D, N):
        """Those of D + p N."""
        size = D.degree() + 1
        rows = [[*each, *[acb(0)] * (size - len(list(each)))] for each in (D, N)]
        turned = [acb_poly([c.conjugate() for c in row[::-1]]) for row in rows]
        both = acb_poly([0 if c.contains(0) else c for c in D * turned[1] - turned[0] * N])
        for root in (0, 1, -1):
            while both.degree() > 0 and both(root).contains(0):
                both = without(both, root)
        roots = both.roots(tol=1e-40) if both.degree() > 0 else []
        found = [-D(z) / N(z) for z in (acb(1), acb(-1), *roots) if (abs(z) - 1).contains(0)]
        found += [] if rows[1][-1] == 0 else [-rows[0][-1] / rows[1][-1]]
        return [float(self.back(x.real).mid()) for x in found if x.is_finite()]

    def scanned(self, low, high):
        """Where the verdict changes between values that are looked at, or the sign of a polynomial at z = 1 or at z = -1."""

        def seen(p):
            signs = [float(each(z).real.mid()) > 0 for each in self.factors(self.into(arb(p))) for z in (acb(1), acb(-1))]
            return self.is_stable(p), *signs

        share = [k / SCANNED for k in range(1, SCANNED)]
        points = sorted({low + (high - low) * each for each in share + [1e-6 ** (1 - each) for each in share]})
        found = []
        for (a, one), (b, two) in pairwise((p, seen(p)) for p in points):
            for at in [k for k, (x, y) in enumerate(zip(one, two, strict=True)) if x != y]:
                left, right = a, b
                while (middle := (left + right) / 2) not in (left, right):
                    left, right = (middle, right) if seen(middle)[at] == one[at] else (left, middle)
                found.append(middle)
        return sorted(set(found))
