"""Every wish is the worst of what the other commands find for the same loops."""

import tomllib

import numpy as np
import pytest
from meaning.reading import machine_of, with_numbers
from support.drawn import ARM, NETWORK, as_blocks

import wavesweep
from wavesweep.designs import study
from wavesweep.designs import wishes as measures
from wavesweep.designs.best import judged
from wavesweep.designs.family import points_of, scenarios_of
from wavesweep.designs.search import Judged
from wavesweep.designs.wishes import WorstMeasure, evaluate
from wavesweep.engine.errors import SpecError
from wavesweep.program.spec import load

pytestmark = pytest.mark.asks("for_all")

TABLES = {
    "controller": {"kind": "pmw-lm", "Kp": 2.0},
    "environment": {"integration": "explicit", "delay": 1},
    "device": {"velocity": "difference"},
    "design": {
        "vary": {"b": {"start": 5, "stop": 60}, "filters.lp1.order": [1, 2]},
        "wish": {"z_width": {"B_VE": [1, 5]}, "felt": {"B_VE": [1, 5]}, "channel": {"at_most": 3}},
    },
    "for_all": {"device.mass": [0.08, 0.125], "operator.damping": [0, 5]},
}
DESIGNS = {"controller.b": np.array([10.0, 10.0, 40.0, 40.0]), "filters.lp1.order": np.array([1, 2, 1, 1])}


OBSERVED = {  # a mass with an observer of its velocity, which may be unstable by itself
    "rates": {"tick_hz": 1000},
    "numbers": {"d": 1.0, "a": 0.9},
    "block": {
        "dev": {"type": "mass", "mass": 0.1, "damping": "d"},
        "obs": {"type": "tf", "num": [1.0], "den": [1.0, "-a"], "discrete": True},
    },
    "wire": {"obs.u": "dev.v", "dev.f": "push - 0.001*obs.y"},
    "ports": {"hand": {"force": "push", "displacement": "dev.x"}},
    "design": {"vary": {"d": {"start": 0.5, "stop": 4}, "a": {"start": 0.9, "stop": 1.05}}, "wish": {"port": {}}},
}


def wishes(**wanted):
    return load(TABLES | {"design": TABLES["design"] | {"wish": wanted}})


def values_of(spec):
    return evaluate(spec, spec.design.wishes, scenarios_of(spec), DESIGNS, 20000.0)


def loops(spec, number):
    """The compiled loop of a design and of each scenario."""
    own = {path: column[number].item() for path, column in DESIGNS.items()}
    return [wavesweep.compile(spec.with_values(own | each)) for each in scenarios_of(spec)]


def test_whole_numbers_between_that_make_no_loop_are_left_out():
    """A delay of half as many runs as a number says; a value of the list itself is refused."""
    drawn = {
        "rates": {"tick_hz": 1000},
        "numbers": {"n": 4, "k": 50.0},
        "block": {"m": {"type": "mass", "mass": 0.2, "damping": 1.0}, "net": {"type": "delay", "steps": "n/2"}},
        "wire": {"net.u": "m.x", "m.f": "-k*net.y - 3*m.v + hand"},
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
        "design": {"vary": {"k": [10, 90]}, "wish": {"settling": {}}, "population": 8},
        "for_all": {"n": [4, 8]},
    }
    job = study.job_of(load(drawn))
    assert job.asked.finer == [{"numbers.n": n} for n in (4, 6, 8)]
    drawn["for_all"]["n"] = [4, 5]
    with pytest.raises(SpecError, match=r"block.net.steps: expected a whole number >= 0, found 2.5"):
        study.job_of(load(drawn))


def test_frames_that_vary_count_as_frames_of_each_length_and_of_no_other():
    """A PD loop that falls slowest in the longer of its frames, neither of which is the spec's own of 20 ticks."""
    drawn = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 60.0, "d": 3.0, "n": 20},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.0}, "c": {"type": "hold", "every": "n"}},
        "wire": {"c.u": "-k*m.x - d*m.v", "m.f": "c.y + push"},
        "ports": {"inputs": {"push": "push"}, "outputs": {"place": "m.x"}},
        "design": {"vary": {"k": {"start": 10, "stop": 600}}, "wish": {"settling": {}}},
        "for_all": {"n": {"values": [10, 30], "varying": True}},
    }
    spec = load(drawn)
    assert scenarios_of(spec) == scenarios_of(spec, 3) == [{"numbers.n": 10}, {"numbers.n": 30}]
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.k": np.array([60.0])}, 0.0)["settling"]
    alone = load({name: table for name, table in drawn.items() if name not in ("for_all", "design")})
    times = [wavesweep.verdict(alone.with_values({"n": n}))["slowest"]["time_constant_s"] for n in (10, 20, 30)]
    assert found.value[0] == pytest.approx(np.log(50) * max(times[0], times[2]), rel=1e-9)
    assert found.scenario[0] == np.argmax([times[0], times[2]])
    drawn["design"]["wish"] = {"overshoot": {"from": "push", "to": "place"}}
    drawn["for_all"]["n"] = [10, 12]
    assert [each["numbers.n"] for each in scenarios_of(load(drawn), 1)] == [10, 11, 12]


