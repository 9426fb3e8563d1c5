"""What commands say, word for word: `said/*.txt` have command lines and, below each, what is printed.

WAVESWEEP_SAID=write in the environment and `-m ""` write the files anew, for changes of wording; read the difference before
it is kept.
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
    (r"^.* (done|still at work) .*after \d+ s.*\n", ""),  # progress, on a machine that takes long
    (r"(\b\d+\.\d{8})\d{3,}(?=[,\s])", "\\1..."),
    (r"[\d.]+e-1[5-9]\b", "...e-16"),
    (r"\bin \d+\.\d\d s\b", "in ... s"),
    (r"tool_version: \S+", "tool_version: ..."),
    (r"about [\d.]+ (m?s|kB|MB|min)\b", "about ... \\1"),
    (r"(    work: .*); .*", "\\1; ..."),
)

# What takes longest: other lines have sentences of these kinds, and pages of the documents the same about a log.
AT_LENGTH = (
    "check arm.toml --set block.net.steps=40",
    "check pmw.toml --set b=10",
    "check pmw.toml --set rates.",
    "check pmw.toml --set 'sweep.b=",
    "zwidth dc.toml --no-plot --for-hands passive --for-hands port --set sweep.B_VE=[0]",
    "identify sweeps/examples/pushed.csv",
)


@pytest.mark.parametrize("page", [page if page == "refusals" else pytest.param(page, marks=pytest.mark.slow) for page in SAID])
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_commands_say_what_the_page_shows(page, whole, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    Path("sweeps").symlink_to(ROOT / "sweeps")
    for spec in HERE.glob("*.toml"):
        Path(spec.name).write_bytes(spec.read_bytes())
    said, before = [], sorted(tmp_path.iterdir())
    asked = [each for each in SAID[page] if whole or not each[0].startswith(AT_LENGTH)]
    for line, _ in asked:
        code = main(shlex.split(line.partition("  # ")[0]))
        streams = capfd.readouterr()
        text = (streams.out + streams.err).replace(str(tmp_path), "/here") + (f"exit code {code}\n" if code else "")
        for pattern, shown in LOOSE:
            text = re.sub(pattern, shown, text, flags=re.MULTILINE)
        said.append((line, text))
    if whole and os.environ.get("WAVESWEEP_SAID") == "write":
        (HERE / f"{page}.txt").write_text("".join(f"$ {line}\n{text}" for line, text in said), encoding="utf-8")
    assert said == asked
    assert page != "refusals" or sorted(tmp_path.iterdir()) == before
