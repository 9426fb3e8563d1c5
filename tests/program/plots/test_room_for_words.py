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


def test_lines_and_marks_are_seen_on_a_dark_ground():
    from matplotlib.colors import to_rgb
    from matplotlib.lines import Line2D

    dark = {"figure.facecolor": "black", "axes.facecolor": "black", "text.color": "white"}
    for settings, seen in ((dark, True), ({}, False)):
        with as_asked(settings=settings), figure(TWO_COLUMNS, 2.0) as canvas:
            axes = canvas.subplots()
            axes.plot([0, 1], [0, 1], color="#440154")
            axes.plot([0], [1], "*", color="black")
            axes.vlines([0.5], 0, 1, colors=["black"])
        colours = [line.get_color() for line in axes.findobj(Line2D) if line in axes.lines]
        colours += axes.collections[0].get_color().tolist()
        lightness = [
            sum(share * channel for share, channel in zip((0.2126, 0.7152, 0.0722), to_rgb(each), strict=True))
            for each in colours
        ]
        assert [each > 0.49 for each in lightness] == [seen] * 3
