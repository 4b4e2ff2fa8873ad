"""Ctrl-C, and the SIGTERM of a cancelled workflow: noticed between two steps of a run, and never within one."""

from __future__ import annotations

import signal
import socket
from types import FrameType
from typing import Final, Self

# On Windows, a cancelled workflow sends Ctrl-C, then Ctrl-Break.
_SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if name in signal.Signals.__members__
)


class Interruption:
    """While it is entered, these signals are only noted, and wake whoever waits for `awakened`.

    An exception out of a signal handler could come between the birth of a child and its being known, or in the midst
    of a report. It is a socket since Windows can wait for nothing else beside others.
    """

    def __init__(self) -> None:
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
