"""Work that is counted, so that no test has to look at a clock."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any


def work_of(step: Callable[[], object]) -> int:
    """How many instructions of Python's machine a step takes, and how many functions of C it calls."""
    work = 0

    def on_instruction(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal work
        frame.f_trace_opcodes = True
        work += event == "opcode"
        return on_instruction

    def on_call(frame: FrameType, event: str, argument: object) -> None:
        nonlocal work
        work += event == "c_call"

    trace, profile = sys.gettrace(), sys.getprofile()
    sys.settrace(on_instruction)
    sys.setprofile(on_call)
    try:
        step()
    finally:
        sys.setprofile(profile)
        sys.settrace(trace)
    return work
