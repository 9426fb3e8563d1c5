"""`wavesweep why` from the spec to its files and its words."""

import json
import re

import numpy as np
import pytest
from support.drawn import ARM

from wavesweep.program import results
from wavesweep.program.plots import figure_of
from wavesweep.program.spec import load
from wavesweep.sensitivity.table import why

HOLE = """
[controller]
kind = "pmw"
[environment]
integration = "explicit"
[filters]
lp1 = { order = 1, cutoff_hz = 8.57 }
[sweep]
B_VE = [0.5, 1.0]
"""


@pytest.fixture
def hole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hole.toml").write_text(HOLE)
    return "hole.toml"


@pytest.mark.slow
def test_every_end_has_its_rows_its_words_and_its_files(wavesweep, hole, tmp_path):
    code, out, err = wavesweep("why", hole)
    assert (code, out) == (0, "")
    folder = tmp_path / "results/hole"
    assert {file.name for file in folder.iterdir()} == {f"why{s}" for s in (".csv", ".parquet", ".png", ".datapackage.json")}
    table = results.read(folder / "why.parquet")
    found = dict.fromkeys(zip(table["interval"].tolist(), table["side"].tolist(), strict=True))
    assert list(found) == [(0, "low"), (0, "high"), (1, "low"), (1, "high")]
    assert "K_VE: stable from 0 to 799.713 and 2523.34 to 4448.81 N/m\n" in err
    assert "B_VE is not swept here, held at the spec's 1\n" in err
    assert "high end, K_VE = 799.713 N/m: set by an oscillation of 40.427 rad/s (6.434 Hz), damping ratio 0.00462 just" in err
    assert "  states that take part: avatar position 47 %, filter lp1 42 %, device velocity 11 %\n" in err
    assert (
        "  1 % more rates.fast_hz (same ratio) moves it up by 5.42 %, 1 % more filters.lp1.cutoff_hz down by 3.96 %, "
        "1 % more device.damping up by 1.29 %\n" in err
    )
    assert "  felt there: 550.842 N/m; 1 % more rates.fast_hz (same ratio) moves it up by 3.82 %" in err
    assert err.count("which has no changes in per cent") == 1
    assert "  felt there: 0 N/m\n" in err
    package = json.loads((folder / "why.datapackage.json").read_text())
    units = {field["name"]: field.get("unit") for field in package["resources"][0]["schema"]["fields"]}
    assert (units["omega"], units["elasticity"]) == ("rad/s", "1")
    assert package["wavesweep"]["slices"] == {"computed": 1, "skipped": 0, "certified": 1}


@pytest.mark.slow
def test_another_axis_and_a_drawn_loop(wavesweep, hole, tmp_path):
    code, _, err = wavesweep("why", hole, "--along", "b", "--set", "sweep.b={start=5, stop=200}", "--no-plot")
    assert code == 0
    assert re.search(r"end, b = [\d.]+ N\*s/m: set by", err)
    code, _, err = wavesweep("why", hole, "--along", "b", "--no-plot", "--overwrite")
    assert (code, "b has no span in [sweep]: searched from " in err) == (0, True)
    assert wavesweep("why", hole, "--along", "operator.mass")[0] == 2
    (tmp_path / "arm.toml").write_text(ARM)
    code, out, _ = wavesweep("why", "arm.toml", "--json", "--no-plot")
    found = json.loads(out)["tables"]["why"]
    (end,) = found["ends"]
    assert (code, end["end"], end["felt"], found["along"]["unit"]) == (0, "high", None, "N*s/m")
    assert list(end["limit"]["elasticities"]) == ["kd", "kp", "rates.tick_hz"]


def panels(canvas):
    """The panels that are shown."""
    return [axis for axis in canvas.axes if axis.get_visible()]


def test_the_figure_has_a_panel_per_end_sorted_and_with_no_more_than_a_dozen_numbers():
    values = {"Kp": 20.0, "kind": "pmw-lm"}
    spec = load({
        "controller": values, "environment": {"integration": "explicit", "delay": 3}, "local_model": {"B_LM": 0.5},
        "operator": {"mass": 0.1, "damping": 1.0, "stiffness": 50.0}, "filters": {"lp1": {"order": 2, "cutoff_hz": 10.0}},
    })  # fmt: skip
    table = why(spec)
    canvas = figure_of("why")(table.columns, table.facts)
    (panel,) = panels(canvas)
    names = [label.get_text() for label in panel.get_yticklabels()]
    assert len(names) == 12
    assert re.fullmatch(r"fast rate \(same ratio\); \d+ more, each at most\s\S+", panel.get_xlabel())
    largest = np.zeros(12)
    for bars in panel.containers:
        for bar in bars:
            place = round(bar.get_y() + bar.get_height() / 2)
            largest[place] = max(largest[place], abs(bar.get_width()))
    assert len(panel.containers) == 2
    assert (np.diff(largest) <= 0).all()
    shown = np.abs(table.columns["elasticity"])
    assert largest[0] == shown.max()
    assert panel.get_title(loc="left").startswith(r"high end, $K_\mathrm{VE}$ = ")
