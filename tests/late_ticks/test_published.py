"""Two loops of the literature on sampling at uncertain times, with the ends that are known."""

import pytest

from wavesweep.engine.switched import Verdict
from wavesweep.late_ticks.bracket import decided
from wavesweep.late_ticks.tick_curves import late_ticks
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

pytestmark = pytest.mark.asks("for_all")

# x'' = -0.1 x' + 0.1 u, u = -(3.75, 11.5) x: Branicky, Phillips, Zhang, ACC 2000. Published for times that vary: 0.87, 1.11,
# 1.33, 1.69, 1.729 s; each constant time is stable up to 1.72941 s.
BATCH = {
    "rates": {"tick_hz": 1.0},
    "block": {"plant": {"type": "mass", "mass": 10.0, "damping": 1.0}},
    "wire": {"plant.f": "-3.75*plant.x - 11.5*plant.v"},
}
# x'' = -2 x + 0.1 x' + u, u = x: stable with constant times from 0.2008 to 2.0212 s.
DELAYED = {
    "rates": {"tick_hz": 1.0},
    "block": {
        "plant": {
            "type": "ss",
            "A": [[0, 1], [-2, 0.1]],
            "B": [[0], [1]],
            "C": [[1, 0]],
            "D": [[0]],
            "inputs": ["u"],
            "outputs": ["x"],
        }
    },
    "wire": {"plant.u": "plant.x"},
}


def verdict(spec, start, stop):
    loop = own_loop(load(spec))
    return decided(lambda cells: late_ticks(loop, "", (start, stop), cells))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spec", "start", "stop", "expected"),
    [
        (BATCH, 1e-3, 1.729, Verdict.PROVED),
        (BATCH, 1e-3, 1.7295, Verdict.REFUTED),
        (DELAYED, 0.4, 1.8, Verdict.PROVED),
        (DELAYED, 0.2, 2.02, Verdict.REFUTED),  # each of them for ever is stable
    ],
)
def test_sampling_at_uncertain_times(spec, start, stop, expected):
    assert verdict(spec, start, stop)[0] == expected
