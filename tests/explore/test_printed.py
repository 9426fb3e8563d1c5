"""What the script of the page shows of answers that it is given, in node and without a browser."""

import json
import shutil
import subprocess
from importlib.resources import files

import pytest

from wavesweep.explore.explorer_page import SCRIPTS, Page
from wavesweep.explore.server import as_json
from wavesweep.program.spec import load

# A page whose elements keep texts, classes and attributes, whose clock goes by hand, and whose questions wait.
PAGE = """
const places = {}, asked = [], timers = new Map();
let clock = 0;
class Element {
  parts = []; dataset = {}; style = {}; textContent = ""; names = {}; hidden = false; classes = new Set();
  classList = {toggle: (name, on) => this.classes[on ? "add" : "delete"](name), contains: name => this.classes.has(name),
    add: name => this.classes.add(name), remove: name => this.classes.delete(name)};
  setAttribute(name, value) { this.names[name] = value; }
  removeAttribute(name) { delete this.names[name]; }
  append(...parts) { this.parts.push(...parts); }
  replaceChildren(...parts) { this.parts = parts; }
  get children() { return this.parts; }
  addEventListener() {}
  toggleAttribute() {}
  querySelector() {}
  querySelectorAll() { return []; }
  getBoundingClientRect() { return {left: 0, top: 0, width: 600, height: 300}; }
}
const made = () => new Element();
globalThis.window = {};
const getElementById = id => places[id] ??= made();
globalThis.document = {body: made(), getElementById, createElement: made, createElementNS: made, addEventListener() {}};
globalThis.ResizeObserver = globalThis.IntersectionObserver = Element;
let stream;
globalThis.EventSource = class { constructor() { stream = this; } };
Element.prototype.observe = () => {};
let keys = 0;
globalThis.setTimeout = (call, ms, ...given) => { timers.set(++keys, [clock + ms, () => call(...given)]); return keys; };
globalThis.clearTimeout = key => timers.delete(key);
globalThis.fetch = () => new Promise((done, lose) => asked.push({lose, answer: found => done({ok: true, json: () => found})}));
const soon = () => new Promise(setImmediate);
async function pass(ms) {
  clock += ms;
  for (const [key, [at, call]] of timers) if (at <= clock) { timers.delete(key); call(); }
  await soon();
}
document.getElementById("data").textContent = GIVEN;
"""
SAY = "console.log(JSON.stringify({}));"


def ran(data, run):
    """What a program says after the scripts of a page with these data."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node on the PATH")
    scripts = "\n".join((files("wavesweep.explore") / name).read_text(encoding="utf-8") for name in SCRIPTS)
    program = "\n".join((PAGE.replace("GIVEN", json.dumps(as_json(data))), scripts, run))
    done = subprocess.run([node, "-"], input=program, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def page():
    return Page(load({"controller": {"kind": "pmw"}}))


def test_ends_are_printed_to_the_inner_side(page):
    beside = {"low_hz": 0.5, "high_hz": 20.0, "felt_low": 1.25, "felt_high": 800.0}
    limits = {"low": 1.2345612, "high": 799.713412, "low_omega": 3.0, "high_omega": 125.0}
    range_ends = {"low": 1000.0, "high": 6000.0, "low_omega": None, "high_omega": None}
    run = f"ranges = {{[plane.y]: {{certified: true, intervals: {json.dumps([limits | beside, range_ends | beside])}}}}};"
    run += "intervals();" + SAY.format("places.intervals.parts.map(row => row.parts.map(cell => cell.parts.join('')))")
    assert ran(page._data(), run)[:2] == [
        ["K_VE", "1.23457 N/m", "799.713 N/m", "0.5 / 20 Hz", "1.25 / 800 N/m", "✓ certified"],
        ["K_VE", "1000 N/m (range ends)", "6000 N/m (range ends)", "0.5 / 20 Hz", "1.25 / 800 N/m", "✓ certified"],
    ]


SCENE = """
const said = [], drawn = () => Boolean(picture) || Object.keys(ranges).length > 0;
const alert = () => !$("gone").hidden && $("gone").textContent !== "";
const note = () => said.push([places.state.textContent, places.proof.textContent, isBlank(), drawn(), alert()]);
(async () => {
  await soon(); note();
  values["controller.b"] = 40; changed();
  await pass(2900); note();  // nothing answers
  asked.pop().answer(FOUND); await soon(); note();
  values["controller.b"] = 41; changed();
  asked.pop().lose(new Error("lost")); await soon(); note();
  stream.onmessage(); asked.pop().answer(FOUND); await soon(); note();
  values["controller.b"] = 42; changed();
  asked.pop().answer({...FOUND, plane: undefined, ranges: []}); await soon(); note();
  console.log(JSON.stringify(said));
})();
"""


def test_nothing_of_an_earlier_design_is_shown_for_long(page, monkeypatch):
    """Of a server that does not answer, and after a question that was lost until the next answer."""
    data = page._data()
    monkeypatch.setattr(page, "answer_s", 600.0)  # s, of a busy machine
    found = page.answers["quick"]({"values": {"controller.b": 40}, "plane": data["plane"], "search": {}})
    right = ["● stable", "… preview", False, True, False]
    none = ["… no answer for these numbers", "", True, False]
    assert ran(data, SCENE.replace("FOUND", as_json(found))) == [
        right,
        [*none, False],
        right,
        [*none, True],
        right,
        ["● stable", "… preview", False, False, False],
    ]


def test_controls_have_names_of_their_own_and_the_plane_says_what_it_shows(page):
    controls = "data.sliders.flatMap(s => [s.range, s.number])"
    names, plane = ran(page._data(), SAY.format(f"[{controls}.map(each => each.names['aria-label']), places.plane.names]"))
    assert len(names) == len({*names}) == 2 * len(page.sliders)
    assert "device mass kg" in names
    assert plane["aria-label"].endswith("the design at 500 and 1 is stable. Arrow keys move it.")


def test_a_wall_that_an_integrator_makes_rigid_is_called_so(page):
    run = "answer.own.felt = {rigid: true, stiffness: null, damping: null, over_band: null}; numbers();"
    run += "const texts = each => each.parts ? each.parts.map(texts).join(' ') : String(each);"
    said = ran(
        page._data(), run + SAY.format("Object.values(places).map(texts).filter(text => text.includes('felt stiffness'))")
    )
    assert said
    assert "felt stiffness rigid: a constant force moves nothing in the end" in said[0]
