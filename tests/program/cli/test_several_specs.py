"""`zwidth` and `bode` of several specs put all of them into one table and one figure."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import wavesweep as library
from wavesweep.program import results

WAVES = """
[controller]
kind = "pmw"
[environment]
integration = "explicit"
[sweep]
K_VE = { start = 0, stop = 6000 }
B_VE = [0.5, 1.0, 1.5]
b = [10, 25]
[bode]
frequency_hz = [1, 5]
"""
DIRECT = """
[controller]
kind = "dc-slow"
[environment]
delay = 3
[sweep]
K_VE = { start = 0, stop = 6000 }
B_VE = [1, 2]
rates.slow_hz = [50, 100]
[bode]
frequency_hz = [1, 2, 3]
"""
SUFFIXES = (".csv", ".parquet", ".png", ".datapackage.json")


@pytest.fixture
def compare(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "waves.toml").write_text(WAVES)
    (tmp_path / "direct.toml").write_text(DIRECT)

    def run(*more, specs=("waves.toml", "direct.toml")):
        return wavesweep("zwidth", *specs, *more)

    return run


@pytest.fixture
def figures(monkeypatch):
    """The figures of a run, as they are written."""
    from wavesweep.program.plots import figure_files as files

    drawn, save = [], files.save
    monkeypatch.setattr(files, "save", lambda canvas, *more: (drawn.append(canvas), save(canvas, *more)))
    return drawn


def test_a_spec_that_cannot_be_compared_is_refused_before_any_work(compare, monkeypatch):
    monkeypatch.setattr("wavesweep.program.tables.specs.intervals", lambda *_, **__: pytest.fail("it was computed"))
    mass = '[rates]\ntick_hz = 1000\n[numbers]\nk = 1.0\nd = 0.1\n[block.m]\ntype = "mass"\nmass = 1.0\n'
    Path("drawn.toml").write_text(f'{mass}[wire]\n"m.f" = "-k*m.x - d*m.v"\n')
    code, _, err = compare(specs=("waves.toml", "drawn.toml"))
    assert code == 2
    assert re.match(r"drawn.toml:\d+:\d+: ports: expected wall", err)
    assert not list(Path().glob("results/**/.*"))


@pytest.mark.slow
def test_it_writes_a_table_and_its_figure_with_what_each_spec_assumes(compare, figures):
    code, out, err = compare()
    assert (code, out) == (0, "")
    assert {file.name for file in Path("results/waves+direct").iterdir()} == {f"zwidth-specs{suffix}" for suffix in SUFFIXES}
    assert re.search("waves:\n  stable for every K_VE from 0 up to .*\n(?:    .*\n)?  largest stable K_VE: ", err)
    assert "direct:\n  largest stable K_VE: " in err
    assert "\n  stiffest wall as the hand feels it at rest: " in err
    direct = "direct: wall force K*x + B*v at the slow rate, delay of 3 ticks, exact velocity"
    assert f"assumes: {direct}; " in err
    below = " ".join(figures[0].get_supxlabel().split())
    assert "Assumes: waves: explicit integration of the wall, no delay, exact velocity" in below
    assert direct in below


def test_its_rows_are_those_of_each_specs_own_zwidth(compare):
    """Behind the spec and the axes of both, to the bit; an axis of the other spec has the own value, or none."""
    assert compare("--no-plot", "--quiet") == (0, "", "")
    for suffix in (".csv", ".parquet"):
        table = results.read(f"results/waves+direct/zwidth-specs{suffix}")
        assert list(table)[:5] == ["spec", "B_VE", "b", "rates.slow_hz", "along"]
        for name in ("waves", "direct"):
            rows = {key: column[table["spec"] == name] for key, column in table.items()}
            own = library.zwidth(f"{name}.toml")
            assert len(own) == len(rows["spec"])
            for key in own:
                np.testing.assert_array_equal(rows[key], own[key].to_numpy())
        assert np.isnan(table["b"][table["spec"] == "direct"]).all()
        assert (table["rates.slow_hz"][table["spec"] == "waves"] == 50.0).all()


def test_an_edited_spec_is_named_with_its_change(compare):
    compare("--no-plot", "--quiet")
    Path("direct.toml").write_text(DIRECT.replace("delay = 3", "delay = 5"))
    code, _, err = compare("--no-plot")
    assert code == 0
    assert "replaced the results of this spec; changed: direct: environment.delay 3 -> 5\n" in err
    assert compare("--no-plot", specs=("direct.toml", "waves.toml"))[0] == 0
    Path("other.toml").write_text(WAVES)
    code, _, err = compare("--no-plot", "--out", "results/waves+direct", specs=("direct.toml", "other.toml"))
    assert code == 2
    assert "found results of another spec (waves, direct; SHA-256 " in err


def test_the_summary_as_json_has_the_extremes_of_each_spec(compare):
    code, out, err = compare("--no-plot", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    specs = found["tables"]["zwidth-specs"]["specs"]
    own = library.zwidth("waves.toml")
    assert specs["waves"]["largest"]["value"] == own.high.max()
    assert specs["waves"]["stiffest_felt"]["value"] == own.felt_high.max()
    assert specs["direct"]["largest"]["at"].keys() == {"B_VE", "rates.slow_hz"}


@pytest.mark.slow
def test_a_whole_number_that_only_one_spec_has_is_missing_in_the_others(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recipes = Path(library.__file__).parents[1] / "sweeps" / "recipes"
    (tmp_path / "plain.toml").write_text('[controller]\nkind = "dc-slow"\n[sweep]\nB_VE = [0.5, 1.0]\n')
    code, _, err = wavesweep("zwidth", "plain.toml", str(recipes / "two-rate-wall.toml"), "--out", "both", "--no-plot")
    assert (code, "Error" in err) == (0, False)
    table = results.read(tmp_path / "both/zwidth-specs.csv")
    assert np.isnan(table["n"][table["spec"] == "plain"]).all()
    assert np.isfinite(table["n"][table["spec"] != "plain"]).all()
