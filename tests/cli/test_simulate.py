"""`simulate` writes the time series, and for sines the response seen in it, and says what happened."""

import json
from math import exp
from pathlib import Path

import numpy as np
import pytest

import wavesweep as library
from wavesweep import results
from wavesweep.tables import kind_named
from wavesweep.tables.simulation import simulate as tables_of

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


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_the_table_reads_back_with_missing_signals(simulate, suffix):
    simulate()
    columns = results.read(f"there/simulate{suffix}")
    assert list(columns) == [field.name for field in kind_named("simulate").fields]
    assert len(columns["tick"]) == 500
    assert np.isnan(columns["v_2"]).all()
    assert columns["touching"].dtype == bool


def test_both_formats_hold_the_same_bits(simulate):
    simulate("jitter=0.1")
    for kind in ("simulate", "simulate-response"):
        csv, parquet = (results.read(f"there/{kind}{suffix}") for suffix in (".csv", ".parquet"))
        for name, column in csv.items():
            assert list(map(repr, column.tolist())) == list(map(repr, parquet[name].tolist())), name


@pytest.mark.slow
def test_the_response_stands_beside_that_of_the_linear_loop(simulate):
    simulate("input=stepped-sine", "frequency_hz=[3, 11]", "settle_s=5", "duration_s=20")
    columns = results.read("there/simulate-response.csv")
    assert columns["frequency_hz"].tolist() == [3.0, 11.0]
    np.testing.assert_allclose(columns["omega_Ts"], 2 * np.pi * 0.02 * columns["frequency_hz"])
    for name in ("admittance_re", "impedance_abs", "impedance_deg"):
        np.testing.assert_allclose(columns[name], columns[f"linear_{name}"], rtol=1e-3)


@pytest.mark.parametrize(("hz", "left"), [("1, 2", ""), ("1, 2, 4", "4"), ("1, 2, 4, 5, 6, 7, 8, 9", "4, ..., 9")])
def test_sines_that_are_not_measured_are_named(simulate, hz, left):
    simulate("input=stepped-sine", f"frequency_hz=[{hz}]", "settle_s=0.1", "periods=1", "duration_s=2.5")
    assert results.read("there/simulate-response.csv")["frequency_hz"].tolist() == [1.0, 2.0]
    facts = json.loads(Path("there/simulate.datapackage.json").read_text())["wavesweep"]
    assert [text for text in facts["notices"] if "not measured" in text] == [
        f"not measured at {left} Hz: the input ends before they have settled; a longer simulate.duration_s measures them"
    ] * bool(left)


@pytest.mark.parametrize(
    ("given", "unread"),
    [
        (["record=r.csv"], "simulate.record"),
        (["input=step", "width_s=3", "frequency_hz=4"], "simulate.frequency_hz, simulate.settle_s, simulate.width_s"),
        (["input=pulse", "width_s=3", "at_s=0.1"], "simulate.settle_s"),
        (["frequency_hz=4"], ""),
    ],
)
def test_keys_that_the_input_does_not_read_are_named(simulate, given, unread):
    _, _, err = simulate(*given)
    lines = [line for line in err.splitlines() if "not read" in line]
    assert [line.partition(":")[0] for line in lines] == [unread] * bool(unread)


def test_the_facts_hold_the_whole_spec_and_its_digest(simulate):
    simulate("wall=0.002")
    for kind in ("simulate", "simulate-response"):
        facts = json.loads(Path(f"there/{kind}.datapackage.json").read_text())["wavesweep"]
        assert facts["spec"]["simulate"]["wall"] == 0.002
        assert len(facts["spec_sha256"]) == 64
        assert facts["methods"]
    assert facts["spec"]["controller"]["b"] == 25.0


@pytest.mark.slow
def test_other_forces_have_no_response_and_leave_none_behind(simulate):
    simulate(plot=True)
    code, _, err = simulate("input=step")
    assert code == 0
    assert "replaced the results of this spec; changed: simulate.input sine -> step" in err
    assert files("there") == {f"simulate{suffix}" for suffix in SUFFIXES} - {"simulate.png"}


def test_results_of_other_commands_do_not_depend_on_it(wavesweep, sweep, spec):
    for seed in (1, 2):
        assert wavesweep("zwidth", spec, "--no-plot", "--out", "there", "--set", f"simulate.seed={seed}")[0] == 0
    assert len(sweep.seen) == 2


