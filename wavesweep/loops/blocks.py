"""The blocks that a spec can draw: each from its numbers and its own period, in delta form.

Numbers are scalars or arrays over a batch, real or complex. Matrices of `ss` are lists of rows of such numbers.
"""

from dataclasses import replace

import numpy as np

from wavesweep.loops.block import Block, matrix, numbers
from wavesweep.loops.device import impulse_and_step, motion
from wavesweep.loops.filters import butterworth as sections
from wavesweep.loops.wave import avatar as cut_avatar
from wavesweep.loops.wave import local_model as closed_model
from wavesweep.spec.block_types import BODIES
from wavesweep.spec.keys import AHEAD
from wavesweep.spec.words import DELTA

TERMS = 20  # of a Taylor series of a matrix whose size is at most 1/2: rounding remains
SIZE = 0.5


def mass(name, period, mass, damping=0.0, stiffness=0.0) -> Block:
    """`m x'' + d x' + k x = f` with f held over the period: exact. `f` (N) -> `x` (m), `v` (m/s)."""
    m, (d, k) = numbers(mass), (numbers(each) / numbers(mass) for each in (damping, stiffness))
    s, g, of_s, of_g = impulse_and_step(d, k, period)
    block = _block(name, ("f",), ("x", "v"), ("v", "x"), *motion(s, g, -d, -k, m), [[0, 1], [1, 0]], [[0], [0]])
    sizes = None if of_s is None else (*motion(of_s, of_g, *map(np.abs, (d, k, m))), block.C, block.D)
    at_rest = matrix([[-numbers(damping), -numbers(stiffness)], [1.0, 0.0]]), matrix([[1.0], [0.0]]), block.C, block.D
    return replace(block, terms=sizes, at_rest=at_rest, labels=(f"{name} velocity", f"{name} position"))


def inertia(name, period, inertia, damping=0.0, stiffness=0.0) -> Block:
    """A `mass` that turns: `f` (N*m) -> `x` (rad), `v` (rad/s)."""
    return mass(name, period, inertia, damping, stiffness)


def spring(name, period, k, d=0.0) -> Block:
    """`f1 = k (x2 - x1) + d (v2 - v1)` on one end, `f2 = -f1` on the other."""
    del period
    return _static(name, ("x1", "v1", "x2", "v2"), ("f1", "f2"), _of_spring(k, d))


def _of_spring(k, d):
    k, d = numbers(k), numbers(d)
    return [[-k, -d, k, d], [k, d, -k, -d]]


def ss(name, period, A, B, C, D, inputs, outputs, discrete=False, rests=None) -> Block:
    """State-space model with the ports `inputs` and `outputs`; continuous ones have their inputs held: exact.

    rests: of a discrete one, the parts of the entries of A that rounding has taken.
    """
    n, m, p = len(A), len(inputs), len(outputs)
    A, B, C, D = (_matrix(rows, shape) for rows, shape in ((A, (n, n)), (B, (n, m)), (C, (p, n)), (D, (p, m))))
    rest = 0.0 if rests is None else _matrix(rests, (n, n))
    E, G, *sizes = (A - np.eye(n) + rest, B) if discrete else held(A, B, period)
    block = _block(name, inputs, outputs, tuple(f"x{i}" for i in range(n)), E, G, C, D)
    block = block if discrete else replace(block, at_rest=(A, B, C, D))
    return replace(block, terms=(*sizes, np.abs(block.C), np.abs(block.D))) if sizes else block


def tf(name, period, num, den, discrete=False, rests=None) -> Block:
    """Transfer function from coefficients of descending powers, in controllable form; `u` -> `y`.

    A discrete one is realised in powers of z - 1, or of z + 1 if its poles are plain numbers and nearer to -1, to which its
    coefficients are taken without rounding: in powers of z, the ticks of a long frame would grow and cancel. Poles that are
    written as 0 are delays. rests: the parts of the coefficients that rounding has taken.
    Accuracy: that of the coefficients, whose roots lose digits at high orders; `butterworth` and `ss` do not.
    """
    if discrete == DELTA:
        return _tf_in_delta_form(name, num, den)
    if discrete:
        return _discrete_tf(name, num, den, *(rests or ([0.0] * len(num), [0.0] * len(den))))
    n, rows = len(den) - 1, _of_tf(num, den)
    block = ss(name, period, **rows)
    return replace(block, at_rest=(*block.at_rest[:2], _matrix([_over(num, den)[1:]], (1, n)), 0 * block.D)) if n else block


