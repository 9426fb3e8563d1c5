"""Walls that push and never pull: a claim of the writer is proved, and what says more is refused."""

import tomllib
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from support.proofs import checked

pytest.importorskip("wavesweep.contact", reason="multipliers are found by it")
from wavesweep.checker import balls, contact, file
from wavesweep.contact.rows import wall_cut
from wavesweep.contact.wall_loop import WallLoop
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import loops_of
from wavesweep.proofs.walls import claim_of_walls

DIRECT = """
rates.ratio = 20
device = { mass = 0.1, damping = 1.5 }
environment.delay = 0
controller.kind = "dc-slow"
"""
WAVES = """
device = { mass = 0.1, damping = 1.5, velocity = "difference" }
environment = { integration = "explicit", delay = 1 }
controller = { kind = "pmw", b = 10.0 }
filters.lp1 = { order = 1, cutoff_hz = 10 }
"""
GRASPED = DIRECT + "operator.stiffness = 100"
DRAWN = """
rates.tick_hz = 1000
numbers = { K = 100.0, B = 1.0 }
[block]
device = { type = "mass", mass = 0.1, damping = 1.5 }
wall = { type = "hold", every = 20 }
[wire]
"device.f" = "hand - wall.y"
"wall.u" = "K*device.x + B*device.v"
[ports]
hand = { force = "hand", displacement = "device.x", reaction = "wall.y" }
wall = { stiffness = "K", damping = "B" }
"""
OFFSET = WAVES + "operator.stiffness = 100"  # hand and avatar apart: a drift with a force
MEMBERS = (
    DIRECT
    + """
[for_all]
contact = true
"device.mass" = { values = [0.09, 0.12] }
"""
)
# spec, and the largest stiffness with a damping of 1
PROVED = {DIRECT: "240", GRASPED: "150", WAVES: "600", OFFSET: "300", DRAWN: "240", MEMBERS: "200"}


@cache
def written(spec: str, K=("0", ""), B=("1", "1")) -> list[dict]:
    names = ("K", "B") if spec == DRAWN else ("K_VE", "B_VE")
    K = K[0], K[1] or PROVED[spec]
    ends = {name: tuple(map(Fraction, pair)) for name, pair in zip(names, (K, B), strict=True)}
    return claim_of_walls(file.spec_of(spec.encode()), {}, ends)


@pytest.mark.parametrize("spec", PROVED)
def test_every_motion_comes_to_rest(tmp_path, spec):
    code, words = checked(tmp_path, spec, written(spec))
    assert code == (3 if spec == MEMBERS else 0), words  # of whose [for_all] nothing else is asked
    assert "any wall that pushes and never pulls" in words
    assert f" from 0 to {PROVED[spec]}, " in words


def test_the_damping_may_have_the_range(tmp_path):
    lines = written(DIRECT, K=("100", "100"), B=("0.8", "3"))
    assert checked(tmp_path, DIRECT, lines)[0] == 0


def test_a_claim_may_have_pieces(tmp_path):
    low, high = (written(WAVES, K=ends, B=("3", "3")) for ends in (("0", "600"), ("600", "930")))
    head = low[0] | {"sides": {"K_VE": ["0", "930"], "B_VE": ["3", "3"]}}
    lines = [head, {"split": "K_VE", "at": "600"}, *low[1:], *high[1:]]
    assert low[0]["states"] == high[0]["states"]
    assert checked(tmp_path, WAVES, lines)[0] == 0
    assert checked(tmp_path, WAVES, lines[:-1])[0] == 1
    assert checked(tmp_path, WAVES, [head, lines[1], lines[3], lines[2]])[0] == 1


