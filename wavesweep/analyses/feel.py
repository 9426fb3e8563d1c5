"""What the hand feels at rest, and over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from wavesweep.analyses.loops import loop_at_hand
from wavesweep.errors import WavesweepError
from wavesweep.response.lifted import Lifted
from wavesweep.response.steady import respond, static_response
from wavesweep.spec import Spec

BAND_HZ = (1.0, 3.0, 10.0)  # of a hand that explores a wall
LOWEST_HZ, HIGHEST_HZ, POINTS, FINE = 1e-4, 100.0, 481, 81
TENTH = 0.1  # of the stiffness at rest, what another may differ by and count as the same
SLOW_SHARE = 8e-4  # of the slow rate: a frequency so low that the impedance is that of a spring and a damper, as a rule
FALL, FALLS = 8.0, 8  # a mode may be slower: then it is looked at so many times lower frequencies
NOTHING = 1e-9  # of the impedance over the highest frequency, what a damping of 0 may be off by
ROUGHLY = 1e-3  # of itself, what a damping may be off by that is worth a number
SURE = 1e-6  # relative error of an impedance that is shown


def felt_over_band(spec: Spec, loop: Lifted, stiffness: float) -> dict | None:
    """What the hand feels of the wall over frequency as a JSON-able dict; None without a wall that can be taken away.

    It is what the wall adds to free motion: the impedance less that of the same loop whose wall has the stiffness and damping
    0. So neither a mass counts nor a brake. loop: that of the spec at the hand. stiffness: that at rest, N/m.
    hz; at each impedance (N/m), its size, and free (N/m), the size of that of free motion, both missing if they are not known.
    holds_to_hz: the frequency up to which the size is within a tenth of that at rest; outweighed_hz: that from which on free
    motion has more than the wall adds; both None if there is none up to `HIGHEST_HZ`, or half the fast rate. They are looked
    for at 80 frequencies a decade from 1e-4 Hz on, and located to a thousandth; a resonance that is narrower may be missed.
    """
    try:
        free = loop_at_hand(spec.with_values(dict.fromkeys(spec.wall, 0.0))) if spec.wall else None
    except WavesweepError:  # a drawing that divides by a number of its wall
        free = None
    if free is None:
        return None
    most = min(HIGHEST_HZ, 0.499 * loop.port.rate)
    hertz = np.array([each for each in BAND_HZ if each <= most])
    *sizes, sure = _added(loop, free, hertz)
    found = {
        name: [float(each) if ok else None for each, ok in zip(size, sure, strict=True)]
        for name, size in zip(("impedance", "free"), sizes, strict=True)
    }
    rest = stiffness - np.nan_to_num(static_response(free)[1].ravel()[0].real)
    whole = np.geomspace(LOWEST_HZ, most, POINTS)
    seen = _added(loop, free, whole)
    for name, place, where in (
        ("holds_to_hz", 0, lambda size, *_: ~(np.abs(size / rest - 1) <= TENTH)),
        ("outweighed_hz", 1, lambda size, without, _: without > size),
    ):
        ends = _around(whole, where(*seen))
        fine = np.geomspace(*ends, FINE) if ends else whole[:0]
        ends = ends and _around(fine, where(*_added(loop, free, fine)))
        found[name] = ends and ends[place]
    return {"hz": hertz.tolist(), **found}


def _around(grid, so):
    """The numbers of a grid before which something is not so, and at which it is so first; None if it is so at none."""
    at = np.flatnonzero(so)
    return (float(grid[max(at[0] - 1, 0)]), float(grid[at[0]])) if at.size else None


def _added(loop, free, hertz):
    """The sizes of what the wall adds to the impedance and of that of free motion, and whether they are known, at each Hz."""
    found, without = respond(loop, hertz), respond(free, hertz)
    with np.errstate(all="ignore"):
        added = np.abs(found.impedance - without.impedance)
        off = sum(np.abs(each.impedance) * each.impedance_error for each in (found, without))
        return added, np.abs(without.impedance), off <= SURE * added


def band_at(spec: Spec, numbers: Mapping[str, float], stiffness: float) -> dict | None:
    """`felt_over_band` of a spec with other numbers, by name; missing ones are the spec's own. stiffness: at rest, N/m."""
    known = {spec.names.find(name).path: value for name, value in numbers.items() if not np.isnan(value)}
    there = spec.with_values(known)
    return felt_over_band(there, loop_at_hand(there), stiffness)


def sizes_in_words(band: Mapping[str, object] | None) -> list[str]:
    """Texts: what is felt at each frequency, up to that from which on free motion has more than the wall adds."""
    most = band["outweighed_hz"] if band else None
    pairs = zip(band["hz"], band["impedance"], strict=True) if band else ()
    return [
        f"{'not known' if size is None else f'{size:.4g}' if size < 1e4 else f'{size:.0f}'} at {hz:g} Hz"
        for hz, size in pairs
        if most is None or hz < most
    ]


def in_words(band: Mapping[str, object] | None) -> str:
    """The text that follows the stiffness at rest, in brackets."""
    holds, most = (band and band[name] for name in ("holds_to_hz", "outweighed_hz"))
    parts = [", ".join(sizes_in_words(band))]
    if holds:
        parts.append(f"within a tenth of it {'up to' if holds >= 1 else 'only up to'} {holds:.3g} Hz")
    if most:
        parts.append(f"free motion outweighs it from {most:.3g} Hz on")
    return f" ({'; '.join(filter(None, parts))})" if any(parts) else ""


def felt_at_rest(spec: Spec, loop) -> dict | None:
    """Stiffness and damping of the wall as the hand feels it towards 0 Hz, and `felt_over_band`; None without a hand."""
    if loop is None:
        return None
    admittance, stiffness = (part.ravel()[0].real for part in static_response(loop)[:2])
    if admittance == 0:
        return {"stiffness": None, "damping": None, "rigid": True}
    damping = _damping(partial(respond, loop), SLOW_SHARE * loop.port.rate / loop.frame.ticks)
    band = felt_over_band(spec, loop, stiffness) if stiffness > 0 else None
    stiffness, damping = (float(each) if np.isfinite(each) else None for each in (stiffness, damping))
    return {"stiffness": stiffness, "damping": damping, "rigid": False, "over_band": band}


def _damping(response, low):
    """Imaginary part of the impedance over frequency towards 0 Hz; NaN if it is not known to ROUGHLY.

    It is extrapolated from pairs of ever lower frequencies, from `low` Hz on. Lower down a slow mode does less, and rounding
    more: a pair is as good as it agrees with one next to it, and its own rounding allows. Pairs above a slow mode may agree
    better than those below it, so the best is looked for among those that agree with the lowest good one, and nothing is known
    if one further down differs by more than its rounding. response: of frequencies.
    """
    frequency = low * np.array([1, 0.5]) / FALL ** np.arange(FALLS)[:, None]
    found = response(frequency.ravel())
    impedance, error = (part.reshape(frequency.shape) for part in (found.impedance, found.impedance_error))
    with np.errstate(all="ignore"):
        values, unsure = impedance.imag / (2 * np.pi * frequency), error * np.abs(impedance) / (2 * np.pi * frequency)
        damping, rounding = (4 * values[:, 1] - values[:, 0]) / 3, (4 * unsure[:, 1] + unsure[:, 0]) / 3
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
        nothing = abs(damping[best]) <= off[best] <= NOTHING * np.abs(impedance[0, 0]) / low
        return 0.0 if nothing else np.nan
