"""Margins for all of [for_all]: none that python-control has of a loop of the box is smaller, and the refuted ones are met."""

import warnings
from itertools import product

import control
import numpy as np
import pytest
from meaning.reading import radius_of, with_numbers
from scipy.signal import cont2discrete

pytest.importorskip("wavesweep.for_all", reason="margins for all of [for_all] are proved by it")
from wavesweep import load
from wavesweep.margins import box_margins
from wavesweep.margins.box_margins import margins_for_all
from wavesweep.margins.table import margins

LAG = {
    "rates": {"tick_hz": 100},
    "numbers": {"a": 8.0, "k": 3.0, "every": 2, "late": 1},
    "block": {
        "plant": {"type": "tf", "num": ["a"], "den": [1, "a", 0]},
        "pd": {"type": "gain", "k": "k", "every": "every"},
        "net": {"type": "delay", "steps": "late", "every": "every"},
    },
    "wire": {"pd.u": "-plant.y", "net.u": "pd.y", "plant.u": "net.y"},
}
BOX = {"a": {"start": 7.5, "stop": 8.5}, "k": {"start": 2.5, "stop": 3.0}}


def for_all(spec, cut, **ranges):
    rows, _ = margins_for_all(load(spec | {"for_all": ranges}), cut)
    return {each.name: each for each in rows}


def of_control(a, k, every=2, late=1):
    """The margins of the same loop by python-control."""
    period = every / 100
    A, B, C, D, _ = cont2discrete(control.ssdata(control.ss(control.tf([a * k], [1, a, 0]))), period)
    L = control.tf(control.ss(A, B, C, D, period)) * control.tf([1], [1] + [0] * late, period)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gain, phase, _, _, omega, _ = control.stability_margins(L, returnall=True)
        disk, *_ = control.disk_margins(L, np.geomspace(0.1, np.pi / period, 400))
    return {
        "gain_up": min(gain[gain > 1]),
        "phase": min(phase),
        "delay_frames": min(np.radians(phase) / omega) / period,
        "disk": disk,
    }


@pytest.mark.parametrize(("k", "size", "proved"), [(0.5, np.inf, np.inf), (3.0, np.inf, 0.0), (3.0, 40.0, None)])
def test_any_delay_is_proved_where_the_gain_is_below_1_alone(k, size, proved):
    """A leaky plant with the gain k at rest. Of a delay that is too long, the proof ends where a pole of a loop is outside."""
    plant = LAG["block"]["plant"] | {"den": [1, "a"]}
    tables = with_numbers(LAG, {"k": k}) | {"block": LAG["block"] | {"plant": plant}}
    spec = load(tables | {"for_all": {"a": BOX["a"]}})
    (case,) = box_margins._cases(spec, "net.y", spec.for_all.unknown, {})
    found, _ = case._proved("delay_frames", size)
    if proved is None:
        ends = [BOX["a"]["start"], BOX["a"]["stop"]]
        radii = [max(radius_of(with_numbers(tables, {"a": a, "late": late}), 0) for a in ends) for late in range(1, 40)]
        proved = float(np.argmax(np.array(radii) > 1))
        assert 0 < proved < 32
    assert found == proved


@pytest.mark.slow
def test_no_loop_of_a_box_has_less_than_what_is_proved():
    found, rng = for_all(LAG, "net.y", **BOX), np.random.default_rng(3)
    points = [*np.column_stack([rng.uniform(7.5, 8.5, 3), rng.uniform(2.5, 3, 3)]).tolist(), *product((7.5, 8.5), (2.5, 3.0))]
    least = {}
    for point in points:
        for name, value in of_control(*point).items():
            assert name == "delay_frames" or value > found[name].value, (name, point)
            least[name] = min(value, least.get(name, np.inf))
    for name, value in least.items():
        assert found[name].refuted == pytest.approx(value, rel=2e-3)  # at a corner
        assert found[name].settled
        if name != "delay_frames":
            assert 0.99 * found[name].refuted < found[name].value < found[name].refuted
    assert found["delay_frames"].value == found["delay_frames"].refuted > 1
    first = int(np.ceil(found["delay_frames"].value))  # of the frames beyond the one of the spec
    for late, stable in [*((1 + frames, True) for frames in range(first)), (2 + first, False)]:
        radii = [radius_of(with_numbers(LAG, {"a": a, "k": k, "late": late}), 0) for a, k in points]
        assert (max(radii) < 1) == stable
    assert (found["gain_down"].value, found["gain_down"].limited) == (0, False)
    assert "k = 3" in found["delay_frames"].counterexample


