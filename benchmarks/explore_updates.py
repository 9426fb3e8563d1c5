"""Updates a second of `wavesweep explore` while a slider is dragged: of the server alone, and as a browser draws them.

python benchmarks/explore_updates.py [SPEC...]

The browser is a headless Chromium of the system, driven by playwright, at 1280 x 900 pixels; it shares the processors with the
server. Without them the second number is missing.
"""

import http.client
import json
import shutil
import sys
import threading
import time
from dataclasses import asdict

from wavesweep.explore.explorer_page import Page
from wavesweep.explore.server import Server
from wavesweep.program.spec import load

SECONDS = 3.0
SPECS = ("sweeps/paper/fig4.toml", "sweeps/paper/fig8.toml", "sweeps/examples/hole.toml")


def measured(source):
    """Seconds of each update, of the answer over HTTP, while b is varied."""
    page = Page(load(source))
    server = Server(page.text, page.answers)
    threading.Thread(target=server.serve, daemon=True).start()
    own = f"127.0.0.1:{server.server_address[1]}"
    headers = {"Content-Type": "application/json", "Origin": f"http://{own}"}
    search = {slider.path: slider.search for slider in page.sliders if slider.path in (page.plane.x, page.plane.y)}
    connection, seconds = http.client.HTTPConnection(own), []
    while sum(seconds) < SECONDS:
        values = {"controller.b": 20 + 0.01 * len(seconds)}
        body = json.dumps({"values": values, "plane": asdict(page.plane), "search": search})
        started = time.perf_counter()
        connection.request("POST", f"/{server.token}/quick", body, headers)
        answer = connection.getresponse().read()
        seconds.append(time.perf_counter() - started)
        assert "error" not in json.loads(answer)
    connection.close()
    return seconds


DRAG = """async seconds => {
  const slider = document.getElementById("s-controller.b"), low = +slider.min || 0, high = +slider.max || 1000, rates = [];
  const started = performance.now();
  await new Promise(done => {
    const tick = now => {
      if (now - started > 1e3 * seconds) return done();
      slider.value = low + (high - low) * (0.5 + 0.2 * Math.sin((now - started) / 700));
      slider.dispatchEvent(new Event("input", {bubbles: true}));
      if (now - started > 1500) rates.push(+document.getElementById("how").dataset.updates);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  });
  return rates.sort((a, b) => a - b);
}"""


def drawn(source):
    """Updates of each last second that a browser shows while b is dragged; none without a browser."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        return []
    page = Page(load(source))
    server = Server(page.text, page.answers)
    threading.Thread(target=server.serve, daemon=True).start()
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        tab = browser.new_page(viewport={"width": 1280, "height": 900})
        tab.goto(f"http://127.0.0.1:{server.server_address[1]}/{server.token}/")
        tab.wait_for_timeout(3000)
        rates = tab.evaluate(DRAG, 5)
        browser.close()
    return rates


if __name__ == "__main__":
    for source in sys.argv[1:] or SPECS:
        seconds = sorted(measured(source))
        middle, least = seconds[len(seconds) // 2], seconds[0]
        rate = len(seconds) / sum(seconds)
        shown = drawn(source)
        said = f"; in the browser {shown[len(shown) // 2]}, at least {shown[0]}" if shown else "; no browser here"
        print(f"{source}: {rate:.0f} updates a second; {1e3 * middle:.1f} ms, at least {1e3 * least:.1f} ms{said}", flush=True)
