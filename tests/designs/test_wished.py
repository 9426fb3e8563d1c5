"""What a spec's own numbers reach of its wishes, against closed forms."""

from math import exp, log

import numpy as np
import pytest

from wavesweep.designs.family import scenarios_of
from wavesweep.designs.study import design
from wavesweep.designs.wished import wished
from wavesweep.designs.wishes import evaluate
from wavesweep.engine.errors import SpecError
from wavesweep.program.analyses.claim_words import scope_in_words
from wavesweep.program.spec import load

# a velocity under a gain, held over ticks: v[k+1] = a v[k] - b K v[k]
a = exp(-0.5 * 0.001 / 0.01)
POLE = a - (1 - a) / 0.5 * 3.0
CONSTANT = -0.001 / log(POLE)  # s


def loop(wish, **more):
    return load(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"K": 3.0, "J": 0.01},
            "block": {"axis": {"type": "inertia", "inertia": "J", "damping": 0.5}, "gain": {"type": "gain", "k": "K"}},
            "wire": {"gain.u": "-axis.v", "axis.f": "gain.y"},
            "design": {"vary": {"K": {"start": 1.0, "stop": 10.0}}, "wish": wish},
        }
        | more
    )


@pytest.mark.parametrize(("share", "met"), [(0.99, "missed"), (1.01, "met")])
def test_a_bound_is_met_on_its_side_alone(share, met):
    (row,), _ = wished(loop({"time_constant": {"at_most": share * CONSTANT}}))
    _, asked, reached, answer = row
    assert float(reached.removesuffix(" s")) == pytest.approx(CONSTANT, rel=1e-4)
    assert float(asked.removeprefix("at most ").removesuffix(" s")) == pytest.approx(share * CONSTANT, rel=1e-4)
    assert answer == met


def test_an_unstable_loop_meets_nothing_that_is_known():
    (row,), _ = wished(loop({"time_constant": {"at_most": 1.0}}, numbers={"K": 60.0, "J": 0.01}))
    assert row[2:] == ("not known", "not known")


@pytest.mark.asks("for_all")
def test_what_is_reached_is_that_of_the_worst_of_all_loops():
    heavy = exp(-0.5 * 0.001 / 0.02)
    slowest = -0.001 / log(heavy - (1 - heavy) / 0.5 * 3.0)
    (row,), claims = wished(loop({"time_constant": {"at_most": 1.0}}, for_all={"J": [0.01, 0.02]}))
    assert float(row[2].removesuffix(" s")) == pytest.approx(slowest, rel=1e-4)
    assert any("J" in scope_in_words(claim.scope) for claim in claims)


@pytest.mark.asks("margins")
def test_wishes_of_one_kind_are_about_their_own_cuts():

    several = loop({"gain": [{"at_least": 2.0, "cut": "gain.y"}, {"at_least": 1e3, "cut": "gain.y"}]})
    alone = loop({"gain": {"at_least": 2.0, "cut": "gain.y"}})
    (first, second), _ = wished(several)
    assert [first] == wished(alone)[0]
    assert (first[2], first[3], second[3]) == (second[2], "met", "missed")
    again = load(several.asking("design").tables())
    assert again.asking("design").design == several.asking("design").design


@pytest.mark.parametrize(
    ("wish", "said"),
    [
        ({"time_constant": [{"at_most": 1.0}, {"at_moost": 1.0}]}, "design.wish.time_constant_2.at_moost"),
        ({"time_constant": [{"at_most": 1.0}] * 2, "time_constant_2": {}}, "one wish of this name"),
        ({"time_constant": [{"at_most": 1.0}] * 10}, "time_constant_10"),
        ({"time_constant": [1.0]}, "expected a table"),
    ],
)
def test_a_wrong_wish_of_a_list_is_named(wish, said):
    with pytest.raises(SpecError, match=said):
        loop(wish)


INTEGRATOR = {  # under a gain in every tick of 10 ms: |L| = 1 at 2 sin(t/2) = K T, with a phase of 90 deg - t/2 left
    "rates": {"tick_hz": 100.0},
    "numbers": {"K": 10.0},
    "block": {"p": {"type": "tf", "num": [1], "den": [1, 0]}, "c": {"type": "gain", "k": "K"}},
    "wire": {"p.u": "c.y", "c.u": "ref - p.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "p.y"}},
}


@pytest.mark.slow
@pytest.mark.asks("margins")
def test_the_largest_number_is_that_of_the_bound_of_another_wish():
    wish = {"largest": "K", "phase_deg": {"at_least": 40, "cut": "c.y"}}
    spec = load(INTEGRATOR | {"design": {"vary": {"K": {"start": 1, "stop": 250}}, "wish": wish}})
    table = design(spec, jobs=1)
    K = 200 * np.sin(np.radians(50))
    assert K * (1 - 1e-4) < table.columns["largest"][0] <= K
    assert table.columns["largest"][0] == table.columns["K"][0]
    assert spec.design.settings == {"seed": 0, "population": 32, "generations": 12}


def test_numbers_of_unstable_loops_are_none():
    tables = INTEGRATOR | {"design": {"vary": {"K": {"start": 1, "stop": 250}}, "wish": {"smallest": {"number": "K"}}}}
    spec = load(tables)
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.K": np.array([3.0, 199.0, 201.0])}, 1.0)
    assert found["smallest"].value == pytest.approx([3.0, 199.0, np.nan], nan_ok=True)
    assert load(spec.asking("design").tables()).design == spec.design


@pytest.mark.parametrize("wish", ["k", {}, 3.0])
def test_only_a_varied_number_is_made_large(wish):
    with pytest.raises(SpecError, match=r"design\.wish\.largest"):
        load(INTEGRATOR | {"design": {"vary": {"K": {"start": 1, "stop": 250}}, "wish": {"largest": wish}}})
