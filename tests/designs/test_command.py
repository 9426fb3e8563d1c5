"""`design`: a front that every other command confirms, the same bytes for all workers and after a stop, and misses in words."""

import json
import re
import tomllib

import numpy as np
import pytest
from support.chunks import finished

import wavesweep
from wavesweep.designs import study
from wavesweep.designs.best import miss
from wavesweep.designs.study import job_of
from wavesweep.engine.errors import WavesweepError
from wavesweep.program.cli import main
from wavesweep.program.results import read
from wavesweep.program.spec import load
from wavesweep.program.store.checkpoint import FileCheckpoint
from wavesweep.program.sweep import running
from wavesweep.program.tables import kind_named

# what each design has to hold for is in [for_all]
pytestmark = pytest.mark.asks("for_all")

SPEC = """
[environment]
integration = "explicit"
delay = 1
[controller]
kind = "pmw"
[design]
population = 16
generations = 3
[design.vary]
b = { start = 5, stop = 200, scale = "log" }
"filters.lp1.order" = [0, 1, 2]
[design.wish]
z_width = { B_VE = [1, 5] }
transparency = { band_hz = [0.1, 5], walls = [50] }
[for_all]
"device.mass" = [0.08, 0.125]
"""


@pytest.fixture
def run(tmp_path, monkeypatch, capfd):
    """Run the command on the spec; give the exit code, what was printed, and the folder of results."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SPEC, encoding="utf-8")

    def run(*arguments):
        out = [] if "--out" in arguments else ["--out", "results/mine"]
        code = main(["design", "mine.toml", *arguments, *out])
        return code, "".join(capfd.readouterr()), tmp_path / "results" / "mine"

    return run


@pytest.mark.slow
def test_the_front_is_that_of_the_other_commands(run):
    code, text, results = run("--no-plot", "--set", "design.population=8", "--set", "design.generations=1")
    assert code == 0
    assert "designs on the front" in text
    assert "the spec's own design: z_width" in text
    rows = read(results / "design.csv")
    assert rows["certified"].all()
    assert rows["holds"].all()
    assert (np.diff(rows["z_width"]) <= 0).all()
    assert (np.diff(rows["transparency"]) <= 0).all()
    assert main(["plot", str(results / "design.parquet")]) == 0
    package = json.loads((results / "design.datapackage.json").read_text(encoding="utf-8"))
    names = package["wavesweep"]["best"]
    assert names[0] == "best/mine-01.toml"
    for name in names:
        row = int(name[-7:-5]) - 1
        found = wavesweep.zwidth(results / name)
        assert found.high.min() == pytest.approx(rows["z_width"][row], rel=1e-12)
        assert tomllib.loads((results / name).read_text())["controller"]["b"] == rows["b"][row]
    assert main(["verify", str(results)]) == 0
    best = results / names[0]
    best.write_text(best.read_text() + "# changed\n")
    assert main(["verify", str(results)]) == 1
    best.unlink()
    assert main(["verify", str(results)]) == 1


@pytest.mark.slow
def test_the_bytes_are_the_same_for_two_workers_and_after_a_stop(run, tmp_path, monkeypatch):
    # Two tasks a generation.
    (tmp_path / "mine.toml").write_text(SPEC.replace("population = 16", "population = 64"), encoding="utf-8")
    assert run("--no-plot", "--jobs", "1")[0] == 0
    one = (tmp_path / "results/mine/design.parquet").read_bytes()
    assert run("--no-plot", "--jobs", "2", "--backend", "loky", "--out", "two")[0] == 0
    assert (tmp_path / "two/design.parquet").read_bytes() == one
    calls, save = [], running.MemoryCheckpoint.save

    def stop(self, number, records):
        calls.append(number)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return save(self, number, records)

    kept = FileCheckpoint.save
    monkeypatch.setattr(
        FileCheckpoint, "save", lambda self, *some: stop(self, *some) if len(calls) >= 4 else calls.append(kept(self, *some))
    )
    assert run("--no-plot", "--jobs", "1", "--out", "three")[0] == 130
    monkeypatch.setattr(FileCheckpoint, "save", kept)
    assert finished(tmp_path / "three")
    assert run("--no-plot", "--jobs", "1", "--out", "three")[0] == 0
    assert (tmp_path / "three/design.parquet").read_bytes() == one
    assert not list((tmp_path / "three").glob(".design-*"))


@pytest.mark.asks("passive")
def test_bounds_that_stand_against_each_other_are_named():
    spec = load({"controller": {"kind": "pmw"}, "design": {"vary": {"b": [1]}, "wish": {
        "z_width": {"at_least": 100}, "channel": {"at_most": 1.1}, "port": {"at_least": 0}}}})  # fmt: skip
    records = np.zeros(3, job_of(spec).dtype)
    records["z_width"], records["channel"], records["port"] = [50, 120, 90], [1.0, 1.4, 1.05], [0, -1e-6, 1e-7]
    for wish in spec.design.wishes:
        records[f"{wish.name}_certified"] = True
    text = miss(spec, records, [{}], study.wish_units(spec))
    free = load({"controller": {"kind": "pmw"}, "design": {"vary": {"b": [1]}, "wish": {"z_width": {}}}})
    said = miss(free, np.zeros(3, job_of(free).dtype), [{}], {"z_width": "N/m"})
    assert said.startswith("no design of 3 has a value for every wish; the nearest")
    assert "; a loop that is unstable has no value" in said
    assert text.startswith(
        "no design of 3 meets all bounds; the nearest has z_width 90 N/m (at least 100); channel 1.05 (at most 1.1)"
    )
    assert text.endswith("z_width stands against channel: 1 designs met the one, 2 the other, none both")


@pytest.mark.asks("passive")
def test_a_design_with_unknown_values_is_never_nearer_than_one_without():
    """However far beyond its bounds that is; one that is not certified counts as unknown."""
    spec = load({"controller": {"kind": "pmw"}, "design": {"vary": {"b": [1]}, "wish": {
        "settling": {"at_most": 1e-4}, "damping_ratio": {"at_least": 0.4}, "port": {"at_least": -1e-5}}}})  # fmt: skip
    records = np.zeros(3, job_of(spec).dtype)
    for name, values, certified in (
        ("settling", [np.nan, 500, 400], [True, True, False]),
        ("damping_ratio", [0.5, 0.01, 0.01], [True, True, True]),
        ("port", [0, -1, -1], [True, True, True]),
    ):
        records[name], records[f"{name}_certified"] = values, certified
    assert "the nearest has settling 500 s" in miss(spec, records, [{}], study.wish_units(spec))
    assert "the nearest has settling not known" in miss(spec, records[[0, 2]], [{}], study.wish_units(spec))


@pytest.mark.slow
def test_the_nearest_miss_is_one_of_all_that_has_to_hold():
    """Between the ends of the hand's mass walls are less stiff: designs judged before that was known are no misses."""
    tables = {"controller": {"kind": "pmw", "Kp": 40.0}, "environment": {"integration": "explicit", "delay": 9}}
    tables |= {"device": {"velocity": "difference"}, "filters": {"lp1": {"order": 0}}}
    hand = {"operator.mass": [0.0, 0.08], "operator.damping": [2.0], "operator.stiffness": [800.0]}
    wanted = {"vary": {"b": {"start": 24.9, "stop": 25.1}}, "wish": {"z_width": {"at_least": 80.0, "B_VE": [1]}}}
    tables |= {"for_all": hand, "design": wanted | {"population": 8, "generations": 10}}
    with pytest.raises(WavesweepError) as error:
        wavesweep.design(tables)
    value, place = re.search(r"has z_width (\S+) N/m \(at least 80\) with operator.mass=(\S+),", str(error.value)).groups()
    assert float(value) < 80
    assert 0 < float(place) < 0.08