@pytest.mark.slow
@pytest.mark.asks("passive")
def test_the_wishes_of_a_controller_drawn_as_blocks_are_its_own():
    wished = {"z_width": {"at_least": 1, "B_VE": [0, 2]}, "felt": {"at_least": 1, "B_VE": [0, 2]}}
    wished |= {
        "port": {"at_least": -1, "walls": [100, 300]},
        "damping_ratio": {"walls": [100, 300]},
        "settling": {"walls": [100]},
    }
    tables = {"controller": {"kind": "pmw-lm", "Kp": 2.0}, "local_model": {"B_LM": 0.5}}
    built_in = load(tables)
    values, found = built_in.values["controller.b"] * np.array([0.7, 1.0, 1.6]), []
    for loop, path in ((tables, "controller.b"), (as_blocks(built_in.values), "numbers.b")):
        spec = load(loop | {"design": {"wish": wished, "vary": {path: {"start": 1e-3, "stop": 5000}}}})
        found.append(evaluate(spec, spec.design.wishes, scenarios_of(spec), {path: values}, 20000.0))
    for wish in wished:
        own, drawn = (each[wish] for each in found)
        np.testing.assert_allclose(drawn.value, own.value, rtol=1e-9, atol=1e-12, err_msg=wish)
        assert own.certified.all()
        assert drawn.certified.all()


def test_the_slowest_mode_of_an_integrator_settles_in_closed_form():
    """d x' = -K x, held over T: an eigenvalue 1 - K T/d, which turns over by half circles where K T > d."""
    tables = tomllib.loads(NETWORK) | {"sweep": {"along": "K"}}
    tables |= {
        "design": {
            "vary": {"K": {"start": 1, "stop": 100}},
            "wish": {"settling": {}, "time_constant": {"at_most": 9}, "damping_ratio": {}},
        }
    }
    tables["numbers"] |= {"k": 0}
    spec, K = load(tables), np.array([10.0, 60.0, 100.0, 149.0, 160.0])
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.K": K}, 1.0)
    pole = 1 - K * 0.02 / 1.5
    expected = np.where(np.abs(pole) < 1, -0.02 / np.log(np.abs(pole)), np.nan)
    np.testing.assert_allclose(found["time_constant"].value, expected, rtol=1e-12)
    np.testing.assert_allclose(
        np.abs(pole) ** (found["settling"].value / 0.02), np.where(np.abs(pole) < 1, 0.02, np.nan), rtol=1e-12
    )
    log = np.log(pole.astype(complex))
    np.testing.assert_allclose(found["damping_ratio"].value, -log.real / np.abs(log), rtol=1e-10)


@pytest.mark.parametrize(
    ("counted", "counts"),
    [
        ({"modes": "oscillating"}, lambda size: size >= 1),
        ({"slower_than": 0.05}, lambda size: size > np.exp(-0.02 / 0.05)),
        ({"modes": "all"}, lambda size: size >= 0.1),
    ],
)
def test_which_modes_count_for_a_damping_ratio_is_the_wish_s_to_say(counted, counts):
    """A real eigenvalue below 0 is no oscillation, and one that falls fast may be left out; unstable ones always count."""
    tables = tomllib.loads(NETWORK) | {"sweep": {"along": "K"}}
    tables |= {"design": {"vary": {"K": {"start": 1, "stop": 100}}, "wish": {"damping_ratio": counted}}}
    tables["numbers"] |= {"k": 0}
    spec, K = load(tables), np.array([10.0, 60.0, 100.0, 149.0, 160.0])
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.K": K}, 1.0)["damping_ratio"]
    pole = 1 - K * 0.02 / 1.5
    log = np.log(pole.astype(complex))
    expected = np.where(counts(np.abs(pole)), -log.real / np.abs(log), 1.0)
    np.testing.assert_allclose(found.value, expected, rtol=1e-10)
    assert found.certified.all()
    assert spec.design.wishes[0].written() == counted


