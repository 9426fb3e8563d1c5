"""`simulate` writes the time series, and for sines the response seen in it, and says what happened."""

import json
from math import exp
from pathlib import Path

import numpy as np
import pytest

import wavesweep as library
from wavesweep.program import results
from wavesweep.simulation.table import simulate as tables_of

EXAMPLES = Path(__file__).parents[2] / "sweeps" / "examples"
SUFFIXES = (".csv", ".parquet", ".png", ".datapackage.json")
KEYS = {"kind": "controller.kind"}
SHORT = ("--set", "simulate.duration_s=0.5", "--set", "simulate.settle_s=0.1")


@pytest.fixture
def simulate(wavesweep, spec):
    """Simulate the spec for half a second with the settings given, and give (exit code, stdout, stderr)."""

    def run(*settings, plot=False, force=False, out="there", device=None, **loop):
        switches = ["--plot" if plot else "--no-plot", *(["--overwrite"] if force else []), "--out", out]
        given = [word for setting in settings for word in ("--set", f"simulate.{setting}")]
        given += ["--set", f"device.preset={device}"] if device else []
        given += [word for name, value in loop.items() for word in ("--set", f"{KEYS.get(name, name)}={value}")]
        return wavesweep("simulate", spec, *SHORT, *given, *switches)

    return run


def files(folder):
    return {file.name for file in Path(folder).iterdir()}


@pytest.mark.slow
def test_a_sine_gives_two_tables_and_their_figures(simulate):
    code, out, err = simulate(plot=True)
    assert (code, out) == (0, "")
    assert files("there") == {f"{kind}{suffix}" for kind in ("simulate", "simulate-response") for suffix in SUFFIXES}
    assert "pmw, force of the hand sine: 500 ticks, 0.5 s" in err
    assert "response at 1 frequency: differs from the linear loop by at most" in err
    assert "Wrote there/simulate.csv, .parquet, .png, .datapackage.json in " in err
    assert "Wrote there/simulate-response.csv, .parquet, .png, .datapackage.json in " in err


def test_equal_runs_give_equal_bytes(simulate):
    settings = ("input=noise", "jitter=0.2", "late=4", "dropped=0.1", "seed=7", "wall=0.0")
    first, again = ([simulate(*settings, out=out, device="omni"), Path(out, "simulate.parquet").read_bytes()] for out in "ab")
    assert first[1] == again[1]


@pytest.mark.slow
def test_a_loop_that_diverges_is_told_and_no_failure(wavesweep, spec):
    settings = ("--set", "controller.kind=dc", "--set", "K_VE=1e8", "--out", "there")
    code, _, err = wavesweep("simulate", spec, *settings)
    assert code == 0
    columns = results.read("there/simulate.csv")
    rows = len(columns["tick"])
    assert 0 < rows < 10_000
    assert "UNSTABLE: the linear loop diverges (spectral radius 494.531 per frame)\n" in err
    assert f"stopped after tick {rows}, {rows / 1000:g} s: a force exceeds 1e+06 N; the rows end before it\n" in err
    assert f"dc, force of the hand sine: {rows} of 10000 ticks" in err
    assert " J" not in err
    facts = json.loads(Path("there/simulate.datapackage.json").read_text())["wavesweep"]
    assert facts["ticks"] == {"wanted": 10_000, "simulated": rows, "stopped": "a force exceeds 1e+06 N"}
    assert facts["linear_loop"] == {"stable": False, "spectral_radius": pytest.approx(494.531, rel=1e-5)}
    assert facts["limits"] == {"position_m": 1e3, "force_N": 1e6}
    assert not Path("there/simulate-response.csv").exists()


def test_a_loop_that_diverges_slowly_is_compared_with_no_steady_response(simulate):
    """The columns of the linear response are missing, and the table says why."""
    code, _, err = simulate("frequency_hz=10", "max_force=3", kind="dc", K_VE=8000)
    assert code == 0
    assert "UNSTABLE: " in err
    assert "response at 1 frequency: an unstable loop has no steady response to compare it with (doubt: unstable)\n" in err
    columns = results.read("there/simulate-response.csv")
    assert columns["doubt"].tolist() == ["unstable"]
    missing = [name for name, column in columns.items() if column.dtype == float and np.isnan(column).all()]
    assert missing == [name for name in columns if name.startswith("linear_")]


@pytest.mark.sample(3)
@pytest.mark.slow
@pytest.mark.asks("require")
@pytest.mark.parametrize("example", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_examples_run(example, wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = (
        "--set",
        "simulate.frequency_hz=[2]",
        "--set",
        "simulate.duration_s=4",
        "--quiet",
        "--no-plot",
        "--out",
        "short",
    )
    assert wavesweep("simulate", str(example), *settings) == (0, "", "")
    facts = json.loads(Path("short/simulate.datapackage.json").read_text())["wavesweep"]
    times = results.read("short/simulate.parquet")["time_s"]
    whole = len(times) == round(4 / times[1])
    # The own designs of some of them are unstable.
    assert whole == (not facts["ticks"]["stopped"])
    assert whole or not facts["linear_loop"]["stable"]
    assert example.read_text().startswith("# ")


@pytest.mark.asks("check")
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dc"])
def test_a_mode_that_has_not_died_out_where_a_sine_is_measured_is_told(kind):
    def said(settle):
        spec = {"controller": {"kind": kind}, "simulate": {"settle_s": settle, "duration_s": settle + 2, "frequency_hz": [5]}}
        (notice,) = tables_of(library.load(spec).asking("simulate"))[1].facts["notices"] or [""]
        return notice

    constant = library.verdict({"controller": {"kind": kind}})["slowest"]["time_constant_s"]
    settle = round(2 * constant, 3)
    assert f", which falls to 1/e in {constant:.3g} s, " in said(settle)
    assert f"still has {100 * exp(-settle / constant):.2g} % of its beginning" in said(settle)
    enough = float(said(settle).split("; ")[1].split(" s leave")[0])
    assert exp(-enough / constant) == pytest.approx(1e-3, rel=0.05)
    assert said(round(enough, 3)) == ""
