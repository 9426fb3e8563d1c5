"""A wave line without hold or delay passes on what it takes: its impedance cancels in every tick, and digits with it.

The avatar follows the device, so nothing of the loop depends on the impedance, and that of 1 N*s/m tells the truth.
"""

import numpy as np
import pytest
from stress.drawings import monodromy

import wavesweep

IMPEDANCES = 10.0 ** np.arange(-4, 15, 2)
USUAL = (IMPEDANCES >= 1) & (IMPEDANCES < 1e5)


def line(b, damping=1.5, **tables):
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 500.0, "B": 1.0, "m": 0.1, "b": float(b)},
        "block": {
            "device": {"type": "mass", "mass": "m", "damping": damping},
            "end": {"type": "wave", "b": "b"},
            "avatar": {"type": "avatar", "b": "b", "integration": tables.pop("integration", "implicit")},
        },
        "wire": {
            "end.v": "device.v",
            "end.in": "avatar.out",
            "avatar.in": "end.out",
            "avatar.f": "K*avatar.x_spring + B*avatar.v",
            "device.f": "hand - end.force",
        },
        "ports": {
            "hand": {"force": "hand", "displacement": "device.x", "reaction": "end.force"},
            "wall": {"stiffness": "K", "damping": "B"},
        },
        **tables,
    }


@pytest.mark.parametrize("damping", [1.5, 1e-6])
def test_responses_are_within_their_bounds(damping):
    def responses(b):
        found = wavesweep.bode(line(b, damping, bode={"frequency_hz": [0.0, 1.0, 10.0, 40.0]}))
        return [found[f"{name}_re"] + 1j * found[f"{name}_im"] for name in NAMES], [found[f"{name}_error"] for name in NAMES]

    truths, of_truths = responses(1.0)
    for b in IMPEDANCES:
        for found, error, truth, of_truth in zip(*responses(b), truths, of_truths, strict=True):
            known = found.notna()
            assert (np.abs(found / truth - 1) <= error + of_truth)[known].all(), b
            assert known.all() or not 1e-4 < b < 1e12


NAMES = "admittance", "impedance"


ALONG = {"K": {"start": 0, "stop": 2e5}, "m": {"start": 1e-4, "stop": 1.0}, "B": {"start": 0, "stop": 1e4}}


@pytest.mark.sample(2)
@pytest.mark.parametrize("along", ALONG)
@pytest.mark.parametrize("integration", ["implicit", "explicit"])
@pytest.mark.parametrize("damping", [1.5, 1e-6])
def test_what_is_certified_does_not_depend_on_the_impedance(along, integration, damping):
    def table(b):
        return wavesweep.stability_region(
            line(1.0, damping, integration=integration, sweep={along: ALONG[along], "b": b}), along
        )

    truth = table([1.0])
    ends = [f"{along}_low", f"{along}_high"] if along in truth else ["low", "high"]
    found = table(IMPEDANCES.tolist())
    assert table(IMPEDANCES[USUAL].tolist())["certified"].all()
    assert truth["certified"].all()
    for b, rows in found[found["certified"]].groupby("b"):
        np.testing.assert_allclose(rows[ends], truth[ends], rtol=1e-9, err_msg=str(b))


def test_a_spectral_radius_is_right_or_missing():
    radii = [wavesweep.compile(line(b)).spectral_radius() for b in (1.0, *IMPEDANCES, 1e15)]
    known = np.isfinite(radii)
    np.testing.assert_allclose(np.array(radii)[known], radii[0], rtol=1e-3)
    assert known[:-1][1:][USUAL].all()
    truth, hidden = (wavesweep.compile(line(b, 1e-6)).spectral_radius() for b in (1.0, 1e15))
    assert np.isnan(hidden) or hidden == pytest.approx(truth, rel=1e-9)


def test_a_margin_at_the_port_is_right_or_missing():
    def margin(b):
        tables = line(b, integration="explicit")
        tables["numbers"] |= {"K": 3000.0}
        found = wavesweep.passivity(tables)
        assert found["port_omega"].isna().equals(found["port_margin"].isna())
        return found["port_margin"][0]

    truth, margins = margin(1.0), np.array([margin(b) for b in IMPEDANCES])
    known = np.isfinite(margins)
    assert known[USUAL].all()
    assert not known.all()
    np.testing.assert_allclose(margins[known], truth, rtol=1e-9)


