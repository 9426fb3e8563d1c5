"""Figures: each kind of table can be drawn, small and always the same; what they look like, a person has to judge."""

import struct

import numpy as np
import pytest

from wavesweep import plots


def size_of(png):
    """Width and height in pixels, from the header."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", png[16:24])


@pytest.mark.parametrize(
    ("table", "draw", "inches"),
    [
        ("plane", plots.zwidth, 3.5),
        ("family", plots.zwidth, 3.5),
        ("panels", plots.zwidth, 7.0),
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