BOTH = [["1000"]], [["1000"]]
CHANGES = {
    "a higher end": ({"sides": {"K_VE": ["0", "255"], "B_VE": ["1", "1"]}}, {}, "that does not come to rest"),
    "less damping": ({"sides": {"K_VE": ["0", "240"], "B_VE": ["0.9", "0.9"]}}, {}, "that does not come to rest"),
    "a wall that pulls back": ({"sides": {"K_VE": ["-1", "240"], "B_VE": ["1", "1"]}}, {}, "K_VE = -1 is not at least 0"),
    "two ranges": ({"sides": {"K_VE": ["0", "240"], "B_VE": ["1", "2"]}}, {}, "more than one number"),
    "stiffness alone": ({"sides": {"K_VE": ["0", "240"]}, "numbers": {"B_VE": "1"}}, {}, "the stiffness and the damping"),
    "the damping first": ({"sides": {"B_VE": ["1", "1"], "K_VE": ["0", "240"]}}, {}, "the stiffness and the damping"),
    "no rest": ({"rest": None}, {}, "the states are"),
    "another rest": ({"rest": ["@v"]}, {}, "keeps the drift"),
    "weights of 1": ({}, {"e": ["0.5"], "h": ["0.5"]}, "weights of a multiplier"),
    "a negative weight": ({}, {"e": ["0.1"], "h": ["-0.1"]}, "weights of a multiplier"),
    "weights of one side": ({}, {"e": [], "h": ["0.1"]}, "weights of a multiplier"),
    "no weights": ({}, {"e": [], "h": [], "P": BOTH}, "that does not come to rest"),
    "no form without the wall": ({}, {"L": [["0"]]}, "without its wall"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_says_more_is_refused(tmp_path, change):
    of_claim, of_cell, why = CHANGES[change]
    head, cell = written(DIRECT)
    head = {key: value for key, value in (head | of_claim).items() if value is not None}
    code, words = checked(tmp_path, DIRECT, [head, cell | of_cell])
    assert code in (1, 2)
    assert why in words


def test_a_rest_is_one_of_walls_alone(tmp_path):
    head = {"claim": "modes", "outside": 0, "states": [], "rest": ["@x"]}
    code, words = checked(tmp_path, DIRECT, [head, {"L": [], "signs": ""}])
    assert code == 2
    assert "a rest is one of walls" in words


def test_a_spec_without_a_wall_has_no_claim(tmp_path):
    code, words = checked(tmp_path, DRAWN.split("wall = { st", maxsplit=1)[0], [{"claim": "contact", "states": []}])
    assert code == 1
    assert "the stiffness and the damping" in words


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("mass = 0.1", "mass = 0.09"),
        ("damping = 1.5", "damping = 1.4"),
        ("delay = 0", "delay = 1"),
        ("ratio = 20", "ratio = 21"),
        ("damping = 1.5 }", "damping = 1.5, delay = 1 }"),
    ],
)
def test_a_spec_with_another_number_is_refused(tmp_path, before, after):
    assert checked(tmp_path, DIRECT.replace(before, after), written(DIRECT))[0] == 1


@pytest.mark.parametrize(
    "more", ['"rates.ratio" = { values = [16, 20], varying = true }', "lost = 1", '"device.mass" = { start = 0.1, stop = 0.1 }']
)
def test_what_varies_is_refused(tmp_path, more):
    code, words = checked(tmp_path, f"{DIRECT}[for_all]\n{more}\n", written(DIRECT))
    assert code == 1
    assert "REFUSED" in words


VARYING = '[for_all]\ncontact = true\n"rates.ratio" = { values = [20, 33], varying = true }\n'
IN_FRAMES = {"floating": DIRECT + VARYING, "grasped": GRASPED + "\n" + VARYING}


@cache
def in_frames(spec):
    """Lines for stiffnesses from 20 to 100, in one piece."""
    ends = {"K_VE": (Fraction(20), Fraction(100)), "B_VE": (Fraction(1),) * 2}
    head, *cells = claim_of_walls(file.spec_of(spec.encode()), {}, ends)
    assert len(cells) == 1
    return head, cells[0]


@pytest.mark.parametrize("spec", IN_FRAMES)
def test_every_motion_comes_to_rest_in_any_order_of_frames(tmp_path, spec):
    spec = IN_FRAMES[spec]
    code, words = checked(tmp_path, spec, in_frames(spec))
    assert code == 3, words
    assert "K_VE from 20 to 100, B_VE = 1: every motion comes to rest" in words


