"""Frames in any order: graphs of forms that the package finds, and what they do not prove of specs that allow more."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import block_diag, expm
from support.forms import form_of, matrix_of
from support.proofs import checked

from wavesweep.checker import balls, file
from wavesweep.checker.reader import for_all
from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._switched.norms import find_norms

SPEC = """
[rates]
ratio = 5
[environment]
integration = "explicit"
delay = 1
step = "elapsed"
[device]
velocity = "difference"
[controller]
kind = "dc-slow"
[for_all]
"rates.ratio" = { values = [4, 5, 7], varying = true }
"""
LETTERS = ["rates.ratio=4", "rates.ratio=5", "rates.ratio=7"]


def spectra(family, letters) -> np.ndarray:
    """Matrices of frames at a point, in doubles."""
    point = balls.Cell({})
    found = []
    for letter in letters:
        (part,) = family.matrix(letter, point).parts.values()
        found.append([[x / balls.ONE for x in row] for row in part])
    return np.array(found)


def graph_of(spec: str, number: str, value: str, letters) -> tuple[list[str], dict]:
    """States, and a cell with the forms that are found at a value."""
    claim = file.Claim("for all", {number: Fraction(value)})
    family = file.family_of(file.spec_of(spec.encode()), claim)
    A = spectra(family, letters)
    centre, factor = find_norms(1.01 * A, np.ones((len(letters), len(letters)), dtype=bool))
    assert factor == 1
    forms = centre.norms.P / abs(centre.norms.P).max()
    graph = centre.norms.graph
    nodes = [{"L": [[f"{x:.12g}" for x in row] for row in np.linalg.cholesky(P).T]} for P in forms]
    places = zip(graph.source.tolist(), graph.symbol.tolist(), graph.target.tolist(), strict=True)
    return family.states, {"nodes": nodes, "edges": [[source, letters[symbol], target] for source, symbol, target in places]}


def about(states, **more):
    return {"claim": "for all", "sides": {"K_VE": ["395", "405"]}, "states": states} | more


def test_a_graph_proves_every_order(tmp_path):
    states, graph = graph_of(SPEC, "K_VE", "400", LETTERS)
    code, words = checked(tmp_path, SPEC, [about(states), graph])
    assert code == 0, words
    assert words.startswith("proved: all that [for_all] and its channels allow, K_VE from 395 to 405: every motion decays")


def test_a_graph_has_a_node_and_no_more_than_are_told(tmp_path, monkeypatch):
    states, graph = graph_of(SPEC, "K_VE", "400", LETTERS)
    nodes = len(graph["nodes"])
    for most, wrong in ((nodes, False), (nodes - 1, True)):
        monkeypatch.setattr(file, "NODES", most)
        code, words = checked(tmp_path, SPEC, [about(states), graph])
        assert (code, f"{nodes} nodes; at most {most}" in words) == (2 * wrong, wrong), words
    code, words = checked(tmp_path, SPEC, [about(states), {"nodes": [], "edges": []}])
    assert (code, "0 nodes; at most" in words) == (2, True), words


def test_a_frame_that_may_come_must_have_an_edge(tmp_path):
    states, graph = graph_of(SPEC, "K_VE", "400", LETTERS)
    fewer = graph | {"edges": [edge for edge in graph["edges"] if edge[1] != LETTERS[2]]}
    code, words = checked(tmp_path, SPEC, [about(states), fewer])
    assert code == 1
    assert "the frame rates.ratio=7 may come at node 0, which has no edge of it" in words


LONGER = SPEC.replace("[4, 5, 7]", "[4, 5, 7, 9]")
CHANGED = {  # specs of which the same forms prove nothing
    "a longer frame": LONGER,
    "a result that is later": SPEC.replace("delay = 1", "delay = 4"),
    "results that are lost": SPEC.replace("[for_all]", "[for_all]\nlost = 1"),
    "other delays": SPEC.replace("[for_all]", '[for_all]\n"environment.delay" = { values = [1, 4], varying = true }'),
    "a range of masses": SPEC.replace("[for_all]", '[for_all]\n"device.mass" = { start = 0.05, stop = 0.2 }'),
    "two masses in a list": SPEC.replace("[for_all]", '[for_all]\n"device.mass" = [0.05, 0.2]'),
    "two masses": SPEC.replace("[for_all]", '[for_all]\n"device.mass" = { values = [0.05, 0.2] }'),
}


@pytest.mark.parametrize("change", CHANGED)
def test_a_set_that_is_larger_is_not_proved(change, tmp_path):
    states, graph = graph_of(SPEC, "K_VE", "400", LETTERS)
    code, words = checked(tmp_path, CHANGED[change], [about(states), graph])
    assert code == 1, words


def refuted(spec, K, word, tmp_path):
    """The checker's answer on a word, with the form that Stein's equation gives of its product."""
    claim = file.Claim("refuted", {"K_VE": Fraction(K)}, outside=1, word=word)
    family = file.family_of(file.spec_of(spec.encode()), claim)
    cell, outside = form_of(matrix_of(family))
    line = {"claim": "refuted", "numbers": {"K_VE": K}, "outside": outside, "word": word, "states": family.states}
    return checked(tmp_path, spec, [line, cell])


def test_a_step_that_is_not_said_is_the_time_that_elapses():
    spec = SPEC.replace("dc-slow", "pmw")

    def matrices(text):
        family = file.family_of(file.spec_of(text.encode()), file.Claim("for all"))
        return np.array(spectra(family, LETTERS))

    elapsed = matrices(spec)
    assert np.array_equal(matrices(spec.replace('step = "elapsed"', "")), elapsed)
    assert not np.array_equal(matrices(spec.replace("elapsed", "nominal")), elapsed)


def test_a_word_is_multiplied_out(tmp_path):
    """Published of a result after 1 ms: 146.9 N/m with frames of 33, 33, 20, 16 and 25 ticks in some order; for ever 152.1."""
    word = ["rates.ratio=33"]
    spec = SPEC.replace("[4, 5, 7]", "[16, 20, 25, 33]").replace("ratio = 5", "ratio = 20")
    code, words = refuted(spec, "153", word, tmp_path)
    assert code == 0, words
    assert "unstable, with frames rates.ratio=33 for ever" in words
    assert refuted(spec, "152", word, tmp_path)[0] == 1


def test_a_word_that_the_spec_does_not_allow_refutes_nothing(tmp_path):
    lossy = SPEC.replace("[for_all]", "[for_all]\nlost = 1")
    assert refuted(lossy, "6000", ["rates.ratio=7", "rates.ratio=7;lost"], tmp_path)[0] == 0
    with pytest.raises(file.Refused, match="does not allow"):
        refuted(lossy, "6000", ["rates.ratio=7;lost"], tmp_path)
    with pytest.raises(file.Refused, match="does not allow"):
        refuted(SPEC, "6000", ["rates.ratio=8"], tmp_path)


def test_a_member_is_one_of_the_spec(tmp_path):
    claim = {"claim": "refuted", "outside": 1, "states": ["@x"], "word": LETTERS[:1]}
    masses = SPEC.replace("[for_all]", '[for_all]\n"device.mass" = { start = 0.05, stop = 0.2 }')
    for numbers in ({}, {"device.mass": "0.3"}):
        code, words = checked(tmp_path, masses, [claim | {"numbers": numbers}])
        assert code == 1
        assert "device.mass" in words


def test_results_at_once_or_later_are_those_of_a_march_by_hand():
    """Of x'' = -15 x' - 10 f, f = K x of the last sample so many ticks later: eigenvalues of frames in any order."""
    delays = '[for_all]\n"environment.delay" = { values = [0, 1, 4], varying = true }'
    spec = SPEC.partition("[for_all]")[0].replace("step", "B_VE = 0\nstep") + delays
    flow = expm(1e-3 * np.array([[0, 1, 0], [0, -15, -10], [0, 0, 0]]))

    def frame(late):
        whole = np.eye(4)
        for tick in range(5):
            step = np.eye(4)
            if tick == 0:
                step[3] = [400, 0, 0, 0]
            if tick == late:
                step[2] = step[3]
            whole = block_diag(flow, 1) @ step @ whole
        return whole

    for word in ([0], [1], [4, 0], [0, 4, 1, 0]):
        letters = [f"environment.delay={late}" for late in word]
        claim = file.Claim("refuted", {"K_VE": Fraction(400)}, outside=1, word=letters)
        family = file.family_of(file.spec_of(spec.encode()), claim)
        (found,) = spectra(family, [""])
        sizes = np.sort(abs(np.linalg.eigvals(found)))
        march = np.linalg.multi_dot([np.eye(4), *(frame(late) for late in word[::-1]), np.eye(4)])
        expected = np.sort(abs(np.linalg.eigvals(march)))[-2:]
        assert sizes[-2:] == pytest.approx(expected, rel=1e-9)


