"""Updates a second of `wavesweep explore`, as a browser asks for them while a slider is dragged, without their drawing.

python tests/benchmarks/explore_updates.py [SPEC...]
"""

import http.client
import json
import sys
import threading
import time
from dataclasses import asdict

from wavesweep.explore.page import Page
from wavesweep.explore.server import Server
from wavesweep.spec import load

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


if __name__ == "__main__":
    for source in sys.argv[1:] or SPECS:
        seconds = sorted(measured(source))
        middle, least = seconds[len(seconds) // 2], seconds[0]
        rate = len(seconds) / sum(seconds)
        print(f"{source}: {rate:.0f} updates a second; {1e3 * middle:.1f} ms, at least {1e3 * least:.1f} ms")
