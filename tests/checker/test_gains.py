"""Gains below a level: what is proved holds by closed forms and marches, and what says more is refused."""

import tomllib
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import expm
from support.proofs import checked

pytest.importorskip("wavesweep.proofs", reason="its forms are those that are proved")
from wavesweep.checker import balls, file
from wavesweep.checker.gain import Gain
from wavesweep.proofs.gains import claims_of_energy

# x+ = a x + (1 - a) u in every second tick, whose output is held: y = (x, x)
SMOOTHED = """
rates.tick_hz = 100
numbers = { a = 0.5, k = 1.0 }
[block]
lag = { type = "lowpass", a = "1 - a", every = 2 }
[wire]
"lag.u" = "k*ref"
[ports]
inputs = { ref = "ref" }
outputs = { y = "lag.y" }
"""
# an integrator in a loop of one tick: L = K/(z - 1), 1/(1 + L) = (z - 1)/(z - 1 + K), largest at z = -1: 2/(2 - K)
LOOP = """
rates.tick_hz = 100
numbers = { K = 0.5 }
[block]
sum = { type = "integrator" }
gain = { type = "gain", k = "100*K" }
[wire]
"sum.u" = "ref - gain.y"
"gain.u" = "sum.y"
[ports]
inputs = { ref = "ref" }
outputs = { y = "sum.y" }
[sweep]
along = "K"
K = { start = 0.1, stop = 1.5 }
"""
SLOW = LOOP.replace("tick_hz = 100", "tick_hz = 200").replace("type =", "every = 2, type =")  # the same in every second tick
ROOT = 2**0.5  # an input of every second tick, shown in both


def claim(spec: str, gain: Gain, name="", span=(0.0, 0.0)) -> list[dict]:
    found = claims_of_energy(tomllib.loads(spec, parse_float=Fraction), {}, name, span, gain)
    return [line for lines in found for line in lines]


def of(source: str, signal: str, level: float) -> Gain:
    return Gain(source, signal, "", Fraction(0), Fraction(level))


def at(cut: str, less: str, level: float) -> Gain:
    return Gain("", "", cut, Fraction(less), Fraction(level))


@pytest.mark.parametrize(
    ("spec", "gain", "norm"),
    [
        (SMOOTHED, of("ref", "y", 1), ROOT),
        (LOOP, of("ref", "y", 1), 1 / 50),
        (LOOP, at("gain.y", "0", 1), 2 / 1.5),
        (LOOP, at("gain.y", "1/2", 1), 2 / 1.5 - 0.5),
        (SLOW, at("gain.y", "0", 1), 2 / 1.5),
    ],
)
def test_a_gain_is_proved_next_to_its_closed_form_and_nothing_below(tmp_path, spec, gain, norm):
    above = claim(spec, gain._replace(at_most=Fraction(norm * (1 + 1e-6))))
    code, words = checked(tmp_path, spec, above)
    assert (code, words.splitlines()[-1].startswith("own numbers for ")) == (0, True), words
    below = [above[0] | {"gain": above[0]["gain"] | {"at_most": repr(norm * (1 - 1e-9))}}, *above[1:]]
    assert "the gain may be" in checked(tmp_path, spec, below)[1]
    with pytest.raises(file.Refused, match="not below its level"):
        claim(spec, gain._replace(at_most=Fraction(norm * (1 - 1e-9))))


def test_a_level_that_is_the_gain_at_rest_is_told():
    with pytest.raises(file.Refused, match=r"at rest it is 0\.02, and forms show a millionth more"):
        claim(LOOP, of("ref", "y", Fraction(1, 50)))


