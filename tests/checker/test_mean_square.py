"""Chances: x' = -k x, sampled and held, whose second moments are multiplied out here by hand."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import expm
from support.proofs import checked

from wavesweep.checker import balls, file

T = 0.1
LOSSY = """
rates.tick_hz = 10
numbers = {{ k = 1.0, p = 0.2 }}
[block]
tank = {{ type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }}
net = {{ type = "channel", {chances} }}
[wire]
"tank.u" = "net.y"
"net.u" = "-k*tank.y"
"""
FRAMES = """
rates.tick_hz = 10
numbers = {{ k = 1.0, n = 2 }}
[block]
tank = {{ type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }}
valve = {{ type = "hold", every = "n" }}
[wire]
"tank.u" = "valve.y"
"valve.u" = "-k*tank.y"
[for_all]
n = {{ values = [1, 3], varying = true, {chances} }}
"""
# a wall whose force is held over frames of 20 ms
RESULTS = """
rates.ratio = 20
device = { mass = 0.1, damping = 1.5 }
environment = { delay = 0, B_VE = 1.0 }
controller.kind = "dc-slow"
for_all.loss = 0.2
"""


def moments(steps: dict, states) -> float:
    """The spectral radius of second moments of a chain: steps[before, after] is a list of (chance, A)."""
    size = next(iter(steps.values()))[0][1].shape[0] ** 2
    whole = np.zeros((len(states) * size, len(states) * size))
    for (before, after), several in steps.items():
        for chance, A in several:
            row, column = states.index(after) * size, states.index(before) * size
            whole[row : row + size, column : column + size] += chance * np.kron(A, A)
    return abs(np.linalg.eigvals(whole)).max()


def of_losses(k: float, p: float, begins: float = 0.0, ends: float = 1.0) -> float:
    """Of (x, what is held), without and within a burst."""
    comes = np.array([[1 - k * T, 0], [-k, 0]])
    lost = np.array([[1, T], [0, 1]])
    out = [(1 - p, comes), (p, lost)]
    within = [(1.0, lost)]
    steps = {
        (0, 0): [((1 - begins) * chance, A) for chance, A in out],
        (0, 1): [(begins * chance, A) for chance, A in within],
        (1, 0): [(ends * chance, A) for chance, A in out],
        (1, 1): [((1 - ends) * chance, A) for chance, A in within],
    }
    return moments(steps, [0, 1])


def of_frames(k: float, chances) -> float:
    """chances[before][after] of lengths 1 and 3."""
    A = [np.array([[1 - k * n * T]]) for n in (1, 3)]
    return moments({(i, j): [(chances[i][j], A[j])] for i in (0, 1) for j in (0, 1)}, [0, 1])


def of_results(k: float) -> float:
    """Of (x, v, force) at the begins of frames: m v' = force - 1.5 v."""
    lost = expm(0.02 * np.array([[0, 1, 0], [0, -15, 10], [0, 0, 0]]))
    return moments({(0, 0): [(0.8, lost @ [[1, 0, 0], [0, 1, 0], [-k, -1, 0]]), (0.2, lost)]}, [0])


TWO = """
rates.tick_hz = 10
numbers.k = 1.0
[block]
tank = { type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }
a = { type = "channel", every = 4, loss = 0.2 }
b = { type = "channel", every = 2, phase = 1, loss = 0.3, missing = "zero" }
[wire]
"tank.u" = "a.y + b.y"
"a.u" = "-k*tank.y"
"b.u" = "-2*k*tank.y"
"""


def of_two(k: float) -> float:
    """Of (x, a, b): a comes in tick 0, b in ticks 1 and 3 of 4, and its force is 0 where it does not come."""

    def stretch(a, b, ticks):
        return [[1, ticks * T, ticks * T], [0, 1, 0], [0, 0, 1]] @ np.array([[1, 0, 0], a, b])

    kept = [0, 1, 0], [0, 0, 1]
    first = [(0.8, stretch([-k, 0, 0], kept[1], 1)), (0.2, stretch(*kept, 1))]
    others = [[(0.7, stretch(kept[0], [-2 * k, 0, 0], ticks)), (0.3, stretch(kept[0], [0, 0, 0], ticks))] for ticks in (2, 1)]
    return moments({(0, 1): first, (1, 2): others[0], (2, 0): others[1]}, [0, 1, 2])


CASES = {
    "results": (RESULTS, of_results),
    "two channels in turn": (TWO, of_two),
    "losses": (LOSSY.format(chances='loss = "p"'), lambda k: of_losses(k, 0.2)),
    "bursts": (LOSSY.format(chances='loss = "p", burst = 0.1, burst_end = 0.4'), lambda k: of_losses(k, 0.2, 0.1, 0.4)),
    "shares": (FRAMES.format(chances="shares = [3, 1]"), lambda k: of_frames(k, [[0.75, 0.25]] * 2)),
    "next": (FRAMES.format(chances="next = [[1, 1], [9, 1]]"), lambda k: of_frames(k, [[0.5, 0.5], [0.9, 0.1]])),
}


def limit_of(radius) -> float:
    low, high = 1.0, 400.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if radius(middle) < 1 else (low, middle)
    return low


