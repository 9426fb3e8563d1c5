"""Step responses of a signal to an input, tick by tick, with a bound on each sample and on all
that follow the last one."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._response.lifted import Lifted, Stretch
from wavesweep.engine._response.port import Port, reached
from wavesweep.engine._response.steady import transfer
from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import UsageError

MOST_STEP_TICKS = 2000  # of a frame
MOST_SAMPLED_STATES = 8_000_000  # samples times states
REST = 1e-6  # of the largest sample: how far the last frame may be from all later ones
LONGER = 1.4  # times the time to settle: the end of what is worth showing
BAND = 0.02  # of the final value, within which a response has settled


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """The response of a signal to an input that is 0 before the time 0 and 1 from then on, as each
    tick shows it.

    time_s, value: `(samples,)`, of whole frames. period: of a tick, s. frame: ticks of a frame.
    final: the mean of the samples in the end. error: a bound on the error of each sample and of
    `final`. tail: how far any later sample may be from that of the same tick in the last frame.
    """

    time_s: np.ndarray
    value: np.ndarray
    period: float
    frame: int
    final: float
    error: float
    tail: float

    @staticmethod
    def of(port: Port, most_states: int = MOST_SAMPLED_STATES) -> "Step":
        """Return the step response of a single loop, given by its port between an input and a
        signal (see `Port.between`).

        The states at the starts of frames, `x[j+1] = A x[j] + g`, are found by doubling: those of n
        more frames follow from A^n. In units in which no state exceeds 1, a power A^n of a size q <
        1/2 shows that `sum |C A^j| <= S = sum_(j<n) |C A^j|/(1 - q)`. So a change d of the states
        between the last two frames moves no later sample by more than `S |d|`, and a residual r of
        the recursion, which has the rounding and the errors of A and g, no sample by more than `S
        |r|`. Errors: UsageError for a loop that is not stable, or that does not come to rest within
        `most_states` samples times states, and for a signal that a constant input moves without end.
        Accuracy: as bounded; the bounds themselves are computed to first order.
        """
        loop = Lifted.of(port)
        ticks = port.kind.size
        if port.outputs > 1 or ticks > MOST_STEP_TICKS or loop.lost.any():
            moves = port.outputs > 1
            fault = "one that moves without end" if moves else f"a frame of {ticks} ticks"
            expected = f"a signal that comes to rest, in frames of at most {MOST_STEP_TICKS} ticks"
            raise UsageError(f"step: expected {expected}, found {fault}")
        frame = Stretch.of(port)
        D = Bounded(frame.impulse_map(), frame.impulse_map(1)).sum(-1)
        g = frame.controllability.sum(-1)
        moved = reached(g.value != 0, (frame.E.value != 0).T)
        g = g.part(moved)
        E = frame.E.part(moved[:, None], moved)
        C = frame.observability.part(0).part(slice(None), moved)
        rest = _until_rest(E.value, g.value, C.value, D.value, most_states)
        X = Bounded.exact(rest.states)
        later = Bounded.exact(np.vstack([rest.states[1:], rest.after]))
        residual = (later - X - (X @ E.mT + g)).size
        read = (X @ C.mT + D).error
        error = rest.gain * float((residual / rest.unit).max(initial=0.0)) + float(read.max())
        final, of_final = (float(limit.ravel()[0].real) for limit in transfer(loop, 0.0))
        of_limit = of_final * abs(final)
        if np.isnan(of_limit):
            final = float(rest.value[-1].mean())  # of all later frames, but for the tail
            of_limit = rest.tail
        time_s = np.arange(rest.value.size) * port.period
        return Step(
            time_s, rest.value.ravel(), port.period, ticks, final, error + of_limit, rest.tail
        )

    @property
    def known(self) -> bool:
        """Whether the final value is known and is not 0, so that times and overshoot are shares
        of it."""
        return abs(self.final) > 2 * self.error

    @property
    def settling_s(self) -> float:
        """Time from which all samples are within 2 % of the final value; NaN if that is not
        known."""
        far = np.abs(self.value - self.final) + 2 * self.error > BAND * abs(self.final)
        last = np.abs(self.value[-self.frame :] - self.final).max() + 2 * self.error + self.tail
        if not (self.known and last <= BAND * abs(self.final)):
            return np.nan
        return float(self.time_s[np.flatnonzero(far)[-1]] + self.period) if far.any() else 0.0

    @property
    def overshoot(self) -> float:
        """How far the largest sample is beyond the final value, as a share of that, and at least
        0; NaN if it is not known."""
        beyond = (self.value / self.final - 1) if self.known else np.array([np.nan])
        last = beyond[-self.frame :].max() + self.tail / max(abs(self.final), NEXT_TO_ZERO)
        return max(0.0, float(beyond.max())) if last <= max(beyond.max(), 10 * REST) else np.nan

    @property
    def peak_s(self) -> float:
        """Time of the sample that is farthest beyond the final value, or from 0 if that is not
        known."""
        away = self.value * np.sign(self.final) if self.known else np.abs(self.value)
        return float(self.time_s[np.argmax(away)])

    @property
    def shown(self) -> int:
        """How many samples show how it comes to rest: somewhat more than until it has settled."""
        if self.settling_s > 0:
            last = self.settling_s / self.period
        else:
            moving = np.flatnonzero(
                np.abs(self.value - self.final) > BAND * np.abs(self.value).max()
            )
            last = moving[-1] if moving.size else self.value.size
        return int(min(max(LONGER * last, 10), self.value.size - 1)) + 1

    def value_at(self, time_s: float) -> float:
        """The sample at a time."""
        return float(self.value[round(time_s / self.period)])

    @property
    def rise_s(self) -> tuple[float, float]:
        """Times of the first samples that reach 10 % and 90 % of the final value; NaN if they
        are not known."""
        if not self.known:
            return np.nan, np.nan
        # Between these shares of the final value a response rises.
        return self._first_at(0.1), self._first_at(0.9)

    def _first_at(self, share: float) -> float:
        """The time of the first sample that reaches a share of the final value; NaN without one."""
        samples = np.flatnonzero(self.value / self.final >= share)
        return float(self.time_s[samples[0]]) if samples.size else np.nan


class _Rest(NamedTuple):
    """Frames of a loop from the step on until it is at rest.

    states: at their starts, `(frames, n)`. after: those at the start of the one after them. value:
    the samples, `(frames, ticks)`. unit: of the states, in which none exceeds 1. gain: S, how far a
    change of states by 1 moves a later sample. tail: how far all later samples may be off those of
    the last frame.
    """

    states: np.ndarray
    after: np.ndarray
    value: np.ndarray
    unit: np.ndarray
    gain: float
    tail: float


def _until_rest(
    E: np.ndarray, g: np.ndarray, C: np.ndarray, D: np.ndarray, most_states: int
) -> _Rest:
    """Return the frames of `x[j+1] - x[j] = E x[j] + g`, samples `C x[j] + D`, by doubling their
    number until they are at rest; see `Step.of`."""
    power = E  # A^n - 1
    X = np.zeros((1, len(g)))  # states at the starts of n frames
    after = g  # and of the one after them
    rows = C[None]  # C A^j
    with np.errstate(all="ignore"):  # of a loop that is not stable
        while True:
            largest = np.abs(np.vstack([X, after])).max(0, initial=0.0)
            unit = np.where(largest > 0, largest, 1.0)
            size = float((np.abs(np.eye(len(g)) + power) @ unit / unit).max(initial=0.0))
            value = X @ C.T + D
            gain = float((np.abs(rows) @ unit).sum(0).max(initial=0.0) / (1 - size))
            tail = gain * float((np.abs(after - X[-1]) / unit).max(initial=0.0))
            # A power of the frame of this size proves that a response comes to rest.
            if size <= 0.5 and tail <= REST * np.abs(value).max():
                return _Rest(X, after, value, unit, gain, tail)
            if not np.isfinite(largest).all() or 2 * rows.size > most_states:
                raise UsageError(
                    "step: expected a loop that comes to rest, found one that is unstable, or too slow to tell"
                )
            X = np.concatenate([X, X + X @ power.T + after])
            rows = np.concatenate([rows, rows + rows @ power])
            after = after + power @ after + after
            power = power + power + power @ power
