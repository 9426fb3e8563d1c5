"""Places where nothing is known: what only these keep apart is one interval in doubt, and none of them is an end or a hole."""

import json
from dataclasses import replace

import numpy as np
import pytest

from wavesweep.engine._stability import along_any
from wavesweep.engine._stability.intervals import common, in_rows, intervals_of, joined, without_seams
from wavesweep.engine._stability.regions import Regions
from wavesweep.engine.doubts import Doubt
from wavesweep.program import plots, results
from wavesweep.program.cli.entry import main


def regions(*parts):
    """Regions of one column from (low, high, unstable), with a crossing at each end between two of them."""
    low, high, unstable = map(np.array, zip(*parts, strict=True))
    zero, inner = np.zeros(low.size, int), np.full(low.size, 0.5)
    low_theta, high_theta = inner.copy(), inner.copy()
    low_theta[0] = high_theta[-1] = np.nan
    return Regions(zero, low.astype(float), high.astype(float), low_theta, high_theta, unstable, zero, np.full(low.size, 1e-12))


def rows_of(*parts, doubt=Doubt.COUNTS):
    return in_rows(intervals_of(regions(*parts), np.array([doubt]), np.array([1.0]), np.array([0])))


def test_pieces_around_an_open_place_are_one_interval_and_a_proved_hole_stays_one():
    rows, open_ = rows_of((0, 1, 0), (1, 2, -1), (2, 3, 0), (3, 4, 1), (4, 5, -1), (5, 6, 2), (6, 7, 0))
    assert rows.low.tolist() == [0, 6]
    assert rows.high.tolist() == [3, 7]
    assert rows.index.tolist() == [0, 1]
    assert rows.count.tolist() == [2, 2]
    assert rows.high_omega[0] == rows.low_omega[1] == 0.5
    assert open_.places.tolist() == [2, 0]
    assert open_.low[0] == 1
    assert open_.high[0] == 5  # that from 4 on belongs to the first


def test_a_place_where_nothing_is_known_is_no_end():
    rows, open_ = rows_of((0, 1, 1), (1, 2, -1), (2, 3, 0), (3, 4, -1), (4, 5, -1), (5, 6, 1))
    assert (rows.low.item(), rows.high.item()) == (2, 3)
    assert np.isnan([rows.low_omega.item(), rows.high_omega.item(), rows.residual.item()]).all()
    assert (open_.places.item(), open_.low.item(), open_.high.item()) == (2, 1, 5)  # both of the last are one place


def test_a_column_of_which_nothing_is_known_to_be_stable_has_its_open_places_and_no_interval():
    rows, open_ = rows_of((0, 1, 1), (1, 2, -1), (2, 3, 1), (3, 4, -1))
    assert rows.count.item() == 0
    assert np.isnan([rows.low.item(), rows.high.item()]).all()
    assert (open_.places.item(), open_.low.item(), open_.high.item()) == (2, 1, 4)


def test_an_open_place_goes_on_over_the_seam_of_two_parts_of_a_range():
    of = lambda *parts: intervals_of(regions(*parts), np.array([Doubt.CROWDED]), np.array([1.0]), np.array([0]))  # noqa: E731
    rows, open_ = in_rows(without_seams(joined([of((0, 1, 0), (1, 2, -1)), of((2, 3, -1), (3, 4, 0))])))
    assert (rows.low.item(), rows.high.item(), rows.count.item()) == (0, 4, 1)
    assert (open_.places.item(), open_.low.item(), open_.high.item()) == (1, 1, 3)


