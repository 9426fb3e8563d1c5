"""The recipes: each runs with the command that it names, and its answer is that of loops over ticks and of closed formulas."""

import functools
import pathlib
import re
import shutil
import tomllib

import numpy as np
import pytest
from scipy.optimize import brentq
from support.recipes import FRAMES, radius

import wavesweep
from wavesweep.cli import main
from wavesweep.results import read

FOLDER = pathlib.Path(__file__).parents[1] / "sweeps" / "recipes"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
TEXTS = {name: (FOLDER / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES}
WHOLE = {"n", "N", "k"}  # numbers of ticks


@functools.cache
def table(name):
    """The recipe's own table, as the library gives it."""
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
    return {key: given["value"] for key, given in numbers.items()}


def ends(name, **fixed):
    """(low, high) of the stable intervals at these values; those of the recipe's table where it has them."""
    rows, wanted = table(name), defaults(name) | fixed
    rows = rows[np.logical_and.reduce([rows[axis] == wanted[axis] for axis in rows.columns if axis in wanted])]
    if not len(rows) or not fixed.keys() <= set(rows.columns):
        loop = wavesweep.compile(tomllib.loads(TEXTS[name]))
        rows = loop.stable_intervals(**{key: [value] for key, value in fixed.items()})
    return list(zip(rows.low, rows.high, strict=True))


def test_every_recipe_has_a_witness():
    assert set(FRAMES) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_recipe_says_what_is_known_and_what_is_assumed(name):
    for mark in ("Answer:", "From sources:", "Assumed:"):
        assert len(re.findall(rf"^# {mark}", TEXTS[name], re.MULTILINE)) == 1
    assert re.search(r"^# (Asked|Code) (in|by) ", TEXTS[name], re.MULTILINE)


@pytest.mark.sample(2)
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
    assert f"all {len(rows['certified'])} rows certified" in capsys.readouterr().err
    assert main(["check", words[1]]) == 0


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


SHOWN = [
    ("physics-joint", {"h": 0.005, "kd": 6.3088}, "6539.83"),
    ("physics-joint", {"h": 0.005, "kd": 1.0}, "4416.31"),
    ("physics-joint", {"h": 0.002, "kd": 1.0}, "26101.9"),
    ("policy", {"g": 0.0, "zeta": 2.0, "n": 10}, "7.9577"),
    ("policy", {"g": 0.0, "zeta": 2.0, "n": 5}, "15.9155"),
    ("policy", {"g": 3.0, "zeta": 1.0, "n": 5}, "7.305"),
    ("policy", {"g": 1.0, "zeta": 1.0, "n": 5}, "31.831"),
    ("teleoperation", {"n": 20}, "0.5306"),
    ("teleoperation", {"n": 10}, "0.2909"),
    ("teleoperation", {"n": 20, "kp": 120.0}, "0.2968"),
    ("engine", {"grip": 0, "N": 5}, "7.711"),
    ("engine", {"grip": 1, "N": 5}, "1208.4"),
    ("engine", {"grip": 0, "N": 1}, "9.037"),
    ("engine", {"grip": 1, "N": 1}, "1555.3"),
    ("wheel", {"grip": 0, "n": 5}, "27.80"),
    ("wheel", {"grip": 0, "n": 20}, "9.115"),
    ("wheel", {"grip": 1, "n": 5}, "306.9"),
    ("wheel", {"grip": 1, "n": 20}, "101.5"),
    ("wheel", {"grip": 0, "n": 5, "B": 0.3}, "183.9"),
    ("wheel", {"grip": 0, "n": 20, "B": 0.3}, "71.61"),
    ("wheel", {"grip": 0, "n": 5, "J": 0.06}, "27.79"),
    ("hybrid-test", {"n": 1}, "3.372"),
    ("hybrid-test", {"n": 3}, "7.842"),
    ("hybrid-test", {"n": 5}, "12.249"),
    ("hybrid-test", {"n": 10}, "22.791"),
    ("hybrid-test", {"n": 20}, "40.820"),
    ("network", {"k": 1}, "111.11"),
    ("network", {"k": 4}, "166.67"),
    ("network", {"k": 6}, "166.67"),
    ("network", {"k": 10}, "100.00"),
    ("network", {"k": 15}, "66.667"),
    ("two-rate-wall", {"B": 20.0, "n": 10}, "129770"),
    ("two-rate-wall", {"B": 20.0, "n": 20}, "42150"),
    ("two-rate-wall", {"B": 50.0, "n": 20}, "28813"),
    ("two-rate-wall", {"B": 20.0, "n": 1}, "400000"),
    ("two-rate-wall", {"B": 0.0, "n": 10}, "10001"),
    ("long-delay", {"n": 0}, "3920.8"),
    ("long-delay", {"n": 1}, "1303.7"),
    ("long-delay", {"n": 5}, "346.04"),
    ("long-delay", {"n": 20}, "81.689"),
]


@pytest.mark.sample(5)
@pytest.mark.slow
@pytest.mark.parametrize(("name", "fixed", "shown"), SHOWN)
def test_the_answers_are_those_of_the_comments(name, fixed, shown):
    digits = len(shown.partition(".")[2])
    assert shown in {f"{end:.{digits}f}" for pair in ends(name, **fixed) for end in pair}
    assert shown in numbers_of(name)


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
