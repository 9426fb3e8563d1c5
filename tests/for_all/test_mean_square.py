"""Messages lost at random, against closed forms, operators of their own, and many runs."""

import numpy as np
import pytest

from wavesweep.engine._sets.taylor_models import Polynomials
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.mean_square import brackets_on_average, decays, nearest_growing
from wavesweep.engine._switched.norm_check import Norms, shrink_on_average, shrink_over
from wavesweep.for_all.mean_square import chances
from wavesweep.program.spec import load


def recursion(a, missing="zero", **channel):
    """`x+ = a x + u`, where `u = -k x` unless it is lost."""
    return {
        "rates": {"tick_hz": 1.0},
        "numbers": {"p": 0.1, "k": a},
        "block": {
            "plant": {"type": "ss", "A": [[a]], "B": [[1]], "C": [[1]], "discrete": True},
            "net": {"type": "channel", "loss": "p", "missing": missing, **channel},
        },
        "wire": {"net.u": "-k*plant.y", "plant.u": "net.y"},
    }


@pytest.mark.parametrize(
    ("P", "weight", "holds"),
    [
        (1.0, [0.75, 0.25 - 1e-9], False),  # not all that may happen
        (1.0, [0.75 + 1e-9, 0.25 - 1e-9], True),
        (1.0, [0.75, 0.25], False),  # p a^2 is 1
        (-1.0, [0.5, 0.5], False),  # -1 + 0.5 * 4 is positive, but it is no norm
    ],
)
def test_the_check_takes_probabilities_and_norms_alone(P, weight, holds):
    """`x+ = 0` or `2 x` with probability p: p < 1/4."""
    graph = Graph(np.zeros(2, int), np.arange(2), np.zeros(2, int))
    E, weight = np.array([[[-1.0]], [[1.0]]]), np.array(weight)
    assert shrink_on_average(Norms(np.full((1, 1, 1), P), graph), weight, E, np.zeros_like(E)) is holds


@pytest.mark.parametrize(("weight", "holds"), [([0.78, 0.22], True), ([0.77, 0.23], False), ([0.78 - 1e-9, 0.22], False)])
def test_the_check_over_a_range_is_of_its_worst_number(weight, holds):
    """`x+ = 0` or `(2 + 0.1 s) x` with probability p, for s from -1 to 1: `p 2.1^2 < 1`, in the form 1."""
    graph = Graph(np.zeros(2, int), np.arange(2), np.zeros(2, int))
    terms, form = np.zeros((3, 2, 1, 1)), np.zeros((3, 1, 1, 1))
    terms[0, 1], terms[1, 1], form[0] = 2.0, 0.1, 1.0
    A, P = Polynomials(terms, np.zeros((2, 1, 1)), 1, 2), Polynomials(form, np.zeros((1, 1, 1)), 1, 2)
    assert shrink_over(P, graph, A, None, np.array(weight))[0] is holds


def chain(spec, along="", **values):
    spec = load(spec).with_values({f"numbers.{name}": value for name, value in values.items()})
    return chances(spec.drawing, dict(spec.values), along)


@pytest.mark.parametrize("a", [1.2, 2.0, 5.0])
def test_a_deadbeat_loop_may_lose_one_message_in_a_squared(a):
    """p < 1/a^2 (B. Sinopoli et al., Kalman filtering with intermittent observations, IEEE Trans. Autom. Control 49, 2004)."""
    (found,) = brackets_on_average(chain(recursion(a), "p"), (0.0, 1.0))
    assert found.low == 0
    assert found.high == pytest.approx(1 / a**2, rel=2e-5)
    assert found.high < 1 / a**2 < found.above.x
    refuted = nearest_growing(chain(recursion(a), "p"), 0.1 / a**2, 1.0)
    assert (1 / a**2 <= refuted.x <= (1 + 2e-10) / a**2, refuted.word) == (True, (0,))


