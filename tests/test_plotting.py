"""The library's figures: those of the commands, drawn for a compiled loop."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import wavesweep
from wavesweep import plots
from wavesweep.sweep import intervals

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


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("bode", {"frequency_hz": [0.0, 1.0, 10.0], "b": [20, 40]}),
        ("passivity", {"b": [20, 40]}),
        ("simulate", {"friction": 0.2}),
        ("zwidth", {"along": "b", "span": (5, 100), "K_VE": np.linspace(100, 1000, 4)}),
    ],
)
def test_every_method_has_a_figure(name, call):
    figure = getattr(wavesweep.compile(SPEC), f"plot_{name}")(**call)
    assert isinstance(figure, Figure)
    assert figure._repr_png_()[:4] == b"\x89PNG"
