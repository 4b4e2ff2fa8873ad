"""`view --live` and `run --watch --live`: real sockets on this machine, real runs, Ctrl-C."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from sim_action.app.live import MAX_CONNECTIONS, Answering, LivePages, LoopbackServer
from sim_action.cli.main import call
from sim_action.results.journal import JOURNAL_FILE, Finished
from tests.integration.conftest import write
from tests.integration.marked_processes import processes_of
from tests.integration.test_watch import SCENARIO, watching
from tests.patience import PATIENCE, wait_until
from tests.results.test_journal import begun, outcome


@contextmanager
def serving(answering: Answering) -> Iterator[LoopbackServer]:
    """A server in this process."""
    with LoopbackServer(0, answering) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LoopbackServer]:
    with serving(LivePages(tmp_path)) as server:
        yield server


def asked(address: str, path: str = "", method: str = "GET", host: str | None = None) -> http.client.HTTPResponse:
    """The answer to a request; `path` is behind the token, unless it begins with a slash."""
    url = urlsplit(address)
    connection = http.client.HTTPConnection("127.0.0.1", url.port, timeout=PATIENCE)
    connection.putrequest(method, path if path.startswith("/") else url.path + path, skip_host=True)
    if host != "":
        connection.putheader("Host", host or f"127.0.0.1:{url.port}")
    connection.endheaders()
    return connection.getresponse()


def connected(server: LoopbackServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.server_address[1]))


def state(address: str) -> dict[str, Any]:
    return dict(json.loads(asked(address, "state").read()))


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_whoever_has_the_token_sees_progress_and_report(name: str, server: LoopbackServer, tmp_path: Path) -> None:
    begun(tmp_path)(Finished(0, outcome("a")))
    assert urlsplit(server.address).hostname == "127.0.0.1"
    # A browser leaves out port 80.
    assert asked(server.address, "state", host=name).status == 200
    for page, word in (("", b"Waiting for a run"), ("report", b"travel")):
        answer = asked(server.address, page, host=f"{name}:80")
        assert answer.status == 200
        assert word in answer.read()
        assert "connect-src 'self'" in answer.headers["Content-Security-Policy"]
        assert answer.headers["Cache-Control"] == "no-store"
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert answer.headers["Access-Control-Allow-Origin"] is None
    progress = state(server.address)
    assert progress["finished"] == 1
    assert asked(server.address, f"state?after={progress['version']}").status == 204
    assert asked(server.address, "state?after=other").status == 200


@pytest.mark.skipif(sys.platform == "win32", reason="another program could take the port there")
def test_its_port_can_be_used_again_at_once(tmp_path: Path) -> None:
    with serving(LivePages(tmp_path)) as server:
        port = server.server_address[1]
        # The server closes this connection first: the kernel keeps its port for a minute.
        assert asked(server.address, "state").status == 200
    with LoopbackServer(port, LivePages(tmp_path)) as server:
        assert server.server_address[1] == port


NOT_FOUND = (
    *(("GET", path, None) for path in ("/", "/state", "/wrong/", "results.jsonl", "report.html", "../results.jsonl")),
    *(("GET", path, None) for path in ("%2e%2e/", "state/")),
    *(("GET", "state", host) for host in ("evil.example", "127.0.0.1.evil.example:80", "")),
    *((method, "state", None) for method in ("POST", "PUT", "DELETE", "OPTIONS", "HEAD", "<b>")),
)


def test_everything_else_is_not_found(server: LoopbackServer, tmp_path: Path) -> None:
    begun(tmp_path)
    (tmp_path / "report.html").write_text("secret")
    for method, path, host in NOT_FOUND:
        answer = asked(server.address, path, method, host)
        assert (answer.status, answer.read()) == (404, b""), (method, path, host)
    with connected(server) as sent:
        sent.sendall("GET /éééé/state HTTP/1.0\r\nHost: localhost:80\r\n\r\n".encode())
        assert sent.makefile("rb").readline().split()[1] == b"404"


@contextmanager
def started(folder: Path, environment: dict[str, str], *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The command line in a process of its own, which the end of the block kills."""
    command = [sys.executable, "-m", "sim_action", *arguments]
    output, errors = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=output, stderr=errors, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def test_damaged_requests_end_nothing(server: LoopbackServer) -> None:
    for sent in (b"\r\n\r\n", b"GET\r\n\r\n", b"\xff\x00\n", b"GET / HTTP/9.9\r\n\r\n", b"A" * 70_000):
        with connected(server) as connection:
            connection.sendall(sent)
    assert asked(server.address, "state").status == 200


