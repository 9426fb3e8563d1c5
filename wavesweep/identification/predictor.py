"""The steady Kalman filter of a device on which a force acts that is not in the log.

    s[k+1] = A s[k] + G (f[k] + w[k] + u[k]),   w[k+1] = w[k] + z[k],   y[k] = C s[k] + r[k]

f is the force of the log over the mass, w a force that walks at random, as of a cable or a hand, u
a white one, r the noise of the reading. The filter predicts each reading from all before it; what
is left, the innovations, is white if the model is right, whatever w has done to the device until
then (Anderson and Moore, Optimal Filtering, 1979, chapter 4).

A tick is the unit of time here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm, schur
from scipy.signal import lfilter

from wavesweep.identification.model import Model

FORGOTTEN = 1e-9  # effect of the initial state below which it no longer matters


@dataclass(frozen=True, eq=False)
class Tick:
    """A tick of a unit mass with the walking force as its last state: `s[k+1] = A s[k] + ...`, of
    which `C s` is read.

    held: the effect of a unit force over the whole tick. speed: the state that is the velocity.
    flow: the equations in which a unit force is the last state, of which those from `first` on are
    kept.
    """

    A: np.ndarray
    held: np.ndarray
    C: np.ndarray
    speed: int
    flow: np.ndarray
    first: int

    @cached_property
    def lever(self) -> np.ndarray:
        """The effect of a unit mean of (1/2 - t) f over the tick, t of it after its start.

        It is that of f = 12 (1/2 - t), which has this mean and no other: with the flow F of the
        states and the force b, 12 times the integral of exp(F (1 - t)) b (1/2 - t). By two more
        states that follow f, it is an exponential of the tick.
        """
        size = len(self.flow)
        wide = np.zeros((size + 1, size + 1))
        wide[:size, :size] = self.flow
        wide[size - 1, size] = 1.0
        moved = expm(wide)[self.first : size - 1, size - 1 :]
        effect = 6 * moved[:, 0] - 12 * moved[:, 1]
        return np.append(effect, np.zeros(len(self.A) - len(effect)))

    def begun(self, part: float) -> np.ndarray:
        """The effect of a unit force that begins a part of the tick late, `(states,)`."""
        moved = expm((1 - part) * self.flow)[self.first : -1, -1]
        return np.append(moved, np.zeros(len(self.A) - len(moved)))


def _flow(model: Model, shape: Mapping[str, float]) -> np.ndarray:
    """A of `x' = A x` for x = (x_1, v_1), or (x_1, v_1, x_1 - x_2, v_2) of two masses; shape: see
    `tick_of`."""
    rate = shape["rate"]
    square = shape["square"]
    if not model.load:
        return np.array([[0, 1], [-square, -rate]])
    loss = shape["coupling_rate"]
    share = shape["share"]
    return np.array(
        [
            [0, 1, 0, 0],
            [0, -rate - loss, -square, loss],
            [0, 1, 0, -1],
            [0, loss / share, square / share, -loss / share - shape["load_rate"]],
        ]
    )


def tick_of(model: Model, shape: Mapping[str, float], period: float) -> Tick:
    """The tick of a model.

    shape: `rate`, the damping over the mass (1/s), and `square`, the stiffness over it; of two
    masses also `share`, the load over the first mass, `load_rate`, its damping over it, and of the
    spring `square` and `coupling_rate`, over the first mass.
    """
    flow = _flow(model, shape)
    size = len(flow)
    units = np.where(np.arange(size) % 2, 1 / period, 1.0)  # velocities are per tick
    wide = np.zeros((size + 1, size + 1))
    wide[:size, :size] = period * flow * units[None, :] / units[:, None]
    wide[1, size] = 1.0
    whole = expm(wide)
    # Of a velocity nothing else depends on the position, unless there is a spring.
    with_position = model.measured == "position" or (model.spring and shape["square"] != 0.0)
    first = 0 if with_position else 1
    speed = 1 - first
    A = whole[first:size, first:size]
    held_force = whole[first:size, size]
    C = np.zeros(len(A))
    C[0 if model.measured == "position" else speed] = 1.0
    if model.measured == "acceleration":  # the change of the velocity over the tick before
        A = np.pad(A, ((0, 1), (0, 1)))
        A[-1, speed] = 1.0
        held_force = np.append(held_force, 0.0)
        C = np.append(C, -1.0)
    A = np.block([[A, held_force[:, None]], [np.zeros((1, len(A))), np.ones((1, 1))]])
    return Tick(A, np.append(held_force, 0.0), np.append(C, 0.0), speed, wide, first)


class Predictor:
    """The filter of a tick for white force and walk of variances `white` and `drift`, relative to
    that of the reading.

    M: the matrix of the errors of its states; spread: the variance of an innovation, relative to
    that of the reading. from_zero: the walk begins at 0, and not anywhere.
    """

    def __init__(
        self, tick: Tick, white: float, drift: float, rows: int, from_zero: bool = False
    ) -> None:
        self.tick = tick
        self._open = len(tick.A) - from_zero  # states that may be anything at the first row
        noise = white * np.outer(tick.held, tick.held)
        noise[-1, -1] += drift
        self.covariance = _steady(tick.A, tick.C, noise)
        self.spread = float(tick.C @ self.covariance @ tick.C) + 1.0
        self.gain = tick.A @ self.covariance @ tick.C / self.spread
        self.M = tick.A - np.outer(self.gain, tick.C)
        self._by_modes = len(self.M) > 4  # more poles near 1 would leave few digits to a polynomial
        if self._by_modes:
            self._triangle, self._basis = schur(self.M, "complex")
        self._past = np.poly(self.M).real
        self._ahead = np.poly(tick.A).real
        free = _free(self.M, tick.C, rows)[:, : self._open]
        basis, sizes, _ = np.linalg.svd(free / np.linalg.norm(free, axis=0), full_matrices=False)
        self._initial = basis[:, sizes > 1e-8 * sizes[0]]

    def innovations(self, reading: np.ndarray, skip: int) -> np.ndarray:
        """Of a log without force, from row `skip` on, without what the state at this row
        explains."""
        if self._by_modes:
            return self._without_initial((reading - self._seen([(self.gain, reading)]))[skip:])
        return self._without_initial(lfilter(self._ahead, self._past, reading)[skip:])

    def effect(self, parts: list[tuple[np.ndarray, np.ndarray]], skip: int) -> np.ndarray:
        """The same of what forces add to the predictions. parts: the effect of a unit force over
        a tick, and the forces."""
        if self._by_modes:
            return self._without_initial(self._seen(parts)[skip:])
        effect = np.zeros(len(parts[0][1]))
        for push, force in parts:
            # C adj(z - M) B = det(z - M + B C) - det(z - M)
            response = np.poly(self.M - np.outer(push, self.tick.C)).real - self._past
            effect += lfilter(response, self._past, force)
        return self._without_initial(effect[skip:])

    def _seen(self, parts):
        """C s[k] of `s[k+1] = M s[k] + sum push signal[k]` from rest. parts: pairs (push, signal).

        With M = Q R Q* (`_basis`, `_triangle`) and s = Q q, q comes row by row from the last one
        on, as R is triangular.
        """
        seen = np.zeros(len(parts[0][1]), dtype=complex)
        states = []
        for row in reversed(range(len(self.M))):
            drive = np.zeros(len(seen), dtype=complex)
            for push, signal in parts:
                drive[1:] += (self._basis[:, row].conj() @ push) * signal[:-1]
            below = range(len(self.M) - 1, row, -1)
            for column, state in zip(below, states, strict=True):
                drive[1:] += self._triangle[row, column] * state[:-1]
            state = lfilter([1.0], [1.0, -self._triangle[row, row]], drive)
            states.append(state)
            seen += (self.tick.C @ self._basis[:, row]) * state
        return seen.real

    def smoothed(self, reading: np.ndarray, push: np.ndarray, skip: int) -> np.ndarray:
        """The states at each row from all readings and `push`, the effects of all forces, `(states,
        rows)` both.

        In the first `skip` rows, whose forces are not known, they are those of the next row. The
        backward pass is that of Bryson and Frazier in the form of Durbin and Koopman (2012, section
        4.4).
        """
        reading = reading[skip:]
        push = push[:, skip:]
        drive = np.zeros((len(self.M), len(reading)))
        drive[:, 1:] = (np.outer(self.gain, reading) + push)[:, :-1]
        error = reading - self.tick.C @ _run(self.M, drive)
        free = _free(self.M, self.tick.C, len(reading))[:, : self._open]
        start = np.linalg.lstsq(free, error[: len(free)], rcond=1e-12)[0]
        drive[: self._open, 0] = start
        states = _run(self.M, drive)
        error = reading - self.tick.C @ states
        back = _run(self.M.T, np.outer(self.tick.C / self.spread, error[::-1]))[:, ::-1]
        states = states + self.covariance @ back
        return np.concatenate([states[:, :1].repeat(skip, axis=1), states], axis=1)

    def _without_initial(self, errors):
        rows = len(self._initial)
        errors[:rows] -= self._initial @ (self._initial.T @ errors[:rows])
        return errors


def _steady(A, C, noise):
    """The covariance of the states before a reading of unit variance, by doubling (Anderson and
    Moore 1979, section 6.7)."""
    forward = A.T
    seen = np.outer(C, C)
    covariance = noise
    identity = np.eye(len(A))
    for _ in range(60):  # doublings of the time over which the Riccati equation is solved
        shared = np.linalg.solve(identity + seen @ covariance, np.hstack([forward, seen]))
        forward_shared = shared[:, : len(A)]
        seen_shared = shared[:, len(A) :]
        added = forward.T @ covariance @ forward_shared
        seen = seen + forward @ seen_shared @ forward.T
        forward = forward @ forward_shared
        covariance = covariance + (added + added.T) / 2
        seen = (seen + seen.T) / 2
        # The relative change of its solution that ends the doublings.
        if np.abs(added).max() <= 1e-12 * np.abs(covariance).max():
            break
    return covariance


def _free(M, C, rows):
    """What a unit of each state at the first row adds to each innovation, `(rows, states)`, as
    far as it matters."""
    free = C[None, :]
    power = M
    while len(free) < rows:
        free = np.concatenate([free, free @ power])
        power = power @ power
        if np.abs(free[-1]).max() < FORGOTTEN and np.abs(power).max() < FORGOTTEN:
            break
    return free[:rows]


def _run(M, drive):
    """The states x[k] = M x[k-1] + drive[:, k] from 0, `(states, rows)`, by a Schur form: one
    pole after the other."""
    triangle, basis = schur(M, "complex")
    driven = basis.conj().T @ drive
    states = np.zeros_like(driven)
    for row in reversed(range(len(M))):
        drive_of_row = driven[row]
        drive_of_row[1:] += triangle[row, row + 1 :] @ states[row + 1 :, :-1]
        states[row] = lfilter([1.0], [1.0, -triangle[row, row]], drive_of_row)
    return (basis @ states).real
