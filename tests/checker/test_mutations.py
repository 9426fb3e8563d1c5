"""A proof of both sides of an end is refused of every spec whose end is elsewhere: each key counts, as it is meant."""

import re
from functools import cache

import numpy as np
import pytest
from support.forms import at_value
from support.proofs import checked

NEAR = 1e-6  # of an end

DIRECT = """
[rates]
fast_hz = 1000
ratio = 20
[environment]
delay = 1
B_VE = 1.0
[device]
mass = 0.1
damping = 1.5
velocity = "difference"
delay = 0
dead_time = 0.0003
[operator]
mass = 0.02
damping = 0.5
stiffness = 50
[controller]
kind = "dc-slow"
[sweep]
K_VE = { start = 0, stop = 2000 }
"""
WAVES = """
[rates]
slow_hz = 50
[environment]
integration = "explicit"
delay = 1
[device]
velocity = "difference"
[controller]
kind = "pmw"
b = 10
Kp = 5
[filters.lp1]
order = 2
cutoff_hz = 12
[sweep]
K_VE = { start = 0, stop = 5000 }
"""
DRAWN = """
rates.tick_hz = 1000
[numbers]
k = 100.0
d = 4.0
[block]
arm = { type = "mass", mass = 0.2, damping = 0.8, stiffness = 15 }
far = { type = "inertia", inertia = 0.05, damping = 0.3 }
eye = { type = "hold", every = 4, phase = 1 }
late = { type = "delay", seconds = 0.0024 }
steps = { type = "delay", steps = 3 }
law = { type = "pid", kp = "k", ki = 20, kd = "d", tau = 0.004, method = "implicit", every = 2 }
soft = { type = "lowpass", cutoff_hz = 60 }
comb = { type = "notch", frequency_hz = 90, q = 1.5 }
sharp = { type = "butterworth", order = 2, cutoff_hz = 200 }
[signals]
off = "0.5*eye.y + 0.5*late.y"
[wire]
"eye.u" = "arm.x"
"late.u" = "arm.x"
"steps.u" = "sharp.y"
"law.u" = "-off"
"soft.u" = "law.y"
"comb.u" = "soft.y"
"sharp.u" = "comb.y"
"arm.f" = "steps.y + 40*(far.x - arm.x) - 0.2*prev(arm.v)"
"far.f" = "40*(arm.x - far.x)"
[sweep]
along = "k"
k = { start = 1, stop = 10000 }
"""
ENDS = {"direct": 275.73963408907656, "waves": 542.9821249963696, "drawn": 361.3524061610909}
SPECS = {"direct": (DIRECT, "K_VE"), "waves": (WAVES, "K_VE"), "drawn": (DRAWN, "k")}
MUTATIONS = {
    "direct": [
        ("fast_hz = 1000", "fast_hz = 1001"), ("ratio = 20", "ratio = 21"), ("delay = 1\n", "delay = 2\n"),
        ("delay = 1\n", 'delay = "frame"\n'), ("delay = 1\n", "delay = 0\n"), ("B_VE = 1.0", "B_VE = 1.00001"),
        ("mass = 0.1\n", "mass = 0.100001\n"), ("damping = 1.5", "damping = 1.50001"), ('"difference"', '"exact"'),
        ("delay = 0\n", "delay = 1\n"), ("0.0003", "0.000301"), ("dead_time = 0.0003\n", ""), ("mass = 0.02", "mass = 0.02001"),
        ("damping = 0.5", "damping = 0.50001"), ("stiffness = 50", "stiffness = 50.01"), ('"dc-slow"', '"dc"'),
        ('"dc-slow"', '"dc-lm"'), ("mass = 0.1\n", 'preset = "touch"\n'), ("ratio = 20", "slow_hz = 60"),
    ],
    "waves": [
        ("slow_hz = 50", "slow_hz = 40"),
        ('"explicit"', '"implicit"'), ('"explicit"', '"trapezoidal"'), ("b = 10", "b = 10.0001"),
        ("Kp = 5", "Kp = 5.0001"), ("order = 2", "order = 1"), ("cutoff_hz = 12", "cutoff_hz = 12.001"),
        ('"pmw"', '"pmw-mean"'),
        ('"pmw"', '"pmw-lm"'), ('velocity = "difference"', "mass = 0.1001"),
    ],
    "drawn": [
        ("tick_hz = 1000", "tick_hz = 1000.1"), ("mass = 0.2", "mass = 0.20001"), ("stiffness = 15", "stiffness = 15.001"),
        ("damping = 0.3", "damping = 0.30001"), ("every = 4", "every = 2"), ("phase = 1", "phase = 2"), ("0.0024", "0.0025"),
        ("seconds = 0.0024", "steps = 2"), ("seconds = 0.0024", "steps = 3"), ("steps = 3", "steps = 2"),
        ("steps = 3", "seconds = 0.0031"),
        ("ki = 20", "ki = 20.01"), ("tau = 0.004", "tau = 0.00401"), ('"implicit"', '"explicit"'), ("every = 2", "every = 1"),
        ("d = 4.0", "d = 4.0001"), ("cutoff_hz = 60", "cutoff_hz = 60.01"), ("cutoff_hz = 60", "a = 0.27"),
        ("q = 1.5", "q = 1.501"),
        ("frequency_hz = 90", "frequency_hz = 90.01"), ("q = 1.5", "q = 1.5, depth = 0.01"), ("order = 2", "order = 3"),
        ("order = 2", 'order = 2, pass = "high"'), ("prev(arm.v)", "arm.v"), ("0.5*eye.y", "0.5*arm.x"),
        ("40*(far.x - arm.x)", "40*far.x - 40.001*arm.x"), ('"arm.f" = "steps.y + ', '"arm.f" = "'),
        ("- 0.2*prev", "+ 0.2*prev"), ('type = "inertia", inertia', 'type = "mass", mass'),
    ],
}  # fmt: skip