def test_slow_connections_do_not_lock_anybody_out(server: LoopbackServer) -> None:
    slow = [connected(server) for _ in range(2 * MAX_CONNECTIONS)]
    for connection in slow:
        connection.sendall(b"GET /")
    assert asked(server.address, "state").status == 200
    for connection in slow:
        connection.close()


def test_open_connections_do_not_keep_it_alive(tmp_path: Path) -> None:
    with serving(LivePages(tmp_path)) as server:
        idle = connected(server)
        assert asked(server.address, "state").status == 200
    with idle:
        idle.settimeout(PATIENCE)
        assert idle.recv(1) == b""
    with pytest.raises(ConnectionRefusedError):
        connected(server)


def test_hostile_files_are_told_as_text(server: LoopbackServer, tmp_path: Path) -> None:
    (tmp_path / JOURNAL_FILE).write_bytes(b"{}\n")
    assert "is not a valid journal" in state(server.address)["problem"]
    assert asked(server.address, "report").status == 200


def test_a_port_in_use_is_told(server: LoopbackServer, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = str(server.server_address[1])
    assert call(["view", str(tmp_path), "--live", "--print", "--port", port]) == 2
    assert f"cannot listen on port {port} of this machine: " in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process of its own here")
def test_a_run_of_two_jobs_is_followed_from_before_its_start(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    for place in range(6):
        write(tmp_path / f"{place}.sim.yml", SCENARIO.format(name=f"number {place}"))
    environment = {**os.environ, "GITHUB_ACTIONS": "", "ROS_MARK": str(tmp_path)}
    with started(tmp_path, environment, "view", "--live", "--print") as view:
        assert view.stdout is not None
        address = view.stdout.readline().strip()
        assert state(address)["call"] == 0
        with started(tmp_path, environment, "run", ".", "--jobs", "2", "--quiet") as run:
            wait_until(lambda: state(address).get("finished", 0) > 0)
            # Whichever of the two jobs ends first.
            assert re.search("number [0-5]", asked(address, "report").read().decode())
            assert run.wait(PATIENCE) == 0
        end = state(address)
        assert (end["finished"], end["isOver"], end["call"]) == (6, True, 1)
        assert [of_a_kind["count"] for of_a_kind in end["lists"]] == [0, 0, 6, 0]
        assert asked(address, "report").read().decode().count('<article id="s') == 7  # And the page of all.
        view.send_signal(signal.SIGINT)
        assert view.wait(PATIENCE) == 130
        assert processes_of(tmp_path) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process of its own here")
def test_watch_serves_each_of_its_runs(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    write(tmp_path / "a.sim.yml", SCENARIO.format(name="first"))
    with watching(tmp_path, "--live") as until_line:
        told = until_line("watching 1 file")
        [address] = [word for word in told.split() if word.startswith("http://127.0.0.1:")]
        first = state(address)
        assert (first["finished"], first["isOver"]) == (1, True)
        write(tmp_path / "a.sim.yml", SCENARIO.format(name="renamed"))
        until_line("watching 1 file")
        assert "renamed" in asked(address, "report").read().decode()
        assert state(address)["call"] == 2
    with pytest.raises(ConnectionRefusedError):
        state(address)
