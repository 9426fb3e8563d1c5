"""Figures: each kind of table can be drawn, small and always the same; what they look like, a person has to judge."""

import pathlib
import re
import struct
import threading
from itertools import pairwise, product

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
from wavesweep.program.plots.style import about_figure, as_asked, figure, note_below, warn_above
from wavesweep.program.spec import sweep_axes
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.specs import intervals_of_specs

pytestmark = pytest.mark.slow
SWEEPS = pathlib.Path(wavesweep.__file__).parents[1] / "sweeps"


def size_of(png):
    """Width and height in pixels, from the header."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", png[16:24])


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("table", "draw", "inches"),
    [
        ("plane", plots.zwidth, 3.5),
        ("family", plots.zwidth, 3.5),
        ("bars", plots.zwidth, 3.5),
        ("responses", plots.bode, 7.0),
    ],
)
def test_a_figure_has_a_papers_width_and_the_same_bytes_each_time(table, draw, inches, request, tmp_path):
    columns = request.getfixturevalue(table)
    for name in ("first.png", "second.png"):
        save(draw(columns, {}), tmp_path / name, about_figure("zwidth", {}))
    first, second = (tmp_path / name for name in ("first.png", "second.png"))
    assert size_of(first.read_bytes())[0] == pytest.approx(200 * inches, abs=1)
    assert first.stat().st_size < 200_000
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(("along", "shown"), [("K_VE", False), ("spring_k", True)])
def test_a_range_that_begins_at_0_is_dotted_below_where_the_number_goes_on(along, shown, plane):
    """The wall's stiffness ends at 0, but a number of a drawn loop does not."""
    facts = {"spec": {"numbers": {"spring_k": {"value": 1.0, "unit": "N/m", "description": ""}}}}
    (axes,) = plots.zwidth(plane | {"along": np.full(plane["low"].size, along, object)}, facts).axes
    dotted = [patch.get_extents() for patch in axes.patches if patch.get_hatch()]
    assert bool(dotted) == shown == (axes.get_ylim()[0] < 0)
    legend = axes.figure.legends
    assert any(text.get_text() == "beyond the swept range" for each in legend for text in each.get_texts()) == shown


def png(figure):
    """The bytes of a figure."""
    return figure._repr_png_()


@pytest.mark.thorough
def test_a_figure_of_a_long_table_is_the_same_in_blocks(panels):
    whole = png(plots.zwidth(panels, {}))
    assert size_of(whole)[0] == pytest.approx(200 * 7.0, abs=1)
    assert len(whole) < 250_000
    blocks = [
        {name: column[start : start + 1000] for name, column in panels.items()} for start in range(0, len(panels["b"]), 1000)
    ]
    assert png(plots.zwidth(lambda: blocks, {})) == whole


def test_roles_are_given_in_order_and_what_is_left_out_is_said():
    axes = {"K_LM": range(50), "Kp": range(4), "b": range(30), "B_VE": range(1000), "device.mass": range(3)}
    best = {"K_LM": 33, "b": 7, "B_VE": 999, "device.mass": 2}
    layout = lay_out(axes, best)
    assert (layout.x, layout.panels, layout.family) == ("B_VE", "K_LM", "Kp")
    assert (len(layout.points), len(layout.panel_values), len(layout.members)) == (400, 6, 4)
    assert layout.fixed == {"b": 7, "device.mass": 2}
    assert {0, 33, 49} <= set(layout.panel_values)
    for said in ("400 of 1000 values of B_VE", "6 of 50 values of K_LM", "b at 7 alone", "device.mass at 2 alone"):
        assert said in layout.left_out
    assert lay_out({"b": range(4), "Kp": [1.0]}, {}).left_out == ""
    assert (lay_out({"b": range(4)}, {}).x, lay_out({"b": range(4)}, {}).family) == (None, "b")


