"""Messages of channels in a simulation: those that are late or lost beside other blocks, and those that are lost at random."""

import numpy as np
import pytest
from support.messages import marched_blocks, random_blocks, spec_of_blocks
from support.networks import back, random_messages, random_network, spec_of

import wavesweep
from wavesweep.program.spec import load
from wavesweep.simulation.from_spec import simulated
from wavesweep.simulation.hardware import Effects, losses
from wavesweep.simulation.table import simulate


def test_messages_are_lost_as_often_as_the_chain_says():
    """In a share b/(b + e) of messages a burst goes on, which lasts 1/e messages on average."""
    keys = {"loss": 0.02, "burst": 0.01, "burst_end": 0.2, "burst_loss": 0.9}
    lost = np.array([late is None for late in losses(Effects(seed=3), keys, 400_000)])
    inside = 0.01 / 0.21
    assert lost.mean() == pytest.approx(inside * 0.9 + (1 - inside) * 0.02, rel=0.02)
    both = (lost[1:] & lost[:-1]).mean()
    chain = np.array([[0.99, 0.01], [0.2, 0.8]])
    weights = np.array([1 - inside, inside]) * [0.02, 0.9]
    assert both == pytest.approx(weights @ chain @ [0.02, 0.9], rel=0.03)
    assert losses(Effects(seed=3), keys, 100) != losses(Effects(seed=3), keys, 100, 1)


def test_a_simulation_draws_its_losses_unless_a_pattern_is_given():
    spec = load(
        {
            "rates": {"tick_hz": 10},
            "block": {"plant": {"type": "mass", "mass": 1, "damping": 1}, "net": {"type": "channel", "loss": 0.3}},
            "wire": {"net.u": "-plant.x", "plant.f": "net.y + push"},
            "ports": {"inputs": {"push": "push"}, "outputs": {"place": "plant.x"}},
            "simulate": {"input": "step", "duration_s": 100, "seed": 5},
        }
    )
    late = simulated(spec).late
    assert set(late.tolist()) == {0, -1}
    assert 0.2 < (late == -1).mean() < 0.4
    given = load(spec.tables() | {"simulate": {"input": "step", "messages": {"net": [0, "2 lost", 1]}}})
    assert simulated(given).late[:8].tolist() == [0, -1, -1, 1, 0, -1, -1, 1]
    assert load(given.asking("simulate").tables()).simulate["messages"] == {"net": (0, None, None, 1)}
    for seconds, settles in ((100, {"place": pytest.approx(1.0)}), (2, {})):  # where a spring of 1 N/m holds 1 N, or not yet
        tables = given.asking("simulate").tables()
        tables["simulate"]["duration_s"] = seconds
        assert simulate(load(tables).asking("simulate"))[0].facts["settles_at"] == settles


@pytest.mark.sample(12)
@pytest.mark.parametrize("seed", range(100))
@pytest.mark.parametrize("dropped", [False, True])
def test_a_march_with_queues_of_messages_gives_what_each_block_gives(seed, dropped):
    """A message and the results of other blocks in its tick are late or lost each by itself."""
    source = np.random.default_rng(seed)
    loop, push = random_blocks(source), source.normal(size=120)
    late = {"dropped": 1.0} if dropped else {}
    run = simulated(load(spec_of_blocks(loop, **late)), push)
    assert run.stopped == ""
    expected = marched_blocks(loop, push, dropped)
    found = np.array([run.signals[name] for name in ("place", *loop["blocks"])]).T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(4))
def test_the_age_of_a_message_is_a_column(seed):
    """That of the newest one that has come, also if an older one comes after it; none before the first."""
    source = np.random.default_rng(seed)
    loop = random_network(source)
    tables = spec_of(loop)
    messages = dict(zip(("there", "back"), random_messages(loop, source), strict=True))
    own = {name: ["lost" if each is None else each for each in late] for name, late in messages.items()}
    tables["simulate"] = {"input": "step", "duration_s": 0.3, "messages": own}
    (table,) = simulate(load(tables))[:1]
    for name, channel in zip(own, loop["channels"], strict=True):
        ages = []
        for k in range(300):
            older, last = back(channel, messages[name], k)
            sent = channel["phase"] + (last - older) * channel["every"]
            ages.append((k - sent) * 1e-3 if sent >= 0 else np.nan)
        np.testing.assert_allclose(table.columns[f"age_of_{name}"], ages, rtol=0, atol=1e-12)


def test_what_is_zero_without_a_message_has_no_age():
    """A message each 3 ticks: 1 late, lost, 4 late, in time, 1 late. From a run on in which none comes there is none."""
    channel = {"type": "channel", "every": 3, "late": 4, "lost": 1, "missing": "zero"}
    tables = {
        "rates": {"tick_hz": 1},
        "block": {"plant": {"type": "mass", "mass": 1, "damping": 1}, "net": channel},
        "signals": {"got": "net.y"},
        "wire": {"net.u": "push", "plant.f": "got - 0.01*plant.x"},
        "ports": {"inputs": {"push": "push"}, "outputs": {"place": "plant.x"}},
        "simulate": {"input": "step", "duration_s": 15, "messages": {"net": [1, "lost", 4, 0]}},
    }
    (table,) = simulate(load(tables))[:1]
    age = table.columns["age_of_net"]
    assert age == pytest.approx([np.nan, 1, 2, *[np.nan] * 6, 0, 1, 2, np.nan, 1, 2], nan_ok=True)
    assert (np.isnan(age) == (table.columns["got"] == 0))[3:].all()  # the step begins after the first message


def test_the_library_has_the_age_of_a_message_too():
    tables = spec_of(random_network(np.random.default_rng(0)))
    table = wavesweep.compile(tables | {"simulate": {"input": "step", "duration_s": 0.2}}).simulate()
    assert [name for name in table if name.startswith("age_of_")] == ["age_of_there", "age_of_back"]
    assert table.attrs["units"]["age_of_back"] == "s"
