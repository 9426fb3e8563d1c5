"""Plants that turn by whole circles, or by very many radians, within a tick or a frame: what is left has lost digits.

Nothing may be certified that those digits decide, and no bound of a response may be exceeded.
"""

import mpmath
import numpy as np
import pytest
from support import certified

import wavesweep
from wavesweep.spec import load

mp = mpmath.mp.clone()
mp.dps = 60
ALLOWED = 1e-9  # of an end, and of a hundred-thousandth of the range


def resonance(omega, zeta, every, wire):
    """An oscillator of unit gain whose output is held for so many ticks of 1 ms."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 1.0},
        "block": {
            "p": {"type": "tf", "num": [omega**2], "den": [1, 2 * zeta * omega, omega**2]},
            "h": {"type": "hold", "every": every},
        },
        "wire": {"h.u": "p.y", "p.u": wire},
    }


def exact_radius(omega, zeta, period, K):
    """Spectral radius of the oscillator with `u = K y`, held over the period, from its closed form."""
    omega, zeta, T = mp.mpf(omega), mp.mpf(zeta), mp.mpf(period)
    damped, decay = omega * mp.sqrt(1 - zeta**2), mp.exp(-zeta * omega * T)
    c, s = decay * mp.cos(damped * T), decay * mp.sin(damped * T)
    r = zeta * omega / damped
    A = mp.matrix([[c + r * s, s / damped], [-(omega**2) * s / damped, c - r * s]])
    B = mp.matrix([1 - A[0, 0], -A[1, 0]])
    trace = A[0, 0] + K * B[0] + A[1, 1]
    det = (A[0, 0] + K * B[0]) * A[1, 1] - A[0, 1] * (A[1, 0] + K * B[1])
    root = mp.sqrt(mp.mpc(trace**2 / 4 - det))
    return max(abs(trace / 2 + root), abs(trace / 2 - root))


@pytest.mark.sample(3)
@pytest.mark.parametrize("zeta", [1e-12, 1e-8, 1e-4, 1e-2])
@pytest.mark.parametrize("detuned", [0.0, 1e-6, -1e-4, 0.02])
@pytest.mark.parametrize(("every", "turns"), [(10, 1), (10, 3), (1, 1), (1, 200)])
def test_ends_are_right_or_in_doubt(zeta, detuned, every, turns):
    omega, period = 2 * np.pi * 1000 / every * turns * (1 + detuned), every * 1e-3
    span = (-1.5, 1.5)
    table = wavesweep.compile(resonance(omega, zeta, every, "K*h.y")).stable_intervals("K", span)
    assert table["certified"].all() or min(zeta, abs(detuned)) < 1e-3 or turns > 1
    if not table["certified"].all():
        return
    ends = [end for end in (*table["low"], *table["high"]) if np.isfinite(end) and end not in span]
    for end in ends:
        allowed = mp.mpf(ALLOWED * (abs(end) + 1e-5 * (span[1] - span[0])))
        sides = [exact_radius(omega, zeta, period, mp.mpf(end) + side * allowed) < 1 for side in (-1, 1)]
        assert sides[0] != sides[1], end


@pytest.mark.sample(2)
@pytest.mark.parametrize("wire", ["K*h.y + 0.3*K*p.y", "K*(1+K)*h.y"])
@pytest.mark.parametrize("every", [1, 5])
def test_along_panels_too(wire, every):
    """At z = 1 the loop of gain 1 has the limit K = 1/1.3, or the root of K (1 + K) = 1, whatever turns."""
    limit = 1 / 1.3 if "0.3" in wire else (np.sqrt(5) - 1) / 2
    for zeta in (1e-11, 1e-9, 1e-6, 1e-2):
        table = wavesweep.compile(resonance(2 * np.pi * 1000 / every, zeta, every, wire)).stable_intervals("K", (-2.0, 2.0))
        if table["certified"].all() and (table["intervals"] > 0).any():
            at_one = table.loc[table["high_omega"] == 0, "high"]
            np.testing.assert_allclose(at_one, limit, rtol=1e-9)


@pytest.mark.parametrize("zeta", [1e-9, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("detuned", [5e-6, -3e-4, 0.01])
def test_bounds_of_responses_know_what_a_turn_takes(zeta, detuned):
    """Against the closed form at 60 digits: a mass on a spring whose force is held for a tick in which it turns once."""
    mass, omega, T = 0.1, 2 * np.pi * 1000 * (1 + detuned), 1e-3
    frequencies = [0.005, 0.3, 40.0]
    found = wavesweep.bode(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"g": 0.02 * omega**2 * zeta},
            "block": {
                "p": {"type": "mass", "mass": mass, "damping": 2 * mass * zeta * omega, "stiffness": mass * omega**2},
                "h": {"type": "hold"},
            },
            "wire": {"h.u": "p.x", "p.f": "hand - g*h.y"},
            "ports": {"hand": {"force": "hand", "displacement": "p.x"}},
            "bode": {"frequency_hz": frequencies},
        }
    )
    if not found["stable"].all():
        return
    m, k = mp.mpf(mass), mp.mpf(mass * omega**2)
    a, w0 = mp.mpf(2 * mass * zeta * omega) / m / 2, mp.sqrt(k / m)
    wd = mp.sqrt(w0**2 - a**2)
    c, s = mp.exp(-a * T) * mp.cos(wd * T), mp.exp(-a * T) * mp.sin(wd * T)
    A = mp.matrix([[c + a / wd * s, s / wd], [-(w0**2) / wd * s, c - a / wd * s]])
    B = mp.matrix([(1 - A[0, 0]) / k, -A[1, 0] / k])
    closed = mp.matrix([[A[0, 0] - mp.mpf(0.02 * omega**2 * zeta) * B[0], A[0, 1]],
                        [A[1, 0] - mp.mpf(0.02 * omega**2 * zeta) * B[1], A[1, 1]]])  # fmt: skip
    for row, frequency in zip(found.itertuples(), frequencies, strict=True):
        if np.isnan(row.admittance_re):
            continue
        z = mp.expj(2 * mp.pi * mp.mpf(frequency) * T)
        x = mp.lu_solve(z * mp.eye(2) - closed, B)[0]
        off = abs((mp.mpc(row.admittance_re, row.admittance_im) - x) / x)
        assert off <= row.admittance_error + 1e-15


@pytest.mark.sample(3)
@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm"])
@pytest.mark.parametrize("along", ["device.damping", "device.mass"])
@pytest.mark.parametrize("detuned", [0.0016, -1e-4])
def test_a_built_in_device_on_a_spring_without_damping(kind, along, detuned):
    """A hand's spring, or the local model's, of nearly 50 Hz at a slow rate of 50 Hz; against ball arithmetic."""
    spring = 0.3 * (100 * np.pi * (1 + detuned)) ** 2
    part = {"local_model": {"K_LM": spring, "B_LM": 0.0}} if kind == "dc-lm" else {"operator": {"stiffness": spring}}
    values = {
        "controller": {"kind": kind},
        "device": {"mass": 0.3, "damping": 1e-6, "velocity": "exact"},
        "environment": {"K_VE": 0.025, "B_VE": 0.0, "integration": "implicit"},
        **part,
    }
    span = {"device.damping": (0.0, 0.1), "device.mass": (0.2997, 0.3003)}[along]
    table, known = wavesweep.compile(values).stable_intervals(along, span), dict(load(values).values)
    if not table["certified"].all():
        assert table["doubt"][0] in ("rounding", "counts", "search", "crowded")
        return
    for low, high, *omegas in table[["low", "high", "low_omega", "high_omega"]].itertuples(index=False):
        for end, omega, inward in ((low, omegas[0], 1), (high, omegas[1], -1)):
            if np.isfinite(omega) and span[0] < end < span[1]:
                allowed = 2 * ALLOWED * (end + 1e-5 * (span[1] - span[0]))
                inside, outside = (
                    certified.Witness(known | {along: end + side * inward * allowed}, (512, 1024)).unstable(0.025, 0.0)
                    for side in (1, -1)
                )
                assert inside == 0 < outside


STIFF = [  # damping, the hand's stiffness, range of K_VE, and the end in it by 120 digits
    (0.2, 394784174.88693726, 78956834977387.45, 62772161.131261867),
    (10.000000000000002, 39478417866.923805, 3.947841786692381e17, 59885981559937.453),
    (1.0, 394784178.66923803, 3947841786692380.0, 6283205149743.1921),
    (0.11000000000000001, 3947841.91634945, 434262610798.4395, 6911504333.7101312),
]


@pytest.mark.parametrize(("damping", "spring", "high", "right"), STIFF)
def test_a_built_in_wave_line_on_a_stiff_hand(damping, spring, high, right):
    """One rate, no filter, no Kp: the impedance cancels, and a device, its springs and a sum of velocities remain."""
    table = wavesweep.compile(
        {
            "rates": {"fast_hz": 1000.0, "ratio": 1},
            "device": {"mass": 0.1, "damping": damping},
            "operator": {"stiffness": spring},
            "environment": {"K_VE": 1.0, "B_VE": 0.0, "integration": "explicit"},
            "controller": {"kind": "pmw", "b": damping, "Kp": 0.0},
            "filters": {"lp1": {"order": 0, "cutoff_hz": 10.0}},
        }
    ).stable_intervals("K_VE", (0.0, high))
    assert not table["certified"].any() or table["high"].tolist() == [pytest.approx(right, rel=1e-9)]


def next_to_the_limit(kind, ratio, mass, damping, wall, **more):
    """A controller whose damping is next to `2 m/T`."""
    rates, device = {"fast_hz": 1000.0, "ratio": ratio}, {"mass": mass, "damping": damping}
    return {"controller": {"kind": kind}, "rates": rates, "device": device, "environment": wall} | more


NEARLY = [  # a spec, a number, its range, and an end in it, by 120 digits
    (
        next_to_the_limit(
            "dc-lm", 2, 0.01, 0.01, {"K_VE": 15.0, "B_VE": 0.0}, local_model={"K_LM": 0.0, "B_LM": 20 * (1 + 1e-8)}
        ),
        "K_LM", (0.0, 100.0), 17.599999979581935,
    ),
    (
        next_to_the_limit(
            "pmw", 20, 0.13461, 0.0, {"K_VE": 2.588908215046291e-05, "B_VE": 0.0, "integration": "explicit"},
            controller={"kind": "pmw", "b": 269.21706952841606, "Kp": 0.0}, filters={"lp1": {"order": 1, "cutoff_hz": 10.0}},
        ),
        "B_VE", (0.0, 0.007326178959902229), 1.44741565080876e-06,
    ),
]  # fmt: skip


@pytest.mark.parametrize(("spec", "along", "span", "right"), NEARLY, ids=["dc-lm", "pmw"])
def test_a_built_in_damper_that_nearly_turns_the_velocity_over(spec, along, span, right):
    """Next to `b = 2 m/T` a tick has an eigenvalue -1, and a frame of an even number of ticks nearly none of its digits."""
    table = wavesweep.compile(spec).stable_intervals(along, span)
    if table["certified"].all():
        ends = [end for end in (*table["low"], *table["high"]) if span[0] < end < span[1]]
        assert min(abs(end - right) for end in ends) <= ALLOWED * (right + 1e-5 * (span[1] - span[0]))


@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm"])
def test_a_mode_that_ends_a_frame_in_its_other_state_has_turned_too(kind):
    """326 circles and a quarter, at a quality of 6e7: the end was off by 1.5e-8, and certified."""
    omega = 2049.844051282051
    tables = {
        "controller": {"kind": kind},
        "rates": {"ratio": 1000},
        "device": {"mass": 1.0, "damping": 2 * 8.3e-9 * omega},
        "operator": {"stiffness": omega**2},
        "environment": {"B_VE": 0.0, "delay": 785},
        "local_model": {"K_LM": 0.0, "B_LM": 0.0},
    }
    found = wavesweep.compile(tables).stable_intervals("K_VE", (0, 0.01 * omega**2))
    assert found.doubt.tolist() == ["rounding"]


def test_a_drawn_mode_that_ends_a_frame_in_its_other_state_has_turned_too():
    omega, damping = 1800.980442280074, 4.152692319953543e-09
    blocks = {
        "p": {"type": "mass", "mass": 1.0, "damping": 2 * damping * omega, "stiffness": omega**2},
        "s": {"type": "hold", "every": 5000},
        "h": {"type": "hold", "every": 5000, "phase": 956},
    }
    wires = {"s.u": "c*p.x", "h.u": "s.y", "p.f": f"-{omega**2!r}*h.y"}
    tables = {"rates": {"tick_hz": 1000.0}, "numbers": {"c": 1.0}, "block": blocks, "wire": wires}
    assert wavesweep.compile(tables).stable_intervals("c", (0, 1)).doubt.tolist() == ["rounding"]