@pytest.mark.asks("passive")
def test_designs_that_make_no_loop_are_none_and_change_no_other():
    """A cutoff beyond half the rate, a phase beyond the period, and a loop of direct terms without a solution."""
    tables = tomllib.loads(ARM)
    tables["numbers"] |= {"fc": 100.0, "g": 0.5}
    tables["block"] |= {
        "lp": {"type": "butterworth", "order": 1, "cutoff_hz": "fc"},
        "one": {"type": "gain", "k": "g"},
    }
    tables["wire"] |= {"lp.u": "arm.v", "one.u": "one.y + arm.v", "arm.f": "-kp*net.y - kd*lp.y + c*one.y + hand"}
    tables["design"] = {
        "vary": {"fc": {"start": 1, "stop": 9000}, "g": [0.0, 0.5, 1.0], "block.net.phase": [0, 30]},
        "wish": {"settling": {}, "port": {"at_least": -9}},
    }
    spec = load(tables)
    designs = {
        "numbers.fc": np.array([50.0, 9000.0, 60.0, 70.0, 80.0]),
        "numbers.g": np.array([0.5, 0.5, 1.0, 0.0, 0.5]),
        "block.net.phase": np.array([0, 0, 0, 30, 0]),
    }
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), designs, 1.0)
    for name, worst in found.items():
        assert worst.certified.tolist() == [True, False, False, False, True]
        assert np.isnan(worst.value[1:4]).all()
        alone = [
            evaluate(spec, spec.design.wishes, scenarios_of(spec), {p: v[[at]] for p, v in designs.items()}, 1.0)
            for at in (0, 4)
        ]
        assert worst.value[[0, 4]].tolist() == [each[name].value[0] for each in alone]


@pytest.mark.asks("passive")
def test_an_unstable_loop_has_no_margin_at_the_port():
    """Its map may have a positive real part on the whole circle: with b = 0.18 N*s/m it has, and a radius of 2."""
    values = {"b": 0.1797, "K_LM": 53.7, "B_LM": 7.45, "filters.lp1.order": 1, "filters.hp.order": 0, "filters.lp2.order": 2}
    spec = load(
        {"controller": {"kind": "pmw-lm"}, "design": {"vary": {"b": {"start": 0.1, "stop": 200}}, "wish": {"port": {}}}}
    )
    spec = spec.with_values(values)
    assert wavesweep.compile(spec).passivity().port_margin[0] >= 0
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"controller.b": np.array([values["b"], 25.0])}, 2000.0)[
        "port"
    ]
    assert np.isnan(found.value[0])
    spec = load(OBSERVED)
    found = evaluate(
        spec, spec.design.wishes, scenarios_of(spec), {"numbers.d": np.full(2, 3.9), "numbers.a": np.array([1.0494, 0.9])}, 1.0
    )
    assert wavesweep.compile(spec.with_values({"d": 3.9, "a": 1.0494})).passivity().port_margin[0] > 0
    assert np.isnan(found["port"].value[0])
    assert found["port"].value[1] > 0


@pytest.mark.asks("passive")
def test_points_are_the_product_with_the_designs_slowest():
    spec = load(TABLES)
    points = points_of(DESIGNS, scenarios_of(spec), {"environment.B_VE": (1.0, 5.0)})
    assert (points.shape, points.size) == ((4, 4, 2), 32)
    assert points.changes["controller.b"][:9].tolist() == [10.0] * 9
    assert points.changes["environment.B_VE"][:4].tolist() == [1.0, 5.0, 1.0, 5.0]
    value, scenario = points.worst(np.arange(32.0), more=True)
    assert (value.tolist(), scenario.tolist()) == ([0.0, 8.0, 16.0, 24.0], [0] * 4)
    value, scenario = points.worst(np.where(np.arange(32) == 5, np.nan, 1.0), more=False)
    assert np.isnan(value[0])
    assert scenario[0] == 2


