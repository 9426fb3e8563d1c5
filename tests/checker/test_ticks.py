"""Ticks of any times between two: x' = -k y with y sampled in each tick, or in each second one, is stable below 2/k."""

from fractions import Fraction

import pytest
from support.proofs import checked

from wavesweep.checker import form

TANK = """
rates.tick_hz = 10
numbers.k = 1.0
[block]
tank = { type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }
valve = { type = "hold", every = 1 }
[wire]
"tank.u" = "valve.y"
"valve.u" = "-k*tank.y"
[for_all]
tick = { late = 0.05 }
"""
EVERY_SECOND = TANK.replace("every = 1", "every = 2")
STATES = {"states": ["@tank x0"]}
ONE = [{"L": [["1"]]}]
ALWAYS = {"nodes": ONE, "edges": [[0, "0", 0]]}


def up_to(k, **more):
    return {"claim": "for all", "sides": {"k": ["13", k]}} | STATES | more


def refuted(k, *word):
    return {"claim": "refuted", "numbers": {"k": k}, "outside": 1, "word": list(word)} | STATES


UNSTABLE = {"L": [["1"]], "signs": "-"}


def test_a_form_proves_ticks_of_all_times(tmp_path):
    """x+ = (1 - h k) x, h up to 0.15 s: k below 13.333."""
    code, words = checked(tmp_path, TANK, [up_to("13.33"), ALWAYS])
    assert code == 0, words
    assert "k from 13 to 13.33: with ticks of any times from 0.1 to 0.15 s, every motion decays" in words
    assert checked(tmp_path, TANK, [up_to("13.34"), ALWAYS])[0] == 1
    later = TANK.replace("late = 0.05", "late = 0.051")
    assert checked(tmp_path, later, [up_to("13.33"), ALWAYS])[0] == 1
    same = TANK.replace("late = 0.05", "start = 0.1, stop = 0.15")
    assert checked(tmp_path, same, [up_to("13.33"), ALWAYS])[0] == 0


def test_each_part_of_the_times_has_an_edge(tmp_path):
    both = ALWAYS | {"edges": [[0, "0", 0], [0, "1", 0]]}
    assert checked(tmp_path, TANK, [up_to("13.33", ticks=["0.12"]), both])[0] == 0
    code, words = checked(tmp_path, TANK, [up_to("13.33", ticks=["0.12"]), ALWAYS])
    assert (code, "the frame 1 may come at node 0" in words) == (1, True), words
    for cuts in (["0.2"], ["0.12", "0.11"], ["0.1"]):
        code, words = checked(tmp_path, TANK, [up_to("13.33", ticks=cuts), both])
        assert (code, "do not rise" in words) == (1, True), words


BROKEN = [
    ({"more": 1}, "a graph has nodes, edges and a start alone"), ({"edges": [[0, "0", 1]]}, "has the node 1 of 1"),
    ({"edges": [[-1, "0", 0]]}, "has the node -1 of 1"), ({"start": 1}, "starts at one of its nodes"),
    ({"start": -1}, "starts at one of its nodes"), ({"nodes": [ONE[0] | {"signs": "+"}]}, "a node has L and Q alone"),
    ({"edges": [[0, "0"]]}, "an edge is not"), ({"edges": [[0, 0, 0]]}, "a letter is not"), ({"nodes": []}, "0 nodes"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "why"), BROKEN)
def test_a_graph_has_nodes_edges_and_a_start(change, why, tmp_path):
    code, words = checked(tmp_path, TANK, [up_to("13.33"), ALWAYS | change])
    assert (code, why in words) == (2, True), words


def test_a_form_without_a_graph_proves_no_ticks(tmp_path):
    code, words = checked(tmp_path, TANK, [up_to("13.33"), ONE[0] | {"signs": "+"}])
    assert (code, "no graph for k from 13.0 to 13.33" in words) == (1, True), words
    side = TANK.replace("numbers.k = 1.0", '[numbers]\nk = 1.0\n"for_all.tick" = 1.0').replace("-k*", "-k*for_all.tick*")
    code, words = checked(tmp_path, side, [up_to("13.33") | {"sides": {"for_all.tick": ["1", "1"]}}, ALWAYS])
    assert (code, "a number with the name for_all.tick" in words) == (2, True), words


def test_what_happens_in_a_tick_depends_on_its_place(tmp_path):
    """Of y sampled in each second tick, x+ = (1 - (h + h') k) x."""
    states = ["@held valve.y", "@tank x0"]
    k = {"claim": "for all", "numbers": {"k": "6"}, "states": states}
    # of y and x before the first tick, x^2 + 1e-4 y^2, and before the second one 1.2 (x + y/8)^2 + 0.008 y^2
    first = {"L": [["0.01", "0"], ["0", "1"]]}
    second = {"L": [["0.0894", "0"], ["0.1369", "1.0954"]]}
    edges = [[0, "0", 1], [1, "0", 0]]
    code, words = checked(tmp_path, EVERY_SECOND, [k, {"nodes": [first, second], "edges": edges}])
    assert code == 0, words
    code, words = checked(tmp_path, EVERY_SECOND, [k, {"nodes": [first, second], "edges": edges, "start": 1}])
    assert (code, "does not decrease" in words) == (1, True), words


