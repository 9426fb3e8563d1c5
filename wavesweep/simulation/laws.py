"""What each type of block does when it runs, as sums of products of its inputs and states.

The equations are written here a second time, from the blocks' meaning and with realisations of
their own: one-pole sections for filters, direct forms for transfer functions, the exponential of
each continuous model. So an error in a block or in a frame shows as a difference between two
programs.
"""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from wavesweep.engine.drawing import TYPES
from wavesweep.simulation.body import exponential_minus_one, zero_order_hold

Sum = tuple[tuple[float, str], ...]
"""A sum of products: the factor and the name of each term."""


class Law(NamedTuple):
    """What a block does when it runs; names are its ports, its states and numbers in between.

    gives: outputs and numbers in between as sums of inputs, states and each other. keeps: the
    states afterwards, from all numbers as they were before. moves: rows of states; the first takes
    the value of the name, each other one that of the one before it. limits: low and high of numbers
    that end there. stops: states that keep their value while a number is beyond its limit and would
    be driven on: (the number before the limit, behind it, and what drives it).
    """

    gives: Mapping[str, Sum]
    keeps: Mapping[str, Sum] = MappingProxyType({})
    moves: tuple[tuple[str, tuple[str, ...]], ...] = ()
    limits: Mapping[str, tuple[float, float]] = MappingProxyType({})
    stops: Mapping[str, tuple[str, str, str]] = MappingProxyType({})


def mass(period: float, mass: float, damping: float, stiffness: float) -> Law:
    """`m x'' + d x' + k x = f` under a force (N) that is held over the period: exact."""
    a, b, c, d, e, g = zero_order_hold(mass, damping, stiffness, period).tolist()
    places = {"x": ((1.0, "position"),), "v": ((1.0, "velocity"),)}
    moved = {"position": ((a, "position"), (b, "velocity"), (c, "f"), (1.0, "position"))}
    return Law(
        places,
        moved | {"velocity": ((d, "position"), (e, "velocity"), (g, "f"), (1.0, "velocity"))},
    )


def inertia(period: float, inertia: float, damping: float, stiffness: float) -> Law:
    """A mass that turns."""
    return mass(period, inertia, damping, stiffness)


def mass_matrix(period: float, axes: Sequence[str], **keys) -> Law:
    """`M a + D v + K x = f` under forces that are held over the period: exact."""
    forces, velocities = ([f"{port}{name}" for name in axes] for port in "fv")
    matrices = (matrix.tolist() for matrix in _of_axes(axes, **keys))
    return ss(period, *matrices, forces, [*axes, *velocities], discrete=False)


class LawMatrices(NamedTuple):
    """A, B, C and D of a continuous block: rows of numbers, or arrays."""

    A: Sequence
    B: Sequence
    C: Sequence
    D: Sequence


def _of_axes(axes, mass, damping, stiffness, through):
    n, axes_at_port = len(axes), np.array(through) if through else np.eye(len(axes))

    def at_axes(rows):
        if rows:
            matrix = np.array(rows)
        else:
            matrix = np.zeros((len(axes_at_port), len(axes_at_port)))
        return (
            axes_at_port.T
            @ (np.diag(matrix[0]) if len(matrix) < len(axes_at_port) else matrix)
            @ axes_at_port
        )

    slowed = np.linalg.solve(
        at_axes(mass), np.hstack([-at_axes(stiffness), -at_axes(damping), np.eye(n)])
    )
    still = np.zeros((n, n))
    return LawMatrices(
        np.vstack([np.hstack([still, np.eye(n)]), slowed[:, : 2 * n]]),
        np.vstack([still, slowed[:, 2 * n :]]),
        np.eye(2 * n),
        np.zeros((2 * n, n)),
    )


def spring(period: float, k: float, d: float) -> Law:
    """A spring and a damper between two ends, which they pull towards each other."""
    del period
    pull = ((k, "x2"), (-k, "x1"), (d, "v2"), (-d, "v1"))
    return Law({"f1": pull, "f2": tuple((-gain, name) for gain, name in pull)})


