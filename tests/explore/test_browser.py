"""The page in a browser: opened, dragged, read, and compared with `zwidth`."""

import json
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest

import wavesweep
from tests.explore.conftest import ARM, DRIVE, HOLE
from wavesweep.explore.explorer_page import saved_page
from wavesweep.program.spec import load

pytestmark = pytest.mark.slow
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="the client that drives a browser, playwright, is missing")
    if CHROMIUM is None:
        pytest.skip("no chromium on the PATH")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture
def opened(browser):
    """Open an address; at the end no page may have had an error or a message in its console."""
    contexts, said = [], []

    def start(address, **options):
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(address)
        until(page, "window.ready")
        return page

    yield start
    for context in contexts:
        context.close()
    assert said == []


def until(page, expression):
    """Wait for an expression; the page's policy does not let it evaluate texts, as the client's own way to wait would."""
    deadline = time.monotonic() + 60
    while not page.evaluate(expression):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(20)
    return page


def settled(page):
    """Wait until everything is certified."""
    return until(page, "document.getElementById('proof').textContent.includes('✓ certified')")


def ends(page, along):
    """The ends of the intervals on the page, and whether all are certified."""
    rows = page.locator(f"#intervals tr[data-along='{along}'][data-low]")
    found = rows.evaluate_all("all => all.map(row => [row.dataset.low, row.dataset.high, row.dataset.certified])")
    return [(float(low), float(high)) for low, high, _ in found], {word for *_, word in found} == {"true"}


def assert_ends_of(page, rows):
    """The intervals on the page are certified and those of `zwidth`, which takes another number of columns at once."""
    found, certified = ends(page, "environment.K_VE")
    assert certified
    np.testing.assert_allclose(found, rows[["low", "high"]], rtol=1e-12, atol=1e-12)


def move(page, path, share):
    """Drag the slider of a key to a share of its length, in steps."""
    slider = page.locator(f"[id='s-{path}']")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.down()
    for step in range(1, 9):
        page.mouse.move(box["x"] + box["width"] * (0.5 + (share - 0.5) * step / 8), y)
    return page


def enter(page, path, value):
    """Type a number into the field of a key."""
    field = page.locator(f"[id='s-{path}-number']")
    field.fill(str(value))
    field.press("Enter")


def fault(page, path):
    """What is said at the field of a key."""
    return page.text_content(f"[id='s-{path}-fault']")


def test_the_intervals_on_the_page_are_those_of_zwidth(opened, client):
    page = settled(opened(client.server.address))
    table = wavesweep.zwidth(HOLE | {"sweep": HOLE["sweep"] | {"B_VE": [1.0], "b": [25]}})
    assert_ends_of(page, table)
    radius = float(page.get_attribute("#n-radius", "data-value"))
    assert radius == pytest.approx(wavesweep.verdict(HOLE)["spectral_radius"], rel=1e-12)


def test_a_slider_is_dragged_and_the_numbers_follow(opened, client):
    page = settled(opened(client.server.address))
    page.evaluate("""window.said = new Set();
      new MutationObserver(() => said.add(document.getElementById("proof").textContent))
        .observe(document.getElementById("proof"), {childList: true})""")
    move(page, "controller.b", 0.7)
    page.mouse.up()
    settled(page)
    assert page.evaluate("[...said].sort()") == ["… preview", "✓ certified"]
    b = page.evaluate("values['controller.b']")
    assert b > 26
    table = wavesweep.zwidth(HOLE | {"sweep": HOLE["sweep"] | {"B_VE": [1.0], "b": [b]}})
    assert_ends_of(page, table)
    verdict = wavesweep.verdict(HOLE | {"controller": {"kind": "pmw", "b": b}})
    for place, value in (
        ("#n-radius", verdict["spectral_radius"]),
        ("#n-felt", verdict["felt"]["stiffness"]),
        ("#n-norm", verdict["channel_norm"]),
    ):
        assert float(page.get_attribute(place, "data-value")) == pytest.approx(value, rel=1e-12)
    assert page.locator("#plane .ghost").count() > 0
    assert page.locator("#plane .ghostmark").count() == 1
    page.click("#reset")
    settled(page)
    assert page.locator("#plane .ghostmark").count() == 0