DRAWN = """
rates.tick_hz = 10
numbers = { k = 1.0, n = 2 }
[block]
tank = { type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }
valve = { type = "hold", every = "n" }
[wire]
"tank.u" = "valve.y"
"valve.u" = "-k*tank.y"
[for_all]
n = { values = [1, 2, 3], varying = true }
"""


@pytest.mark.parametrize(("k", "code"), [("6.6", 0), ("6.68", 1)])
def test_an_integrator_that_is_sampled_at_will_decays_below_two_over_the_longest_step(k, code, tmp_path):
    letters = [f"n={n}" for n in (1, 2, 3)]
    states, graph = graph_of(DRAWN, "k", "6.6", letters)
    claim = {"claim": "for all", "numbers": {"k": k}, "states": states}
    found, words = checked(tmp_path, DRAWN, [claim, graph])
    assert found == code, words


def test_frames_of_a_word_act_in_their_order():
    claim = file.Claim("refuted", {"K_VE": Fraction(400)}, outside=1, word=LETTERS)
    family = file.family_of(file.spec_of(SPEC.encode()), claim)
    (whole,) = spectra(family, [""])
    first, second, third = spectra(family, LETTERS)
    assert whole == pytest.approx(third @ second @ first, rel=1e-9, abs=1e-12)
    assert whole != pytest.approx(first @ second @ third, rel=1e-3, abs=1e-6)


