"""The recipes: each runs with the command that it names, and its answer is that of an interpreter of the documents."""

import functools
import pathlib
import re
import shutil
import tomllib

import numpy as np
import pytest
from meaning.attacked import judge_row
from meaning.members import with_numbers
from meaning.reading import drift_of, radius_of

import wavesweep
from wavesweep.program.cli import main
from wavesweep.program.results import read

FOLDER = pathlib.Path(__file__).parents[2] / "sweeps" / "recipes"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
TEXTS = {name: (FOLDER / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES}
SETS = ("late-camera", "late-messages", "lost-commands", "quadrotor", "random-loss")  # with rows that hold for all of a set


@functools.cache
def whole_table(name):
    """The recipe's own table, as the library gives it."""
    function = wavesweep.zwidth if command(name) == "zwidth" else wavesweep.stability_region
    return function(tomllib.loads(TEXTS[name]))


def table(name, of_sets=False):
    """The rows of the spec's own loops, or those of sets."""
    rows = whole_table(name)
    return rows[(rows.guarantee != "spec") == of_sets] if "guarantee" in rows else rows


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


def ends(name, of_sets=False, **fixed):
    """(low, high) of the stable intervals at these values; those of the recipe's table where it has them."""
    rows, wanted = table(name, of_sets), defaults(name) | fixed
    rows = rows[np.logical_and.reduce([rows[axis] == wanted[axis] for axis in rows.columns if axis in wanted])]
    if not len(rows) or not fixed.keys() <= set(rows.columns):
        loop = wavesweep.compile(tomllib.loads(TEXTS[name]))
        rows = loop.stable_intervals(**{key: [value] for key, value in fixed.items()})
    return list(zip(rows.low, rows.high, strict=True))


def slices(name, rows):
    """The rows of each slice, with the tables of its loop, and the axis of the intervals with its range."""
    tables = tomllib.loads(TEXTS[name])
    sweep = tables["sweep"]
    along = sweep.get("along", "K")
    axes = [key for key in sweep if key not in ("along", along)]
    for key, some in rows.groupby(axes):
        yield some, with_numbers(tables, dict(zip(axes, key, strict=True))), along, sweep[along]


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


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_recipe_has_the_intervals_of_the_interpreter(name):
    """Stable on one side of every end and unstable on the other, a billionth away, and as stable as it says in between."""
    for rows, tables, along, span in slices(name, table(name)):
        inside = {along: span["start"] + 0.37 * (span["stop"] - span["start"])}
        drift = drift_of(with_numbers(tables, inside))

        def radius(value, tables=tables, along=along, drift=drift):
            return radius_of(with_numbers(tables, {along: value}), drift)

        low, high = rows.low.to_numpy(), rows.high.to_numpy()
        for end, inwards in [*((end, 1) for end in low), *((end, -1) for end in high)]:
            if not np.isnan(end) and end not in span.values():
                assert radius(end * (1 + inwards * 1e-9)) < 1 < radius(end * (1 - inwards * 1e-9)), (tables, end)
        for value in np.linspace(span["start"], span["stop"], 7)[1:-1]:
            assert (radius(value) < 1) == ((value > low) & (value < high)).any(), (tables, value)


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_what_a_recipe_claims_of_a_set_withstands_an_attack(name):
    rows = table(name, of_sets=True)
    assert rows.settled.all()
    for some, tables, *_ in slices(name, rows):
        for row in some.to_dict("records"):
            assert [one for one in judge_row(tables, row, np.random.default_rng(5)) if not one.same] == []


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
    "grid-converter": "Kp, Kad, fp: 12 6 20 = 0.0009346, 8 6 20 = 0.0860289, 12 15 100 = 0.0170637",
    "exposure": "n, T: 2 0.1 = 5.3590, 1 0.1 = 8.2843, 0 0.1 = 20.000, 2 0.05 = 10.7180",
}
# The same of rows that hold for all of a set.
PROVED = {
    "late-messages": "k: 4 = 99.988, 15 = 58.571",
    "lost-commands": "n: 1 = 1993.3, 2 = 1320.9, 5 = 660.5, 10 = 352.2",
    "quadrotor": "n: 0 = 8.886, 5 = 5.209, 15 = 2.631",
    "random-loss": "p, b: 0.01 0 = 3914.3, 0.05 0 = 3589.0, 0.1 0 = 3218.2, 0 0.005 = 1680.7, 0.1 0.005 = 1552.0",
}
# Along another number: the recipe, the number, its range, those of others, a factor for the comment's unit, and the end.
ALONG = [
    ("cascade", "h", (1e-4, 0.1), {"k": 100}, 1e3, "18.8528"),
    ("cascade", "h", (1e-4, 0.1), {"k": 200}, 1e3, "32.0468"),
    ("cascade", "h", (1e-4, 0.1), {"k": 800}, 1e3, "20.5790"),
    ("physics-joint", "h", (1e-4, 0.05), {"kp": 5000}, 1e3, "5.917"),
    ("physics-joint", "h", (1e-4, 0.05), {"kp": 5000, "kd": 1}, 1e3, "4.686"),
    ("physics-joint", "kd", (0, 100), {"kp": 9910}, 1, "14.73"),
    ("current-loop", "x", (0.1, 10), {}, 1, "5.223"),
    ("admittance", "K", (0, 20000), {}, 1, "1045"),
]