@pytest.mark.thorough
def test_the_figure_of_a_large_sweep_goes_through_the_best_design(panels):
    felt = np.where((panels["b"] == 70) & (panels["K_LM"] == 700) & (panels["B_VE"] == 3), 9000.0, panels["felt_high"])
    figure = plots.zwidth({**panels, "felt_high": felt}, {})
    (title,) = [axes.get_title() for axes in figure.axes if any(line.get_marker() == "*" for line in axes.lines)]
    assert "700" in title or "70 " in title
    assert any("stiffest felt, certified: 9000" in text.get_text() for text in figure.legends[0].get_texts())


def test_short_axes_are_bars_of_all_their_combinations():
    """Up to 16 in a panel; of more the last axes are held."""
    layout = lay_out({"g": [0.0, 1.0, 3.0], "zeta": [1.0, 2.0], "n": [5.0, 10.0]}, {})
    assert (layout.family, layout.panels, dict(layout.fixed), layout.left_out) == ("g", "zeta", {}, "")
    assert layout.bars == [{"g": g, "n": n} for g in (0.0, 1.0, 3.0) for n in (5.0, 10.0)]
    held = lay_out({"g": range(8), "zeta": [1.0, 2.0], "n": [5.0, 10.0, 20.0]}, {})
    assert (held.bars[:2], dict(held.fixed)) == ([{"g": 0}, {"g": 1}], {"n": 10.0})
    assert "n at 10 alone" in held.left_out


@pytest.mark.thorough
def test_the_bars_of_a_recipe_show_every_row():
    """Two panels of six bars each, and a stroke for each end that stability sets."""
    source = pathlib.Path(wavesweep.__file__).parents[1] / "sweeps" / "recipes" / "policy.toml"
    table = intervals(wavesweep.load(source))
    figure = plots.stability_region(table.columns, table.facts)
    shown = [axes for axes in figure.axes if axes.patches]
    assert [len(axes.get_yticks()) for axes in shown] == [6, 6]
    ends = sum(len(lines.get_segments()) for axes in shown for lines in axes.collections)
    assert ends == np.isfinite(table.columns["low_omega"]).sum() + np.isfinite(table.columns["high_omega"]).sum()
    assert {text.get_text() for axes in shown for text in axes.get_yticklabels()} >= {"g = 3, n = 5 ms"}


def test_a_single_design_has_a_panel_for_each_value_and_its_response():
    spec = {
        "controller": {"kind": "pmw"},
        "sweep": {"K_VE": {"start": 0, "stop": 2000}},
        "design": {"vary": {"b": {"start": 5, "stop": 100}}, "wish": {"z_width": {"at_least": 400.0}, "felt": {}}},
    }
    facts = {"spec": wavesweep.load(spec).asking("design").tables(), "own": {"z_width": 500.0, "felt": None}}
    facts["runners_up"] = [{"numbers": {"b": 90.0}, "wishes": {"z_width": 750.0, "felt": 600.0}}]
    columns = {"b": np.array([40.0]), "z_width": np.array([900.0]), "felt": np.array([700.0])}
    *panels, response = plots.design(columns, facts).axes
    assert [text.get_text() for text in panels[0].get_yticklabels()] == ["nominal", "found", "next best"]
    values = [[*zip(*line.get_data(), strict=True)] for axes in panels for line in axes.lines if line.get_marker() in "Xo"]
    assert values == [[(500, 0)], [(900, 1)], [(750, 2)], [(700, 1)], [(600, 2)], [(25, 0)], [(40, 1)], [(90, 2)]]
    texts = [[text.get_text() for text in axes.texts] for axes in panels]
    assert texts[0] == ["500 (25 %)", "900 (125 %)", "750 (87.5 %)"]
    assert texts[1][0] == "not known"
    for line, b in zip(response.lines, (25.0, 40.0, 90.0), strict=True):
        frequency, magnitude = line.get_data()
        expected = wavesweep.compile({"controller": {"kind": "pmw", "b": b}}).response(frequency.tolist())
        assert magnitude == pytest.approx(1e3 * expected["admittance_abs"].to_numpy(), rel=1e-9)
    assert len(plots.design(columns, {**facts, "spec": {"design": facts["spec"]["design"]}}).axes) == 3


