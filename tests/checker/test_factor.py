"""A factor of the signal at a cut: as another number of the loop has it, and as closed forms do."""

from fractions import Fraction

import numpy as np
import pytest
from support.proofs import checked

from wavesweep.checker import balls, file
from wavesweep.checker.factor import FACTOR, PHASE

# x+ = x - K exp(j phi) x: |1 - K exp(j phi)| < 1 below K = 2 cos(phi)
LOOP = """
rates.tick_hz = 100
numbers.K = 0.5
block.sum = { type = "ss", discrete = true, A = [[1]], B = [[1]], C = [[1]] }
block.gain = { type = "gain", k = "K" }
wire."sum.u" = "-gain.y"
wire."gain.u" = "sum.y"
"""
SLOW = LOOP.replace("type =", "every = 2, type =")  # the same in every second tick
HELD = LOOP.replace('"gain", k', '"gain", every = 2, k')  # x+ = (1 - 2 K) x in two ticks, the signal held in the second one
CONTROLLER = """
controller.kind = "{}"
device = {{ mass = {}, damping = {}, delay = {} }}
operator = {{ mass = {}, damping = {}, stiffness = {} }}
environment = {{ delay = 1, K_VE = {}, B_VE = {} }}
rates.ratio = 5
"""


def claim(cut: str, side: str, *ends: str, outside=0) -> dict:
    states = ["@sum x0", "@sum x0 imaginary"][: 1 + (side == PHASE)]
    return {"claim": "modes", "cut": cut, "sides": {side: list(ends)}, "outside": outside, "states": states}


ONE, TWO = {"L": [["1"]], "signs": "+"}, {"L": [["1", "0"], ["0", "1"]], "signs": "++"}


@pytest.mark.parametrize("spec", [LOOP, SLOW])
def test_a_factor_is_proved_up_to_its_margin(spec, tmp_path):
    for ends, outside, code in (
        (("0.01", "3.99"), 0, 0),
        (("0.01", "4.01"), 0, 1),
        (("4.01", "9"), 1, 0),
        (("3.9", "9"), 1, 1),
    ):
        lines = [claim("gain.y", FACTOR, *ends, outside=outside), ONE | {"signs": "+-"[outside]}]
        found, words = checked(tmp_path, spec, lines, {"question": [{"claim": "modes"}]})
        assert found == code or (found, code) == (3, 0), words
        assert f"{FACTOR} from {ends[0]} to {ends[1]}, at gain.y: " in words


@pytest.mark.parametrize("spec", [LOOP, SLOW])
def test_a_phase_is_proved_up_to_its_margin(spec, tmp_path):
    """Of 2 cos(phi) = 0.5 the angle is 75.522488 degrees."""
    for low, high, outside, code in ((75.2, 75.522, 0, 0), (75.2, 75.523, 0, 1), (75.523, 76, 2, 0), (75.522, 76, 2, 1)):
        lines = [claim("gain.y", PHASE, repr(low), repr(high), outside=outside), TWO | {"signs": "+-"[outside // 2] * 2}]
        question = [{key: lines[0][key] for key in ("claim", "sides", "cut")}]
        found, words = checked(tmp_path, spec, lines, {"question": question, "of": "design"})
        assert found == code, words
        if not code:
            assert f"{PHASE} from {low} to {high} at gain.y: proved {'un' * bool(outside)}stable all over" in words


def modes(spec: str, cut: str, value: float, side=FACTOR) -> np.ndarray:
    asked = file.Claim("modes", sides={side: (Fraction(value),) * 2} if cut else {}, cut=cut)
    (A,) = file.family_of(file.spec_of(spec.encode()), asked).matrix("", balls.Cell(asked.sides)).parts.values()
    values = np.linalg.eigvals([[x / balls.ONE for x in row] for row in A])
    return np.sort_complex(np.round(values[abs(values) > 1e-9], 9))


@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm"])
@pytest.mark.parametrize("delay", [0, 2])
def test_a_factor_of_a_force_is_one_of_what_makes_it_or_of_what_it_moves(kind, delay):
    spec = CONTROLLER.format(kind, 0.1, 1.5, delay, 0.02, 0.5, 30, 300, 2)
    cut, other = "encoder.force", CONTROLLER.format(kind, 0.125, 1.875, delay, 0.025, 0.625, 37.5, 300, 2)
    if kind.startswith("dc"):
        cut, other = "wall.y", CONTROLLER.format(kind, 0.1, 1.5, delay, 0.02, 0.5, 30, 240, 1.6)
    assert modes(spec, cut, 0.8) == pytest.approx(modes(other, "", 0), abs=1e-7)
    assert modes(spec, cut, 180, PHASE)[::2] == pytest.approx(modes(spec, cut, -1), abs=1e-6)


def test_a_signal_that_is_held_is_turned_when_it_is_made():
    assert modes(HELD, "gain.y", 0.5) == pytest.approx([0.5])
    turned = 1 - np.exp(1j * np.pi / 3)
    assert modes(HELD, "gain.y", 60, PHASE) == pytest.approx(np.sort_complex([turned.conj(), turned]))


def test_a_cut_at_which_nothing_is_made_is_refused(tmp_path):
    spec = CONTROLLER.format("dc", 0.1, 1.5, 0, 0.02, 0.5, 30, 300, 2)
    for text, cut, why in (
        (LOOP, "gain.x", "nothing gives"),
        (spec, "f_m", "nothing is made at the cut"),
        (LOOP, "", "is no number"),
    ):
        head = claim(cut, FACTOR, "0.1", "1")
        assert why in checked(tmp_path, text, [head, ONE], {"question": []})[1]
    head = claim("gain.y", FACTOR, "0.1", "1")
    two, none = ({"sides": {name: ["0.1", "1"] for name in names}} for names in ((FACTOR, PHASE), ("K",)))
    for change in (two, none, {"claim": "gain"}, {"radius": "2"}):
        asked = {key: value for key, value in (head | change).items() if key not in ("outside", "states")}
        assert "a cut is one of modes" in checked(tmp_path, LOOP, [head, ONE], {"question": [asked]})[1]