def is_answer(name, pairs, shown, unit=1):
    """Whether a number of the comment is an end of some intervals."""
    digits = len(shown.partition(".")[2])
    assert shown in {f"{unit * end:.{digits}f}" for pair in pairs for end in pair}, (name, pairs, shown)
    assert shown in numbers_of(name)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "of_sets"), [*((name, False) for name in ANSWERS), *((name, True) for name in PROVED)])
def test_the_answers_are_those_of_the_comments(name, of_sets):
    for part in (PROVED if of_sets else ANSWERS)[name].split("; "):
        keys, rows = part.split(": ")
        for values, shown in (row.split(" = ") for row in rows.split(", ")):
            fixed = dict(zip(keys.split(", "), map(float, values.split()), strict=True))
            is_answer(name, ends(name, of_sets, **fixed), shown)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "along", "span", "others", "unit", "shown"), ALONG)
def test_answers_along_other_numbers_are_those_of_the_comments(name, along, span, others, unit, shown):
    loop = wavesweep.compile(str(FOLDER / f"{name}.toml"))
    rows = loop.stable_intervals(along, span, **{key: [value] for key, value in others.items()})
    is_answer(name, list(zip(rows.low, rows.high, strict=True)), shown, unit)


def test_a_notch_beyond_half_the_rate_is_refused():
    with pytest.raises(wavesweep.SpecError, match="half the block's own rate"):
        wavesweep.load(FOLDER / "notch.toml", ["f=215"])


@pytest.mark.slow
def test_pictures_that_are_lost():
    """Lost ones matter without an observer alone."""
    high = table("late-camera", of_sets=True).set_index("s").high
    assert [f"{high[0]:.4g}", f"{high[1]:.3g}"] == ["7.188", "46.4"]
    assert {"7.188", "46.4", "20"} <= numbers_of("late-camera")
    lost = ["c=5", "sweep.g.stop=20", "sweep.s=[1]"]
    found = wavesweep.stability_region(wavesweep.load(FOLDER / "late-camera.toml", lost))
    assert found[found.guarantee == "for_all"].high.tolist() == [20]


@pytest.mark.slow
def test_a_wall_in_any_direction_at_any_pose():
    """What is proved for all of them is next to what the worst of a grid has."""
    ranges = {"phi": {"start": 0, "stop": 3.1416}, "q2": {"start": 0.4, "stop": 1.4}}
    tables = tomllib.loads(TEXTS["two-axes"]) | {"for_all": ranges, "sweep": {"K": {"start": 1, "stop": 2000}, "kh": [400]}}
    rows = wavesweep.zwidth(tables)
    proved = rows[rows.guarantee == "for_all"].high.item()
    assert f"{proved:.1f}" in numbers_of("two-axes")

    def radius(phi, q2, K):
        return radius_of(with_numbers(tables, {"phi": phi, "q2": q2, "K": K, "kh": 400.0}), 0)

    members = np.random.default_rng(0).uniform([0, 0.4], [3.1416, 1.4], (200, 2))
    assert max(radius(*member, proved) for member in members) < 1
    assert max(radius(*member, 1.01 * proved) for member in members) > 1
