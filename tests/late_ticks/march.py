"""Late ticks marched by hand: two controllers as a program runs them, on a mass that moves for the true length of each tick.

Nothing of the package is used: the plant is a matrix exponential, the rest are sums.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm


@dataclass(frozen=True)
class Program:
    """A wall at the slow rate: direct coupling, or waves behind a first-order low-pass or the mean of a frame; explicit
    integration, SI units."""

    waves: bool
    ratio: int
    delay: int
    mass: float
    damping: float
    K: float
    B: float
    difference: bool
    tick: float = 1e-3
    b: float = 10.0
    cutoff_hz: float = 10.0
    Kp: float = 0.0
    mean: bool = False

    @property
    def tables(self):
        """The same as a spec."""
        return {
            "rates": {"fast_hz": 1 / self.tick, "ratio": self.ratio},
            "device": {
                "mass": self.mass,
                "damping": self.damping,
                "velocity": "difference" if self.difference else "exact",
            },
            "environment": {
                "K_VE": self.K,
                "B_VE": self.B,
                "integration": "explicit",
                "delay": self.delay,
            },
            "controller": {"kind": "pmw-mean" if self.mean else "pmw", "b": self.b, "Kp": self.Kp}
            if self.waves
            else {"kind": "dc-slow"},
            "filters": {"lp1": {"order": 1, "cutoff_hz": self.cutoff_hz}} if self.waves and not self.mean else {},
        }

    def moved(self, state, lengths):
        """The states after ticks of these lengths, the first of a frame first; state: `(8, n)` columns."""
        x, v, before, low, x_s, shown, coming, shown_x = state
        coming_x = x_s
        for k, length in enumerate(lengths):
            phase = k % self.ratio
            if phase == self.delay % self.ratio:
                shown, shown_x = coming, coming_x
            speed = (x - before) / self.tick if self.difference else v
            if self.waves:
                wave = shown + self.Kp * (shown_x - x)
                force = self.b * speed - np.sqrt(2 * self.b) * wave
                out = np.sqrt(2 * self.b) * speed - wave
                w = np.tan(np.pi * self.cutoff_hz * self.tick)
                filtered = (w * out + low) / (1 + w)  # trapezium: y (1 + w) = w u + state
                if self.mean:
                    filtered = (low + out) / self.ratio
                    low = low + out if phase else 0 * out
                else:
                    low = filtered * (1 - w) + w * out
                if phase == 0:
                    rate = (np.sqrt(2 * self.b) * filtered - self.K * x_s) / (self.b + self.B)
                    pull = self.K * x_s + self.B * rate
                    coming = filtered - np.sqrt(2 / self.b) * pull
                    x_s = x_s + self.ratio * self.tick * rate
                    coming_x = x_s
            else:
                if phase == 0:
                    coming = self.K * x + self.B * speed
                force = shown
            before = x
            A = np.array([[0, 1, 0], [0, -self.damping / self.mass, -1 / self.mass], [0, 0, 0]])
            step = expm(A * length)[:2]
            x, v = step @ np.array([x, v, force])
        return np.array([x, v, before, low, x_s, shown, coming, shown_x])

    def growth(self, lengths):
        """The eigenvalues of a pattern of lengths, largest first, as absolute values."""
        matrix = self.moved(np.eye(8), lengths)
        return np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]
