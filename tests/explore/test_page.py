"""The answers of a page equal those of the library, and a saved page has them all."""

import json
import os
import re
import subprocess
import sys
import tomllib
from math import prod

import numpy as np
import pytest

import wavesweep
from tests.explore.conftest import ARM, HOLE, UNEVEN
from wavesweep.explore.explorer_page import saved_page
from wavesweep.program.cli import main
from wavesweep.program.spec import load

PLANE = {"x": "environment.B_VE", "y": "environment.K_VE", "x_span": [0, 5], "y_span": [0, 6000]}
ENDS = ("low", "high", "low_omega", "high_omega", "residual", "felt_low", "felt_high")


def test_the_intervals_are_those_of_the_library(client):
    for path, name, span in (
        ("environment.K_VE", "K_VE", (0, 6000)),
        ("controller.b", "b", (5, 80)),
        ("device.mass", "device.mass", (0.02, 0.5)),
    ):
        found = client.ask("certified", along=path, span=span)
        table = wavesweep.compile(HOLE).stable_intervals(along=name, span=span)
        assert found["certified"] == bool(table.certified.all())
        assert len(found["intervals"]) == len(table) if table.intervals[0] else not found["intervals"]
        for row, (_, expected) in zip(found["intervals"], table.iterrows(), strict=True):
            for end in ENDS:
                assert row[end] == (None if np.isnan(expected[end]) else expected[end])


def test_the_plane_is_that_of_the_library_while_something_moves_and_at_rest(client):
    quick = client.ask("quick", plane=PLANE, search={"environment.K_VE": [0, 6000]})
    for found in (client.ask("certified", plane=PLANE), quick["plane"]):
        table = wavesweep.compile(HOLE).stable_intervals(span=(0, 6000), B_VE=found["x"])
        expected = [[] for _ in found["x"]]
        for _, row in table[table.intervals > 0].iterrows():
            expected[found["x"].index(row.B_VE)].append([row.low, row.high, bool(row.certified)])
        assert found["columns"] == expected
        assert found["partly"] == [False] * len(expected)
        assert sum(found["known"]) > 0.8 * len(found["known"])
    (along,) = quick["ranges"]
    assert along == client.ask("certified", along="environment.K_VE", span=[0, 6000])


@pytest.mark.slow
@pytest.mark.parametrize("source", [ARM, UNEVEN], ids=["drawn", "uneven"])
def test_drawn_loops_and_uneven_rates_have_the_same(serving, source):
    client = serving(source)
    plane = {**vars_of(client.page.plane)}
    quick = client.ask("quick", plane=plane)
    verdict = wavesweep.verdict(source)
    assert {name: quick["own"][name] for name in quick["own"]} == {name: verdict[name] for name in quick["own"]}
    loop = wavesweep.compile(source)
    assert quick["plane"]["how"] == "cells"
    axes = {plane["x"]: quick["plane"]["x"], plane["y"]: quick["plane"]["y"]}
    assert quick["plane"]["stable"] == (loop.spectral_radius(**axes) < 1).astype(int).tolist()
    assert "assembled tick by tick" in client.send("GET", "")[2]
    found = client.ask("certified", plane=plane)
    assert sum(found["known"]) > 0.9 * len(found["known"])
    some = found["x"][::16]
    table = loop.stable_intervals(along=plane["y"], span=plane["y_span"], **{plane["x"]: some})
    expected = [[row.low, row.high, bool(row.certified)] for _, row in table.iterrows() if row.intervals]
    columns = [found["columns"][found["x"].index(x)] for x in some]
    np.testing.assert_allclose([each for column in columns for each in column], expected, rtol=1e-9)


def vars_of(plane):
    return {"x": plane.x, "y": plane.y, "x_span": list(plane.x_span), "y_span": list(plane.y_span)}


def test_what_makes_no_loop_is_said_in_the_answer_with_the_field_that_it_is_about(client):
    late, beyond = {"environment.delay": 30}, PLANE | {"x": "filters.lp1.cutoff_hz", "x_span": [1, 600]}
    for name, question, at, said in (
        ("quick", {"values": late}, "environment.delay", "environment.delay: expected a whole number <= 20"),
        ("certified", {"values": late, "plane": PLANE}, "environment.delay", "found 30"),
        ("toml", {"values": late}, "environment.delay", "found 30"),
        ("quick", {"plane": beyond}, "x1", "filters.lp1.cutoff_hz: expected a number < 500"),
        ("certified", {"plane": beyond}, "x1", "filters.lp1.cutoff_hz: expected a number < 500"),
    ):
        answer = client.ask(name, **question)
        assert answer["at"] == [at]
        assert said in answer["error"]
    answer = client.ask("certified", along="filters.lp1.cutoff_hz", span=[1, 600])
    assert answer["span"] == [1, 499]  # as far as the spec goes