def proof_of(spec: str, k: str) -> list[dict]:
    """Forms of the checker's chain: P_q = 1 + sum of chance A' P_r A."""
    name = "k" if "numbers" in spec else "K_VE"
    claim = file.Claim("mean square", {name: Fraction(k)})
    family = file.family_of(file.spec_of(spec.encode()), claim)
    point = balls.Cell({})
    size = len(family.states)
    states = list(family.moves)
    whole = np.zeros((len(states) * size**2, len(states) * size**2))
    for state, moves in family.moves.items():
        for kind, after, chance in moves.values():
            A = np.array([[x / balls.ONE for x in row] for row in family.matrix(kind, point).parts[()]])
            row, column = (states.index(each) * size**2 for each in (state, after))
            share = chance.value(point)[1] / balls.ONE
            whole[row : row + size**2, column : column + size**2] += share * np.kron(A.T, A.T)
    right = np.tile(np.eye(size).ravel(), len(states))
    forms = np.linalg.solve(np.eye(len(whole)) - whole, right).reshape(len(states), size, size)
    forms /= abs(forms).max()
    nodes = [{"L": [[f"{x:.15g}" for x in row] for row in np.linalg.cholesky((P + P.T) / 2).T]} for P in forms]
    return [{"claim": "mean square", "numbers": {name: k}, "states": family.states}, {"nodes": nodes}]


@pytest.mark.parametrize("case", CASES)
def test_the_mean_square_decays_up_to_where_second_moments_grow(case, tmp_path):
    spec, radius = CASES[case]
    limit = limit_of(radius)
    lines = proof_of(spec, f"{0.999 * limit:.12g}")
    code, words = checked(tmp_path, spec, lines)
    assert code == 0, words
    assert "the mean of all squares decays" in words
    further = [lines[0] | {"numbers": dict.fromkeys(lines[0]["numbers"], f"{1.001 * limit:.12g}")}, lines[1]]
    assert checked(tmp_path, spec, further)[0] == 1


def test_a_probability_may_be_swept(tmp_path):
    spec, _ = CASES["losses"]
    lines = proof_of(spec, "10")
    claim = lines[0] | {"sides": {"p": ["0.19", "0.2"]}}
    assert checked(tmp_path, spec, [claim, lines[1]])[0] == 0
    below = CASES["bursts"][0].replace('"p"', '"(p - 0.15)**2 - 0.0001"')
    for given, low, code, why in ((spec, "-0.01", 2, "loss = -0.01 is not at least 0"), (below, "0.1", 1, "no probability")):
        head, forms = proof_of(given, "1")
        found, words = checked(tmp_path, given, [head | {"sides": {"p": [low, "0.2"]}}, forms])
        assert (found, why in words) == (code, True), words


def test_other_chances_are_another_chain(tmp_path):
    for case, other in (("losses", "bursts"), ("shares", "next"), ("bursts", "losses")):
        limit = limit_of(CASES[case][1])
        lines = proof_of(CASES[case][0], f"{0.99 * limit:.12g}")
        assert checked(tmp_path, CASES[other][0], lines)[0] == 1


def test_chances_of_delays_may_be_those_of_each_length():
    """And all else is independent: a chance is the product of the shares of its length, of its delay and of the result."""
    spec = (
        RESULTS.replace("delay = 0, ", "")
        + """
for_all."rates.ratio" = { values = [8, 10], varying = true, shares = [1, 3] }
for_all."environment.delay" = { values = [0, 2, 3], varying = true, shares = [[1, 1, 2], [4, 1, 0]] }
"""
    )
    moves = file.family_of(file.spec_of(spec.encode()), file.Claim("mean square")).moves[None]
    of_delays = {8: (25, 25, 50), 10: (80, 20, 0)}
    expected = {
        f"rates.ratio={ratio};environment.delay={delay}{lost}": Fraction(of_ratio * of_delay * of_result, 10**6)
        for ratio, of_ratio in ((8, 25), (10, 75))
        for delay, of_delay in zip((0, 2, 3), of_delays[ratio], strict=True)
        for lost, of_result in (("", 80), (";lost", 20))
        if of_delay
    }
    assert {letter: chance.exact[()] for letter, (_, _, chance) in moves.items()} == expected


NOT_AT_RANDOM = {
    "a spec without chances": (
        LOSSY.format(chances="lost = 1").replace(", p = 0.2", ""),
        "messages of net are late, or lost in a row",
    ),
    "results in a row": (RESULTS.replace("loss = 0.2", "lost = 1"), "lost counts results in a row"),
    "a message that is late": (
        LOSSY.format(chances="late = 1").replace(", p = 0.2", ""),
        "messages of net are late, or lost in a row",
    ),
    "nothing at all": (RESULTS.replace("for_all.loss = 0.2", ""), "the spec has no chances"),
    "a chain with edges": (RESULTS, "a chain has nodes alone"),
}


@pytest.mark.parametrize("case", NOT_AT_RANDOM)
def test_what_has_no_mean_square_is_refused(case, tmp_path):
    spec, why = NOT_AT_RANDOM[case]
    head, forms = proof_of(RESULTS, "20")
    head |= {"numbers": {"k": "1"}} if "net" in spec else {}
    code, words = checked(tmp_path, spec, [head, forms | {"edges": []}])
    assert (code, why in words) == (2, True), words
    code, words = checked(tmp_path, RESULTS, [head | {"numbers": {"K_VE": "20"}}, {"nodes": forms["nodes"] * 2}])
    assert (code, "2 forms of 1 states" in words) == (1, True), words
    code, words = checked(tmp_path, RESULTS, [head | {"numbers": {"K_VE": "20"}}, forms["nodes"][0] | {"signs": "+++"}])
    assert (code, "no graph" in words) == (1, True), words
