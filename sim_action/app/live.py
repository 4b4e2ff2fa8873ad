"""The use case `view --live`: serve the progress and the report of a call that goes on, on this machine only.

A call does not serve its own report: it forks children, and a process that forks must have no threads. `run --watch
--live` starts this module as a process of its own, which ends with the call. The simulation only writes its journal.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final
from urllib.parse import parse_qs

from sim_action.app.loopback import Answer, LoopbackServer
from sim_action.app.view import opened
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.process import Interruption
from sim_action.core.wording import escaped_line, note, system_reason
from sim_action.reports import ReportOptions, workspace_of
from sim_action.reports.html.document import Page
from sim_action.reports.html.live_page import Finished, live_report, live_state, progress_page, version
from sim_action.results.journal_follower import JournalFollower
from sim_action.results.written_files import JUNIT_FILE

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
            known = parse_qs(query).get("after")
            unchanged = known == [version(self._follower)] and not self._follower.problem
            body = b"" if unchanged else json.dumps(live_state(self._follower), allow_nan=False).encode()
        return Answer(body, "application/json")

    def _current_report(self) -> Answer:
        """Return the report of what has finished; it is made again only if there is more."""
        with self._looking:
            self._follower.look()
            while self._follower.has_more:
                self._follower.look()
            known, recorded = Finished.of(self._follower), self._follower.recorded
            if self._report is not None and self._report[0] == known:
                return self._report[1]
            if recorded is None:
                return _answer(progress_page())
            results = recorded.results() if known.is_over else recorded.results_so_far()
        self._report = (known, _answer(live_report(results, known, self._options)))
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
    folder, port = Path(sys.argv[1]), int(sys.argv[2])
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
