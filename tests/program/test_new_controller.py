"""The controller and the analysis of CONTRIBUTING, as a maintainer would add them: right, against a march of its own.

The slow wall's held force reaches the device through a first-order low-pass at the fast rate.
"""

import numpy as np
import pytest
from scipy.linalg import expm
from support.documents import code
from support.specs import nested, values_of

import wavesweep
from wavesweep.haptics.controller_page import wall_cut
from wavesweep.haptics.controllers import CONTROLLERS, Controller

KIND = "dc-filtered"


VALUES = values_of("dc-slow", ratio=8, delay=3, K_VE=120.0, B_VE=0.7, mass=0.12, damping=1.1, lp1_order=1, lp1_cutoff_hz=25.0)
FREE, HELD = VALUES, VALUES | {"operator.stiffness": 300.0, "operator.mass": 0.05}


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The line of the registry."""
    description = "direct coupling to the slow wall, whose held force is smoothed"
    monkeypatch.setitem(CONTROLLERS, KIND, Controller(description, code("Add a controller")["dc_smooth"]))


def compiled(values):
    """The loop of the new kind."""
    return wavesweep.compile(nested(values | {"controller.kind": KIND}))


def frame(values, state, K, B, force):
    """March a frame: states (x, v, the filter's u and y before, held force); the state after it, positions and forces."""
    T, ratio, delay = 1 / values["rates.fast_hz"], values["rates.ratio"], values["environment.delay"]
    m, d, k = (
        values[f"device.{n}"] + values[f"operator.{n}"] if n != "stiffness" else values["operator.stiffness"]
        for n in ("mass", "damping", "stiffness")
    )
    step = expm(T * np.array([[0, 1, 0], [-k / m, -d / m, 1 / m], [0, 0, 0]]))
    w = np.tan(np.pi * values["filters.lp1.cutoff_hz"] * T)
    x, v, u_before, y_before, old = state
    new, xs, fs = K * x + B * v, [], []
    for i in range(ratio):
        u = new if i >= delay else old
        y = (w * (u + u_before) - (w - 1) * y_before) / (w + 1)
        xs.append(x)
        fs.append(y)
        x, v, _ = step @ np.array([x, v, force[i] - y])
        u_before, y_before = u, y
    return np.array([x, v, u_before, y_before, new]), np.array(xs), np.array(fs)


def monodromy(values, K, B):
    """The frame-to-frame matrix, column by column."""
    still = np.zeros(values["rates.ratio"])
    return np.stack([frame(values, unit, K, B, still)[0] for unit in np.eye(5)], axis=-1)


def radius(values, K, B):
    """Its largest eigenvalue."""
    return np.abs(np.linalg.eigvals(monodromy(values, K, B))).max()


@pytest.mark.parametrize("values", [FREE, HELD])
def test_intervals_are_stable_inside_and_unstable_outside(values):
    loop = compiled(values)
    for along, span, wall in (("K_VE", (0, 20000), lambda p: (p, 0.7)), ("B_VE", (0, 50), lambda p: (120.0, p))):
        found = loop.stable_intervals(along=along, span=span)
        assert found.certified.all()
        assert len(found) == 1
        end = found.high[0]
        assert radius(values, *wall(end * (1 - 1e-6))) < 1 < radius(values, *wall(end * (1 + 1e-6)))
    assert loop.spectral_radius() == pytest.approx(radius(values, 120.0, 0.7), rel=1e-10)
    damped = loop.stable_intervals(along="device.damping", span=(0.01, 20))
    assert damped.certified.all()
    for row in damped.itertuples():
        middle = values | {"device.damping": (row.low + row.high) / 2}
        assert radius(middle, 120.0, 0.7) < 1


@pytest.mark.parametrize("values", [FREE, HELD])
def test_the_response_is_that_of_the_march(values):
    K, B = (30.0, 0.7) if values is FREE else (120.0, 0.7)
    loop = compiled(values | {"environment.K_VE": K})
    ratio, A = values["rates.ratio"], monodromy(values, K, B)
    found = loop.response([0.5, 5.0, 40.0, 124.9])
    assert found.stable.all()
    for row in found.itertuples():
        turn = np.exp(2j * np.pi * row.frequency_hz / values["rates.fast_hz"] * np.arange(ratio + 1))
        parts = [frame(values, np.zeros(5), K, B, part[:-1]) for part in (turn.real, turn.imag)]
        start = np.linalg.solve(turn[-1] * np.eye(5) - A, parts[0][0] + 1j * parts[1][0])
        still = np.zeros(ratio)
        free = [frame(values, part, K, B, still) for part in (start.real, start.imag)]
        x, f = (np.mean((parts[0][i] + 1j * parts[1][i] + free[0][i] + 1j * free[1][i]) / turn[:-1]) for i in (1, 2))
        assert complex(row.admittance_re, row.admittance_im) == pytest.approx(x, rel=1e-8)
        assert complex(row.impedance_re, row.impedance_im) == pytest.approx(f / x, rel=1e-8)


@pytest.mark.whole
def test_passivity_and_the_verdict_on_hands_ask_the_drawing():
    """Without waves there is no channel; the port's margin is what a scan of the lifted map has, from the same march."""
    loop = compiled(HELD)
    table = loop.passivity()
    assert table.channel_passive.all()
    assert table.channel_norm.isna().all()
    ratio, A = HELD["rates.ratio"], monodromy(HELD, 120.0, 0.7)
    force = [frame(HELD, np.zeros(5), 120.0, 0.7, unit) for unit in np.eye(ratio)]
    G = np.stack([state for state, _, _ in force], axis=-1)
    T = np.stack([np.append(xs[1:], state[0]) - xs for state, xs, _ in force], axis=-1)
    still = np.zeros(ratio)
    free = [frame(HELD, unit, 120.0, 0.7, still) for unit in np.eye(5)]
    O = np.stack([np.append(xs[1:], state[0]) - xs for state, xs, _ in free], axis=-1)
    lowest = []
    for theta in np.linspace(1e-4, np.pi, 4000):
        H = T + O @ np.linalg.solve(np.exp(1j * theta) * np.eye(5) - A, G)
        lowest.append(np.linalg.eigvalsh(H + H.conj().T)[0] / 2)
    assert table.port_margin[0] == pytest.approx(min(lowest), rel=1e-4)
    assert wavesweep.compile(nested(HELD | {"controller.kind": KIND})).to_control().ninputs == ratio


def test_the_analysis_of_the_document_is_how_fast_the_loop_dies_away():
    """Over a batch of walls; NaN where the loop is unstable."""
    stiffness = np.array([30.0, 120.0, 5000.0])
    found = code("Add an analysis")["time_constant"](wall_cut(VALUES | {"controller.kind": KIND}), stiffness, 0.7)
    sizes = [radius(VALUES, K, 0.7) for K in stiffness]
    expected = [-8e-3 / np.log(size) if size < 1 else np.nan for size in sizes]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert np.isnan(expected[-1])
