"""The report: one file that needs no other one, the numbers of the tables in it, and commands that give it again."""

import hashlib
import re
import shlex
from collections import Counter
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import wavesweep
from wavesweep.program.analyses.claims import STABLE, Claim, Status, Verdict, own_scope
from wavesweep.program.cli import main
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.spec import load
from wavesweep.program.spec.writing import as_toml
from wavesweep.program.tables.interval_table import intervals
from wavesweep.reports import content

pytestmark = pytest.mark.slow
PD = {
    "rates": {"tick_hz": 1000},
    "numbers": {"K": 40.0, "J": 0.01},
    "block": {"axis": {"type": "inertia", "inertia": "J", "damping": 0.5}, "gain": {"type": "gain", "k": "K"}},
    "wire": {"gain.u": "-axis.x", "axis.f": "gain.y"},
}


class Reader(HTMLParser):
    """The elements of a page: whether they are nested, their names, and all that they point to."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.refers, self.names, self.words = [], Counter(), set(), Counter(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.names[tag] += 1
        self.ids.update(value for name, value in attrs if name == "id")
        self.refers |= {value for name, value in attrs if name in ("href", "src", "xlink:href", "action", "srcset")}
        self.refers |= {found for _, value in attrs for found in re.findall(r"url\((.*?)\)", value or "")}
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "svg"} & {*self.open}:
            self.words.append(data)


def read(text):
    page = Reader(text)
    assert page.open == []
    return page


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    """A spec with an axis, as a file, and its report."""
    source = tmp_path_factory.mktemp("spec") / "axis.toml"
    tables = PD | {"sweep": {"along": "K", "K": {"start": 1.0, "stop": 5000.0}, "J": [0.005, 0.01]}}
    source.write_text(f"# How stiff may the axis be?\n{as_toml(tables)}", encoding="utf-8")
    return source, wavesweep.report(source)


def test_a_report_needs_no_other_file_and_its_names_are_its_own(axis):
    page = read(axis[1])
    assert (page.names["svg"], page.names["main"]) == (4, 1)
    tables = re.findall(r".+(?=<table>)", axis[1])
    assert all(re.fullmatch(r'<div class="wide" role="region" tabindex="0" aria-label=".+">', each) for each in tables)
    assert len(tables) == page.names["table"]


def test_a_report_has_the_intervals_margins_and_spec(axis):
    source, text = axis[0], unescape(" ".join(read(axis[1]).words))
    for row in wavesweep.stability_region(source).itertuples():
        assert re.search(rf"\b{row.J:g}\s+{rounded_up(row.low)}\s+{rounded_down(row.high)}\b", text)
    margins = wavesweep.compile(source).margins().set_index("margin")["value"]
    assert f"disk margin {rounded_down(margins['disk'])}" in text
    assert source.read_text(encoding="utf-8") in text
    assert "In the words of the spec: How stiff may the axis be?" in text


def test_a_report_opens_with_the_wishes_of_its_spec():
    wish = {"damping_ratio": {"at_least": 0.01}, "gain": {"at_least": 100.0, "cut": "gain.y"}}
    text = wavesweep.report(PD | {"design": {"vary": {"K": {"start": 1.0, "stop": 100.0}}, "wish": wish}})
    rows = re.findall(r"<tr>.*?</tr>", text[: text.index(">Answer<")], re.DOTALL)
    assert [re.findall(r"<td>(.*?)</td>", row)[-1] for row in rows[1:]] == ["met", "missed"]
    assert "gain margin at gain.y" in rows[2]


def test_what_a_report_refutes_is_unstable_by_the_spectral_radius_and_stable_on_the_other_side_of_the_end(axis):
    loop, text = wavesweep.compile(axis[0]), " ".join(read(axis[1]).words)
    found = re.findall(r"J = (\S+)\s+K = (\S+)\s+eigenvalue .* per frame, modulus 1 \+ (\S+):", text)
    assert len(found) == 2
    ends = wavesweep.stability_region(loop.spec)["high"].to_numpy()
    for J, K, over in np.array(found, float):
        end = ends[np.argmin(np.abs(ends / K - 1))]
        assert loop.spectral_radius(J=J, K=K) - 1 == pytest.approx(over, rel=1e-2, abs=1e-9)
        assert loop.spectral_radius(J=J, K=end + (end - K)) < 1


def test_the_commands_of_a_report_give_its_tables_their_proof_and_the_report(axis, tmp_path, monkeypatch, capsys):
    source, page = axis
    monkeypatch.chdir(tmp_path)
    Path("axis.toml").write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    for command in re.search(r"<pre>(.*?)</pre>", page, re.DOTALL)[1].splitlines():
        assert main(shlex.split(unescape(command))[1:]) == 0
    assert "verified/stability-region.proof: 4 of 4 claims proved by the checker" in capsys.readouterr().out
    hashes = dict(re.findall(r"SHA-256 of (verified/\S+)\s+([0-9a-f]{64})", unescape(" ".join(read(page).words))))
    assert len(hashes) == 3
    assert {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in hashes} == hashes
    assert Path("results/axis/report.html").read_text(encoding="utf-8") == page


def test_a_loop_without_an_axis_has_a_report_that_assumes_nothing_of_intervals():
    words = " ".join(read(wavesweep.report(PD)).words)
    assert "may each of its numbers go?" in words
    assert "What the proof assumes" not in words


def test_of_a_spec_without_numbers_no_ranges_are_claimed():
    fixed = load(
        PD | {"numbers": {}, "block": {"axis": PD["block"]["axis"] | {"inertia": 0.01}, "gain": {"type": "gain", "k": 40.0}}}
    )
    for spec, claimed in ((fixed, False), (load(PD), True)):
        assert ("Ranges of each number alone" in content._own_lines(spec, None)[-1]) == claimed


@pytest.mark.parametrize(
    ("certified", "said"),
    [
        (True, "The intervals are certified, but not known everywhere"),
        (False, "Not all of the intervals are certified."),
    ],
)
def test_what_is_not_known_is_not_called_uncertified(certified, said):
    spec = load(PD | {"sweep": {"along": "K", "K": {"start": 1.0, "stop": 5000.0}}})
    table = intervals(spec)
    table.columns["certified"][:] = certified
    found = content.ReportSection("", "", table, (("more than 1 % is not known in 1 row of for_all", True),), "<svg>", "", "")
    judged = Verdict((Claim(STABLE, own_scope(spec), Status.COMPUTED),))
    assert said in "".join(content._answer(spec, found, ("stable", False), judged))


def test_only_an_earlier_report_of_the_spec_is_replaced(tmp_path, monkeypatch, capsys):
    """Which is told by the head of the page; the page that stands in for a report here has none."""
    monkeypatch.setattr("wavesweep.reports.content.report", lambda _, asked: f"{asked.overrides}<title>")
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text('[controller]\nkind = "dc"\n', encoding="utf-8")
    assert main(["report", "mine.toml", "-o", "there"]) == 0
    assert Path("there/report.html").read_text(encoding="utf-8") == "()<title>"
    assert main(["report", "mine.toml", "-o", "there"]) == 2
    assert "the file is no report of mine" in capsys.readouterr().err
    Path("own.html").write_text(wavesweep.reports.report_page.page("mine", ["by hand"]), encoding="utf-8")
    assert main(["report", "mine.toml", "-o", "own.html", "--set", "b=20"]) == 0
    assert Path("own.html").read_text(encoding="utf-8") == "('b=20',)<title>"
    Path("nowhere").touch()  # a file, where a folder is asked for
    for wrong in ("report.pdf", "", "-", "nowhere/mine.toml/x.html"):
        assert main(["report", "mine.toml", "-o", wrong]) == 2


def test_a_figure_in_which_nothing_is_drawn_is_left_out():
    """Of a range that ends before the limit: nothing moves an end, so there are no bars."""
    spec = load({"controller": {"kind": "dc-slow"}, "sweep": {"K_VE": {"start": 0, "stop": 100}, "B_VE": [1.0]}})
    page = content.report(spec, content.ReportRequest())
    figures = re.findall(r"<figure.*?</figure>", page, re.DOTALL)
    assert figures
    assert all('id="f' in each and "axes_" in each for each in figures)
    numbers = [int(number) for number in re.findall(r"<figcaption>Figure (\d+)[.]", page)]
    assert numbers == [*range(1, len(figures) + 1)]
    assert "why" not in " ".join(re.findall(r"<figcaption>(.*?)</figcaption>", page))


@pytest.mark.parametrize(("tables", "said"), [({"controller": {"kind": "dc"}}, True), (PD, False)])
@pytest.mark.parametrize("held", [False, True])
def test_a_report_says_that_nobody_holds_a_device_that_has_a_port_for_a_hand(tables, said, held):
    hand = {"operator": {"mass": 0.1, "damping": 1.0, "stiffness": 100.0}} if held and said else {}
    table = SimpleNamespace(facts={"claims": {"spec": "stable"}})
    words = [*content._of_nobody(load(tables | hand), table)]
    assert bool(words) == (said and not held)