def data_of(text):
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


@pytest.mark.slow
def test_a_saved_page_has_the_sweep_in_it():
    """HOLE sweeps K_VE to 6000, B_VE in 11 values and b in 2; its own values are 500, 1 and 25. All values of b and some of the
    others, with the ends and its own, make at most 100 designs."""
    heard = []
    data = data_of(saved_page(load(HOLE), lambda *report: heard.append(report)))
    stops, own = data["stops"], {"environment.K_VE": 500.0, "environment.B_VE": 1.0, "controller.b": 25.0}
    assert stops.keys() == own.keys()  # every number of the sweep has a slider
    assert stops["controller.b"] == [20.0, 25.0]
    assert {0.0, 1.0, 5.0} <= set(stops["environment.B_VE"]) <= {*np.linspace(0, 5, 11)}
    assert {0.0, 500.0, 6000.0} <= set(stops["environment.K_VE"])
    count = prod(map(len, stops.values()))
    assert len(data["designs"]) == count <= 100
    assert len(data["planes"]) == 2  # one for each b: the other numbers are its axes
    assert heard == [(done, count + 2) for done in range(count + 3)]  # the designs and two tables
    (design,) = [each for each in data["designs"] if each["values"] == own]
    intervals, responses = data["report"]
    table = wavesweep.zwidth(HOLE)
    rows = intervals["csv"].split("\n")
    assert len(rows) == len(table) + 1 == intervals["rows"] + 1
    highs = [float(row.split(",")[rows[0].split(",").index("high")]) for row in rows[1:]]
    assert highs == table.high.tolist()
    assert intervals["facts"]["spec_sha256"] == load(HOLE).sha256
    assert responses["kind"] == "bode"
    assert intervals["figure"].startswith("data:image/svg+xml;base64,")
    assert load(tomllib.loads(design["toml"])).sha256 == load(HOLE).sha256
    assert all(each["ranges"][0]["certified"] for each in data["designs"])


@pytest.mark.slow
def test_text_from_a_spec_cannot_leave_its_place(tmp_path):
    path = tmp_path / "a<b>&c.toml"
    path.write_text(ARM_TEXT)
    text = saved_page(load(path))
    assert "</script><script>" not in text
    assert "<title>a&lt;b&gt;&amp;c: wavesweep explore</title>" in text
    assert "</script><script>alert(1)" in data_of(text)["sliders"][1]["description"]


ARM_TEXT = """
rates.tick_hz = 1000
numbers.k = { value = 1.0, description = "</script><script>alert(1)</script>" }
numbers.d = 1.0
block.m = { type = "mass", mass = 1.0 }
wire."m.f" = "-k*m.x - d*m.v"
sweep = { along = "k", k = { start = 0, stop = 5 } }
"""


def test_a_page_that_a_killed_run_has_put_in_place_is_no_reason_to_refuse(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    page = "<title>mine: wavesweep explore</title>"
    monkeypatch.setattr("wavesweep.explore.explorer_page.saved_page", lambda *_: page)
    (tmp_path / "mine.toml").write_text('controller.kind = "dc"\n')
    (tmp_path / "mine.html").write_text(page)
    (tmp_path / ".wavesweep.new-0123456789ab").mkdir()  # what it had no time to remove
    command = ["explore", "mine.toml", "--save", "mine.html"]
    assert main(command) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.html", "mine.toml"]
    (tmp_path / "mine.html").write_text(f"{page} of other numbers")
    assert main(command) == 2
    assert "mine.html: the file exists; expected another name, or --overwrite to replace it" in capfd.readouterr().err


@pytest.mark.slow
def test_equal_specs_give_equal_pages(tmp_path):
    """Also in processes that order sets in other ways."""
    spec = 'controller.kind = "dc"\nsweep.B_VE = [1]\n[simulate]\ninput = "step"\nduration_s = 0.2\namplitude = 1.0\n'
    (tmp_path / "mine.toml").write_text(spec)
    pages = []
    for seed in ("1", "2"):
        words = [sys.executable, "-m", "wavesweep", "explore", "mine.toml", "--save", f"{seed}.html", "-q"]
        subprocess.run(words, cwd=tmp_path, env=os.environ | {"PYTHONHASHSEED": seed}, check=True, capture_output=True)
        pages.append((tmp_path / f"{seed}.html").read_bytes())
    assert pages[0] == pages[1]
