"""White noise while frames, or messages, are at random: against chains of own matrices."""

import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from tests.for_all.marches import ticked
from wavesweep.check.verdict import verdict
from wavesweep.for_all.noise import claims
from wavesweep.for_all.varying import Rules
from wavesweep.program.spec import load

M, D, T = 2.0, 0.5, 0.01
KP, KD = 90.0, 12.0


def network(**changes):
    """A mass with a PD law of which every second tick's message may be lost, in bursts."""
    numbers = {"kp": KP, "loss": 0.1, "burst": 0.2, "burst_end": 0.4, "burst_loss": 0.9}
    return {
        "rates": {"tick_hz": 1 / T},
        "numbers": numbers | changes,
        "block": {
            "plant": {"type": "mass", "mass": M, "damping": D},
            "net": {
                "type": "channel",
                "every": 2,
                **{name: name for name in ("loss", "burst", "burst_end", "burst_loss")},
            },
        },
        "wire": {
            "net.u": f"-kp*(plant.x + noise) - {KD}*plant.v",
            "plant.f": "net.y + push",
        },
        "ports": {
            "inputs": {"push": "push", "noise": "noise"},
            "outputs": {"place": "plant.x", "force": "net.y"},
        },
        "sweep": {"along": "kp", "kp": {"start": 1, "stop": 3000}},
    }


def held(period=T):
    """The mass over a tick with a held force: of (x, v)."""
    A = np.array([[0, 1, 0], [0, -D / M, 1 / M], [0, 0, 0]])
    whole = expm(A * period)
    return whole[:2, :2], whole[:2, 2:]


def ticks_of_network(kp, read, push, noise):
    """The tick from (x, v, y) on: what is sent, or kept, and then held; and what noise of 1 adds."""
    A, b = held()
    y = np.array([[-kp, -KD, 0.0]]) if read else np.array([[0.0, 0.0, 1.0]])
    y_noise = -kp * noise * read
    E = np.vstack([np.hstack([A, np.zeros((2, 1))]) + b @ y, y])
    return E, np.vstack([b * (y_noise + push), [[y_noise]]]), y, y_noise


def rms_of_network(route, kp=KP, loss=0.1, burst=0.2, burst_end=0.4, burst_loss=0.9):
    """By full Kronecker products, burst by burst, tick by tick."""
    source, signal = route
    push, noise = float(source == "push"), float(source == "noise")
    share = np.array([burst_end, burst]) / (burst + burst_end)
    L = np.zeros((18, 18))
    w = np.zeros(18)
    seen = np.zeros(18)
    direct = 0.0
    for before in (0, 1):
        for after in (0, 1):
            change = (burst, burst_end)[before]
            of_burst = change if before != after else 1 - change
            lost = (loss, burst_loss)[after]
            for read, chance in ((False, lost), (True, 1 - lost)):
                p = of_burst * chance
                A, W = np.eye(3), np.zeros((3, 3))
                rows = slice(9 * before, 9 * before + 9)
                for of_tick in (read, False):
                    E, G, y, y_noise = ticks_of_network(kp, of_tick, push, noise)
                    c = np.array([[1.0, 0, 0]]) if signal == "place" else y
                    seen[rows] += p * (A.T @ c.T @ c @ A).ravel() / 2
                    direct += p * share[before] * (c @ W @ c.T).item() / 2
                    direct += p * share[before] * (signal == "force") * y_noise**2 / 2
                    A, W = E @ A, E @ W @ E.T + G @ G.T
                to = slice(9 * after, 9 * after + 9)
                L[to, rows] += p * np.kron(A, A)
                w[to] += p * share[before] * W.ravel()
    if np.abs(np.linalg.eigvals(L)).max() >= 1:
        return np.inf
    return np.sqrt(seen @ np.linalg.solve(np.eye(18) - L, w) + direct)


def noise_of(tables):
    """What check says of noise, by input and output."""
    return {(row["from"], row["to"]): row["rms"] for row in verdict(load(tables))["rms"]}


@pytest.mark.slow
def test_noise_while_bursts_lose_messages_has_the_moments_of_full_kronecker_products():
    found = noise_of(network())
    assert len(found) == 4
    for route, rms in found.items():
        assert rms == pytest.approx(rms_of_network(route), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "span"), [("kp", (1, 3000)), ("loss", (0, 0.6))])
