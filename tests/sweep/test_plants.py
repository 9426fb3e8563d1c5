"""Plants drawn as several blocks: one plant, as a single state-space model is."""

import numpy as np
import pytest
import scipy.linalg
from support.plants import bodies, joint

import wavesweep
from wavesweep.spec import load
from wavesweep.sweep.planning import plan, within_ticks

LIMIT = 4164.33267612  # of kp, from the joint as one state-space model
SPRING = {"type": "spring", "k": "ks"}
ENDS = {"s.x1": "motor.x", "s.x2": "link.x"}


def limits(tables, along="kp", span=(0, 20000), **axes):
    found = wavesweep.compile(tables).stable_intervals(along, span, **axes)
    assert found.certified.all()
    return found[["low", "high"]].to_numpy().tolist()


def with_spring():
    tables = joint(between=("s.f1", "s.f2"), **ENDS)
    return tables | {"block": tables["block"] | {"s": SPRING}}


def turning():
    tables = with_spring()
    turned = {
        name: {"type": "inertia", "inertia": each["mass"], "damping": each.get("damping", 0)}
        for name, each in tables["block"].items()
        if name != "s"
    }
    return tables | {"block": turned | {"s": SPRING}}


@pytest.mark.parametrize(
    "tables",
    [
        joint(),
        joint(between=("ks*link.x - ks*motor.x", "-ks*link.x + ks*motor.x")),
        joint(**{"motor.f": "ks*link.x - (ks + kp)*motor.x - kd*motor.v"}),
        with_spring(),
        turning(),
    ],
    ids=["product", "multiplied out", "joined", "spring", "inertia"],
)
def test_an_elastic_joint_is_one_plant_under_sampled_control(tables):
    ((low, high),) = limits(tables)
    assert (low, high) == (0, pytest.approx(LIMIT, rel=1e-11))


def test_a_force_that_is_held_between_plants_is_a_hold():
    """The lightly damped mode of the joint then gains energy in every tick: no gain is stable."""
    held = joint(between=("s.y", "-s.y"), **{"s.u": "ks*(link.x - motor.x)"})
    (row,) = (
        wavesweep.compile(held | {"block": held["block"] | {"s": {"type": "hold"}}})
        .stable_intervals("kp", (0, 20000))
        .itertuples()
    )
    assert (row.intervals, row.certified) == (0, True)


def test_a_lag_before_an_integrator_is_their_product():
    notch = {"type": "tf", "discrete": True, "num": [0.8079083700287017, -0.4993148324732646, 0.8079083700287017]}
    notch["den"] = [1.0, -0.4993148324732646, 0.6158167400574035]
    tables = {"rates": {"tick_hz": 400}, "numbers": {"k": 10.0}}
    blocks = {"body": {"type": "tf", "num": [1], "den": [1, 0]}, "lag": {"type": "tf", "num": [1], "den": [0.03, 1]}}
    blocks |= {"notch": notch, "pwm": {"type": "delay"}}
    wires = {"notch.u": "body.y", "pwm.u": "-k*notch.y", "lag.u": "pwm.y", "body.u": "lag.y"}
    ((low, high),) = limits(tables | {"block": blocks, "wire": wires}, "k", (0, 2000))
    assert (low, high) == (0, pytest.approx(222.355288, rel=1e-8))


def test_a_stiffer_spring_tends_to_the_rigid_joint():
    """With half of the critical damping; the distance falls as 1/ks. Rounding leaves no proof beyond 1e7 N/m, but digits."""
    body = {"type": "mass", "mass": 0.6, "damping": 0.1}
    ports = {"hand": {"force": "push", "displacement": "m.x"}}
    rigid = {"rates": {"tick_hz": 1000}, "numbers": {"kp": 200.0, "kd": 2.0}, "block": {"m": body}, "ports": ports}
    ((_, limit),) = limits(rigid | {"wire": {"m.f": "-kp*m.x - kd*m.v + push"}})
    between = "ks*({0}.x - {1}.x) + sqrt(ks/12)*({0}.v - {1}.v)"
    damped = joint(between=(between.format("link", "motor"), between.format("motor", "link")))
    found = wavesweep.compile(damped).stable_intervals("kp", (0, 20000), ks=[1e5, 1e6, 1e8, 1e10, 1e12])
    assert found.certified[:2].all()
    away = found.high / limit - 1
    assert ((away > 0) & (away < [0.07, 0.007, 7e-5, 7e-7, 7e-9])).all()


