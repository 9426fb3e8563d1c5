"""The library's figures: those of the commands, drawn for a compiled loop."""

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.legend import Legend

import wavesweep
from wavesweep.program import plots
from wavesweep.program.tables.interval_table import intervals

pytestmark = pytest.mark.slow

SPEC = {
    "controller": {"kind": "pmw"},
    "sweep": {"K_VE": {"start": 0.0, "stop": 4000.0}, "B_VE": [0.0, 2.0, 5.0], "b": [20.0, 40.0]},
}


def test_a_figure_of_the_library_is_that_of_the_command():
    loop, table = wavesweep.compile(SPEC), intervals(wavesweep.load(SPEC))
    figure = loop.plot_zwidth(span=(0, 4000), B_VE=[0.0, 2.0, 5.0], b=[20.0, 40.0])
    assert isinstance(figure, Figure)
    assert figure._repr_png_() == plots.zwidth(table.columns, table.facts)._repr_png_()


@pytest.mark.parametrize("axis", ["rates.slow_hz", "filters.lp1.passband_hz"])
def test_an_axis_that_other_keys_follow_from_is_drawn(axis):
    """A cross marks the spec's own design, if it has a value on that axis."""
    edges = {"passband_hz": 5.0, "stopband_hz": 50.0, "passband_db": 3.0, "stopband_db": 20.0}
    spec = {"controller": {"kind": "pmw"}, **({"filters": {"lp1": edges}} if "filters" in axis else {})}
    values = [20.0, 25.0, 40.0, 50.0, 100.0, 125.0, 200.0, 250.0, 500.0] if axis == "rates.slow_hz" else np.linspace(3, 8, 11)
    figure = wavesweep.compile(spec).plot_zwidth(span=(0, 4000), **{axis: values})
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert ("nominal design" in names) == (axis == "rates.slow_hz")


@pytest.mark.parametrize("inside", [False, True])
def test_a_figure_has_no_legend_and_no_notes_if_they_are_not_wanted(inside):
    loop, across = wavesweep.compile(SPEC), {"span": (0, 4000), "B_VE": [0.0, 5.0], "b": [20.0, 40.0]}

    def drawn(**parts):
        whole, axes = plt.subplots(figsize=(3.5, 2.6), layout="constrained") if inside else (None, None)
        figure = loop.plot_zwidth(ax=axes, **parts, **across)
        assert (figure is whole) == inside
        figure.draw_without_rendering()
        part = figure.subfigs[0] if inside else figure
        panel = part.axes[0].get_position()
        return bool(figure.findobj(Legend)), "Strokes" in part.get_supxlabel(), panel.height

    (_, _, least), (legends, notes, most) = drawn(), drawn(legend=False, caption=False)
    assert (legends, notes) == (False, False)
    assert drawn()[:2] == (True, True)
    assert most > (1.3 if inside else 1.0) * least
    plt.close("all")
