"""The folder's README: its commands make the tables of the figures that it shows."""

import re
import shlex
from pathlib import Path

import pytest

from reproduce.felt_responses import CONTROLLERS
from reproduce.figures import FIGURES, figure_7
from reproduce.specs import load_paper
from wavesweep.program.cli import main
from wavesweep.program.results import publish
from wavesweep.program.spec import load

ROOT = Path(__file__).parents[3]
README = (ROOT / "sweeps" / "paper" / "README.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## Figure (\d)\n(.*?)(?=^## |\Z)", README, flags=re.MULTILINE | re.DOTALL))


def test_each_figure_has_a_section_with_its_picture():
    assert [int(number) for number in SECTIONS] == [2, 4, 5, 6, 7, 8]
    assert len(FIGURES) == len(SECTIONS)
    for number, text in SECTIONS.items():
        assert f"![Figure {number}](figures/fig{number}.png)" in text
        assert "    wavesweep " in text


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("number", [number for number in SECTIONS if number != "7"])
def test_the_commands_of_a_figure_make_its_tables(number, paper, tmp_path, monkeypatch):
    figure = next(each for each in FIGURES if each.__name__ == f"figure_{number}")
    expected = {table.kind: table for table in figure(paper)}
    commands = re.findall(r"^    (wavesweep .*)$", SECTIONS[number], flags=re.MULTILINE)
    monkeypatch.chdir(ROOT)
    assert len(commands) == len(expected)
    for command, (name, table) in zip(commands, expected.items(), strict=True):
        _, kind, *arguments = shlex.split(command)
        assert main([kind, *arguments, "--no-plot", "--quiet", "--out", str(tmp_path / name)]) == 0
        publish(table, tmp_path / name, formats=())
        assert (tmp_path / name / f"{kind}.csv").read_bytes() == (tmp_path / name / f"{name}.csv").read_bytes()


def test_the_commands_of_figure_7_simulate_its_three_loops(monkeypatch):
    assert figure_7 in FIGURES
    monkeypatch.chdir(ROOT)
    loops = []
    for command in re.findall(r"^    (wavesweep .*)$", SECTIONS["7"], flags=re.MULTILINE):
        _, kind, source, *options = shlex.split(command)
        pairs = list(zip(options[::2], options[1::2], strict=True))
        assert kind == "simulate"
        loops.append(dict(load(source, [value for flag, value in pairs if flag == "--set"]).values))
    assert loops == [dict(load_paper("fig7", overrides).values) for overrides in CONTROLLERS.values()]
