"""The server of a page: on this machine's loopback alone, behind a token, and over as soon as the
page is closed.

A request is answered only if it names this address as its host (a page of another site cannot make
a browser do so), comes from the page itself if it has an origin, and has the token in its path.
There is no path to any file.
"""

import hmac
import json
import secrets
import sys
import time
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock

LOOPBACK = "127.0.0.1"
LARGEST_QUESTION = 64 * 1024  # bytes of a question
# s without any page after which the server ends; a page that is loaded again takes less
GRACE = 3.0
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "DENY",
}

Answer = Callable[[Mapping[str, object]], Mapping[str, object]]


class Server(ThreadingHTTPServer):
    """A server of one page and of the answers to its questions.

    page: gives the text of the page. answers: name of a question -> function from its JSON to that
    of the answer. port: 0 for any free one.
    """

    request_queue_size = 512  # a browser may ask for many things at once, and others may knock

    daemon_threads = True
    block_on_close = False
    timeout = 0.25  # s between two looks at the pages

    def __init__(
        self, page: Callable[[], str], answers: Mapping[str, Answer], port: int = 0
    ) -> None:
        super().__init__((LOOPBACK, port), Handler)
        self.page, self.answers, self.token = page, answers, secrets.token_urlsafe(24)
        self._pages, self._seen, self._lock = 0, None, Lock()

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{LOOPBACK}:{self.server_address[1]}/{self.token}/"

    def serve(self) -> None:
        """Answer until the last page has been closed for GRACE seconds."""
        with self:
            while not self.over():
                self.handle_request()

    def over(self) -> bool:
        """Whether the last page has been closed for GRACE seconds."""
        with self._lock:
            return (
                self._pages == 0
                and self._seen is not None
                and time.monotonic() - self._seen > GRACE
            )

    def open_page(self, change: int) -> None:
        """Count a page that was opened (1) or closed (-1)."""
        with self._lock:
            self._pages += change
            self._seen = time.monotonic()

    def handle_error(self, request, client_address) -> None:  # noqa: ARG002 - the names of the base
        """Print an error in one line, and nothing about a connection that the browser has given
        up."""
        error = sys.exception()
        if not isinstance(error, OSError):
            sys.stderr.write(f"Error: {type(error).__name__}: {error} (a fault of wavesweep)\n")


class Handler(BaseHTTPRequestHandler):
    """One connection of a browser."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version = "wavesweep"
    sys_version = ""
    timeout = 60  # s of silence after which a connection is closed; a browser opens another one
    wbufsize = -1  # head and body go out together
    disable_nagle_algorithm = True

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the name of the base
        """Keep the terminal quiet."""

    def do_GET(self) -> None:
        """The page, and the connection that it keeps open."""
        address, name = self.path.partition("?")[0], self._asked()
        if name == "" and not address.endswith(
            "/"
        ):  # addresses of questions are relative to the page's
            self._head(
                HTTPStatus.PERMANENT_REDIRECT, "text/plain; charset=utf-8", 0, place=f"{address}/"
            )
        elif name == "":
            self._send(HTTPStatus.OK, self.server.page().encode(), "text/html; charset=utf-8")
        elif name == "alive":
            self._stay()
        elif name is not None:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """The answer to a question."""
        name = self._asked(asking=True)
        if name is None:
            return
        if name not in self.server.answers:
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        length = self.headers.get("Content-Length", "")
        if (
            not length.isascii()
            or not length.isdigit()
            or len(length) > 9
            or int(length) > LARGEST_QUESTION
        ):
            self._refuse(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE
                if length.isdigit()
                else HTTPStatus.LENGTH_REQUIRED
            )
            return
        try:
            answer = self.server.answers[name](dict(json.loads(self.rfile.read(int(length)))))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            self._refuse(HTTPStatus.BAD_REQUEST)
            return
        self._send(HTTPStatus.OK, as_json(answer).encode(), "application/json")

    def _asked(self, asking: bool = False) -> str | None:
        """The last part of the path; None, with a refusal, unless host, origin and token are
        those of the page."""
        _, token, name = (*self.path.partition("?")[0].split("/", 2), "", "")[:3]
        if not (
            self._from_here(asking)
            and hmac.compare_digest(token.encode(), self.server.token.encode())
        ):
            self._refuse(HTTPStatus.FORBIDDEN)
            return None
        return name

    def _from_here(self, asking: bool) -> bool:
        """Whether host and origin are those of the page."""
        port = self.server.server_address[1]
        hosts = [f"{name}:{port}" for name in (LOOPBACK, "localhost")]
        origin = self.headers.get("Origin")
        right = self.headers.get_all("Host") in [[host] for host in hosts]
        right &= origin in [f"http://{host}" for host in hosts] or (origin is None and not asking)
        return right and (not asking or self.headers.get_content_type() == "application/json")

    def _stay(self) -> None:
        """Keep the connection until the page has gone; a browser does not slow this down in a
        tab that is not seen."""
        self._head(HTTPStatus.OK, "text/event-stream", None)
        self.server.open_page(1)
        try:
            while True:
                self.wfile.write(b"data: here\n\n")
                self.wfile.flush()
                # Seconds between two signs of life on the connection that a page keeps open.
                time.sleep(1.0)
        except OSError:
            self.close_connection = True
        finally:
            self.server.open_page(-1)

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True  # the body of the question has not been read
        self._send(
            status, f"{status.value} {status.phrase}\n".encode(), "text/plain; charset=utf-8"
        )

    def _send(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        self._head(status, kind, len(body))
        self.wfile.write(body)
        self.wfile.flush()

    def _head(self, status: HTTPStatus, kind: str, length: int | None, place: str = "") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if place:
            self.send_header("Location", place)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if length is not None:
            self.send_header("Content-Length", str(length))
        if self.close_connection or length is None:
            self.send_header("Connection", "close")
        self.end_headers()


def as_json(value: object) -> str:
    """JSON in which numbers that are not finite are null."""
    return json.dumps(_finite(value), allow_nan=False, separators=(",", ":"))


def _finite(value):
    if isinstance(value, float):
        return value if value - value == 0 else None
    if isinstance(value, Mapping):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value