def test_values_are_proved_one_by_one_and_the_worst_counts_in_rows_behind_those_of_the_spec(monkeypatch):
    monkeypatch.setattr(
        "wavesweep.margins.dead_time_margin.in_seconds", lambda _spec, _cut, found, _times: found
    )  # takes longer
    columns = margins(load(LAG | {"for_all": {"late": {"values": [0, 1, 2]}}}), "net.y").columns
    for word, late in (("spec", 1), ("for_all", 2)):
        rows = columns["guarantee"] == word
        found = dict(zip(columns["margin"][rows], columns["value"][rows], strict=True))
        for name, value in of_control(8.0, 3.0, late=late).items():
            assert found[name] == pytest.approx(value, rel=2e-3)
    assert columns["guarantee"].tolist() == sorted(columns["guarantee"], reverse=True)
    assert set(columns["counterexample"][rows & (columns["margin"] != "gain_down")]) == {"late = 2"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gain_up", "phase", "disk"])
def test_what_few_loops_of_a_box_lack_is_not_proved(name):
    """About a = 7.93 the gain is half as large again."""
    bump = "k*(1 + 0.5*exp(-((a - 7.93)/0.02)**2))"
    spec = load(LAG | {"block": LAG["block"] | {"pd": {"type": "gain", "k": bump, "every": "every"}}})
    spec = load(spec.tables() | {"for_all": {"a": {"start": 7.85, "stop": 8.05}}})
    (case,) = box_margins._cases(spec, "net.y", spec.for_all.unknown, {})
    sizes = [box_margins.size_of(case._at((a,))[name]) for a in (7.93, 7.85)]
    assert sizes[0] < 0.9 * sizes[1]
    assert case._proved(name, 0.99 * sizes[0])[0] == pytest.approx(0.99 * sizes[0], rel=1e-9)
    assert case._proved(name, 0.97 * sizes[1])[0] < sizes[0]


def test_a_box_with_an_unstable_loop_has_no_margin_but_a_counterexample():
    found = for_all(LAG, "net.y", k={"start": 3.0, "stop": 100.0})
    assert {each.counterexample for each in found.values()} == {"k = 100"}
    assert np.isnan([each.value for each in found.values()]).all()


def test_frames_that_vary_leave_the_margins_of_the_specs_own_numbers():
    spec = LAG | {"for_all": {"every": {"values": [1, 2], "varying": True}}}
    table = margins(load(spec), "net.y")
    assert "guarantee" not in table.columns
    assert any("constant, and here every of [for_all] may vary" in notice for notice in table.facts["notices"])


def test_margins_beside_lost_messages_speak_of_messages_and_of_no_table_that_is_not_there():
    spec = LAG | {"block": LAG["block"] | {"net": {"type": "channel", "lost": 1, "every": "every"}}}
    spec["numbers"] = {name: value for name, value in LAG["numbers"].items() if name != "late"}
    said = box_margins.refused(load(spec))
    assert ("messages may be late or lost" in said, "[for_all]" in said) == (True, False)


def test_a_search_for_the_worst_numbers_asks_for_the_margins_of_those_that_may_be_worse_alone():
    spec = load(LAG | {"for_all": BOX})
    (case,) = box_margins._cases(spec, "pd.y", spec.for_all.unknown, {})
    point, worst = case._worst("gain_up", [])
    assert point == min(product(*case.box.T.tolist()), key=lambda each: of_control(*each)["gain_up"])
    assert worst.value == pytest.approx(of_control(*point)["gain_up"], rel=1e-6)
    assert len(case.known) <= 3