def _tf_in_delta_form(name, num, den):
    """Transfer function from coefficients of descending powers of z - 1."""
    num, den = ([numbers(each) for each in some] for some in (num, den))
    n, own, (A, B, C, D) = len(den) - 1, _over(num, den), _controllable(num, den)
    block = _block(name, ("u",), ("y",), tuple(f"x{i}" for i in range(n)), A, B, C, D)
    of_C = [[abs(b) + abs(a / den[0] * own[0]) for a, b in zip(den[1:], own[1:], strict=True)]]
    terms = np.abs(block.E), np.abs(block.B), matrix(of_C), np.abs(block.D)
    return replace(block, terms=terms, at_rest=(block.E, block.B, matrix([own[1:]]), 0 * block.D))


def _of_tf(num, den):
    """The keys of a continuous `ss` that is this transfer function."""
    A, B, C, D = _controllable([numbers(each) for each in num], [numbers(each) for each in den])
    return {"A": A, "B": B if A else [], "C": C, "D": D, "inputs": ("u",), "outputs": ("y",)}


def _over(num, den):
    """Coefficients of the numerator, as many as those of the denominator, over the first one of that."""
    return [numbers(0.0)] * (len(den) - len(num)) + [numbers(each) / numbers(den[0]) for each in num]


def _controllable(num, den):
    """Rows of A, B, C and D from coefficients of descending powers; each state but the first integrates the one before it.

    At rest the first state does not change, and y is the sum of the states times the numerator's coefficients but the first.
    """
    n, lead = len(den) - 1, den[0]
    a, b = [each / lead for each in den[1:]], _over(num, den)
    C = [[each - factor * b[0] for each, factor in zip(b[1:], a, strict=True)]]
    A = [[-factor for factor in a]] + [[1.0 if column == row else 0.0 for column in range(n)] for row in range(n - 1)]
    return A[:n], [[1.0 if row == 0 else 0.0] for row in range(n)], C, [[b[0]]]


def _discrete_tf(name, num, den, of_num, of_den):
    """`num(z)/(z^k rest(z))`: the input goes through `1/rest` and then k delays, which the last k coefficients read."""
    k = next((at for at, each in enumerate(reversed(den)) if type(each) not in (int, float) or each), 0)
    more = [0.0] * (len(den) - len(num))
    n, num, of_num = len(den) - 1 - k, [*more, *num], [*more, *of_num]
    about = -1 if _near_minus_one(den[: n + 1]) else 1
    shifted, ones = (
        [_about(at, each[: n + 1], rest[: n + 1]) for each, rest in ((num, of_num), (den, of_den))] for at in (about, 1)
    )
    A, B, C, D = _controllable(*shifted)
    A = [[each + (about - 1) * (i == j) for j, each in enumerate(row)] for i, row in enumerate(A)]
    E = [[*row, *[0.0] * k] for row in A] + [[1.0 * (i == j - 1) - (i == j) for i in range(n + k)] for j in range(n, n + k)]
    later = [numbers(each) / den[0] for each in num[n + 1 :]]
    B, C = [*B, *([1.0 * (j == 0)] for j in range(n, n + k))], [[*C[0], *later]]
    names = *(f"x{i}" for i in range(n)), *(f"u{j + 1}" for j in range(k))
    block = _block(
        name, ("u",), ("y",), names, *(_matrix(*each) for each in ((E, (n + k, n + k)), (B, (n + k, 1)), (C, (1, n + k)))), D
    )
    if not n:
        return block
    own, through = (_over(*ones)[1:], 0.0) if about == 1 else ([0.0] * n, ones[0][-1] / ones[1][-1])
    return replace(block, at_rest=(block.E, block.B, _matrix([[*own, *later]], (1, n + k)), matrix([[through]])))


def _near_minus_one(den):
    """Whether the roots are nearer to -1 than to 1 by a bound on them (Fujiwara 1916), and none is 1.

    Only plain numbers tell: the states of a loop must not change along a sweep.
    """
    if not all(type(each) in (int, float) for each in den):
        return False
    ones, minus = (np.abs(_about(at, den, [0.0] * len(den))) for at in (1, -1))
    far, near = (np.max((each[1:] / each[0]) ** (1 / np.arange(1, len(each))), initial=0.0) for each in (ones, minus))
    return near < far and ones[-1] > 0


