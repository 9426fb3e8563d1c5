"""The figure of measured frames: how often each length occurs, and which follow which."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns
from wavesweep.program.plots.labels import as_it_stands
from wavesweep.program.plots.style import (
    GRID,
    TWO_COLUMNS,
    distinct_colour,
    figure,
    note_below,
    warn_above,
)


def identify_frames(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw an `identify-frames` table: the share of each length, and a disc for each pair, whose
    area is its share."""
    ticks = np.array([row["ticks"] for row in facts["lengths"]])
    shares = np.array([row["frames"] for row in facts["lengths"]]) / facts["frames"]
    with figure(TWO_COLUMNS, 3.0) as canvas:
        left, right = canvas.subplots(1, 2)
        left.bar(ticks, 100 * shares, width=0.8 * facts["every"], color=distinct_colour(0))
        left.set(xlabel="length of a frame (ticks)", ylabel="share (%)")
        right.scatter(
            columns["ticks"],
            columns["next_ticks"],
            60 * columns["share"],
            color=distinct_colour(1),
            linewidths=0,
        )
        right.set(xlabel="length of a frame (ticks)", ylabel="length of the next (ticks)")
        for axes in (left, right):
            axes.grid(**GRID)
            axes.set_axisbelow(True)
            axes.xaxis.get_major_locator().set_params(integer=True)
        right.yaxis.get_major_locator().set_params(integer=True)
        independent = "do not depend" if facts["independent"] else "depend"
        note_below(
            canvas, as_it_stands(f"{facts['frames']} frames; lengths {independent} on those before")
        )
        unfit = facts["unfit"]["frames"]
        if facts["every"] == 1:
            counted = "whole ticks"
        else:
            counted = f"multiples of {facts['every']} ticks, and count as such"
        warn_above(
            canvas, f"{unfit} of {facts['frames']} frames do not last {counted}" if unfit else ""
        )
    return canvas
