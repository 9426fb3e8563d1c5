"""Random loops with a wall that only pushes, run tick by tick next to the end of what is proved."""

import numpy as np
import pytest

from wavesweep.contact.rows import records_through_contact
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop
from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.march import simulate

pytestmark = pytest.mark.asks("simulation")
STIFFNESS = "environment.K_VE"
TICKS = 24_000
PUSHED = 2_000  # ticks of a hand that does what it likes
WINDOW = 2_000  # ticks, of which the force's motion is looked at


def any_loop(rng):
    """A controller with numbers at random."""
    ratio = int(rng.integers(1, 30))
    kind = str(rng.choice(["dc", "dc-slow", "dc-lm", "pmw", "pmw-lm"]))
    return {
        "rates": {"ratio": ratio},
        "device": {
            "mass": 10 ** rng.uniform(-1.3, 0),
            "damping": rng.uniform(0.5, 3),
            "velocity": str(rng.choice(["exact", "difference"])),
        },
        "environment": {
            "B_VE": float(rng.choice([0.0, rng.uniform(0, 8)])),
            "integration": str(rng.choice(["explicit", "implicit", "trapezoidal"])),
            "delay": int(rng.integers(0, ratio + 1)),
        },
        "controller": {"kind": kind, "b": rng.uniform(2, 40), "Kp": float(rng.choice([0.0, 20.0]))},
        "local_model": {"K_LM": rng.uniform(0, 300)},
        "filters": {"lp1": {"order": int(rng.integers(0, 3)), "cutoff_hz": rng.uniform(5, 15)}},
    }


def proved_wall(tables):
    """The stiffest wall that is proved from 0 on; None if none is."""
    rows = records_through_contact(own_loop(load(tables), STIFFNESS), STIFFNESS, (0.0, 5000.0))
    first = rows[(rows["intervals"] > 0) & (rows["low"] == 0)]
    return float(first["high"][0]) if first.size else None


def forces_of_wall(tables, stiffness, rng):
    """The wall's forces while a hand does what it likes, and then pushes with a constant force."""
    wanders = np.cumsum(rng.standard_normal(PUSHED)) * rng.uniform(0, 0.02)
    push = np.concatenate([wanders, np.full(TICKS - PUSHED, rng.uniform(1, 4))])
    effects = Effects(wall=float(rng.uniform(0, 0.02)), pulls=False)
    values = {**load(tables).values, STIFFNESS: stiffness}
    run = simulate(values, push, effects)
    assert not run.stopped
    return run.signals["F_s"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_no_march_goes_on_where_it_is_proved(seed):
    """What is left of the force's motion fades; contact is made within the first seconds."""
    rng, ran = np.random.default_rng(seed), 0
    while ran < 3:
        tables = any_loop(rng)
        stiffness = proved_wall(tables)
        if stiffness is None:
            continue
        force = forces_of_wall(tables, 0.97 * stiffness, rng)
        assert (force >= 0).all()
        assert force[: TICKS // 2].any()
        ran += 1
        middle, end = (np.ptp(force[at : at + WINDOW]) for at in (TICKS // 2, TICKS - WINDOW))
        assert end <= max(0.9 * middle, 1e-3 * np.ptp(force))