def test_each_combination_of_listed_values_is_counted(tmp_path, monkeypatch):
    spec = SPEC[: SPEC.index("[for_all]")] + '[for_all]\n"device.mass" = { values = [0.1, 0.2] }\nb = { values = [1, 2, 3] }\n'
    for most, counted in ((6, False), (5, True)):
        monkeypatch.setattr(for_all, "MOST", most)
        _, words = checked(tmp_path, spec.replace('"dc-slow"', '"pmw"'), [about(["@v"]), {"nodes": [], "edges": []}])
        assert ("6 combinations of values; at most 5" in words) == counted, words


ONE_CHANNEL = """
rates.tick_hz = 10
block.tank = {{ type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }}
block.net = {{ type = "channel", {} }}
wire."tank.u" = "net.y"
wire."net.u" = "-tank.y"
"""
BETWEEN = DRAWN.replace('every = "n" }', 'every = "n" }\nb = { type = "%s" }').replace("-k*tank.y", '-k*b.y"\n"b.u" = "tank.y')
LATER = DRAWN.replace("[1, 2, 3]", "[2, 3]").replace('"hold", every', '"integrator", phase = 1, every')
AT_ONCE = '"environment.delay" = {{ values = [{}], varying = true }}'
NO_PROOF = {  # specs and why they have no proof here
    "frames of a mean": (SPEC.replace("dc-slow", "pmw-mean"), "frames of pmw-mean that vary"),
    "frames of one rate": (SPEC.replace("dc-slow", "dc"), "frames of dc that vary"),
    "frames of no whole ticks": ("rates.slow_hz = 60\ncontroller.kind = 'pmw'\nfor_all.lost = 1", "do not last whole ticks"),
    "lost at random": (SPEC.partition('"rates.ratio"')[0] + "loss = 0.1", "which no proof for all of them holds for"),
    "kinds of frames": (SPEC.replace("values = [4, 5, 7]", "start = 5, stop = 60") + AT_ONCE.format("1,2,3,4,5"), "280 kinds"),
    "masses that vary": (SPEC + '"device.mass" = { start = 0.05, stop = 0.2, varying = true }', "device.mass varies"),
    "ticks beside frames": (SPEC + "tick = { late = 0.0002 }", "tick stands alone"),
    "a key that there is not": (SPEC + "few = 1", "few is no number"),
    "at once beside the next sample": (SPEC + AT_ONCE.format("0, 4"), "results at once, beside others of the next sample"),
    "at once beside steps that elapse": (SPEC.replace("dc-slow", "pmw") + AT_ONCE.format("0, 1"), "results at once, beside"),
    "a tick of a length": (DRAWN.replace("tick_hz = 10", 'tick_hz = "10*n"'), "the tick lasts as long as n says"),
    "a tick that follows from a length": (
        DRAWN.replace("= 10", '= "rate"').replace("n = 2 }", 'n = 2, rate = "20*n" }'), "the tick lasts as long as n"
    ),
    "two numbers that vary": (DRAWN + "k = { values = [1, 2], varying = true }", "one number varies"),
    "another rate": (BETWEEN % 'hold", every = "2', "blocks of other rates than n"),
    "two rates that vary": (BETWEEN % 'hold", every = "2*n', "blocks of other rates than n"),
    "a step after a phase": (LATER, "the block valve has no rule here"),
    "a step in a wire": (DRAWN.replace("-k*tank.y", "-dt*k*tank.y"), "the block valve has no rule here"),
    "a length in a wire": (DRAWN.replace("-k*tank.y", "-n*k*tank.y"), "the block valve has no rule here"),
    "a length in a plant": (DRAWN.replace("C = [[1]]", 'C = [["1/n"]]'), "the block tank has no rule here"),
    "a filter of another rate": (
        DRAWN.replace('"hold"', '"butterworth", order = 1, cutoff_hz = 0.1'), "the block valve has no rule here"
    ),
    "channels beside frames": (BETWEEN % 'channel", missing = "held", lost = "1', "beside messages that are late or lost"),
    "messages at random": (ONE_CHANNEL.format("loss = 0.1"), "which no proof for all of them holds for"),
    "bursts": (ONE_CHANNEL.format("burst = 0.1"), "which no proof for all of them holds for"),
    "late messages, or zero": (ONE_CHANNEL.format('late = 1, missing = "zero"'), "late, and zero where they are missing"),
}  # fmt: skip


