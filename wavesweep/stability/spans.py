"""Parts of the spans of columns: which touch, and which values lie in them, for all columns at once."""

import numpy as np


def merged(column, left, right):
    """Parts that touch as one; parts of a column do not overlap."""
    order = np.lexsort((left, column))
    column, left, right = column[order], left[order], right[order]
    apart = (np.diff(column) != 0) | (left[1:] > right[:-1])
    first, last = np.append(True, apart)[: column.size], np.append(apart, True)[: column.size]
    return column[first], left[first], right[last]


def are_in(column, value, owner, left, right):
    """Which of the values of these columns lie in one of the parts (owner, left, right) of their column."""
    place, who = np.concatenate([left, right, value]), np.concatenate([owner, owner, column])
    step = np.repeat([1, -1, 0], [left.size, right.size, value.size])
    order = np.lexsort((place, who))
    depth = np.empty(place.size, int)
    depth[order] = np.cumsum(step[order])
    return depth[left.size + right.size :] > 0


def weight_touching(column, left, right, owner, low, high, weight):
    """The sum of the weights of those parts (owner, low, high) that touch each part (column, left, right)."""
    before = _summed(column, left, owner, high, weight, strictly=True)  # of those that end before it
    return _summed(column, right, owner, low, weight, strictly=False) - before


def _summed(column, place, owner, value, weight, *, strictly):
    """The sum of the weights of the values of these columns below each place, or up to it."""
    who, where = np.concatenate([owner, column]), np.concatenate([value, place])
    asks = np.repeat([0, 1], [owner.size, column.size])
    order = np.lexsort((-asks if strictly else asks, where, who))
    total = np.empty(who.size)
    total[order] = np.cumsum(np.concatenate([weight, np.zeros(column.size)])[order])
    return total[owner.size :]
