"""Titles, names of axes and names of bars have room at any width."""

from itertools import combinations

import pytest

from wavesweep.program.plots.style import TWO_COLUMNS, as_asked, figure

LONG = "a title that says at length what is in the panel below"
WIDTHS = [89 / 25.4, TWO_COLUMNS]


def texts_of(canvas):
    """The panels, and the boxes of all titles, names of axes and numbers."""
    canvas.draw_without_rendering()
    panels = [axes for axes in canvas.axes if axes.get_visible()]
    texts = [text for axes in panels for text in (axes.title, axes.xaxis.label, axes.yaxis.label)]
    return panels, [text.get_window_extent() for text in texts if text.get_text() and text.get_visible()]


@pytest.mark.parametrize("width", WIDTHS)
def test_titles_of_four_panels_do_not_overlap(width):
    with as_asked(width), figure(TWO_COLUMNS, 5.0) as canvas:
        for axes in canvas.subplots(2, 2).flat:
            axes.set_title(LONG)
            axes.set_xlabel("rate of the ticks of the loop (Hz)")
            axes.set_ylabel("stiffness felt at the port (N/m)")
    panels, boxes = texts_of(canvas)
    assert len(boxes) == 12
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(box.x0 >= 0 and box.x1 <= width * canvas.dpi + 1 for box in boxes)
    assert (max(len(axes.get_title().splitlines()) for axes in panels) > 1) == (width < TWO_COLUMNS)
