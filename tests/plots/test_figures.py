"""Figures: each kind of table can be drawn, small and always the same; what they look like, a person has to judge."""

import struct

import numpy as np
import pytest

from wavesweep import plots
from wavesweep.plots.layout import lay_out

pytestmark = pytest.mark.slow


def size_of(png):
    """Width and height in pixels, from the header."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", png[16:24])


@pytest.mark.parametrize(
    ("table", "draw", "inches"),
    [
        ("plane", plots.zwidth, 3.5),
        ("family", plots.zwidth, 7.0),
        ("bars", plots.zwidth, 3.5),
        ("responses", plots.bode, 7.0),
    ],
)
def test_a_figure_has_a_papers_width_and_the_same_bytes_each_time(table, draw, inches, request, tmp_path):
    columns = request.getfixturevalue(table)
    for name in ("first.png", "second.png"):
        draw(columns, {}, tmp_path / name)
    first, second = (tmp_path / name for name in ("first.png", "second.png"))
    assert size_of(first.read_bytes())[0] == pytest.approx(200 * inches, abs=1)
    assert first.stat().st_size < 200_000
    assert first.read_bytes() == second.read_bytes()


def test_a_table_without_anything_stable_is_drawn(plane, tmp_path):
    one = {name: column[:1] for name, column in plane.items()}
    nothing = {**one, "intervals": np.zeros(1, int), "low": np.full(1, np.nan), "high": np.full(1, np.nan)}
    plots.zwidth(nothing, {}, tmp_path / "nothing.png")
    assert (tmp_path / "nothing.png").exists()


def test_a_figure_of_a_long_table_keeps_what_it_shows_and_is_the_same(panels, tmp_path):
    plots.zwidth(panels, {}, tmp_path / "whole.png")
    assert size_of((tmp_path / "whole.png").read_bytes())[0] == pytest.approx(200 * 7.0, abs=1)
    assert (tmp_path / "whole.png").stat().st_size < 200_000
    picture = plots.Picture({name: tuple(np.unique(panels[name]).tolist()) for name in ("B_VE", "b", "K_LM")})
    for start in range(0, len(panels["b"]), 1000):
        picture.add({name: column[start : start + 1000] for name, column in panels.items()})
    picture.draw({}, tmp_path / "blocks.png")
    assert (tmp_path / "blocks.png").read_bytes() == (tmp_path / "whole.png").read_bytes()


def test_roles_are_given_in_order_and_what_is_left_out_is_said():
    axes = {"K_LM": range(50), "Kp": range(40), "b": range(30), "B_VE": range(1000), "device.mass": range(3)}
    layout = lay_out(axes)
    assert (layout.x, layout.panels, layout.family) == ("B_VE", "K_LM", "Kp")
    assert (len(layout.points), len(layout.panel_values), len(layout.members)) == (400, 9, 6)
    assert layout.fixed == {"b": 15, "device.mass": 1}
    for said in ("400 of 1000 values of B_VE", "9 of 50 values of K_LM", "6 of 40 values of Kp", "b at 15 alone"):
        assert said in layout.left_out
    assert lay_out({"b": range(4), "Kp": [1.0]}).left_out == ""
    assert (lay_out({"b": range(4)}).x, lay_out({"b": range(4)}).family) == (None, "b")


def test_what_is_not_known_is_hatched(plane, bars, tmp_path):
    """A slice of which part could not be searched looks different from one that is unstable there."""
    for name, table in (("plane", plane), ("bars", bars)):
        doubt = np.where(np.arange(len(table["b" if name == "bars" else "B_VE"])) == 2, "search", table["doubt"]).astype(object)
        plots.zwidth({**table, "doubt": doubt, "certified": doubt == ""}, {}, tmp_path / "hatched.png")
        plots.zwidth({**table, "certified": doubt == ""}, {}, tmp_path / "plain.png")
        assert (tmp_path / "hatched.png").read_bytes() != (tmp_path / "plain.png").read_bytes()
