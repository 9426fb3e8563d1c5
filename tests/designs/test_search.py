"""The search finds published fronts, keeps constraints, and depends on its seed alone."""

from functools import reduce
from itertools import product

import numpy as np
import pytest

from wavesweep import compile  # noqa: A004 - the library calls it so
from wavesweep.designs import study
from wavesweep.designs.search import Evolution, Judged, generations, undominated
from wavesweep.designs.study import design
from wavesweep.program.analyses.own_design import own_design
from wavesweep.program.spec import load


def zdt(number, x):
    """Two objectives of the test problems of E. Zitzler, K. Deb, L. Thiele (Evolutionary Computation 8, 2000)."""
    first, g = x[:, 0], 1 + 9 * x[:, 1:].mean(1)
    share = first / g
    shape = {1: 1 - np.sqrt(share), 2: 1 - share**2, 3: 1 - np.sqrt(share) - share * np.sin(10 * np.pi * first)}[number]
    return np.stack([first, g * shape], axis=1)


def last(judge, genes=8, population=80, count=100, seed=0):
    for best in generations(judge, Evolution(population, count, seed), [0] * genes, np.zeros((0, genes))):
        found = best
    return found


@pytest.mark.slow
def test_a_constraint_is_kept_and_its_edge_is_found():
    """The least x + y with x y >= 1/4 is 1, at x = y = 1/2."""

    def judge(_, genes):
        x, y = genes.T
        return Judged(genes, (x + y)[:, None], np.maximum(0.25 - x * y, 0))

    found = last(judge, genes=2)
    assert found.violation[0] == 0
    assert found.objectives[0, 0] == pytest.approx(1, abs=1e-3)


