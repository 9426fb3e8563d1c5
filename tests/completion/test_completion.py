"""A shell completes commands, specs, keys, axes, devices and controllers, and loads nothing heavy for that."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from wavesweep.completion.shell import COMPLETIONS
from wavesweep.engine.loops.controllers import CONTROLLERS
from wavesweep.program.cli import main
from wavesweep.program.cli.entry import COMMANDS, group
from wavesweep.program.reading.devices import DEVICES
from wavesweep.program.reading.tables import study_keys
from wavesweep.program.spec import KEYS, SYMBOLS


@pytest.fixture
def complete(monkeypatch, capsys):
    """What a shell is offered behind the words that are typed; the last word is incomplete."""

    def run(*words, shell="bash"):
        monkeypatch.setenv("_WAVESWEEP_COMPLETE", f"{shell}_complete")
        monkeypatch.setenv("COMP_WORDS", "\n".join(["wavesweep", *words]))
        monkeypatch.setenv("COMP_CWORD", words[-1] if shell == "fish" else str(len(words)))
        assert main([]) == 0
        lines = capsys.readouterr().out.splitlines()
        return lines[1::3] if shell == "zsh" else [line.split(",", 1)[1].split("\t")[0] for line in lines if line]

    return run


@pytest.fixture(name="specs")
def files(tmp_path, monkeypatch):
    """A folder with specs at several depths, and with other files."""
    monkeypatch.chdir(tmp_path)
    names = (
        "mine.toml",
        "notes.txt",
        "sweeps/a.toml",
        "sweeps/deep/b.toml",
        "sweeps/x/y/z/c.toml",
        ".venv/d.toml",
        "sweeps/t.csv",
    )
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).touch()


def test_commands_are_completed(complete):
    assert complete("") == list(COMMANDS)
    assert complete("zw") == ["zwidth"]
    assert complete("--ver") == ["--version"]


@pytest.mark.asks("margins")
def test_cuts_and_numbers_of_a_root_locus_are_those_of_the_spec(complete):
    spec = str(Path(__file__).parents[2] / "sweeps" / "templates" / "drive.toml")
    assert complete("margins", spec, "--cut", "") == ["control.y", "current.y", "motor.v"]
    assert complete("check", spec, "--root-locus", "k") == ["kt", "kp", "ki"]


def test_keys_for_set_are_completed(complete):
    assert complete("zwidth", "a.toml", "--set", "contr") == [
        f"controller.{name}=" for name in ("kind", "b", "Kp", "K_VC", "B_VC")
    ]
    offered = complete("zwidth", "a.toml", "--set", "")
    assert {f"{name}=" for name in (*KEYS, *study_keys(), *SYMBOLS, "sweep.along")} <= set(offered)
    assert complete("bode", "a.toml", "b.toml", "--set", "bode.fre") == ["bode.frequency_hz="]


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--set", "controller.kind", "="), list(CONTROLLERS)),
        (("--set", "controller.kind", "=", "pmw-"), ["pmw-mean", "pmw-lm"]),
        (("--set", "device.preset", "=", "o"), ["omni", "omega"]),
        (("--set", "sweep.along", "=", "K_"), ["K_VE", "K_LM", "K_VC"]),
        (("--set", "=", "environment.integration", "=", "e"), ["explicit"]),
        (("--set", "b", "=", "4", "--set", "sweep.device.m"), ["sweep.device.mass="]),
        (("--set", "device.mass", "="), []),
        (("--set", "nothing", "="), []),
        (("--set", "b", "=", "4", "--overw"), ["--overwrite"]),
    ],
)
def test_bash_gets_the_part_behind_the_equals_sign(words, found, complete):
    assert complete("zwidth", "a.toml", *words) == found


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_get_whole_words(shell, complete):
    assert complete("zwidth", "a.toml", "--set", "device.preset=o", shell=shell) == [
        "device.preset=omni",
        "device.preset=omega",
    ]


DRAWN = """
[rates]
tick_hz = 1000
[numbers]
kp = { value = 100.0, unit = "N/m", description = "gain" }
kd = 3
[block.arm]
type = "mass"
mass = 0.2
[block.net]
type = "delay"
[block.new]
"""


@pytest.mark.whole
@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--set", "k"), ["kp=", "kd="]),
        (("--set", "numbers."), ["numbers.kp=", "numbers.kd="]),
        (
            ("--set", "block.n"),
            ["block.net.steps=", "block.net.seconds=", "block.net.taps=", "block.net.every=", "block.net.phase="],
        ),
        (("--set", "sweep.k"), ["sweep.kp=", "sweep.kd="]),
        (("--set", "bode.k"), ["bode.kp=", "bode.kd="]),
        (("--set", "bode.f"), ["bode.frequency_hz=", "bode.from="]),
        (("--set", "sweep.block.arm.m"), ["sweep.block.arm.mass="]),
        (("--set", "sweep.block.arm.t"), []),
        (("--set", "rates."), ["rates.tick_hz="]),
        (("--set", "controller"), []),
        (("--set", "simulate.fri"), ["simulate.friction="]),
        (("--set", "simulate.inp"), ["simulate.input="]),
        (("--set", "sweep.along", "=", "k"), ["kp", "kd"]),
        (("--set", "simulate.input", "=", "step"), ["stepped-sine", "step"]),
    ],
)
@pytest.mark.usefixtures("specs")
def test_the_numbers_and_blocks_of_a_drawn_loop_are_completed(words, found, complete):
    Path("mine.toml").write_text(DRAWN)
    assert sorted(complete("stability-region", "mine.toml", *words)) == sorted(found)
    assert complete("why", "mine.toml", "--along", "k") == ["kp", "kd"]


@pytest.mark.whole
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
@pytest.mark.usefixtures("specs")
def test_no_name_that_a_shell_would_run_and_no_line_of_a_description_is_offered(shell, complete):
    strange = '"$(id)" = 1\nkd = { value = 3, description = "a\\nplain\\nb" }\n[block."k`id`"]\ntype = "gain"\n'
    Path("mine.toml").write_text(DRAWN.replace("kd = 3\n", strange))
    assert complete("why", "mine.toml", "--along", "", shell=shell) == ["kp", "kd"]
    assert complete("why", "mine.toml", "--set", "block.k", shell=shell) == []


def test_controllers_devices_and_keys_are_completed(complete):
    assert complete("init", "")[: len(CONTROLLERS)] == list(CONTROLLERS)
    assert complete("init", "dr") == ["drive"]
    assert complete("init", "pmw", "--device", "") == list(DEVICES)
    assert complete("keys", "environment.i") == ["environment.integration"]
    assert complete("keys", "sweep.dev") == [
        "sweep.device.mass",
        "sweep.device.damping",
        "sweep.device.delay",
        "sweep.device.dead_time",
    ]


def test_every_argument_of_a_command_is_completed():
    """An argument under another name would silently be left out."""
    for name in COMMANDS:
        arguments = [each for each in group.get_command(None, name).params if each.param_type_name == "argument"]
        assert {each.name for each in arguments if each._custom_shell_complete is None} <= set(COMPLETIONS), name


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("words", ["zwidth a", "zwidth a.toml --set contr", "", "init p"])
def test_completion_loads_nothing_heavy(words):
    program = (
        "import sys\nfrom wavesweep.program.cli import main\n"
        "try:\n    main([])\nfinally:\n    print('modules', *sys.modules, file=sys.stderr)"
    )
    typed = ["wavesweep", *(words.split() or [""])]
    given = {"_WAVESWEEP_COMPLETE": "bash_complete", "COMP_WORDS": "\n".join(typed), "COMP_CWORD": str(len(typed) - 1)}
    done = subprocess.run([sys.executable, "-c", program], env=os.environ | given, capture_output=True, text=True, check=True)
    loaded = set(done.stderr.splitlines()[-1].split()[1:])
    assert "wavesweep.completion.shell" in loaded
    assert (
        loaded
        & {
            "numpy",
            "scipy",
            "pandas",
            "matplotlib",
            "pyarrow",
            "wavesweep.program.sweep",
            "wavesweep.engine.loops.from_drawing",
        }
        == set()
    )
    assert words or not loaded & {"wavesweep.program.cli.study_commands", "wavesweep.programs.command"}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_there_is_a_script_for_each_shell(shell, monkeypatch, capsys):
    monkeypatch.setenv("_WAVESWEEP_COMPLETE", f"{shell}_source")
    assert main([]) == 0
    script = capsys.readouterr().out
    assert f"_WAVESWEEP_COMPLETE={shell}_complete" in script
    # After `KEY=` there is no space, so that the value can be typed.
    assert shell != "bash" or "compopt -o nospace" in script


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("bash"), reason="no bash")
@pytest.mark.usefixtures("specs")
def test_bash_itself_completes(tmp_path):
    """The script in a shell: the words are taken apart at `=`, as readline does it."""
    program = tmp_path / "bin" / "wavesweep"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m wavesweep "$@"\n')
    program.chmod(0o755)
    script = (
        'eval "$(_WAVESWEEP_COMPLETE=bash_source wavesweep)"\n'
        'ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()\n'
        '_wavesweep_completion wavesweep; echo "${COMPREPLY[*]}"; }\n'
        "ask wavesweep zwidth mine.toml --set controller.kind = dc-\n"
    )
    path = f"{program.parent}:{os.environ['PATH']}"
    shell = [shutil.which("bash"), "-c", script]
    done = subprocess.run(shell, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["dc-slow dc-lm dc-vc dc-vc-lm"]
    assert done.stderr == ""
