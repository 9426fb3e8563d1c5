"""Controllers at rates that do not divide: ticks that are opened and closed again, against those that are built whole."""

import numpy as np
import pytest

from wavesweep.engine._loops.from_drawing import FACTOR, PRODUCT
from wavesweep.engine._monodromy.open_ticks import OpenTicks
from wavesweep.haptics.controllers import CONTROLLERS, WALL
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

BASE = {"controller": {"Kp": 20.0}, "environment": {"K_VE": 700.0, "B_VE": 3.0}}


def spec_of(kind, **tables):
    return load({name: {**BASE.get(name, {}), **tables.get(name, {})} for name in {*BASE, *tables}} | {
        "controller": {**BASE["controller"], "kind": kind, **tables.get("controller", {})}
    })  # fmt: skip


@pytest.mark.sample(7)
@pytest.mark.parametrize("path", WALL)
@pytest.mark.parametrize("kind", CONTROLLERS)
@pytest.mark.parametrize("delay", [0, 7])
def test_ticks_cut_at_the_wall_and_closed_again_are_those_with_the_wall(kind, delay, path):
    """Of three loops at three walls each, which a batch would connect one by one."""
    loop = own_loop(spec_of(kind, environment={"delay": delay}, rates={"slow_hz": 60.0}))
    mass, p = np.array([0.1, 0.3, 0.7]), np.array([[0.5, 80.0, 3000.0]])
    some = loop.changed({"device.mass": mass, path: 1.0})
    ticks = OpenTicks.of(some.drawn(path), some.drawn(), PRODUCT, FACTOR)
    drift = loop.changed({path: np.array([0.5, 2.0])}).drift()
    found = drift.frames_of(ticks.closed(np.arange(3)[:, None], p))
    whole = loop.changed({"device.mass": mass[:, None], path: p}).frames(drift)
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-12 * np.abs(whole).max())