def gains(g, eps, every=1):
    """A position read as the difference of two large multiples of it, which is `g*eps` times it."""
    rate = {} if every == 1 else {"every": every, "phase": every - 1}
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 1.0, "g": g, "eps": eps},
        "block": {
            "p": {"type": "mass", "mass": 1.0, "damping": 0.5},
            "a": {"type": "gain", "k": "1 + eps", **rate},
            "c": {"type": "gain", **rate},
        },
        "wire": {"a.u": "p.x", "c.u": "p.x", "p.f": "hand - K*(g*a.y - g*c.y) - 200*p.x - 2*p.v"},
        "ports": {"hand": {"force": "hand", "displacement": "p.x"}},
    }


@pytest.mark.parametrize("g", [1.0, 1e4, 1e6, 1.437e9, 1.437e11, 1.437e13, 1e15])
def test_a_difference_that_a_number_multiplies_is_certified_only_with_its_digits(g):
    found = wavesweep.compile(gains(g, 3.0 / g)).stable_intervals("K", (0, 1e5))
    truth = wavesweep.compile(gains(1.0, 3.0)).stable_intervals("K", (0, 1e5))
    assert truth["certified"].all()
    assert found["certified"].all() or g > 1e4
    if found["certified"].all():
        np.testing.assert_allclose(found[["low", "high"]], truth[["low", "high"]], rtol=1e-9)


@pytest.mark.sample(2)
@pytest.mark.parametrize("g", [1.0, 1e4, 1e6, 1e8, 1e10, 1e12])
def test_a_difference_of_what_is_held_is_certified_only_with_its_digits(g):
    """The gains run in one tick of a frame, and their difference is read in another."""
    tables = gains(g, 3.0 / g, every=10)
    tables["block"]["h"] = {"type": "hold", "every": 10, "phase": 7}
    tables["wire"] |= {"h.u": "g*a.y - g*c.y", "p.f": "hand - h.y - 200*p.x - K*p.v"}
    found = wavesweep.compile(tables).stable_intervals("K", (-5, 1000))
    if g == 1.0 or found["certified"].all():
        exact = tables | {"wire": tables["wire"] | {"h.u": "g*eps*a.u", "a.u": "p.x"}}
        exact["wire"]["h.u"] = "3*a.y"
        exact["numbers"] = {"K": 1.0}
        exact["block"] = exact["block"] | {"a": exact["block"]["a"] | {"k": 1.0}}
        truth = wavesweep.compile(exact).stable_intervals("K", (-5, 1000))
        assert truth["certified"].all()
        np.testing.assert_allclose(found[["low", "high"]], truth[["low", "high"]], rtol=1e-9)
    assert found["certified"].all() == (g < 1e5)


def test_an_end_that_a_moderate_growth_between_ticks_moves_is_not_certified():
    """It would be off by 3e-9: the growth is 256, and the end a small damping beside a large gain."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"d": 0.77452, "g": 812240000.0},
        "block": {
            "dev": {"type": "mass", "mass": 0.95792, "damping": "d"},
            "s": {"type": "hold", "every": 2},
            "a": {"type": "gain", "k": 1 + 4.0546e-08, "every": 10},
            "c": {"type": "gain", "every": 10},
            "h": {"type": "hold", "every": 10, "phase": 7},
        },
        "wire": {
            "s.u": "dev.x",
            "a.u": "dev.x",
            "c.u": "dev.x",
            "dev.f": "hand - h.y - 2277.3*dev.x - 1.2333*dev.v - 48.005*s.y",
            "h.u": "g*a.y - g*c.y",
        },
        "ports": {"hand": {"force": "hand", "displacement": "dev.x"}},
    }
    found = wavesweep.compile(tables).stable_intervals("d", (-5, 1000))
    assert found["doubt"].tolist() == ["rounding"]


@pytest.mark.parametrize("g", [1.0, 1e3, 1e9, 3.5e10])
def test_a_margin_of_ticks_that_cancel_each_other_is_right_or_missing(g):
    def margin(g):
        return wavesweep.passivity(gains(g, 3.0 / g, every=5) | {"sweep": {}})["port_margin"][0]

    truth, found = margin(1.0), margin(g)
    assert (g > 1e6 and np.isnan(found)) or found == pytest.approx(truth, rel=1e-8)


def two_lines(b, c, every, integration, wall, device):
    """A line behind another one, the second's avatar at a slower rate."""
    spec = line(b)
    spec["numbers"] |= dict(zip(("K", "B", "m", "c"), (*wall, device[0], c), strict=True))
    spec["block"]["device"]["damping"] = device[1]
    spec["block"] |= {
        "between": {"type": "avatar", "b": "b", "integration": integration},
        "second": {"type": "wave", "b": "c"},
        "avatar": {"type": "avatar", "b": "c", "integration": integration, "every": every},
    }
    spec["wire"] |= {
        "end.in": "between.out",
        "between.in": "end.out",
        "between.f": "second.force",
        "second.v": "between.v",
        "second.in": "avatar.out",
        "avatar.in": "second.out",
    }
    return spec