def ss(
    period: float, A, B, C, D, inputs: Sequence[str], outputs: Sequence[str], *, discrete: bool
) -> Law:
    """State-space model, rows of numbers; the inputs of a continuous one are held over the
    period: exact."""
    n = len(A)
    names = [*(f"state {i}" for i in range(n)), *inputs]
    D = D or [[0.0] * len(inputs) for _ in outputs]
    changes = [[*row, *pushed] for row, pushed in zip(A, B, strict=True)]
    if not discrete and n:
        matrix = np.zeros((len(names), len(names)))
        matrix[:n] = changes
        changes = exponential_minus_one(matrix * period)[:n].tolist()
    keeps = {}
    for name, row in zip(names, changes, strict=False):
        keeps[name] = _sum(row, names)
        if not discrete:
            keeps[name] += ((1.0, name),)
    gives = {}
    for name, by_states, by_inputs in zip(outputs, C or [[]] * len(D), D, strict=True):
        gives[name] = _sum([*by_states, *by_inputs], names)
    return Law(gives, keeps)


def _numbered(members, side):
    """The numbers of all input ports (side -2) or output ports (-1) of the members, by their
    names."""
    ports = [f"{member[0]}.{port}" for member in members for port in member[side]]
    return {port: i for i, port in enumerate(ports)}


def continuous(
    period: float,
    members,
    gains: Mapping[tuple[str, str], float],
    inputs,
    outputs,
    arriving=(),
    sensed=(),
) -> Law:
    """Blocks whose inputs are sums of their outputs at every instant, and of inputs from outside
    that are held: exact.

    members: name, type, keys, input and output ports of each. gains: of a port and an output.
    inputs, outputs: port -> its name in the law. arriving: port, name in the law and instant (share
    of the period) of what is added to inputs within the tick. sensed: output, name in the law and
    instant of what is read within it.
    """
    models = [_matrices(kind, keys, len(into), len(out)) for _, kind, keys, into, out in members]
    A, B, C, D = (_along_diagonal(blocks) for blocks in zip(*models, strict=True))
    ports = _numbered(members, -2)
    shown = _numbered(members, -1)
    order = len(A)
    K = np.zeros((len(ports), len(shown)))
    for (port, name), gain in gains.items():
        K[ports[port], shown[name]] = gain
    # All outputs of states and inputs from outside.
    through = np.linalg.solve(np.eye(len(shown)) - D @ K, np.hstack([C, D]))
    moved = np.hstack([A, B]) + B @ K @ through
    through = through[[shown[name] for name in outputs]]
    into = [order + ports[name] for name in inputs]
    matrices = LawMatrices(moved[:, :order], moved[:, into], through[:, :order], through[:, into])
    names = [*inputs.values()], [*outputs.values()]
    if not (arriving or sensed):
        return ss(period, *(matrix.tolist() for matrix in matrices), *names, discrete=False)
    arrivals = [(list(inputs).index(port), name, instant) for port, name, instant in arriving]
    read = [(list(outputs).index(signal), name, instant) for signal, name, instant in sensed]
    return _within_tick(period, matrices, *names, arrivals, read)


def _along_diagonal(blocks) -> np.ndarray:
    """A matrix that has these along its diagonal, and is 0 elsewhere."""
    ends = np.cumsum([block.shape for block in blocks], axis=0)
    diagonal = np.zeros(ends[-1])
    for block, (below, right) in zip(blocks, ends, strict=True):
        rows, columns = block.shape
        diagonal[below - rows : below, right - columns : right] = block
    return diagonal