def test_a_dash_writes_the_time_series_to_stdout(simulate):
    code, out, err = simulate("duration_s=0.02", out="-")
    assert (code, len(out.splitlines())) == (0, 21)
    assert out.startswith("tick,frame,phase,time_s,f_h,x,")
    assert "Wrote" not in err
    assert not Path("there").exists()


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


def test_a_force_of_zero_has_no_response_to_compare(simulate):
    code, _, err = simulate("frequency_hz=10", "amplitude=0")
    assert code == 0
    assert "not known, so there is nothing to compare with the linear loop" in err
    assert "at most 0 (admittance)" not in err


def test_what_happened_is_told(simulate):
    _, _, err = simulate("wall=0.0005", "late=3", "dropped=0.2", "amplitude=8", "jitter=0.1", device="omni")
    assert "contact made " in err
    assert "motors at their limit of 3.3 N for " in err
    assert "of 25 slow results " in err
    assert 'device.velocity = "exact" does not see the encoder' in err
    assert "energy: the hand gave " in err


def test_it_is_told_where_the_spec_stands_before_the_preset(simulate):
    _, _, err = simulate("friction=0.1", device="omni")
    assert "the spec takes precedence over the preset omni: simulate.friction = 0.1 and not 0.26\n" in err
    assert "the preset omni adds to the linear loop: resolution = 5.5e-05, max_force = 3.3\n" in err


def test_at_rates_that_do_not_divide_a_device_has_its_effects_too(simulate):
    code, _, err = simulate("friction=0.1", "wall=0.001", "late=3", device="omni", **{"rates.slow_hz": 60})
    assert code == 0
    assert "the preset omni adds to the linear loop: resolution = 5.5e-05, max_force = 3.3\n" in err
    assert "of 30 slow results " in err
    columns = results.read("there/simulate.parquet")
    assert np.isfinite(columns["u_s"]).all()
    assert set(columns["touching"].tolist()) == {True, False}


def test_a_recorded_force_is_read_and_vouched_for(simulate):
    Path("push.csv").write_text("force_N\n" + "1.5\n" * 60)
    assert simulate("input=record", "record=push.csv", "duration_s=0.05")[0] == 0
    assert results.read("there/simulate.csv")["f_h"].tolist() == [1.5] * 50
    facts = json.loads(Path("there/simulate.datapackage.json").read_text())["wavesweep"]
    assert len(facts["record_sha256"]) == 64


def test_a_record_that_is_not_there_is_a_usage_error(simulate):
    code, _, err = simulate("input=record", "record=push.csv")
    assert (code, err) == (2, "Error: push.csv: cannot be read: No such file or directory\n")
    assert not Path("there").exists()


@pytest.mark.slow
def test_a_run_without_a_tick_is_a_table_without_a_row(simulate):
    code, _, err = simulate("duration_s=0", plot=True)
    assert (code, len(results.read("there/simulate.csv")["tick"])) == (0, 0)
    assert "0 ticks" in err


@pytest.mark.sample(3)
@pytest.mark.slow
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
    rows = len(results.read("short/simulate.parquet")["tick"])
    # The own designs of some of them are unstable.
    assert (rows == 4000) == (not facts["ticks"]["stopped"])
    assert rows == 4000 or not facts["linear_loop"]["stable"]
    assert example.read_text().startswith("# ")


@pytest.mark.thorough
@pytest.mark.slow
def test_a_minute_with_everything_on_runs_as_it_stands(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, _, err = wavesweep("simulate", str(EXAMPLES / "rig.toml"))
    assert "pmw-lm, force of the hand sine: 60000 ticks, 60 s" in err


@pytest.mark.parametrize("kind", ["dc", "pmw"])
def test_a_mode_that_has_not_died_out_where_a_sine_is_measured_is_told(kind):
    def said(settle):
        spec = {"controller": {"kind": kind}, "simulate": {"settle_s": settle, "duration_s": settle + 2, "frequency_hz": [5]}}
        (notice,) = tables_of(library.load(spec).as_simulated())[1].facts["notices"] or [""]
        return notice

    constant = library.verdict({"controller": {"kind": kind}})["slowest"]["time_constant_s"]
    settle = round(2 * constant, 3)
    assert f", which falls to 1/e in {constant:.3g} s, " in said(settle)
    assert f"still has {100 * exp(-settle / constant):.2g} % of its beginning" in said(settle)
    enough = float(said(settle).split("; ")[1].split(" s leave")[0])
    assert exp(-enough / constant) == pytest.approx(1e-3, rel=0.05)
    assert said(round(enough, 3)) == ""
