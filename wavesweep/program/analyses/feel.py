"""What the hand feels at rest, and over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, partial

import numpy as np

from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.response import Lifted, respond, static_response
from wavesweep.program.analyses.spec_loops import loop_at_hand
from wavesweep.program.spec import Spec

# a grid, and points of a finer one between two of it
LOWEST_HZ, HIGHEST_HZ, POINTS, FINE = 1e-4, 100.0, 481, 81
FALL, FALLS = 8.0, 8  # a mode may be slower: then it is looked at so many times lower frequencies
ROUGHLY = 1e-3  # of itself, what a damping may be off by that is worth a number
# states; of more, hundreds of frequencies take minutes, and `bode` has those that are asked for
MOST_FELT_STATES = 300


def felt_over_band(spec: Spec, loop: Lifted, stiffness: float) -> dict | None:
    """What the hand feels of the wall over frequency as a JSON-able dict; None without a wall that
    can be taken away, or that adds something at rest.

    It is what the wall adds to free motion: the impedance less that of the same loop whose wall has
    the stiffness and damping
    0. So neither a mass counts nor a brake. loop: that of the spec at the hand. stiffness: that at
       rest, N/m.
    hz; at each impedance (N/m), its size, and free (N/m), the size of that of free motion, both
    missing if they are not known. holds_to_hz: the frequency up to which the size is within a tenth
    of that at rest, None if it is so up to `HIGHEST_HZ`, or half the fast rate.
    outweighed_bands_hz: [from, to] in which free motion has more than the wall adds; to is None of
    one that goes on; outweighed_hz: where the first begins, None without. They are looked for at 80
    frequencies a decade from 1e-4 Hz on, and located to a thousandth; a resonance that is narrower
    may be missed.
    """
    if not spec.wall:
        return None
    try:
        free = loop_at_hand(spec.with_values(dict.fromkeys(spec.wall, 0.0)))
    except WavesweepError:  # a drawing that divides by a number of its wall
        return None
    if free is None:
        return None
    highest = min(HIGHEST_HZ, 0.499 * loop.port.rate)
    # Of a hand that explores a wall.
    hertz = np.array([number for number in (1.0, 3.0, 10.0) if number <= highest])
    *sizes, sure = _added(loop, free, hertz)
    felt = {
        name: [float(number) if ok else None for number, ok in zip(size, sure, strict=True)]
        for name, size in zip(("impedance", "free"), sizes, strict=True)
    }
    rest = stiffness - np.nan_to_num(static_response(free)[1].ravel()[0].real)
    if abs(rest) <= 1e-9 * stiffness:  # the hand slides on the wall, but for rounding
        return None
    frequencies = np.geomspace(LOWEST_HZ, highest, POINTS)
    added = cache(
        lambda *ends: _added(loop, free, frequencies if not ends else np.geomspace(*ends, FINE))
    )
    # What another may differ by and count as the same, of the stiffness at rest.
    changed = _runs(frequencies, lambda *ends: ~(np.abs(added(*ends)[0] / rest - 1) <= 0.1))
    felt["holds_to_hz"] = next((before for before, *_ in changed), None)
    bands = [
        band for _, *band in _runs(frequencies, lambda *ends: np.greater(*added(*ends)[1::-1]))
    ]
    first = bands[0][0] if bands else None
    return {"hz": hertz.tolist(), **felt, "outweighed_hz": first, "outweighed_bands_hz": bands}


def _runs(grid, so):
    """Yield the runs of frequencies at which something is so: the last one before, the first and
    the last of it.

    so(): at all of the grid; so(low, high): at FINE frequencies between two of it. The last is None
    of one that goes on.
    """
    changes = np.flatnonzero(np.diff(so(), prepend=False, append=False))
    for first, beyond in changes.reshape(-1, 2).tolist():
        begin = (grid[max(first - 1, 0)], grid[first])
        fine = np.geomspace(*begin, FINE)
        index = int(np.argmax(so(*begin)))
        last = None
        if beyond < grid.size:
            end = (grid[beyond - 1], grid[beyond])
            at_last = np.flatnonzero(so(*end)).max(initial=0)
            last = np.geomspace(*end, FINE)[at_last].item()
        yield float(fine[max(index - 1, 0)]), float(fine[index]), last


def _added(loop, free, hertz):
    """The sizes of what the wall adds to the impedance and of that of free motion, and whether
    they are known, at each Hz."""
    walled = respond(loop, hertz)
    without = respond(free, hertz)
    with np.errstate(all="ignore"):
        added = np.abs(walled.impedance - without.impedance)
        size_free = np.abs(without.impedance)
        off = (
            np.abs(walled.impedance) * walled.impedance_error + size_free * without.impedance_error
        )
        return added, size_free, off <= 1e-6 * added  # relative error of an impedance that is shown


def sizes_in_words(band: Mapping[str, object] | None) -> list[str]:
    """Texts: what is felt at each frequency at which free motion has no more than the wall adds."""
    if not band:
        return []
    texts = []
    for hz, size in zip(band["hz"], band["impedance"], strict=True):
        bands = band["outweighed_bands_hz"]
        if any(low <= hz and (high is None or hz <= high) for low, high in bands):
            continue
        felt = "not known"
        if size is not None:
            felt = f"{size:.4g}" if size < 1e4 else f"{size:.0f}"
        texts.append(f"{felt} at {hz:g} Hz")
    return texts


def outweighed_in_words(band: Mapping[str, object]) -> str:
    """Where free motion has more than the wall adds; empty if it has nowhere."""
    bands = []
    for low, high in band["outweighed_bands_hz"]:
        start = "up" if low == LOWEST_HZ and high else f"from {low:.3g}"
        end = "Hz on" if high is None else f"to {high:.3g} Hz"
        bands.append(f"{start} {end}")
    said = " and ".join(filter(None, [", ".join(bands[:-1]), *bands[-1:]]))
    if said:
        return f"free motion outweighs it {said}"
    return ""


def felt_at_rest(spec: Spec, loop) -> dict | None:
    """Stiffness and damping of the wall as the hand feels it towards 0 Hz; None without a hand.

    `felt_over_band` is beside them if the loop has up to MOST_FELT_STATES states.
    """
    if loop is None:
        return None
    admittance, stiffness = (value.ravel()[0].real for value in static_response(loop)[:2])
    if admittance == 0:
        return {"stiffness": None, "damping": None, "rigid": True}
    # A frequency so low that the impedance is that of a spring and a damper, as a rule.
    damping = _damping(partial(respond, loop), 8e-4 * loop.port.rate / loop.frame.ticks)
    small = loop.order <= MOST_FELT_STATES
    if stiffness > 0 and small:
        band = felt_over_band(spec, loop, stiffness)
    else:
        band = None
    return {
        "stiffness": float(stiffness) if np.isfinite(stiffness) else None,
        "damping": float(damping) if np.isfinite(damping) else None,
        "rigid": False,
        "over_band": band,
    }


def _damping(response, low):
    """Imaginary part of the impedance over frequency towards 0 Hz; NaN if it is not known to
    ROUGHLY.

    It is extrapolated from pairs of ever lower frequencies, from `low` Hz on. Lower down a slow
    mode does less, and rounding more: a pair is as good as it agrees with one next to it, and its
    own rounding allows. Pairs above a slow mode may agree better than those below it, so the best
    is looked for among those that agree with the lowest good one, and nothing is known if one
    further down differs by more than its rounding. response: of frequencies.
    """
    frequency = low * np.array([1, 0.5]) / FALL ** np.arange(FALLS)[:, None]
    at_port = response(frequency.ravel())
    impedance = at_port.impedance.reshape(frequency.shape)
    error = at_port.impedance_error.reshape(frequency.shape)
    with np.errstate(all="ignore"):
        values = impedance.imag / (2 * np.pi * frequency)
        unsure = error * np.abs(impedance) / (2 * np.pi * frequency)
        # Extrapolated to 0 Hz: a damping is even in frequency, and the second of a pair is half the
        # first.
        damping = (4 * values[:, 1] - values[:, 0]) / 3
        rounding = (4 * unsure[:, 1] + unsure[:, 0]) / 3
        apart = np.pad(np.abs(np.diff(damping)), 1, constant_values=np.inf)
        off = np.fmin(apart[:-1], apart[1:]) + rounding
        off = np.where(np.isnan(off), np.inf, off)
        good = np.flatnonzero(off <= ROUGHLY * np.abs(damping))
        if good.size:
            alike = np.abs(damping - damping[good[-1]]) <= ROUGHLY * np.abs(damping[good[-1]])
            off = np.where(alike, off, np.inf)
        best = np.argmin(off)
        below = np.abs(damping[best + 1 :] - damping[best]) > rounding[best + 1 :] + off[best]
        if below.any():
            return np.nan
        if off[best] <= ROUGHLY * np.abs(damping[best]):
            return damping[best]
        # What a damping of 0 may be off by, of the impedance over the highest frequency.
        nothing = abs(damping[best]) <= off[best] <= 1e-9 * np.abs(impedance[0, 0]) / low
        return 0.0 if nothing else np.nan
