"""Tables, and rows of tables, whose capability is not installed."""

import numpy as np

from wavesweep.program.plots.plain_figure import MOST_PLAIN_PANELS, plain
from wavesweep.program.row_kinds import row_kind
from wavesweep.program.tables.columns import missing_command, missing_for


def test_a_plain_figure_has_a_panel_for_each_column_of_numbers():
    columns = {"t": np.array([0.0, 1.0]), "doubt": np.array(["", ""], object), "m": np.array([2, 1])}
    columns |= {"empty": np.full(2, np.nan)} | {f"n{number}": np.ones(2) for number in range(MOST_PLAIN_PANELS)}
    canvas = plain(columns, {})
    drawn = {axes.get_title(): axes for axes in canvas.axes if axes.get_visible()}
    assert list(drawn) == ["m", *(f"n{number}" for number in range(MOST_PLAIN_PANELS - 1))]
    (line,) = drawn["m"].lines
    assert line.get_xydata().tolist() == [[0.0, 2.0], [1.0, 1.0]]
    assert "Not drawn: doubt, empty, n11." in canvas.get_supxlabel()


def test_what_is_missing_is_named():
    rows = {"along": np.array(["K_VE"]), "hand": np.array(["robot"], object)}
    assert missing_for("decay", rows, {"command": "wavesweep --quiet decay a.toml"}) == "tables of wavesweep decay"
    assert missing_for("zwidth-hands", rows, {"command": "wavesweep zwidth a.toml"}) == "rows of robot"
    assert missing_for("zwidth-hands", rows | {"hand": np.array(["free"], object)}, {}) == ""
    assert missing_command("torn", {"command": "wavesweep zwidth a.toml"}) == ""
    assert row_kind("robot").legend == "robot (drawn plainly)"
