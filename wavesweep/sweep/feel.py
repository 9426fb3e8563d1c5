"""What the hand feels over frequency, beside the stiffness at rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wavesweep.response.lifted import Lifted
from wavesweep.response.steady import respond
from wavesweep.spec import Spec
from wavesweep.sweep.drawn_loops import loop_at_hand

BAND_HZ = (1.0, 3.0, 10.0)  # of a hand that explores a wall
LOWEST_HZ, HIGHEST_HZ, POINTS = 1e-4, 100.0, 481
TENTH = 0.1  # of the stiffness at rest, what another may differ by and count as the same
SURE = 1e-6  # relative error of an impedance that is shown


def felt_over_band(loop: Lifted, stiffness: float) -> dict:
    """What the hand feels over frequency as a JSON-able dict: hz, and impedance (N/m, missing if it is not known) at each.

    stiffness: that at rest, N/m. holds_to_hz: the frequency up to which the size of the impedance is within a tenth of it; None
    if it is so up to `HIGHEST_HZ`, or half the fast rate. It is looked for at 80 frequencies a decade from 1e-4 Hz on, and then
    located to a thousandth; a resonance that is narrower may be missed.
    """
    most = min(HIGHEST_HZ, 0.499 * loop.port.rate)
    hertz = np.array([each for each in BAND_HZ if each <= most])
    found = respond(loop, hertz)
    size = np.where(found.impedance_error <= SURE, np.abs(found.impedance), np.nan)
    holds = None
    low, high = LOWEST_HZ, most
    for points in (POINTS, 81):
        grid = np.geomspace(low, high, points)
        away = np.flatnonzero(~(np.abs(np.abs(respond(loop, grid).impedance) / stiffness - 1) <= TENTH))
        if not away.size:
            break
        low, high = float(grid[max(away[0] - 1, 0)]), float(grid[away[0]])
        holds = low
    return {
        "hz": hertz.tolist(),
        "impedance": [float(each) if np.isfinite(each) else None for each in size],
        "holds_to_hz": holds,
    }


def band_at(spec: Spec, numbers: Mapping[str, float], stiffness: float) -> dict:
    """`felt_over_band` of a spec with other numbers, by name; missing ones are the spec's own. stiffness: at rest, N/m."""
    known = {spec.names.find(name).path: value for name, value in numbers.items() if not np.isnan(value)}
    return felt_over_band(loop_at_hand(spec.with_values(known)), stiffness)


def sizes_in_words(band: dict) -> list[str]:
    """Texts: what is felt at each frequency."""
    return [
        f"{'not known' if size is None else f'{size:.4g}' if size < 1e4 else f'{size:.0f}'} at {hz:g} Hz"
        for hz, size in zip(band["hz"], band["impedance"], strict=True)
    ]


def in_words(band: dict) -> str:
    """The text that follows the stiffness at rest, in brackets."""
    holds, sizes = band["holds_to_hz"], ", ".join(sizes_in_words(band))
    within = f"within a tenth of it {'up to' if holds >= 1 else 'only up to'} {holds:.3g} Hz" if holds is not None else ""
    texts = [text for text in (sizes, within) if text]
    return f" ({'; '.join(texts)})" if texts else ""
