"""The server alone: who is answered, what, and when it ends."""

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest
from support.program import PROGRAM

from wavesweep.explore.server import GRACE, LARGEST_QUESTION, Server

QUESTION = json.dumps({"values": {}})


def test_the_page_is_there_with_its_data_and_a_policy(client):
    status, headers, text = client.send("GET", "")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert re.search(r"default-src 'none'; script-src 'sha256-[^']+'; [^\"]*connect-src 'self'", text)
    assert "{{" not in text
    assert json.loads(re.search(r'id="data">(.*?)</script>', text)[1])["name"] == "spec"


EVIL = {"host": ("evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "[::1]:{port}", "")}
EVIL |= {"origin": ("http://evil.example", "null", "http://127.0.0.1", "https://127.0.0.1:{port}")}
EVIL |= {"token": ("", "x", "%C3%A9", "../..", "{token}A", "{less}")}


@pytest.mark.parametrize(("part", "value"), [(part, value) for part, values in EVIL.items() for value in values])
def test_another_host_origin_or_token_gets_403_and_nothing_else(client, part, value):
    """A hostile page can point a name at this machine, and other users of it can try tokens."""
    server = client.server
    value = value.format(port=server.server_address[1], token=server.token, less=server.token[:-1])
    for method, path, body in (("GET", "", None), ("GET", "alive", None), ("POST", "quick", QUESTION)):
        status, headers, text = client.send(method, path, body, **{part: value})
        assert (status, text) == (403, "403 Forbidden\n")
        assert "Access-Control-Allow-Origin" not in headers


def test_a_question_without_an_origin_or_as_a_form_gets_403(client):
    """A form of another page can send plain text without asking first."""
    assert client.send("POST", "quick", QUESTION, origin=None)[0] == 403
    assert client.send("POST", "quick", QUESTION, kind="text/plain")[0] == 403


def test_there_is_no_way_to_a_file_and_no_other_method(client):
    for path in ("page.html", "../pyproject.toml", "%2e%2e/etc/passwd", "quick/x", "index.html"):
        assert client.send("GET", path)[0] == client.send("POST", path, QUESTION)[0] == 404
    for method in ("PUT", "DELETE", "OPTIONS", "HEAD"):
        assert client.send(method, "")[0] == 501


def test_nonsense_is_refused_and_the_server_lives(client):
    nonsense = ("{", "[1]", "3", "{}", '{"values": 3}', '{"values": {"controller.kind": "dc"}}', "[" * 30000)
    nonsense += ('{"values": {"controller.b": "20"}}', '{"values": {}, "plane": {"x": "a"}}')
    for body in nonsense:
        assert client.send("POST", "quick", body)[0] == 400
    assert client.send("POST", "quick", " " * (LARGEST_QUESTION + 1))[0] == 413
    assert client.send("GET", "")[0] == 200


@pytest.mark.parametrize(("length", "status"), [(None, 411), ("9" * 5000, 413), ("-1", 411), ("1e3", 411)])
def test_a_body_without_a_length_or_of_an_absurd_one_is_refused(client, length, status):
    port = client.server.server_address[1]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=300)
    connection.putrequest("POST", f"/{client.server.token}/quick")
    for name, value in (("Origin", f"http://127.0.0.1:{port}"), ("Content-Type", "application/json")):
        connection.putheader(name, value)
    if length:
        connection.putheader("Content-Length", length)
    connection.endheaders()
    assert connection.getresponse().status == status
    connection.close()


def test_the_server_listens_on_loopback_alone(client):
    assert client.server.server_address[0] == "127.0.0.1"
    assert len(client.server.token) >= 32
    with Server(str, {}) as other:
        assert other.token != client.server.token


def test_a_fault_of_an_answer_is_a_line_on_stderr(capfd):
    def broken(_):
        raise ZeroDivisionError("x")

    server = Server(str, {"quick": broken})
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    port = server.server_address[1]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=300)
    headers = {"Origin": f"http://127.0.0.1:{port}", "Content-Type": "application/json"}
    connection.request("POST", f"/{server.token}/quick", "{}", headers)
    with pytest.raises(http.client.RemoteDisconnected):
        connection.getresponse()
    assert "Error: ZeroDivisionError: x (a fault of wavesweep)\n" in capfd.readouterr().err
    server.open_page(1)
    server.open_page(-1)
    server._seen -= GRACE + 1
    thread.join(10)
    assert not thread.is_alive()


SPEC = 'controller.kind = "pmw"\n'
SHORT = 0.5  # s in place of GRACE


def started(tmp_path, *options):
    """The command in a process of its own, and its address."""
    (tmp_path / "mine.toml").write_text(SPEC)
    program = f"from wavesweep.explore import server\nserver.GRACE = {SHORT}\n{PROGRAM}"
    command = [sys.executable, "-c", program, "explore", "mine.toml", "--no-browser", *options]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    address = process.stderr.readline().split()[0]
    port, token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/", address).groups()
    return process, int(port), token


@pytest.mark.slow
def test_the_command_ends_when_its_page_is_closed(tmp_path):
    process, port, token = started(tmp_path)
    page = http.client.HTTPConnection("127.0.0.1", port, timeout=300)
    page.request("GET", f"/{token}/alive")
    assert page.getresponse().read(5) == b"data:"
    time.sleep(2 * SHORT)
    assert process.poll() is None
    page.close()
    page.sock = None
    assert process.wait(300) == 0
    assert process.stderr.read() == ""
    process.stderr.close()


@pytest.mark.slow
def test_the_command_ends_with_ctrl_c(tmp_path):
    process, _, _ = started(tmp_path)
    os.kill(process.pid, signal.SIGINT)
    assert process.wait(300) == 130
    assert process.stderr.read() == "Interrupted.\n"
    process.stderr.close()
