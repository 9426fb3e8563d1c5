"""The sentence about the wall, the delay and the velocity follows from the loop, and from the keys that were given."""

import pytest
from support.specs import KINDS

from wavesweep import load
from wavesweep.passive.table import passivity
from wavesweep.program.analyses.assumptions import model_in_words
from wavesweep.program.analyses.claims import own_figures
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses
from wavesweep.program.tables.table import facts_of
from wavesweep.sensitivity.table import why

GIVEN = {"environment": {"integration": "trapezoidal", "delay": 7}, "device": {"velocity": "difference"}}


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_said_of_defaults_if_all_is_given(kind):
    said = model_in_words(load({"controller": {"kind": kind}, **GIVEN}))
    assert "default" not in said
    assert said.endswith("velocity from differences of position")
    assert ("7 of 20" in said) == (kind != "dc")
    assert ("trapezoidal" in said) == (kind not in ("dc", "dc-slow", "dc-lm"))


def test_swept_values_are_neither_defaults_nor_single():
    said = model_in_words(load({"controller": {"kind": "pmw"}}), swept=["environment.delay"])
    assert "delay swept" in said
    assert "optimistic defaults of environment.integration and device.velocity: engines usually" in said


@pytest.mark.asks("for_all")
def test_messages_of_a_swept_number_are_those_of_each_row():
    lossy = {"bus": {"type": "channel", "lost": "2*n - 1", "late": "k"}, "r": {"type": "integrator"}}
    tables = {"rates": {"tick_hz": 1}, "numbers": {"g": 1.0, "n": 3, "k": 1}, "block": lossy}
    tables |= {"wire": {"bus.u": "-g*r.y", "r.u": "bus.y"}, "sweep": {"along": "g", "g": {"start": 0, "stop": 0.1}}}
    for axes, said in (
        ({}, "messages of bus late by up to 1 tick or lost, never six in a row"),
        ({"n": [1, 2]}, "messages of bus late by up to 1 tick or lost, up to 2*n - 1 in a row"),
        ({"k": [1]}, "messages of bus late by up to k ticks or lost, never six in a row"),
    ):
        claims = intervals(load(tables | {"sweep": tables["sweep"] | axes}), jobs=1).facts["claims"]
        assert claims["for_all"]["loops"] == said
        assert claims["spec"]["loops"] == "messages of bus all in time"


def test_frames_that_vary_are_named_with_the_delay_and_the_step_that_they_have():
    lengths = {"for_all": {"rates.ratio": {"values": [17, 34, 50], "varying": True}}, "controller": {"kind": "pmw"}}
    own = {"rates": {"ratio": 17}, "device": {"velocity": "difference"}}
    for delay, step, said in (
        (
            "frame",
            "elapsed",
            'results in place with the next frame (delay = "frame"), integrated over the time since the last frame',
        ),
        (17, "nominal", 'delay of 17 ticks, integrated over 17 ticks, however long a frame is (step = "nominal")'),
    ):
        wall = {"environment": {"integration": "explicit", "delay": delay, "step": step}}
        spec = load(lengths | own | wall)
        assert said in model_in_words(spec, told=["rates.ratio"])
        assert "frames of 17 ticks" in own_figures([spec], "modes")["spec"].said()


def test_several_specs_have_a_line_each_unless_they_agree():
    one, two = (load({"controller": {"kind": kind}, **GIVEN}) for kind in ("dc", "pmw"))
    assert facts_of([one, one], {}, {}, {})["assumes"] == model_in_words(one)
    both = facts_of([one, two], {}, {}, {})["assumes"].splitlines()
    assert both == [f"{spec.name}: {model_in_words(spec)}" for spec in (one, two)]


def test_numbers_that_a_preset_does_not_give_are_named_with_every_table():
    spec = load({"controller": {"kind": "pmw"}, "device": {"preset": "touch", "mass": 0.1}, "sweep": {"B_VE": [0.5, 1.0]}})
    said = "the spec takes precedence over the preset touch: device.mass = 0.1 and not 0.045"
    for table in (intervals(spec), responses([spec]), passivity(spec), why(spec)):
        assert said in table.facts["notices"]


def cycle(n, swept):
    """An integrator that reads itself through a delay of n ticks: with none of them, in the same tick."""
    return load(
        {
            "rates": {"tick_hz": 1},
            "numbers": {"g": 1.0, "n": n},
            "block": {"late": {"type": "delay", "steps": "n"}, "r": {"type": "integrator", "method": "implicit"}},
            "wire": {"late.u": "r.y", "r.u": "grid - g*late.y"},
            "ports": {"inputs": {"grid": {"signal": "grid"}}, "outputs": {"angle": {"signal": "r.y"}}},
            "sweep": {"along": "g", "g": {"start": 0, "stop": 10}} | swept,
        }
    )


