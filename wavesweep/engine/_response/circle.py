"""Frequencies on the circles of the tick and of the frame."""

from functools import cached_property, lru_cache

import numpy as np

from wavesweep.engine._monodromy.unit_circle import on_circle


class Circle:
    """Frequencies (Hz) as points on the circles of a tick and of a frame of `ratio` ticks; rate:
    ticks per second.

    The angle per tick is kept in three parts whose multiples are exact: a frequency next to a
    multiple of the slow rate has an angle per frame next to 0, and all its digits are needed.
    """

    def __init__(self, frequency: np.ndarray, rate: float, ratio: int) -> None:
        self.frequency = frequency
        self.rate = rate
        self.ratio = ratio
        self.cycles = frequency / rate
        self.powers = np.ones((1, frequency.size), complex)
        product, error = _product(self.cycles, rate)
        self.high, self.low = _halves(self.cycles)
        self.rest = ((frequency - product) - error) / rate

    def at(self, index: slice | np.ndarray) -> "Circle":
        """Return some of the frequencies; the object itself if `index` is a slice of all of
        them."""
        if isinstance(index, slice) and index.start == 0 and index.stop >= self.frequency.size:
            return self
        return Circle(self.frequency[index], self.rate, self.ratio)

    def angle(self, count: int) -> np.ndarray:
        """Return `w count T`, rad, less full turns."""
        turns = np.round(self.cycles * count)
        return 2 * np.pi * (((self.high * count - turns) + self.low * count) + self.rest * count)

    def turn(self, count: int) -> np.ndarray:
        """Return `exp(j w count T)`."""
        angle = self.angle(count)
        return np.cos(angle) + 1j * np.sin(angle)

    def steps(self, count: int) -> np.ndarray:
        """Return `exp(j w count T) - 1`, to all digits."""
        return on_circle(self.angle(count))

    def ladder(self, count: int) -> np.ndarray:
        """`exp(j w i T)` for the first ticks i of a frame, `(count, points)`."""
        while (
            len(self.powers) < count
        ):  # always doubled, so that bits do not depend on what was asked before
            self.powers = np.concatenate([self.powers, self.powers * self.turn(len(self.powers))])
        return self.powers[:count]

    @cached_property
    def tick(self) -> np.ndarray:
        """`exp(j w T) - 1`."""
        return self.steps(1)

    @cached_property
    def frame(self) -> np.ndarray:
        """`exp(j w M T) - 1`, exactly 0 at multiples of the slow rate."""
        return self.steps(self.ratio)


@lru_cache(maxsize=4)  # loops are asked again and again for the same frequencies
def circle_of(frequencies: bytes, rate: float, ratio: int) -> Circle:
    """Return frequencies (Hz), the bytes of doubles, on the circles of such ticks and frames."""
    return Circle(np.frombuffer(frequencies), rate, ratio)


def _product(a: np.ndarray, b: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a product and its rounding error (Dekker 1971)."""
    high_a, low_a = _halves(a)
    high_b, low_b = _halves(b)
    product = a * b
    return product, ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b


def _halves(a: np.ndarray | float) -> tuple[np.ndarray | float, np.ndarray | float]:
    """Return two numbers of 26 bits whose sum is a."""
    far = 134217729.0 * a
    high = far - (far - a)
    return high, a - high
