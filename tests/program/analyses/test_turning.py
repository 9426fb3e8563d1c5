"""Plants that turn by whole circles, or by very many radians, within a tick or a frame: what is left has lost digits.

Nothing may be certified that those digits decide, and no bound of a response may be exceeded.
"""

import mpmath
import numpy as np
import pytest

import wavesweep

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


@pytest.mark.parametrize(
    ("zeta", "detuned", "every", "turns"), [(1e-12, 0.0, 10, 1), (1e-8, -1e-4, 10, 3), (1e-4, 1e-6, 1, 1), (1e-2, 0.02, 1, 200)]
)
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


@pytest.mark.slow
@pytest.mark.parametrize(("every", "wire"), [(1, "K*h.y + 0.3*K*p.y"), (5, "K*(1+K)*h.y")])
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
