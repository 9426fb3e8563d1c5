"""Frames of random lengths in mean square: closed forms, and loops that are marched tick by tick from their equations alone.

The marches begin a frame with its sample, so that the step of the wall is the length of the frame before, and the moments are
kept for each such length: another form than that of the package, whose frames end with their sample.
"""

from itertools import product

import numpy as np
import pytest

import wavesweep
from tests.for_all.marches import T, dc_slow, matrix_of, pmw, ticked
from wavesweep.engine._switched.mean_square import brackets_on_average, decays, grows_everywhere
from wavesweep.engine._switched.patterns import growth
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.for_all.rows import intervals_for_all
from wavesweep.for_all.varying import Rules
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import loops_of

LENGTHS, SHARES = [16, 20, 25, 33], [254, 588, 109, 49]
CHAIN = [[70, 24, 4, 2], [12, 80, 6, 2], [5, 35, 45, 15], [5, 45, 30, 20]]


def integrator(lengths, **chances):
    """`x' = -k x`, sampled once in a frame and held: a frame of n ticks multiplies x by `1 - k n T`."""
    return {
        "rates": {"tick_hz": 100.0},
        "numbers": {"k": 1.0, "n": lengths[0]},
        "block": {"plant": {"type": "integrator"}, "slow": {"type": "hold", "every": "n"}},
        "wire": {"plant.u": "-k*slow.y", "slow.u": "plant.y"},
        "for_all": {"n": {"values": lengths, "varying": True, **chances}},
        "sweep": {"along": "k", "k": {"start": 0, "stop": 100}},
    }


