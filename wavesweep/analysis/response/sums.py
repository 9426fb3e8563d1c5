"""Frequencies on the circles of the tick and of the frame, and a frame's sums under a force at each."""

from functools import cached_property

import numpy as np

from wavesweep.analysis.response.frame import Loop
from wavesweep.analysis.response.ticks import ROUNDING, Sizes, repeated, size_of_both, then, tick
from wavesweep.lifted.circle import on_circle


class Circle:
    """Frequencies (Hz), and what they are in a tick and in a frame of `ratio` ticks; rate: ticks per second.

    The angle per tick is kept in three parts, of which multiples are exact: a frequency next to a multiple of the slow rate
    has an angle per frame next to 0, and all its digits count.
    """

    def __init__(self, frequency, rate: float, ratio: int):
        self.frequency, self.rate, self.ratio = frequency, rate, ratio
        self.cycles = frequency / rate
        product, error = _product(self.cycles, rate)
        self.high, self.low = _halves(self.cycles)
        self.rest = ((frequency - product) - error) / rate
        self.turns = {}

    def at(self, index) -> "Circle":
        """Some of the frequencies."""
        return Circle(self.frequency[index], self.rate, self.ratio)

    def angle(self, count: int):
        """`w count T`, rad, less full turns."""
        whole = np.round(self.cycles * count)
        return 2 * np.pi * (((self.high * count - whole) + self.low * count) + self.rest * count)

    def turn(self, count: int):
        """`exp(j w count T)`."""
        if count not in self.turns:
            angle = self.angle(count)
            self.turns[count] = np.cos(angle) + 1j * np.sin(angle)
        return self.turns[count]

    def steps(self, count: int):
        """`exp(j w count T) - 1`, to all digits."""
        return on_circle(self.angle(count))

    @cached_property
    def tick(self):
        """`exp(j w T) - 1`."""
        return self.steps(1)

    @cached_property
    def frame(self):
        """`exp(j w M T) - 1`, exactly 0 at multiples of the slow rate."""
        return self.steps(self.ratio)

    @cached_property
    def share(self):
        """The component at w of what is constant in every frame, times w of the tick over w of the frame."""
        return self.turn(1) * self.turn(self.ratio).conj() / self.ratio


def circle(loop: Loop, frequency_hz) -> Circle:
    """The frequencies on the circles of this loop."""
    rate = loop.diagram.rate
    rate = 1 / np.asarray(loop.diagram.period, float) if rate is None else np.asarray(rate, float)
    return Circle(np.asarray(frequency_hz, float), rate, loop.diagram.ratio)


def _product(a, b):
    """Product and its rounding error (Dekker 1971)."""
    (high_a, low_a), (high_b, low_b), product = _halves(a), _halves(b), a * b
    return product, ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b


def _halves(a):
    """Two numbers of 26 bits whose sum is a."""
    far = 134217729.0 * a
    high = far - (far - a)
    return high, a - high


def runs(loop: Loop, points: Circle, fast):
    """The frame's ticks as one run, and what the held signals of the last frame and of this one add to its sums.

    fast: the tick with its held inputs as states. The last two are `(..., p, points, held)`.
    """
    one, turn, delay, n = tick(fast, points.frequency.size), points.turn, loop.diagram.delay, len(loop.fast.states)
    before, after = (repeated(one, count, lambda a, b: then(a, b, turn)) for count in (delay, loop.diagram.ratio - delay))
    if before is None:
        return after, 0 * after.r[..., n:], after.r[..., n:]
    if after is None:
        return before, before.r[..., n:], 0 * before.r[..., n:]
    back = turn(delay).conj()[:, None]
    old = before.r[..., n:] + back * (after.r[..., :n] @ before.E[..., None, :n, n:])
    return then(before, after, turn), old, back * after.r[..., n:]


def sizes_of_runs(before: Sizes | None, after: Sizes | None, n: int):
    """Sizes of the same, n fast states: of the run, and (size, error) of what the old and the new held signals add."""
    if before is None:
        return after, (0 * after.r[..., n:], 0 * after.r[..., n:]), (after.r[..., n:], after.dr[..., n:])
    if after is None:
        return before, (before.r[..., n:], before.dr[..., n:]), (0 * before.r[..., n:], 0 * before.r[..., n:])
    k, dk = np.abs(before.E[..., :n, n:]), before.dE[..., :n, n:]
    old = before.r[..., n:] + after.r[..., :n] @ k
    dold = before.dr[..., n:] + after.dr[..., :n] @ k + after.r[..., :n] @ dk + ROUNDING * old
    return size_of_both(before, after), (old, dold), (after.r[..., n:], after.dr[..., n:])


def conserved(loop, g, size):
    """By how much the force changes the conserved combination in a frame, `(..., 1, points)`, and its error."""
    law, n = loop.law[..., None, :], len(loop.fast.states)
    error = loop.dlaw[..., None, :] @ np.abs(g) + np.abs(law) @ (size.dg[..., :n, :] + ROUNDING * np.abs(g))
    return law @ g, error
