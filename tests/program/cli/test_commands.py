"""What all commands share: the help, the table of commands, options and where the results go."""

import inspect
import json
import shlex
from pathlib import Path

import click
import pytest

from wavesweep import load
from wavesweep.program.cli.entry import COMMANDS, command_of, group

ROOT = Path(__file__).parents[3]

SWEEPS = ("zwidth", "stability-region", "bode")  # whose fixture answers at once


def test_every_command_has_help_whose_first_sentence_is_in_the_list(wavesweep):
    for name, short in COMMANDS.items():
        code, out, err = wavesweep(name, "--help")
        assert (code, err) == (0, "")
        assert out.startswith(f"Usage: wavesweep {name} ")
        assert command_of(name).help.split("\n\n")[0] == short


@pytest.mark.whole
@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999"])
def test_every_option_that_is_a_number_refuses_one_that_is_not_finite_by_its_name(text):
    options = [(name, option) for name in COMMANDS for option in command_of(name).params]
    numbers = [(name, option) for name, option in options if isinstance(option.type, click.types.FloatParamType)]
    assert {option.opts[0] for _, option in numbers} == {"--open", "--fast-hz", "--resolution", "--delay", "--rate"}
    for name, option in numbers:
        context = click.Context(command_of(name))
        with pytest.raises(click.BadParameter) as raised:
            option.process_value(context, text)
        said = f"Invalid value for '{option.opts[0]}': expected a finite number, found {text}"
        assert (raised.value.exit_code, raised.value.format_message()) == (2, said)


EXAMPLES = [
    line.strip()
    for name in COMMANDS
    for line in inspect.cleandoc(command_of(name).help).splitlines()
    if line.startswith("  wavesweep ")
]


@pytest.mark.whole
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
        load(source, settings).asking("simulate")


@pytest.mark.parametrize(("option", "asked"), [("--overwrite", 1), ("--restart", 2)])
def test_to_overwrite_results_and_to_throw_a_checkpoint_away_are_two_options(option, asked, wavesweep, sweep, spec, tmp_path):
    (tmp_path / "results/wall").mkdir(parents=True)
    (tmp_path / "results/wall/zwidth.csv").write_text("somebody's")
    code, _, err = wavesweep("zwidth", spec, "--no-plot", option)
    assert (code, "give --overwrite to replace them" in err) == ((0, False) if asked & 1 else (2, True))
    assert [given["force"] for _, given in sweep.seen] == ([asked > 1] if asked & 1 else [])


@pytest.mark.parametrize("name", SWEEPS)
def test_a_dash_writes_the_table_to_stdout_and_no_file(name, wavesweep, sweep, spec, tmp_path):
    code, out, err = wavesweep(name, spec, "--out", "-")
    assert code == 0
    assert not (tmp_path / "results").exists()
    wavesweep(name, spec, "--no-plot", "--quiet")
    assert out == (tmp_path / f"results/wall/{name}.csv").read_text()
    assert "Wrote" not in err
    assert len(sweep.seen) == 2


@pytest.mark.whole
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
        "open": None, "at": {"B_VE": 1.0}, "at_the_edge_of": ["B_VE"], "equal_rows": 1, "certified": True,
    }  # fmt: skip
    assert (table["stiffest_felt"]["value"], table["stiffest_felt"]["with"]) == (90.0, 700.0)
    assert (table["rows"], table["certified_rows"], table["doubts"], table["slices_with_a_hole"]) == (3, 3, {}, 1)


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
    (tmp_path / "other.toml").write_text((tmp_path / spec).read_text())
    code, _, err = wavesweep("zwidth", "other.toml", "--no-plot", "--set", "b=30", "--out", "results/wall", "--overwrite")
    assert (code, "changed" in err) == (0, False)  # another spec's results are no former ones of this spec


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


def test_an_edited_spec_does_not_meet_the_checkpoint_of_its_earlier_version(wavesweep, sweep, spec):
    """Each version has a file of its own; one that was left behind is named, and nothing is thrown away."""
    for _ in range(2):
        wavesweep("zwidth", spec, "--no-plot", "--quiet")
    first, again = (given["checkpoint"] for _, given in sweep.seen)
    assert first == again
    first.touch()
    code, _, err = wavesweep("zwidth", spec, "--no-plot", "--set", "b=40", "--out", "results/wall")
    assert (code, sweep.seen[-1][1]["checkpoint"] == first) == (0, False)
    assert (
        f"an interrupted run of another version of the spec is kept in {first}; remove it if it is not needed\n"
        in err.replace("\n    ", " ")
    )
