"""The recipes: each runs with the command that it names, and its answer is that of loops over ticks and of closed formulas."""

import functools
import pathlib
import re
import shutil
import tomllib

import numpy as np
import pytest
from scipy.optimize import brentq
from support.recipes import in_stator, radius

import wavesweep
from wavesweep.program.cli import main
from wavesweep.program.results import read

FOLDER = pathlib.Path(__file__).parents[2] / "sweeps" / "recipes"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
TEXTS = {name: (FOLDER / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES}
WHOLE = {"n", "N", "k"}  # numbers of ticks


@functools.cache
def table(name):
    """The recipe's own table, as the library gives it, without rows for all messages."""
    rows = whole_table(name)
    return rows[rows.guarantee == "spec"] if "guarantee" in rows else rows


@functools.cache
def whole_table(name):
    function = wavesweep.zwidth if command(name) == "zwidth" else wavesweep.stability_region
    return function(tomllib.loads(TEXTS[name]))


def command(name):
    """The command of the recipe's comment, which has to be one that finds stable intervals of this file."""
    return re.search(rf"^#     wavesweep (\S+) sweeps/recipes/{name}\.toml$", TEXTS[name], re.MULTILINE)[1]


def numbers_of(name):
    """The numbers in the paragraphs of the comment that begin with "Answer:"."""
    found = re.search(r"^# Answer:(.*?)^# From sources:", TEXTS[name], re.MULTILINE | re.DOTALL)[1]
    return set(re.findall(r"\d+(?:\.\d+)?", found))


def defaults(name):
    numbers = tomllib.loads(TEXTS[name])["numbers"]
    return {key: given["value"] for key, given in numbers.items() if isinstance(given, dict)}


def ends(name, **fixed):
    """(low, high) of the stable intervals at these values; those of the recipe's table where it has them."""
    rows, wanted = table(name), defaults(name) | fixed
    rows = rows[np.logical_and.reduce([rows[axis] == wanted[axis] for axis in rows.columns if axis in wanted])]
    if not len(rows) or not fixed.keys() <= set(rows.columns):
        loop = wavesweep.compile(tomllib.loads(TEXTS[name]))
        rows = loop.stable_intervals(**{key: [value] for key, value in fixed.items()})
    return list(zip(rows.low, rows.high, strict=True))


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(FOLDER.rglob("*.toml")), ids=lambda path: path.stem)
def test_a_recipe_runs_with_the_command_that_it_names(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(FOLDER, tmp_path / "sweeps" / "recipes")
    words = re.search(r"^#     wavesweep (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)[1].split()
    assert words[1:] == [f"sweeps/recipes/{path.relative_to(FOLDER).as_posix()}"]
    assert main(words) == 0
    rows = read(tmp_path / "results" / path.stem / f"{words[0]}.csv")
    assert rows["certified"].all()
    kinds = len(set(rows["guarantee"].tolist())) if "guarantee" in rows else 1
    assert f"all {len(rows['certified']) // kinds} rows certified" in capsys.readouterr().err
    assert main(["check", words[1]]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert (len(lines) <= 18, max(map(len, lines)) <= 100) == (True, True), lines


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_recipe_has_the_intervals_of_loops_over_ticks(name):
    """Stable on one side of every end and unstable on the other, a billionth away, and as stable as it says on a grid."""
    found, sweep = table(name), tomllib.loads(TEXTS[name])["sweep"]
    along = sweep.get("along", "K")
    axes, span = [key for key in sweep if key not in ("along", along)], (sweep[along]["start"], sweep[along]["stop"])
    grid = np.linspace(*span, 42)[1:-1]
    for key, rows in found.groupby(axes):
        numbers = defaults(name) | dict(zip(axes, key, strict=True))
        numbers |= {each: int(numbers[each]) for each in WHOLE & numbers.keys()}
        low, high = rows.low.to_numpy(), rows.high.to_numpy()
        for end, inside in [*((end, 1) for end in low), *((end, -1) for end in high)]:
            if not np.isnan(end) and end not in span:
                at = [radius(name, {**numbers, along: end * (1 + side * 1e-9)}) for side in (inside, -inside)]
                assert at[0] < 1 < at[1]
        stable = ((grid > low[:, None]) & (grid < high[:, None])).any(0)
        assert [radius(name, {**numbers, along: value}) < 1 for value in grid] == stable.tolist()


# Of each recipe the numbers that are given, then their values and the end that the comment shows.
ANSWERS = {
    "physics-joint": "h, kd: 0.005 6.3088 = 6539.83, 0.005 1 = 4416.31, 0.002 1 = 26101.9",
    "policy": "g, zeta, n: 0 2 10 = 7.9577, 0 2 5 = 15.9155, 3 1 5 = 7.305, 1 1 5 = 31.831",
    "teleoperation": "n: 20 = 0.5306, 10 = 0.2909; n, kp: 20 120 = 0.2968",
    "engine": "grip, N: 0 5 = 7.711, 1 5 = 1208.4, 0 1 = 9.037, 1 1 = 1555.3",
    "wheel": (
        "grip, n: 0 5 = 27.80, 0 20 = 9.115, 1 5 = 306.9, 1 20 = 101.5; grip, n, B: 0 5 0.3 = 183.9, "
        "0 20 0.3 = 71.61; grip, n, J: 0 5 0.06 = 27.79"
    ),
    "random-loss": "p, b: 0 0 = 4000.00, 0.1 0.005 = 4000.00",
    "late-messages": "k: 4 = 100.00, 15 = 100.00",
    "lost-commands": "n: 0 = 4000.00, 1 = 4000.00",
    "hybrid-test": "n: 1 = 3.372, 3 = 7.842, 5 = 12.249, 10 = 22.791, 20 = 40.820",
    "network": "k: 1 = 111.11, 4 = 166.67, 6 = 166.67, 10 = 100.00, 15 = 66.667",
    "two-rate-wall": "B, n: 20 10 = 129770, 20 20 = 42150, 50 20 = 28813, 20 1 = 400000, 0 10 = 10001",
    "long-delay": "n: 0 = 3920.8, 1 = 1303.7, 5 = 346.04, 20 = 81.689",
    "cascade": "h: 0.02 = 110.93, 0.02 = 976.49, 0.002 = 20.31, 0.002 = 9980.0",
    "co-simulation": (
        "H, n: 0.04 1 = 5.6007, 0.04 4 = 3.7240, 0.04 16 = 3.1955, 0.01 1 = 1.5653, 0.01 4 = 0.9832, 0.01 16 = 0.8363"
    ),
    "current-loop": (
        "h, x: 0.000132 1 = 1205.832, 2.5e-05 1 = 6366.220, 0.000132 1.5 = 952.026, 2.5e-05 1.5 = 5015.601, "
        "0.000132 2 = 705.465, 2.5e-05 2 = 3724.514"
    ),
    "turning-rotor": (
        "f, a, c: 250 0 0 = 750.07, 250 0 1 = 565.94, 250 1.5 1 = 1789.37, 250 1.5 0 = 3000, 500 0 0 = 869.39, "
        "500 0 1 = 582.64, 500 1.5 1 = 1717.30, 500 1.5 0 = 2231.30"
    ),
    "salient-rotor": (
        "f, t, c: 250 0 0 = 1463.95, 250 0 1 = 564.09, 250 1 0 = 1614.10, 250 1 1 = 1551.60, 500 0 0 = 977.19, "
        "500 0 1 = 996.71, 500 1 0 = 1240.07, 500 1 1 = 1428.85"
    ),
    "decimation": "kd, n: 0 1 = 4544.000, 0 4 = 81.336, 2 1 = 3744.000, 2 4 = 280.719",
    "batch-reactor": "n: 2 = 0.0657931, 1 = 0.131597",
    "admittance": (
        "M, K, tau: 11.25 1000 0.006 = 11.960, 11.25 10000 0.006 = 116.219, 11.25 100000 0.006 = 960.32, "
        "50 10000 0.006 = 119.100, 2 10000 0.006 = 103.720, 11.25 10000 0.009 = 143.868"
    ),
    "notch": "f, q: 80 2 = 222.355, 40 2 = 179.175, 20 2 = 125.998, 80 4 = 244.631; depth: 1 = 272.687",
    "engine-rates": (
        "kd, N: 0.5 5 = 328.80, 0.5 10 = 60.000, 0.5 6 = 155.855, 0.5 6 = 199.528, 0.5 6 = 238.246, "
        "0.1 5 = 376.80, 0.1 10 = 12.000, 0.1 6 = 23.912"
    ),
    "late-camera": "s: 0 = 8.3109, 1 = 46.562; s, m: 1 1.25 = 25.958",
    "two-axes": "phi, q2, kh: 1.6 1.4 0 = 967.22, 0 1.4 0 = 597.25, 0 1.4 400 = 493.73",
    "quadrotor": "n: 0 = 12.746, 5 = 6.0074, 15 = 2.7448",
    "exposure": "n, T: 2 0.1 = 5.3590, 1 0.1 = 8.2843, 0 0.1 = 20.000, 2 0.05 = 10.7180",
}


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", ANSWERS)
def test_the_answers_are_those_of_the_comments(name):
    for part in ANSWERS[name].split("; "):
        keys, rows = part.split(": ")
        for values, shown in (row.split(" = ") for row in rows.split(", ")):
            fixed, digits = map(float, values.split()), len(shown.partition(".")[2])
            pairs = ends(name, **dict(zip(keys.split(", "), fixed, strict=True)))
            assert shown in {f"{end:.{digits}f}" for pair in pairs for end in pair}
            assert shown in numbers_of(name)


@pytest.mark.slow
def test_an_arm_whose_commands_are_lost():
    """A constant interval of n + 1 ticks makes it unstable at 2 kd/((n + 1) h); some patterns do so earlier."""
    rows = whole_table("lost-commands")
    rows, given = rows[rows.guarantee != "spec"], defaults("lost-commands")
    limits = 2 * given["kd"] / ((rows.n + 1) * 1e-3)
    assert rows.settled.all()
    assert (rows.fails_from < 1.000001 * limits).all()
    assert (rows.high > np.where(rows.n < 10, 0.99, 0.96) * limits).all()
    assert {"352.2", "355.5"} <= numbers_of("lost-commands")


@pytest.mark.slow
def test_messages_that_are_late_by_other_times():
    """A message in time and one that is r h late, in turn, for ever: the matrices of both, by hand."""
    rows = whole_table("late-messages")
    rows = rows[rows.guarantee != "spec"].set_index("k")
    assert rows.settled.all()
    assert f"{rows.high[4]:.3f}" == "99.988"
    assert [f"{rows.high[15]:.3f}", f"{rows.fails_from[15]:.3f}"] == ["58.571", "58.579"]
    assert {"99.988", "58.571", "58.579"} <= numbers_of("late-messages")

    def radius(K, r=0.75):
        step = K * 0.02
        prompt = np.array([[1 - step, 0], [-step, 0]])  # x, and what is shown times h
        late = np.array([[1 - step * (1 - r), r], [-step, 0]])
        return np.abs(np.linalg.eigvals(late @ prompt)).max()

    assert brentq(lambda K: radius(K) - 1, 50, 66) == pytest.approx(rows.fails_from[15], rel=1e-6)


@pytest.mark.slow
def test_an_arm_whose_messages_are_lost_at_random():
    rows = whole_table("random-loss")
    rows = rows[rows.guarantee == "mean_square"].set_index(["p", "b"])
    assert rows.settled.all()
    shown = {f"{rows.high[each]:.1f}" for each in ((0.01, 0), (0.05, 0), (0.1, 0), (0, 0.005), (0.1, 0.005))}
    assert shown == {"3914.3", "3589.0", "3218.2", "1680.7", "1552.0"}
    assert shown <= numbers_of("random-loss")
    assert (rows.fails_from < 1.00002 * rows.high).all()


def test_a_joint_of_a_physics_engine():
    """kp < (4 I + 2 h kd)/h^2, and the thread's bound of w h in terms of the damping ratio."""
    rows, I = table("physics-joint"), defaults("physics-joint")["I"]
    np.testing.assert_allclose(rows.high, (4 * I + 2 * rows.h * rows.kd) / rows.h**2, rtol=1e-9)
    w = np.sqrt(rows.high / I)
    zeta = rows.kd / (2 * I * w)
    np.testing.assert_allclose(w * rows.h, 2 * zeta + 2 * np.sqrt(zeta**2 + 1), rtol=1e-9)
    loop, kp = wavesweep.compile(str(FOLDER / "physics-joint.toml")), I * (200 * np.pi) ** 2
    assert loop.stable_intervals("kd", (0, 100), kp=[kp]).low[0] == pytest.approx(14.73, abs=0.01)


@pytest.mark.slow
def test_pd_behind_a_policy():
    """f < 1/(2 pi zeta T) if the policy reacts little: kd < 2 I/T, where kp < 2 kd/T is weaker."""
    rows = table("policy")
    little = rows[rows.g <= 1]
    np.testing.assert_allclose(little.high, 1 / (2 * np.pi * little.zeta * little.n * 1e-3), rtol=1e-9)


@pytest.mark.slow
def test_the_friction_compensation_of_a_teleoperated_arm():
    """Close to Fv + kp tau, which the program's slope exceeds at both rates; more kp is better, and a faster host is worse."""
    rows, given = table("teleoperation"), defaults("teleoperation")
    np.testing.assert_allclose(rows.high, given["Fv"] + rows.kp * (rows.n - 0.5) * 1e-4, rtol=1e-2)
    assert given["c"] == pytest.approx(0.1 * 28.417 * 0.306 + given["Fv"], abs=5e-4)
    assert (rows.high[rows.kp == given["kp"]] < given["c"]).all()
    assert (rows.groupby("n").high.diff().dropna() > 0).all()
    assert (rows.groupby("kp").high.diff().dropna() > 0).all()


@pytest.mark.slow
def test_the_damping_of_a_hybrid_test():
    """Close to that of the delay differential equation whose delay has half a tick more; 6 ms are allowed, and 7 are not."""
    given = defaults("hybrid-test")
    for row in table("hybrid-test").itertuples():
        late = (row.n + 0.5) * 1e-3
        w = brentq(lambda w, late=late: given["k"] + given["ks"] * np.cos(w * late) - given["m"] * w * w, 1, 60)
        assert row.low == pytest.approx(given["ks"] * np.sin(w * late) / w, rel=5e-3)
    assert ends("hybrid-test", n=6)[0][0] < given["c"] < ends("hybrid-test", n=7)[0][0]


def test_an_integrator_over_a_network():
    rows = table("network")
    r = rows.k / 20
    limit = np.where(r < 0.5, np.minimum(1 / r, 1 / np.where(r < 0.5, 0.5 - r, 1)), 1 / r) / 0.02
    np.testing.assert_allclose(rows.high, limit, rtol=1e-9)


def test_delays_longer_than_a_frame():
    """The curve of the comment at the recipe's own damping, up to where it ends in K = 0; beyond, no wall is stable."""

    def curve(t, late):
        R = 4 * np.sin(t / 2) ** 2 / np.cos(t / 2)
        b = R * np.sin(late * t) / np.sin(t)
        return b, R * np.cos(late * t) - b * (1 - np.cos(t))

    rows = table("long-delay")
    for row in rows.itertuples():
        late, b = row.n + 0.5, row.B * 1e-3 / 0.1
        t = np.linspace(1e-6, min(np.pi, np.pi / late) * (1 - 1e-6), 10001)
        t = t[curve(t, late)[1] > 0][-1]
        if curve(t, late)[0] < b:
            assert (row.intervals, row.certified) == (0, 1)
            continue
        t = brentq(lambda t, b=b, late=late: curve(t, late)[0] - b, 1e-6, t, xtol=1e-15, rtol=1e-14)
        assert row.high == pytest.approx(curve(t, late)[1] * 0.1 / 1e-6, rel=1e-9)
    assert rows[rows.intervals == 0][["B", "n"]].to_numpy().tolist() == [[8, 20]]


def test_the_periods_of_a_cascade():
    """Along the period, a gain that is best is neither the weakest nor the strongest; a march a billionth away agrees."""
    rows = wavesweep.compile(str(FOLDER / "cascade.toml")).stable_intervals("h", (1e-4, 0.1), k=[100, 200, 800])
    for k, end, shown in zip((100, 200, 800), rows.high, ("18.8528", "32.0468", "20.5790"), strict=True):
        given = defaults("cascade") | {"k": k}
        assert radius("cascade", given | {"h": end * (1 - 1e-9)}) < 1 < radius("cascade", given | {"h": end * (1 + 1e-9)})
        assert f"{end * 1e3:.4f}" == shown
        assert shown in numbers_of("cascade")
    assert ends("cascade", h=0.02)[0] == pytest.approx((110.9342847390224, 976.485367525044), rel=1e-12)


def test_substeps_of_a_co_simulation():
    """Close to the delay differential equation of the mode in which the masses move against each other. Without damping no
    window is stable that is shorter than that mode's period."""
    k, coupling = 4 * np.pi**2, 16 * np.pi**2
    for row in table("co-simulation").itertuples():
        late = row.H * (row.n + 1) / (2 * row.n)
        w = brentq(lambda w, late=late: k + coupling + coupling * np.cos(w * late) - w * w, 10, 25)
        assert row.low == pytest.approx(coupling * np.sin(w * late) / w, rel=0.04)
    windows = np.geomspace(1e-3, 1 / 3, 60)
    assert min(radius("co-simulation", {"c": 0.0, "H": H, "n": n, "m": 1.0}) for H in windows for n in (1, 4, 16)) > 1


def test_the_dead_time_of_a_current_loop():
    """A pass at 132 us with 300 Hz, and passes that take so long as the bandwidth is to the limit."""
    assert "5.223" in numbers_of("current-loop")
    found = wavesweep.compile(str(FOLDER / "current-loop.toml")).stable_intervals("x", (0.1, 10))
    assert found.high[0] == pytest.approx(5.223, abs=5e-4)
    given = defaults("current-loop")
    at = [radius("current-loop", given | {"x": found.high[0] * (1 + side * 1e-9)}) for side in (-1, 1)]
    assert at[0] < 1 < at[1]


@pytest.mark.slow
def test_a_rotor_that_turns_while_its_voltage_stands_still():
    """A step of the wanted current, marched in the frame of the stator, where the rotor has an angle in each pass."""
    tables = tomllib.loads(TEXTS["turning-rotor"])
    given = {key: value["value"] for key, value in tables["numbers"].items() if isinstance(value, dict)} | {"a": 1.5, "c": 0.7}
    fe, f, a, c, hz, R, L = (given[key] for key in ("fe", "f", "a", "c", "hz", "R", "L"))
    (table,) = wavesweep.simulate({**tables, "numbers": tables["numbers"] | {"a": 1.5, "c": 0.7}})
    i = integral = late = 0.0  # the current and the late voltage as the stator sees them
    found = []
    for k, wanted in enumerate(table["ref"]):
        own = i * np.exp(-2j * np.pi * fe * k / hz)
        found.append(own)
        integral += (1j * wanted - own) / hz
        asked = 2 * np.pi * f * (L * (1j * wanted - own) + R * integral) + 2j * np.pi * fe * c * L * own
        rest = np.exp(-R / L / hz)
        i = rest * i + (1 - rest) / R * late
        late = asked * np.exp(2j * np.pi * fe * (k + a) / hz)
    np.testing.assert_allclose(table["flux"] + 1j * table["torque"], found, rtol=0, atol=1e-12)
    assert np.abs(found).max() > 1
    passes = [given["hz"] / end for (_, end) in (ends("turning-rotor", f=250.0, a=0.0, c=share)[0] for share in (0.0, 1.0))]
    assert {f"{passes[0]:.0f}", f"{passes[1]:.1f}"} <= numbers_of("turning-rotor")


@pytest.mark.slow
def test_a_salient_rotor_whose_voltage_stands_still():
    """A step of the wanted current, marched in the frame of the stator by Runge-Kutta."""
    tables = tomllib.loads(TEXTS["salient-rotor"])
    n = defaults("salient-rotor") | {"t": 0.3, "c": 0.6}
    w, h, R, L, mean = 2 * np.pi * n["fe"], 1 / n["hz"], n["R"], np.diag([n["Ld"], n["Lq"]]), (n["Ld"] + n["Lq"]) / 2
    own, cross = 0.3 * L + 0.7 * mean * np.eye(2), np.array([[0, -1], [1, 0]])
    (table,) = wavesweep.simulate({**tables, "numbers": tables["numbers"] | {"t": 0.3, "c": 0.6}})
    flux, late, integral, found = *np.zeros((3, 2)), []
    for k, wanted in enumerate(table["ref"]):
        angle = w * h * k
        turned, ahead = (np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (angle, angle + 1.5 * w * h))
        current = np.linalg.inv(L) @ turned.T @ flux
        found.append(current)
        error = np.array([0, wanted]) - current
        integral = integral + h * error
        asked = 2 * np.pi * n["f"] * (own @ error + R * integral) + 0.6 * w * cross @ own @ current
        flux, late = in_stator(flux, late, angle, w, h, R, n["Ld"], n["Lq"]), ahead @ asked
    np.testing.assert_allclose(np.stack([table["flux"], table["torque"]], 1), found, rtol=0, atol=1e-11)
    assert np.abs(found).max() > 1


def test_a_torque_that_is_held_for_the_decimation():
    given = defaults("decimation")
    h, I, d = given["h"], given["I"], given["d"]
    rows = table("decimation")
    every = rows[rows.n == 1]
    np.testing.assert_allclose(every.high, (4 * I + 2 * h * (d - every.kd)) / h**2, rtol=1e-12)
    loop = wavesweep.compile(str(FOLDER / "decimation.toml"))
    rows = loop.stable_intervals(d=[0.0], kd=[0.1, 0.5, 2.0], n=[2, 4])
    np.testing.assert_allclose(rows.high, 2 * rows.kd / ((rows.n - 1) * h), rtol=1e-12)
    assert given["kp"] < table("decimation").high.min()


def test_messages_in_turn():
    """The limit that is known of this reactor, and hardly less than half of that of both outputs in each message."""
    found = table("batch-reactor").set_index("n").high
    assert found[2] == pytest.approx(0.06579306090414097, rel=1e-13)
    assert found[2] == pytest.approx(found[1] / 2, rel=1e-4)


def test_the_damping_of_an_admittance_controlled_arm():
    """Below K (tau + T + half a tick), to which it tends with the virtual mass."""
    given, rows = defaults("admittance"), table("admittance")
    limit = rows.K * (rows.tau + given["T"] + 0.001)
    assert (rows.low < limit).all()
    heavy = (rows.M == 50) & (rows.K <= 10000)
    np.testing.assert_allclose(rows.low[heavy], limit[heavy], rtol=0.011)
    assert (rows.sort_values("M").groupby(["K", "tau"]).low.diff().dropna() > 0).all()
    stiffest = wavesweep.compile(str(FOLDER / "admittance.toml")).stable_intervals("K", (0, 20000)).high[0]
    assert f"{stiffest:.0f}" == "1045"
    assert "1045" in numbers_of("admittance")


def test_a_notch_beyond_half_the_rate():
    """The gain that is known at 80 Hz; at 215 Hz the program's filter is unstable, and the block is refused."""
    assert ends("notch", f=80, q=2)[0][1] == pytest.approx(222.355288, abs=5e-7)
    given = defaults("notch")
    assert min(radius("notch", given | {"k": k, "f": 215.0}) for k in np.linspace(0, 1000, 101)) > 1
    with pytest.raises(wavesweep.SpecError, match="half the block's own rate"):
        wavesweep.load(FOLDER / "notch.toml", ["f=215"])


def test_a_controller_beside_a_physics_engine():
    """In every step, and in every second one."""
    rows, I, h = table("engine-rates"), defaults("engine-rates")["I"], 1 / 60
    every, second = rows[rows.N == 5], rows[rows.N == 10]
    np.testing.assert_allclose(every.high, (4 * I - 2 * h * every.kd) / h**2, rtol=1e-12)
    np.testing.assert_allclose(second.high, 2 * second.kd / h, rtol=1e-12)


def test_the_average_over_an_exposure():
    rows = table("exposure")
    limits = {0: 2.0, 1: 2 * np.sqrt(2) - 2, 2: 4 - 2 * np.sqrt(3)}
    np.testing.assert_allclose(rows.high * rows["T"], rows.n.map(limits), rtol=1e-12)


@pytest.mark.slow
def test_a_quadrotor_of_any_inertia():
    """The heaviest one sets the limit: what is proved is within 1 % of its own, and with it the loop is as stable as that."""
    rows = whole_table("quadrotor")
    rows = rows[rows.guarantee == "for_all"].set_index("n")
    assert rows.settled.all()
    assert {f"{high:.3f}" for high in rows.high} == {"8.886", "5.209", "2.631"} <= numbers_of("quadrotor")
    for n, row in rows.iterrows():
        for J in (0.015, 0.02, 0.03):
            assert radius("quadrotor", defaults("quadrotor") | {"n": n, "J": J, "kv": row.high}) < 1
        heavy = brentq(lambda kv, n=n: radius("quadrotor", defaults("quadrotor") | {"n": n, "J": 0.03, "kv": kv}) - 1, 1, 15)
        assert row.high < heavy < 1.01 * row.high
        assert row.fails_from == pytest.approx(heavy, rel=1e-6)


@pytest.mark.slow
def test_pictures_that_are_lost():
    """Proved with an observer and without: below the limit in which every picture arrives, and lost ones matter without it."""
    rows = whole_table("late-camera")
    rows = rows[rows.guarantee == "for_all"].set_index("s")
    assert rows.settled.all()
    assert 7.188 < rows.high[0] < 8.3109
    assert 46.4 < rows.high[1] < 46.562
    assert {"7.188", "8.3109", "46.4", "46.562", "20"} <= numbers_of("late-camera")
    lost = ["c=5", "sweep.g.stop=20", "sweep.s=[1]"]
    found = wavesweep.stability_region(wavesweep.load(FOLDER / "late-camera.toml", lost))
    assert found[found.guarantee == "for_all"].high.tolist() == [20]


@pytest.mark.slow
def test_a_wall_in_any_direction_at_any_pose():
    """What is proved for all of them is less than for any, and next to what the worst of a grid has."""
    ranges = {"phi": {"start": 0, "stop": 3.1416}, "q2": {"start": 0.4, "stop": 1.4}}
    tables = tomllib.loads(TEXTS["two-axes"]) | {"for_all": ranges, "sweep": {"K": {"start": 1, "stop": 2000}, "kh": [400]}}
    rows = wavesweep.zwidth(tables)
    proved = rows[rows.guarantee == "for_all"].high.item()
    numbers = defaults("two-axes") | {"kh": 400.0}
    worst = max(
        radius("two-axes", numbers | {"phi": phi, "q2": q2, "K": 1.01 * proved})
        for phi in np.linspace(0, 3.1416, 41)
        for q2 in np.linspace(0.4, 1.4, 21)
    )
    assert worst > 1
    assert f"{proved:.1f}" in numbers_of("two-axes")
    for phi, q2 in np.random.default_rng(0).uniform([0, 0.4], [3.1416, 1.4], (200, 2)):
        assert radius("two-axes", numbers | {"phi": phi, "q2": q2, "K": proved}) < 1
