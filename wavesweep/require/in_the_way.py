"""The mode that keeps a loop from what is required of its modes, where no interval has it."""

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loops.batch import Loops
from wavesweep.engine.stability.radii import drift_of, frames
from wavesweep.engine.stability.spectrum import damping_ratio, eigenvalues
from wavesweep.require.discs import RequiredCircle

PLACES = 65  # of the span, at which the modes are looked at


def mode_in_the_way(bound, loops: Loops, along: str, span: tuple[float, float]) -> dict[str, float]:
    """Of the value that comes nearest to what is required, the mode that misses it most; empty if no value makes a loop.

    bound: see `Bound`. loops: a single loop. along: path of the number, span: its range. value: of the number, one of PLACES.
    z_re, z_im: the eigenvalue of a frame. hz: frequency of the mode from frame to frame. time_constant_s: in which it falls to
    1/e, negative if it grows.
    """
    nearest, found = np.inf, {}
    for value in np.linspace(*span, PLACES + 2)[1:-1].tolist():
        with suppress(IllPosedLoopError):
            loop = loops.changed({along: value}).read
            drawn = loop.drawn()
            period = float(np.ravel(drawn.period)[0]) * drawn.ticks
            delta, finite = eigenvalues(frames(loop, drift_of(loop)).reshape(-1, *2 * (len(drift_of(loop).remaining),))[:1])
            if not finite.all() or not delta.size:
                continue
            beyond = _beyond(bound, delta, period)[0]
            if beyond.max() < nearest:
                nearest, found = beyond.max(), _described(value, delta[0, beyond.argmax()], period)
    return found


def _beyond(bound, delta, period):
    """By how much eigenvalues less 1 miss what is required."""
    if bound.bounded:
        return RequiredCircle().beyond(delta)
    with np.errstate(divide="ignore"):
        beyond = np.log(np.abs(1 + delta)) - np.log(bound.radius_of(period))
    return np.maximum(beyond, bound.damped.spiral(period).beyond(delta)) if bound.damped else beyond


def _described(value, delta, period) -> dict[str, float]:
    with np.errstate(divide="ignore"):
        s = np.log1p(complex(delta)) / period
    return {
        "value": value,
        "z_re": float(1 + delta.real),
        "z_im": float(abs(delta.imag)),
        "hz": float(abs(s.imag)) / (2 * np.pi),
        "damping_ratio": float(damping_ratio(delta)),
        "time_constant_s": float(-1 / s.real),
    }


def words_of_mode(mode: Mapping[str, float], name: str, unit: str) -> str:
    """The mode in words; name, unit: of the number along which the intervals are."""
    imaginary = f" +- {mode['z_im']:.4g}j" if mode["z_im"] else ""
    time = mode["time_constant_s"]
    lasts = f"falls to 1/e in {time:.4g} s" if time > 0 else f"grows by e in {-time:.4g} s"
    said = f"{mode['hz']:.4g} Hz, damping ratio {mode['damping_ratio']:.3g}, {lasts}"
    place = f"nearest at {name} = {mode['value']:.6g}{unit}"
    return f"{place}, where the mode z = {mode['z_re']:.4g}{imaginary} ({said}) is in the way"
