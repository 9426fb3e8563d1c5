"""What all commands share: the help, the table of commands, options and where the results go."""

import importlib
from pathlib import Path

import pytest

from wavesweep.cli.entry import COMMANDS, group, module_of

WITH_TABLES = [name for name in COMMANDS if name not in ("check", "paper", "bench", "keys", "init")]  # no SPEC, or no table
SWEEPS = [name for name in WITH_TABLES if name not in ("simulate", "passivity")]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_short_help_is_the_first_sentence_of_the_commands_own(name):
    command = importlib.import_module(module_of(name)).command
    assert command.name == name
    assert command.help.split("\n\n")[0] == COMMANDS[name]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name, wavesweep):
    code, out, err = wavesweep(name, "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"Usage: wavesweep {name} ")


@pytest.mark.parametrize("name", WITH_TABLES)
def test_the_common_options_are_the_same_everywhere(name):
    def described(command):
        return {option.name: (option.opts, option.help) for option in command.params if option.param_type_name == "option"}

    # bode has no options of its own.
    assert described(group.get_command(None, name)).items() >= described(group.get_command(None, "bode")).items()


@pytest.mark.slow
@pytest.mark.parametrize("name", SWEEPS)
def test_results_go_to_a_folder_of_the_specs_name(name, wavesweep, sweep, spec, tmp_path):
    code, out, err = wavesweep(name, spec)
    assert (code, out) == (0, "")
    files = {file.name for file in (tmp_path / "results" / "wall").iterdir()}
    assert files == {f"{name}{suffix}" for suffix in (".csv", ".parquet", ".png", ".datapackage.json")}
    assert f"Wrote results/wall/{name}.csv, .parquet, .png, .datapackage.json in " in err
    assert len(sweep.seen) == 1


@pytest.mark.parametrize("name", SWEEPS)
def test_a_dash_writes_the_table_to_stdout_and_no_file(name, wavesweep, sweep, spec, tmp_path):
    code, out, err = wavesweep(name, spec, "--out", "-")
    assert code == 0
    assert not (tmp_path / "results").exists()
    wavesweep(name, spec, "--no-plot", "--quiet")
    assert out == (tmp_path / f"results/wall/{name}.csv").read_text()
    assert "Wrote" not in err
    assert len(sweep.seen) == 2


def test_workers_are_passed_on(wavesweep, sweep, spec):
    wavesweep("zwidth", spec, "--no-plot", "--jobs", "3", "--backend", "dask", "--scheduler", "tcp://there:8786")
    expected = {"jobs": 3, "backend": "dask", "scheduler": "tcp://there:8786", "along": "K_VE", "hands": None, "progress": None}
    expected |= {"checkpoint": Path("results/wall/.zwidth.parts"), "force": False}
    assert sweep.seen == [("intervals", expected)]


def test_stability_region_leaves_the_axis_to_the_spec(wavesweep, sweep, spec):
    wavesweep("stability-region", spec, "--no-plot")
    assert sweep.seen[0][1]["along"] is None


def test_a_setting_overrides_the_spec(wavesweep, sweep, spec):
    code, out, _ = wavesweep("check", spec, "--set", 'controller.kind="dc"', "--set", "b=40")
    assert (code, out) == (0, "kind dc\n2 slices\n")
    assert [name for name, _ in sweep.seen] == ["plan"]


def test_no_plot_draws_nothing(wavesweep, sweep, spec, tmp_path):
    wavesweep("zwidth", spec, "--no-plot")
    assert not (tmp_path / "results/wall/zwidth.png").exists()
    assert len(sweep.seen) == 1


def test_quiet_says_nothing(wavesweep, sweep, spec):
    assert wavesweep("zwidth", spec, "--no-plot", "--quiet") == (0, "", "")
    assert wavesweep("check", spec, "--quiet") == (0, "", "")
    assert len(sweep.seen) == 2


def test_the_summary_names_intervals_holes_and_the_largest_stiffness(wavesweep, sweep, spec):
    _, _, err = wavesweep("zwidth", spec, "--no-plot")
    assert "2 slices: 3 stable intervals, 1 slice with a hole" in err
    assert "largest stable K_VE: 4448.82 at B_VE = 1\n" in err
    assert "all 3 rows certified" in err
    assert len(sweep.seen) == 1


def test_a_table_of_several_specs_goes_to_a_folder_of_all_their_names(wavesweep, sweep, spec, tmp_path):
    (tmp_path / "other.toml").write_text((tmp_path / spec).read_text())
    code, _, err = wavesweep("bode", spec, "other.toml", "--no-plot")
    assert code == 0
    assert (tmp_path / "results/wall+other/bode.csv").exists()
    assert "2 curves of 2 frequencies" in err
    assert len(sweep.seen) == 1