def built_in(kind, lengths, number="K_VE", **chances):
    spec = {
        "environment": {"integration": "explicit", "delay": 1},
        "device": {"velocity": "difference"},
        "controller": {"kind": kind, "b": 10.0} if kind == "pmw" else {"kind": kind},
        "for_all": {"rates.ratio": {"values": lengths, "varying": True, **chances}},
        "sweep": {number: {"start": 0, "stop": 2000}},
    }
    return spec | ({"filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}}} if kind == "pmw" else {})


def rows_of(shares):
    return [shares] if np.ndim(shares) == 1 else shares


def radius(frame, lengths, shares, results=((1, 1.0),)):
    """The spectral radius of the second moments, kept for each length of the last frame.

    frame: the matrix of a frame of some length after another one, with a result of some delay. results: the delays, None of
    one that is lost, each with its probability, or of frames of each length its probabilities.
    """
    rows = np.array([np.array(row) / sum(row) for row in rows_of(shares)])
    rows = rows if len(rows) > 1 else np.tile(rows, (len(lengths), 1))
    n = len(frame(lengths[0], lengths[0], results[0][0])) ** 2
    whole = np.zeros((len(lengths), n, len(lengths), n))
    for (i, before), (j, length) in product(enumerate(lengths), enumerate(lengths)):
        for delay, chance in results:
            A = frame(length, before, delay)
            whole[j, :, i] += rows[i, j] * np.resize(chance, len(lengths))[j] * np.kron(A, A)
    return np.abs(np.linalg.eigvals(whole.reshape(len(lengths) * n, -1))).max()


def found_of(spec, along, high=2000.0):
    loaded = load(spec)
    rules = Rules.of(loaded)
    return brackets_on_average((rules.on_average() or rules).family(dict(loaded.values), along), (0.0, high))


@pytest.mark.parametrize("lengths", [[1, 2]])
def test_independent_frames_of_an_integrator_have_the_first_two_moments_of_the_length(lengths):
    """`E (1 - k n T)^2 < 1` if and only if `k < 2 E n / (T E n^2)`."""
    shares = np.arange(1, len(lengths) + 1)
    (found,) = found_of(integrator(lengths, shares=shares.tolist()), "numbers.k", 200.0)
    n = np.array(lengths) / 100
    end = 2 * (shares @ n) / (shares @ n**2)
    assert found.high < end < found.above.x
    assert found.high == pytest.approx(end, rel=2e-5)


@pytest.mark.parametrize("stay", [0.1])
def test_a_chain_of_an_integrator_has_the_radius_of_two_moments(stay):
    """Short and long frames that alternate or stay: moments `[p_ij a_j^2]` of two numbers."""
    (found,) = found_of(integrator([2, 9], next=[[stay, 1 - stay], [1 - stay, stay]]), "numbers.k", 200.0)

    def moments(k):
        a = (1 - k * np.array([0.02, 0.09])) ** 2
        return np.abs(np.linalg.eigvals(a[:, None] * np.array([[stay, 1 - stay], [1 - stay, stay]]))).max()

    assert moments(found.high) < 1 < moments(found.above.x)
    assert found.high == pytest.approx(found.above.x, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "march", "shares"), [("dc-slow", dc_slow, CHAIN), ("pmw", pmw, SHARES)])
def test_walls_end_where_the_moments_of_a_march_begin_to_grow(kind, march, shares):
    given = {"shares": shares} if np.ndim(shares) == 1 else {"next": shares}
    (found,) = found_of(built_in(kind, LENGTHS, **given), "environment.K_VE")
    assert radius(march(found.high), LENGTHS, shares) < 1 < radius(march(found.above.x), LENGTHS, shares)
    assert found.high == pytest.approx(found.above.x, rel=1e-4)
    assert radius(march(found.high / 2), LENGTHS, shares) < 1
    assert 0 < found.low < 1e-5  # as the device drifts at 0
    assert all(radius(march(K), LENGTHS, shares) < 1 for K in (1e-4, 1e-2, 1.0))


@pytest.mark.parametrize("k", [10.0, 40.0, 53.4, 53.5, 100.0])
def test_a_slow_block_that_runs_later_steps_by_the_frame_before(k):
    """`x' = -k (z + I)`: z is sampled with the frame, and I integrates over the time since it last ran, a tick later."""
    lengths, shares = [2, 5], [[1, 3], [2, 1]]
    spec = integrator(lengths, next=shares)
    spec["numbers"]["k"] = k
    spec["block"]["sum"] = {"type": "integrator", "method": "implicit", "every": "n", "phase": 1}
    spec["wire"] |= {"sum.u": "slow.y", "plant.u": "-k*(slow.y + sum.y)"}

    def march(state, length, before, _):
        x, z, total = state
        for tick in range(length):
            z = x if tick == 0 else z
            total += before * 0.01 * z if tick == 1 else 0.0
            x -= 0.01 * k * (z + total)
        return x, z, total

    stable = radius(lambda *frame: matrix_of(march, 3, *frame), lengths, shares) < 1
    assert stable == (k < 53.45)
    loaded = load(spec)
    assert decays(Rules.of(loaded).on_average().family(dict(loaded.values), "")) == ("proved" if stable else "refuted")


def test_results_may_be_lost_in_any_pattern_where_all_others_are_in_place_at_once():
    """The samples of frames may have results that are in place at once, and such that never are."""
    spec = built_in("pmw", [16, 33])
    spec["environment"]["delay"], spec["for_all"]["lost"] = 0, 1
    family = Rules.of(load(spec)).family(dict(load(spec).values), "environment.K_VE")
    kinds = [(each.ticks, each.delay, each.through) for each in family.symbols]
    short, long = kinds.index((16, 0, False)), kinds.index((33, "lost", True))
    assert family.follows[short, long]
    assert family.follows[long, short]
    for K in (200.0, 2000.0):
        product = pmw(K)(33, 16, None) @ pmw(K)(16, 33, 0)
        assert growth(family.at(K), (short, long)) == pytest.approx(np.abs(np.linalg.eigvals(product)).max(), rel=1e-9)


def test_one_length_alone_is_stable_as_a_constant_rate_is():
    (found,) = found_of(built_in("pmw", [16, 20, 33], shares=[0, 5, 0]), "environment.K_VE", 1200.0)
    exact = 801.892576710366  # the interval of the same loop at a constant ratio of 20
    assert found.high < exact < found.above.x
    assert found.high == pytest.approx(exact, rel=2e-5)


DELAYS = {"values": [1, 2], "varying": True}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"lost": 1}, "for_all.lost: expected loss = PROBABILITY where what varies is at random, found 1"),
        ({"environment.delay": DELAYS}, "for_all.environment.delay: expected shares beside values of each number that varies"),
        (
            {"environment.delay": DELAYS | {"next": [[1, 1]] * 2}},
            "expected shares of delays, or a list of them for each length",
        ),
        (
            {"environment.delay": DELAYS | {"shares": [[1, 1]]}},
            "for_all.environment.delay.shares: expected 2 lists, one for each length of frames, found a list",
        ),
        ({"loss": 1.5}, "for_all.loss: expected a number <= 1"),
    ],
)
def test_what_is_at_random_in_part_or_has_no_shares_is_refused(more, said):
    spec = built_in("pmw", [16, 20], shares=[1, 1])
    spec["for_all"] |= more
    with pytest.raises(SpecError) as caught:
        load(spec)
    assert said in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_ranges_beside_frames_at_random_are_proved_for_each_of_their_numbers(seed):
    rng = np.random.default_rng(seed)
    lengths = sorted(rng.choice(np.arange(4, 30), rng.integers(2, 4), replace=False).tolist())
    shares = rng.integers(0, 9, len(lengths) if seed % 4 < 2 else (len(lengths),) * 2) + 1
    kind, march = (("pmw", pmw), ("dc-slow", dc_slow))[seed % 2]
    spec = built_in(kind, lengths, **{"shares" if shares.ndim == 1 else "next": shares.tolist()})
    mass, damping = (0.1 * np.sort(rng.uniform(0.6, 1.6, 2)), 1.5 * np.sort(rng.uniform(0.5, 2, 2)))
    spec["for_all"]["device.mass"] = dict(zip(("start", "stop"), mass.tolist(), strict=True))
    if seed % 3:
        spec["for_all"]["device.damping"] = dict(zip(("start", "stop"), damping.tolist(), strict=True))
    loss, results = 0.1 * (seed % 5 == 0), ((1, 1.0),)
    if loss:
        spec["for_all"]["loss"], results = loss, ((1, 1 - loss), (None, loss))
    loaded, along = load(spec), "environment.K_VE"
    rules, loops = Rules.of(loaded), loops_of(loaded, dict(loaded.values), along)
    rows = intervals_for_all(rules.on_average() or rules, loops, along, (0.0, 2000.0))
    damping = damping if seed % 3 else np.array([1.5, 1.5])
    for row in rows[rows["intervals"] > 0]:
        corners = [*product(mass, damping), *rng.uniform((mass[0], damping[0]), (mass[1], damping[1]), (5, 2))]
        for (m, d), K in product(corners, (row["low"], row["high"], rng.uniform(row["low"], row["high"]))):
            assert radius(march(K, m=m, d=d), lengths, shares, results) < 1
        if not np.isnan(row["fails_from"]):
            text = row["counterexample"].rpartition("from: ")[2]
            at = dict(each.split(" = ") for each in text.split(", ")[:-1])
            device = {"m": float(at["device.mass"]), "d": float(at.get("device.damping", 1.5))}
            assert radius(march(row["fails_from"], **device), lengths, shares, results) > 1 - 1e-5  # numbers of six digits
            assert row["high"] < row["fails_from"]


