"""The picture of time shows the numbers of `moments`, and all of its texts can be read at both widths and on both grounds."""

import itertools

import pytest
from matplotlib.colors import to_rgb

from wavesweep.picture.moments import moments
from wavesweep.program import plots
from wavesweep.program.plots.style import ONE_COLUMN, as_asked
from wavesweep.program.spec import load

LATE = {"controller": {"kind": "pmw"}, "rates": {"slow_hz": 60.0}, "environment": {"delay": "frame"}}
LOGGED = {"values": [16, 20, 25, 33, 41], "varying": True}
SPECS = {
    "60": LATE,
    "log": {
        "controller": {"kind": "dc-slow"},
        "environment": {"delay": "frame"},
        "for_all": {"rates.ratio": LOGGED, "lost": 1},
    },
    "drive": "sweeps/templates/position-loop.toml",
    "quadrotor": "sweeps/recipes/quadrotor.toml",
    "no plant": "sweeps/recipes/engine-rates.toml",
}


def bars(axes):
    """The span of each bar, and its colour, of a panel of lanes."""
    return [(patch.get_x(), patch.get_x() + patch.get_width(), to_rgb(patch.get_facecolor())) for patch in axes.patches]


@pytest.mark.slow
def test_the_bars_are_the_life_of_the_oldest_number_and_its_age_is_below():
    canvas = plots.timing(load(LATE))
    lanes, ages = canvas.axes
    (found,) = moments(load(LATE))
    life = found.shown
    waits, stays = life.start - life.measured, life.end - life.measured
    strong = to_rgb("#D55E00")
    assert [span[:2] for span in bars(lanes) if span[2] == pytest.approx(strong)] == [pytest.approx((waits, stays))]
    assert [text.get_text() for text in lanes.get_yticklabels()] == ["1000 Hz\nencoder", "60 Hz\navatar"]
    assert [text.get_text() for text in ages.get_xticklabels()] == ["0", "17", "34"]
    assert [text.get_text() for text in lanes.get_xticklabels()] == ["measured", "in place", "replaced"]
    slow = ages.lines[1]
    falls = dict(zip(slow.get_xdata(), slow.get_ydata(), strict=True))  # the last of two at one time: the new number
    assert falls[waits] == waits
    assert max(slow.get_ydata()) == found.age == 34
    said = canvas._supxlabel.get_text().replace("\N{NO-BREAK SPACE}", " ")
    assert "The force is computed from samples up to 34 ms old" in " ".join(said.split())
    assert ": avatar answers one frame late." in " ".join(said.split())


@pytest.mark.slow
@pytest.mark.parametrize(("integration", "late"), [("implicit", ""), ("explicit", "answers one frame late.")])
def test_a_frame_that_is_not_over_is_not_counted_as_late(integration, late):
    """An explicit device answers a frame late; 19 of 20 ticks of delay are less than another one."""
    canvas = plots.timing(load({"controller": {"kind": "dc-vc"}, "environment": {"delay": 19, "integration": integration}}))
    said = " ".join(canvas._supxlabel.get_text().split())
    assert late in said
    assert ("late" in said) == bool(late)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("60", None),
        ("60", ONE_COLUMN),
        ("log", ONE_COLUMN),
        ("drive", None),
        ("quadrotor", ONE_COLUMN),
        ("no plant", ONE_COLUMN),
    ],
)
def test_texts_can_be_read(name, width):
    with as_asked(width):
        canvas = plots.timing(load(SPECS[name]))
    extents = []
    for axes in canvas.axes:
        left, right = axes.get_xlim()
        texts = [*axes.texts, axes.title, axes._left_title, *axes.get_yticklabels()]
        texts += [text for text in axes.get_xticklabels() if left <= text.get_position()[0] <= right]
        texts += [axes.xaxis.label, axes.yaxis.label]
        extents += [text.get_window_extent() for text in texts if text.get_text() and text.get_visible()]
        for text in axes.texts:  # in bars of its colour, or on the ground
            assert to_rgb(text.get_color()) in ((0, 0, 0), (1, 1, 1))
    extents += [canvas._suptitle.get_window_extent(), canvas._supxlabel.get_window_extent()]
    high, wide = canvas.bbox.y1, canvas.bbox.x1
    for box in extents:
        assert box.x0 >= -1
        assert box.x1 <= wide + 1
        assert box.y0 >= -1
        assert box.y1 <= high + 1
    for one, other in itertools.combinations(extents, 2):
        assert not one.padded(-1.5).overlaps(other.padded(-1.5)), (one, other)
