"""Loops with words of firmware and functions of numbers: proofs in ball arithmetic give the intervals that doubles certify."""

import pytest

import wavesweep

PLANT = {"type": "mass", "mass": 0.2, "damping": 5.0, "stiffness": 90.0}
LOOPS = [
    ({"type": "pid", "kp": "g", "ki": "40*g", "kd": 0.5, "tau": 0.002}, (1.0, 2000.0)),
    ({"type": "pid", "kp": 100, "ki": "g", "kd": 0.5, "method": "trapezoidal", "every": 2}, (1.0, 9000.0)),
    ({"type": "pid", "kp": 300, "kd": 2.0, "tau": "g"}, (0.0, 0.05)),
    ({"type": "lead", "zero_hz": 5, "pole_hz": "g"}, (10.0, 400.0)),
    ({"type": "notch", "frequency_hz": "g", "q": 2}, (10.0, 400.0)),
    ({"type": "lowpass", "cutoff_hz": "g"}, (1.0, 400.0)),
    ({"type": "biquad", "b0": "g", "b1": 0.5, "a1": -0.2, "every": 2}, (-9.0, 9.0)),
    ({"type": "fir", "coefficients": [0.5, "g", 0.2, "-g/3"], "every": 2}, (-90.0, 90.0)),
    ({"type": "mean", "n": 3}, (0.1, 300.0)),
    ({"type": "gain", "k": "exp(g)*cos(g) - sin(g) + tan(g/9) + log(g)"}, (0.5, 8.0)),
]


@pytest.mark.slow
@pytest.mark.sample(2)
@pytest.mark.parametrize(("word", "span"), LOOPS, ids=[word["type"] for word, _ in LOOPS])
def test_words_have_the_proved_intervals_that_doubles_certify(prove, word, span):
    K = "g" if word["type"] == "mean" else "K"
    numbers = {"g": 2.0, K: 30.0}
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": numbers,
        "block": {"m": PLANT, "c": word},
        "wire": {"c.u": "-m.x", "m.f": f"{K}*c.y"},
    }
    proof = prove(tables, "g", span)
    found = wavesweep.compile(tables | {"sweep": {"along": "g", "g": {"start": span[0], "stop": span[1]}}}).stable_intervals()
    assert found.certified.all()
    expected = found[["low", "high"]].to_numpy()[found.intervals > 0]
    assert [pytest.approx(list(ends), rel=1e-9) for ends in expected] == [list(each[:2]) for each in proof.intervals]
