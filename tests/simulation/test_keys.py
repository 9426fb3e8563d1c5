"""[simulate] says what the hand does and what a real rig adds; no other command's results depend on it."""

import pytest
from support.drawn import ARM

from wavesweep.engine.errors import SpecError
from wavesweep.program.spec import load

LOOP = {"controller": {"kind": "pmw"}}


def simulate(**given):
    return load(LOOP | {"simulate": given}).simulate


@pytest.mark.parametrize(
    ("given", "frequencies"),
    [
        ({"input": "sine", "frequency_hz": 7}, (7.0,)),
        ({"input": "sine", "frequency_hz": [7]}, (7.0,)),
        ({"input": "stepped-sine", "frequency_hz": 7}, (7.0,)),
        ({"input": "stepped-sine", "frequency_hz": {"start": 1, "stop": 4, "num": 3, "scale": "log"}}, (1.0, 2.0, 4.0)),
        ({"input": "chirp", "frequency_hz": {"start": 1, "stop": 4}}, (1.0, 4.0)),
        ({"input": "chirp"}, (0.1, 50.0)),
        ({"input": "noise"}, ()),
        ({"input": "noise", "frequency_hz": [1, 2]}, ()),
    ],
)
def test_each_input_reads_its_frequencies(given, frequencies):
    assert simulate(**given)["frequency_hz"] == pytest.approx(frequencies, rel=1e-14)


@pytest.mark.parametrize("kind", ["sine", "chirp", "step", "noise"])
def test_what_is_written_can_be_read_again(kind):
    spec = load(LOOP | {"simulate": {"input": kind}}).asking("simulate")
    assert load(spec.tables()).asking("simulate").sha256 == spec.sha256


def test_other_commands_do_not_depend_on_it():
    plain, asked = load(LOOP), load(LOOP | {"simulate": {"friction": 0.2}})
    assert plain.sha256 == asked.sha256
    assert "simulate" not in asked.tables()
    assert plain.asking("simulate").sha256 != asked.asking("simulate").sha256
    assert asked.asking("simulate").tables()["simulate"]["friction"] == 0.2


@pytest.mark.parametrize(
    ("override", "name", "value"),
    [
        ("simulate.input=stepped-sine", "input", "stepped-sine"),
        ("simulate.frequency_hz=8", "frequency_hz", (8.0,)),
        ("device.preset=omni", "friction", 0.26),
        ("simulate.wall=-0.001", "wall", -0.001),
        ("simulate={ seed = 4 }", "seed", 4),
    ],
)
def test_a_setting_overrides_it(override, name, value):
    assert load(LOOP | {"simulate": {"wall": 0.01, "seed": 1}}, [override]).simulate[name] == value


def test_a_wall_that_may_pull_is_not_said_and_one_that_only_pushes_is():
    """So the digest of a spec that says nothing of it is what it was."""
    plain, pushes = (load(LOOP | {"simulate": {"wall": 0.01, **more}}).asking("simulate") for more in ({}, {"pulls": False}))
    assert "pulls" not in plain.tables()["simulate"]
    assert load(pushes.tables()).asking("simulate").simulate["pulls"] is False
    assert pushes.sha256 != plain.sha256


def test_a_slow_loop_is_no_mistake_until_it_is_simulated():
    slow = LOOP | {"rates": {"fast_hz": 8.0}, "filters": {"lp1": {"order": 0}, "hp": {"order": 0}, "lp2": {"order": 0}}}
    spec = load(slow)
    with pytest.raises(SpecError, match=r"simulate\.frequency_hz: expected numbers < 4\.0"):
        spec.asking("simulate")
    assert load(slow, ["simulate.frequency_hz=1"]).asking("simulate").simulate["frequency_hz"] == (1.0,)


def test_the_hand_of_a_drawn_loop_is_simulated(write):
    spec = load(write(ARM + "[simulate]\ninput = 'step'\nduration_s = 0.5\n"))
    assert "simulate" not in spec.tables()
    simulated = spec.asking("simulate")
    tables = simulated.tables()
    assert (tables["simulate"]["input"], tables["simulate"]["duration_s"]) == ("step", 0.5)
    assert tables["simulate"]["friction"] == 0.0
    assert load(simulated.tables()).asking("simulate").sha256 == simulated.sha256


@pytest.mark.parametrize("kind", ["step", "pulse"])
def test_the_times_that_nobody_wrote_fit_a_tick_of_a_minute(kind):
    block = {"q": {"type": "integrator", "method": "explicit"}}
    tables = {"rates": {"tick_hz": "1/T"}, "numbers": {"T": 60.0}, "block": block, "wire": {"q.u": "r - 0.01*q.y"}}
    spec = load(tables | {"ports": {"inputs": {"r": "r"}, "outputs": {"y": "q.y"}}, "simulate": {"input": kind}})
    assert spec.asking("simulate").simulate["duration_s"] == 6000.0
    with pytest.raises(SpecError, match=r"simulate\.duration_s: expected at least a tick \(60 s\), found 10"):
        load(spec.asking("simulate").tables(), ["simulate.duration_s=10"]).asking("simulate")