@pytest.mark.parametrize("width", [3.5, 7.0])
def test_notes_below_a_figure_and_warnings_above_are_not_cut_off(width):
    said = "a sentence that is longer than one line of a narrow figure, as those on what a run assumes are " * 2
    with figure(width, 3.0) as canvas:
        canvas.subplots()
        note_below(canvas, said, said, axis="force (N)")
        warn_above(canvas, said)
    for text in (canvas._suptitle, canvas._supxlabel):
        box = text.get_window_extent()
        assert 0 <= box.x0 < box.x1 <= canvas.get_figwidth() * canvas.dpi
        assert 0 <= box.y0 < box.y1 <= canvas.get_figheight() * canvas.dpi
    assert canvas.get_figheight() > 3.0  # room for the lines


def texts_of(canvas):
    legends = [*(axes.get_legend() for axes in canvas.axes if axes.get_legend()), *canvas.legends]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


@pytest.mark.thorough
def test_the_legend_is_low_above_one_column_and_beside_the_panels_of_two(family, panels):
    felt = family | {"felt_low": family["low"] / 2, "felt_high": family["high"] / 2}
    figure = plots.zwidth(felt, {})
    (axes,) = figure.axes
    boxes = [legend.get_window_extent() for legend in (axes.get_legend(), *figure.legends)]
    assert sum(box.height for box in boxes) < 0.25 * figure.bbox.height
    assert min(box.x0 for box in boxes) > 0
    assert max(box.x1 for box in boxes) < figure.bbox.x1
    assert texts_of(figure)[:4] == ["$b$ = 20 N·s/m", "40", "60", "80"]
    assert "stiffest felt, certified: 2600 N/m at rest,\nof a wall of 5200 N/m" in texts_of(figure)
    wide = plots.zwidth(panels, {})
    (legend,) = wide.legends
    assert legend.get_window_extent().x0 > max(each.get_window_extent().x1 for each in wide.axes)


def test_a_star_at_the_last_value_is_at_its_coordinates_and_whole():
    loop = {"controller": {"kind": "pmw"}, "environment": {"integration": "explicit"}}
    figure = wavesweep.compile(loop).plot_zwidth(B_VE=[0.0, 5.0, 15.0])
    (axes,) = figure.axes
    (star,) = [line for line in axes.lines if line.get_marker() == "*"]
    assert (star.get_xdata(), star.get_transform(), star.get_clip_on()) == (15.0, axes.transData, False)


def test_the_star_of_bars_of_hands_is_at_its_hand(bars):
    first = {name: column[:1] for name, column in bars.items()}
    columns = {name: np.tile(column, 2) for name, column in first.items()}
    columns["high"] = columns["felt_high"] = np.array([1000.0, 3000.0])
    at = list(columns).index("along") + 1
    hand = {"hand": np.array(["free", "operator"], object)}
    columns = dict([*list(columns.items())[:at], *hand.items(), *list(columns.items())[at:]])
    (axes,) = plots.zwidth(columns, {}).axes
    (star,) = [line for line in axes.lines if line.get_marker() == "*"]
    assert (star.get_xdata().item(), star.get_ydata().item()) == (3000.0, 1.0)


WALL = {
    "rates": {"tick_hz": 1000},
    "numbers": {"K": 5.0, "B": 0.01},
    "block": {"m": {"type": "mass", "mass": 0.2, "damping": 2.0}, "h": {"type": "hold", "every": 5}},
    "wire": {"h.u": "m.x", "m.f": "hand - K*h.y - B*m.v"},
    "ports": {"hand": {"force": "hand", "displacement": "m.x"}, "wall": {"stiffness": "K", "damping": "B"}},
}


FACTS = {"spec": {"numbers": {name: {"value": 1.0, "unit": "", "description": ""} for name in "KB"}}}


def test_an_axis_that_goes_by_factors_is_drawn_so():
    damping = {"B": {"start": 0.001, "stop": 10, "num": 12, "scale": "log"}}
    passive = wavesweep.passivity(WALL | {"sweep": damping})
    columns = {name: passive[name].to_numpy() for name in passive}
    assert [axes.get_xscale() for axes in plots.passivity(columns, FACTS).axes] == ["log"]  # without waves the port alone
    rows = wavesweep.zwidth(WALL | {"sweep": damping | {"K": {"start": 0, "stop": 1e5}}})
    columns = {"spec": np.full(len(rows), "wall", object)} | {name: rows[name].to_numpy() for name in rows}
    assert [axes.get_xscale() for axes in plots.zwidth_specs(columns, FACTS).axes] == ["log"]


