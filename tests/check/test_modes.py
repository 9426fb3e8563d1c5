"""The slowest and the least damped mode in a verdict."""

import pytest
from support.drawn import APART

import wavesweep
from wavesweep.program.analyses.own_design import own_design
from wavesweep.program.cli import main
from wavesweep.program.spec import load


def test_check_names_the_states_of_the_slowest_mode_and_of_the_least_damped():
    found = wavesweep.verdict(APART)
    assert found["slowest"]["states"][0].startswith("one")
    assert found["least_damped"] is None or found["least_damped"]["damping_ratio"] <= found["slowest"]["damping_ratio"]
    heavy = {**APART, "block": APART["block"] | {"two": {"type": "mass", "mass": 2.0, "damping": 2.0, "stiffness": 20000.0}}}
    found = wavesweep.verdict(heavy)
    assert (found["slowest"]["states"][0][:3], found["least_damped"]["states"][0][:3]) == ("one", "two")
    assert found["least_damped"]["damping_ratio"] == pytest.approx(0.005, rel=1e-6)


def test_the_slowest_mode_of_a_deadbeat_loop_is_over_within_a_frame(tmp_path, capsys):
    spec = tmp_path / "mine.toml"
    spec.write_text(
        """[rates]
tick_hz = 1000.0
[numbers]
K = 1000.0
[block]
p = { type = "integrator" }
h = { type = "hold", every = 1 }
[wire]
"h.u" = "p.y"
"p.u" = "r - K*h.y"
[ports]
inputs = { r = "r" }
outputs = { y = "p.y" }
[sweep]
along = "K"
K = { start = 1.0, stop = 5000.0 }
""",
        encoding="utf-8",
    )
    assert main(["check", str(spec)]) == 0
    assert "  slowest mode: over within a frame\n" in capsys.readouterr().out


def test_a_loop_without_states_is_over_within_its_frame_of_several_ticks():
    tables = {
        "rates": {"tick_hz": 100},
        "block": {"f": {"type": "gain", "k": 2.0, "every": 4}},
        "wire": {"f.u": "cmd"},
        "ports": {"inputs": {"cmd": "cmd"}, "outputs": {"y": "f.y"}},
    }
    found = own_design(load(tables))
    assert (found["stable"], found["slowest"]["time_constant_s"], found["slowest"]["states"]) == (True, 0, [])
