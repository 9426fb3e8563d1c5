"""The sentence about the wall, the delay and the velocity follows from the loop, and from the keys that were given."""

import pytest

from wavesweep import load
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses


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
