"""Titles, names of axes and names of bars have room at any width."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Text

from wavesweep.program import plots
from wavesweep.program.plots.labels import assumption
from wavesweep.program.plots.style import TWO_COLUMNS, as_asked, figure, note_below
from wavesweep.program.row_kinds import words_of

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


def every_text(canvas):
    """The boxes of all texts that are drawn."""
    canvas.draw_without_rendering()
    drawn = [text for text in canvas.findobj(Text) if text.get_text().strip() and text.get_visible()]
    beyond = set()  # numbers of axes that are not drawn
    for axes in canvas.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            beyond |= {tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high}
    return [text.get_window_extent() for text in drawn if text not in beyond]


def assert_apart(canvas):
    boxes = every_text(canvas)
    assert not any(one.overlaps(other) for one, other in combinations([box.padded(-1) for box in boxes], 2))
    assert min(box.x0 for box in boxes) > -1
    assert min(box.y0 for box in boxes) > -1
    assert max(box.x1 for box in boxes) < canvas.bbox.width + 1
    assert max(box.y1 for box in boxes) < canvas.bbox.height + 1


@pytest.mark.parametrize("column", ["hand", "guarantee"])
def test_names_of_bars_of_every_kind_do_not_overlap(column):
    words = list(words_of(column))
    places = np.arange(float(len(words)))
    columns = {
        "along": ["K_VE"] * len(words),
        column: words,
        "doubt": [""] * len(words),
        **dict.fromkeys(("interval", "low", "felt_low"), 0 * places),
        "intervals": 0 * places + 1,
        **dict.fromkeys(("certified", "settled"), places < 2),
        **dict.fromkeys(("low_omega", "fails_below"), 0 * places + np.nan),
        **dict.fromkeys(("high", "felt_high"), 500 + 50 * places),
        **dict.fromkeys(("high_omega", "fails_from"), 700 + 60 * places),
    }
    columns = {name: np.array(values) for name, values in columns.items()}
    assumed = "explicit integration of the wall, delay of 1 tick, velocity from differences of position: engines usually"
    with as_asked(WIDTHS[0]):
        assert_apart(plots.zwidth(columns, {"assumes": assumed, "spec": {"controller": {"kind": "pmw"}}}))


def test_notes_are_as_wide_as_the_panels():
    with figure(TWO_COLUMNS, 2.0) as canvas:
        left, right = canvas.subplots(1, 2)
        left.set_ylabel("stiffness felt at the port (N/m)")
        note_below(canvas, *(f"What is {LONG}." for _ in range(4)), "a_name_" * 30, axis="time (s)")
    canvas.draw_without_rendering()
    notes = canvas._supxlabel.get_window_extent()
    assert left.bbox.x0 - 1 < notes.x0
    assert notes.x1 < right.bbox.x1 + 1
    assert notes.width > 0.7 * (right.bbox.x1 - left.bbox.x0)
    assert_apart(canvas)


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("table", ["plane", "family", "panels", "bars"])
def test_texts_of_a_figure_of_intervals_are_apart(table, width, request):
    assumed = "integrated over the time since the last frame, velocity from differences of position: engines usually"
    with as_asked(width):
        assert_apart(
            plots.zwidth(request.getfixturevalue(table), {"assumes": assumed, "spec": {"controller": {"kind": "pmw"}}})
        )


def test_what_several_specs_assume_are_sentences_of_their_own():
    assert assumption({"assumes": "one: no delay\nother: no delay"}) == "Assumes: one: no delay. other: no delay."
