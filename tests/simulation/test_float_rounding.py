"""What floats move in a closed loop: against a closed form, and a march in single precision of its own."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.simulation.export.float_rounding import UNIT, float_rounding

H = 1e-3
PLANT = {"type": "tf", "num": [1], "den": [0.05, 1]}


def spec(blocks, wires, seconds=1.0, size=1.0):
    return wavesweep.load(
        {
            "rates": {"tick_hz": 1 / H},
            "block": {"plant": PLANT, **blocks},
            "wire": {**wires, "plant.u": "control.y"},
            "ports": {"inputs": {"ref": "ref"}, "outputs": {"y": "plant.y"}},
            "simulate": {"from": "ref", "input": "step", "duration_s": seconds, "amplitude": size, "at_s": 0.0},
        }
    )


@pytest.mark.parametrize("k", [2.5, -0.5, 60.0])
def test_the_bound_of_a_gain_is_its_sum_of_responses_times_its_roundings(k):
    """u = ref - k y - m is three terms, of which one is multiplied, m = y; u and m are copied; y' = a y + b u."""
    a, b = np.exp(-H / 0.05), 1 - np.exp(-H / 0.05)
    holds = {"control": {"type": "hold"}, "copy": {"type": "hold"}}
    found = float_rounding(spec(holds, {"copy.u": "plant.y", "control.u": f"ref - {k}*plant.y - copy.y"}))
    closed = a - b * (k + 1)
    y = (1 - closed ** np.arange(1000)) * b / (1 - closed)
    u = np.abs(1 - (k + 1) * y).max()
    rounded = (3 * 1.0 + (5 * abs(k) + 3 + 2) * y.max() + 2 * u) * UNIT
    moved, largest = found.moves["plant.u"]
    assert largest == pytest.approx(u, rel=1e-12)
    bound = 1.01 * rounded * (1 + abs(b * (k + 1)) / (1 - abs(closed)))
    assert bound * (1 - 1e-6) < moved < bound * (1 + 5e-3)


@pytest.mark.parametrize(("kp", "ki", "size"), [(3.0, 60.0, 1.0), (0.5, 400.0, 37.0)])
def test_a_march_in_single_precision_is_within_the_bound_and_its_integral_stalls_there(kp, ki, size):
    """A PI controller every 2 ticks, from the left; whatever it computes is rounded to a float."""
    blocks = {"control": {"type": "pi", "kp": kp, "ki": ki, "every": 2, "method": "explicit"}}
    found = float_rounding(spec(blocks, {"control.u": "ref - plant.y"}, 3.0, size))
    a = np.exp(-H / 0.05)

    def run(of):
        y, total, u, seen, most = 0.0, of(0.0), of(0.0), [], of(0.0)
        for tick in range(3000):
            if tick % 2 == 0:
                error = of(of(size) - of(y))
                u = of(of(of(kp) * error) + of(of(ki) * total))
                total = of(total + of(of(2 * H) * error))
                most = max(most, total)
            seen.append(float(u))
            y = a * y + (1 - a) * float(u)
        return np.array(seen), most

    exact, most = run(np.float64)
    rounded, _ = run(np.float32)
    moved, largest = found.moves["plant.u"]
    assert largest == pytest.approx(np.abs(exact).max(), rel=1e-9)
    assert moved / 200 < np.abs(rounded - exact).max() < moved
    least = found.stalls["control"]
    kept = np.float32(most)
    for factor, moves in ((0.99, False), (1.01, True)):
        assert (kept + np.float32(np.float32(2 * H) * np.float32(factor * least)) != kept) == moves


def test_a_run_that_reaches_a_limit_has_no_bound():
    limited = {"control": {"type": "saturation", "high": 0.7, "low": -0.7}}
    with pytest.raises(UsageError, match=r"within the limits of control.y"):
        float_rounding(spec(limited, {"control.u": "ref - plant.y"}))


def test_an_angle_that_nobody_reads_may_drift_and_rounding_that_grows_with_itself_has_no_bound():
    wires = {"control.u": "ref - 2.5*plant.y"}
    blocks = {"control": {"type": "hold"}, "angle": {"type": "tf", "num": [1], "den": [1, 0]}}
    alone = float_rounding(spec({"control": {"type": "hold"}}, wires))
    beside = float_rounding(spec(blocks, {**wires, "angle.u": "plant.y"}))
    assert beside.moves["plant.u"] == pytest.approx(alone.moves["plant.u"], rel=1e-3)
    with pytest.raises(UsageError, match="settles"):
        float_rounding(spec(blocks, {"control.u": "ref + 2.5*angle.y", "angle.u": "plant.y"}))
    slow = {"control": {"type": "lowpass", "cutoff_hz": 3e-6}}
    with pytest.raises(UsageError, match="moves its own errors"):
        float_rounding(spec(slow, {"control.u": "ref"}))


def test_an_integral_at_a_power_of_two_leaves_it_downwards_by_half_as_much_as_upwards():
    loop = {
        "rates": {"tick_hz": 1},
        "block": {"i": {"type": "integrator"}, "p": {"type": "tf", "num": [1], "den": [2, 1]}},
        "wire": {"i.u": "r - i.y", "p.u": "i.y"},
        "ports": {"inputs": {"r": "r"}, "outputs": {"y": "p.y"}},
        "simulate": {"input": "step", "amplitude": 4, "at_s": 1, "duration_s": 20},
    }
    least = float_rounding(wavesweep.load(loop)).stalls["i"]
    kept = np.float32(4.0)
    for size, moves in ((0.99 * least, False), (1.01 * least, True)):
        assert (kept + np.float32(size) != kept or kept - np.float32(size) != kept) == moves


@pytest.mark.parametrize("gains", [(1e-30, 1e-12, 1e42), (1e-30, 1e-12, 1e21, 1e21), (1e30, 1e30, 1e-30, 1e-30)])
def test_what_leaves_the_range_of_floats_is_refused_or_within_the_bound(gains):
    """Of the same product in numpy's floats, whose underflow the bound has and whose overflow is refused."""
    holds = {f"g{k}": {"type": "gain", "k": gain} for k, gain in enumerate(gains)} | {"control": {"type": "hold"}}
    ways = ["ref", *(f"g{k}.y" for k in range(len(gains)))]
    wires = {f"g{k}.u": ways[k] for k in range(len(gains))} | {"control.u": ways[-1]}
    with np.errstate(all="ignore"):
        product = np.float32(1.0)
        for gain in gains:
            product = product * np.float32(gain)
    if not np.isfinite(product) or not np.isfinite(np.float32(gains)).all():
        with pytest.raises(UsageError, match="within the range of floats"):
            float_rounding(spec(holds, wires))
    else:
        moved, _ = float_rounding(spec(holds, wires)).moves["plant.u"]
        assert abs(float(product) - np.prod(gains)) <= moved