def test_loops_beside_each_other_are_open_where_one_is_and_the_others_are_not_unstable():
    one = intervals_of(regions((0, 2, 0), (2, 6, -1), (6, 9, 0)), np.array([Doubt.COUNTS]), np.array([1.0]), np.array([0]))
    other = intervals_of(regions((0, 4, 0), (4, 5, 1), (5, 9, 0)), np.array([0]), np.array([1.0]), np.array([0]))
    rows, open_ = in_rows(common([one, other]))
    assert list(zip(rows.low.tolist(), rows.high.tolist(), strict=True)) == [(0, 2), (6, 9)]
    assert open_.places.tolist() == [1, 1]
    assert open_.high.tolist() == [4, 6]
    assert open_.low.tolist() == [2, 5]


SPEC = """
rates.tick_hz = 10
[numbers]
tau = 1.0
k = 3.0
[block.lag]
type = "tf"
num = [1]
den = ["tau", 1]
[block.late]
type = "delay"
steps = 3
[wire]
"late.u" = "lag.y"
"lag.u" = "-k*late.y"
[sweep]
along = "tau"
tau = { start = 0.2, stop = 4 }
"""


@pytest.fixture
def blind(monkeypatch, tmp_path):
    """A command on the spec, for which nothing is known of tau between two values."""
    whole = along_any.regions_along_any

    def run(low, high, *words):
        def without(*args, **more):
            found = whole(*args, **more)
            cuts = [np.unique(np.clip([a, b, low, high], a, b)) for a, b in zip(found.low, found.high, strict=True)]
            of = np.repeat(np.arange(len(cuts)), [len(each) - 1 for each in cuts])
            lows, highs = (np.concatenate([each[part] for each in cuts]) for part in (slice(-1), slice(1, None)))
            unknown = (lows >= low) & (highs <= high)
            parts = replace(found.take(of), low=lows, high=highs)
            return replace(
                parts, unstable=np.where(unknown, -1, parts.unstable), doubt=np.where(unknown, Doubt.CROWDED, parts.doubt)
            )

        monkeypatch.setattr(along_any, "regions_along_any", without)
        path = tmp_path / "late.toml"
        path.write_text(SPEC)
        return main([words[0], str(path), *words[1:]])

    return run


@pytest.mark.slow
def test_summary_json_and_table_say_where_nothing_is_known(blind, tmp_path, capsys):
    out = ["--out", str(tmp_path / "out"), "--overwrite"]
    assert blind(2.0, 2.5, "stability-region", *out) == 0
    said = "".join(capsys.readouterr())
    assert "1 slice: 1 stable interval, 1 slice with open places" in said
    assert "to 4, not known from 2 to 2.5" in said
    assert "hole" not in said
    assert blind(2.0, 2.5, "stability-region", *out, "--json") == 0
    found = json.loads(capsys.readouterr().out)["tables"]["stability-region"]
    assert found["slices_with_open_places"] == 1
    assert found["slices_with_a_hole"] == 0
    assert found["few_slices"][0]["open"] == [{"places": 1, "from": 2.0, "to": 2.5}]
    rows = (tmp_path / "out" / "stability-region.csv").read_text().splitlines()
    assert len(rows) == 2
    assert rows[0].endswith("open_places,open_low,open_high,argument")
    assert rows[1].endswith(",1,2.0,2.5,")


@pytest.mark.parametrize(("low", "high", "ended"), [(2.0, 2.5, True), (3.0, 4.0, False)])
def test_a_figure_hatches_an_open_place_and_has_a_word_for_it(low, high, ended, blind, tmp_path):
    assert blind(low, high, "stability-region", "--out", str(tmp_path / "out"), "--no-plot") == 0
    _, columns, facts = results.read_table(tmp_path / "out" / "stability-region.csv")
    canvas = plots.zwidth(columns, facts)
    (axes,) = canvas.axes
    hatched = [patch.get_bbox() for patch in axes.patches if patch.get_hatch() == "/////"]
    assert [(box.x0, box.x1) for box in hatched] == [(low, high)]
    said = [text.get_text() for legend in (*canvas.legends, axes.get_legend()) for text in legend.get_texts()]
    assert ("not known" in said, "beyond the swept range" in said) == (True, ended)
