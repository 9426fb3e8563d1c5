"""Planes in parts: every part against spectral radii, the shares, the rectangle, and what is refused."""

import json

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.maps.figure import _STABLE as drawn_stable
from wavesweep.maps.figure import stability_map as drawn_map
from wavesweep.maps.rectangle import largest_about
from wavesweep.maps.stability_map import stability_map
from wavesweep.maps.table import KINDS
from wavesweep.program import plots
from wavesweep.program.plots.interval_legend import OWN

DRIVE = {
    "rates": {"tick_hz": 500.0},
    "numbers": {"k": {"value": 100.0}, "K": {"value": 20.0}, "T": {"value": 0.5}},
    "block": {
        "load": {"type": "mass", "mass": 10.0},
        "slow": {"type": "gain", "k": "K", "every": 5},
        "integral": {"type": "integrator", "method": "implicit"},
    },
    "wire": {"slow.u": "-load.x", "integral.u": "slow.y - load.v", "load.f": "k*(slow.y - load.v + integral.y/T)"},
    "sweep": {
        "along": "k",
        "k": {"start": 5.0, "stop": 8000.0, "scale": "log"},
        "K": {"start": 1.0, "stop": 400.0, "scale": "log"},
    },
}


def _held(spec, names, wanted, points=40):
    """A map, each of whose proved parts is held against radii at points of it and at its corners."""
    table = stability_map(spec, names, wanted)
    columns = table.columns
    places = ("first", "second", "third")[: len(names)]
    low, high = (np.stack([columns[f"{place}_{end}"] for place in places], -1) for end in ("low", "high"))
    rng = np.random.default_rng(0)
    compiled = wavesweep.compile(spec)
    proved = np.flatnonzero(columns["proved"] != "open")
    for row in rng.choice(proved, points):
        point = low[row] + rng.choice([0.0, rng.uniform(), 1.0], len(names)) * (high - low)[row]
        own = compiled.with_(**dict(zip(names, point.tolist(), strict=True)))
        assert (float(own.spectral_radius()) < 1) == (columns["outside"][row] == 0), point
    assert ((columns["outside"] == 0) == (columns["proved"] == "stable")).all()
    assert (np.isnan(columns["outside"]) == (columns["proved"] == "open")).all()
    assert columns["share"].sum() == pytest.approx(1, abs=1e-9)
    assert columns["share"][columns["proved"] == "open"].sum() <= wanted
    counts = table.facts["slices"]
    assert (counts["computed"], counts["certified"]) == (len(columns["share"]), len(proved))
    assert (np.diff(columns["first_low"]) >= 0).all()
    return table


def test_a_number_that_the_controller_does_not_read_is_said_so():
    """The local model's stiffness of a loop without one, of which a map has two sides that differ in nothing."""
    spec = wavesweep.load({"controller": {"kind": "dc-slow"}, "sweep": {"K_LM": {"start": 0, "stop": 1}}})
    notices = stability_map(spec, ["K_VE", "K_LM"], 0.5).facts["notices"]
    assert "K_LM is not read by dc-slow: evaluated once, its rows repeated" in notices


def test_what_is_proved_of_a_part_holds_at_its_points():
    table = _held(wavesweep.load(DRIVE), ["k", "K"], 0.1)
    assert {"stable", "unstable", "open"} == {*table.columns["proved"]}
    again = KINDS[0].again(table.facts, str)
    assert (next(iter(again.all_blocks()))["share"] == table.columns["share"]).all()
    numbers = KINDS[0].tally(table)
    numbers.add(table.columns)
    found = numbers.numbers(table.facts)
    json.dumps(found)
    assert {*found["outside"]} == {"1", "2"}
    lines = [line for line, _ in KINDS[0].lines(found)]
    assert lines[0].startswith("k by K: ")
    # the rectangle has the own design, and nothing but stable parts
    about = np.array(found["about"])
    assert (about[0] < [100, 20]).all()
    assert (about[1] > [100, 20]).all()
    columns = table.columns
    low, high = (np.stack([columns[f"{place}_{end}"] for place in ("first", "second")], -1) for end in ("low", "high"))
    meets = ((low < about[1] * (1 - 1e-9)) & (high > about[0] * (1 + 1e-9))).all(-1)
    assert {*columns["proved"][meets]} == {"stable"}


