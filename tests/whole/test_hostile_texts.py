"""Texts of a user stay texts, in C, in HTML, in a shell, in figures and in tables: no field of a spec does anything."""

import csv
import re
import shlex
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

from wavesweep.program.cli import main

NAME = "$\\frac{$ <b>'\"`id`;&#{{data}}$(id)%s,x"
TEXT = "*/ #error x /* $\\frac{$_^({</script><marquee onload='\"`touch PWNED`$(touch PWNED)${x}@end,m^(\\frac{)^2"
SPEC = f"""
[rates]
tick_hz = 1000
[numbers]
k = {{ value = 10.0, unit = '''{TEXT}''', description = '''{TEXT}''' }}
c = {{ value = 5.0, unit = '''$m''', description = '''{TEXT}''' }}
[block.joint]
type = "mass"
mass = 1.0
[block.h]
type = "lowpass"
a = 0.5
[wire]
"h.u" = "k*joint.x"
"joint.f" = "-h.y - c*joint.v + push + dist"
[ports]
hand = {{ force = "push", displacement = "joint.x" }}
inputs = {{ dist = {{ signal = "dist", unit = '''{TEXT}''' }} }}
outputs = {{ place = {{ signal = "joint.x", unit = '''{TEXT}''' }} }}
[sweep]
along = "k"
k = {{ start = 0, stop = 1000 }}
c = [5, 6]
[bode]
frequency_hz = [1, 2, 3]
[simulate]
duration_s = 0.02
"""
pytestmark = pytest.mark.slow


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """The name of a file whose texts end comments, formulas, elements and quotes, and begin commands."""
    monkeypatch.chdir(tmp_path)
    Path(f"{NAME}.toml").write_text(SPEC)
    return f"{NAME}.toml"


class Tags(HTMLParser):
    """The elements of a page."""

    def __init__(self, page):
        super().__init__()
        self.found = set()
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found |= {tag, *(name for name, _ in attrs)}


def test_no_text_is_code_of_c(spec):
    assert main(["export", spec, "--out", "c"]) == 0
    code = "".join(Path("c", name).read_text() for name in ("controller.h", "controller.c", "example.c", "check.c"))
    assert "#error x" not in re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL)
    if shutil.which("gcc") and shutil.which("make"):
        done = subprocess.run(
            [shutil.which("make"), "-C", "c", "check", "CFLAGS=-O0 -Wall -Wextra -Werror"],
            capture_output=True,
            text=True,
            check=False,
        )
        assert "no bit differs" in done.stdout, done.stderr
    assert not [*Path().rglob("PWNED")]


def test_no_text_is_an_element_of_a_page(spec):
    assert main(["report", spec, "--out", "r.html"]) == 0
    assert main(["explore", spec, "--save", "e.html"]) == 0
    for name in ("r.html", "e.html"):
        page = Path(name).read_text()
        assert "p" in (found := Tags(page).found)
        assert not found & {"marquee", "onload", "b"}


def test_texts_stand_in_figures_and_tables_as_they_are(spec, capfd):
    assert main(["stability-region", spec, "--out", "o"]) == 0
    shown = capfd.readouterr()
    assert [*Path("o").glob("*.png")]
    for path in Path("o").glob("*.csv"):
        header, *rows = csv.reader(path.read_text().splitlines())
        assert {len(row) for row in rows} == {len(header)}
    assert all(spec in shlex.split(line) for line in shown.out.splitlines() if line.startswith("  wavesweep "))
