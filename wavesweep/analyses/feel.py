"""What the hand feels over frequency, beside the stiffness at rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wavesweep.analyses.loops import loop_at_hand
from wavesweep.errors import WavesweepError
from wavesweep.response.lifted import Lifted
from wavesweep.response.steady import respond, static_response
from wavesweep.spec import Spec

BAND_HZ = (1.0, 3.0, 10.0)  # of a hand that explores a wall
LOWEST_HZ, HIGHEST_HZ, POINTS, FINE = 1e-4, 100.0, 481, 81
TENTH = 0.1  # of the stiffness at rest, what another may differ by and count as the same
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
