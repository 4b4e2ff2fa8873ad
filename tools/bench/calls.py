"""Counts the calls of functions in a block, or of a command line in this process. It imports nothing of ours itself."""

from __future__ import annotations

import importlib
import itertools
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def counted_calls() -> Iterator[Iterator[int]]:
    """Count the calls, of Python and of C, in the block; the next number is theirs."""
    calls = itertools.count()

    def on_event(_frame: FrameType, event: str, _argument: object) -> None:
        if event in ("call", "c_call"):
            next(calls)

    sys.setprofile(on_event)
    try:
        yield calls
    finally:
        sys.setprofile(None)


def command() -> None:
    """Run the command line of this process; its modules of ours and its calls are a last line."""
    with counted_calls() as calls:
        importlib.import_module("sim_action.cli.main").call(sys.argv[1:])
    print(f"\n{sum(name.startswith('sim_action') for name in sys.modules)} {next(calls)}")