def with_edges(change):
    return lambda line: line | {"edges": [change(*edge) for edge in line["edges"]]}


FORGERIES = {
    "a higher end": ({"sides": {"K_VE": ["20", "160"], "B_VE": ["1", "1"]}}, dict, "does not fall"),
    "another damping": ({"sides": {"K_VE": ["20", "100"], "B_VE": ["0.2", "0.2"]}}, dict, "does not fall"),
    "a dropped edge": ({}, lambda line: line | {"edges": line["edges"][1:]}, "has no edge of it"),
    "a weight below 0": ({}, with_edges(lambda *edge: [*edge[:4], "-0.1"]), "not below 0"),
    "a weight of the force": ({}, with_edges(lambda *edge: [*edge[:3], "-0.1", edge[4]]), "not below 0"),
    "a heavier last force": ({}, with_edges(lambda *edge: [*edge[:4], "40"]), "does not fall"),
    "h below 0": ({}, lambda line: line | {"h": "-1"}, "not below 0"),
    "nothing stored": ({}, lambda line: line | {"h": "0"}, "does not fall"),
    "no forms": ({}, lambda line: line | {"nodes": []}, "0 nodes"),
    "a form of one end": ({}, lambda line: line | {"nodes": [{"L": node["L"][:1]} for node in line["nodes"]]}, "L is not"),
    "forms of the other end": (
        {},
        lambda line: line | {"nodes": [{"L": node["L"][::-1]} for node in line["nodes"]]},
        "does not fall",
    ),
    "a multiplier": ({}, lambda _: {"L": [], "e": [], "h": [], "P": []}, "no graph"),
}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_graph_that_says_more_is_refused(tmp_path, forgery):
    of_claim, change, why = FORGERIES[forgery]
    spec = IN_FRAMES["floating"]
    head, line = in_frames(spec)
    code, words = checked(tmp_path, spec, [head | of_claim, change(line)])
    assert code in (1, 2)
    assert why in words


@pytest.mark.parametrize("lengths", ["[20, 33, 40]", "[20, 34]", "[19, 33]"])
def test_frames_of_another_length_are_refused(tmp_path, lengths):
    spec = IN_FRAMES["floating"]
    other = spec.replace("[20, 33]", lengths)
    code, words = checked(tmp_path, other, in_frames(spec))
    assert code == 1
    assert "has no edge of it" in words


def march(K, B, word, wall, frames):
    """Forces of a floating mass, by its exact motion in frames of these ticks."""
    x, v, forces = 0.01, 0.0, []
    for place in range(frames):
        forces.append(wall(K * x + B * v))
        duration = 0.001 * word[place % len(word)]
        still = -forces[-1] / 1.5
        slow = np.exp(-1.5 / 0.1 * duration)
        x += duration * still + (v - still) * (1 - slow) * 0.1 / 1.5
        v = still + (v - still) * slow
    return np.abs(forces)


def test_a_march_comes_to_rest_inside_and_goes_on_outside():
    """Walls of the class in frames at random at the proved end; beyond it the linear wall grows in the longest frames."""
    rng = np.random.default_rng(7)
    walls = [lambda y: y, lambda y: max(0.0, y), lambda y: min(0.3, max(0.0, y - 0.1)), np.tanh]
    for wall in walls:
        for _ in range(5):
            forces = march(100.0, 1.0, rng.choice([20, 33], 97), wall, 2000)
            assert forces[-100:].max() < 1e-6 * max(1e-3, forces.max()) + 1e-9
    assert march(230.0, 1.0, [33], walls[0], 300)[-20:].max() > 10


