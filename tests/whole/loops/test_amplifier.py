"""Built-in loops whose motors are late, against the interpreter of the documents."""

import numpy as np
import pytest
from meaning.judge import compiled, judge
from meaning.specs import toml
from support.specs import KINDS, nested, values_of

import wavesweep
from wavesweep.program.analyses.assumptions import model_in_words
from wavesweep.program.analyses.hardware_limits import limits_of_walls
from wavesweep.program.spec import load
from wavesweep.simulation.from_spec import simulated


def values(kind, late, seconds=0.0, **more):
    more = {"ratio": 6, "delay": 2, "Kp": 4.0, "B_VE": 0.8, "K_LM": 60.0, "mass": 0.07, "lp1_cutoff_hz": 40.0, **more}
    return values_of(kind, **more) | {"device.delay": late, "device.dead_time": seconds}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "late", "seconds"),
    [(kind, *(((1, 0.0), (7, 0.0), (0, 0.0003), (2, 0.0017))[number % 4])) for number, kind in enumerate(KINDS)],
)
def test_every_controller_with_the_force_late_is_that_of_the_documents(kind, late, seconds, tmp_path):
    """`f_m` is the force of the motors, which the hand feels."""
    text = toml(nested(values(kind, late, seconds)) | {"sweep": {"along": "K_VE", "K_VE": {"start": 0, "stop": 3000}}})
    loop = compiled(text, tmp_path)
    assert [one for one in judge(text, loop, required=False) if not one.same] == []
    parts = [f"{late} tick{'s' * (late > 1)}"] * bool(late) + [f"{1e3 * seconds:g} ms"] * bool(seconds)
    assert f"amplifier late by {' and '.join(parts)}" in model_in_words(loop.spec)


@pytest.mark.parametrize(("late", "seconds"), [(0, 0.0), (2, 0.0), (1, 0.0003), (0, 0.0016)])
def test_the_passive_wall_is_that_of_its_sampling_and_its_delay(late, seconds):
    """`d/(T/2 + delay)`, on both sides of it."""
    own = values("dc", late, seconds, B_VE=0.0, damping=1.2)
    own["environment.K_VE"] = 1.2 / (0.5e-3 + late * 1e-3 + seconds)
    given = load(nested(own) | {"simulate": {"resolution": 1e-5, "friction": 0.1}})
    assert limits_of_walls(given)["passive_to"] == pytest.approx(own["environment.K_VE"], rel=1e-14)
    for share, passive in ((1 - 1e-6, True), (1 + 1e-6, False)):
        table = wavesweep.compile(nested(own)).passivity(K_VE=share * own["environment.K_VE"])
        assert bool(table.port_passive[0]) is passive


def test_a_dead_time_is_part_of_a_device_with_friction_encoder_and_limited_motors():
    """Against a march that cuts each tick where the force changes, and where the device comes to rest or sets off."""
    K, T, late, step, most, friction = 180.0, 1e-3, 1.3e-3, 2e-5, 0.5, 0.15
    simulate = {"friction": friction, "resolution": step, "max_force": most}
    device = {"dead_time": late, "velocity": "difference", "mass": 0.1, "damping": 1.5}
    given = load(
        {"controller": {"kind": "dc"}, "environment": {"K_VE": K, "B_VE": 0.0}, "device": device, "simulate": simulate}
    )
    force = 1.5 * np.sin(np.arange(150) / 10)
    x, v, places, asked = 0.0, 0.0, [], [0.0, 0.0]
    for f in force:
        places.append(x)
        asked.append(K * step * np.floor(x / step + 0.5))
        for exerted, part in ((asked[-3], late % T), (asked[-2], T - late % T)):
            net, left = f - np.clip(exerted, -most, most), part
            while left > 0 and (v or abs(net) > friction):
                end = (net - friction * np.sign(v or net)) / 1.5  # the velocity that it tends to
                stop = 0.1 / 1.5 * np.log(1 - v / end) if v * end < 0 else np.inf
                t = min(stop, left)
                x, v = x + end * t + (v - end) * -np.expm1(-15 * t) / 15, end + (v - end) * np.exp(-15 * t)
                v, left = (0.0 if t == stop else v), left - t
    found = simulated(given, force).signals["x"]
    assert np.any(np.diff(places) == 0), "it rests now and then"
    np.testing.assert_allclose(found, places, rtol=0, atol=1e-12)
