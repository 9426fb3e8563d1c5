"""The page in a browser: opened, dragged, read, and compared with `zwidth`."""

import json
import re
import shutil
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import wavesweep
from tests.explore.conftest import ARM, HOLE
from wavesweep.explore.page import Page, saved_page
from wavesweep.explore.server import GRACE, Server
from wavesweep.spec import load

pytestmark = pytest.mark.slow
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FIRST_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"


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
    deadline = time.monotonic() + 30
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


def test_updates_come_while_a_slider_is_dragged(opened, client):
    """Some 30 a second on a free core; the bound leaves room for a machine at work."""
    page = settled(opened(client.server.address))
    drag = """async () => {
      const slider = document.getElementById("s-controller.b"), seen = [];
      new MutationObserver(() => seen.push(performance.now())).observe(document.getElementById("own"), {childList: true});
      for (let k = 0, start = performance.now(); performance.now() - start < 2000; k++) {
        slider.value = 400 + k % 200; slider.dispatchEvent(new Event("input"));
        await new Promise(requestAnimationFrame);
      }
      const tens = seen.slice(10).map((at, k) => at - seen[k]);
      return [seen.length / 2, 1e4 / Math.min(...tens)];
    }"""
    rate, best = page.evaluate(drag)
    print(f"{rate:g} updates a second, {best:.0f} in the fastest ten")  # noqa: T201 - pytest -s shows the measurement
    assert rate > 3


def test_first_paint_takes_less_than_a_second(opened, client):
    page = opened(client.server.address)
    until(page, "performance.getEntriesByName('first-contentful-paint').length > 0")
    assert page.evaluate(FIRST_PAINT) < 1000


def test_the_page_can_be_used_by_the_keyboard_alone(opened, client):
    page = settled(opened(client.server.address))
    page.focus("[id='s-device.damping']")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("values['device.damping']") > 1.5
    assert "N*s/m" in page.get_attribute("[id='s-device.damping']", "aria-valuetext")
    page.focus("#plane")
    before = page.evaluate("values['environment.K_VE']")
    page.keyboard.press("ArrowUp")
    assert page.evaluate("values['environment.K_VE']") > before
    number = page.locator("[aria-label='controller.b, number'], [aria-label='b, number']").first
    number.fill("44.5")
    number.press("Enter")
    assert page.evaluate("values['controller.b']") == 44.5
    number.fill("nonsense")
    number.press("Enter")
    assert number.input_value() == "44.5"
    controls = "[...document.querySelectorAll('button, select, input')]"
    unnamed = f"{controls}.filter(e => !(e.labels?.length || e.ariaLabel || e.textContent.trim()))"
    assert page.evaluate(f"{unnamed}.map(e => e.outerHTML)") == []


def test_a_design_that_cannot_be_is_said_and_left_again(opened, client):
    page = settled(opened(client.server.address))
    page.evaluate("set('rates.ratio', 20); set('environment.delay', 20)")
    settled(page)
    page.evaluate("set('rates.ratio', 10)")
    page.wait_for_selector("#fault:not([hidden])")
    assert "environment.delay: expected a whole number <= 10" in page.inner_text("#fault")
    page.evaluate("set('environment.delay', 4)")
    page.wait_for_selector("#fault", state="hidden")
    settled(page)


def test_the_plane_can_be_chosen(opened, client):
    page = settled(opened(client.server.address))
    page.select_option("#x", "controller.b")
    settled(page)
    assert "values of b" in page.inner_text("#how")
    assert page.evaluate("picture.columns.flat().every(each => each[2])")


def test_the_button_copies_the_spec(opened, client):
    page = opened(client.server.address, permissions=["clipboard-read", "clipboard-write"])
    page.evaluate("set('controller.b', 33.5)")
    page.click("#copy")
    until(page, "document.getElementById('copied').textContent.startsWith('Copied')")
    text = page.evaluate("navigator.clipboard.readText()")
    assert load_text(text).sha256 == load(HOLE).with_values({"b": 33.5}).sha256


def load_text(text):
    import tomllib

    return load(tomllib.loads(text))


def test_a_page_of_another_origin_gets_nothing(browser, client, serving):
    """Another server of this machine, which is another origin to a browser."""
    other = serving(ARM)
    page = browser.new_context().new_page()
    page.goto(other.server.address)
    until(page, "window.ready")
    page.evaluate("document.querySelector('meta[http-equiv]').remove()")
    ask = """async address => { try { const got = await fetch(address + "quick", {method: "POST", body: "{}",
      headers: {"Content-Type": "application/json"}}); return "got " + got.status; } catch (error) { return "nothing"; } }"""
    assert page.evaluate(ask, client.server.address) == "nothing"
    page.context.close()


def test_drawn_loops_are_explored(opened, serving):
    page = settled(opened(serving(ARM).server.address))
    table = wavesweep.stability_region(ARM | {"sweep": ARM["sweep"] | {"kp": [240]}})
    assert ends(page, "numbers.c") == (list(zip(table.low, table.high, strict=True)), True)
    assert "more slowly" in page.inner_text("#mode")


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
    assert page.locator("#report section").count() == 2
    assert page.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
    facts = json.loads(page.locator("#report section pre").first.text_content())
    assert facts["spec_sha256"] == load(HOLE).sha256


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_nothing_is_wider_than_the_window_and_texts_can_be_read(opened, client, width, scheme):
    page = settled(opened(client.server.address, viewport={"width": width, "height": 800}, color_scheme=scheme))
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    look_up = "name => getComputedStyle(document.documentElement).getPropertyValue(name)"
    names = ["--ink", "--soft", "--accent", "--bad", "--ghost"]
    pairs = [[page.evaluate(look_up, each) for each in (name, "--card")] for name in names]
    assert min(contrast(*pair) for pair in pairs) > 4.5  # WCAG 2.2, 1.4.3


def contrast(one, other):
    """Ratio of the luminances of two colours such as #123abc."""
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def luminance(colour):
    digits = re.fullmatch(r"\s*#([0-9a-f]{3}|[0-9a-f]{6})", colour)[1]
    digits = "".join(c + c for c in digits) if len(digits) == 3 else digits
    parts = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_the_server_ends_after_its_page(browser):
    made = Page(load(ARM))
    server = Server(made.text, made.answers)
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    page = browser.new_context().new_page()
    page.goto(server.address)
    until(page, "window.ready")
    page.reload()
    page.wait_for_timeout(1000 * (GRACE + 1))
    assert thread.is_alive()
    page.context.close()
    thread.join(15)
    assert not thread.is_alive()