@pytest.mark.asks("passive")
@pytest.mark.parametrize(("wish", "said"), [("channel", True), ("damping_ratio", False)])
def test_a_study_of_the_channel_alone_says_that_it_shows_no_loop(wish, said):
    tables = {"controller": {"kind": "pmw"}, "design": {"vary": {"b": {"start": 5, "stop": 10}}, "wish": {wish: {}}}}
    tables["design"] |= {"population": 8, "generations": 1}
    found = wavesweep.design(tables)
    assert any("may be unstable" in notice for notice in found.attrs["facts"]["notices"]) == said


@pytest.mark.slow
def test_what_is_known_of_the_own_design_is_said_beside_that_its_own_wall_is_unstable():
    """z_width has walls of its own: one of the own design is known however stiff the spec's own wall is."""
    study = {"population": 8, "generations": 1, "vary": {"K_LM": {"start": 10, "stop": 300}}, "wish": {"z_width": {}}}
    spec = {"device": {"velocity": "difference"}, "environment": {"integration": "explicit", "delay": 1, "B_VE": 1.0}}
    spec |= {"controller": {"kind": "dc-lm"}, "local_model": {"K_LM": 50}, "sweep": {"K_VE": {"start": 0, "stop": 1000}}}
    table = wavesweep.design({**spec, "design": study})
    (own,) = [text for text, _ in kind_named("design").lines(table.attrs["summary"]) if "own design" in text]
    assert "z_width 281.65 N/m" in own
    assert "unstable with its own numbers" in own
