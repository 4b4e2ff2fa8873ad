"""The use case `view --live`: serve the progress and the report of a call that goes on, on this machine only.

A call does not serve its own report: it forks children, and a process that forks must have no threads. `run --watch
--live` starts this module as a process of its own, which ends with the call. The simulation only writes its journal.
"""

from __future__ import annotations

import hmac
import json
import os
import secrets
import socket
import socketserver
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any, ClassVar, Final
from urllib.parse import parse_qs

from sim_action.app.view import opened
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, note, system_reason
from sim_action.reports import ReportOptions, workspace_of
from sim_action.reports.html.document import Page
from sim_action.reports.html.live_page import Finished, live_report, live_state, progress_page, version
from sim_action.results.journal import JournalFollower
from sim_action.results.output_folder import JUNIT_FILE

MAX_CONNECTIONS: Final = 32  # the number of connections at a time, and so of threads
_ADDRESS: Final = "127.0.0.1"
_NAMES: Final = frozenset({"127.0.0.1", "localhost"})
_TIMEOUT_S: Final = 10.0
_HEADERS: Final = (
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
)


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a request."""

    body: bytes  # the content; empty: there is nothing new
    kind: str = "text/html; charset=utf-8"  # the media type
    policy: str = "default-src 'none'"  # the content security policy


Answering = Callable[[str, str], Answer | None]
"""A function from the path behind the token and the query to an answer; None: there is no such page."""


class LoopbackServer(socketserver.ThreadingMixIn, socketserver.TCPServer):
    """The server. `with` closes it, and ends all its threads."""

    # On Windows, the option would let another program take the port.
    allow_reuse_address = sys.platform != "win32"
    daemon_threads = True
    request_queue_size = 16

    def __init__(self, port: int, answering: Answering) -> None:
        """Listen on a port of this machine; 0: any free one. Raise OSError."""
        self.token: Final = secrets.token_urlsafe(24)
        self.answering: Final = answering
        # The oldest is the first; True: its request is not complete yet.
        self._open: dict[socket.socket, bool] = {}
        self._guard = threading.Lock()
        super().__init__((_ADDRESS, port), _Handler)
        # The caller knows that there is a request.
        self.timeout = 0

    @property
    def address(self) -> str:
        """The URL with the token."""
        return f"http://{_ADDRESS}:{self.server_address[1]}/{self.token}/"

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Make room if there are too many connections: the oldest without a whole request is closed."""
        with self._guard:
            if len(self._open) < MAX_CONNECTIONS:
                return True
            oldest = next((connection for connection, is_waiting in self._open.items() if is_waiting), None)
            if oldest is None:
                return False
            del self._open[oldest]
            # Its thread, which waits for the rest of the request, closes it.
            with suppress(OSError):
                oldest.shutdown(socket.SHUT_RDWR)
            return True

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a request in a thread of its own."""
        with self._guard:
            self._open[request] = True
        super().process_request(request, client_address)

    def is_complete(self, request: Any) -> None:
        """Keep a connection until it is answered: its request has arrived."""
        with self._guard:
            if request in self._open:
                self._open[request] = False

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self._guard:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def server_close(self) -> None:
        """Stop listening, and close all connections: browsers keep some open without any request."""
        super().server_close()
        with self._guard:
            for request in self._open:
                with suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a connection that broke."""