@pytest.mark.parametrize(
    ("along", "stop", "loop"),
    [
        ("B", 1e3, (413.6, 1.136, 10, "implicit", (1326.0, 0.1007), (0.3212, 0.2042))),
        ("B", 1e3, (5.088, 9.107, 10, "implicit", (2510.0, 1.852), (0.3257, 0.05112))),
        ("K", 1e5, (14.84, 247.6, 5, "trapezoidal", (138.5, 6.069), (0.5309, 6.653))),
        ("B", 1e3, (14.84, 247.6, 5, "trapezoidal", (138.5, 6.069), (0.5309, 6.653))),
        ("K", 1e5, (5.397, 299.4, 1, "trapezoidal", (10.44, 0.1395), (0.04186, 6.236))),
    ],
)
def test_usual_lines_in_a_row_are_certified(along, stop, loop):
    """To close a tick over the number loses more digits than to connect it with the number in its place, which tells."""
    tables = two_lines(*loop)
    found = wavesweep.compile(tables).stable_intervals(along, (0, stop))
    assert found["certified"].tolist() == [True]

    def radius(value):
        spec = wavesweep.compile(tables | {"numbers": tables["numbers"] | {along: value}}).spec
        z = np.linalg.eigvals(monodromy(spec.drawing, spec.values))
        return np.abs(z[np.abs(z - 1) > 1e-6]).max()

    end = found["high"][0]
    assert radius(end * (1 - 1e-6)) < 1 < radius(end * (1 + 1e-6))


@pytest.mark.parametrize("impedances", [(1.0, 1.0), (10.0, 3.0), (1e4, 1e-4), (1e8, 1e-6)])
def test_two_lines_in_a_row_have_the_end_of_one(impedances):
    """Four ports are torn: the terms of a product with the inverse of their equations cancel."""
    one = wavesweep.compile(line(1.0)).stable_intervals("B", (0, 1e4))
    spec = two_lines(*impedances, 1, "implicit", (500.0, 1.0), (0.1, 1.5))
    two = wavesweep.compile(spec).stable_intervals("B", (0, 1e4))
    known = max(impedances) <= 10
    np.testing.assert_allclose(two["high"], one["high"], rtol=1e-12 if known else 1e-15 * max(impedances))
    assert two["certified"].all() or not known


def test_an_end_at_0_is_exact_where_a_drift_begins_there():
    """What rounding of the notch leaves of a stiffness of 0 is more than the least end of such a range may be off."""
    notch = {"num": [1, "4*pi*6", "(2*pi*60)**2"], "den": [1, "4*pi*60", "(2*pi*60)**2"]}
    blocks = {name: {"type": "hold", "every": 32} for name in ("seen", "speed", "force")}
    spec = {
        "rates": {"tick_hz": 2000},
        "numbers": {"K": 10.0},
        "block": {
            "handle": {"type": "mass", "mass": 0.15, "damping": 0.8},
            "difference": {"type": "difference", "every": 2},
            "low": {"type": "butterworth", "order": 2, "cutoff_hz": 80, "every": 2},
            "notch": {"type": "tf"} | notch,
            **blocks | {"force": blocks["force"] | {"phase": 2}},
        },
        "wire": {
            "difference.u": "handle.x",
            "low.u": "difference.y",
            "seen.u": "handle.x",
            "speed.u": "low.y",
            "force.u": "K*seen.y + 2*speed.y",
            "notch.u": "force.y",
            "handle.f": "0.4*low.y - notch.y",
        },
    }
    below, at = (wavesweep.compile(spec).stable_intervals("K", (low, 3000)) for low in (-100, 0))
    assert at["certified"].all()
    assert below["certified"].all()
    assert below["low"].tolist() == [0.0]
    np.testing.assert_allclose(below["high"], at["high"], rtol=1e-9)
