"""Scales of axes, and their ticks."""

from typing import Any

import numpy as np


def by_factors(axis: Any, low: float, high: float) -> None:
    """Set a logarithmic scale from `low` to `high`; over less than two decades it has plain
    numbers."""
    from matplotlib.ticker import AutoLocator, FuncFormatter, LogLocator, NullFormatter

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    if high < 100 * low:
        axis.set_major_locator(
            # Up to this ratio of its ends a logarithmic axis has ticks at equal steps.
            LogLocator(subs=(1.0, 2.0, 5.0)) if high > 5.0 * low else AutoLocator()
        )
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def scale_magnitudes(axes: Any) -> None:
    """Set a logarithmic scale. Over less than two decades it has plain numbers at 1, 2, 5, since
    powers of ten are too few.

    Values that are much alike have a linear one.
    """
    of_lines = [np.asarray(line.get_ydata(), float) for line in axes.lines]
    values = np.concatenate([np.zeros(0), *of_lines])
    values = values[values > 0]
    if not values.size:
        return  # nothing is known, or all is 0, as the static impedance of free space
    if values.max() < 2.6 * values.min():  # there may be no 1, 2 or 5 in it
        _at_least(axes, 0.02 * values.max())  # of the largest value, that an axis shows at least
        return
    axes.set_yscale("log")
    by_factors(axes.yaxis, *axes.get_ylim())


def _at_least(axes: Any, span: float) -> None:
    """Show no less than this span about the middle, with plain numbers, so that rounding is not
    taken for a difference."""
    low, high = axes.get_ylim()
    if high - low < span:
        axes.set_ylim((low + high - span) / 2, (low + high + span) / 2)
    axes.ticklabel_format(axis="y", useOffset=False)


def in_degrees(axes: Any, continued: bool) -> None:
    """Ticks every 45 or 90 degrees, or finer if a phase varies by less; matplotlib's own if it
    hardly varies.

    continued: whether phases go on at 180 degrees; then ticks are farther apart, too.
    """
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_ylim()
    if high - low < 3:
        _at_least(axes, 1.0)  # degree that an axis of a phase shows at least
        return
    steps = [1, 2, 5, 15, 45, 90]
    if continued:
        steps += [180 * 2**power for power in range(20)]
    step = next((step for step in steps if high - low <= 6 * step), 90)
    axes.yaxis.set_major_locator(MultipleLocator(step))
    if not continued:
        axes.set_ylim(max(low, -190), min(high, 190))


def is_logarithmic(values: np.ndarray) -> bool:
    """Whether an axis is spaced by a constant factor, so that its scale is logarithmic."""
    steps = np.unique(values)
    if len(steps) < 4 or steps[0] <= 0:
        return False
    return bool(np.ptp(np.diff(np.log(steps))) < 1e-6 * np.log(steps[-1] / steps[0]))


def goes_by_factors(values: np.ndarray) -> bool:
    """Whether a scale of factors suits values of any spacing, by which of both spacings is more
    even, or by their range."""
    steps = np.unique(values)
    if len(steps) < 3:
        return False
    ratio = steps[-1] / steps[0]
    unevenness = np.ptp(np.diff(steps)) / np.ptp(steps)
    unevenness_of_factors = np.ptp(np.diff(np.log(steps))) / np.log(ratio)
    if min(unevenness, unevenness_of_factors) > 1e-6:
        return bool(ratio > 20)
    return bool(unevenness_of_factors < unevenness or ratio > 200)