def _apart(span_a, span_b, coupling=0.1, **own):
    """Modes at a and at b, one of which moves the other by the coupling."""
    block = {
        "m": {
            "type": "ss",
            "discrete": True,
            "inputs": ["u"],
            "A": [["a", coupling], [0, "b"]],
            "B": [[1], [1]],
            "C": [[1, 1]],
        },
        "g": {"type": "gain", "k": 0.0},
    }
    numbers = {"a": {"value": 0.6}, "b": {"value": 0.6}} | {name: {"value": value} for name, value in own.items()}
    sweep = {"along": "a", "a": span_a, "b": span_b}
    wire = {"g.u": "m.y", "m.u": "g.y"}
    return wavesweep.load({"rates": {"tick_hz": 100.0}, "numbers": numbers, "block": block, "wire": wire, "sweep": sweep})


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_modes_apart_from_each_other_have_the_counts_and_shares_of_their_squares(scale):
    """As many are outside as of a and b are above 1; a share of the plane is one of logarithms where the range is one."""
    low, high = (0.5, 4.0) if scale == "log" else (-0.5, 2.5)
    inside = 1 / 3 if scale == "log" else 0.5
    table = stability_map(_apart({"start": low, "stop": high, "scale": scale}, {"start": 0.5, "stop": 1.5}), ["a", "b"])
    columns = table.columns
    middle = np.stack([columns[f"{place}_low"] / 2 + columns[f"{place}_high"] / 2 for place in ("first", "second")], -1)
    shown = columns["proved"] != "open"
    assert (columns["outside"][shown] == (middle > 1).sum(-1)[shown]).all()
    wanted = {0: inside / 2, 1: 0.5, 2: (1 - inside) / 2}
    for outside, share in wanted.items():
        assert columns["share"][columns["outside"] == outside].sum() == pytest.approx(share, abs=0.005)
    sizes = np.array([[columns[f"{place}_{end}"] for place in ("first", "second")] for end in ("low", "high")])
    spans = np.diff(np.log(sizes[:, 0]) if scale == "log" else sizes[:, 0], axis=0)[0] * np.diff(sizes[:, 1], axis=0)[0]
    np.testing.assert_allclose(columns["share"], spans / spans.sum(), rtol=1e-9)
    assert [sizes[0].min(1).tolist(), sizes[1].max(1).tolist()] == table.facts["ends"] == [[low, 0.5], [high, 1.5]]
    np.testing.assert_allclose(table.facts["about"], [[low, 0.5], [1, 1]], rtol=0.02)
    assert table.facts["own"] == [0.6, 0.6]
    assert table.facts["logarithmic"] == [scale == "log", False]
    assert table.facts["wanted"] == 0.005


@pytest.mark.parametrize("ends", [(-1.5, 1.5), (0.0, 2.0)])
def test_modes_that_do_not_act_on_each_other_have_the_map_of_their_squares(ends):
    """Also where the plane's middle has modes of no size, or on the circle."""
    span = dict(zip(("start", "stop"), ends, strict=True))
    columns = stability_map(_apart(span, span, 0.0), ["a", "b"]).columns
    assert len(columns["share"]) < 1000
    share = 2 / 3 if ends[0] < 0 else 0.5  # of each number, inside the circle
    assert columns["share"][columns["outside"] == 0].sum() == pytest.approx(share**2, abs=0.005)


def test_an_unstable_design_has_no_rectangle_and_few_parts_leave_most_open(monkeypatch):
    spec = _apart({"start": 0.5, "stop": 2}, {"start": 0.5, "stop": 1.5}, a=1.2)
    assert stability_map(spec, ["a", "b"]).facts["about"] is None
    monkeypatch.setattr("wavesweep.maps.stability_map.MOST_PARTS", 1)
    table = stability_map(spec, ["a", "b"])
    assert table.columns["proved"].tolist() == ["open", "open"]
    assert table.columns["share"].tolist() == [0.5, 0.5]


def _by_hand(**more):
    """Parts of a plane, by columns, and facts about it."""
    columns = {
        "first_low": [0.0, 1.0, 1.0, 3.0], "first_high": [1.0, 3.0, 3.0, 4.0],
        "second_low": [1.0, 1.0, 2.0, 1.0], "second_high": [3.0, 2.0, 3.0, 3.0],
        "share": [0.25, 0.25, 0.25, 0.25], "outside": [0.0, 1.0, 5.0, np.nan],
        "proved": np.array(["stable", "unstable", "unstable", "open"], object),
    }  # fmt: skip
    facts = {"numbers": ["a", "b"], "ends": [[0.0, 1.0], [4.0, 3.0]], "own": [0.5, 2.0], "about": None, "wanted": 0.1}
    return {name: np.array(column) for name, column in columns.items()}, facts | more