@pytest.mark.parametrize("n", [1, 3, 8])
def test_a_spring_in_n_links_is_one_state_space_model(n):
    """Springs and small masses in a row."""
    blocks = joint()["block"] | {f"l{i}": {"type": "mass", "mass": 0.01} for i in range(1, n)}
    row = ["motor", *(f"l{i}" for i in range(1, n)), "link"]
    wires = {f"{name}.f": [] for name in row}
    size = len(row)
    A, mass, k = np.zeros((2 * size, 2 * size)), [0.1, *[0.01] * (n - 1), 0.5], 1e4 * n
    A[:size, size:], A[size, size] = np.eye(size), -1.0
    for i in range(n):
        for a, b in ((i, i + 1), (i + 1, i)):
            wires[f"{row[a]}.f"].append(f"{n}*ks*({row[b]}.x - {row[a]}.x)")
            A[size + a, [b, a]] += np.array([k, -k]) / mass[a]
    wires = {port: " + ".join(terms) for port, terms in wires.items()}
    wires["motor.f"] += " - kp*motor.x - kd*motor.v"
    wires["link.f"] += " + push"
    B, C = np.zeros((2 * size, 2)), np.zeros((3, 2 * size))
    B[size, 0], B[-1, 1], C[0, 0], C[1, size], C[2, size - 1] = 10, 2, 1, 1, 1
    one = {"type": "ss", "A": A.tolist(), "B": B.tolist(), "C": C.tolist(), "inputs": ["t", "f"], "outputs": ["q", "w", "l"]}
    single = joint() | {"block": {"p": one}, "wire": {"p.t": "-kp*p.q - kd*p.w", "p.f": "push"}}
    single |= {"ports": {"hand": {"force": "push", "displacement": "p.l"}}, "numbers": {"kp": 200.0, "kd": 2.0}}
    found, expected = (wavesweep.compile(each) for each in (joint() | {"block": blocks, "wire": wires}, single))
    np.testing.assert_allclose(*(each.spectral_radius(kp=[10, 500, 3000, 6000]) for each in (found, expected)), rtol=1e-10)
    np.testing.assert_allclose(
        *(each.stable_intervals("kp", (1, 20000))[["low", "high"]] for each in (found, expected)), rtol=1e-10
    )


@pytest.mark.sample(6)
@pytest.mark.parametrize("seed", range(500))
def test_random_plants_are_one_state_space_model(seed):
    many, single, *_ = bodies(seed)
    found, expected = map(wavesweep.compile, (many, single))
    ends = [each.stable_intervals("kp", (0.1, 2e4)) for each in (found, expected)]
    assert all(each.certified.all() for each in ends)
    np.testing.assert_allclose(*(each[["low", "high"]] for each in ends), rtol=1e-10)
    np.testing.assert_allclose(*(each.spectral_radius(kp=[1.0, 100.0, 3000.0]) for each in (found, expected)), rtol=1e-10)


def test_responses_are_those_of_one_state_space_model():
    many, single, *_ = bodies(3)
    found, expected = (wavesweep.compile(each).response([0, 0.1, 1, 10, 90]) for each in (many, single))
    for name in ("admittance_re", "admittance_im", "impedance_re", "impedance_im", "worst_gain"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, atol=1e-9 * np.abs(expected[name]).max())


def radius_of_joint(ks, kp=200.0, kd=2.0, h=1e-3):
    """The joint under PD that is held over a tick, by scipy."""
    A = np.array([[0, 1, 0, 0], [-ks / 0.1, -1, ks / 0.1, 0], [0, 0, 0, 1], [ks / 0.5, 0, -ks / 0.5, 0]])
    whole = scipy.linalg.expm(h * np.block([[A, np.array([[0], [10], [0], [0]])], [np.zeros((1, 5))]]))
    return np.abs(np.linalg.eigvals(whole[:4, :4] + whole[:4, 4:] @ [[-kp, -kd, 0, 0]])).max()


def test_a_number_within_a_plant_is_swept_by_panels():
    """Radii on both sides of each end, by another program."""
    found = wavesweep.compile(joint()).stable_intervals("ks", (10, 1e6), kp=[200.0, 3000.0, 6000.0])
    assert found.certified.all()
    assert (found.intervals > 0).sum() >= 2
    for row in found[found.intervals > 0].itertuples():
        for end, away in ((row.low, -1), (row.high, 1)):
            if 10 < end < 1e6:
                inside, outside = (radius_of_joint(end * (1 + side * away * 1e-6), row.kp) for side in (-1, 1))
                assert inside < 1 < outside
        assert radius_of_joint((row.low + row.high) / 2, row.kp) < 1


def test_the_derivative_of_an_end_in_a_number_within_a_plant_is_known():
    found = wavesweep.why(joint() | {"sweep": {"along": "kp", "kp": {"start": 0, "stop": 20000}}})
    (row,) = found[(found.number == "ks") & (found.side == "high")].itertuples()
    step = 1e-4
    up, down = (limits(joint(10000.0 * (1 + each)))[0][1] for each in (step, -step))
    assert row.elasticity == pytest.approx((up - down) / (2 * step * LIMIT), rel=1e-4)