@pytest.mark.parametrize("case", NO_PROOF)
def test_what_has_no_proof_is_told(case, tmp_path):
    spec, why = NO_PROOF[case]
    code, words = checked(tmp_path, spec, [{"claim": "for all", "states": []}, {"nodes": [], "edges": []}])
    assert (code, why in words) == (2, True), words


def sizes(spec: str, **claim) -> np.ndarray:
    family = file.family_of(file.spec_of(spec.encode()), file.Claim(**claim))
    found = abs(np.linalg.eigvals(spectra(family, [""])[0]))
    return np.sort(found[found > 1e-6])


@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm"])
@pytest.mark.parametrize("more", ["delay = 0", "delay = 1", 'delay = "frame"', 'delay = 1\nintegration = "trapezoidal"'])
def test_a_frame_that_is_repeated_is_the_loop_of_that_ratio(kind, more):
    spec = SPEC.replace("dc-slow", kind).replace('integration = "explicit"\ndelay = 1', more)
    for letter in LETTERS:
        alone = sizes(spec, claim="modes", numbers={"rates.ratio": Fraction(letter[-1])})
        assert sizes(spec, claim="refuted", word=[letter]) == pytest.approx(alone, rel=1e-6), letter


RUN = {
    "hold": "", "difference": "", "integrator": 'method = "trapezoidal"', "pi": "kp = 0.5, ki = 0.2", "gain": "k = 0.7",
    "pid": "kp = 0.5, ki = 0.2, kd = 0.02", "lowpass": "cutoff_hz = 0.8", "saturation": "high = 9", "delay": "steps = 2",
    "mean": "n = 3", "fir": "coefficients = [0.5, 0.2]", "biquad": "b1 = 0.3, a1 = -0.2",
    "tf": "num = [1, 0.5], den = [2, 0.1], discrete = true", "ss": "A = [[0.5]], B = [[1]], C = [[0.3]], discrete = true",
}  # fmt: skip


@pytest.mark.parametrize("kind", RUN)
def test_a_block_that_runs_once_in_a_frame_is_that_of_its_length(kind):
    spec = DRAWN.replace('"hold", every', f'"{kind}", {RUN[kind]}{", " * bool(RUN[kind])}every')
    for n in (1, 2, 3):
        alone = sizes(spec, claim="modes", numbers={"n": Fraction(n)})
        assert sizes(spec, claim="refuted", word=[f"n={n}"]) == pytest.approx(alone, rel=1e-6), n


def test_each_type_of_block_says_what_it_does_in_a_step_that_varies():
    """A new type stands in `STEPPED` or `STEADY`, or here if no frame of another length is read of it."""
    without = {"butterworth", "channel", "impulse", "inertia", "lead", "local_model", "mass", "mass_matrix", "notch", "spring"}
    assert {*TYPES} == for_all.STEPPED | for_all.STEADY | without
