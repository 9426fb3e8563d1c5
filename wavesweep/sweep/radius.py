"""Spectral radius over a product of axes."""

import numpy as np

from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import draw
from wavesweep.lifted import cut_at_wall
from wavesweep.sweep.grid import make_grid
from wavesweep.sweep.groups import groups
from wavesweep.sweep.slices import with_batch


def radius_over(spec, axes, cut=None) -> np.ndarray:
    """Spectral radius per frame of `ratio` ticks for every combination of the axes, flat, the first axis slowest.

    cut: the loop of the spec's own values, used where only the wall is swept.
    """
    grid = make_grid(spec, axes)
    K, B = grid.wall_values().values()
    found = np.empty((grid.loops, grid.walls))
    for members, values in groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops):
        diagram = draw(values)
        loops = cut if cut is not None and not grid.loop_axes else cut_at_wall(diagram)
        radius = spectral_radius(with_batch(loops, members.size).at((slice(None), None)), K, B)
        # A loop may have a frame of fewer ticks, as the ideal coupling has; counted per frame of the spec, controllers compare.
        with np.errstate(over="ignore"):
            found[members] = radius ** (values["rates.ratio"] // diagram.ratio)
    loop, wall = grid.column_of(np.arange(grid.size))
    return found[loop, wall]
