"""Effects of a device in drawn loops: those of a controller are those of the same loop written as blocks."""

import tomllib

import numpy as np
import pytest
from support.drawn import as_blocks
from support.specs import nested, random_values

import wavesweep
from wavesweep.simulation.from_spec import simulated

TWO_RATES = """
[rates]
tick_hz = 1000
[numbers]
K = 300.0
B = 2.0
[block.handle]
type = "mass"
mass = 0.1
damping = 1.0
[block.sensor]
type = "hold"
every = 5
[block.filter]
type = "butterworth"
order = 1
cutoff_hz = 10.0
every = 10
phase = 3
[wire]
"sensor.u" = "K*handle.x + B*handle.v"
"filter.u" = "20*handle.x"
"handle.f" = "push - sensor.y - filter.y"
[ports]
hand = { force = "push", displacement = "handle.x", reaction = "sensor.y + filter.y" }
wall = { stiffness = "K", damping = "B" }
"""


def effects_of(seed):
    """Some effects, with a wall or without."""
    r = np.random.default_rng(seed + 7)
    every = {
        "wall": float(r.choice([0.0, 1e-3, -1e-3])), "resolution": 5e-5, "max_force": 4.0, "friction": 0.2, "jitter": 0.2,
        "late": int(r.choice([1, 5, 30])), "dropped": 0.1,
    }  # fmt: skip
    return {name: value for name, value in every.items() if r.random() < 0.5} | {"seed": seed}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 13, 26, 39])
def test_a_controller_and_its_blocks_have_the_same_effects(seed):
    values = random_values(seed, str(np.random.default_rng(seed).choice(["dc", "dc-slow", "pmw", "pmw-lm"])))
    if values["controller.kind"] != "dc" and values["rates.ratio"] == 1:
        values["rates.ratio"], values["environment.delay"] = 4, min(values["environment.delay"], 4)
    force = 3 * np.random.default_rng(seed).standard_normal(800)
    own = wavesweep.compile(nested(values)).simulate(force, **effects_of(seed))
    blocks = wavesweep.compile(as_blocks(values)).simulate(force, **effects_of(seed))
    assert len(own) == len(blocks)
    left_out = own.columns.difference(blocks.columns)
    assert not own[left_out].fillna(0).to_numpy(dtype=float).any()  # what a drawn loop does not have is no column of it
    for name in blocks:
        a, b = (table[name].to_numpy(dtype=float) for table in (own, blocks))
        assert np.array_equal(np.isnan(a), np.isnan(b)), name
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-8 * np.nanmax(np.abs(a), initial=1e-9), err_msg=name)


def run(text, force, **effects):
    return simulated(wavesweep.load(tomllib.loads(text)), force, **effects)


def test_slow_results_of_each_rate_are_late_by_themselves():
    """The sensor's result of every 5 ticks, and the filter's of every 10 from tick 3 on."""
    seen = run(TWO_RATES, np.ones(400), late=8, seed=2)
    changes = np.flatnonzero(np.diff(seen.signals["f_m"])) + 1
    assert len({*(changes % 5).tolist()}) == 5
    assert len(seen.late) == 80
    assert seen.late.max() > 4
    lost = run(TWO_RATES, np.ones(400), dropped=1.0)
    assert np.all(lost.signals["f_m"] == 0.0)


def test_a_wall_that_is_read_in_every_tick_reads_slow_results_as_they_have_arrived():
    """A loop whose wall is named moves as one whose wall is not."""
    hold = {"type": "hold", "every": 5}
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 50.0, "B": 1.0},
        "block": {"handle": {"type": "mass", "mass": 0.5, "damping": 2.0}, "seen": hold},
        "wire": {"seen.u": "handle.x", "handle.f": "push - K*(handle.x - 0.5*seen.y) - B*handle.v"},
    }
    ports, force = {"hand": {"force": "push", "displacement": "handle.x"}}, np.random.default_rng(0).normal(1, 1, 300)
    wall = {"wall": {"stiffness": "K", "damping": "B"}}
    seen = [
        simulated(wavesweep.load(tables | {"ports": ports | more}), force, late=3, dropped=0.5).signals["x"]
        for more in ({}, wall)
    ]
    np.testing.assert_allclose(seen[1], seen[0], rtol=0, atol=1e-12)
