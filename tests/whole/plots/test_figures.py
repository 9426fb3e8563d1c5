"""Figures: each kind of table can be drawn, small and always the same; what they look like, a person has to judge."""

import pathlib
import struct
import threading
from itertools import product

import matplotlib
import numpy as np
import pytest
from program.plots.conftest import table_of_intervals

import wavesweep
import wavesweep.program.sweep
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program import plots
from wavesweep.program.analyses.plane_columns import smooth_axes
from wavesweep.program.cli import main
from wavesweep.program.plots import style
from wavesweep.program.plots.figure_files import save
from wavesweep.program.plots.figure_layout import best_row, lay_out
from wavesweep.program.plots.shown import Shown
from wavesweep.program.plots.style import about_figure
from wavesweep.program.spec import sweep_axes

pytestmark = pytest.mark.slow
SWEEPS = pathlib.Path(wavesweep.__file__).parents[1] / "sweeps"


def size_of(png):
    """Width and height in pixels, from the header."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", png[16:24])


def test_a_figure_has_a_papers_width_and_the_same_bytes_each_time(plane, tmp_path):
    for name in ("first.png", "second.png"):
        save(plots.zwidth(plane, {}), tmp_path / name, about_figure("zwidth", {}))
    first, second = (tmp_path / name for name in ("first.png", "second.png"))
    assert size_of(first.read_bytes())[0] == pytest.approx(200 * 3.5, abs=1)
    assert first.stat().st_size < 200_000
    assert first.read_bytes() == second.read_bytes()


def texts_of(canvas):
    legends = [*(axes.get_legend() for axes in canvas.axes if axes.get_legend()), *canvas.legends]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


def test_one_thread_after_the_other_has_the_settings_of_figures():
    """They are those of the process, and would stay if two threads put back those of each other."""
    entered, before = threading.Event(), dict(matplotlib.rcParams)

    def draw():
        with style.style():
            entered.set()

    other = threading.Thread(target=draw)
    with style.style():
        other.start()
        assert not entered.wait(0.2)
    other.join()
    assert entered.is_set()
    assert dict(matplotlib.rcParams) == before


def test_a_margin_of_an_unstable_loop_does_not_pass_for_passive():
    """Its loop is not passive, also where the margin is positive: the margins are crossed out, as lines and as dots."""
    late = {
        "environment": {"delay": 20, "integration": "explicit"},
        "device": {"damping": 50.0},
        "controller": {"kind": "pmw-lm", "Kp": 10.0},
    }
    rows = wavesweep.passivity(late | {"sweep": {"K_VE": [0.0, 10.0, 100.0, 300.0, 1000.0], "b": [1.0, 20.0], "B_VE": [0.0]}})
    lost = (rows["port_margin"] >= 0) & ~rows["stable"]
    assert lost.any()
    figure = plots.passivity({name: rows[name].to_numpy() for name in rows}, rows.attrs["facts"])
    marks = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "x"]
    assert [len(line.get_xdata()) for line in marks] == [(~rows["stable"]).sum()]
    assert "unstable, not passive" in texts_of(figure)
    fine = wavesweep.passivity({"controller": {"kind": "pmw"}, "sweep": {"K_VE": [1.0, 2.0]}})
    figure = plots.passivity({name: fine[name].to_numpy() for name in fine}, fine.attrs["facts"])
    assert "unstable, not passive" not in texts_of(figure)


DRAWN = sorted([*(SWEEPS / "templates").glob("*.toml"), *(SWEEPS / "recipes").glob("*.toml")])


@pytest.mark.parametrize("name", [*CONTROLLERS, *(each.stem for each in DRAWN)])
def test_the_first_figure_of_a_spec_to_begin_with_shows_its_own_design(name, tmp_path):
    """The sweep of `init pmw` left its own b out."""
    assert main(("init", name, "--out", str(tmp_path / "mine.toml"))) == 0
    spec = wavesweep.load(tmp_path / "mine.toml")
    along, others = sweep_axes(spec, None)
    axes = {axis.name: [float(value) for value in axis.values] for axis in others}
    span = (float(along.start), float(along.stop), np.nan, np.nan, True)
    columns = table_of_intervals([*axes], along.name, [(place, [span]) for place in product(*axes.values())])
    facts, best = {"spec": spec.tables()}, best_row(columns)
    layout = lay_out(axes, best, smooth=smooth_axes(axes, facts))
    assert Shown(columns, facts, layout, best).own_design(layout.panel_values or (np.nan,))