def test_held_inputs_have_the_radius_of_their_second_moments():
    (found,) = brackets_on_average(chain(recursion(1.2, "held"), "k"), (0.0, 3.0))

    def radius(k):
        sent, lost = np.array([[1.2 - k, 0], [-k, 0]]), np.array([[1.2, 1], [0, 1]])
        return np.abs(np.linalg.eigvals(0.9 * np.kron(sent, sent) + 0.1 * np.kron(lost, lost))).max()

    for inside, outside in ((found.low, found.below.x), (found.high, found.above.x)):
        assert radius(inside) < 1 < radius(outside)
        assert inside == pytest.approx(outside, rel=1e-4)
    assert decays(chain(recursion(1.2, "held"), k=1.0)) == "proved"
    assert decays(chain(recursion(1.2, "held"), k=0.1)) == "refuted"


def test_operators_of_a_stretch_are_within_the_rest_of_a_line():
    """Of a gain that acts twice in a frame, so that second moments are of its fourth power."""
    spec = recursion(1.2, "held", every=2)
    spec["wire"]["plant.u"], spec["numbers"]["g"] = "net.y - g*plant.y", 0.3
    moments = chain(spec, "g")
    middle, slope, rest = moments._enclosed(0.2, 0.6)
    for s in np.linspace(-1, 1, 9):
        assert (np.abs(moments.operator(0.4 + 0.2 * s) - middle - s * slope) <= rest + 1e-15).all()


def test_all_intervals_are_found_in_which_either_most_messages_are_lost_or_most_arrive():
    """Stable without and with all messages, and not if half are lost: two matrices of different eigenvectors, in turn."""
    a, k = np.array([[-0.3, -1.2], [0.2, -1.1]]), np.array([0.5, 1.9])
    spec = recursion(0.0)
    spec["block"]["plant"] |= {"A": a.tolist(), "B": [[0], [1]], "C": [[1, 0], [0, 1]], "outputs": ["y", "z"]}
    spec["numbers"], spec["wire"]["net.u"] = {"p": 0.1}, f"{k[0]}*plant.y + {k[1]}*plant.z"
    found = brackets_on_average(chain(spec, "p"), (0.0, 1.0))

    def radius(p):
        sent = a + np.outer([0, 1], k)
        return np.abs(np.linalg.eigvals((1 - p) * np.kron(sent, sent) + p * np.kron(a, a))).max()

    assert (found[0].low, found[1].high) == (0, 1)
    for inside, outside in ((found[0].high, found[0].above.x), (found[1].low, found[1].below.x)):
        assert radius(inside) < 1 < radius(outside)
        assert inside == pytest.approx(outside, rel=1e-4)
    for p in np.linspace(found[0].above.x, found[1].below.x, 50):
        assert radius(p) > 1


@pytest.mark.slow
def test_a_row_reaches_from_end_to_end_where_moments_decay_slowly():
    """Forms between those at both ends of a stretch serve on stretches that are a hundred times longer."""
    burst = {"loss": 0.02, "burst": 0.1, "burst_end": 0.5, "burst_loss": 0.8}
    tables = {
        "rates": {"tick_hz": 500.0},
        "numbers": {"s": 0.02},
        "block": {
            "x": {"type": "mass", "mass": 0.1, "damping": 0.01548, "stiffness": 0.9581},
            "sc": {"type": "channel", "every": 8, "phase": 6, **burst},
            "dv": {"type": "difference", "every": 1},
            "ca": {"type": "channel", "every": 8, "phase": 4, "loss": 0.1},
        },
        "wire": {"sc.u": "x.x", "dv.u": "sc.y", "ca.u": "-s*(0.9581*sc.y + 0.2476*dv.y)", "x.f": "ca.y"},
    }
    (row,) = brackets_on_average(chain(tables, "numbers.s"), (0.0, 0.7))
    assert row.low < 1e-3 * row.high
    assert row.high < row.above.x < 1.01 * row.high
    assert all(chain(tables, "", s=s).decays(0.0) for s in np.linspace(row.low, row.high, 9))
    assert not chain(tables, "", s=1.01 * row.above.x).decays(0.0)