def test_a_form_is_the_same_for_all_times_of_a_tick(tmp_path):
    """One that changes with the time is no form: the next tick has another one."""
    slope = {"nodes": [{"L": [["1"]], "Q": [[[0, 1], [["0.5"]]]]}], "edges": [[0, "0", 0]]}
    code, words = checked(tmp_path, TANK, [up_to("13.33"), slope])
    assert (code, "a slope has an exponent of each side" in words) == (2, True), words


def test_a_pattern_of_times_is_multiplied_out(tmp_path):
    for word in (["stop"], ["0.15", "stop", "0.149"], ["0.149"]):
        code, words = checked(tmp_path, TANK, [refuted("13.5", *word), UNSTABLE])
        assert code == 0, words
    assert "with ticks of 0.149 s for ever" in words
    for word, why in ((["0.1501"], "no tick of 0.1501 s may come"), ([], "no tick"), (["start"], "does not decrease")):
        code, words = checked(tmp_path, TANK, [refuted("13.5", *word), UNSTABLE])
        assert (code, why in words) == (1, True), words


def test_a_pattern_is_repeated_until_a_frame_is_whole(tmp_path):
    """At k = 7 two long ticks grow, |1 - 0.3 k| = 1.1, and a long and a short one do not."""
    one = {"claim": "refuted", "numbers": {"k": "7"}, "outside": 1, "states": ["@held valve.y", "@tank x0"]}
    form = {"L": [["0.03", "0"], ["0", "1"]], "signs": "+-"}
    for word, code in ((["stop", "stop"], 0), (["stop"], 0), (["stop", "start"], 1)):
        found, words = checked(tmp_path, EVERY_SECOND, [one | {"word": word}, form])
        assert found == code, words


BESIDE = {
    "a range": ("[for_all]", "[for_all]\nk = { start = 1, stop = 2 }", "tick stands alone"),
    "the measured time": ("late = 0.05", 'late = 0.05, steps = "measured"', "divides by the measured time"),
    "two ways": ("late = 0.05", "late = 0.05, start = 0.1, stop = 0.15", "late, or start and stop"),
    "another own tick": ("late = 0.05", "start = 0.11, stop = 0.15", "the spec's own one among them"),
    "never late": ("late = 0.05", "late = 0.0", "times are above 0"),
    "a dead time": ("valve = {", 'line = { type = "delay", seconds = 0.1 }\nvalve = {', "beside dead times"),
    "messages": ("valve = {", 'net = { type = "channel", lost = 1 }\nvalve = {', "beside dead times, messages"),
}


@pytest.mark.parametrize("case", BESIDE)
def test_what_has_no_proof_beside_late_ticks_is_refused(case, tmp_path):
    old, new, why = BESIDE[case]
    spec = TANK.replace(old, new)
    for name in ("line", "net"):
        if name in new:
            spec = spec.replace('"valve.u" = "-k*tank.y"', f'"{name}.u" = "-k*tank.y"\n"valve.u" = "{name}.y"')
    code, words = checked(tmp_path, spec, [up_to("13.33"), ALWAYS])
    assert (code, why in words) == (2, True), words


def test_frames_of_no_whole_ticks_and_means_have_no_proof(tmp_path):
    spec = 'rates.slow_hz = 60\ncontroller.kind = "dc-slow"\nfor_all.tick = { late = 0.0001 }\n'
    for text, claim, why in ((spec, {}, "no whole ticks"), (TANK, {"claim": "mean square"}, "the spec has no chances")):
        code, words = checked(tmp_path, text, [{"claim": "for all"} | STATES | claim, ALWAYS])
        assert (code, why in words) == (2, True), words


def test_a_tick_of_any_time_lies_between_its_control_points():
    """Of c_0 + c_1 s + c_2 s^2 + c_3 s^3 the first three terms are those of Bernstein's points, the last an error."""
    c = {0: 7, 1: -20, 2: 4, 3: 5}
    first, middle, last = form.control_points(form.Matrix({(0, power): [[x]] for power, x in c.items()}, [[1]]))
    for s in (Fraction(-1), Fraction(-1, 3), Fraction(1)):
        shares = ((1 - s) / 2) ** 2, (1 - s * s) / 2, ((1 + s) / 2) ** 2
        mixed = sum(share * point.parts[0,][0][0] for share, point in zip(shares, (first, middle, last), strict=True))
        assert abs(mixed - sum(x * s**power for power, x in c.items())) == abs(5 * s**3)
    assert [point.error for point in (first, middle, last)] == [[[6]]] * 3