class _Handler(BaseHTTPRequestHandler):
    server: LoopbackServer
    timeout: ClassVar[float] = _TIMEOUT_S

    def do_GET(self) -> None:
        """Answer a request."""
        self.server.is_complete(self.connection)
        try:
            answer = self._answer()
        except Exception as error:  # noqa: BLE001 - a fault must not end the server, nor show more than its kind
            note(f"a page cannot be made: {type(error).__name__}: {error}")
            self.send_error(500)
            return
        if answer is None:
            self.send_error(404)
            return
        self._send(200 if answer.body else 204, answer)

    def _answer(self) -> Answer | None:
        hosts = self.headers.get_all("Host", [])
        if len(hosts) != 1 or hosts[0].partition(":")[0] not in _NAMES:
            return None
        path, _, query = self.path.partition("?")
        empty, _, rest = path.partition("/")
        token, has_slash, page = rest.partition("/")
        expected = self.server.token.encode()
        if empty or not has_slash or not hmac.compare_digest(token.encode("utf-8", "replace"), expected):
            return None
        return self.server.answering(page, query)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer without any detail. Another method than GET is answered as a page that is not there."""
        self.close_connection = True
        self._send(404 if code == HTTPStatus.NOT_IMPLEMENTED else code, Answer(b"", "text/plain"))

    def _send(self, code: int, answer: Answer) -> None:
        with suppress(OSError):
            self.send_response(code)
            for name, value in (*_HEADERS, ("Content-Security-Policy", answer.policy)):
                self.send_header(name, value)
            if code != 204:
                self.send_header("Content-Type", answer.kind)
                self.send_header("Content-Length", str(len(answer.body)))
            self.end_headers()
            self.wfile.write(answer.body)

    def version_string(self) -> str:
        """Return the name of the server."""
        return "sim-action"

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name in http.server
        """Print nothing: the address has the token."""


_POLL_S: Final = 0.5
_CALL: Final = [sys.executable, "-P", "-m", "sim_action.app.live"]


class LivePages:
    """The pages about the calls in a folder; made when a browser asks for them."""

    def __init__(self, folder: Path) -> None:
        self._options = ReportOptions(
            folder=folder,
            junit=folder / JUNIT_FILE,
            junit_strict=False,
            environment={},
            workspace=workspace_of(os.environ, Path.cwd()),
        )
        self._follower = JournalFollower(folder)
        self._looking = threading.Lock()
        self._making = threading.Lock()
        self._report: tuple[Finished, Answer] | None = None

    def __call__(self, page: str, query: str) -> Answer | None:
        """Return the answer to a request; None: there is no such page."""
        match page:
            case "":
                return _answer(progress_page())
            case "state":
                return self._state(query)
            case "report":
                # The report of a large suite takes seconds. The progress goes on meanwhile.
                with self._making:
                    return self._current_report()
        return None

    def _state(self, query: str) -> Answer:
        """Return the state; nothing if the reader has it already."""
        with self._looking:
            self._follower.look()
            versions = parse_qs(query).get("after")
            unchanged = versions == [version(self._follower)] and not self._follower.problem
            body = b"" if unchanged else json.dumps(live_state(self._follower), allow_nan=False).encode()
        return Answer(body, "application/json")

    def _current_report(self) -> Answer:
        """Return the report of the finished runs; it is made again only if there are more."""
        with self._looking:
            self._follower.look()
            while self._follower.has_more:
                self._follower.look()
            finished, recorded = Finished.of(self._follower), self._follower.recorded
            if self._report is not None and self._report[0] == finished:
                return self._report[1]
            if recorded is None:
                return _answer(progress_page())
            results = recorded.results() if finished.is_over else recorded.results_so_far()
        self._report = (finished, _answer(live_report(results, finished, self._options)))
        return self._report[1]


def _answer(page: Page) -> Answer:
    return Answer(b"".join(page.parts()), policy=page.policy)


def serve_live(folder: Path, port: int, *, print_only: bool) -> ExitCode:
    """Serve the pages about a folder until Ctrl-C; print the address, and open it. Raises UsageError."""
    with Interruption() as interruption, _listening(folder, port) as server:
        sys.stdout.write(f"{server.address}\n")
        sys.stdout.flush()
        if not print_only and not opened(server.address, os.environ):
            note("no browser can be opened here; open this address yourself")
        note("press Ctrl-C to stop")
        _serve(server, interruption, threading.Event())
    return ExitCode.of_command(is_interrupted=True)


@contextmanager
def live_beside(folder: Path, port: int) -> Iterator[None]:
    """Serve the pages about a folder in another process meanwhile, and print the address. Raises UsageError."""
    command = [*_CALL, os.path.abspath(folder), str(port)]  # noqa: PTH100 - links in it stay
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603 - this interpreter
    assert server.stdin is not None
    assert server.stdout is not None
    try:
        address = server.stdout.readline().decode().strip()
        if not address:
            raise UsageError(f"--live: the server could not start; the port {port} may be in use")
        note(f"live report: {address}")
        yield
    finally:
        server.stdin.close()
        server.terminate()
        server.wait()
        server.stdout.close()


def main() -> None:
    """Serve until the standard input ends, which the parent holds open."""
    folder = Path(sys.argv[1])
    port = int(sys.argv[2])
    parent_ended = threading.Event()

    def wait_for_parent() -> None:
        with suppress(OSError, ValueError):
            sys.stdin.buffer.read()
        parent_ended.set()

    with Interruption() as interruption, _listening(folder, port) as server:
        threading.Thread(target=wait_for_parent, daemon=True).start()
        sys.stdout.write(f"{server.address}\n")
        sys.stdout.flush()
        _serve(server, interruption, parent_ended)


def _serve(server: LoopbackServer, interruption: Interruption, ended: threading.Event) -> None:
    while not interruption.happened and not ended.is_set():
        interruption.wait(_POLL_S, server.socket)
        server.handle_request()


def _listening(folder: Path, port: int) -> LoopbackServer:
    try:
        return LoopbackServer(port, LivePages(folder.absolute()))
    except (OSError, OverflowError) as error:
        reason = system_reason(error) if isinstance(error, OSError) else str(error)
        raise UsageError(escaped_line(f"cannot listen on port {port} of this machine: {reason}")) from None


if __name__ == "__main__":
    with suppress(UsageError):
        main()
