"""The reference numbers of `python benchmarks/bench`, at 50 digits; run it to make `benchmarks/bench/references.json` again.

    python benchmarks/references.py

Stable intervals: the model's tick is written down at 50 digits (`support.exact`), multiplied up to a frame, and its
transfer functions are turned into polynomials. A crossing is a real root of one of these, counted by Sturm's sequence
and bisected to the last digit; between the crossings the unstable eigenvalues are counted by Schur and Cohn's recursion
on the closed loop's polynomial. Nothing of the package but the reading of the specs takes part.
"""

from __future__ import annotations

import json
import sys
from itertools import pairwise, product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # the witnesses are those of the tests
from support.exact import frame, limit, mp, number, response

from bench import accuracy
from bench.frequency_responses import problem as response_problem
from bench.problems import COLUMNS, FILE, PROBLEMS, digest

DIGITS = 60
NOTHING = mp.mpf(10) ** -40  # relative to the largest coefficient: structural zeros are smaller, all others larger


def value(poly, x):
    """A polynomial by Horner's rule; coefficients from the highest power on."""
    out = mp.mpf(0)
    for a in poly:
        out = out * x + a
    return out


def interpolated(samples, radius):
    """Coefficients, highest first, of the polynomial with these values at `radius exp(2 pi j k/n)`; real by symmetry."""
    n = len(samples)
    low_first = [
        (mp.fsum(s * mp.expjpi(mp.mpf(-2 * k * i) / n) for k, s in enumerate(samples)) / n / radius**i).real for i in range(n)
    ]
    return low_first[::-1]


def polynomials(whole):
    """`(d, N_x, N_v)`: `G_x = N_x/d` and `G_v = N_v/d` of the loop cut at the wall, of equal length."""
    n, radius = len(whole.B), mp.mpf(3) / 2
    points = [radius * mp.expjpi(mp.mpf(2 * k) / (n + 1)) for k in range(n + 1)]
    rows = []
    for z in points:
        d = mp.det(mp.matrix([[z * (i == j) - whole.A[i, j] for j in range(n)] for i in range(n)]))
        G_x, G_v = whole.transfer(z)
        rows.append((d, d * G_x, d * G_v))
    # What nothing reads drifts by itself: a root at 1 that all three have.
    return without_shared([interpolated(part, radius) for part in zip(*rows, strict=True)], mp.mpf(1))


def without_shared(polys, root, times=12):
    """Divide a common root out of all polynomials, as often as all have it."""
    for _ in range(times):
        if any(abs(value(p, root)) > NOTHING * max(map(abs, p)) for p in polys):
            return polys
        polys = [_divided(p, root) for p in polys]
    return polys


def _divided(p, root):
    out = []
    for a in p[:-1]:
        out.append(a + (root * out[-1] if out else 0))
    return out


def crossing_polynomial(one, solved):
    """Coefficients c_1..c_n of `Im[one conj(solved)] = sum c_k sin(k theta)`, as powers of cos(theta), highest first."""
    low_one, low_solved = one[::-1], solved[::-1]
    c = [mp.mpf(0)] * len(one)
    for (i, a), (j, b) in product(enumerate(low_one), enumerate(low_solved)):
        if i != j:
            c[abs(i - j)] += a * b * (1 if i > j else -1)
    powers, before, now = [mp.mpf(0)] * len(c), [mp.mpf(0)], [mp.mpf(1)]
    for coefficient in c[1:]:
        for k, a in enumerate(now):
            powers[k] += coefficient * a
        longer = [mp.mpf(0), *(2 * a for a in now)]
        before, now = now, [a - (before[k] if k < len(before) else 0) for k, a in enumerate(longer)]
    return trimmed(powers[::-1])


def trimmed(poly):
    """Without leading zeros."""
    size = max(map(abs, poly))
    start = next((i for i, a in enumerate(poly) if abs(a) > NOTHING * size), len(poly))
    return poly[start:]


def sturm(poly):
    """Sturm's sequence."""
    n = len(poly) - 1
    links = [poly, [a * (n - i) for i, a in enumerate(poly[:-1])]]
    while len(links[-1]) > 1:
        rest, divisor = list(links[-2]), links[-1]
        size = max(map(abs, rest))
        for _ in range(len(rest) - len(divisor) + 1):
            factor = rest[0] / divisor[0]
            rest = [a - factor * (divisor[i] if i < len(divisor) else 0) for i, a in enumerate(rest)][1:]
        top = next((i for i, a in enumerate(rest) if abs(a) > NOTHING * size), None)
        if top is None:  # repeated factors: the sequence ends with them, and counts distinct roots
            break
        scale = max(map(abs, rest))
        links.append([-a / scale for a in rest[top:]])
    return links


def changes(links, x):
    """Changes of sign along the sequence."""
    signs = [v > 0 for link in links if (v := value(link, x)) != 0]
    return sum(a != b for a, b in pairwise(signs))