def test_a_map_says_what_share_is_proved():
    columns, facts = _by_hand(about=[[0.0, 1.0], [1.0, 3.0]])
    tally = KINDS[0].tally(stability_map(_apart({"start": 0.5, "stop": 2}, {"start": 0.5, "stop": 1.5}), ["a", "b"]))
    tally.add(columns)
    found = tally.numbers(facts)
    assert {name: found[name] for name in ("parts", "stable", "unstable", "open")} == {
        "parts": 4, "stable": 0.25, "unstable": 0.5, "open": 0.25,
    }  # fmt: skip
    assert found["outside"] == {"1": 0.25, "5": 0.25}
    assert [*KINDS[0].lines(found)] == [
        ("a by b: 4 parts, 25 % proved stable, 50 % proved unstable, 25 % open", True),
        ("  narrower ranges leave less open", True),
        ("  25 % with 1 eigenvalue outside the unit circle", False),
        ("  25 % with 5 eigenvalues outside the unit circle", False),
        ("  the largest rectangle about the own design, all stable: a 0 to 1, b 1 to 3", False),
    ]
    assert [important for _, important in KINDS[0].lines(found | {"wanted": 0.25})] == [False] * 4


@pytest.mark.parametrize("third", [False, True])
def test_every_part_is_drawn_in_its_place(third):
    columns, facts = _by_hand(logarithmic=[False, True])
    facts["about"] = None if third else [[0.5, 1.0], [1.0, 3.0]]
    if third:
        facts |= {"numbers": ["a", "b", "c"], "ends": [[0.0, 1.0, 10.0], [4.0, 3.0, 20.0]], "own": [0.5, 2.0, 12.0]}
        columns |= {"third_low": np.array([10.0, 10.0, 15.0, 10.0]), "third_high": np.array([20.0, 16.0, 20.0, 14.0])}
    numbers = {name: {"value": 1.0, "unit": "", "description": ""} for name in facts["numbers"]}
    canvas = drawn_map(columns, facts | {"spec": {"numbers": numbers}, "assumes": []})
    shown = {(0, 1): "stable", (1, 1): 1, (1, 2): 5, (3, 1): "open"}
    cuts = [{(0, 1), (1, 1), (3, 1)}, {(0, 1), (1, 1), (1, 2)}, {(0, 1), (1, 2)}] if third else [{*shown}]
    for axes, wanted in zip(canvas.axes, cuts, strict=True):
        found = {}
        for collection in axes.collections:
            for path in collection.get_paths():
                found[tuple(path.vertices.min(0).tolist())] = collection.get_facecolor()[0, :3].tolist()
                assert len({*map(tuple, path.vertices.tolist())}) == 4
        assert {*found} == wanted
        for corner, colour in found.items():
            of_kind = {"stable": drawn_stable[:3], "open": (0, 0, 0), 1: (0.75,) * 3, 5: (0.3,) * 3}[shown[corner]]
            np.testing.assert_allclose(colour, of_kind, atol=0.01)
        assert (axes.get_xlim(), axes.get_ylim()) == ((0, 4), (1, 3))
        assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "log")
        (cross,) = axes.lines
        assert cross.get_xydata().tolist() == [[0.5, 2.0]]
        boxes = [[*box.get_xy(), box.get_width(), box.get_height()] for box in axes.patches]
        assert boxes == ([] if third else [[0.5, 1.0, 0.5, 2.0]])
    assert [axes.get_title() for axes in canvas.axes] == (["c = 11", "c = 15", "c = 19"] if third else [""])
    words = [text.get_text() for text in canvas.legends[0].get_texts()]
    assert words == ["stable", "unstable, 1 outside", "unstable, 4 or more outside", "open"]
    assert ("dashed" in " ".join(text.get_text() for text in canvas.texts)) is not third


@pytest.mark.slow
def test_maps_of_a_wall_and_of_three_numbers_hold_at_their_points():
    haptic = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 5000}, "b": {"start": 5, "stop": 100}}}
    _held(wavesweep.load(haptic), ["K_VE", "b"], 0.05, 200)
    _held(wavesweep.load(DRIVE), ["k", "K", "T"], 0.3, 200)
    # modes as far outside as 1e9
    clocked = DRIVE | {
        "rates": {"tick_hz": "1/h"},
        "numbers": DRIVE["numbers"] | {"h": {"value": 0.002}},
        "sweep": {"along": "k", "k": {"start": 0.1, "stop": 20000.0}, "h": {"start": 0.002, "stop": 0.03}},
    }
    _held(wavesweep.load(clocked), ["k", "h"], 0.1, 200)
    # elsewhere with an offset and on scales that are not logarithmic
    offset = DRIVE | {"sweep": {"along": "k", "k": {"start": -5.0, "stop": 900.0}, "K": {"start": 0.0, "stop": 400.0}}}
    _held(wavesweep.load(offset), ["k", "K"], 0.1, 200)


