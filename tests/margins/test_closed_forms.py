"""A lag under a gain, L = g/(z - 1/2): tables, words and figures have its margins, curves and steps in closed form."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import wavesweep
from wavesweep.margins import box_margins, panel
from wavesweep.margins.figure import _closed_step, decibels_and_degrees, draw_bode, draw_nyquist, open_loop
from wavesweep.margins.marked_steps import draw_others, draw_step
from wavesweep.margins.table import KINDS, _numbers, margins
from wavesweep.program.analyses.claim_words import fact_of
from wavesweep.program.analyses.claims import Claim, Property, Status, own_scope
from wavesweep.program.plots.style import family_looks

T = 0.01


def lag(g, **more):
    block = {"p": {"type": "tf", "num": [1], "den": [T / np.log(2), 1]}, "c": {"type": "gain", "k": "2*g"}}
    wire, ports = {"p.u": "c.y", "c.u": "ref - p.y"}, {"inputs": {"ref": "ref"}, "outputs": {"own": "p.y"}}
    return wavesweep.load(
        {"rates": {"tick_hz": 1 / T}, "numbers": {"g": g}, "block": block, "wire": wire, "ports": ports, **more}
    )


def closed(g, hertz):
    return g / (np.exp(2j * np.pi * T * hertz) - 0.5)


def expected(g):
    """Value and frequency (Hz) of each margin of 0.5 < g < 1.5; all but those of the gain 1 are met at half the rate."""
    crossing = np.arccos(1.25 - g * g)
    turn = np.pi + np.angle(closed(g, crossing / (2 * np.pi * T)))
    disk = 2 * (1.5 - g) / (1.5 + g)
    rest = {"gain_up": 1.5 / g, "disk": disk, "disk_gain": 1.5 / g, "disk_phase": np.degrees(2 * np.arctan(disk / 2))}
    rest |= {"sensitivity": 1.5 / (1.5 - g), "complementary": g / (1.5 - g)}
    slow = {"phase": np.degrees(turn), "delay_frames": turn / crossing}
    return {name: (value, 50.0) for name, value in rest.items()} | {
        name: (value, crossing / (2 * np.pi * T)) for name, value in slow.items()
    }


def table_of(g):
    return {name: (value, 2 * np.pi * hz, hz) for name, (value, hz) in expected(g).items()}


def test_a_table_and_a_page_have_the_margins_of_the_closed_form_and_lines_say_them():
    spec, wanted = lag(0.91, sweep={"along": "g", "g": {"start": 0.1, "stop": 1.0}}), expected(0.91)
    table = margins(spec)
    columns = table.columns
    assert {*columns["cut"]} == {"c.y"}
    before, behind = (
        ["gain_up", "gain_down", "phase", "delay"],
        ["disk", "disk_gain", "disk_phase", "sensitivity", "complementary"],
    )
    assert columns["margin"].tolist() == before + behind
    assert columns["unit"].tolist() == ["ratio", "ratio", "deg", "s", "ratio", "ratio", "deg", "ratio", "ratio"]
    assert columns["limited"].tolist() == [name != "gain_down" for name in columns["margin"]]
    assert columns["certified"].all()
    (late,) = columns["value"][columns["margin"] == "delay"]
    older = 2 ** -(1 - (late / T - 1))  # of what is held, what is left of a tick's older force when the newer one arrives
    assert np.abs(np.roots([1, -0.5, 1.82 * (1 - older), 1.82 * (older - 0.5)])).max() == pytest.approx(1, abs=1e-8)
    numbers = np.stack([columns[name] for name in ("value", "omega", "hz", "bound")], -1)
    rows = dict(zip(columns["margin"], numbers, strict=True))
    for name in wanted.keys() & rows.keys():
        value, omega, hz, bound = rows[name]
        assert (value, hz) == (pytest.approx(wanted[name][0], rel=bound + 1e-13), pytest.approx(wanted[name][1], rel=1e-9))
        assert omega == pytest.approx(2 * np.pi * hz, rel=1e-9)
        assert 0 < bound <= 2e-9
    assert rows["gain_down"][0] == 0
    assert table.facts["slices"] == {"computed": 1, "skipped": 0, "certified": 1}
    assert any("g is not swept here" in said for said in table.facts["notices"])
    assert "dead time" in table.facts["methods"]["margins"]
    shown = panel.data(spec)
    assert shown == {"cuts": ["c.y", "p.y"], "routes": [("ref", "own")]}
    page = panel.answers()["margins"](spec, {"cut": "c.y"}, shown)
    assert [(row["name"], row["value"], row["unit"], row["limited"]) for row in page["margins"]] == [
        *zip(*(columns[name].tolist() for name in ("margin", "value", "unit", "limited")), strict=True)
    ]
    for row in page["margins"]:
        if row["name"] in ("gain_up", "phase"):
            assert complex(*row["at"]) == pytest.approx(closed(0.91, row["hz"]), rel=1e-9)
    tally = KINDS[0].tally(table)
    tally.add(columns)
    lines = [line for line, _ in KINDS[0].lines(tally.numbers(table.facts))]
    assert lines[:4] == [
        "broken at c.y, once in 10 ms",
        "gain may grow by a factor up to 1.64835, at 314.16 rad/s (50 Hz)",
        "gain may fall by a factor down to: no limit",
        "phase margin 85.0765 deg, at 113.53 rad/s (18.07 Hz)",
    ]
    assert lines[8:] == [
        "peak sensitivity Ms 2.54238, at 314.16 rad/s (50 Hz)",
        "peak complementary sensitivity Mt 1.54238, at 314.16 rad/s (50 Hz)",
    ]


@pytest.mark.parametrize(
    "name",
    ["gain_up", "delay_frames", "disk", *(pytest.param(name, marks=pytest.mark.slow) for name in ("gain_down", "phase"))],
)
def test_the_worst_loop_of_a_box_sets_what_is_proved_for_all(name):
    spec = lag(0.9, for_all={"g": {"start": 0.8, "stop": 1.1}})
    (case,) = box_margins._cases(spec, "c.y", spec.for_all.unknown, {})
    margin = box_margins._for_all_cases([(case, *case.margin(name))], name)
    assert margin.settled
    assert not margin.doubt
    if name == "gain_down":
        assert (margin.value, margin.limited, margin.counterexample) == (0, False, "")
        return
    value, hz = expected(1.1)[name]
    assert (margin.limited, margin.counterexample) == (True, "g = 1.1")
    assert (margin.refuted, margin.omega) == (pytest.approx(value, rel=1e-8), pytest.approx(2 * np.pi * hz, rel=1e-8))
    assert 0.99 * value < margin.value < value
    for part in [*box_margins._with_gain_and_phase(margin)] * (name == "disk"):
        own, shared = part.value, np.tan(np.radians(part.value) / 2) if part.name == "disk_phase" else margin.value / 2
        wanted = {"disk": 2 * shared, "disk_gain": (1 + shared) / (1 - shared)}.get(part.name, own)
        assert (own, shared) == (pytest.approx(wanted, rel=1e-12), pytest.approx(margin.value / 2, rel=1e-12))
        assert part.refuted == pytest.approx(expected(1.1)[part.name][0], rel=1e-8)
        assert part.limited


def test_panels_draw_the_closed_form_and_the_margins_where_they_are_set():
    g, other, look = 0.9, 0.4, family_looks(2)[1]
    wanted = table_of(g)
    loop, member = open_loop(lag(g), "c.y", wanted), open_loop(lag(other), "c.y", {})
    nyquist, gain, phase = Figure().subplots(1, 3)
    assert draw_nyquist(nyquist, loop, "c.y", [(member, look, "g = 0.4")]) == ""
    L = closed(g, loop.hertz)
    circle, own, familiar, mirrored, minus_1, *marks = (line.get_xydata() @ [1, 1j] for line in nyquist.lines)
    np.testing.assert_allclose(np.abs(circle), 1)
    for curve, exact in ((own, L), (mirrored, L.conj()), (familiar, closed(other, member.hertz))):
        np.testing.assert_allclose(curve, exact, rtol=1e-9)
    assert loop.hertz[-1] == pytest.approx(50, rel=1e-12)
    assert loop.hertz[0] < 1e-4
    assert np.abs(np.log(L[1:] / L[:-1])).max() <= 0.03
    assert minus_1 == [-1]
    at = {name: closed(g, wanted[name][2]) for name in ("gain_up", "phase", "delay_frames")}
    for mark, exact in zip(marks, at.values(), strict=True):
        assert mark == pytest.approx(exact, rel=1e-9)
    rim = nyquist.patches[0].get_path().vertices @ [1, 1j]
    ends = -1.5 / g, -g / 1.5  # the disk meets -1 times the gains at its ends
    np.testing.assert_allclose(np.abs(rim - sum(ends) / 2), (ends[1] - ends[0]) / 2, rtol=1e-12)
    assert nyquist.get_legend_handles_labels()[1] == [
        "gain 1", "L at c.y, nominal", "g = 0.4", "disk margin 0.5",
        "gain up 1.66 (4.43 dB) at 50 Hz", "phase 86.1° at 17.75 Hz", "delay frames 1.348 at 17.75 Hz",
    ]  # fmt: skip
    size = 1.8 + 1.5 / g  # of the square that has the disk on its left and L(0) = 2 g on its right
    np.testing.assert_allclose(nyquist.get_xlim(), (1.8 - 1.5 / g) / 2 + size * np.array([-0.58, 0.58]), rtol=1e-6)
    np.testing.assert_allclose(nyquist.get_ylim(), size * np.array([-0.58, 0.58]), rtol=1e-6)
    draw_bode(gain, phase, loop, [(member, look, "g = 0.4")])
    for axes, part, limit, step in ((gain, 0, 0.0, 5), (phase, 1, -180.0, 45)):
        familiar, own, dashed, *lines = (line.get_xydata() for line in axes.lines)
        for curve, of in ((own, g), (familiar, other)):
            values = closed(of, curve[:, 0])
            exact = np.degrees(np.unwrap(np.angle(values))) if part else 20 * np.log10(np.abs(values))
            np.testing.assert_allclose(curve[:, 1], exact, atol=1e-9)
        assert dashed[:, 1].tolist() == [limit] * 2
        stems = [line for line in lines if len(line) == 2]
        points = [line[0] for line in lines if len(line) == 1]
        for point, (name, value) in zip(points, at.items(), strict=True):
            level = np.degrees(np.angle(value)) if part else 20 * np.log10(abs(value))
            assert point == pytest.approx([wanted[name][2], -180 if part and name == "gain_up" else level], rel=1e-9, abs=1e-9)
        for stem in stems:
            assert stem[1] - stem[0] == pytest.approx([0, -wanted["phase"][0] if part else 20 * np.log10(wanted["gain_up"][0])])
        assert [stem[0, 0] for stem in stems] == ([pytest.approx(wanted["phase"][2])] * 2 if part else [50.0])
        assert axes.get_xlim() == pytest.approx((0.005, 50))
        top, low = (0.0, -180.0) if part else (20 * np.log10(1.8), 20 * np.log10(other / 1.5))
        room = 0.05 * (top - low)
        assert axes.get_ylim() == pytest.approx((low - room, top + room), abs=0.1)
        assert axes.yaxis.get_major_locator()._edge.step == step
    assert phase.get_xlabel() == "frequency (Hz), up to half the frame's rate"


@pytest.mark.parametrize(
    ("g", "words"),
    [
        (1.2, ["rise time < 10 ms", "overshoot 70 % at 10 ms", "within 2 % after 110 ms"]),
        (0.2, ["rise time 10 ms", "within 2 % after 40 ms"]),
        (0.5, ["rise time < 10 ms", "within 2 % after 10 ms"]),
    ],
)
def test_a_step_is_a_power_of_the_pole_and_its_marks_lie_on_it(g, words):
    step = _closed_step(lag(g), "c.y")
    axes = Figure().subplots()
    marks = draw_step(axes, step)
    assert [said.replace("\N{NO-BREAK SPACE}", " ") for _, said in marks] == words
    final = g / (0.5 + g)

    def at(ms):
        return final * (1 - (0.5 - g) ** np.round(np.asarray(ms) / 10))

    curve, dashed, *others = (line.get_xydata() for line in axes.lines)
    np.testing.assert_allclose(curve[:, 1], at(curve[:, 0]), atol=1e-12)
    np.testing.assert_allclose(curve[:, 0], 10 * np.arange(len(curve)))
    assert axes.get_xlim() == (0, curve[-1, 0])
    assert (axes.get_xlabel(), dashed[:, 1].tolist()) == ("time (ms)", [pytest.approx(final)] * 2)
    for line in others:
        on_curve = line[1:] if line[0] == pytest.approx([10, final]) else line  # a stem begins at the final value
        np.testing.assert_allclose(on_curve[:, 1], at(on_curve[:, 0]), atol=1e-9)
    band = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    assert (band.y0, band.y1) == (pytest.approx(0.98 * final), pytest.approx(1.02 * final))
    slow = _closed_step(lag(0.1), "c.y")
    draw_others(axes, [(slow, family_looks(1)[0])])
    other = axes.lines[-1].get_xydata()
    np.testing.assert_allclose(other[:, 1], 0.1 / 0.6 * (1 - 0.4 ** np.round(other[:, 0] / 10)), atol=1e-12)
    assert axes.get_xlim()[1] == pytest.approx(max(curve[-1, 0], 1e3 * slow.time_s[slow.shown - 1]))
    assert other[-1, 0] == pytest.approx(axes.get_xlim()[1])


@pytest.mark.parametrize("route", [None, ["ref", "own"]])
def test_a_page_shows_the_closed_form_of_loop_and_step(route):
    spec = lag(0.2)
    shown = panel.data(spec)
    found = panel.quick(spec, {"cut": "c.y", "route": route}, shown, True)
    curve, step = found["open"], found["step"]
    L = np.array(curve["re"]) + 1j * np.array(curve["im"])
    np.testing.assert_allclose(L, closed(0.2, np.array(curve["hertz"])), rtol=1e-9)
    np.testing.assert_allclose([curve["decibels"], curve["degrees"]], decibels_and_degrees(L, False))
    assert np.abs(np.log(L[1:] / L[:-1])).max() <= 0.2
    values = 0.2 / 0.7 * (1 - 0.3 ** np.arange(40))
    np.testing.assert_allclose(step["value"], values[: len(step["value"])], atol=1e-12)
    np.testing.assert_allclose(step["time_s"], T * np.arange(len(step["value"])))
    assert step["final"] == pytest.approx(0.2 / 0.7)
    assert step["rise"] == [[T, pytest.approx(values[1])], [pytest.approx(2 * T), pytest.approx(values[2])]]
    assert (step["rise_s"], step["settling_s"]) == (pytest.approx(T), pytest.approx(4 * T))
    assert step["peak"][1] == pytest.approx(values[round(step["peak"][0] / T)], abs=1e-12)
    assert (step["overshoot"], step["known"], step["error"], step["unit"]) == (0, True, None, "" if route else "ratio")
    assert panel.quick(spec, {"cut": "", "route": route}, shown, True) == {}
    assert "unstable" in panel.quick(spec, {"cut": "c.y", "route": route}, shown, False)["step"]["error"]
    for wrong in ({"cut": "x.y"}, {"cut": "c.y", "route": ["own", "ref"]}):
        with pytest.raises(KeyError):
            panel.quick(spec, wrong, shown, True)


def test_lines_say_what_is_lifted_in_doubt_or_without_a_limit_and_what_holds_for_all():
    def row(value, unit="ratio", **more):
        cells = {"omega": 20 * np.pi, "hz": 10.0, "doubt": "", "limited": True}
        cells |= {"fails_below": None, "fails_from": None, "settled": True, "counterexample": ""}
        return {"value": value, "unit": unit} | cells | more

    def lines(of_spec, **more):
        facts = {"cut": "c.y", "period_s": 0.02, "times": 1, "rows": 4, "doubts": {}, "margins": of_spec}
        return [*KINDS[0].lines(facts | more)]

    once = {"gain_down": row(0.12345649), "phase": row(44.99999, "deg", hz=40.0), "delay_frames": row(3.0, "frame", hz=None)}
    once |= {"disk": row(None, doubt="crowded"), "disk_gain": row(1e6, limited=False), "sensitivity": row(1.5, doubt="search")}
    assert lines(once) == [
        ("broken at c.y, once in 20 ms", False),
        ("gain may fall by a factor down to 0.123457, at 62.832 rad/s (10 Hz)", False),
        ("phase margin 44.9999 deg, at 40 Hz (seen once a frame: 10 Hz)", False),
        ("delay margin (fewer whole frames than) 3", False),
        ("disk margin: not certified (crowded), at 62.832 rad/s (10 Hz)", True),
        ("  gain alone within the disk, up or down by a factor of: no limit", False),
        ("peak sensitivity Ms 1.5, at 62.832 rad/s (10 Hz), not certified (search)", True),
    ]
    for times, word in ((2, "both"), (4, "all four"), (5, "all 5")):
        found = [
            line
            for line, _ in lines({"phase": row(45.0, "deg"), "sensitivity": row(1.5), "complementary": row(1.0)}, times=times)
        ]
        assert found[0] == f"broken at c.y, which runs {times} times per 20 ms; a margin is for one factor on {word} values"
        assert found[2] == f"peaks of inputs of any form, over all {times} values: largest singular values"
        assert len(found) == 5
    spec = lag(0.9, for_all={"g": {"start": 0.8, "stop": 1.0}})
    claims = [
        Claim(Property("margins", "figures"), own_scope(spec), status, said)
        for status, said in ((Status.PROVED, ""), (Status.REFUTED, "g = 1"))
    ]
    worst = {
        "gain_down": row(0.25, fails_below=0.2499999, counterexample="g = 1"),
        "phase": row(40.0, "deg", fails_from=41.00001),
    }
    proved, refuted = (lines({}, for_all=worst, claim=fact_of(claim)) for claim in claims)
    assert [line for line, _ in proved[2:]] == [
        "gain may fall by a factor down to 0.25, refuted below 0.249999 by g = 1",
        "phase margin 40 deg, refuted from 41.0001 on by ",
    ]
    assert proved[1][0].endswith("(for_all):")
    assert (len(refuted), refuted[0][1]) == (2, True)


def test_rows_of_the_spec_and_of_all_its_numbers_are_told_apart():
    columns = {"guarantee": ["spec", "spec", "for_all"], "cut": ["c.y"] * 3, "margin": ["phase", "disk", "phase"]}
    columns |= {
        "value": [50.0, 0.8, 40.0],
        "unit": ["deg", "ratio", "deg"],
        "omega": [3.0, np.nan, np.nan],
        "hz": [0.5, 1.0, np.nan],
    }
    columns |= {
        "doubt": ["", "search", ""],
        "limited": [True] * 3,
        "fails_below": [np.nan] * 3,
        "fails_from": [np.nan, np.nan, 41.0],
    }
    columns |= {"settled": [True] * 3, "counterexample": ["", "", "g = 1"]}
    columns = {name: np.array(cells, object if isinstance(cells[0], str) else None) for name, cells in columns.items()}
    facts = {"cut": "c.y", "period_s": 0.02, "claims": {"for_all": "a claim"}}
    found = _numbers(columns, facts)
    assert (found["rows"], found["doubts"], found["times"], found["claim"]) == (3, {"search": 1}, 1, "a claim")
    assert {name: row["value"] for name, row in found["margins"].items()} == {"phase": 50.0, "disk": 0.8}
    assert found["for_all"] == {
        "phase": {"value": 40.0, "unit": "deg", "omega": None, "doubt": "", "limited": True, "hz": None}
        | {"fails_below": None, "fails_from": 41.0, "settled": True, "counterexample": "g = 1"}
    }
    alone = {name: column[:2] for name, column in columns.items() if name != "guarantee"}
    assert {"for_all", "claim"}.isdisjoint(_numbers(alone, facts | {"times": 4}))
    with pytest.raises(wavesweep.UsageError, match="expected a loop that is stable, found one that is not; wavesweep check"):
        margins(lag(1.6))
