"""A loop with a complex factor of a signal, and its real drawing of twice the size."""

import numpy as np
import pytest

from wavesweep import load
from wavesweep.engine._drawing.complex_gain import TWIN, with_complex_factor
from wavesweep.engine._drawing.drawing import path_of
from wavesweep.engine._drawing.expressions import Tree
from wavesweep.engine._drawing.gain_at_signal import GAIN, with_gain
from wavesweep.engine._loops.dead_time import structure
from wavesweep.engine._stability.spectrum import eigenvalues
from wavesweep.engine.loop import Loops

LOOP = {
    "rates": {"tick_hz": 100},
    "numbers": {"a": 8.0, "k": 3.0, "c": 2.0, "tau": 0.013},
    "block": {
        "plant": {"type": "tf", "num": ["a"], "den": [1, "a", 0]},
        "pd": {"type": "gain", "k": "k", "every": 2},
        "net": {"type": "delay", "steps": 1, "every": 2},
        "late": {"type": "delay", "seconds": "tau"},
        "lag": {"type": "lowpass", "cutoff_hz": "c"},
    },
    "wire": {"lag.u": "plant.y", "pd.u": "-plant.y - 0.1*lag.y", "net.u": "pd.y", "late.u": "net.y", "plant.u": "late.y"},
}


@pytest.mark.parametrize("cut", ["net.y", "plant.y", "lag.y"])
def test_its_eigenvalues_are_those_of_the_complex_loop_and_their_conjugates(cut):
    spec = load(LOOP)
    complex_drawing = with_gain(spec.drawing, cut, GAIN)
    real_drawing = with_complex_factor(complex_drawing, Tree.name("re"), Tree.name("im"))
    k = np.array([0.9 * np.exp(0.3j), 1.2 * np.exp(-0.5j), -2.0 + 0.1j])
    values = dict(spec.values)
    known = structure(complex_drawing, values)
    ticks = {path: int(known[path.replace(TWIN, "")]) for path in real_drawing.building}
    one = Loops(complex_drawing, values | {path_of(GAIN): k})
    factor = {path_of(GAIN): 1.0, path_of("re"): k.real.copy(), path_of("im"): k.imag.copy()}
    two = Loops(real_drawing, values | ticks | factor)
    z = 1 + eigenvalues(one.frames(one.drift()))[0]
    both = 1 + eigenvalues(two.frames(two.drift()))[0]
    for ours, theirs in zip(both, z, strict=True):
        expected = np.poly(np.concatenate([theirs, theirs.conj()])).real
        np.testing.assert_allclose(np.poly(ours).real, expected, atol=1e-12)


def test_dead_times_in_both_parts_have_the_whole_ticks_of_the_loop():
    loops = Loops(load(LOOP).drawing, dict(load(LOOP).values)).with_gain_at("net.y")
    turned = loops.with_complex_factor(Tree.number(1.0), Tree.number(0.0))
    assert turned.radii()[0] == pytest.approx(loops.radii()[0], rel=1e-10)
