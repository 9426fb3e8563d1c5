"""A page that is served in a thread, and questions to it as a browser sends them."""

import http.client
import json
import threading
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from support import drawn

from wavesweep.explore.explorer_page import Page
from wavesweep.explore.server import Server
from wavesweep.program.spec import load

HOLE = {
    "controller": {"kind": "pmw", "b": 25.0},
    "environment": {"integration": "explicit"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    "sweep": {"K_VE": {"start": 0, "stop": 6000}, "B_VE": {"start": 0, "stop": 5, "num": 11}, "b": [20, 25]},
}
ARM = tomllib.loads(drawn.ARM)
DRIVE = Path(__file__).parents[2] / "sweeps" / "templates" / "drive.toml"
UNEVEN = HOLE | {"rates": {"slow_hz": 60.0}}


@dataclass
class Client:
    """A browser that knows the server's address."""

    server: Server
    page: Page

    def send(self, method, path, body=None, host=None, origin="own", token=None, kind="application/json"):
        """The status, the headers and the text of an answer."""
        port = self.server.server_address[1]
        own = f"127.0.0.1:{port}"
        headers = {"Host": own if host is None else host}
        if origin == "own" and method == "POST":
            headers["Origin"] = f"http://{own}"
        elif origin != "own" and origin is not None:
            headers["Origin"] = origin
        if body is not None:
            headers["Content-Type"] = kind
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=300)
        try:
            token = self.server.token if token is None else token
            connection.request(method, f"/{token}/{path}", body, headers)
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read().decode()
        finally:
            connection.close()

    def ask(self, name, **question):
        """The answer to a question."""
        status, _, text = self.send("POST", name, json.dumps({"values": {}, **question}))
        assert status == 200, text
        return json.loads(text)


@pytest.fixture(scope="session")
def serving():
    """Serve the page of a spec until the tests end."""
    opened = []

    def start(source):
        page = Page(load(source), answer_s=300)
        server = Server(page.text, page.answers)
        server.open_page(1)  # one that stays open until the tests end
        thread = threading.Thread(target=server.serve, daemon=True)
        thread.start()
        opened.append((server, thread))
        return Client(server, page)

    yield start
    for server, _ in opened:
        server.open_page(-1)
    for _, thread in opened:
        thread.join(10)
        assert not thread.is_alive()


@pytest.fixture(scope="session")
def client(serving):
    return serving(HOLE)
