"""Settings of this process: how it handles signals that end it, and how often it collects garbage."""

from __future__ import annotations

import gc
import signal
from types import FrameType
from typing import Final, Self

# On Windows, a cancelled workflow sends Ctrl-C, then Ctrl-Break.
_SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if name in signal.Signals.__members__
)


class Interruption:
    """A context in which Ctrl-C, and the SIGTERM of a cancelled workflow, only set a flag and wake a waiting `select`.

    An exception raised by a signal handler could come after a child process has started and before it is known, or in
    the middle of a report.

    Attributes:
        happened: True after the first signal.
        awakened: becomes readable at a signal; a socket, because Windows cannot wait for anything else together with
            sockets.
    """

    def __init__(self) -> None:
        # Commands that only print do not need it.
        import socket

        self.happened = False
        self.awakened, self._written_to = socket.socketpair()
        self._written_to.setblocking(False)

    def __enter__(self) -> Self:
        self._wakeup = signal.set_wakeup_fd(self._written_to.fileno())
        self._handlers = {number: signal.signal(number, self._notice) for number in _SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup)
        self.awakened.close()
        self._written_to.close()

    def _notice(self, _number: int, _frame: FrameType | None) -> None:
        self.happened = True


# Python's own default is 700 (2,000 from 3.13 on).
_GC_THRESHOLD: Final = 500_000


def collect_garbage_rarely() -> None:
    """Let the garbage collector run less often in this process and its forks.

    Imported modules stay alive: collecting them again and again takes a tenth of a short call. Not for processes that
    run user code.
    """
    gc.set_threshold(_GC_THRESHOLD)