def test_specs_of_a_comparison_differ_by_their_looks_and_values_have_panels(family):
    rows = family["low"].size
    columns = {"spec": np.repeat(np.array(["one", "two"], object), rows)}
    columns |= {name: np.tile(column, 2) for name, column in family.items()}
    figure = plots.zwidth_specs(columns, {})
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in panels] == [f"$b$ = {b} N·s/m" for b in (20, 40, 60, 80)]
    for axes in panels:
        looks = {(str(each.get_colors()[0]), str(each.get_linestyles()[0])) for each in bars_of(axes) if len(each.get_colors())}
        assert len(looks) == 3  # and that of what is not certified
    assert texts_of(figure)[:2] == ["one", "two"]


def bars_of(axes):
    """Collections of lines at single values of x."""
    return [each for each in axes.collections if hasattr(each, "get_segments") and each.get_segments()]


def test_a_spec_that_does_not_read_the_damping_has_the_same_limits_everywhere(plane):
    """Its values are missing; it is a line from side to side."""
    one = {"spec": np.full(plane["low"].size, "one", object)} | plane
    other = {name: column[:1] for name, column in one.items()}
    other |= {"spec": np.array(["flat"], object), "B_VE": np.array([np.nan]), "high": np.array([1234.0])}
    (axes,) = plots.zwidth_specs({name: np.concatenate([column, other[name]]) for name, column in one.items()}, {}).axes
    lines = [line.tolist() for each in bars_of(axes) for line in each.get_segments()]
    assert [[0.0, 1234.0], [15.0, 1234.0]] in lines


def test_texts_of_a_figure_are_texts_in_a_file(plane, tmp_path):
    """TrueType fonts in a PDF, which journals ask for, and text elements in an SVG."""
    for suffix in ("pdf", "svg"):
        save(plots.zwidth(plane, {}), tmp_path / f"a.{suffix}", about_figure("zwidth", {}))
    fonts = re.findall(rb"/Subtype /(Type3|Type0|TrueType)", (tmp_path / "a.pdf").read_bytes())
    assert set(fonts) == {b"Type0"}
    assert re.search("<text [^>]*>largest", (tmp_path / "a.svg").read_text())


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


@pytest.mark.parametrize(("own", "marked"), [(2.0, [(40.0, 0)]), (2.5, []), (3.0, [(40.0, 1)])])
def test_the_bar_of_the_specs_own_design_has_its_cross(own, marked):
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 40.0, "d": own},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.0}, "h": {"type": "hold", "every": 20}},
        "wire": {"h.u": "-k*m.x - d*m.v", "m.f": "h.y"},
        "sweep": {"along": "k", "k": {"start": 0, "stop": 1500}, "d": [2.0, 3.0]},
    }
    table = intervals(wavesweep.load(tables))
    axes = plots.stability_region(table.columns, table.facts).axes[0]
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    assert [point for line in crosses for point in zip(*line.get_data(), strict=True)] == marked