def test_the_page_can_be_used_by_the_keyboard_alone(opened, client):
    page = settled(opened(client.server.address))
    page.focus("[id='s-device.damping']")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("values['device.damping']") > 1.5
    assert "N·s/m" in page.get_attribute("[id='s-device.damping']", "aria-valuetext")
    page.focus("#plane")
    before = page.evaluate("values['environment.K_VE']")
    page.keyboard.press("ArrowUp")
    assert page.evaluate("values['environment.K_VE']") > before
    number = page.locator("[aria-label='controller b, number']").first
    number.fill("44.5")
    number.press("Enter")
    assert page.evaluate("values['controller.b']") == 44.5
    number.fill("nonsense")
    number.press("Enter")
    assert fault(page, "controller.b") == "expected a number > 0, found nonsense; the design still has 44.5"
    assert number.get_attribute("aria-invalid") == "true"
    assert page.evaluate("values['controller.b']") == 44.5
    number.fill("45")
    number.press("Enter")
    assert (fault(page, "controller.b"), page.evaluate("values['controller.b']")) == ("", 45)
    controls = "[...document.querySelectorAll('button, select, input')]"
    unnamed = f"{controls}.filter(e => !(e.labels?.length || e.ariaLabel || e.textContent.trim()))"
    assert page.evaluate(f"{unnamed}.map(e => e.outerHTML)") == []


def test_a_design_that_cannot_be_is_said_and_left_again(opened, client):
    page = settled(opened(client.server.address))
    enter(page, "environment.delay", 20)
    settled(page)
    enter(page, "rates.ratio", 10)
    page.wait_for_selector("#fault")
    for path in ("rates.ratio", "environment.delay"):  # that which was changed, and that which is named
        assert fault(page, path) == "environment.delay: expected a whole number <= 10 (rates.ratio), found 20"
    assert "see rates.ratio, environment.delay" in page.inner_text("#fault")
    assert page.inner_text("#state") == "✕ not possible"
    page.wait_for_timeout(600)  # the proof is not begun
    assert page.inner_text("#proof") == ""
    enter(page, "environment.delay", 4)
    page.wait_for_selector("#fault", state="hidden")
    settled(page)
    assert page.locator(".fault:not(:empty), [aria-invalid]").count() == 0
    page.keyboard.press("Control+z")
    page.wait_for_selector("#fault")
    page.keyboard.press("Control+z")
    settled(page)
    assert page.locator(".fault:not(:empty), [aria-invalid]").count() == 0
    assert page.input_value("[id='s-rates.ratio-number']") == "20"


def test_steps_are_taken_back_and_done_again(opened, client):
    """A drag is one step, and so is a number that is typed."""
    page = settled(opened(client.server.address))
    assert page.locator("#undo:disabled, #redo:disabled, #reset:disabled").count() == 3
    move(page, "device.mass", 0.8).mouse.up()
    dragged = page.evaluate("values['device.mass']")
    enter(page, "controller.b", 31)
    state = "[values['device.mass'], values['controller.b'], plane.y_span[1]]"
    assert page.evaluate(state) == [dragged, 31, 6000]
    page.click("#plane")
    settled(page)
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    assert page.evaluate(state)[:2] == [dragged, 25]
    page.click("#undo")
    assert page.evaluate(state) == [0.1, 25, 6000]
    assert page.locator("#undo:disabled").count() == 1
    page.keyboard.press("Control+Shift+z")
    page.click("#redo")
    assert page.evaluate(state)[:2] == [dragged, 31]
    assert page.input_value("[id='s-controller.b-number']") == "31"
    settled(page)
    table = wavesweep.zwidth(
        HOLE
        | {
            "device": {"mass": dragged},
            "controller": {"kind": "pmw", "b": 31.0},
            "sweep": HOLE["sweep"] | {"B_VE": [1.0], "b": [31]},
        }
    )
    assert_ends_of(page, table)