def test_a_loop_without_states_has_no_map():
    block = {"g": {"type": "gain", "k": "a"}, "h": {"type": "gain", "k": "b"}}
    wire = {"g.u": "h.y", "h.u": "-0.2*g.y"}
    tables = {"rates": {"tick_hz": 10.0}, "numbers": {"a": 0.3, "b": 0.2}, "block": block, "wire": wire}
    with pytest.raises(UsageError, match="expected a loop with states, found none"):
        stability_map(wavesweep.load(tables), ["a", "b"])


def test_a_map_of_a_block_that_nothing_drives_is_that_of_its_matrix():
    block = {"type": "ss", "A": [["a", "b"], ["-b", "a"]], "inputs": [], "B": [[], []], "C": [[1, 0]]}
    sweep = {"along": "a", "a": {"start": -2.0, "stop": 1.0}, "b": {"start": 0.0, "stop": 2.0}}
    tables = {"rates": {"tick_hz": 10.0}, "numbers": {"a": 0.3, "b": 0.2}, "block": {"x": block}, "sweep": sweep}
    table = stability_map(wavesweep.load(tables), ["a", "b"], 0.02)
    columns = table.columns
    assert {*columns["proved"]} == {"stable", "unstable", "open"}
    assert (columns["first_high"][columns["proved"] == "stable"] <= 0).all()
    assert (columns["first_low"][columns["proved"] == "unstable"] >= 0).all()
    figure = plots.stability_map(columns, table.facts)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["stable", "unstable, 2 outside", "open"]
    (own,) = figure.axes[0].lines  # with the mark that it has in every figure
    assert (own.get_marker(), own.get_xydata().tolist()) == (OWN["marker"], [[0.3, 0.2]])


def test_the_largest_rectangle_about_a_point_is_that_of_all_tries():
    rng = np.random.default_rng(3)
    whole = np.array([[0.0, 0.0], [6.0, 6.0]])
    for _ in range(10):
        corners = rng.integers(0, 6, (6, 2))
        obstacles = np.stack([corners, corners + 1], 1).astype(float)
        point = rng.integers(0, 6, 2) + 0.5
        on_floor = np.array([[point - 0.5, point + 0.5]]) * [1, 0] + [[0, 0], [0, 1]]  # under which no room is left
        assert largest_about(point * [1, 0], whole, np.concatenate([obstacles, on_floor])) is None
        inside = ((obstacles[:, 0] < point) & (point < obstacles[:, 1])).all(-1).any()
        found = largest_about(point, whole, obstacles)
        assert (found is None) == inside
        best = 0.0
        ticks = np.arange(7.0)
        for low in np.stack(np.meshgrid(ticks, ticks), -1).reshape(-1, 2):
            for high in np.stack(np.meshgrid(ticks, ticks), -1).reshape(-1, 2):
                if (low < point).all() and (point < high).all():
                    met = ((obstacles[:, 0] < high) & (obstacles[:, 1] > low)).all(-1).any()
                    best = max(best, 0.0 if met else float((high - low).prod()))
        if found is not None:
            assert (found[1] - found[0]).prod() == pytest.approx(best)


@pytest.mark.parametrize(
    ("names", "more", "said"),
    [
        (["k"], {}, "expected two or three numbers"),
        (["k", "k"], {}, "expected two or three numbers"),
        (["k", "block.slow.every"], {}, "decides how it is built"),
        (["k", "K"], {"sweep": DRIVE["sweep"] | {"require": {"radius": 0.9}}}, "stability-region --map"),
    ],
)
def test_what_has_no_map_is_refused(names, more, said):
    with pytest.raises(UsageError, match=said):
        stability_map(wavesweep.load(DRIVE | more), names)


@pytest.mark.parametrize("option", [("-j", "1"), ("--backend", "loky"), ("--restart",), ("--for-hands", "box")])
def test_options_of_rows_are_refused_beside_a_map(option, wavesweep, tmp_path):
    (tmp_path / "a.toml").write_text('controller.kind = "dc"')
    code, _, said = wavesweep("stability-region", str(tmp_path / "a.toml"), "--map", "K_VE,b", *option)
    assert code == 2
    assert "--map: expected it without --" in said
