"""Loops with dead times in seconds: exact for any fraction of a tick."""

import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import loops_of

T = 1e-3


def drawn(order, fine, q, act, sensor, seed):
    """A loop with delays of `act` and `sensor` q-ths of a tick; fine: drawn with a tick that is q times as short."""
    rng = np.random.default_rng(seed)
    den = np.poly(-rng.uniform(5, 400, order)).tolist()
    every = q if fine else 1
    blocks = {
        "p": {"type": "tf", "num": [den[-1] * rng.uniform(0.3, 2)], "den": den},
        "c": {"type": "pi", "kp": "k", "ki": 20.0, "every": every},
    }
    wires = {"p.u": "c.y", "c.u": "-p.y"}
    for name, of, read, port in (("act", act, "c.y", "p.u"), ("sens", sensor, "-p.y", "c.u")):
        if of is not None:
            blocks[name] = {"type": "delay"} | ({"steps": of} if fine else {"seconds": of * T / q})
            wires |= {f"{name}.u": read, port: f"{name}.y"}
    rates = {"tick_hz": every / T}
    return {"rates": rates, "numbers": {"k": 1.0}, "block": blocks, "wire": wires, "sweep": {"k": {"start": 1e-3, "stop": 1e4}}}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 200, 20))
def test_intervals_are_those_of_a_tick_of_which_the_dead_times_are_multiples(seed):
    rng = np.random.default_rng(seed)
    q, order = int(rng.choice([3, 4, 5, 10])), int(rng.integers(1, 4))
    act, sensor = ((int(rng.integers(0, 3 * q)) if read else None) for read in ((1, 0), (0, 1), (1, 1))[seed // 20 % 3])
    found, fine = (wavesweep.compile(drawn(order, each, q, act, sensor, seed)).stable_intervals() for each in (False, True))
    assert found.certified.all()
    np.testing.assert_allclose(found[["low", "high"]], fine[["low", "high"]], rtol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_balls_prove_loops_with_dead_times(seed):
    """Ends against the eigenvalues of the same loop at a tick of which its dead time is a multiple."""
    rng = np.random.default_rng(seed + 50)
    q, order = int(rng.choice([3, 4, 5])), int(rng.integers(1, 4))
    act = int(rng.integers(1, 2 * q))
    spec = wavesweep.compile(drawn(order, False, q, act, None, seed)).spec
    from wavesweep.prove import prover

    found = prover.ball_prover(loops_of(spec, spec.values), "numbers.k", np.array([T]))(0, 1e-3, 1e4)
    fine = wavesweep.compile(drawn(order, True, q, act, None, seed))
    ends = [end for row in found for end in row[:2] if 1e-3 < end < 1e4]
    for low, high, *_ in found:
        assert fine.spectral_radius(k=[low + (high - low) * share for share in (1e-6, 0.5, 1 - 1e-6)]).max() < 1
    for end in ends:
        assert fine.spectral_radius(k=[end]) == pytest.approx(1, abs=1e-9)


def held_over(A, B, t):
    """What a time does to states, and to them from inputs that are held."""
    whole = expm(np.block([[A, B], [np.zeros((B.shape[1], len(A) + B.shape[1]))]]) * t)
    return whole[: len(A), : len(A)], whole[: len(A), len(A) :]


def radius(A, B, C, k, h, tau):
    """The spectral radius of `u = -k y` of every h seconds, which acts on the plant tau later."""
    m = int(np.ceil(tau / h * (1 - 1e-12)))
    n, left = len(A), m * h - tau
    F = np.zeros((n + m, n + m))
    (F[:n, :n], whole), (_, late), unit = held_over(A, B, h), held_over(A, B, left), np.eye(n + m)
    u = np.append(-k * C, np.zeros(m))
    old, new = (unit[n + m - 1], u if m == 1 else unit[n + m - 2]) if m else (u, u)
    F[:n] += np.outer(whole, old) + np.outer(late, new - old)
    F[n : n + 1] = u
    F[n + 1 :, n : n + m - 1] = np.eye(max(0, m - 1))
    return np.abs(np.linalg.eigvals(F)).max()


@pytest.mark.slow
@pytest.mark.parametrize(("along", "seed"), [("tau", 0), ("h", 9)])
def test_a_dead_time_and_the_tick_are_numbers_to_look_along(along, seed):
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 4))
    den = np.poly(-rng.uniform(5, 400, order))
    A, B, C = np.vstack([-den[None, 1:], np.eye(order)[:-1]]), np.eye(order)[:, :1], np.eye(order)[-1] * den[-1]
    own = {"h": float(rng.uniform(1e-3, 5e-3)), "tau": float(rng.uniform(0, 8e-3)), "k": float(rng.uniform(1, 8))}
    span = {"tau": (0.0, 12e-3), "h": (1e-3, 12e-3)}[along]
    spec = {
        "rates": {"tick_hz": "1/h"},
        "numbers": own,
        "block": {"p": {"type": "tf", "num": [den[-1]], "den": den.tolist()}, "net": {"type": "delay", "seconds": "tau"}},
        "wire": {"net.u": "-k*p.y", "p.u": "net.y"} if seed % 2 else {"net.u": "p.y", "p.u": "-k*net.y"},
        "sweep": {along: dict(zip(("start", "stop"), span, strict=True))},
    }
    found = wavesweep.compile(spec).stable_intervals()
    assert found.certified.all()
    rows = found[found.intervals > 0]

    def at(p):
        return radius(A, B, C, **(own | {along: p}))

    for end in {*rows.low, *rows.high} - {*span}:
        below, above = (at(end * (1 + step)) for step in (-1e-7, 1e-7))
        assert (below < 1) != (above < 1)
    grid = np.linspace(*span, 300)
    inside = ((grid[:, None] >= rows.low.to_numpy()) & (grid[:, None] <= rows.high.to_numpy())).any(1)
    truth = np.array(list(map(at, grid)))
    sure = np.abs(truth - 1) > 1e-6
    np.testing.assert_array_equal(inside[sure], (truth < 1)[sure])


ARM = {
    "rates": {"tick_hz": 1000},
    "numbers": {"kp": 300.0, "kd": 4.0, "tau": 0.00137},
    "block": {
        "arm": {"type": "mass", "mass": 0.2, "damping": 0.1},
        "net": {"type": "delay", "seconds": "tau"},
        "sens": {"type": "delay", "seconds": "0.6*tau"},
        "vel": {"type": "difference"},
    },
    "wire": {"sens.u": "arm.x", "vel.u": "sens.y", "net.u": "-kp*sens.y - kd*vel.y", "arm.f": "net.y + hand"},
    "ports": {"hand": {"force": "hand", "displacement": "arm.x"}},
}


@pytest.mark.parametrize("tau", [0.0, 0.0004, 0.00137, 0.002])
def test_a_simulation_goes_from_instant_to_instant_of_a_tick(tau):
    """Two programs, which share no discretisation."""
    spec = load(ARM).with_values({"numbers.tau": tau})
    force = np.random.default_rng(0).normal(size=400)
    (each,) = (ticks := Ticks.of(Loops(spec.drawing, spec.values).drawn(), ("ports.hand.displacement",))).maps
    x, expected = np.zeros(len(ticks.states)), []
    for f in force:
        expected.append(each.C[0] @ x)
        x = x + each.E @ x + each.B[:, 0] * f
    seen = wavesweep.compile(ARM).with_(tau=tau).simulate(force)
    np.testing.assert_allclose(seen.x, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("read", [{"seconds": 0.002}, {"steps": 2}])
def test_a_dead_time_goes_past_a_tick_beside_another_of_whole_ticks(read):
    """An integrator of gain 420 per s: `p[k+1] = p[k] - 0.42 ((1 - s) p[k-2-m] + s p[k-3-m])` behind 2 + m + s ticks."""
    blocks = {
        "p": {"type": "tf", "num": [1], "den": [1, 0]},
        "read": {"type": "delay"} | read,
        "h": {"type": "hold"},
        "act": {"type": "delay", "seconds": "a"},
    }
    wires = {"read.u": "p.y", "h.u": "read.y", "act.u": "-420*h.y", "p.u": "act.y"}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"a": 2e-4}, "block": blocks, "wire": wires}
    (row,) = wavesweep.compile(tables).stable_intervals("a", (0.0, 1.5e-3)).itertuples()
    assert row.certified
    assert row.low == 0
    m, s = divmod(row.high / T, 1)
    polynomial = np.zeros(int(m) + 5)
    polynomial[:2], polynomial[-2:] = (1, -1), (0.42 * (1 - s), 0.42 * s)
    assert np.abs(np.roots(polynomial)).max() == pytest.approx(1, abs=1e-9)