def _within_tick(period, matrices: LawMatrices, inputs, outputs, arriving, sensed) -> Law:
    """A continuous model from instant to instant of a tick; arriving, sensed: see `continuous`,
    with indices of ports."""
    A, B, C, D = matrices
    order = len(A)
    names = [f"state {i}" for i in range(order)]
    names += [*inputs, *(name for _, name, _ in arriving)]
    # The state and the inputs at an instant, of those at the tick.
    state = np.eye(order, len(names))
    pushed = np.eye(len(inputs), len(names), order)
    now = 0.0
    shown = {name: C[i] @ state + D[i] @ pushed for i, name in enumerate(outputs)}
    events = [
        (instant, 0, port, order + len(inputs) + k) for k, (port, _, instant) in enumerate(arriving)
    ]
    events += [(instant, 1, row, name) for row, name, instant in sensed]
    generator = np.block([[A, B], [np.zeros((len(inputs), order + len(inputs)))]])
    for instant, kind, port, place in (*sorted(events), (1.0, 2, 0, 0)):
        change = exponential_minus_one(generator * ((instant - now) * period))[:order]
        state = state + change @ np.vstack([state, pushed])
        now = instant
        if kind == 0:
            pushed[port, place] += 1.0
        elif kind == 1:
            shown[place] = C[port] @ state + D[port] @ pushed
    gives = {name: _sum(row.tolist(), names) for name, row in shown.items()}
    keeps = {name: _sum(row.tolist(), names) for name, row in zip(names, state, strict=False)}
    return Law(gives, keeps)


def _matrices(kind, keys, inputs, outputs):
    """A, B, C and D of a continuous block with so many ports."""
    if TYPES[kind].body:
        m, d, k = keys.values()
        rows = (
            [[0.0, 1.0], [-k / m, -d / m]],
            [[0.0], [1 / m]],
            [[1.0, 0.0], [0.0, 1.0]],
            [[0.0], [0.0]],
        )
    elif kind == "mass_matrix":
        rows = _of_axes(**keys)
    elif kind == "spring":
        pull = [-keys["k"], -keys["d"], keys["k"], keys["d"]]
        rows = [], [], [], [pull, [-row for row in pull]]
    elif kind == "tf":
        rows = _controllable(keys["num"], keys["den"])
    else:
        rows = (keys[name] for name in "ABCD")
    A, B, C, D = map(np.array, rows)
    shapes = (len(A), len(A)), (len(A), inputs), (outputs, len(A)), (outputs, inputs)
    return [
        matrix.reshape(shape) if matrix.size else np.zeros(shape)
        for matrix, shape in zip((A, B, C, D), shapes, strict=True)
    ]


def tf(period: float, num: Sequence[float], den: Sequence[float], *, discrete: bool) -> Law:
    """Transfer function from coefficients of descending powers of s or z, in direct or in
    controllable form."""
    if not discrete:
        return ss(period, *_controllable(num, den), ("u",), ("y",), discrete=False)
    a, b = (
        [coefficient / den[0] for coefficient in den],
        [0.0] * (len(den) - len(num)) + [each / den[0] for each in num],
    )
    past = tuple(f"w{i}" for i in range(1, len(den)))
    gives = {
        "w0": ((1.0, "u"), *_sum([-coefficient for coefficient in a[1:]], past)),
        "y": _sum(b, ("w0", *past)),
    }
    return Law(gives, moves=(("w0", past),) if past else ())


def _controllable(num, den):
    """A, B, C and D of a transfer function from coefficients of descending powers of s."""
    n, a = len(den) - 1, [coefficient / den[0] for coefficient in den]
    b = [0.0] * (len(den) - len(num)) + [coefficient / den[0] for coefficient in num]
    A = [
        [-coefficient for coefficient in a[1:]],
        *([1.0 * (i == j) for j in range(n)] for i in range(n - 1)),
    ][:n]
    C = [coefficient - factor * b[0] for coefficient, factor in zip(b[1:], a[1:], strict=True)]
    return LawMatrices(A, [[1.0 * (i == 0)] for i in range(n)], [C], [[b[0]]])


def gain(period: float, k: float) -> Law:
    """`y = k u`."""
    del period
    return Law({"y": ((k, "u"),)})


def hold(period: float) -> Law:
    """`u` as it was when the block ran last."""
    return gain(period, 1.0)


def impulse(period: float) -> Law:
    """The sum of all `u`, whose change in a tick is `u` if the block runs in it and otherwise 0."""
    del period
    return Law({"sum": ((1.0, "before"), (1.0, "u"))}, {"before": ((1.0, "sum"),)})


def channel(period: float, **_: object) -> Law:
    """A hold; `march` has what happens to its messages."""
    return hold(period)


def delay(period: float, steps: int) -> Law:
    """`u` of so many runs ago."""
    past = tuple(f"u{i}" for i in range(1, steps + 1))
    if past:
        return Law({"y": ((1.0, past[-1]),)}, moves=(("u", past),))
    return hold(period)


