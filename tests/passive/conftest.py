"""The paper's loop as flat values, and random loops of every kind."""

import numpy as np
import pytest
from support.specs import values_of


@pytest.fixture
def values():
    """A function: the defaults with some keys changed, `values("pmw", K_VE=100.0, **{"filters.lp1.order": 2})`."""
    return values_of


@pytest.fixture
def random_values():
    """A function: a loop of any kind from a seed."""
    return _random_values


def _random_values(seed):
    r = np.random.default_rng(seed)
    ratio, fast_hz = int(r.choice([1, 2, 3, 5, 10, 20, 50])), float(r.choice([500.0, 1000.0, 2000.0]))

    def log(low, high):
        return float(np.exp(r.uniform(np.log(low), np.log(high))))

    def maybe(chance, low, high):
        return log(low, high) if r.random() < chance else 0.0

    filters = {}
    for name in ("lp1", "hp", "lp2"):
        filters[f"filters.{name}.order"] = int(r.integers(1, 5))
        filters[f"filters.{name}.cutoff_hz"] = log(0.002 * fast_hz, 0.1 * fast_hz)
    return filters | {
        "rates.fast_hz": fast_hz, "rates.ratio": ratio,
        "device.mass": log(0.02, 2), "device.damping": log(0.05, 30),
        "device.velocity": str(r.choice(["exact", "difference"])),
        "operator.mass": maybe(0.4, 0.05, 0.5), "operator.damping": maybe(0.4, 0.1, 10),
        "operator.stiffness": maybe(0.3, 10, 1000),
        "environment.K_VE": log(10, 2000), "environment.B_VE": log(0.1, 10),
        "environment.integration": str(r.choice(["explicit", "implicit", "trapezoidal"])),
        "environment.delay": int(r.choice([0, 1, ratio // 2, ratio])),
        "controller.kind": str(r.choice(["dc", "dc-slow", "dc-lm", "pmw", "pmw", "pmw-lm", "pmw-lm"])),
        "controller.b": log(5, 80), "controller.Kp": maybe(0.5, 1, 60),
        "local_model.K_LM": maybe(0.9, 10, 3000), "local_model.B_LM": maybe(0.6, 0.1, 5),
        "local_model.integration": str(r.choice(["explicit", "implicit", "trapezoidal"])),
        "local_model.delay": int(r.integers(0, 2)),
    }  # fmt: skip