@cache
def proof_of(name) -> list[dict]:
    """Claims just inside and just outside of its end."""
    spec, number = SPECS[name]
    return [line for share in (1 - NEAR, 1 + NEAR) for line in at_value(spec, number, repr(ENDS[name] * share))]


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECS)
def test_the_package_finds_these_ends(name, tmp_path):
    import wavesweep

    (tmp_path / "spec.toml").write_text(SPECS[name][0])
    rows = wavesweep.compile(tmp_path / "spec.toml").stable_intervals()
    np.testing.assert_allclose(rows["high"], ENDS[name], rtol=1e-10)


@pytest.mark.parametrize("name", SPECS)
def test_both_sides_of_an_end_are_proved(name, tmp_path):
    code, words = checked(tmp_path, SPECS[name][0], proof_of(name))
    assert code == 0, words
    assert [line["outside"] > 0 for line in proof_of(name) if "claim" in line] == [False, True]


@pytest.mark.parametrize(("name", "old", "new"), [(name, *change) for name, changes in MUTATIONS.items() for change in changes])
def test_a_key_that_is_another_is_refused(name, old, new, tmp_path):
    spec = SPECS[name][0]
    assert len(re.findall(re.escape(old), spec)) >= 1
    if (old, new) == ('type = "inertia", inertia', 'type = "mass", mass'):  # the same in other words
        assert checked(tmp_path, spec.replace(old, new, 1), proof_of(name))[0] == 0
        return
    code, words = checked(tmp_path, spec.replace(old, new, 1), proof_of(name))
    assert code == 1, words


UNKNOWN = [
    ("direct", "[operator]", "[operator]\ninertia = 1"),
    ("direct", "[controller]", "[controller]\nslip = 2"),
    ("direct", "[rates]", "[hand]\nmass = 1\n[rates]"),
    ("drawn", 'type = "mass",', 'type = "mass", slip = 1,'),
    ("drawn", '"eye.u"', '"eye.v" = "arm.x"\n"eye.u"'),
    ("drawn", "[signals]", "[extra]\na = 1\n[signals]"),
    ("drawn", 'method = "implicit"', 'method = "euler"'),
]


@pytest.mark.parametrize(("name", "old", "new"), UNKNOWN)
def test_a_key_that_is_not_known_is_an_error(name, old, new, tmp_path):
    code, words = checked(tmp_path, SPECS[name][0].replace(old, new, 1), proof_of(name))
    assert code == 2, words
    assert "is not known" in words
