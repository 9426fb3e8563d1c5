"""The mode that keeps a loop from being stable, or from what is required of its modes, where no
interval is."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import damping_ratio, eigenvalues, lines_of_each, named_modes
from wavesweep.program.analyses.poles import ON_CIRCLE, leading
from wavesweep.program.number_words import lasting

SPAN_PLACES = 33  # inside a span, at which the modes are looked at, beside its ends
SAME_EIGENVALUE = 1e-9  # distance of two, up to which they are one: 1 is that of a mode that stays

Beyond = Callable[[np.ndarray, np.ndarray, float], np.ndarray]
"""By how much eigenvalues less 1 are outside of where they have to be, from these, what their
modes turn in a frame by their lines in the spectrum (rad), and the frame's period (s)."""


def outside(delta: np.ndarray, _: np.ndarray, __: float) -> np.ndarray:
    """By how much eigenvalues less 1 are outside of the unit circle, in the logarithm."""
    with np.errstate(divide="ignore"):
        return np.log(np.abs(1 + delta))


def mode_in_the_way(
    loops: Loops, path: str, span: tuple[float, float], beyond: Beyond, *, by_lines: bool = False
) -> dict[str, Any]:
    """Of the value that comes nearest, the mode that is farthest outside; empty if no value makes a
    loop, or a large one. Values at which the loop is stable come before all others.

    loops: a single loop. path: path of the number, span: its range. value: of the number, one of
    SPAN_PLACES in it or an end, but not 0, where a loop may fall apart. z_re, z_im: the eigenvalue
    of a frame. hz, damping_ratio: of its strongest line in the spectrum. time_constant_s: in which
    it falls to 1/e, negative if it grows, None if it stays. states: that take part. by_lines:
    whether what is beyond depends on the lines.
    """
    nearest, mode = (True, np.inf), {}
    places = np.linspace(*span, SPAN_PLACES + 2)
    for value in places[places != 0].tolist():
        with suppress(IllPosedLoopError):
            loop = loops.changed({path: value}).read
            drawn, drift = loop.drawn(), loop.drift_of_frames()
            # Of more states a look at the modes takes over a tenth of a second at each place.
            if len(drift.remaining) > 200:
                return {}
            E = loop.frames(drift)
            names, (delta, shares) = named_modes(E.reshape(E.shape[-2:]), drawn, drift)
            period = float(np.ravel(drawn.period)[0]) * drawn.ticks
            turns = np.abs(np.angle(1 + delta))
            if by_lines:
                turns = turns_of_modes(loop, delta)
            amount = beyond(delta, turns, period)
            if not delta.size:
                continue
            distance = bool((np.abs(1 + delta) >= 1).any()), amount.max()
            if distance < nearest:
                nearest, worst = distance, int(amount.argmax())
                (turned,) = turns_of_modes(loop, delta[[worst]])
                mode = _described(value, complex(delta[worst]), turned, period) | {
                    "states": leading(names, shares[worst])
                }
    return mode


def only_oscillates(delta: np.ndarray) -> bool:
    """Whether all modes are pairs on the unit circle, as those of a loop that conserves energy;
    delta: eigenvalues less 1."""
    z = 1 + delta
    z = z[np.abs(z) > ON_CIRCLE]  # the others are over after one frame
    return bool(((np.abs(np.abs(z) - 1) <= ON_CIRCLE) & (np.abs(z.imag) > ON_CIRCLE)).all())


def conserves(loops: Loops) -> bool:
    """Whether a single loop seems to conserve energy: all of its modes are pairs on the unit
    circle but for rounding."""
    E = loops.frames(loops.drift_of_frames())
    return only_oscillates(eigenvalues(E)[0].ravel())


def turns_of_modes(loop: Loops, delta: np.ndarray) -> np.ndarray:
    """What the modes of a single loop turn in a frame (rad) by their strongest lines; delta:
    their eigenvalues less 1."""
    drawn = loop.drawn()
    period = float(np.ravel(drawn.period)[0]) * drawn.ticks
    with np.errstate(divide="ignore"):
        modes = np.log1p(delta)
    lines = [lines[0, 0] for lines in lines_of_each(loop, [*modes.reshape(-1, 1, 1)])]
    return 2 * np.pi * period * np.array(lines)


def _described(value: float, delta: complex, turned: float, period: float) -> dict[str, Any]:
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log1p(delta) / period
        ratio = float(damping_ratio(delta, turned))
    stays = abs(delta) <= SAME_EIGENVALUE
    return {
        "value": value,
        "z_re": 1 + delta.real,
        "z_im": abs(delta.imag),
        "hz": float(turned) / (2 * np.pi * period),
        "damping_ratio": None if stays else ratio,
        "time_constant_s": None if stays else float(-1 / s.real),
    }


def mode_in_words(mode: Mapping[str, Any], name: str, unit: str) -> str:
    """A mode that is in the way, in words; name, unit: of the number along which the intervals
    are. Or the requirements of a value that comes nearest to all."""
    place = f"nearest of those looked at: {name} = {mode['value']:.6g}{unit}"
    if "requirements" in mode:
        return f"{place}, {requirements_in_words(mode['requirements'])}"
    imaginary = f" +- {mode['z_im']:.4g}j" if mode["z_im"] else ""
    time = mode["time_constant_s"]
    if time is None:
        return stays_in_words(mode["states"])
    said = f"{mode['hz']:.4g} Hz, damping ratio {mode['damping_ratio']:.3g}, {lasting(time)}"
    states = f" of {', '.join(mode['states'])}" if mode["states"] else ""
    return (
        f"{place}, where the mode z = {mode['z_re']:.4g}{imaginary}{states} is in the way ({said})"
    )


def requirements_in_words(requirements: Mapping[str, Mapping[str, Any]]) -> str:
    """What a value misses and meets of what is required."""
    said: dict[bool, list[str]] = {False: [], True: []}
    for word, requirement in requirements.items():
        value, bound, more = (requirement[key] for key in ("value", "bound", "more"))
        limit = "at least" if more else "at most"
        is_met = value >= bound if more else value <= bound
        said[is_met].append(f"{word} {value:.4g} ({limit} {bound:.6g})")
    parts = [f"misses {', '.join(said[False])}" if said[False] else ""]
    parts.append(f"meets {', '.join(said[True])}" if said[True] else "")
    return f"which {' and '.join(filter(None, parts))}"


def stays_in_words(states: Sequence[str]) -> str:
    """A mode that neither grows nor decays; states: that take part in it."""
    advice = "with a little that does (friction, of masses) the other modes decide"
    return f"a mode of {', '.join(states)} stays as it is, as nothing opposes it; {advice}"
