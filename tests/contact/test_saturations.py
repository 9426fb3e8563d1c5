"""A block that saturates, in place of a wall: its verdict, held against runs beyond its limits."""

import numpy as np
import pytest

from wavesweep.contact.on_check import facts, refuse
from wavesweep.contact.verdict import OPEN, WITHIN, of_saturation
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.claims import curve_of
from wavesweep.program.spec import load

pytestmark = pytest.mark.asks("for_all")
ARM = {
    "rates": {"tick_hz": 1000},
    "numbers": {"kp": 200.0, "kd": 3.0},
    "block": {
        "arm": {"type": "mass", "mass": 0.2, "damping": 0.5},
        "amp": {"type": "saturation", "high": 3.0, "every": 5},
        "hold": {"type": "hold", "every": 5},
    },
    "wire": {"amp.u": "kp*(ref - arm.x) - kd*arm.v", "hold.u": "amp.y", "arm.f": "hold.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"angle": "arm.x"}},
    "sweep": {"kp": {"start": 0, "stop": 500}},
    "for_all": {"contact": True},
}
SPEED = {
    **ARM,
    "numbers": {"kp": 4.0, "ki": 30.0},
    "block": {
        "arm": ARM["block"]["arm"],
        "pi": {"type": "pi", "kp": "kp", "ki": "ki"},
        "amp": {"type": "saturation", "high": 3.0},
    },
    "wire": {"pi.u": "ref - arm.v", "amp.u": "pi.y", "arm.f": "amp.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"speed": "arm.v"}},
}
BALANCED = {
    **ARM,
    "block": {
        "arm": {"type": "mass", "mass": 0.2, "damping": 0.5, "stiffness": -20.0},
        "amp": {"type": "saturation", "high": 3.0},
    },
    "wire": {"amp.u": "kp*(ref - arm.x) - kd*arm.v", "arm.f": "amp.y"},
}


@pytest.mark.slow
@pytest.mark.asks("simulation")
@pytest.mark.parametrize(("tables", "output", "size"), [(ARM, "angle", 1.0), (SPEED, "speed", 5.0)])
def test_a_loop_that_is_proved_comes_to_rest_from_beyond_its_limits(tables, output, size):
    """A step that keeps the amplifier at its limit for a while, by the simulation."""
    from wavesweep.simulation import table as simulation

    spec = load(tables)
    assert of_saturation(spec, "amp")["verdict"] == "proved"
    step = {"input": "step", "amplitude": size, "duration_s": 20.0, "show": ["amp.y"]}
    (run, *_) = simulation.simulate(load({**tables, "simulate": step}))
    columns = run.columns
    assert (np.abs(columns["amp.y"]) == 3.0).sum() > 100
    assert columns[output][-1] == pytest.approx(size, rel=1e-3)
    assert np.ptp(columns[output][-1000:]) < 1e-4


@pytest.mark.parametrize(
    ("tables", "changes", "counterexample"),
    [(ARM, {"kp": 2000.0}, WITHIN), (BALANCED, {}, OPEN)],
    ids=["unstable within its limits", "a plant that needs its controller"],
)
def test_what_refutes_a_saturation(tables, changes, counterexample):
    spec = load({**tables, "numbers": {**tables["numbers"], **changes}})
    found = facts(spec)
    assert found["saturations"] == {"amp": {"verdict": "refuted", "counterexample": counterexample}}
    assert [(claim.status.name, claim.scope.walls) for claim in found["claims"]] == [("REFUTED", curve_of("amp"))]


@pytest.mark.parametrize(("kp", "verdict"), [(500.0, "proved"), (600.0, "refuted")])
def test_a_motion_that_goes_on_at_the_limits_is_found(kp, verdict):
    """A slow controller, stable within limits up to 684 N/m, and as a wall proved up to 508 N/m."""
    block = {
        "arm": {"type": "mass", "mass": 0.1, "damping": 1.5},
        "amp": {"type": "saturation", "high": 3.0, "every": 20},
        "hold": {"type": "hold", "every": 20},
    }
    found = of_saturation(load({**ARM, "block": block, "numbers": {"kp": kp, "kd": 5.0}}), "amp")
    assert found["verdict"] == verdict
    assert found["counterexample"].startswith("a wall through (") == (verdict == "refuted")


def test_a_loop_with_neither_wall_nor_saturation_is_refused():
    without = {**ARM, "block": {**ARM["block"], "amp": {"type": "gain", "every": 5}}}
    with pytest.raises(UsageError, match="found neither"):
        refuse(load(without))
