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
from tests.explore.conftest import ARM, DRIVE, HOLE, UNEVEN
from tests.whole.plots.test_near_boundaries import within
from wavesweep.explore.explorer_page import Page, saved_page
from wavesweep.program.cli import main
from wavesweep.program.spec import load

PLANE = {"x": "environment.B_VE", "y": "environment.K_VE", "x_span": [0, 5], "y_span": [0, 6000]}
ENDS = ("low", "high", "low_omega", "high_omega", "residual", "felt_low", "felt_high")


@pytest.mark.slow
def test_the_numbers_of_a_design_are_those_of_check(client):
    found = client.ask("quick")["own"]
    verdict = wavesweep.verdict(HOLE)
    for name in ("stable", "spectral_radius", "period_s", "felt", "slowest", "channel_norm", "assumes"):
        assert found[name] == verdict[name]
    changed = client.ask("quick", values={"controller.b": 31.0, "environment.delay": 4})["own"]
    expected = wavesweep.verdict(
        HOLE | {"controller": {"kind": "pmw", "b": 31.0}, "environment": {"integration": "explicit", "delay": 4}}
    )
    assert {name: changed[name] for name in changed} == {name: expected[name] for name in changed}


def test_the_response_is_that_of_the_library(client):
    found = client.ask("quick")["response"]
    table = wavesweep.compile(HOLE).response(found["frequency_hz"])
    for name in ("admittance_abs", "admittance_deg", "impedance_abs", "impedance_deg"):
        assert found[name] == table[name].tolist()
    assert found["error"] < 1e-9
    assert found["doubt"] == []


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


def test_the_plane_is_that_of_the_library(client):
    found = client.ask("certified", plane=PLANE)
    table = wavesweep.compile(HOLE).stable_intervals(span=(0, 6000), B_VE=found["x"])
    expected = [[] for _ in found["x"]]
    for _, row in table[table.intervals > 0].iterrows():
        expected[found["x"].index(row.B_VE)].append([row.low, row.high, bool(row.certified)])
    assert found["columns"] == expected
    assert found["partly"] == [False] * len(expected)
    assert sum(found["known"]) > 0.8 * len(found["known"])


def test_the_quick_plane_and_its_intervals_are_near_the_proved_ones(client):
    found = client.ask("quick", plane=PLANE, search={"environment.K_VE": [0, 6000]})
    assert found["plane"]["how"] == "curve"
    first, second = found["ranges"][0]["intervals"]
    assert (first["high"], second["low"], second["high"]) == pytest.approx((799.7134, 2523.3351, 4448.8188), abs=1e-3)
    for x, column in zip(found["plane"]["x"][::10], found["plane"]["columns"][::10], strict=True):
        table = wavesweep.compile(HOLE).stable_intervals(span=(0, 6000), B_VE=[x])
        pairs = table[table.intervals > 0][["low", "high"]].to_numpy()
        assert np.array([row[:2] for row in column]).reshape(-1, 2) == pytest.approx(pairs, abs=0.5)  # 1e-4 of the plane


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


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "how"), [(60.0, "certified"), (0.0, "cells")])
def test_a_page_opens_with_the_proved_plane_if_there_is_time(seconds, how):
    """Along a number that is no gain the preview is cells, which say nothing between their middles."""
    assert Page(load(ARM), answer_s=seconds).first["plane"]["how"] == how


@pytest.mark.slow
def test_a_page_names_what_its_spec_asks_of_more_than_its_own_numbers():
    ranges = {"device.mass": {"start": 0.08, "stop": 0.12}}
    page = Page(load({"controller": {"kind": "dc-slow"}, "for_all": ranges}), answer_s=0.0)
    _, _, data = page.text().partition('"asked"')
    assert data.lstrip(": ").startswith('["whether stable for device.mass from 0.08 to 0.12"]')