def test_the_seed_decides_all():
    one, same, other = (
        last(lambda _, x: Judged(x, zdt(1, x), np.zeros(len(x))), count=6, seed=seed).genes for seed in (1, 1, 2)
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_the_first_generation_has_the_designs_that_are_given():
    given, seen = np.array([[0.25, 0.75]]), []

    def judge(_, x):
        seen.append(x)
        return Judged(x, x, np.zeros(len(x)))

    next(generations(judge, Evolution(10, 3, 0), (0, 0), given))
    assert (seen[0][0] == given).all()


def test_ranks_by_domination():
    f = np.array([[0.0, 2.0], [1.0, 1.0], [2.0, 0.0], [2.0, 2.0], [3.0, 3.0], [1.0, 1.0]])
    judged = Judged(f, f, np.array([0.0, 0, 0, 0, 0, 0]))
    assert undominated(judged).tolist() == [0, 1, 2]
    assert undominated(Judged(f, f, np.array([1.0, 0, 0, 0, 0, 0]))).tolist() == [1, 2]
    assert undominated(Judged(f, f, np.array([1.0, 2, 3, 4, 5, 6]))).tolist() == [0]
    noise = np.array([[-3000.0000000002674, 2.66e-6], [-3000.000000000064, 1.7e-21], [-2999.99999999998, 0.0], [-2999.9, 0.0]])
    assert undominated(Judged(noise, noise, np.zeros(4))).tolist() == [2]  # whose walls differ by rounding alone
    assert undominated(Judged(noise[:0], noise[:0], np.zeros(0))).tolist() == []


def test_what_is_judged_otherwise_after_a_look_is_judged_again():
    """From the look on the first objective is 1 larger: the best that are left were all judged so."""
    seen = []

    def judge(number, x):
        seen.append(number)
        return Judged(x, zdt(1, x) + np.array([1.0 * bool(looked), 0]), np.zeros(len(x)))

    looked = []

    def look(best):
        looked.append(len(best.genes))
        return len(looked) == 1

    for found in generations(judge, Evolution(24, 40, 0), (0, 0, 0, 0), np.zeros((0, 4)), look=look):
        best = found
    assert len(looked) == 3
    assert seen == list(range(40))
    assert best.objectives[:, 0].min() >= 1
    assert np.array_equal(best.objectives, zdt(1, best.genes) + np.array([1.0, 0.0]))


def test_every_kind_of_design_has_a_part_of_the_population_at_first():
    """The second of three kinds is the best, but only next to a point that the others know nothing of."""

    def judge(_, x):
        kind = np.minimum((x[:, 0] * 3).astype(int), 2)
        kinds.append(np.bincount(kind, minlength=3))
        well = np.abs(x[:, 1:] - 0.81).max(1)
        return Judged(x, np.where(kind == 1, np.minimum(3.0, 10 * well), 1 + well)[:, None], np.zeros(len(x)))

    kinds = []
    for best in generations(judge, Evolution(36, 40, 0), (3, 0, 0, 0), np.zeros((0, 4))):
        found = best
    assert (kinds[0] == 12).all()
    assert (kinds[17] == 12).all()
    assert found.objectives[0, 0] < 0.1


@pytest.mark.slow
@pytest.mark.asks("for_all")
def test_a_design_that_breaks_its_bound_between_the_ends_of_a_range_is_not_the_best():
    """Late feedback of a velocity damps the slowest and the fastest resonance of a range, and shakes those between."""
    spec = {
        "rates": {"tick_hz": 100},
        "numbers": {"stiffness": 400.0, "b": 0.1},
        "block": {
            "load": {"type": "mass", "mass": 1.0, "damping": 0.4, "stiffness": "stiffness"},
            "late": {"type": "delay", "steps": 12},
        },
        "wire": {"late.u": "load.v", "load.f": "-b*late.y"},
        "design": {
            "population": 24,
            "generations": 20,
            "vary": {"b": {"start": 0.01, "stop": 1, "scale": "log"}},
            "wish": {"settling": {}, "damping_ratio": {"at_least": 0.005}},
        },
        "for_all": {"stiffness": [100, 1600]},
    }

    def ratios(b, stiffnesses):
        modes = [own_design(load(spec).with_values({"b": b, "stiffness": stiffness})) for stiffness in stiffnesses]
        return [(own["least_damped"] or own["slowest"])["damping_ratio"] for own in modes]  # None if it is the slowest

    assert min(ratios(0.3, [100, 1600])) > 0.005 > min(ratios(0.3, [500]))
    found = design(load(spec), jobs=1).columns
    assert found["holds"].all()
    assert min(ratios(found["b"][0], np.linspace(100, 1600, 33))) >= 0.005


@pytest.mark.slow
@pytest.mark.asks("for_all")
def test_a_design_is_proved_for_all_numbers_of_its_spec():
    """Direct coupling: the wall of the worst numbers, from which the proof is no further than 1 %."""
    spec = {
        "controller": {"kind": "dc-slow"},
        "environment": {"integration": "explicit", "delay": 1},
        "device": {"velocity": "difference"},
        "for_all": {"device.mass": {"start": 0.08, "stop": 0.125}},
        "sweep": {"K_VE": {"start": 0, "stop": 2000}},
        "design": {"population": 8, "generations": 1, "vary": {"device.damping": {"start": 1, "stop": 3}}},
    }
    spec["design"]["wish"] = {"z_width": {"B_VE": [1]}}
    table = design(load(spec), jobs=1)
    found = table.columns
    own = load({name: table for name, table in spec.items() if name not in ("for_all", "design")})
    assert found["holds"].all()
    for damping, proved in ((found["device.damping"][0], found["z_width"][0]), (1.5, table.facts["own"]["z_width"])):
        members = [own.with_values({"device.mass": mass, "device.damping": damping}) for mass in (0.08, 0.125)]
        worst = min(compile(each).stable_intervals().high[0] for each in members)
        assert 0.99 * worst < proved < worst
    assert 1 + len(table.facts["runners_up"]) <= table.facts["proved"] < table.facts["slices"]["computed"]


def coupled(ticks, K, mass=0.1):
    """A frame of direct coupling with exact velocity; the force of its sample, K x + v, is in place a tick later."""
    decay = np.exp(-1.5 / mass * 1e-3)
    tick = np.array([[1.0, mass / 1.5 * (1 - decay), 0.0], [0.0, decay, 0.0], [0.0, 0.0, 1.0]])
    tick[:2, 2] = -(1e-3 - mass / 1.5 * (1 - decay)) / 1.5, -(1 - decay) / 1.5
    return np.linalg.matrix_power(tick, ticks - 1) @ np.vstack([tick[:2], [K, 1.0, 0.0]])


@pytest.mark.slow
def test_wishes_under_frames_that_vary_are_about_the_wall_that_is_proved():
    """By the frames' matrices: at the wall no order of up to eight frames grows, and a little beyond it one does."""
    lengths, ratio = (16, 33), {"at_least": 0.01}
    tables = {
        "controller": {"kind": "dc-slow"},
        "environment": {"integration": "explicit", "delay": 1, "K_VE": 50.0},
        "for_all": {"rates.ratio": {"values": list(lengths), "varying": True}},
        "sweep": {"K_VE": {"start": 0, "stop": 2000}},
    }

    def growth(K):
        frames = [coupled(each, K) for each in lengths]
        return max(
            np.abs(np.linalg.eigvals(reduce(np.matmul, order))).max() ** (1 / length)
            for length in range(1, 9)
            for order in product(frames, repeat=length)
        )

    def own(**wish):
        design = {"vary": {"device.damping": {"start": 1, "stop": 2}}, "wish": wish}
        spec = load(tables | {"design": design})
        return study.own_design(spec.asking("design"), study.job_of(spec), [])

    found = own(felt={}, z_width={"at_least": 1}, damping_ratio=ratio | {"walls": [50]})
    wall = found["z_width"]
    assert found["felt"] == pytest.approx(wall, rel=1e-9)
    assert growth(wall) < 1 < growth(1.03 * wall)
    assert found["damping_ratio"] > 0
    assert growth(50.0) < 1 < growth(200.0)
    assert own(damping_ratio=ratio | {"walls": [50, 200]})["damping_ratio"] is None