def real_roots(poly):
    """All real roots in (-1, 1), each to the last digit."""
    links, found = sturm(poly), []
    edge = mp.mpf(10) ** -20
    open_ = [(-1 + edge, 1 - edge)]
    while open_:
        low, high = open_.pop()
        there = changes(links, low) - changes(links, high)
        if there == 1:
            found.append(_bisected(poly, low, high) if value(poly, low) * value(poly, high) < 0 else None)
        elif there > 1:
            middle = low + (high - low) * mp.mpf("0.4871")
            open_ += [(low, middle), (middle, high)]
    if None in found:
        raise ValueError("a root that does not change the sign: the loops of this file have none")
    return sorted(found)


def _bisected(poly, low, high):
    below = value(poly, low) > 0
    for _ in range(mp.prec + 10):
        middle = (low + high) / 2
        low, high = (middle, high) if (value(poly, middle) > 0) == below else (low, middle)
    return (low + high) / 2


def unstable(poly):
    """Roots outside the unit circle; those at exactly 1, drift, are divided out before."""
    (poly,) = without_shared([trimmed(poly)], mp.mpf(1))
    return outside(poly)


def outside(poly):
    """The same, by Schur and Cohn's recursion: `lead p - last p*` has as many roots inside as p where |lead| > |last|."""
    while len(poly) > 1:
        lead, last = poly[0], poly[-1]
        if abs(last) > abs(lead):  # turned round, the roots outside become those inside
            return len(poly) - 1 - outside(poly[::-1])
        poly = [lead * a - last * b for a, b in zip(poly[:-1], poly[:0:-1], strict=True)]
        size = max(map(abs, poly))
        poly = [a / size for a in poly]
    return 0


def stable_intervals(polys, along, other, span):
    """Stable intervals of `along` within span, the other wall parameter given: pairs of doubles."""
    d, N_x, N_v = polys
    solved, fixed = (N_x, N_v) if along == "K_VE" else (N_v, N_x)
    one = [a - number(other) * b for a, b in zip(d, fixed, strict=True)]
    cosines = real_roots(crossing_polynomial(one, solved))
    points = [mp.mpc(x, mp.sqrt(1 - x * x)) for x in cosines]
    ends = [(value(one, z) / value(solved, z)).real for z in points]
    ends += [value(one, z) / value(solved, z) for z in (mp.mpf(1), mp.mpf(-1)) if value(solved, z) != 0]
    low, high = (number(end) for end in span)
    marks = [low, *sorted(end for end in ends if low < end < high), high]
    stable = [unstable([a - (a_ + b_) / 2 * b for a, b in zip(one, solved, strict=True)]) == 0 for a_, b_ in pairwise(marks)]
    runs = []
    for (a, b), good in zip(pairwise(marks), stable, strict=True):
        if good and runs and runs[-1][1] == a:
            runs[-1][1] = b
        elif good:
            runs.append([a, b])
    return [[float(a), float(b)] for a, b in runs]


def columns_of(problem, wanted=None):
    """The intervals of every column of a problem (or of those wanted), in the order of its table."""
    spec = problem.ask(max(COLUMNS))
    axes = [axis for axis in spec.sweep if axis.name != "K_VE"]
    known, out = {}, {}
    for index, combination in enumerate(product(*(axis.values for axis in axes))):
        if wanted is not None and index not in wanted:
            continue
        values = {**spec.values, **{axis.path: v for axis, v in zip(axes, combination, strict=True)}}
        loop = tuple((k, v) for k, v in values.items() if k != "environment.B_VE")
        with mp.workdps(DIGITS):
            if loop not in known:
                known[loop] = polynomials(frame(values))
            out[index] = stable_intervals(known[loop], "K_VE", values["environment.B_VE"], (0.0, problem.stop))
    return out


def ends_of(case):
    """The intervals of a hard case."""
    values = case.values()
    other = values["environment.B_VE" if case.along == "K_VE" else "environment.K_VE"]
    with mp.workdps(DIGITS):
        return stable_intervals(polynomials(frame(values)), case.along, other, case.span)


def respond(values, frequencies):
    """`[[Re Y, Im Y, Re Z, Im Z], ...]`; multiples of the slow rate by their limit."""
    slow = values["rates.fast_hz"] / values["rates.ratio"]
    found = []
    for hz in frequencies:
        at = limit if hz % slow == 0 else response
        Y, Z = at(values, hz)
        found.append([float(part) for part in (Y.real, Y.imag, Z.real, Z.imag)])
    return found


def main():
    """Write the file."""
    out = {"how": "benchmarks/references.py, 50 digits and more, rounded to double", "intervals": {}}
    for problem in PROBLEMS:
        found = columns_of(problem)
        out["intervals"][problem.name] = {"digest": digest(problem.ask(max(COLUMNS))), "columns": list(found.values())}
    out["hard_ends"] = [ends_of(case) for case in accuracy.ENDS]
    out["hard_responses"] = [respond(case.values(), [case.frequency_hz]) for case in accuracy.RESPONSES]
    asked = response_problem()
    values = {str(size): respond(asked.spec.values, asked.checked(size)) for size in asked.sizes}
    out["responses"] = {"digest": digest(asked.spec), "values": values}
    FILE.write_text(json.dumps(out, separators=(",", ":")).replace("],[[", "],\n[[") + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