def test_an_offset_that_the_wall_opposes_is_no_drift_with_a_force(tmp_path):
    """Without the spring of the hand nothing keeps hand and avatar apart, and the wall's force moves the rest."""
    code, words = checked(tmp_path, WAVES, written(OFFSET))
    assert code == 1
    assert "share of x in a drift" in words
    head, *cells = written(OFFSET)
    head = dict(head)
    code, words = checked(tmp_path, OFFSET, [head | {"drifts": []}, *cells])
    assert code == 1
    assert "does not move the rest away" in words
    turned = [["@x", *(name for name in names if name != "@x")] for names in head["drifts"]]
    del head["rest"]
    code, words = checked(tmp_path, OFFSET, [head | {"drifts": turned}, *cells])
    assert code == 1
    assert "takes a force of the wall" in words


def test_each_member_needs_its_proof(tmp_path):
    lines = written(MEMBERS)
    assert [line["member"] for line in lines if "member" in line] == [{"device.mass": "0.09"}, {"device.mass": "0.12"}]
    assert checked(tmp_path, MEMBERS.replace("0.12", "0.125"), lines)[0] == 1
    assert checked(tmp_path, MEMBERS.replace("0.12]", "0.12, 0.13]"), lines)[0] == 1


BEFORE = 'every = 20 }\n[wire]\n"device.f" = "hand - wall.y"\n'
OTHER = """every = 20 }
other = { type = "hold", every = 40 }
[wire]
"other.u" = "device.v"
"device.f" = "hand - wall.y - other.y"
"""


@pytest.mark.parametrize(
    ("before", "after", "why"),
    [
        ("K*device.x", "K*K*device.x", "not linear"),
        ("K*device.x", "200*device.x/K", "not linear"),
        ("K*device.x", "K*B*device.x", "not linear"),
        ("hand - wall.y", "hand - wall.y - K*device.x", "acts once in a frame"),
        (BEFORE, OTHER, "acts once in a frame"),
        (BEFORE, OTHER.replace("20", "10, phase = 1"), "acts once in a frame"),
        ('stiffness = "K", damping = "B"', 'stiffness = "B", damping = "K"', "the stiffness and the damping"),
    ],
)
def test_a_wall_that_is_not_one_force_once_in_a_frame_is_refused(tmp_path, before, after, why):
    assert before in DRAWN
    code, words = checked(tmp_path, DRAWN.replace(before, after), written(DRAWN))
    assert code == 1
    assert why in words


@pytest.mark.parametrize("spec", [DIRECT, GRASPED, WAVES, OFFSET])
@pytest.mark.parametrize("K", [0, 300])
def test_what_is_left_over_is_the_condition_on_the_circle(spec, K):
    """Whatever P is, on the circle it is Re M (1 + L), with the responses that the package has by another road."""
    claim = file.Claim("contact", {}, {"K_VE": (Fraction(0), Fraction(1000)), "B_VE": (Fraction(2),) * 2})
    head = written(spec)[0]
    claim.drifts, claim.rest = head["drifts"], head.get("rest", [])
    family = file.family_of(file.spec_of(spec.encode()), claim)
    loop = file.opened_at(family, {"K_VE": Fraction(K), "B_VE": Fraction(2)})
    e, h = [Fraction(1, 8), Fraction(0), Fraction(1, 4)], [Fraction(1, 3), Fraction(1, 16), Fraction(0)]
    n = len(loop.moved)
    P = np.random.default_rng(1).integers(-9, 9, (n + 3, n + 3))
    rows = [[int(x) << balls.BITS for x in row] for row in P + P.T]
    F = np.array(contact.left_over(loop, e, h, rows).parts[()], float) / balls.ONE
    moved = np.array([[middle for _, middle in row] for row in loop.moved], float) / balls.ONE
    own = load(tomllib.loads(spec))
    package = WallLoop.of(wall_cut(loops_of(own, dict(own.values), "environment.K_VE")))
    for angle in (0.05, 0.7, 2.0, np.pi):
        z = np.exp(1j * angle)
        eta = np.linalg.solve(z * np.eye(n) - moved[:, :n], moved[:, n])
        xi = np.append(eta * z**-3, z ** -np.arange(3, -1, -1.0))
        M = 1 - sum(float(x) * z**j + float(y) * z**-j for j, (x, y) in enumerate(zip(e, h, strict=True), 1))
        responses = package.responses(np.array([angle]))[0]
        responses[0] += package.residue.value / (z - 1)
        expected = (M * (1 - K * responses[0] - 2 * responses[1])).real
        assert (xi.conj() @ F @ xi).real == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(F).max())


