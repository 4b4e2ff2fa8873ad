"""The child process of one scenario: its start, its progress and its end.

There are two implementations. `linux_child` isolates better and is used on Linux. `portable_child` needs only the
standard library; its docstring lists its limits.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_action.runner.isolation.child_process import ChildProcess


def child_type_here() -> type[ChildProcess]:
    """Return the type of child processes for this system; no other code chooses."""
    if sys.platform == "linux":
        from sim_action.runner.isolation.linux_child import LinuxChild  # it imports this module

        return LinuxChild
    from sim_action.runner.isolation.portable_child import PortableChild  # it imports this module

    return PortableChild
