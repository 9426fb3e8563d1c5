"""What commands say, word for word: `said/*.txt` have command lines and, below each, what is printed.

What follows from other lines is a law below, and on no page. WAVESWEEP_SAID=write in the environment writes the files anew, for
changes of wording; read the difference before it is kept.
"""

import os
import re
import shlex
from pathlib import Path

import pytest

from wavesweep.program.cli import main

HERE = Path(__file__).parent / "said"
ROOT = Path(__file__).parents[2]
SECTION = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
SAID = {path.stem: SECTION.findall(path.read_text(encoding="utf-8")) for path in sorted(HERE.glob("*.txt"))}
# What differs from run to run, or from machine to machine: times, last digits, and what rounding leaves of nothing.
LOOSE = (
    (r"^.* after \d+ s\b.*\n", ""),  # progress, on a machine that takes long
    (r"(\b\d+\.\d{8})\d{3,}(?=[,\s])", "\\1..."),
    (r"[\d.]+e-1[5-9]\b", "...e-16"),
    (r"\bin \d+\.\d\d s\b", "in ... s"),
    (r"tool_version: \S+", "tool_version: ..."),
    (r"about ([\d.]+ m?s|a second at most)\b", "about ... s"),
    (r"about [\d.]+ (kB|MB|min)\b", "about ... \\1"),
    (r"(    work: .*); .*", "\\1; ..."),
)
USAGE = re.compile(r"Usage: wavesweep (.*)\nTry 'wavesweep (.*) ?--help' for help\.\n\n")


def settled(text):
    """A text without what differs from run to run."""
    for pattern, shown in LOOSE:
        text = re.sub(pattern, shown, text, flags=re.MULTILINE)
    return text


@pytest.fixture
def run(tmp_path, monkeypatch, capfd):
    """What a command line says beside the specs of `said/`: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    Path("sweeps").symlink_to(ROOT / "sweeps")
    for spec in HERE.glob("*.toml"):
        Path(spec.name).write_bytes(spec.read_bytes())

    def said(line):
        code = main(shlex.split(line.partition("  # ")[0]))
        return code, *(settled(text.replace(str(tmp_path), "/here")) for text in capfd.readouterr())

    return said


def refuse_others(page, said):
    """Fail if a page shows something else, unless it is to be written anew."""
    if os.environ.get("WAVESWEEP_SAID") == "write":
        (HERE / f"{page}.txt").write_text("".join(f"$ {line}\n{text}" for line, text in said), encoding="utf-8")
    else:
        assert said == SAID[page]


@pytest.mark.slow
@pytest.mark.parametrize("page", ["check", "summaries"])
def test_commands_say_what_the_page_shows(page, run):
    said = []
    for line, _ in SAID[page]:
        code, out, err = run(line)
        said.append((line, out + err + (f"exit code {code}\n" if code else "")))
    refuse_others(page, said)


def test_refusals_are_said_with_exit_code_2_and_write_nothing(run, tmp_path):
    """Behind (usage), which stands for two lines on the command, a mistake of the command line."""
    said, before = [], sorted(tmp_path.iterdir())
    for line, _ in SAID["refusals"]:
        code, out, err = run(line)
        assert code == 2, line
        assert bool(out) == ("--json" in line)
        if usage := USAGE.match(err):
            assert usage[1].split()[0] in (*usage[2].split(), "[OPTIONS]")
            assert usage[2].strip() in (line.split()[0], "")
        said.append((line, out + USAGE.sub("(usage) ", err)))
    assert sorted(tmp_path.iterdir()) == before
    refuse_others("refusals", said)


@pytest.mark.slow
@pytest.mark.parametrize("spec", ["network.toml", "sweeps/examples/coupling.toml"])
def test_check_says_what_it_says_with_all_less_the_details(spec, run):
    """With lines that fit a terminal, and one that tells of the details."""
    said, _, following = run(f"check {spec}")[1].partition("next:\n")
    of_all, _, following_of_all = run(f"check {spec} --all")[1].partition("next:\n")
    verdict = of_all.partition(f"\n{spec}: valid")[0]
    own = [line for line in verdict.splitlines() if not line.startswith("    ")]
    assert said.split() == " ".join(own).split()
    assert max(map(len, said.splitlines())) <= 88
    *shown, last = following.splitlines()
    assert [line.split() for line in shown] == [line.split() for line in following_of_all.splitlines()]
    assert last.split()[:4] == ["wavesweep", "check", spec, "--all"]
