"""The verdict as a call, and the root locus as a method of a loop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.check import verdict as of_check
from wavesweep.core import api
from wavesweep.core.analyses.asked import Numbers, axes_asked, axis_along
from wavesweep.core.api import Source, spec_of
from wavesweep.core.plots.style import drawn_into
from wavesweep.core.spec.loading import naming

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Loop(api.Loop):
    """Methods of a compiled loop."""

    def plot_root_locus(self, number: str, values: Numbers | None = None, *, ax: Axes | None = None) -> Figure:
        """The poles per frame over a number: a matplotlib `Figure`, with the unit circle and the ends of stable intervals.

        number: named as an axis, see `Loop`. values: by default 300 over the span that the spec's [sweep] has for it. Ends,
        which are certified or marked as not certified, are those between the least and the largest value; a number that
        decides how the loop is built has none. Errors: UsageError if a spec would not accept a name or a value.
        """
        from wavesweep.check.locus import LOCUS, locus_of

        spec = naming(self.spec, [number])
        if values is None:
            span = axis_along(spec, number, None)
            values = np.linspace(span.start, span.stop, LOCUS)
        (axis,) = axes_asked(spec, {number: values})
        return drawn_into(ax, lambda: locus_of(spec, axis))


def verdict(source: Source) -> dict[str, Any]:
    """The verdict of `wavesweep check` on the own design of `source`, as a dict; see `wavesweep.check.verdict`."""
    return of_check.verdict(spec_of(source))
