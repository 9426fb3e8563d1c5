"""Loops at the extremes of what a spec allows, each from its number alone."""

from dataclasses import dataclass

import numpy as np
from support.specs import INTEGRATIONS, random_values

from wavesweep.engine._keys.key import LARGEST, SMALLEST


@dataclass(frozen=True)
class Question:
    """Flat values, and the columns asked for: along "K_VE" or "B_VE" within span, the other one at each of `fixed`."""

    values: dict
    along: str
    span: tuple[float, float]
    fixed: tuple[float, ...]


def spread(r, low, high):
    """A number whose logarithm is uniform."""
    return float(np.exp(r.uniform(np.log(low), np.log(high))))


def maybe(r, number, never):
    """The number, or 0 with the probability `never`."""
    return 0.0 if r.random() < never else number


def wild(r):
    """Every key over its whole range, gains of zero among them."""
    ratio, fast = round(spread(r, 1, 1000)), float(r.choice([500.0, 1000.0, 2000.0, 5000.0]))
    filters = {
        f"filters.{name}.{key}": value for name in ("lp1", "hp", "lp2")
        for key, value in (("order", int(r.integers(0, 13))), ("cutoff_hz", spread(r, 1e-3 * fast, 0.499 * fast)))
    }  # fmt: skip
    return filters | {
        "rates.fast_hz": fast, "rates.ratio": ratio,
        "device.mass": spread(r, 1e-6, 100), "device.damping": maybe(r, spread(r, 1e-3, 1e4), 0.2),
        "device.velocity": str(r.choice(["exact", "difference"])),
        "operator.mass": maybe(r, spread(r, 1e-3, 10), 0.6), "operator.damping": maybe(r, spread(r, 1e-3, 1e3), 0.6),
        "operator.stiffness": maybe(r, spread(r, 1e-2, 1e5), 0.7),
        "environment.K_VE": spread(r, 1e-2, 1e9), "environment.B_VE": spread(r, 1e-3, 1e4),
        "environment.integration": str(r.choice(INTEGRATIONS)), "environment.delay": int(r.integers(0, ratio + 1)),
        "controller.kind": str(r.choice(["dc", "dc-slow", "dc-lm", "pmw", "pmw-lm", "pmw-lm"])),
        "controller.b": spread(r, 1e-6, 1e6), "controller.Kp": maybe(r, spread(r, 1e-2, 1e3), 0.5),
        "local_model.K_LM": maybe(r, spread(r, 1e-2, 1e6), 0.1), "local_model.B_LM": maybe(r, spread(r, 1e-3, 1e3), 0.4),
        "local_model.integration": str(r.choice(INTEGRATIONS)), "local_model.delay": int(r.integers(0, 2)),
    }  # fmt: skip


def usual(r):
    """A loop that somebody might build, any delay."""
    values = random_values(int(r.integers(2**31)))
    return values | {"environment.delay": int(r.integers(0, values["rates.ratio"] + 1))}


def long_filters(r):
    """Orders from 6 to 12, cutoffs from 0.1 % of the rate, few ticks in a frame: poles of three scales crowd."""
    values = usual(r)
    changes = {f"filters.{name}.order": int(r.integers(6, 13)) for name in ("lp1", "hp", "lp2")}
    changes |= {f"filters.{name}.cutoff_hz": spread(r, 1e-3, 0.49) * values["rates.fast_hz"] for name in ("lp1", "hp", "lp2")}
    ratio = int(r.choice([1, 2, 3, 5, 20]))
    return (
        values
        | changes
        | {
            "rates.ratio": ratio,
            "environment.delay": int(r.integers(0, ratio + 1)),
            "controller.kind": str(r.choice(["pmw", "pmw-lm"])),
        }
    )


def unstable_inside(r):
    """A fast side that grows within the frame while the wall waits."""
    values, ratio = usual(r), round(spread(r, 2, 1000))
    return values | {
        "controller.kind": str(r.choice(["dc-lm", "pmw-lm"])), "rates.ratio": ratio,
        "environment.delay": int(r.integers(0, ratio + 1)), "local_model.K_LM": spread(r, 1e3, 1e7),
        "local_model.B_LM": maybe(r, spread(r, 1, 1e4), 0.3), "local_model.integration": "explicit",
    }  # fmt: skip