def test_a_delay_line_beside_a_dead_time_and_a_lag_is_one_interval():
    """The law of the last 20 samples and a dead time of 22.5 samples share their history, which is forgotten all at once."""
    blocks = {
        "dead": {"type": "delay", "seconds": 22.5},
        "plant": {"type": "tf", "num": ["g"], "den": [10, 1]},
        "past": {"type": "delay", "steps": 20},
        "law": {"type": "hold"},
    }
    wires = {"law.u": "-0.2*plant.y + 0.5*past.y", "past.u": "law.y", "dead.u": "law.y", "plant.u": "dead.y"}
    loop = wavesweep.compile({"rates": {"tick_hz": 1}, "numbers": {"g": 1.0}, "block": blocks, "wire": wires})
    (row,) = loop.stable_intervals("g", (0.01, 10.0)).itertuples()
    assert row.certified
    assert row.low == 0.01
    lag, half = np.exp(-0.1), np.exp(-0.05)
    # With z to the power 23 and 43: (z - lag) z^23 (z^20 - 0.5)/z^20 + 0.2 g ((1 - half) z + half - lag) = 0.
    polynomial = np.convolve([1, -lag], np.eye(1, 44, 0)[0] - 0.5 * np.eye(1, 44, 20)[0])
    polynomial[23:25] += 0.2 * row.high * np.array([1 - half, half - lag])
    assert np.abs(np.roots(polynomial)).max() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("digits", [12, 13, 15])
@pytest.mark.parametrize("tick_hz", [60, 90, 7])
def test_a_dead_time_of_a_tick_in_twelve_digits_is_a_tick(tick_hz, digits):
    """1/60 s is 0.0166666666667 s as people write it."""
    tables = {
        "rates": {"tick_hz": tick_hz},
        "numbers": {"k": 5.0},
        "block": {"m": {"type": "mass", "mass": 0.5, "damping": 2.0}},
        "wire": {"late.u": "k*m.x", "m.f": "-late.y"},
        "sweep": {"along": "k", "k": {"start": 0, "stop": 1000}},
    }

    def late(seconds):
        block = tables["block"] | {"late": {"type": "delay", "seconds": seconds}}
        return wavesweep.compile(tables | {"block": block})

    written, exact = late(float(f"{1 / tick_hz:.{digits}g}")), late(1 / tick_hz)
    assert written.poles().shape == exact.poles().shape
    assert written.stable_intervals().high.iloc[0] == pytest.approx(exact.stable_intervals().high.iloc[0], rel=1e-10)
