"""The documents' commands run, in a folder with `sweeps/`, and print the lines that the pages show."""

import json
import pathlib
import re
import shlex

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SHOWN = {path.name: path.read_text(encoding="utf-8") for path in PAGES}
SHOWN = {name: text for name, text in SHOWN.items() if "\n    $ wavesweep " in text}
# A file that a page writes, or goes on with, whose first line is a comment with its name; or a command with the lines after it.
STEP = re.compile(
    r"```toml\n# (?P<file>\S+\.toml)(?P<more>, continued)?\n(?P<lines>[\s\S]*?)```|"
    r"^    \$ wavesweep (?P<command>.*)\n(?P<printed>(?:    (?!\$).*\n)*)",
    re.MULTILINE,
)


@pytest.mark.slow
@pytest.mark.parametrize("page", SHOWN)
def test_a_page_runs_from_its_beginning_to_its_end(page, tmp_path, monkeypatch, capsys):
    from wavesweep.program.cli import main

    monkeypatch.chdir(tmp_path)
    pathlib.Path("sweeps").symlink_to(ROOT / "sweeps")
    for text in SHOWN.values():  # a page may go on with a file of another one
        for step in filter(lambda step: step["file"] and not step["more"], STEP.finditer(text)):
            pathlib.Path(step["file"]).write_text(step["lines"], encoding="utf-8")
    for step in STEP.finditer(SHOWN[page]):
        if step["file"]:
            with pathlib.Path(step["file"]).open("a" if step["more"] else "w", encoding="utf-8") as file:
                file.write(step["lines"])
            continue
        code = main(shlex.split(step["command"]))
        seen = capsys.readouterr()
        printed = [line.rstrip() for line in (seen.out + seen.err).splitlines()]
        expected = [line[4:].rstrip() for line in step["printed"].splitlines()]
        assert (code == 0) is not any(line.startswith("Error: ") for line in expected), step["command"]
        missing = [line for line in expected if not any(fits(line, other) for other in printed)]
        assert missing == [], (step["command"], printed)


@pytest.mark.slow
def test_the_notebook_runs_from_its_beginning_to_its_end():
    """Without Jupyter: each cell is Python, and its last line is what the cell shows."""
    names, shown = {}, []
    for cell in json.loads((ROOT / "docs/first-hour.ipynb").read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            *lines, last = "".join(cell["source"]).splitlines()
            exec("\n".join(lines), names)  # noqa: S102 - a file of this project
            shown.append(eval(last, names))  # noqa: S307
    loop, walls, width, region, curve, bode, largest, tapped = shown
    assert "K_VE = 350" in repr(loop)
    assert walls["certified"].all()
    assert region["certified"].all()
    assert region["low"].isna().tolist() == [False, False, False, True]
    assert curve["impedance_abs"].gt(0).all()
    assert 0 < largest["x"] < 0.1
    assert all(figure.get_axes() for figure in (width, bode, tapped))


def fits(shown, printed):
    """Whether a line of a page is the one that was printed; `...` stands for any text."""
    return re.fullmatch(".*".join(map(re.escape, shown.split("..."))), printed) is not None