def test_a_gain_is_proved_along_a_number_up_to_its_end(tmp_path):
    # Ms = 2/(2 - K) is 1.6 at K = 0.75
    lines = claim(LOOP, at("gain.y", "0", 1.6), "K", (0.1, 0.75))
    assert checked(tmp_path, LOOP, lines)[0] == 0
    low, high = map(float, lines[0]["sides"]["K"])
    assert low == 0.1
    assert 0.75 - 1e-6 < high < 0.75
    wider = [lines[0] | {"sides": {"K": ["0.1", "0.7500001"]}}, *lines[1:]]
    assert "the gain may be" in checked(tmp_path, LOOP, wider)[1]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"from": "other"}, "nothing reads the input other"),
        ({"to": "nowhere"}, "'nowhere' is not known"),
        ({"at_most": "0"}, "is above 0"),
        ({"less": "0.5"}, "a gain has from, to and at_most"),
        ({"at_most": "1.0"}, "the gain may be 1.0"),
    ],
)
def test_another_gain_is_refused(tmp_path, change, why):
    head, *cells = claim(SMOOTHED, of("ref", "y", ROOT * 1.1))
    assert why in checked(tmp_path, SMOOTHED, [head | {"gain": head["gain"] | change}, *cells])[1]


def test_a_form_that_is_no_energy_is_refused(tmp_path):
    head, cell = claim(LOOP, at("gain.y", "0", 1.6))
    assert "the gain may be" in checked(tmp_path, LOOP, [head, {"L": [["0", "0"], ["0", "0"]]}])[1]
    unstable = LOOP.replace("K = 0.5", "K = 2.5")  # a mode at -1.5, Ms = 2/0.5 in size
    assert "the gain may be" in checked(tmp_path, unstable, [head | {"gain": head["gain"] | {"at_most": "9"}}, cell])[1]


def test_a_cell_has_a_form_alone(tmp_path):
    head, cell = claim(LOOP, at("gain.y", "0", 1.6))
    for change in ({"signs": "+"}, {"open": True}):
        assert "a form of a gain or of a port has L and Q alone" in checked(tmp_path, LOOP, [head, cell | change])[1]


CONTROLLED = """
rates.ratio = 4
environment = {{ K_VE = 200, B_VE = 2, delay = 1 }}
controller.kind = "dc-slow"
device = {{ mass = 0.1, damping = 1.5, dead_time = {} }}
operator.stiffness = 20
"""


@pytest.mark.parametrize("late", [0, 0.0004])
def test_a_frame_of_a_controller_has_its_inputs_and_outputs(late):
    """From the hand's force, held over a tick, to the motors' as a tick begins: m x'' = -1.5 x' - 20 x - f + f_h."""
    tables = file.spec_of(CONTROLLED.format(late).encode())
    family = file.family_of(tables, file.Claim("gain", gain=of("f_h", "f_m", 1)))
    with pytest.raises(file.Unreadable, match="the input of a controller is f_h"):
        file.family_of(tables, file.Claim("gain", gain=of("f_m", "f_m", 1)))
    before, after = (expm(time * np.array([[0, 1, 0], [-200, -15, 10], [0, 0, 0]])) for time in (late, 0.001 - late))
    names = ["@x", "@v", *(["@f"] if late else []), "@held F"]
    columns = names + [f"@input {tick}" for tick in range(4)]
    marched = []
    for column in columns:
        x, v, f, held = (float(column == name) for name in ("@x", "@v", "@f", "@held F"))
        shown = []
        for tick in range(4):
            hand = float(column == f"@input {tick}")
            made = 200 * x + 2 * v if tick == 0 else made  # noqa: F821
            held = made if tick == 1 else held
            shown.append(f if late else held)
            x, v, _ = before @ [x, v, hand - f]
            f = held
            x, v, _ = after @ [x, v, hand - f]
        marched.append([x, v, *([f] if late else []), held, *shown])
    rows = family.rows("", balls.POINT)
    rows_of = names + [f"@output {tick}" for tick in range(4)]
    found = [[rows[row].get(column, (0, 0))[1] / balls.ONE for row in rows_of] for column in columns]
    assert np.array(found) == pytest.approx(np.array(marched), rel=1e-12, abs=1e-15)


def test_an_output_that_shows_a_drift_has_no_gain():
    spec = LOOP.replace('"ref - gain.y"', '"ref"')
    with pytest.raises(file.Refused, match="takes part in the drift"):
        claim(spec, of("ref", "y", 9))