def test_drawn_loops_are_explored(opened, serving):
    page = settled(opened(serving(ARM).server.address))
    table = wavesweep.stability_region(ARM | {"sweep": ARM["sweep"] | {"kp": [240]}})
    assert ends(page, "numbers.c") == (list(zip(table.low, table.high, strict=True)), True)
    assert page.is_hidden("#loop")


@pytest.mark.parametrize("width", [1280, 390])
def test_a_loop_without_a_hand_shows_step_and_margins_while_it_is_dragged(opened, serving, width):
    page = settled(opened(serving(DRIVE).server.address, viewport={"width": width, "height": 1000}))
    page.locator("#loop").scroll_into_view_if_needed()
    until(page, "margins?.key === marginsKey()")
    at_rest = page.locator("#m-phase").inner_text()
    move(page, "numbers.J", 0.7)
    page.locator("#loop").scroll_into_view_if_needed()
    until(page, "answer.open && document.querySelectorAll('#l0 .curve, #l1 .curve, #l2 .curve, #l3 .curve').length === 4")
    page.mouse.up()
    until(page, "margins?.key === marginsKey() && !document.body.classList.contains('waiting')")
    loop = wavesweep.compile(DRIVE).with_(J=page.evaluate("values['numbers.J']"))
    phase = loop.margins("control.y").set_index("margin")["value"]["phase"]
    assert float(page.get_attribute("#m-phase", "data-value")) == pytest.approx(phase, rel=1e-12)
    assert page.locator("#m-phase").inner_text() != at_rest
    assert page.locator("#l1 .disk").count() == 1
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.focus("#route")
    page.keyboard.press("End")  # the last choice, by the keyboard
    until(page, "route === null && answer.step.unit === 'ratio' && document.querySelector('#l0 .title, #l0 text')")
    enter(page, "numbers.kp", 9)
    until(page, "margins?.key === marginsKey()")
    assert "No margins" in page.inner_text("#loopnote")
    assert page.locator("#l1 .disk, #l2 .margin").count() == 0


def test_a_saved_page_works_without_a_server(opened, tmp_path):
    spec = replace(load(HOLE), name="a, b")
    (tmp_path / "page.html").write_text(saved_page(spec), encoding="utf-8")
    page = settled(opened((tmp_path / "page.html").as_uri()))
    for rows in page.locator("#report section table").all():
        assert rows.locator("tr").nth(1).locator("td").count() == rows.locator("th").count()
    table = wavesweep.zwidth(HOLE | {"sweep": HOLE["sweep"] | {"B_VE": [1.0]}})
    for place, b in enumerate((20.0, 25.0)):
        page.evaluate(
            "([id, place]) => { const s = document.getElementById(id); s.value = place; s.dispatchEvent(new Event('input')); }",
            ["s-controller.b", place],
        )
        rows = table[table.b == b]
        assert_ends_of(page, rows)
    slider = page.locator("[id='s-environment.B_VE']")  # a number of an axis of the plane
    slider.focus()
    for key in ("Home", "End"):
        page.keyboard.press(key)
        damping = page.evaluate("values['environment.B_VE']")
        table = wavesweep.zwidth(HOLE | {"sweep": HOLE["sweep"] | {"B_VE": [damping], "b": [25]}})
        assert_ends_of(page, table)
    assert page.locator("[id='s-environment.K_VE']").count() == 1
    assert page.locator("#report section").count() == 2
    whole = page.evaluate("[plane.x_span, plane.y_span]")
    page.click("#in")
    inner = page.evaluate("[plane.x_span, plane.y_span]")
    for (low, high), (first, last) in zip(whole, inner, strict=True):
        assert low <= first < last <= high
        assert last - first == pytest.approx((high - low) / 2, rel=0.01)
    for _ in range(2):
        page.click("#out")
    assert page.evaluate("[plane.x_span, plane.y_span]") == whole  # a saved page knows no more
    heads = page.locator("#report section").first.locator("th").all_inner_texts()
    assert {"high"} <= {head.partition(" ")[0] for head in heads}
    assert not {"doubt"} & {*heads}  # all rows are certified
    assert page.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
    facts = json.loads(page.locator("#report section pre").first.text_content())
    assert facts["spec_sha256"] == load(HOLE).sha256
