"""A shell completes commands, options, files, and the keys of --set with their words, and loads nothing heavy for that."""

import subprocess
import sys

import pytest

from wavesweep.program.cli import main
from wavesweep.program.cli.entry import COMMANDS


@pytest.fixture
def complete(monkeypatch, capsys):
    """What zsh is offered behind the words that are typed, of which the last is incomplete: (type, word) each."""

    def run(*words):
        monkeypatch.setenv("_WAVESWEEP_COMPLETE", "zsh_complete")
        monkeypatch.setenv("COMP_WORDS", " ".join(["wavesweep", *words]))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        assert main([]) == 0
        lines = capsys.readouterr().out.strip("\n").splitlines()
        return list(zip(lines[::3], lines[1::3], strict=True))

    return run


def test_commands_and_options_are_completed(complete):
    assert [word for _, word in complete("")] == list(COMMANDS)
    assert complete("zw") == [("plain", "zwidth")]
    assert ("plain", "--for-hands") in complete("zwidth", "--for")


def test_files_are_left_to_the_shell(complete):
    for words in (("zwidth", "mi"), ("zwidth", "mine.toml", "oth"), ("plot", "t"), ("zwidth", "a.toml", "--out", "fol")):
        assert complete(*words) == [("file", words[-1])]


def test_keys_and_their_words_are_completed(complete):
    assert ("plain", "controller.kind=") in complete("zwidth", "mine.toml", "--set", "contr")
    assert complete("zwidth", "mine.toml", "--set", "device.velocity=d") == [("plain", "device.velocity=difference")]
    assert complete("zwidth", "mine.toml", "--set", "nothing=") == []
    assert ("plain", "rates.slow_hz") in complete("keys", "rates.")


@pytest.mark.parametrize("words", ["", "zwidth a.toml --set contr"])
def test_completion_loads_nothing_heavy(words):
    program = (
        "import os, sys\n"
        "os.environ |= {'_WAVESWEEP_COMPLETE': 'zsh_complete', 'COMP_WORDS': 'wavesweep ' + sys.argv[1]}\n"
        "os.environ['COMP_CWORD'] = str(len(sys.argv[1].split()))\n"
        "from wavesweep.program.cli import main\n"
        "main([])\n"
        "assert not {'numpy', 'scipy', 'pandas', 'matplotlib'} & set(sys.modules), sys.modules.keys()\n"
    )
    subprocess.run([sys.executable, "-c", program, words], check=True, capture_output=True)
