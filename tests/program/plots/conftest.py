"""Tables made by hand for the figures."""

import numpy as np
import pytest


def table_of_intervals(axes, along, rows):
    """Rows are (axis values, [(low, high, low_omega, high_omega, certified), ...])."""
    flat = []
    for place, found in rows:
        listed = found or [(np.nan, np.nan, np.nan, np.nan, True)]
        flat += [
            (*place, along, len(found), number, *interval, 1e-14, "" if interval[-1] else "rounding", *interval[:2])
            for number, interval in enumerate(listed)
        ]
    names = [
        *axes,
        "along",
        "intervals",
        "interval",
        "low",
        "high",
        "low_omega",
        "high_omega",
        "certified",
        "residual",
        "doubt",
        "felt_low",
        "felt_high",
    ]
    columns = {name: np.array(values) for name, values in zip(names, zip(*flat, strict=True), strict=True)}
    kinds = {"along": object, "certified": bool, "doubt": object}
    return columns | {name: columns[name].astype(kind) for name, kind in kinds.items()}


def with_a_hole(damping, b):
    """A straight line to 2200 N/m, and an island above it for small damping, the island not certified."""
    first = (0.0, 700 + 10 * b + 100 * damping, np.nan, 40.0, True)
    if damping > 6:
        return [first]
    return [first, (2500 + 200 * damping + 10 * b, 4400 - 100 * damping + 10 * b, 60.0, 157.0, damping < 4)]


@pytest.fixture
def plane():
    """The (K_VE, B_VE) plane of one design."""
    return table_of_intervals(["B_VE"], "K_VE", [((d,), with_a_hole(d, 10)) for d in np.linspace(0, 15, 61)])


@pytest.fixture
def family():
    """The same for four values of b."""
    places = [(d, b) for b in (20, 40, 60, 80) for d in np.linspace(0, 15, 61)]
    return table_of_intervals(["B_VE", "b"], "K_VE", [((d, b), with_a_hole(d, b)) for d, b in places])


@pytest.fixture
def panels():
    """The same for twelve values of b and eleven of K_LM, one of them without anything stable."""
    stiffnesses = np.arange(0, 1100, 100.0)
    places = [(d, b, k) for b in np.linspace(20, 130, 12) for k in stiffnesses for d in np.linspace(0, 15, 16)]
    return table_of_intervals(
        ["B_VE", "b", "K_LM"], "K_VE", [((d, b, k), [] if k == 0 else with_a_hole(d, b + k / 10)) for d, b, k in places]
    )


@pytest.fixture
def bars():
    """Five values of b and no plane; one has nothing stable, the last one ends with the swept range."""
    rows = [((1.0, b), with_a_hole(3 + b / 50, b)) for b in (20, 40, 60)]
    last = ((1.0, 100.0), [(0.0, 5000.0, np.nan, np.nan, True)])
    return table_of_intervals(["B_VE", "b"], "K_VE", [*rows, ((1.0, 80.0), []), last])


@pytest.fixture
def responses():
    """A family of four low-pass responses with a delay, the ideal repeated over it, and an unstable one."""
    parts = [_response("pmw-20hz", "pmw", b, 0.02, 2.5 / b) for b in (20, 40, 60, 80)]
    parts += [_response("direct", "dc", b, 0.0, 0.01) for b in (20, 40, 60, 80)]
    parts += [_response("slow", "dc-slow", b, 0.04, 0.01, stable=False) for b in (20, 40, 60, 80)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _response(spec, controller, b, delay, lag, stable=True):
    frequency = np.geomspace(0.1, 50, 400)
    s = 2j * np.pi * frequency
    admittance = (1 / 500 + lag / 20 * np.exp(-delay * s)) / (1 + lag * s) / (1 + 0.003 * s)
    parts = {}
    for name, value in (("admittance", admittance), ("impedance", np.exp(-2 * delay * s) / admittance)):
        parts |= {f"{name}_re": value.real, f"{name}_im": value.imag, f"{name}_abs": abs(value)}
        parts[f"{name}_deg"] = np.degrees(np.angle(value))
    constant = {"b": float(b), "spec": spec, "controller": controller, "stable": stable, "doubt": "" if stable else "unstable"}
    types = {"b": float, "stable": bool}
    columns = {name: np.full(len(s), value, dtype=types.get(name, object)) for name, value in constant.items()}
    omega = 2 * np.pi * frequency * 0.02
    order = ["b", "spec", "controller", "frequency_hz", "omega_Ts", *parts, "worst_gain", "stable"]
    order += [*(errors := [f"{name}_error" for name in ("admittance", "impedance", "worst_gain")]), "doubt"]
    columns |= dict.fromkeys(errors, np.full(len(s), 1e-13))
    columns |= {"frequency_hz": frequency, "omega_Ts": omega, "worst_gain": abs(admittance), **parts}
    return {name: columns[name] for name in order}
