"""A web server for one reader on this machine: nothing listens on another address, and a random token is in the path.

Another page in the same browser must learn nothing: it does not know the token, a name that it resolves to this machine
is refused as `Host`, and no answer allows other origins.
"""

from __future__ import annotations

import hmac
import secrets
import socket
import socketserver
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any, ClassVar, Final

from sim_action.core.records import dataclass
from sim_action.core.wording import note

MAX_CONNECTIONS: Final = 32
"""The number of connections at a time, and so of threads."""

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
    """The answer to a request.

    Attributes:
        body: the content; empty: there is nothing new.
        kind: the media type.
        policy: the content security policy.
    """

    body: bytes
    kind: str = "text/html; charset=utf-8"
    policy: str = "default-src 'none'"


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
            oldest = next((each for each, is_waiting in self._open.items() if is_waiting), None)
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
