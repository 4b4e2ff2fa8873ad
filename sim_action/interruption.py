"""Ctrl-C, and the SIGTERM of a cancelled workflow: noticed between two steps of a run, and never within one."""

from __future__ import annotations

import os
import signal
from types import FrameType
from typing import Self


class Interruption:
    """While it is entered, both signals are only noted, and wake whoever waits for `descriptor`.

    An exception out of a signal handler could come between the birth of a child and its being known, or in the midst
    of a report.
    """

    def __init__(self) -> None:
        self.happened = False
        self.descriptor, self._written_to = os.pipe()
        os.set_blocking(self._written_to, False)

    def __enter__(self) -> Self:
        self._wakeup = signal.set_wakeup_fd(self._written_to)
        self._handlers = {number: signal.signal(number, self._notice) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup)
        os.close(self.descriptor)
        os.close(self._written_to)

    def _notice(self, _number: int, _frame: FrameType | None) -> None:
        self.happened = True
