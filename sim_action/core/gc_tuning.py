"""How often a process of ours looks for garbage: objects that hold each other, and nobody else does.

What is imported stays. To look through it time and again, as Python does from 700 new objects on, takes a tenth of a
short call.
"""

from __future__ import annotations

import gc
from typing import Final

_NEW_OBJECTS: Final = 500_000


def look_rarely() -> None:
    """From now on in this process, and in its forks; for those that run no code of the user's."""
    gc.set_threshold(_NEW_OBJECTS)