@pytest.mark.parametrize("number", [3, 9, 51])
def test_a_number_that_varies_smoothly_is_along_the_figure_however_few_values_it_has(number):
    """Three values were bars that lay, nine or more a region that stood."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 40.0, "kd": 2.0},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.0}},
        "wire": {"m.f": "-kp*m.x - kd*m.v"},
    }
    figure = wavesweep.compile(tables).plot_zwidth("kp", (0, 5000), kd=np.linspace(1, 60, number))
    assert (figure.get_supxlabel().split("\n")[0], figure.get_supylabel()) == ("kd", "kp")


@pytest.mark.thorough
def test_space_that_is_not_swept_does_not_pass_for_unstable():
    """No interval reaches 5 N*s/m: the axis begins there, and a design of 50 N*s/m beyond its end has no cross."""
    source = pathlib.Path(wavesweep.__file__).parents[1] / "sweeps" / "examples" / "impedance.toml"
    sweep = ["sweep.b={start=5, stop=18}", "sweep.device.mass={start=0.05, stop=0.3, num=13}"]
    table = intervals(wavesweep.load(source, sweep))
    axes = plots.stability_region(table.columns, table.facts).axes[0]
    assert axes.get_ylim()[0] == 5
    assert not [line for line in axes.lines if line.get_marker() == "x" and len(line.get_xdata())]


@pytest.mark.sample(1)
@pytest.mark.parametrize("values", [[0.0, 10.0, 100.0, 300.0, 1000.0], [0.0, 100.0]])
def test_a_margin_of_an_unstable_loop_does_not_pass_for_passive(values):
    """Its loop is not passive, also where the margin is positive: the margins are crossed out, as lines and as dots."""
    late = {
        "environment": {"delay": 20, "integration": "explicit"},
        "device": {"damping": 50.0},
        "controller": {"kind": "pmw-lm", "Kp": 10.0},
    }
    rows = wavesweep.passivity(late | {"sweep": {"K_VE": values, "b": [1.0, 20.0], "B_VE": [0.0]}})
    lost = (rows["port_margin"] >= 0) & ~rows["stable"]
    assert lost.any()
    figure = plots.passivity({name: rows[name].to_numpy() for name in rows}, rows.attrs["facts"])
    marks = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "x"]
    assert [len(line.get_xdata()) for line in marks] == [(~rows["stable"]).sum()]
    assert "unstable, not passive" in texts_of(figure)
    fine = wavesweep.passivity({"controller": {"kind": "pmw"}, "sweep": {"K_VE": [1.0, 2.0]}})
    figure = plots.passivity({name: fine[name].to_numpy() for name in fine}, fine.attrs["facts"])
    assert "unstable, not passive" not in texts_of(figure)


@pytest.mark.thorough
def test_numbers_below_a_narrow_panel_do_not_touch():
    with figure(7.0, 1.5) as canvas:
        for axes in canvas.subplots(1, 3).flat:
            axes.set_xlim(1000000, 2000000)
            axes.ticklabel_format(style="plain")
    for axes in canvas.axes:
        boxes = sorted((box.x0, box.x1) for box in (label.get_window_extent() for label in axes.get_xticklabels()))
        assert len(boxes) >= 2
        assert all(left[1] < right[0] for left, right in pairwise(boxes))


def test_texts_of_neighbouring_panels_and_below_a_round_one_stay_apart():
    """The numbers below four panels ran into each other, and the note below a panel of equal units into its axis."""
    with figure(7.0, 2.0) as canvas:
        for axes in canvas.subplots(1, 4, sharey=True):
            axes.set_xlim(0, 2000)
    boxes = [[each.get_window_extent() for each in axes.get_xticklabels()] for axes in canvas.axes]
    assert all(right[0].x0 - left[-1].x1 > 7 / 72 * canvas.dpi for left, right in pairwise(boxes))
    with figure(4.55, 5.0) as canvas:
        axes = canvas.subplots()
        axes.set(aspect="equal", xlabel="real", ylabel="imaginary", xlim=(-1, 1), ylim=(-1, 1))
        handles = [*axes.plot([0, 1], np.zeros((2, 5)))]
        canvas.legend(handles, "abcde", fontsize=7, loc="outside upper center")
        note_below(canvas, "a note\nof two lines")
    assert canvas._supxlabel.get_window_extent().y1 + 5 < axes.xaxis.label.get_window_extent().y0


def test_a_width_and_a_style_that_are_asked_for(plane, tmp_path):
    usual = plots.zwidth(plane, {})
    with as_asked(89 / 25.4), as_asked(settings={"font.family": ["serif"], "lines.linewidth": 3.0}):
        narrow = plots.zwidth(plane, {})
        save(narrow, tmp_path / "a.png", about_figure("zwidth", {}))
    assert size_of((tmp_path / "a.png").read_bytes())[0] == int(200 * 89 / 25.4)
    assert narrow.axes[0].get_yticklabels()[0].get_fontfamily() == ["serif"]
    assert {label.get_fontsize() for label in narrow.axes[0].get_xticklabels()} == {8.0}
    assert usual.get_figwidth() == plots.zwidth(plane, {}).get_figwidth() == 3.5


@pytest.mark.thorough
def test_nothing_is_transparent_which_an_eps_could_not_show(bars, responses):
    drawn = plots.zwidth(bars, {}), plots.bode(responses, {})
    assert not any(canvas.findobj(lambda part: part.get_visible() and (part.get_alpha() or 1) < 1) for canvas in drawn)


@pytest.mark.thorough
def test_an_eps_is_the_same_each_time(tmp_path, bars):
    drawn = plots.zwidth(bars, {})
    for name in ("a.eps", "b.eps"):
        save(drawn, tmp_path / name, {"Title": "zwidth of mine", "Software": "wavesweep", "Spec": "mine"})
    text = (tmp_path / "a.eps").read_text()
    assert text == (tmp_path / "b.eps").read_text()
    assert "%%Title: zwidth of mine\n" in text
    assert "Date" not in text
    assert "%%BoundingBox: 0 0 252 " in text


@pytest.mark.thorough
def test_a_comparison_follows_the_ends_between_the_values_of_a_table():
    """Between 0 and 5 N*s/m a hole closes, which two values do not show."""
    lp1 = {"lp1": {"order": 1, "cutoff_hz": 8.57}}
    spec = {"controller": {"kind": "pmw", "b": 25.0}, "environment": {"integration": "explicit"}, "filters": lp1}
    spec |= {"bode": {"frequency_hz": [1]}}
    walls = intervals_of_specs([wavesweep.load(spec | {"sweep": {"K_VE": {"start": 0, "stop": 20000}, "B_VE": [0.0, 5.0]}})])
    (axes,) = plots.zwidth_specs(walls.columns, walls.facts).axes
    vertices = np.concatenate([line for each in bars_of(axes) for line in each.get_segments()])
    at = np.unique(vertices[:, 0])
    table = wavesweep.compile(spec).stable_intervals(along="K_VE", span=(0, 20000), B_VE=at.tolist())
    computed = 0
    for x, y in vertices:
        ends = table[x == table.B_VE][["low", "high"]].to_numpy()
        computed += np.abs(ends - y).min() <= 1e-9 * max(y, 1.0)
    assert computed >= len(vertices) - 8  # but for the middle of the pixel in which the hole closes
    counts = table.groupby("B_VE").intervals.first()
    assert (counts.max(), counts.iloc[-1]) == (2, 1)


@pytest.mark.sample(2)
@pytest.mark.parametrize("width", [85 / 25.4, 180 / 25.4])
@pytest.mark.parametrize("name", ["plane", "family", "panels", "bars", "responses", "passivity"])
def test_texts_have_the_same_size_in_both_widths_of_a_journal_and_none_is_cut_off(name, width, request):
    if name == "passivity":
        rows = wavesweep.passivity({"controller": {"kind": "pmw"}, "sweep": {"b": [20, 40, 80]}})
        columns = {column: rows[column].to_numpy() for column in rows}
    else:
        columns = request.getfixturevalue(name)
    draw = {"responses": plots.bode, "passivity": plots.passivity}.get(name, plots.zwidth)
    with as_asked(width):
        drawn = draw(columns, {})
    drawn.draw_without_rendering()
    ticks = [text for axes in drawn.axes for text in (*axes.get_xticklabels(), *axes.get_yticklabels())]
    texts = [*drawn.texts, *(axis.label for axes in drawn.axes for axis in (axes.xaxis, axes.yaxis))]
    texts += [text for legend in drawn.legends for text in legend.get_texts()]
    assert {text.get_fontsize() for text in (*texts, *ticks) if text.get_text().strip()} <= {7.0, 8.0}
    boxes = [text.get_window_extent() for text in texts if text.get_text().strip()]
    assert min(box.x0 for box in boxes) >= 0
    assert max(box.x1 for box in boxes) <= width * drawn.dpi + 1


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
