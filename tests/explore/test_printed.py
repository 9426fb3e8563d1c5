"""What the script of the page prints of numbers that it is given, in node and without a browser."""

import json
import shutil
import subprocess
from importlib.resources import files

import pytest

from wavesweep.explore.explorer_page import SCRIPTS

# A page of which only the texts of elements are kept.
PAGE = """
const places = {};
const place = id => places[id] ??= {textContent: "", className: "", style: {}, classList: {toggle() {}, contains: () => false}};
class Element {
  constructor() { this.parts = []; this.dataset = {}; }
  setAttribute() {}
  append(...parts) { this.parts.push(...parts); }
}
globalThis.document = {
  getElementById: id => Object.assign(place(id), {replaceChildren(...parts) { this.parts = parts; }}),
  createElement: () => new Element(), addEventListener() {},
};
"""
RUN = """
ranges = {p: {certified: true, intervals: GIVEN}};
intervals();
console.log(JSON.stringify(places.intervals.parts.map(row => row.parts.map(cell => cell.parts.join("")))));
"""


def printed(intervals):
    """The cells of each row of the table of intervals."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node on the PATH")
    data = {"sliders": [{"path": "p", "name": "K", "unit": "N/m", "value": 2.0}], "units": {"felt": ["N/m"]}}
    filled = f"{PAGE}place('data').textContent = {json.dumps(json.dumps(data))};\n"
    scripts = "\n".join((files("wavesweep.explore") / name).read_text(encoding="utf-8") for name in SCRIPTS[:3])
    program = "\n".join((filled, scripts, RUN.replace("GIVEN", json.dumps(intervals))))
    done = subprocess.run([node, "-"], input=program, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_ends_are_printed_to_the_inner_side():
    beside = {"low_hz": 0.5, "high_hz": 20.0, "felt_low": 1.25, "felt_high": 800.0}
    limits = {"low": 1.2345612, "high": 799.713412, "low_omega": 3.0, "high_omega": 125.0}
    range_ends = {"low": 1000.0, "high": 6000.0, "low_omega": None, "high_omega": None}
    assert printed([limits | beside, range_ends | beside]) == [
        ["K", "1.23457 N/m", "799.713 N/m", "0.5 / 20 Hz", "1.25 / 800 N/m", "✓ certified"],
        ["K", "1000 N/m (range ends)", "6000 N/m (range ends)", "0.5 / 20 Hz", "1.25 / 800 N/m", "✓ certified"],
    ]