@pytest.mark.slow
@pytest.mark.thorough
def test_a_loop_without_a_hand_has_its_step_response_and_its_margins(serving):
    client, kp = serving(DRIVE), 0.3
    loop = wavesweep.compile(DRIVE).with_(kp=kp)
    asked = {"values": {"numbers.kp": kp}, "cut": "control.y"}
    found = client.ask("quick", **asked, route=["ref", "speed"])
    marched = loop.simulate(np.ones(20_000))["speed"].to_numpy()
    plane = client.ask("quick", **asked, plane=vars_of(client.page.plane))["plane"]
    table = loop.stable_intervals(along="kp", ki=plane["x"], span=client.page.plane.y_span)
    assert plane["how"] == "columns"  # the proved ones, between which nothing is
    np.testing.assert_allclose([row[:2] for (row,) in plane["columns"]], table[["low", "high"]], rtol=1e-12)
    step, L = found["step"], np.array(found["open"]["re"]) + 1j * np.array(found["open"]["im"])
    places = np.round(np.array(step["time_s"]) * 10_000).astype(int)
    np.testing.assert_allclose(step["value"], marched[places], atol=1e-12)
    assert step["overshoot"] == pytest.approx(marched.max() - 1, abs=1e-9)
    outside = np.flatnonzero(np.abs(marched - 1) > 0.02)[-1]
    assert step["settling_s"] == pytest.approx((outside + 1) / 10_000)
    np.testing.assert_allclose(found["open"]["decibels"], 20 * np.log10(np.abs(L)))
    back = client.ask("quick", **asked)["step"]
    assert back["final"] == pytest.approx(1)  # of what comes back to the cut, behind an integrator
    rows, table = client.ask("margins", **asked)["margins"], loop.margins("control.y")
    assert [row["value"] for row in rows] == table["value"].tolist()
    assert [row["doubt"] for row in rows] == table["doubt"].tolist()
    unstable = {"values": {"numbers.kp": 9.0}, "cut": "control.y"}
    assert client.ask("margins", **unstable)["margins"] == []
    assert "unstable" in client.ask("quick", **unstable)["step"]["error"]
    for wrong in ({"cut": "motor.y"}, {"cut": "control.y", "route": ["ref", "angle"]}):
        assert client.send("POST", "quick", json.dumps({"values": {}, **wrong}))[0] == 400


def vars_of(plane):
    return {"x": plane.x, "y": plane.y, "x_span": list(plane.x_span), "y_span": list(plane.y_span)}


def test_another_plane_is_found_by_proved_columns_at_once_if_the_wall_is_up(client):
    plane = PLANE | {"x": "controller.b", "x_span": [10, 60]}
    found, proved = client.ask("quick", plane=plane)["plane"], client.ask("certified", plane=plane)
    assert (found["how"], proved["how"]) == ("columns", "certified")
    assert 0.7 < sum(found["known"]) / len(found["known"]) < sum(proved["known"]) / len(proved["known"])
    assert found["unknown"]  # what is filled is right to some pixels, and the rest is hatched
    assert proved["unknown"] == []


@pytest.mark.thorough
def test_a_plane_without_the_walls_numbers_is_filled_as_in_a_figure(client):
    """It had 65 single columns, and nothing between them."""
    plane = {"x": "controller.b", "y": "device.mass", "x_span": [2.5, 250], "y_span": [0.01, 1.0]}
    found = client.ask("certified", plane=plane)
    assert (found["bars"], found["unknown"], all(found["known"])) == ([], [], True)
    b, mass = np.linspace(3, 249, 12), np.linspace(0.02, 0.99, 12)
    radius = wavesweep.compile(HOLE).spectral_radius(**{"b": b, "device.mass": mass}).ravel()
    places = np.stack(np.meshgrid(b, mass, indexing="ij"), -1).reshape(-1, 2)
    filled = np.any([within(np.array(each), places) for each in found["areas"]], 0)
    clear = np.abs(radius - 1) > 1e-3  # away from the boundary
    assert (filled == (radius < 1))[clear].all()
    assert 20 < filled.sum() < 130


def test_what_is_not_certified_is_not_drawn_as_stable():
    from wavesweep.explore.answers import plane_of
    from wavesweep.program.analyses.plane_columns import KNOWN, Interval, PlaneCurve, View

    columns = {float(x): ((Interval(0.0, 1.0 + x, True, True, x < 2),), ()) for x in range(4)}
    found = plane_of(PlaneCurve(columns, {(float(x), x + 1.0): KNOWN for x in range(3)}), View("b", False, 800, 400))
    assert found["areas"] == [[(0, 1), (1, 2), (2, 3), (3, 4), (3, 0), (2, 0), (1, 0), (0, 0)]]
    assert found["unproved"] == [[(1, 2), (2, 3), (3, 4), (3, 0), (2, 0), (1, 0)]]