def dead_time(ticks: int) -> Law:
    """What was held, and what was read of plants, so many ticks ago; and by how much the former
    is about to change."""
    held_states, read = (
        [port, *(f"{port}{i}" for i in range(1, ticks + 1))] for port in ("u", "sensed")
    )
    soon = ((1.0, held_states[-2]), (-1.0, held_states[-1])) if ticks else ()
    if ticks:
        moves = tuple((port, tuple(past)) for port, *past in (held_states, read))
    else:
        moves = ()
    return Law({"y": ((1.0, held_states[-1]), (1.0, read[-1])), "next": soon}, moves=moves)


def difference(period: float) -> Law:
    """Change of `u` since the last run, over the period."""
    return Law(
        {"change": ((1.0, "u"), (-1.0, "before")), "y": ((1.0 / period, "change"),)},
        {"before": ((1.0, "u"),)},
    )


def saturation(period: float, high: float, low: float | None = None) -> Law:
    """`u` within limits."""
    return _within_limits(hold(period), period, 1.0, Limits(high, low))


def integrator(period: float, method: str, **limits) -> Law:
    """Integral of `u`: rectangles from the left, from the right, or trapezia."""
    total, keeps = _integral("sum", "u", period, method)
    shown = ((1.0, "sum"),) if method == "explicit" else total
    return _within_limits(Law({"y": shown}, keeps), period, 1.0, Limits(**limits))


class Limits(NamedTuple):
    """The limits of a block's output, without `high` none, and what its integral does there."""

    high: float | None = None
    low: float | None = None
    anti_windup: str = "none"
    tracking_s: float | None = None


def _within_limits(law, period, ki, limits: Limits):
    """A law whose output y ends at limits, with what its integral, times ki in y, does there.

    Back-calculation adds `(y - free)/tracking_s` to the rate of `ki sum`, free being y without
    limits (Astrom, Hagglund 1995). Clamping keeps the sum while y is at a limit and `ki u` has the
    sign of `free - y`.
    """
    if limits.high is None:
        return law
    gives = {**law.gives, "free": law.gives["y"], "y": ((1.0, "free"),)}
    keeps = dict(law.keeps)
    stops = {}
    if limits.anti_windup == "clamping":
        gives["driven"] = ((ki, "u"),)
        stops["sum"] = ("free", "y", "driven")
    elif limits.anti_windup == "back-calculation" and float(ki):
        back = period / (ki * limits.tracking_s)
        keeps["sum"] = (*keeps["sum"], (back, "y"), (-back, "free"))
    low = -limits.high if limits.low is None else limits.low
    return law._replace(gives=gives, keeps=keeps, limits={"y": (low, limits.high)}, stops=stops)


def _integral(total: str, rate: str, period: float, method: str) -> tuple[Sum, dict[str, Sum]]:
    """A total after a step, from that before it and a rate, and what is kept; a trapezium needs
    the rate of the last run."""
    if method != "trapezoidal":
        moved = (1.0, total), (period, rate)
        return moved, {total: moved}
    last = f"last {rate}"
    moved = (1.0, total), (period / 2, rate), (period / 2, last)
    return moved, {total: moved, last: ((1.0, rate),)}


