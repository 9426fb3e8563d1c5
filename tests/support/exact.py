"""The loop of the model at 50 digits: what `balls` writes down from its equations, as numbers of mpmath.

It shares no code with the package. `march` runs the ticks in doubles, one after the other.
"""

from collections import defaultdict
from dataclasses import dataclass

import mpmath
import numpy as np
from flint import acb, arb, ctx

from support import balls
from wavesweep.checker.reader.filters import butterworth

mp = mpmath.mp.clone()
mp.dps = 50


def number(value):
    """The double `value`, exactly."""
    return mp.mpf(value)


def _bits():
    """Bits of balls, of which frames of hundreds of ticks lose many; what is left is more than numbers have here."""
    return ctx.workprec(8 * mp.prec)


def _middle(ball):
    if isinstance(ball, acb):
        return mp.mpc(_middle(ball.real), _middle(ball.imag))
    part, exponent = ball.mid().man_exp()
    return mp.ldexp(int(part), int(exponent))


def _numbers(matrix):
    return np.array([[_middle(ball) for ball in row] for row in matrix.tolist()], dtype=object)


def _doubles(matrix):
    return np.array([[float(ball) for ball in row] for row in matrix.tolist()])


def zero_order_hold(values, T):
    """`(x, v)+ = F (x, v) + G f` of the device with the hand on it: the rows of F, and G."""
    with _bits():
        rows = [[_middle(arb(entry)) for entry in row] for row in balls.device(values, arb(T))]
    return [row[:2] for row in rows], [row[2] for row in rows]


def filter_response(order, cutoff_hz, T, highpass, z):
    """The filter's transfer function at z."""
    out, arithmetic = mp.mpf(1), balls.Arithmetic()
    with _bits():
        warped = (arb.pi() * arb(cutoff_hz) * arb(T)).tan()
        sections = butterworth(order, warped, "high" if highpass else "low", arithmetic)
        models = [[[_middle(arb(entry)) for entry in row] for row in (*A, B, C, [D])] for A, B, C, D in sections]
    for *A, B, C, (D,) in models:
        n = len(B)
        state = mp.lu_solve(z * mp.eye(n) - mp.matrix(A), mp.matrix(B))
        out *= D + sum(c * x for c, x in zip(C, state, strict=True))
    return out


@dataclass(frozen=True)
class Frame:
    """The loop cut at the wall over a frame: `s+ = A s + B F`, `x_tilde = c_x s + d_x F`, `x_dot = c_v s + d_v F`."""

    A: np.ndarray
    B: np.ndarray
    x: np.ndarray
    v: np.ndarray
    period: object

    def closed(self, K, B):
        """Frame-to-frame matrix with the wall in place, as an mpmath matrix."""
        read = self.x * number(K) + self.v * number(B)
        return mp.matrix((self.A + np.outer(self.B, read[:-1] / (1 - read[-1]))).tolist())

    def transfer(self, z):
        """(G_x, G_v) at z."""
        n = len(self.B)
        state = mp.lu_solve(mp.matrix((np.diag([z] * n) - self.A).tolist()), mp.matrix(self.B.tolist()))
        state = np.array([*state, mp.mpf(1)], dtype=object)
        return self.x @ state, self.v @ state

    def value_at(self, theta, along, fixed):
        """The wall parameter (complex; real on the stability boundary) at `z = exp(j theta)`."""
        G_x, G_v = self.transfer(mp.expj(theta))
        solved, other = (G_x, G_v) if along == "K_VE" else (G_v, G_x)
        return (1 - number(fixed) * other) / solved


def frame(values):
    """The frame of a loop."""
    with _bits():
        whole, (ratio, _, T) = balls.frame(values), balls.clock(values)
        A, B, x, v = (_numbers(part) for part in (whole.A, whole.B, whole.x, whole.v))
        return Frame(A, B[:, 0], x[0], v[0], _middle(ratio * T))


def spectral_radius(values, drift=1e-15):
    """The largest eigenvalue of a frame but for those at 1 (to `drift`, which half the digits of a double one are)."""
    whole = frame(values).closed(values["environment.K_VE"], values["environment.B_VE"])
    # Moved away from 0, where pure delays put several: QR would wait for ever for entries small beside zeros.
    for away in (2, 3, 1.5):
        try:
            eigenvalues = mp.eig(whole + away * mp.eye(whole.rows), left=False, right=False)
        except RuntimeError:  # QR does not converge: another distance from 0
            continue
        return max(abs(z - away) for z in eigenvalues if abs(z - away - 1) > drift)
    raise RuntimeError("no distance from 0 lets QR converge")


def response(values, frequency_hz):
    """(admittance, impedance) at the hand's own frequency: the steady state under `exp(j w k T)`, and its component."""
    with _bits():
        return tuple(_middle(each) for each in balls.response(values, arb(frequency_hz)))


def limit(values, frequency_hz, step=1e-14):
    """`response` at a frequency where the formula is 0/0: the mean of both sides, whose error is of order step^2."""
    sides = [mp.mpf(frequency_hz) * (1 + sign * mp.mpf(step)) for sign in (-1, 1)]
    pairs = [response(values, side) for side in sides]
    return tuple((left + right) / 2 for left, right in zip(*pairs, strict=True))


SLOW = ("u_s", "v_s", "x_s", "x_dot_s", "F_s")  # signals with a number per frame


def march(values, force):
    """The signals from rest under the hand's force (N, a number per tick): name -> array, with a number per tick or frame."""
    with _bits():
        parts = balls.ticks_of(values)
        ticks = [(_doubles(tick.step), {name: _doubles(row)[0] for name, row in tick.seen.items()}) for tick, _ in parts]
        first = parts[0][0]
        wall = first.x_tilde * arb(values["environment.K_VE"]) + first.x_dot * arb(values["environment.B_VE"])
    order = [tick for tick, (_, times) in zip(ticks, parts, strict=True) for _ in range(times)]
    (wall,), found = _doubles(wall), defaultdict(list)
    known = np.zeros(len(wall))  # the state, the force of the wall, and that of the hand
    for k, f_h in enumerate(force):
        (step, rows), known[-1] = order[k % len(order)], f_h
        if k % len(order) == 0:
            known[-2] = 0.0
            known[-2] = wall @ known / (1 - wall[-2])
        for name, row in rows.items():
            found[name].append(row @ known)
        known[:-2] = step @ known
    return {name: np.array(signals) for name, signals in found.items()}


def margin_at_rest(values, theta=1e-30):
    """The least eigenvalue of the Hermitian part of the map from a frame's forces to its displacements, next to 0 Hz (m/N)."""
    with _bits():
        angle = arb(theta)
        hz = angle / (2 * arb.pi() * values["rates.ratio"]) * arb(values["rates.fast_hz"])
        positions = balls.lifted(values, hz).tolist()
        after = [*positions[1:], [acb(0, angle).exp() * entry for entry in positions[0]]]
        H = mp.matrix([[_middle(b - a) for a, b in zip(*rows, strict=True)] for rows in zip(positions, after, strict=True)])
    return min(mp.eighe((H + H.H) / 2, eigvals_only=True))