def test_an_open_place_is_sent_with_its_values_and_what_is_known_nowhere_without():
    from wavesweep.explore.answers import plane_of
    from wavesweep.program.analyses.plane_columns import KNOWN, Interval, PlaneCurve, View

    interval, spans = (Interval(0.0, 1.0, True, True, False),), (((0.2, 0.4),), ((-np.inf, np.inf),))
    columns = {float(x): (interval, spans[x]) for x in range(2)}
    found = plane_of(PlaneCurve(columns, {(0.0, 1.0): KNOWN}), View("b", False, 800, 400))
    assert found["unknown"] == [(0.0, 0.5, 0.2, 0.4), (0.5, 1.0, None, None)]
    assert found["partly"] == [True, True]


def test_axes_are_fitted_to_the_boundary_and_the_design(client):
    found = client.ask("fit", values={"environment.K_VE": 9000.0}, x=PLANE["x"], y=PLANE["y"])["plane"]
    assert (found["x_span"], found["y_span"]) == ([0, 5], [0, 9450])
    lower = client.ask("fit", values={"environment.delay": 20, "environment.K_VE": 100.0}, x=PLANE["x"], y=PLANE["y"])["plane"]
    table = wavesweep.compile(HOLE | {"environment": {"integration": "explicit", "delay": 20}}).stable_intervals(
        span=(0, 6000), B_VE=np.linspace(0, 5, 9)
    )
    assert lower["y_span"] == pytest.approx([0, 1.25 * table.high.max()], rel=0.05)  # of two digits


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


def test_the_text_of_a_design_loads_to_it(client):
    text = client.ask("toml", values={"controller.b": 33.5})["text"]
    spec = load(tomllib.loads(text))
    assert spec.values["controller.b"] == 33.5
    assert spec.sha256 == load(HOLE).with_values({"b": 33.5}).sha256


def data_of(text):
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


@pytest.mark.slow
@pytest.mark.thorough
def test_a_saved_page_has_the_sweep_in_it():
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
def test_a_saved_page_says_which_table_cannot_be_had_and_why():
    drawn = tomllib.loads(ARM_TEXT)
    intervals, responses = data_of(saved_page(load(drawn)))["report"]
    assert intervals["rows"] == 1
    assert (responses["title"], "kind" in responses) == ("Responses", False)
    assert "expected inputs and outputs, or hand = {" in responses["error"]


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


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("no_word_on_a_busy_machine")
def test_the_command_saves_and_does_not_overwrite(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text('controller.kind = "dc"\nsweep.B_VE = [0, 1]\n')
    assert main(["explore", "mine.toml", "--save", "mine.html"]) == 0
    assert capfd.readouterr() == ("", "mine.html\n")
    first = (tmp_path / "mine.html").read_text()
    assert main(["explore", "mine.toml", "--save", "mine.html", "--set", "device.mass=0.2"]) == 2
    assert "mine.html: the file exists; expected another name, or --overwrite to replace it" in capfd.readouterr().err
    assert (tmp_path / "mine.html").read_text() == first
    assert main(["explore", "mine.toml", "--save", "mine.html", "--set", "device.mass=0.2", "--overwrite"]) == 0
    assert data_of((tmp_path / "mine.html").read_text())["sliders"] != data_of(first)["sliders"]


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


@pytest.mark.thorough
def test_a_page_has_what_was_measured_and_so_have_its_figures(tmp_path):
    (tmp_path / "walls.csv").write_text("B_VE,K_VE,stable\n1,500,1\n1,3000,0\n")
    (tmp_path / "response.csv").write_text("frequency_hz,admittance_re,admittance_im\n1,0,-2\n")
    files = {name: str(tmp_path / f"{file}.csv") for name, file in (("z_width", "walls"), ("response", "response"))}
    sweep = {"K_VE": {"start": 0, "stop": 6000}, "B_VE": [0, 1, 2]}
    text = saved_page(load(HOLE | {"measured": files, "sweep": sweep, "bode": {"frequency_hz": [1.0, 2.0]}}))
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    walls = {"stiffness": "environment.K_VE", "damping": "environment.B_VE", "points": [[1, 500, True], [1, 3000, False]]}
    assert data["measured"]["walls"] == walls
    assert data["measured"]["response"]["admittance_deg"] == [-90]
    assert [[*table["facts"]["measured"]["spec"]] for table in data["report"]] == [["z_width"], ["response"]]