def _about(at, coefficients, rests):
    """Coefficients of descending powers of z - at, for 1 or -1, from those of z: division by it again and again.

    rests: the parts of the coefficients that rounding has taken. Those of the sums are kept beside them (D. E. Knuth, TAOCP 2,
    4.2.2, theorem B).
    """
    if at < 0:  # p(z) = q(-z), and z + 1 = -(-z - 1)
        signs = [(-1.0) ** i for i in range(len(coefficients))][::-1]
        parts = ([sign * numbers(each) for sign, each in zip(signs, some, strict=True)] for some in (coefficients, rests))
        turned = _about(1, *parts)
        return [sign * each for sign, each in zip(signs, turned, strict=True)]
    sums, lost = [numbers(each) for each in coefficients], list(rests)
    for end in range(len(sums), 1, -1):
        for i in range(1, end):
            total = sums[i] + sums[i - 1]
            part = total - sums[i]
            lost[i] = lost[i] + lost[i - 1] + ((sums[i] - (total - part)) + (sums[i - 1] - part))
            sums[i] = total
    return [total + rest for total, rest in zip(sums, lost, strict=True)]


def gain(name, period, k=1.0) -> Block:
    """`y = k u`."""
    del period
    return _static(name, ("u",), ("y",), [[k]])


def hold(name, period) -> Block:
    """`u` as it was when the block ran last."""
    return gain(name, period)


def delay(name, period, steps=1) -> Block:
    """`u` of `steps` runs ago."""
    del period
    if steps == 0:
        return _static(name, ("u",), ("y",), [[1.0]])
    B, C = np.zeros((steps, 1)), np.zeros((1, steps))
    B[0, 0] = C[0, -1] = 1
    return _block(
        name, ("u",), ("y",), tuple(f"u{i + 1}" for i in range(steps)), np.eye(steps, k=-1) - np.eye(steps), B, C, [[0]]
    )


def mean(name, period, n) -> Block:
    """Mean of `u` in the last n runs."""
    block = delay(name, period, n - 1)
    return replace(block, C=np.full((1, n - 1), 1 / n), D=[[1 / n]])


def difference(name, period) -> Block:
    """Change of `u` since the last run, over the period: the velocity that an encoder gives."""
    block = _block(name, ("u",), ("y",), ("u1",), [[-1]], [[1]], [[-1 / numbers(period)]], [[1 / numbers(period)]])
    return replace(block, labels=(f"{name} input of the last run",))


def integrator(name, period, method="explicit") -> Block:
    """Integral of `u`: rectangles from the left, from the right, or trapezia."""
    share = AHEAD[method] * numbers(period)
    return replace(_block(name, ("u",), ("y",), ("s",), [[0]], [[period]], [[1]], [[share]]), labels=(f"{name} integral",))


def butterworth(name, period, order, cutoff_hz, passes="low") -> Block:
    """Butterworth filter by the bilinear transform with prewarping, in normal form; `u` -> `y`."""
    return sections(name, order, cutoff_hz, period, highpass=passes == "high")


def wave(name, period, b, gives="force") -> Block:
    """End of a wave line. "force": `v`, `in` -> `force` = b v - sqrt(2b) in, `out` = sqrt(2b) v - in. "velocity": `f`, `in` ->
    `v` = (sqrt(2b) in - f)/b, `out` = in - sqrt(2/b) f."""
    del period
    b = numbers(b)
    root = np.sqrt(2 * b)
    if gives == "force":
        return _static(name, ("v", "in"), ("force", "out"), [[b, -root], [root, -1.0]])
    return _static(name, ("f", "in"), ("v", "out"), [[-1 / b, root / b], [-root / b, 1.0]])


def avatar(name, period, b, integration="implicit") -> Block:
    """Decoder and avatar of a slow environment: `in`, `f` -> `v`, `x`, `x_spring` (read by the spring), `out`."""
    cut = cut_avatar(b, period, integration)
    rows = [cut.outputs.index(port) for port in ("x_dot", "x", "x_tilde", "v")]
    ports = ("in", "f"), ("v", "x", "x_spring", "out")
    block = _block(name, *ports, ("s",), cut.E, cut.B, cut.C[..., rows, :], cut.D[..., rows, :])
    E, B, C, D = cut.at_rest
    return replace(block, at_rest=(E, B, C[..., rows, :], D[..., rows, :]), labels=(f"{name} position",))


