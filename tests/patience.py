"""How long tests wait for what must happen, so that a busy machine decides nothing."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

PATIENCE: Final = 600  # s; the longest wait. Whatever takes so long hangs.


def wait_until(holds: Callable[[], object]) -> None:
    """Wait until a condition holds; fail if it does not."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)
