"""Work that is counted, so that no test has to look at a clock."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any


def work_of(step: Callable[[], object]) -> int:
    """How many instructions of Python's machine a step takes; what it leaves to C counts as one."""
    work = 0

    def on_instruction(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal work
        frame.f_trace_opcodes = True
        work += event == "opcode"
        return on_instruction

    before = sys.gettrace()
    sys.settrace(on_instruction)
    try:
        step()
    finally:
        sys.settrace(before)
    return work