def test_intervals_of_a_root_mean_square_end_where_that_of_the_products_is_the_level(number, span):
    route = ("push", "place")
    tables = network()
    own = rms_of_network(route)
    level = 1.2 * own if number == "loss" else 1.1 * rms_of_network(route, kp=40.0)
    tables["sweep"] = {
        "along": number,
        number: {"start": span[0], "stop": span[1]},
        "require": {"rms": {"from": route[0], "to": route[1], "at_most": level}},
    }
    rows = wavesweep.stability_region(tables).query("guarantee == 'mean_square'")
    ends = []
    for row in rows.itertuples():
        assert row.certified
        assert row.argument == "sampled"
        ends += [(row.low, row.fails_below), (row.high, row.fails_from)]
    beyond = [(end, refuted) for end, refuted in ends if not np.isnan(refuted)]
    assert beyond
    for end, refuted in beyond:
        assert rms_of_network(route, **{number: end}) < level < rms_of_network(route, **{number: refuted})
        assert end == pytest.approx(refuted, rel=1e-6)
    inside = np.linspace(*span, 60)
    for x in inside:
        is_small = rms_of_network(route, **{number: x}) <= level
        assert is_small == any(row.low <= x <= row.high for row in rows.itertuples())


def test_noise_in_frames_at_random_has_the_moments_of_an_integrator():
    """`x' = -k s + push`, s sampled with noise once in a frame: of (x), whose frames of n ticks have the
    probabilities of those of the frame after."""
    lengths, chain, k, T = [2, 5], np.array([[0.2, 0.8], [0.6, 0.4]]), 20.0, 0.01
    tables = {
        "rates": {"tick_hz": 100.0},
        "numbers": {"k": k, "n": 2},
        "block": {"plant": {"type": "integrator"}, "slow": {"type": "hold", "every": "n"}},
        "wire": {"plant.u": "push - k*slow.y", "slow.u": "plant.y + noise"},
        "ports": {"inputs": {"push": "push", "noise": "noise"}, "outputs": {"x": "plant.y"}},
        "for_all": {"n": {"values": lengths, "varying": True, "next": chain.tolist()}},
    }
    share = np.array([0.6, 0.8]) / 1.4
    n = np.array(lengths)
    found = noise_of(tables)
    for source, push, noise in (("push", 1.0, 0.0), ("noise", 0.0, 1.0)):
        # Each frame multiplies x by 1 - k n T; noise of its ticks and of its sample is added.
        added = share * (n * (T * push) ** 2 + (k * n * T * noise) ** 2)
        A = (1 - k * n * T) ** 2
        # X_i: of x at the beginning of a frame of length i
        X = np.linalg.solve(np.eye(2) - chain.T * A, chain.T @ added)
        seen = 0.0
        for i, length in enumerate(lengths):
            for tick in range(length):
                seen += (1 - k * tick * T) ** 2 * X[i]
                seen += share[i] * (tick * (T * push) ** 2 + (k * tick * T * noise) ** 2)
        assert found[source, "x"] == pytest.approx(np.sqrt(seen / (share @ n)), rel=1e-9)


@pytest.mark.slow
def test_noise_of_lost_results_of_a_wall_has_the_mean_square_of_a_march():
    """Direct coupling with losses and late results, 400,000 frames of its own equations."""
    K, lengths, shares, loss = 60.0, [8, 12], np.array([0.7, 0.3]), 0.2
    tables = {
        "environment": {"integration": "explicit", "delay": 3, "K_VE": K, "B_VE": 1.0},
        "device": {"velocity": "difference"},
        "controller": {"kind": "dc-slow"},
        "for_all": {
            "rates.ratio": {"values": lengths, "varying": True, "shares": [7, 3]},
            "loss": loss,
        },
        "sweep": {
            "along": "K_VE",
            "K_VE": {"start": 10, "stop": 200},
            "require": {"rms": {"from": "f_h", "to": "v", "at_most": 0.02}},
        },
    }
    spec = load(tables)
    (claim,) = claims(spec, Rules.of(spec), "proved")
    low = float(claim.reason) if claim.reason else 0.0
    free, forced = ticked()
    rng = np.random.default_rng(1)
    runs, total, count = 4000, 0.0, 0
    v = x = last = held = np.zeros(runs)
    for frame in range(120):
        length = rng.choice(lengths, p=shares)
        lost = rng.random(runs) < loss
        result = K * x + (x - last) / 1e-3
        for tick in range(length):
            held = np.where(lost, held, result) if tick == 3 else held
            total += (v**2).sum() * (frame >= 20)
            count += runs * (frame >= 20)
            f = rng.standard_normal(runs) - held
            last = x
            v, x = free[0] * v + forced[0] * f, x + free[1] * v + forced[1] * f
    assert np.sqrt(total / count) == pytest.approx(low, rel=2e-2)