def butterworth(period: float, order: int, cutoff_hz: float, passes: str) -> Law:
    """Digital Butterworth filter: bilinear transform, prewarped so that the gain at the cutoff is
    1/sqrt(2).

    Analogue poles `s = tan(pi f T) exp(j pi (2k + n + 1)/2n)` become `p = (1 + s)/(1 - s)`; the
    zeros go to z = -1 ("low") or z = 1 ("high"). A section with a pole p, a real one or the upper
    one of a pair, keeps one number q, complex for a pair:

        q' = p q + g u,        y = Re(r q) + d u

    In a direct form, whose coefficients cancel if the poles are close to z = 1, no digit is left at
    10th order and 0.1 % of the rate. Accuracy: relative 1e-13 of the pass-band gain down to cutoffs
    of 0.1 % of the rate at order 12.
    """
    edge, gives, keeps, into = math.tan(math.pi * cutoff_hz * period), {}, {}, "u"
    for k in range((order + 1) // 2):
        real, out = 2 * k + 1 == order, "y" if 2 * k + 2 >= order else f"y{k}"
        p, g, r, d = _section(
            passes, edge * cmath.exp(1j * math.pi * (2 * k + order + 1) / (2 * order)), real=real
        )
        a, b = f"q{k}", f"q{k}_im"
        second = () if real else ((-r.imag, b),)
        gives[out] = ((r.real, a), *second, (d, into))
        keeps[a] = ((p.real, a), *(() if real else ((-p.imag, b),)), (g, into))
        if not real:
            keeps[b] = ((p.real, b), (p.imag, a))
        into = out
    if order:
        return Law(gives, keeps)
    return hold(period)


class FilterSection(NamedTuple):
    """A section of a filter: its pole, the gains into its state and out of it, and the direct
    term."""

    pole: complex
    gain_in: float
    gain_out: complex
    direct: float


def _section(passes, s, *, real):
    """The section of the analogue pole s, by partial fractions of `d (z +- 1)^n/(z - p)`."""
    s = s.real if real else s
    p = (1 + s) / (1 - s)
    to_one, to_minus_one = -2 * s / (1 - s), 2 / (1 - s)  # 1 - p and 1 + p, without cancelling
    at_gain, at_zero = (to_one, to_minus_one) if passes == "low" else (to_minus_one, -to_one)
    # input and output of like size: the state stays of the size of the signal
    g = abs(to_one) ** 0.5
    if real:
        d = at_gain / 2
        return FilterSection(p, g, d * at_zero / g, d)
    d = abs(at_gain) ** 2 / 4
    return FilterSection(p, g, d * at_zero**2 / (1j * p.imag) / g, d)


def lowpass(period: float, a: float = 0.0, cutoff_hz: float = 0.0) -> Law:
    """`y += a (u - y)`; a cutoff gives `a = dt/(dt + RC)`, `RC = 1/(2 pi cutoff)`."""
    a = a or period / (period + 1 / (2 * math.pi * cutoff_hz))
    return Law(
        {"step": ((1.0, "u"), (-1.0, "before")), "y": ((1.0, "before"), (a, "step"))},
        {"before": ((1.0, "y"),)},
    )


def pi(period: float, kp: float, ki: float, method: str, **limits) -> Law:
    """`y = kp u + ki integral of u`."""
    total = integrator(period, method)
    gives = {"total": total.gives["y"], "y": ((kp, "u"), (ki, "total"))}
    return _within_limits(Law(gives, total.keeps), period, ki, Limits(**limits))


def pid(period: float, kp: float, ki: float, kd: float, tau: float, method: str, **limits) -> Law:
    """The same and `kd slope`, `slope = (tau last slope + change of u)/(tau + T)`."""
    pi_law, share = pi(period, kp, ki, method), 1 / (tau + period)
    slope = {
        "change": ((1.0, "u"), (-1.0, "before")),
        "slope": ((tau * share, "last"), (share, "change")),
    }
    gives = {**pi_law.gives, **slope, "y": (*pi_law.gives["y"], (kd, "slope"))}
    law = Law(gives, {**pi_law.keeps, "before": ((1.0, "u"),), "last": ((1.0, "slope"),)})
    return _within_limits(law, period, ki, Limits(**limits))


def lead(period: float, zero_hz: float, pole_hz: float) -> Law:
    """`(1 + s/z)/(1 + s/p)` by the bilinear transform, each corner prewarped."""
    zero = math.tan(math.pi * zero_hz * period)
    pole = math.tan(math.pi * pole_hz * period)
    return tf(period, [1 + 1 / zero, 1 - 1 / zero], [1 + 1 / pole, 1 - 1 / pole], discrete=True)


def notch(period: float, frequency_hz: float, q: float, depth: float) -> Law:
    """The notch of R. Bristow-Johnson's cookbook, of which a part of the frequency may be left."""
    angle = 2 * math.pi * frequency_hz * period
    alpha, middle = math.sin(angle) / (2 * q), -2 * math.cos(angle)
    return tf(
        period,
        [1 + depth * alpha, middle, 1 - depth * alpha],
        [1 + alpha, middle, 1 - alpha],
        discrete=True,
    )


def biquad(period: float, b0: float, b1: float, b2: float, a1: float, a2: float) -> Law:
    """`(b0 + b1/z + b2/z^2)/(1 + a1/z + a2/z^2)`."""
    return tf(period, [b0, b1, b2], [1.0, a1, a2], discrete=True)


def fir(period: float, coefficients: Sequence[float]) -> Law:
    """Sum of the coefficients times `u` of so many runs ago."""
    past = delay(period, len(coefficients) - 1).moves
    return Law({"y": _sum(coefficients, ("u", *(past[0][1] if past else ())))}, moves=past)


def mean(period: float, n: int) -> Law:
    """Mean of `u` in the last n runs."""
    return fir(period, [1 / n] * n)


def wave(period: float, b: float, gives: str) -> Law:
    """End of a wave line of impedance b (N s/m): `force = b v - sqrt(2b) in`, `out = sqrt(2b) v
    - in`, or solved for `v`."""
    del period
    impedance, admittance = math.sqrt(2 * b), math.sqrt(2 / b)
    if gives == "force":
        return Law(
            {"force": ((b, "v"), (-impedance, "in")), "out": ((impedance, "v"), (-1.0, "in"))}
        )
    return Law({"v": ((admittance, "in"), (-1 / b, "f")), "out": ((1.0, "in"), (-admittance, "f"))})


def avatar(period: float, b: float, integration: str) -> Law:
    """A point behind a wave port, pushed back by the force f: `v = (sqrt(2b) in - f)/b`, `out = in
    - sqrt(2/b) f`.

    It moves from `before` by a step with its velocity; the spring reads where it was, if explicit,
    or where it is.
    """
    admittance = math.sqrt(2 / b)
    moved, keeps = _integral("before", "v", period, integration)
    gives = {
        "v": ((admittance, "in"), (-1 / b, "f")),
        "x_spring": ((1.0, "before"),) if integration == "explicit" else moved,
        "x": moved,
        "out": ((1.0, "in"), (-admittance, "f")),
    }
    return Law(gives, keeps)


def local_model(period: float, b: float, K: float, B: float, integration: str) -> Law:
    """A spring K and a damper B behind a wave port: the avatar's equations with `f = K x_spring
    + B v`, solved for v."""
    moved, keeps = _integral("before", "speed", period, integration)
    if integration == "explicit":
        still = ((1.0, "before"),)
    else:
        still = tuple(term for term in moved if term[1] != "speed")
    ahead = sum(factor for factor, name in moved if name == "speed" and integration != "explicit")
    total = b + B + K * ahead
    gives = {
        "speed": (
            (math.sqrt(2 * b) / total, "in"),
            *((-K * factor / total, name) for factor, name in still),
        ),
        "pull": (*((K * factor, name) for factor, name in still), (K * ahead + B, "speed")),
        "out": ((1.0, "in"), (-math.sqrt(2 / b), "pull")),
    }
    return Law(gives, keeps)


def local_model_away(period: float, b: float, K: float, B: float, integration: str) -> Law:
    """A local model while the wall is not touched: it moves freely, and its spring is not
    stretched."""
    del period, K, B
    if integration == "trapezoidal":
        moving = {"last speed": ((math.sqrt(2 / b), "in"),)}
    else:
        moving = {}
    return Law({"out": ((1.0, "in"),)}, {"before": (), **moving})


def _sum(factors, names) -> Sum:
    return tuple(zip(factors, names, strict=True))


LAWS: Mapping[str, Callable[..., Law]] = MappingProxyType(
    {
        each.__name__: each
        for each in (
            *(
                mass,
                inertia,
                mass_matrix,
                spring,
                ss,
                tf,
                gain,
                hold,
                channel,
                impulse,
                saturation,
                delay,
                difference,
                integrator,
            ),
            *(
                butterworth,
                wave,
                avatar,
                local_model,
                lowpass,
                pi,
                pid,
                lead,
                notch,
                biquad,
                fir,
                mean,
            ),
        )
    }
)
