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


OF_ALL = '[for_all]\n"device.damping" = [0.5, 2]\n'


@pytest.mark.whole
@pytest.mark.parametrize("of_all", [(), ("direct",), ("waves", "direct")], ids=len)
def test_its_rows_are_those_of_each_specs_own_zwidth(compare, of_all):
    """Behind the spec and the axes of both, to the bit; an axis of the other spec has the own value, or none.

    The summary of each is that of its own run, with [for_all] for each kind of its rows.
    """
    for name in of_all:
        path = Path(f"{name}.toml")
        path.write_text(path.read_text() + OF_ALL)
    code, said, _ = compare("--no-plot", "--json")
    assert code == 0
    tables = json.loads(said)["tables"]["zwidth-specs"]["specs"]
    for name, summary in tables.items():
        kinds = summary["guarantees"] if name in of_all else {"spec": summary}
        assert [*kinds] == (["spec", "for_all"] if name in of_all else ["spec"])
        rows = library.zwidth(f"{name}.toml")
        for word, of_kind in kinds.items():
            own = rows[rows["guarantee"] == word] if name in of_all else rows
            assert of_kind["largest"]["value"] == own["high"].max()
    for suffix in (".csv", ".parquet"):
        table = results.read(f"results/waves+direct/zwidth-specs{suffix}")
        assert list(table)[:5] == ["spec", "B_VE", "b", "rates.slow_hz", "along"]
        for name in ("waves", "direct"):
            rows = {key: column[table["spec"] == name] for key, column in table.items()}
            own = library.zwidth(f"{name}.toml")
            assert len(own) == len(rows["spec"])
            for key in own:
                np.testing.assert_array_equal(rows[key], own[key].to_numpy())
            if of_all and name not in of_all:
                assert set(rows["guarantee"]) == {"spec"}
                assert np.isnan(rows["fails_from"]).all()
        assert np.isnan(table["b"][table["spec"] == "direct"]).all()
        assert (table["rates.slow_hz"][table["spec"] == "waves"] == 50.0).all()


@pytest.mark.whole
def test_a_bar_of_a_figure_is_that_of_one_spec(compare, figures):
    """And of one kind of its rows, up to the largest value of these."""
    Path("waves.toml").write_text(WAVES.replace("[0.5, 1.0, 1.5]", "[1.0]").replace("[10, 25]", "[10]"))
    Path("direct.toml").write_text(DIRECT.replace("[1, 2]\n", "[1]\n").replace("[50, 100]", "[50]") + OF_ALL)
    assert compare("--quiet")[0] == 0
    (axes,) = figures[0].axes
    names = [" ".join(label.get_text().split()) for label in axes.get_yticklabels()]
    assert names == ["waves", "direct: nominal numbers", "direct: proved for all"]
    rows = results.read("results/waves+direct/zwidth-specs.csv")
    bars = [(bar.get_y() + bar.get_height() / 2, bar.get_x() + bar.get_width()) for bar in axes.patches]
    for place, (spec, word) in enumerate([("waves", "spec"), ("direct", "spec"), ("direct", "for_all")]):
        highs = rows["high"][(rows["spec"] == spec) & (rows["guarantee"] == word)]
        ends = [end for y, end in bars if abs(y - place) < 0.1]
        np.testing.assert_allclose(sorted(ends), sorted(highs), rtol=1e-12)
    below = " ".join(figures[0].get_supxlabel().split())
    assert "direct: proved for all: stable for " in below
