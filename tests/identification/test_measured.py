"""How far a model is from measured points: ratios, sides, holes, and whether it explains them."""

import numpy as np
import pytest
from scipy.stats import f as fisher

import wavesweep

pytestmark = pytest.mark.asks("check")

MASS, DAMPING, PERIOD = 0.1, 1.5, 1e-3
HOLE = {"environment": {"integration": "explicit"}, "controller": {"kind": "pmw", "b": 30.0}}
HOLE |= {"filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}}}


def limit_of(B):
    """The largest stable stiffness of direct coupling at one rate, velocity exact, by Jury's conditions.

    With p = exp(-d T/m) and c = (1 - p)/d a held force f takes (v, x) to (p v + c f, x + m c v + (T - m c)/d f).
    """
    p = np.exp(-DAMPING * PERIOD / MASS)
    c = (1 - p) / DAMPING
    s = (PERIOD - MASS * c) / DAMPING
    product = c * MASS * c - p * s  # of the determinant's part in K
    below_one = (1 - p + c * B) / product
    flips = (2 + 2 * p - 2 * c * B) / (s + p * s - c * MASS * c)
    return np.minimum(below_one, flips)


def measured(tmp_path, rows, tables=None, name="z_width", header="B_VE,K_VE"):
    path = tmp_path / "points.csv"
    path.write_text("\n".join([header, *(",".join(f"{float(each)!r}" for each in row) for row in rows)]))
    known = {"controller": {"kind": "dc"}, "device": {"mass": MASS, "damping": DAMPING}, "rates": {"fast_hz": 1 / PERIOD}}
    return wavesweep.verdict((tables or known) | {"measured": {name: str(path)}})["measured"]


def test_ratios_are_those_of_the_closed_form_and_both_sides_are_counted(tmp_path):
    damping, ratios = np.array([0.0, 1.0, 2.0, 3.0, 20.0]), np.array([2.0, 0.5, 1.25, 1.1, 1.0 / 3])
    found = measured(tmp_path, np.c_[damping, limit_of(damping) / ratios])["limits"]
    assert [each["ratio"] for each in found["points"]] == pytest.approx(ratios, rel=1e-9)
    assert [each["computed"] for each in found["points"]] == pytest.approx(limit_of(damping), rel=1e-9)
    assert (found["count"], found["compared"], found["more"], found["less"]) == (5, 5, 3, 2)
    assert found["median_ratio"] == pytest.approx(1.1)
    assert (found["worst"]["B_VE"], found["most_promised"]["B_VE"]) == (20.0, 0.0)
    off = limit_of(damping) - limit_of(damping) / ratios
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert (found["scatter"], found["explained"], found["above_hole"], found["beyond"]) == (None, False, 0, 0)


@pytest.mark.slow
def test_limits_are_held_against_their_own_end_beside_a_hole(tmp_path):
    rows = wavesweep.compile(HOLE).stable_intervals(span=(0, 6000), B_VE=1.0)
    (first, second), start = rows.high, rows.low[1]
    limits = [0.5 * first, (first + start) / 2, start * 1.01, second * 1.2]
    found = measured(tmp_path, [(1.0, each) for each in limits], HOLE)["limits"]
    ends = [first, first, second, second]
    assert [each["computed"] for each in found["points"]] == pytest.approx(ends, rel=1e-6)
    assert [each["above_hole"] for each in found["points"]] == [False, False, True, True]
    assert (found["more"], found["less"]) == (2, 2)


def test_walls_that_were_tried_are_counted_on_their_sides_of_a_hole(tmp_path):
    rows = wavesweep.compile(HOLE).stable_intervals(span=(0, 6000), B_VE=1.0)
    first, start, second = rows.high[0], rows.low[1], rows.high[1]
    right = [(0.0, 1), (first * 0.9, 1), ((first + start) / 2, 0), (start * 1.1, 1), (second * 1.1, 0)]
    wrong = [(first * 1.2, 1), (start * 1.05, 0), (second * 1.5, 1), (first / 1.1, 0)]
    found = measured(tmp_path, [(1.0, *each) for each in right + wrong], HOLE, header="B_VE,K_VE,stable")["tried"]
    assert (found["count"], found["stable"], found["not_known"]) == (9, 5, 0)
    assert (found["wrong"], found["promised"], found["denied"]) == (4, 2, 2)
    assert [each["ratio"] for each in found["worst"]] == pytest.approx([1 / 1.5, 1 / 1.2, 1.1], rel=1e-6)
    assert [each["stable"] for each in found["worst"]] == [True, True, False]


@pytest.mark.parametrize("shift", [0.0, 10.0, 20.0])
def test_repeated_limits_are_what_the_model_is_held_against(shift, tmp_path):
    damping = np.repeat([0.0, 1.0, 2.0], 4)
    noise = np.tile([-15.0, 5.0, 10.0, 0.0], 3)
    found = measured(tmp_path, np.c_[damping, limit_of(damping) + noise + shift])["limits"]
    scatter = 3 * np.sum(np.square([-15.0, 5.0, 10.0, 0.0])) / (12 - 3)
    assert found["scatter"] == pytest.approx(np.sqrt(scatter))
    assert found["explained"] == (4 * shift**2 / scatter <= fisher.ppf(0.99, 3, 9))
    assert found["explained"] is (shift < 15)


def test_without_repetition_a_model_within_a_tenth_explains_the_limits(tmp_path):
    damping = np.array([0.0, 1.0, 2.0])
    for factor, explained in ((1.05, True), (1.2, False)):
        found = measured(tmp_path, np.c_[damping, limit_of(damping) * factor])["limits"]
        assert (found["explained"], found["scatter"]) == (explained, None)
    few = [(0.0, limit_of(0.0) / 3), (0.0, limit_of(0.0) / 4), (1.0, limit_of(1.0) / 3)]
    assert measured(tmp_path, few)["limits"]["explained"] is False


def test_a_response_is_compared_where_it_is_coherent_and_below_half_the_rate(tmp_path):
    tables = {"controller": {"kind": "dc"}, "rates": {"fast_hz": 200.0}}
    hertz = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 150.0])
    H = wavesweep.compile(tables).response(hertz[:5])
    H = np.append((H.admittance_re + 1j * H.admittance_im).to_numpy(), 1.0)
    H /= np.append([2.0, 1.0, 0.8, 1.0, 1.0], 1.0) * np.exp(1j * np.radians([0.0, 0.0, 5.0, -30.0, 0.0, 0.0]))
    rows = np.c_[hertz, H.real, H.imag, [1, 1, 1, 1, 0.3, 1]]
    found = measured(tmp_path, rows, tables, "response", "frequency_hz,admittance_re,admittance_im,coherence")["response"]
    assert (found["count"], found["compared"]) == (6, 4)
    assert found["worst"] == pytest.approx({"frequency_hz": 1.0, "ratio": 2.0, "deg": 0.0}, abs=1e-9)
    assert found["worst_phase"] == pytest.approx({"frequency_hz": 10.0, "ratio": 1.0, "deg": -30.0})
    assert (found["median_ratio"], found["median_deg"]) == pytest.approx((1.0, 0.0), abs=1e-9)