def measured_and_sent(lengths, **chances):
    """A mass whose position comes by one channel, an integral over frames of it, and a force that goes by another one."""
    return {
        "rates": {"tick_hz": 1000.0},
        "numbers": {"k": 20.0, "c": 0.5, "n": lengths[0]},
        "block": {
            "m": {"type": "mass", "mass": 0.5, "damping": 4.0},
            "up": {"type": "channel", "every": "n"},
            "sum": {"type": "integrator", "every": "n", "method": "implicit", "phase": 1},
            "down": {"type": "channel", "every": "n", "phase": 1},
        },
        "wire": {"up.u": "m.x", "sum.u": "up.y", "down.u": "up.y + c*sum.y", "m.f": "-k*down.y"},
        "for_all": {"n": {"values": lengths, "varying": True, **chances}},
    }


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_messages_lost_at_random_beside_frames_at_random_have_the_moments_of_a_march(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.choice(np.arange(2, 12), 2, replace=False).tolist()
    shares = rng.integers(0, 9, 2 if seed % 2 else (2, 2)) + 1
    spec = measured_and_sent(lengths, **{"shares" if seed % 2 else "next": shares.tolist()})
    loss, burst, end, inside = (rng.uniform(0, most) for most in (0.3, 0.1, 0.9, 1.0))
    down = rng.uniform(0, 0.4) if seed % 3 else 0.0
    spec["block"]["up"] |= {"loss": loss} | ({"burst": burst, "burst_end": end, "burst_loss": inside} if seed % 4 < 2 else {})
    spec["block"]["down"] |= {"loss": down} if down else {}
    free, forced = ticked(0.5, 4.0)

    def march(state, length, before, k, up, sent):
        v, x, seen, total, force = state
        for tick in range(length):
            if tick == 0 and up:
                seen = x
            if tick == 1:
                total += before * T * seen
                force = seen + 0.5 * total if sent else force
            v, x = free[0] * v - k * forced[0] * force, x + free[1] * v - k * forced[1] * force
        return v, x, seen, total, force

    rows = np.array([np.array(row) / sum(row) for row in rows_of(shares.tolist())])
    bursts = np.array([[1 - burst, burst], [end, 1 - end]]) if seed % 4 < 2 else np.array([[1.0, 0], [1, 0]])

    def moments(k):
        whole = np.zeros((4, 25, 4, 25))
        for (i, before), (j, length), up, sent in product(enumerate(lengths), enumerate(lengths), (0, 1), (0, 1)):
            A = matrix_of(march, 5, length, before, k, up, sent)
            for b, then in product((0, 1), (0, 1)):
                chance = abs((0, 1)[up] - (loss, inside)[then]) * abs(sent - down) * bursts[b, then]
                whole[2 * j + then, :, 2 * i + b] += rows[i % len(rows), j] * chance * np.kron(A, A)
        return np.abs(np.linalg.eigvals(whole.reshape(100, 100))).max()

    loaded = load(spec)
    for k in np.geomspace(30, 3000, 6):
        family = Rules.of(loaded).family({**loaded.values, "numbers.k": k}, "")
        assert decays(family) == ("proved" if moments(k) < 1 else "refuted")


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ({"up": {"loss": 0.1, "missing": "zero"}}, "expected channels that run once a frame and hold the last message"),
        ({"up": {"loss": 0.1}, "down": {"lost": 1}}, "expected late = 0 and lost = 0 of other channels, found down with more"),
        ({"up": {"lost": 1}}, "frames (shares) and messages (loss, burst) at random, found up (channel)"),
    ],
)
def test_channels_that_cannot_stand_beside_frames_at_random_are_refused(block, said):
    spec = measured_and_sent([2, 5], shares=[1, 1]) | {"sweep": {"along": "k", "k": {"start": 0, "stop": 10}}}
    for name, keys in block.items():
        spec["block"][name] |= keys
    with pytest.raises((SpecError, UsageError)) as caught:
        wavesweep.stability_region(spec)
    assert said in str(caught.value)


