"""What all commands share: the help, the table of commands, options and where the results go."""

import inspect
import json
import re
import shlex
from pathlib import Path

import pytest

from wavesweep import load
from wavesweep.cli.entry import COMMANDS, command_of, group
from wavesweep.cli.output import own_folder

ROOT = Path(__file__).parents[2]

# Those of a SPEC that write tables.
OTHERS = ("check", "verify", "explore", "export", "paper", "bench", "keys", "init", "plot", "identify", "inspect")
WITH_TABLES = [name for name in COMMANDS if name not in OTHERS]
SWEEPS = [name for name in WITH_TABLES if name not in ("simulate", "passivity", "compare", "design", "why", "margins")]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_short_help_is_the_first_sentence_of_the_commands_own(name):
    command = command_of(name)
    assert command.name == name
    assert command.help.split("\n\n")[0] == COMMANDS[name]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name, wavesweep):
    code, out, err = wavesweep(name, "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"Usage: wavesweep {name} ")


EXAMPLES = [
    line.strip()
    for name in COMMANDS
    for line in inspect.cleandoc(command_of(name).help).splitlines()
    if line.startswith("  wavesweep ")
]


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_examples_in_the_helps_are_valid(example, tmp_path):
    """Words and settings are accepted; `mine.toml` and `other.toml` are those of a user."""
    _, name, *words = (word for word in shlex.split(example) if word != "--quiet")
    files = [word for word in words if word.endswith(".toml")]
    settings = group.get_command(None, name).make_context(name, list(words)).params.get("overrides", ())
    for file in files:
        source = ROOT / file if file.startswith("sweeps/") else tmp_path / file
        if not file.startswith("sweeps/"):
            source.write_text('controller.kind = "pmw"\n')
        load(source, settings).as_simulated()


@pytest.mark.parametrize("name", ["simulate", "why", "margins", "paper", "bench", "check", "export"])
@pytest.mark.parametrize("option", ["--jobs=2", "--backend=loky", "--scheduler=a", "--restart"])
def test_workers_are_options_only_of_the_commands_that_use_them(name, option, wavesweep, spec):
    code, _, err = wavesweep(name, *([] if name in ("paper", "bench") else [spec]), option)
    assert (code, option.partition("=")[0] in err, "No such option" in err) == (2, True, True)


@pytest.mark.parametrize(("option", "asked"), [("--overwrite", 1), ("--restart", 2)])
def test_to_overwrite_results_and_to_throw_a_checkpoint_away_are_two_options(option, asked, wavesweep, sweep, spec, tmp_path):
    (tmp_path / "results/wall").mkdir(parents=True)
    (tmp_path / "results/wall/zwidth.csv").write_text("somebody's")
    code, _, err = wavesweep("zwidth", spec, "--no-plot", option)
    assert (code, "give --overwrite to replace them" in err) == ((0, False) if asked & 1 else (2, True))
    assert [given["force"] for _, given in sweep.seen] == ([asked > 1] if asked & 1 else [])


@pytest.mark.parametrize("name", WITH_TABLES)
def test_the_commands_whose_tables_can_be_long_write_them_in_parts(name):
    options = {option.name for option in group.get_command(None, name).params}
    assert ("partition" in options) == (name in ("zwidth", "stability-region", "bode", "passivity"))


@pytest.mark.sample(2)
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


@pytest.mark.slow
def test_workers_are_passed_on(wavesweep, sweep, spec):
    wavesweep("zwidth", spec, "--no-plot", "--jobs", "3", "--backend", "dask", "--scheduler", "tcp://there:8786")
    expected = {"jobs": 3, "backend": "dask", "scheduler": "tcp://there:8786", "along": "K_VE", "hands": None, "prove": False}
    ((name, given),) = sweep.seen
    expected |= {"checkpoint": given["checkpoint"], "force": False}
    assert re.fullmatch(r"results/wall/\.zwidth-[0-9a-f]{12}\.sqlite", str(given["checkpoint"]))
    assert (name, {key: value for key, value in given.items() if key != "progress"}) == ("intervals", expected)
    assert callable(given["progress"])


def test_stability_region_leaves_the_axis_to_the_spec(wavesweep, sweep, spec):
    wavesweep("stability-region", spec, "--no-plot")
    assert sweep.seen[0][1]["along"] is None


def test_a_setting_overrides_the_spec(wavesweep, sweep, spec):
    code, out, _ = wavesweep("check", spec, "--set", 'controller.kind="dc"', "--set", "b=40")
    assert code == 0
    assert out.startswith("assumes: ideal wall at the fast rate, exact velocity; kind default of device.velocity: ")
    assert "\nwall, dc: stable (spectral radius " in out
    assert out.endswith("\nkind dc\n2 slices\n")
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
    assert "largest stable K_VE: 4448.82 N/m (stable from 2523.34 on) at B_VE = 1 N*s/m (the edge of that axis)\n" in err
    assert "\nevery K_VE from 0 on stable up to 799.713 N/m at B_VE = 1 N*s/m (the edge of that axis)\n" in err
    assert "stiffest wall as the hand feels it: 90 N/m (" in err
    assert ") with K_VE = 700 N/m at B_VE = 0.5 N*s/m (the edge of that axis)\n" in err
    assert "all 3 rows certified" in err
    assert len(sweep.seen) == 1


@pytest.mark.parametrize(
    ("name", "override", "said"),
    [
        ("zwidth", "B_VE=2", "--set B_VE=2 has no effect here: B_VE is swept; --set sweep.B_VE=... changes its values\n"),
        ("zwidth", "environment.K_VE=2", "--set environment.K_VE=2 has no effect here"),
        ("zwidth", "environment.B_VE=2", "has no effect here: B_VE is swept; --set sweep.B_VE=... changes its values\n"),
        ("zwidth", "device.mass=2", ""),
        ("bode", "B_VE=2", ""),
    ],
)
def test_a_value_of_a_number_that_is_swept_is_said_to_have_no_effect(name, override, said, wavesweep, sweep, spec):
    code, _, err = wavesweep(name, spec, "--no-plot", "--set", override)
    assert (code, said in err, "no effect" in err) == (0, True, bool(said))
    assert len(sweep.seen) == 1


def test_the_summary_can_be_one_json_object_on_stdout(wavesweep, sweep, spec):
    code, out, err = wavesweep("zwidth", spec, "--no-plot", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert (found["command"], found["specs"]) == ("zwidth", ["wall"])
    files = [f"results/wall/zwidth{suffix}" for suffix in (".csv", ".parquet", ".datapackage.json")]
    assert (found["files"], found["changed"], len(sweep.seen)) == (files, [], 1)
    table = found["tables"]["zwidth"]
    assert table["largest"] == {
        "value": 4448.819, "from": 2523.335, "ended_by": "stability",
        "at": {"B_VE": 1.0}, "at_the_edge_of": ["B_VE"], "equal_rows": 1, "certified": True,
    }  # fmt: skip
    assert (table["stiffest_felt"]["value"], table["stiffest_felt"]["with"]) == (90.0, 700.0)
    assert (table["rows"], table["certified_rows"], table["doubts"], table["slices_with_a_hole"]) == (3, 3, {}, 1)


@pytest.mark.parametrize("name", SWEEPS)
def test_json_and_the_table_cannot_both_go_to_stdout(name, wavesweep, sweep, spec):
    code, out, err = wavesweep(name, spec, "--json", "--out", "-")
    assert (code, json.loads(out)["exit_code"], sweep.seen) == (2, 2, [])
    assert "--json and --out - would both write to stdout" in err


@pytest.mark.parametrize("option", ["--format=svg", "--width=3in", "--style=ggplot", "--force"])
@pytest.mark.parametrize("name", ["zwidth", "check", "identify"])
def test_an_option_that_moved_is_named_with_what_does_the_same(name, option, wavesweep, spec):
    code, out, err = wavesweep(name, spec, option)
    assert (code, out) == (2, "")
    assert ("--overwrite" if option == "--force" else "`wavesweep plot TABLE`") in err


@pytest.mark.parametrize("words", [("-q", "check", "SPEC"), ("check", "-q", "SPEC"), ("check", "SPEC", "--quiet")])
def test_how_the_program_speaks_may_stand_anywhere_in_the_line(words, wavesweep, spec):
    assert wavesweep(*(spec if word == "SPEC" else word for word in words)) == (0, "", "")


def test_a_command_without_a_summary_has_no_json(wavesweep):
    code, out, err = wavesweep("plot", "t.csv", "--json")
    assert (code, json.loads(out)["exit_code"], "plot prints no summary" in err) == (2, 2, True)


@pytest.mark.parametrize("name", SWEEPS)
def test_a_figure_that_stdout_cannot_have_is_refused(name, wavesweep, sweep, spec):
    code, out, err = wavesweep(name, spec, "--plot", "--out", "-")
    assert (code, out, sweep.seen) == (2, "", [])
    assert "--plot draws a figure, and --out - writes none" in err


def test_an_edited_spec_replaces_its_own_results_and_says_the_changes(wavesweep, sweep, spec, tmp_path):
    def run(*more):
        return wavesweep("zwidth", spec, "--no-plot", *more)

    assert "replaced" not in run()[2]
    assert "replaced" not in run()[2]
    (tmp_path / spec).write_text((tmp_path / spec).read_text().replace("[0.5, 1.0]", "[0.5, 1.0, 2.0]"))
    assert "replaced the results of this spec; changed: sweep.B_VE [0.5, 1] -> [0.5, 1, 2]\n" in run()[2]
    code, _, err = run("--set", "b=40", "--set", "environment.delay=3", "--out", "results/wall")
    assert code == 0
    assert "replaced the results of this spec; changed: environment.delay 0 -> 3, b 25 -> 40\n" in err
    assert json.loads(run("--json")[1])["changed"] == ["environment.delay 3 -> 0", "b 40 -> 25"]
    assert len(sweep.seen) == 5


@pytest.mark.parametrize(
    ("settings", "folder"),
    [
        (["b=40"], "wall,b=40"),
        (["b=40", "environment.delay=3"], "wall,b=40,environment.delay=3"),
        (["sweep.B_VE="], "wall,sweep.B_VE="),
        (["sweep.B_VE=[2, 4]"], "wall,sweep.B_VE=_2,_4_-9c0f6a65"),
        (["sweep.B_VE=[2,4]"], "wall,sweep.B_VE=_2,4_-df89b177"),
    ],
)
def test_results_with_set_stand_beside_the_specs_own_in_a_folder_that_says_so(settings, folder, wavesweep, spec):
    """A digest tells settings apart whose texts no file system takes; the spec's own results stay as they were."""
    wavesweep("zwidth", spec, "--no-plot", "--quiet")
    own = {path: path.read_bytes() for path in Path("results/wall").iterdir()}
    words = [word for each in settings for word in ("--set", each)]
    code, _, err = wavesweep("zwidth", spec, "--no-plot", *words)
    assert (code, "replaced" in err, sorted(path.name for path in Path("results").iterdir())) == (0, False, ["wall", folder])
    assert {path: path.read_bytes() for path in Path("results/wall").iterdir()} == own
    assert wavesweep("inspect", folder)[0] == 0


def test_a_folder_for_long_settings_has_a_short_name():
    one, other = (own_folder(["a", "b"], [f"wire.x={'1+' * 300}{end}"]) for end in "12")
    assert one != other
    assert {len(one.name), len(other.name)} == {len("a+b,-12345678") + 80}


def test_an_edited_spec_does_not_meet_the_checkpoint_of_its_earlier_version(wavesweep, sweep, spec):
    """Each version has a file of its own; one that was left behind is named, and nothing is thrown away."""
    for _ in range(2):
        wavesweep("zwidth", spec, "--no-plot", "--quiet")
    first, again = (given["checkpoint"] for _, given in sweep.seen)
    assert first == again
    first.touch()
    code, _, err = wavesweep("zwidth", spec, "--no-plot", "--set", "b=40", "--out", "results/wall")
    assert (code, sweep.seen[-1][1]["checkpoint"] == first) == (0, False)
    assert f"an interrupted run of another version of the spec is kept in {first}; remove it if it is not needed\n" in err


def test_the_place_of_a_spec_survives_a_move_of_the_project_and_shows_no_path(wavesweep, sweep, spec, tmp_path, monkeypatch):
    package = "results/wall/zwidth.datapackage.json"
    (tmp_path / "one").mkdir()
    (tmp_path / spec).rename(tmp_path / "one" / spec)
    monkeypatch.chdir(tmp_path / "one")
    wavesweep("zwidth", spec, "--no-plot")
    assert str(tmp_path) not in Path(package).read_text()
    assert tmp_path.name not in Path(package).read_text()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one").rename(tmp_path / "two")
    monkeypatch.chdir(tmp_path / "two")
    assert wavesweep("zwidth", spec, "--no-plot", "--set", "b=40", "--out", "results/wall")[0] == 0
    assert len(sweep.seen) == 2


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ([], 'device.velocity: engines usually have "explicit", 20 and "difference"\n'),
        (["environment.delay=0"], "kind defaults of environment.integration and device.velocity: engines usually have"),
        (
            ["environment.integration=explicit", "environment.delay=1", "device.velocity=difference"],
            "assumes: explicit integration of the wall, delay of 1 of 20 ticks, velocity from differences of position\n",
        ),
        (["controller.kind=dc", "device.velocity=exact"], "assumes: ideal wall at the fast rate, exact velocity\n"),
        (
            ["environment.integration=explicit", "device.velocity=exact", "sweep.environment.delay=[0, 20]"],
            "wall, delay swept, exact velocity\n",
        ),
    ],
)
def test_the_summary_says_which_wall_it_is_for_and_what_the_defaults_are(settings, said, wavesweep, spec):
    words = (word for setting in settings for word in ("--set", setting))
    code, _, err = wavesweep("zwidth", spec, "--no-plot", "--out", "results/wall", *words)
    assert code == 0
    assert said in err
    facts = json.loads(Path("results/wall/zwidth.datapackage.json").read_text())["wavesweep"]
    assert f"assumes: {facts['assumes']}\n" in err
    assert err.startswith("assumes: ") == ("kind default" in err)


def test_a_table_of_several_specs_goes_to_a_folder_of_all_their_names(wavesweep, sweep, spec, tmp_path):
    (tmp_path / "other.toml").write_text((tmp_path / spec).read_text())
    code, _, err = wavesweep("bode", spec, "other.toml", "--no-plot")
    assert code == 0
    assert (tmp_path / "results/wall+other/bode.csv").exists()
    assert "2 curves of 2 frequencies" in err
    assert len(sweep.seen) == 1


@pytest.mark.parametrize("wait", [False, True])
def test_a_command_waits_for_another_run_if_it_is_told_to(wavesweep, tmp_path, monkeypatch, wait):
    from wavesweep import results

    asked, at_work = [], results.at_work
    monkeypatch.setattr(results, "at_work", lambda kinds, to, wait, say: asked.append(wait) or at_work(kinds, to, wait, say))
    (tmp_path / "mine.toml").write_text('[controller]\nkind = "pmw"\n[sweep]\nB_VE = [1]\n')
    options = ["--wait"] if wait else []
    assert wavesweep("zwidth", str(tmp_path / "mine.toml"), "--no-plot", "--out", str(tmp_path / "there"), *options)[0] == 0
    assert asked == [wait]