def test_what_drifts_is_the_plant_as_a_whole():
    free = joint(**{"motor.f": "ks*(link.x - motor.x)"}) | {"numbers": {"ks": 1e4}}
    lines = "\n".join(plan(load(free)))
    assert "drift set aside: motor position, and with it link position, which nothing in the loop holds" in lines
    assert wavesweep.verdict(free)["spectral_radius"] < 1
    low = wavesweep.compile(joint()).response([0.0])
    assert low.admittance_re[0] == pytest.approx(1 / 200 + 1 / 1e4, rel=1e-9)


@pytest.mark.parametrize(("damping", "stable"), [(0.5, True), (-0.5, False)])
def test_a_free_plant_that_no_other_block_reads_has_its_drift_set_aside(damping, stable):
    blocks = {"a": {"type": "mass", "mass": 1, "damping": damping}, "b": {"type": "mass", "mass": 1}}
    wires = {"a.f": "k*(b.x - a.x)", "b.f": "k*(a.x - b.x)", "c.f": "a.x", "d.f": "c.x"}  # c and d only watch
    blocks |= {"c": {"type": "mass", "mass": 1, "damping": 1}, "d": {"type": "mass", "mass": 1, "damping": 1}}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"k": 100.0}, "block": blocks, "wire": wires}
    (row,) = wavesweep.compile(tables).stable_intervals("k", (1.0, 1e4)).itertuples()
    assert (row.certified, row.intervals) == (True, int(stable))
    assert (wavesweep.verdict(tables)["spectral_radius"] < 1) == stable


def test_check_says_what_is_continuous_and_what_is_sampled():
    lines = plan(load(joint()))
    for line in (
        "  runs in every tick: motor (mass), link (mass)",
        "  one plant, within which all acts continuously: motor, link",
        "    motor.f: ks*link.x - ks*motor.x",
        "    link.f: ks*motor.x - ks*link.x",
        "  from samples of every tick, and held over it: motor.f: -kp*motor.x - kd*motor.v",
    ):
        assert line in lines


@pytest.mark.parametrize(
    ("damping", "every", "rings"), [(0, 5, ["v, torque"]), (1, 5, ["v, torque"]), (1, 0, ["v"]), (0, 0, [])]
)
def test_check_names_the_blocks_that_are_solved_within_a_tick(damping, every, rings):
    """An implicit velocity under a torque that reads it in the same tick; every = 0: by a delay, which is no ring."""
    hold = {"type": "hold", "every": every} if every else {"type": "delay"}
    blocks = {name: {"type": "integrator", "method": method} for name, method in (("v", "implicit"), ("x", "explicit"))}
    wires = {"torque.u": "-kp*x.y - kd*v.y", "v.u": "(torque.y - d*v.y)/0.027", "x.u": "v.y"}
    numbers = {"kp": 17.0, "kd": 0.5, "d": damping}
    spec = load({"rates": {"tick_hz": 500}, "numbers": numbers, "block": blocks | {"torque": hold}, "wire": wires})
    start = "solved within a tick: "
    found = [line.removeprefix(start) for line in within_ticks(spec) if line.startswith(start)]
    assert [line.partition(":")[0] for line in found] == rings


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_a_spring_with_one_end_is_held_by_the_ground(damping):
    """As the keys `stiffness` and `damping` of the mass are; as a term of a wire it would be held over the tick."""
    wires = {"late.u": "m.x", "m.f": "-kp*late.y - kd*m.v"}
    numbers, late = {"kp": 100.0, "kd": 2.0, "kh": 300.0}, {"type": "delay"}
    own = {"m": {"type": "mass", "mass": 0.1, "stiffness": "kh", "damping": damping}, "late": late}
    apart = {"m": {"type": "mass", "mass": 0.1}, "late": late, "grip": {"type": "spring", "k": "kh", "d": damping}}
    ends = {"grip.x1": "m.x", "m.f": f"{wires['m.f']} + grip.f1"} | ({"grip.v1": "m.v"} if damping else {})
    drawn = [(own, wires), (apart, wires | ends)]
    (one, other) = (
        wavesweep.compile({"rates": {"tick_hz": 1000}, "numbers": numbers, "block": block, "wire": wire}).stable_intervals(
            "kp", (0.0, 5000.0)
        )
        for block, wire in drawn
    )
    assert one.certified.all()
    assert other.certified.all()
    assert other.high[0] == pytest.approx(one.high[0], rel=1e-9)
    missing = {"rates": {"tick_hz": 1000}, "numbers": numbers, "block": apart, "wire": wires | ends | {"grip.v2": "0*m.v"}}
    with pytest.raises(wavesweep.errors.SpecError, match=r"grip\.x2"):
        load(missing)