MOTION = {
    "claim": "goes on",
    "sides": {"K_VE": ["508.6", "508.6"], "B_VE": ["5", "5"]},
    "forces": ["2", "1.5", "0.4995", "0", "0.5005", "1.5"],
}


def test_a_motion_that_goes_on_is_proved(tmp_path):
    """For 508.574 N/m the guide has these forces."""
    head = written(DIRECT)[0]
    code, words = checked(tmp_path, DIRECT, [head | MOTION])
    assert code == 0
    assert "its forces are 2, 1.5, 0.4995, 0, 0.5005, 1.5 and so on for ever" in words


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"sides": {"K_VE": ["507.5", "507.5"], "B_VE": ["5", "5"]}}, "has these forces"),
        ({"sides": {"K_VE": ["508.6", "509"], "B_VE": ["5", "5"]}}, "not at a range"),
        ({"forces": ["2", "1.5", "0.4995", "0.5005", "0", "1.5"]}, "has these forces"),
        ({"forces": ["2", "1.5", "0.4995", "0", "0.5005", "1.6"]}, "has these forces"),
        ({"forces": ["1"]}, "has these forces"),
        ({"forces": []}, "forces that go on"),
        ({"claim": "contact"}, "forces that go on"),
        ({"numbers": {"mass": "0.2"}}, "no number of this spec"),
        ({"numbers": {"device.mass": "0.2"}}, "has these forces"),
    ],
)
def test_another_motion_is_refused(tmp_path, change, why):
    code, words = checked(tmp_path, DIRECT, [written(DIRECT)[0] | MOTION | change])
    assert code in (1, 2)
    assert why in words


def test_a_motion_of_no_member_is_refused(tmp_path):
    """At 0.1 kg the forces go on, and [for_all] has 0.09 and 0.12 kg alone."""
    head = written(DIRECT)[0] | MOTION
    for numbers, why in (({}, "has a value of"), ({"device.mass": "0.1"}, "none of its values")):
        code, words = checked(tmp_path, MEMBERS, [head | {"numbers": numbers}])
        assert code == 1
        assert why in words


@pytest.mark.parametrize("K", [480, 507, 508, 508.3, 508.6, 520, 700])
def test_a_motion_goes_on_where_a_march_says_so(K):
    """40 rounds of the forces less their mean, by the exact motion of a mass in a frame: readings rise by as much as forces."""
    claim = file.Claim("goes on", {}, {"K_VE": (Fraction(400),) * 2, "B_VE": (Fraction(5),) * 2})
    head = written(DIRECT)[0]
    claim.drifts, claim.rest = head["drifts"], head["rest"]
    family = file.family_of(file.spec_of(DIRECT.encode()), claim)
    loop = file.opened_at(family, {"K_VE": Fraction(K), "B_VE": Fraction(5)})
    u = np.array([float(force) for force in MOTION["forces"]])
    slow = np.exp(-1.5 / 0.1 * 0.02)
    x = v = 0.0
    readings = []
    for force in np.tile(u - u.mean(), 40):
        readings.append(K * x + 5 * v)
        still = -force / 1.5  # the speed that the force leads to
        x += 0.02 * still + (v - still) * (1 - slow) * 0.1 / 1.5
        v = still + (v - still) * slow
    last = np.array(readings[-len(u) :])
    order = np.lexsort((last, u))
    goes_on = bool((np.diff(last[order]) >= np.diff(u[order])).all())
    assert contact.goes_on(loop, [Fraction(force) for force in MOTION["forces"]]) == goes_on
    assert goes_on == (K > 508.1)