@pytest.mark.parametrize(
    ("n", "swept", "at"), [(0, {}, ""), (1, {"n": [0, 1]}, " at n = 0"), (1, {}, None), (0, {"n": [1, 2]}, None)]
)
def test_a_cycle_that_is_solved_within_a_tick_is_named_with_every_table(n, swept, at):
    spec = cycle(n, swept)
    said = [f"solved within a tick{at}: late and r, which read one another in the same tick; prev(...) reads the one before"]
    assert intervals(spec, jobs=1).facts["notices"] == (said if at is not None else [])
    if not swept:
        assert responses([spec]).facts["notices"] == (said if at is not None else [])


NETWORK = {
    "rates": {"tick_hz": 1000},
    "numbers": {"g": 2.0, "w": 0.1},
    "block": {"m": {"type": "mass", "mass": "w", "damping": 1.0, "stiffness": 5}, "net": {"type": "channel", "lost": 2}},
    "wire": {"net.u": "g*(ref - m.v)", "m.f": "net.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"place": "m.x"}},
    "sweep": {"along": "g", "g": {"start": 0, "stop": 50}},
}


@pytest.mark.asks("poles")
def test_what_has_every_message_in_time_claims_no_more():
    from wavesweep.poles.table import poles

    network = load(NETWORK)
    assert poles(network).facts["claims"]["spec"]["loops"] == "messages of net all in time"
    assert responses([network]).facts["claims"]["spec"]["loops"] == "messages of net all in time"
    varied = load({"controller": {"kind": "dc-slow"}, **GIVEN, "for_all": {"device.mass": {"start": 0.08, "stop": 0.1}}})
    (claim,) = responses([varied]).facts["claims"].values()
    assert claim["said"] == "responses with the spec's own numbers, frames of 20 ticks"


@pytest.mark.asks("simulation")
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "all messages in time"),
        ({"simulate": {"messages": {"net": [0, "2 lost", 1]}}}, "messages of net in turn in time, 2 lost, 1 tick late"),
        ({"block": NETWORK["block"] | {"net": {"type": "channel", "loss": 0.1}}}, "messages of net lost at random, seed 0"),
    ],
)
def test_a_run_claims_what_it_has(changed, said):
    """And not what [for_all] or its channels may do beside it."""
    from wavesweep.simulation.table import simulate

    asked = {"for_all": {"w": {"start": 0.05, "stop": 0.2}}, "simulate": {"duration_s": 0.2}}
    spec = load(NETWORK | asked | {name: asked.get(name, {}) | more for name, more in changed.items()}).asking("simulate")
    (claim,) = simulate(spec)[0].facts["claims"].values()
    assert claim["said"] == f"a run with {said}"


@pytest.mark.asks("simulation")
def test_a_run_of_a_controller_names_its_frames():
    from wavesweep.simulation.table import simulate

    varied = {"for_all": {"rates.ratio": {"values": [16, 20, 33], "varying": True}}, "controller": {"kind": "dc-slow"}, **GIVEN}
    at_rate = simulate(load(varied | {"simulate": {"duration_s": 0.2}}).asking("simulate"))[0].facts
    assert "delay of 7 of 20 ticks" in at_rate["assumes"]
    assert at_rate["claims"]["spec"]["said"] == "a run with the spec's own numbers, frames of 20 ticks"
    in_turn = load(varied | {"simulate": {"duration_s": 0.2, "frames": [16, 33]}}).asking("simulate")
    facts = simulate(in_turn)[0].facts
    assert "delay of 7 ticks" in facts["assumes"]
    assert facts["claims"]["spec"]["said"] == "a run with frames of 16, 33 ticks in turn"


@pytest.mark.asks("for_all")
def test_rows_for_all_messages_are_called_so():
    for more, called in (
        ({}, "messages of net lost, never three in a row (for_all)"),
        ({"for_all": {"w": [0.1, 0.2]}}, "w of 0.1, 0.2, messages of net lost, never three in a row (for_all)"),
    ):
        table = intervals(load({**NETWORK, **more}))
        kind, tally = kind_named("stability-region"), kind_named("stability-region").tally(table)
        assert len(table.watched(tally.add).columns["along"]) > 1
        assert f"stable for {called}" in "; ".join(line for line, _ in kind.lines(tally.numbers(table.facts)))