def local_model(name, period, b, K, B, integration="implicit") -> Block:
    """Local model of the interaction with its own decoder: `in` -> `out`."""
    closed = closed_model(b, K, B, period, integration)
    block = _block(name, ("in",), ("out",), ("s",), closed.E, closed.B, closed.C, closed.D)
    return replace(block, at_rest=closed.at_rest, labels=(f"{name} model position",))


def continuous(kind, keys) -> tuple[tuple[str, ...], tuple]:
    """States and matrices `x' = A x + B u`, `y = C x + D u` of a continuous block of this type."""
    if kind in BODIES:
        m = numbers(keys[BODIES[kind]])
        d, k = (numbers(keys[name]) / m for name in ("damping", "stiffness"))
        rows = [[-d, -k], [1.0, 0.0]], [[1 / m], [0.0]], [[0.0, 1.0], [1.0, 0.0]], [[0.0], [0.0]]
        return ("v", "x"), tuple(map(matrix, rows))
    if kind == "spring":
        return (), (np.zeros((0, 0)), np.zeros((0, 4)), np.zeros((2, 0)), matrix(_of_spring(**keys)))
    keys = _of_tf(keys["num"], keys["den"]) if kind == "tf" else keys
    n, m, p = len(keys["A"]), len(keys["inputs"]), len(keys["outputs"])
    shapes = (n, n), (n, m), (p, n), (p, m)
    rows = (keys[name] for name in "ABCD")
    return tuple(f"x{i}" for i in range(n)), tuple(_matrix(*each) for each in zip(rows, shapes, strict=True))


def held(A, B, period, sizes=None):
    """`exp(A T) - 1` and `int_0^T exp(A s) ds B`: a Taylor series over T/2^k, then k doublings in delta form.

    A `(..., n, n)`, B `(..., n, m)`. sizes: of the terms of the sums that the entries of A and B are. If they are given, or if
    there is something to double, two more arrays are the changes of the results by a rounding of each term of all sums, in
    roundings; otherwise they are known to a few roundings of themselves. Accuracy: some roundings of
    each entry for matrices that are not far from normal, unless they turn by much in a period.
    """
    T = numbers(period)[..., None, None]
    A, B = np.broadcast_arrays(A * T, np.zeros(1))[0], B * T
    size = (np.abs(A) if sizes is None else sizes[0] * np.abs(T)).sum(-1).max(-1, initial=0.0)
    with np.errstate(divide="ignore"):
        halvings = np.maximum(0, np.ceil(np.log2(np.minimum(size, np.finfo(float).max) / SIZE))).astype(int)
    step = 0.5 ** halvings[..., None, None]
    E, G = _series(A * step, B * step)
    if sizes is None and not halvings.any():
        return E, G
    of_E, of_G = (np.abs(E), np.abs(G)) if sizes is None else _series(*(size * np.abs(T) * step for size in sizes))
    eye = np.eye(E.shape[-1])
    with np.errstate(over="ignore", invalid="ignore"):
        for turn in range(int(halvings.max())):
            more, size, one = (turn < halvings)[..., None, None], np.abs(E), np.abs(E + eye)
            terms = 2 * np.abs(G) + size @ np.abs(G)
            of_G = np.where(more, of_E @ np.abs(G) + np.abs(E + 2 * eye) @ of_G + terms, of_G)
            of_E = np.where(more, of_E @ one + one @ of_E + 2 * size + size @ size, of_E)
            E, G = np.where(more, 2 * E + E @ E, E), np.where(more, 2 * G + E @ G, G)
    return E, G, of_E, of_G


def _series(A, B):
    """`exp(A) - 1` and `int_0^1 exp(A s) ds B` for small A."""
    E, G, power, force = 0.0, 0.0, A, B
    for term in range(1, TERMS):
        E, G = E + power, G + force
        force = power @ B / (term + 1)
        power = power @ A / (term + 1)
    return E, G


def _matrix(rows, shape):
    return matrix(rows) if all(shape) else np.zeros(shape)


def _static(name, inputs, outputs, D):
    m, p = len(inputs), len(outputs)
    return Block(name, inputs, outputs, (), np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)), matrix(D))


def _block(name, inputs, outputs, states, E, B, C, D):
    parts = (part if isinstance(part, np.ndarray) else matrix(part) for part in (E, B, C, D))
    return Block(name, tuple(inputs), tuple(outputs), tuple(states), *parts)
