"""Loops with dead times in seconds: exact for any fraction of a tick, against the documents and ticks that are finer."""

import numpy as np
import pytest
from meaning.judge import compiled, judge
from meaning.reading import radius_of, with_numbers
from meaning.specs import toml

import wavesweep
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
    rng = np.random.default_rng(seed + 50)
    q, order = int(rng.choice([3, 4, 5])), int(rng.integers(1, 4))
    act = int(rng.integers(1, 2 * q))
    spec = wavesweep.compile(drawn(order, False, q, act, None, seed)).spec
    from wavesweep.prove import prover

    found = prover.ball_prover(loops_of(spec, spec.values), "numbers.k", np.array([T]))(0, 1e-3, 1e4)
    fine = wavesweep.compile(drawn(order, True, q, act, None, seed))
    np.testing.assert_allclose([row[:2] for row in found], fine.stable_intervals()[["low", "high"]], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("along", "seed"), [("tau", 0), ("h", 9)])
def test_a_dead_time_and_the_tick_are_numbers_to_look_along(along, seed):
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 4))
    den = np.poly(-rng.uniform(5, 400, order)).tolist()
    own = {"h": float(rng.uniform(1e-3, 5e-3)), "tau": float(rng.uniform(0, 8e-3)), "k": float(rng.uniform(1, 8))}
    span = {"tau": (0.0, 12e-3), "h": (1e-3, 12e-3)}[along]
    spec = {
        "rates": {"tick_hz": "1/h"},
        "numbers": own,
        "block": {"p": {"type": "tf", "num": [den[-1]], "den": den}, "net": {"type": "delay", "seconds": "tau"}},
        "wire": {"net.u": "-k*p.y", "p.u": "net.y"} if seed % 2 else {"net.u": "p.y", "p.u": "-k*net.y"},
        "sweep": {along: dict(zip(("start", "stop"), span, strict=True))},
    }
    found = wavesweep.compile(spec).stable_intervals()
    assert found.certified.all()
    rows = found[found.intervals > 0]

    def at(p):
        return radius_of(with_numbers(spec, {along: float(p)}), 0)

    for end in {*rows.low, *rows.high} - {*span}:
        below, above = (at(end * (1 + step)) for step in (-1e-7, 1e-7))
        assert (below < 1) != (above < 1)
    grid = np.linspace(*span, 300)
    inside = ((grid[:, None] >= rows.low.to_numpy()) & (grid[:, None] <= rows.high.to_numpy())).any(1)
    truth = np.array(list(map(at, grid)))
    sure = np.abs(truth - 1) > 1e-6
    np.testing.assert_array_equal(inside[sure], (truth < 1)[sure])


@pytest.mark.parametrize("tau", [0.0, 0.0004, 0.00137, 0.002])
def test_dead_times_to_and_from_a_body_are_those_of_the_documents(tau, tmp_path):
    blocks = {
        "arm": {"type": "mass", "mass": 0.2, "damping": 0.1},
        "net": {"type": "delay", "seconds": "tau"},
        "sens": {"type": "delay", "seconds": "0.6*tau"},
        "vel": {"type": "difference"},
    }
    wires = {"sens.u": "arm.x", "vel.u": "sens.y", "net.u": "-kp*sens.y - kd*vel.y", "arm.f": "net.y + push"}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"kp": 300.0, "kd": 4.0, "tau": tau}, "block": blocks, "wire": wires}
    tables |= {"ports": {"hand": {"force": "push", "displacement": "arm.x"}}}
    text = toml(tables | {"sweep": {"along": "kp", "kp": {"start": 0, "stop": 1e4}}})
    found = judge(text, compiled(text, tmp_path), ticks=400, required=False)
    assert [one for one in found if not one.same] == []


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