def nearly_ill_posed(r):
    """A local model that reflects nearly everything, in the same tick, with no filter in its way."""
    values = usual(r)
    b = values["controller.b"]
    return values | {
        "controller.kind": "pmw-lm", "filters.hp.order": 0, "filters.lp2.order": 0, "local_model.delay": 0,
        "local_model.B_LM": b * spread(r, 1e2, 1e13),
    }  # fmt: skip


def feeble(r):
    """Next to nothing damps the hand: crossings crowd at z = 1, or sit on it."""
    values = usual(r)
    return values | {
        "device.damping": maybe(r, spread(r, 1e-9, 1e-2), 0.4), "operator.damping": 0.0,
        "controller.b": spread(r, 1e-6, 1e2), "filters.hp.order": int(r.integers(0, 2)),
        "filters.lp2.order": int(r.integers(0, 2)),
    }  # fmt: skip


def slow(r):
    """Two eigenvalues that nearly meet next to z = 1: next to nothing draws a heavy hand back, through a slow filter."""
    values = usual(r)
    return values | {
        "controller.kind": str(r.choice(["pmw", "pmw-lm", "dc-slow", "dc-lm"])), "controller.Kp": spread(r, 1e-9, 1e-2),
        "operator.mass": spread(r, 1.0, 1e3), "operator.damping": spread(r, 1e-6, 1.0),
        "operator.stiffness": maybe(r, spread(r, 1e-6, 1e-1), 0.5), "filters.lp1.cutoff_hz": 1e-3 * values["rates.fast_hz"],
    }  # fmt: skip


ANY = (
    "device.mass", "device.damping", "operator.mass", "operator.damping", "operator.stiffness", "environment.K_VE",
    "environment.B_VE", "controller.b", "controller.Kp", "local_model.K_LM", "local_model.B_LM", "rates.fast_hz",
)  # fmt: skip
POSITIVE = ("device.mass", "controller.b", "rates.fast_hz")


def any_size(r):
    """A number that a key accepts, from the whole range or from within a million of 1."""
    return spread(r, SMALLEST, LARGEST) if r.random() < 0.5 else spread(r, 1e-6, 1e6)


def any_number(r):
    """Numbers of every size that a key accepts, cutoffs next to 0 and to half the rate, few ticks in a frame."""
    values, ratio = wild(r), int(r.choice([1, 2, 3, 5, 20]))
    values |= {key: maybe(r, any_size(r), 0.0 if key in POSITIVE else 0.3) for key in ANY if r.random() < 0.6}
    half = values["rates.fast_hz"] / 2
    for name in ("lp1", "hp", "lp2"):
        values[f"filters.{name}.order"] = int(r.choice([0, 1, 1, 2, 2, 3, 12]))
        share = r.choice([spread(r, SMALLEST, 1), 1 - spread(r, 1e-16, 1), spread(r, 1e-3, 1)])
        values[f"filters.{name}.cutoff_hz"] = float(np.clip(share * half, SMALLEST, np.nextafter(half, 0)))
    kind = str(r.choice(["dc", "dc", "dc-slow", "dc-slow", "dc-lm", "dc-lm", "pmw", "pmw-lm"]))
    delay = int(r.integers(0, ratio + 1))
    return values | {"controller.kind": kind, "rates.ratio": ratio, "environment.delay": delay}


FAMILIES = {
    make.__name__: make for make in (wild, usual, long_filters, unstable_inside, nearly_ill_posed, feeble, slow, any_number)
}


def question(seed, family) -> Question:
    """The loop, the axis, the span and three columns of this number."""
    r = np.random.default_rng(seed)
    values = FAMILIES[family](r)
    along = str(r.choice(["K_VE", "K_VE", "B_VE"]))
    if family == "any_number":
        return Question(values, along, (0.0, any_size(r)), (maybe(r, any_size(r), 0.4),))
    high = float(r.choice([2e3, 2e4, 1e9] if along == "K_VE" else [15.0, 300.0, 1e4]))
    other = (0.0, 15.0, 1e4) if along == "K_VE" else (0.0, 2e4, 1e9)
    first = other[0] if r.random() < 0.3 else spread(r, 1e-3, other[1])
    return Question(values, along, (0.0, high), (first, float(r.uniform(0, other[1])), spread(r, 1e-3, other[2])))