@pytest.mark.slow
def test_loops_that_modes_are_too_rough_for_are_computed_again(monkeypatch):
    spec = wishes(transparency={"band_hz": [0.1, 10], "walls": [50]})
    right, own = values_of(spec)["transparency"], measures.responses_of

    def rough(loops, size, frequency, good):
        found = own(loops, size, frequency, good)
        if good == np.inf:
            found.admittance[0], found.admittance_error[0] = 7.0, 1.0
        return found

    monkeypatch.setattr(measures, "responses_of", rough)
    found = values_of(spec)["transparency"]
    np.testing.assert_allclose(found.value, right.value, rtol=1e-6)
    assert (found.certified == right.certified).all()


def test_a_design_that_can_render_no_wall_is_none():
    spec = wishes(z_width={"B_VE": [1]})
    records = {"z_width": np.array([0.0, 100.0]), "z_width_certified": np.array([True, True])}
    assert judged(spec.design, records)[1].tolist() == [10.0, 0.0]


def test_what_is_worst_between_the_ends_is_held_for_from_there_on(monkeypatch):
    spec = wishes(z_width={"B_VE": [1]}, transparency={"band_hz": [0.1, 10], "walls": [50]})
    job = study.job_of(spec)
    between = next(number for number, each in enumerate(job.asked.finer) if each not in job.asked.scenarios)
    ends = list(job.asked.scenarios)

    def found(_spec, asked, _scenarios, designs, _stop, *, ranked):
        assert ranked
        count = len(next(iter(designs.values())))
        return {
            wish.name: WorstMeasure(np.ones(count), np.full(count, between), np.ones(count, bool), np.zeros(count, bool))
            for wish in asked
        }

    monkeypatch.setattr(study, "evaluate", found)
    run = study._Run(job, type("", (), {"remove": None}), None)
    best = Judged(np.full((3, 2), 0.5), np.array([[0.0, 2.0], [1.0, 1.0], [2.0, 0.0]]), np.zeros(3))
    assert run.look(best)
    assert job.asked.scenarios == [*ends, job.asked.finer[between]]
    assert not run.look(best)  # it holds for that by now
    assert not run.look(Judged(best.genes, best.objectives, np.ones(3)))


@pytest.mark.slow
def test_a_delay_margin_whose_radius_rounding_hides_is_not_certified(monkeypatch):
    spec = wishes(delay_margin={"at_least": 1, "walls": [100]})
    sure = values_of(spec)["delay_margin"]
    monkeypatch.setattr("wavesweep.engine.loop.Loops.radii", lambda _loops, size: np.full(size, np.nan))
    hidden = values_of(spec)["delay_margin"]
    assert sure.certified.all()
    assert not hidden.certified.any()


# A slow mode without oscillation and one that rings, which do not act on each other.
TWO_MODES = {
    "rates": {"tick_hz": 500},
    "numbers": {"d": 2.0, "k": 50.0},
    "block": {
        "slow": {"type": "mass", "mass": 1.0, "damping": 30.0, "stiffness": 20.0},
        "rings": {"type": "mass", "mass": 0.1, "damping": "d", "stiffness": 5000.0},
    },
    "wire": {"slow.f": "-k*slow.x", "rings.f": "-10*slow.x"},
    "sweep": {"along": "d", "d": {"start": 0.1, "stop": 40}},
    "design": {"vary": {"d": {"start": 0.5, "stop": 20}}, "wish": {"damping_ratio": {"at_least": 0.3}}},
}


def least_ratio(d):
    z = np.linalg.eigvals(machine_of(with_numbers(TWO_MODES, {"d": float(d)})).monodromy()).astype(complex)
    s = np.log(z[np.abs(z) > 1e-9])  # 0 are those of what is held
    return (-s.real / np.abs(s)).min()


@pytest.mark.asks("check", "require")
def test_a_damping_ratio_is_that_of_every_mode_for_wishes_requirements_and_check():
    spec = load(TWO_MODES)
    designs = np.array([0.5, 2.0, 20.0])
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.d": designs}, 1.0)["damping_ratio"]
    assert found.value == pytest.approx([least_ratio(d) for d in designs], rel=1e-9)
    assert found.certified.all()
    (row,) = wavesweep.compile(spec).stable_intervals(require={"damping_ratio": 0.3}).itertuples()
    assert least_ratio(row.low) == pytest.approx(0.3, rel=1e-8)
    checked = wavesweep.verdict(spec)
    assert checked["slowest"]["damping_ratio"] == pytest.approx(1.0)
    assert checked["least_damped"]["damping_ratio"] == pytest.approx(least_ratio(2.0), rel=1e-9)
