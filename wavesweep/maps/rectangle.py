"""The largest rectangle about a point of a plane that lies in its stable parts."""

from itertools import product

import numpy as np


def largest_about(point: np.ndarray, whole: np.ndarray, obstacles: np.ndarray) -> np.ndarray | None:
    """Return the largest rectangle `(2, 2)` that has the point and nothing of the obstacles inside;
    None if the point is within one, between two, or outside the whole.

    point: `(2,)`; whole: low and high ends of both coordinates, `(2, 2)`; obstacles: the same,
    `(obstacles, 2, 2)`.
    """
    if not ((whole[0] <= point) & (point <= whole[1])).all():
        return None
    low = obstacles[:, 0]
    high = obstacles[:, 1]
    across = (low[:, 0] < point[0]) & (point[0] < high[:, 0])
    on_level = (low[:, 1] < point[1]) & (point[1] < high[:, 1])
    if (across & on_level).any():
        return None
    bottoms = np.where(on_level, np.inf, np.where(high[:, 1] <= point[1], high[:, 1], whole[0, 1]))
    tops = np.where(on_level, -np.inf, np.where(low[:, 1] >= point[1], low[:, 1], whole[1, 1]))
    bottom = bottoms[across].max(initial=whole[0, 1])
    top = tops[across].min(initial=whole[1, 1])

    def reached(ends, order, edge):
        """How far rectangles go in one direction, and what bounds them until there."""
        steps = []
        bounds = bottom, top
        for at in order:
            met = max(bounds[0], bottoms[at]), min(bounds[1], tops[at])
            if met != bounds:
                steps.append((ends[at], *bounds))
                bounds = met
            if bounds[0] >= bounds[1]:
                return steps
        return [*steps, (edge, *bounds)]

    left = np.flatnonzero(high[:, 0] <= point[0])
    right = np.flatnonzero(low[:, 0] >= point[0])
    to_left = reached(high[:, 0], left[np.argsort(-high[left, 0])], whole[0, 0])
    to_right = reached(low[:, 0], right[np.argsort(low[right, 0])], whole[1, 0])
    rectangles = [whole[[0, 0]]]  # without an area
    for (start, *before), (stop, *after) in product(to_left, to_right):
        rectangles.append(((start, max(before[0], after[0])), (stop, min(before[1], after[1]))))
    sizes = np.diff(np.array(rectangles), axis=1)[:, 0].clip(0).prod(-1)
    largest = int(sizes.argmax())
    return np.array(rectangles[largest]) if sizes[largest] > 0 else None
