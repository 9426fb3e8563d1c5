"""Figures have the measured points, as they were read, in looks of their own."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import wavesweep
from tests.identification.test_points import spec_of
from wavesweep.identification.marks import responses, undrawn, walls
from wavesweep.program.plots.style import distinct_colour

SWEEP = {"B_VE": [0.0, 1.0, 2.0, 3.0, 4.0]}


def test_the_figure_of_limits_has_the_measured_ones_and_room_for_them(tmp_path):
    spec = spec_of(tmp_path, "z_width", "B_VE,K_VE\n0,1000\n2,9000\n")
    figure = wavesweep.compile(spec).plot_zwidth(span=(0, 20000), **SWEEP)
    (limit,) = [line for line in figure.axes[0].lines if line.get_marker() == "D"]
    assert limit.get_xydata().tolist() == [[0, 1000], [2, 9000]]
    assert figure.axes[0].get_ylim()[1] > 9000
    assert "measured limit" in [text.get_text() for legend in figure.legends for text in legend.get_texts()]


WALL = {"B_VE": [0, 2, 2, 9], "K_VE": [1000, 3500, 3000, 100], "stable": [True, False, True, True], "sha256": "1"}
LIMIT = {"B_VE": [1], "K_VE": [2000], "sha256": "2"}
FACTS = {
    "specs": {name: {} for name in "abcd"},
    "measured": {"a": {"z_width": WALL}, "b": {"z_width": WALL}, "c": {"z_width": LIMIT}},
}


def test_models_of_one_measurement_share_its_points_in_a_comparison():
    """In black; of those outside of a figure its legend says how many there are."""
    found = walls(FACTS, "B_VE", "K_VE", several=True)
    assert found.highest(3200) == 3000
    axes = Figure().subplots()
    axes.set(xlim=(0, 5), ylim=(0, 3500))
    found.draw(axes)
    drawn = [
        (line.get_marker(), line.get_color(), line.get_markerfacecolor(), line.get_xydata().tolist()) for line in axes.lines
    ]
    third = distinct_colour(2)
    hollow, disc = ("o", "black", "white", [[2, 3500]]), ("o", "black", "black", [[0, 1000], [2, 3000]])
    assert drawn == [disc, hollow, ("D", third, third, [[1, 2000]])]
    labels = [handle.get_label() for handle in found.handles([0, 1, 5], (0, 3200))]
    assert labels == ["measured stable (1 of 3 outside)", "measured unstable (1 of 1 outside)", "measured limit"]
    assert walls(FACTS, "K_LM", "K_VE", several=True).of == []


def test_walls_are_drawn_over_their_own_damping_and_stiffness_alone():
    one = {"spec_name": "a", "measured": FACTS["measured"], "spec": {}}
    drawn = one | {"spec": {"ports": {"wall": {"damping": "b", "stiffness": "k"}}}}
    for facts, x, upward, there in ((one, "B_VE", "K_VE", True), (one, "b", "K_VE", False), (drawn, "b", "k", True)):
        ((kinds, colour),) = walls(facts, x, upward, several=False).of or [({}, "black")]
        assert (bool(kinds), colour, undrawn(facts, x, upward) == "") == (there, "black", there)
    assert undrawn(one | {"measured": {}}, "b", "K_VE") == ""


def test_responses_are_drawn_in_mm_per_newton_and_degrees_with_the_names_of_their_specs():
    points = {"frequency_hz": [2.0, 90.0], "re": [0.0, -1e-3], "im": [3e-3, 0.0], "sha256": "1"}
    facts = {"measured": {"a": {"response": points}, "b": {"response": points | {"sha256": "2"}}}}
    shown = responses(facts, ["a", "b"])
    for name, values in (("admittance_abs", [3.0, 1.0]), ("admittance_deg", [90.0, 180.0])):
        axes = Figure().subplots()
        assert shown.draw(axes, name).tolist() == [2, 90, 2, 90]
        assert [line.get_label() for line in axes.lines] == ["a, measured", "b, measured"]
        assert axes.lines[1].get_xydata() == pytest.approx(np.array([[2, values[0]], [90, values[1]]]))
    assert shown.draw(axes, "impedance_abs").tolist() == [2, 90, 2, 90]
    assert shown.draw(axes, "transparency").size == 0
    assert len(axes.lines) == 2