@pytest.mark.parametrize(("above", "grows"), [(1e-4, True), (-1e-4, False)])
def test_a_range_in_which_the_mean_square_decays_nowhere_is_told_from_one_with_a_sliver(above, grows):
    """`E (1 - k n T)^2 < 1` up to an end in closed form."""
    n = np.array([1, 2]) / 100
    end = 2 * ([1, 3] @ n) / ([1, 3] @ n**2)
    loaded = load(integrator([1, 2], shares=[1, 3]))
    rules = Rules.of(loaded)
    family = (rules.on_average() or rules).family(dict(loaded.values), "numbers.k")
    assert grows_everywhere(family, end * (1 + above), 500.0) is grows


@pytest.mark.slow
def test_nothing_decays_in_mean_square_from_a_wall_of_zero_on():
    """Beside a wall of zero the position drifts; another mode of the second moments passes 1 within the range."""
    spec = {
        "rates": {"fast_hz": 500, "ratio": 6},
        "device": {"mass": 0.19, "damping": 0.4, "velocity": "difference"},
        "environment": {"integration": "explicit", "B_VE": 2.9},
        "controller": {"kind": "dc-vc", "K_VC": 2930, "B_VC": 12},
        "for_all": {"rates.ratio": {"values": [4, 6], "varying": True, "shares": [1, 1]}, "loss": 0.25},
        "sweep": {"K_VE": {"start": 0, "stop": 5000}},
    }
    table = wavesweep.zwidth(spec)
    assert table[["guarantee", "intervals", "certified", "settled", "doubt"]].values.tolist() == [
        ["spec", 0, True, True, ""],
        ["mean_square", 0, True, True, ""],
    ]


@pytest.mark.slow
def test_a_spring_at_the_hand_whose_drift_depends_on_the_wall_is_proved_beside_frames_at_random():
    spec = built_in("pmw", [16, 20], shares=[1, 2])
    spec["operator"] = {"mass": 0.1, "damping": 2.0, "stiffness": 100.0}
    spec["sweep"]["K_VE"]["stop"] = 1000
    (row,) = wavesweep.zwidth(spec).query("guarantee == 'mean_square'").itertuples()
    loaded = load(spec)
    family = Rules.of(loaded).on_average().family(dict(loaded.values), "environment.K_VE")
    assert row.certified
    assert row.low < 10
    assert family.decays(row.high)
    assert not family.decays(1.01 * row.high)
