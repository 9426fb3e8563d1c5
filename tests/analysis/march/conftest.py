"""The paper's loop as flat values, from which each test changes what it is about."""

import pytest

_DEFAULTS = {
    "rates.fast_hz": 1000.0, "rates.ratio": 20,
    "device.mass": 0.1, "device.damping": 1.5, "device.velocity": "exact",
    "operator.mass": 0.0, "operator.damping": 0.0, "operator.stiffness": 0.0,
    "environment.K_VE": 500.0, "environment.B_VE": 1.0, "environment.integration": "implicit", "environment.delay": 0,
    "controller.kind": "pmw-lm", "controller.b": 25.0, "controller.Kp": 0.0,
    "filters.lp1.order": 1, "filters.lp1.cutoff_hz": 10.0,
    "filters.hp.order": 1, "filters.hp.cutoff_hz": 10.0,
    "filters.lp2.order": 2, "filters.lp2.cutoff_hz": 20.0,
    "local_model.K_LM": 500.0, "local_model.B_LM": 0.0, "local_model.integration": "implicit", "local_model.delay": 1,
}  # fmt: skip


@pytest.fixture
def values():
    """A function: the defaults with some keys changed, `values("dc-slow", K_VE=100.0, **{"rates.ratio": 1})`."""
    short = {path.split(".", 1)[1]: path for path in _DEFAULTS}

    def changed(kind, **changes):
        named = {short.get(name, name): value for name, value in changes.items()}
        assert named.keys() <= _DEFAULTS.keys()
        return {**_DEFAULTS, "controller.kind": kind, **named}

    return changed
