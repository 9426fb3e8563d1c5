"""Plants drawn as several blocks: one plant, as a single state-space model is."""

import numpy as np
import pytest
from support.plants import bodies, joint

import wavesweep
from wavesweep.check.planning import plan, within_ticks
from wavesweep.program.spec import load


def limits(tables, along="kp", span=(0, 20000), **axes):
    found = wavesweep.compile(tables).stable_intervals(along, span, **axes)
    assert found.certified.all()
    return found[["low", "high"]].to_numpy().tolist()


def test_a_stiffer_spring_tends_to_the_rigid_joint():
    """With half of the critical damping; the distance falls as 1/ks. Rounding leaves no proof beyond 1e7 N/m, but digits."""
    body = {"type": "mass", "mass": 0.6, "damping": 0.1}
    ports = {"hand": {"force": "push", "displacement": "m.x"}}
    rigid = {"rates": {"tick_hz": 1000}, "numbers": {"kp": 200.0, "kd": 2.0}, "block": {"m": body}, "ports": ports}
    ((_, limit),) = limits(rigid | {"wire": {"m.f": "-kp*m.x - kd*m.v + push"}})
    between = "ks*({0}.x - {1}.x) + sqrt(ks/12)*({0}.v - {1}.v)"
    damped = joint(between=(between.format("link", "motor"), between.format("motor", "link")))
    found = wavesweep.compile(damped).stable_intervals("kp", (0, 20000), ks=[1e5, 1e6, 1e8, 1e10, 1e12])
    assert found.certified[:2].all()
    away = found.high / limit - 1
    assert ((away > 0) & (away < [0.07, 0.007, 7e-5, 7e-7, 7e-9])).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 250, 499])
def test_random_plants_are_one_state_space_model(seed):
    many, single, *_ = bodies(seed)
    found, expected = map(wavesweep.compile, (many, single))
    ends = [each.stable_intervals("kp", (0.1, 2e4)) for each in (found, expected)]
    assert all(each.certified.all() for each in ends)
    np.testing.assert_allclose(*(each[["low", "high"]] for each in ends), rtol=1e-10)
    np.testing.assert_allclose(*(each.spectral_radius(kp=[1.0, 100.0, 3000.0]) for each in (found, expected)), rtol=1e-10)


def test_what_drifts_is_the_plant_as_a_whole():
    free = joint(**{"motor.f": "ks*(link.x - motor.x)"}) | {"numbers": {"ks": 1e4}}
    lines = "\n".join(plan(load(free)))
    assert "drift set aside: motor position, and with it link position, which nothing in the loop holds" in lines
    assert wavesweep.verdict(free)["spectral_radius"] < 1
    low = wavesweep.compile(joint()).response([0.0])
    assert low.admittance_re[0] == pytest.approx(1 / 200 + 1 / 1e4, rel=1e-9)


@pytest.mark.parametrize(
    ("damping", "every", "rings"), [(0, 5, ["v, torque"]), (1, 5, ["v, torque"]), (1, 0, ["v"]), (0, 0, [])]
)
def test_check_names_the_blocks_that_are_solved_within_a_tick(damping, every, rings):
    """An implicit velocity under a torque that reads it in the same tick; every = 0: by a delay, which is no ring."""
    hold = {"type": "hold", "every": every} if every else {"type": "delay"}
    blocks = {name: {"type": "integrator", "method": method} for name, method in (("v", "implicit"), ("x", "explicit"))}
    wires = {"torque.u": "-kp*x.y - kd*v.y", "v.u": "(torque.y - d*v.y)/0.027", "x.u": "v.y"}
    numbers = {"kp": 17.0, "kd": 0.5, "d": damping}
    spec = load({"rates": {"tick_hz": 500}, "numbers": numbers, "block": blocks | {"torque": hold}, "wire": wires})
    start = "solved within a tick: "
    found = [line.removeprefix(start) for line in within_ticks(spec) if line.startswith(start)]
    assert [line.partition(":")[0] for line in found] == rings
