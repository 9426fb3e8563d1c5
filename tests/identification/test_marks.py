"""Figures have the measured points, as they were read, in looks of their own."""

import numpy as np
import pytest

import wavesweep
from tests.identification.test_points import spec_of
from wavesweep.identification.marks import facts_of
from wavesweep.program import plots
from wavesweep.program.plots.style import distinct_colour
from wavesweep.program.tables.specs import intervals_of_specs

SWEEP = {"B_VE": [0.0, 1.0, 2.0, 3.0, 4.0]}
WALLS = "B_VE,K_VE,stable\n0,1000,1\n2,3500,0\n2,3000,1\n9,100,1\n"


def points_of(axes, marker, face=None):
    """The points of a panel that have this marker and colour."""
    lines = [line for line in axes.lines if line.get_marker() == marker and line.get_linestyle() == "None"]
    return [line.get_xydata().tolist() for line in lines if face is None or line.get_markerfacecolor() == face]


def named(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_the_figure_of_limits_has_the_measured_ones_and_room_for_them(tmp_path):
    spec = spec_of(tmp_path, "z_width", "B_VE,K_VE\n0,1000\n2,9000\n")
    figure = wavesweep.compile(spec).plot_zwidth(span=(0, 20000), **SWEEP)
    assert points_of(figure.axes[0], "D") == [[[0, 1000], [2, 9000]]]
    assert figure.axes[0].get_ylim()[1] > 9000
    assert "measured limit" in named(figure)


@pytest.mark.slow
def test_the_figure_of_responses_has_the_measured_one_beyond_its_frequencies_too(tmp_path):
    text = "frequency_hz,admittance_abs,admittance_deg\n0.02,0.002,-1\n2,0.003,-5\n90,1e-5,-170\n"
    spec = spec_of(tmp_path, "response", text)
    figure = wavesweep.compile(spec).plot_bode(np.geomspace(0.1, 50, 20))
    magnitude, phase = figure.axes[0], figure.axes[2]
    assert points_of(magnitude, "o") == [pytest.approx(np.array([[0.02, 2.0], [2, 3.0], [90, 0.01]]))]
    assert points_of(phase, "o") == [pytest.approx(np.array([[0.02, -1], [2, -5], [90, -170]]))]
    assert magnitude.get_xlim() == (0.02, 90)
    assert points_of(figure.axes[1], "o") == []
    assert "measured" in named(figure)


@pytest.mark.slow
def test_models_of_one_measurement_share_its_points_in_a_comparison(tmp_path):
    spec = spec_of(tmp_path, "z_width", WALLS)
    (tmp_path / "other.csv").write_text("B_VE,K_VE\n1,2000\n")
    own = ["sweep.K_VE={start=0, stop=8000}", "sweep.B_VE=[0, 1, 2, 3]", "bode.frequency_hz=[1, 10]"]
    specs = []
    for name, other in (("a", "points.csv"), ("b", "points.csv"), ("c", "other.csv")):
        (tmp_path / f"{name}.toml").write_bytes((tmp_path / "mine.toml").read_bytes())
        specs.append(wavesweep.load(tmp_path / f"{name}.toml", [*own, f"measured.z_width={other}"]))
    assert spec.measured == specs[0].measured
    walls = intervals_of_specs(specs)
    figure = plots.zwidth_specs(walls.columns, {**walls.facts, **facts_of(specs, "zwidth-specs")})
    panel = figure.axes[0]
    assert [points for points in points_of(panel, "o", "white") if [2, 3500] in points] == [[[2, 3500]]]
    (limit,) = [line for line in panel.lines if line.get_marker() == "D" and line.get_linestyle() == "None"]
    assert limit.get_xydata().tolist() == [[1, 2000]]
    assert limit.get_color() == distinct_colour(2)
