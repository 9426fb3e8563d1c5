"""[simulate] says what the hand does and what a real rig adds; no other command's results depend on it."""

import pickle

import pytest
from support.drawn import ARM

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.spec import load
from wavesweep.simulation.keys import KEYS, step_seconds

LOOP = {"controller": {"kind": "pmw"}}


def simulate(**given):
    return load(LOOP | {"simulate": given}).simulate


def test_every_key_has_its_default():
    defaults = {path.split(".")[1]: key.default for path, key in KEYS.items()}
    assert load(LOOP).simulate.values == defaults | {"frequency_hz": (5.0,), "duration_s": 10.0}


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


def test_the_default_steps_pass_by_the_multiples_of_half_the_slow_rate():
    steps = simulate(input="stepped-sine")["frequency_hz"]
    assert (steps[0], steps[-1], len(steps)) == (0.5, 49.5, 50)
    assert min(abs(f - 25.0) for f in steps) == 0.5


def test_other_commands_do_not_depend_on_it():
    plain, asked = load(LOOP), load(LOOP | {"simulate": {"friction": 0.2}})
    assert plain.sha256 == asked.sha256
    assert "simulate" not in asked.tables()
    assert plain.asking("simulate").sha256 != asked.asking("simulate").sha256
    assert asked.asking("simulate").tables()["simulate"]["friction"] == 0.2


def test_a_simulated_spec_keeps_what_it_is_when_values_change_and_when_it_travels():
    spec = load(LOOP | {"simulate": {"wall": 0.01}}).asking("simulate")
    changed = spec.with_values({"controller.b": 40.0})
    assert changed.tables()["simulate"]["wall"] == 0.01
    assert pickle.loads(pickle.dumps(changed)).sha256 == changed.sha256  # noqa: S301 - made on the line
    with pytest.raises(TypeError):
        spec.simulate["wall"] = 0.0


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


def test_a_wall_that_only_pushes_has_to_begin_somewhere():
    with pytest.raises(UsageError, match=r"option pulls: expected simulate\.wall, where a one-sided wall begins, found none"):
        wavesweep.simulate(LOOP | {"simulate": {"pulls": False}})


def test_a_slow_loop_is_no_mistake_until_it_is_simulated():
    slow = LOOP | {"rates": {"fast_hz": 8.0}, "filters": {"lp1": {"order": 0}, "hp": {"order": 0}, "lp2": {"order": 0}}}
    spec = load(slow)
    with pytest.raises(SpecError, match=r"simulate\.frequency_hz: expected numbers < 4\.0"):
        spec.asking("simulate")
    assert load(slow, ["simulate.frequency_hz=1"]).asking("simulate").simulate["frequency_hz"] == (1.0,)


def test_a_step_lasts_whole_periods_and_a_second():
    assert step_seconds(0.5, 2.0, 3) == 8.0
    assert step_seconds(40.0, 0.0, 5) == 1.0


def test_the_resolved_tables_load_to_the_same_simulation():
    simulated = load(
        LOOP | {"device": {"preset": "falcon"}, "simulate": {"input": "stepped-sine", "frequency_hz": [1, 2]}}
    ).asking("simulate")
    again = load(simulated.tables()).asking("simulate")
    assert again.tables() == simulated.tables()
    assert again.sha256 == simulated.sha256


def test_given_keys_take_precedence_over_those_of_a_device():
    spec = load(LOOP | {"device": {"preset": "touch"}, "simulate": {"friction": 0.0}})
    assert (spec.simulate["friction"], spec.hardware["friction"], spec.hardware["resolution"]) == (0.0, 0.0, 0.055e-3)


def test_keys_of_a_file_and_of_overrides_are_given(tmp_path):
    path = tmp_path / "wall.toml"
    path.write_text('controller.kind = "pmw"\n[simulate]\nfriction = 0\n')
    assert load(path).given == {"controller.kind", "simulate.friction"}
    assert load(path, ["simulate.seed=3"]).given == {"controller.kind", "simulate.friction", "simulate.seed"}


def test_the_hand_of_a_drawn_loop_is_simulated(write):
    spec = load(write(ARM + "[simulate]\ninput = 'step'\nduration_s = 0.5\n"))
    assert "simulate" not in spec.tables()
    simulated = spec.asking("simulate")
    tables = simulated.tables()
    assert (tables["simulate"]["input"], tables["simulate"]["duration_s"]) == ("step", 0.5)
    assert tables["simulate"]["friction"] == 0.0
    assert load(simulated.tables()).asking("simulate").sha256 == simulated.sha256
