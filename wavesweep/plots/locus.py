"""The figure of the closed-loop poles over a number: a root locus in the plane of the frame."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.plots.style import DOUBTFUL, ONE_COLUMN, family_map, figure, label, note_assumptions
from wavesweep.spec import Axis, Spec

End = tuple[float, np.ndarray, float, bool]
LOCUS = 300  # values of the number by default
REACH = 1.5  # what is farther from 0 is not shown
NEAR = 0.03  # of the width, about the poles that are shown


def locus_of(spec: Spec, axis: Axis) -> Any:
    """The root locus of a spec over the values of an axis, with the ends of the stable intervals between them."""
    from wavesweep.sweep.assumptions import assumes
    from wavesweep.sweep.poles import ends_on_circle, poles_over

    facts = {"spec": spec.tables(), "spec_name": spec.name, "assumes": assumes(spec, [axis.path])}
    return root_locus(axis.name, *poles_over(spec, axis), ends_on_circle(spec, axis), facts)


def root_locus(name: str, numbers: np.ndarray, z: np.ndarray, ends: Sequence[End], facts: Mapping[str, Any]) -> Any:
    """Draw poles z per frame, coloured by the number `name`, the unit circle, and the ends of its stable intervals.

    numbers, z: of each pole, `(poles,)`. ends: value, poles on the circle there, the strongest line of their
    oscillation (Hz), and whether the end is certified.
    """
    with figure(1.3 * ONE_COLUMN, 1.1 * ONE_COLUMN) as canvas:
        axes, turn = canvas.subplots(), np.exp(1j * np.linspace(0, 2 * np.pi, 721))
        axes.plot(turn.real, turn.imag, color="0.6", linewidth=0.8)
        dots = axes.scatter(z.real, z.imag, c=numbers, cmap=family_map(), s=4, linewidths=0, zorder=2)
        canvas.colorbar(dots, ax=axes, label=label(name, facts), shrink=0.85)
        for n, (value, on_circle, hz, certified) in enumerate(ends):
            said = f"{value:.6g}{f', {hz:.4g} Hz' if hz else ''}{'' if certified else ', not certified'}"
            style = {"markerfacecolor": "none", "markersize": 7, "color": "black" if certified else DOUBTFUL}
            axes.plot(on_circle.real, on_circle.imag, "osD^v<>"[n % 7], linestyle="none", label=said, zorder=3, **style)
        shown = z[np.abs(z) <= REACH]
        sides = [(part.min(), part.max()) for part in (np.append(shown.real, 1.0), np.append(shown.imag, 0.0))]
        half = (0.5 + NEAR) * max(high - low for low, high in sides) or 1.0
        limits = [((low + high) / 2 - half, (low + high) / 2 + half) for low, high in sides]
        axes.set(xlim=limits[0], ylim=limits[1])
        axes.set_aspect("equal")
        axes.set(xlabel="real part of z", ylabel="imaginary part of z")
        axes.grid(visible=True, color="0.9", linewidth=0.5)
        if ends:
            axes.legend(title="ends of stable intervals", fontsize=7, title_fontsize=7, loc="best")
        note_assumptions(canvas, facts)
    return canvas
