"""A child process for one scenario: how it is born, listened to, and ended.

There are two ways. `linux` is the better one, and is taken where it is to be had; `portable` needs no more than the
standard library has on every system. What it cannot do stands in its docstring.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_action.runner.isolation.child_process import ChildProcess


def child_type_here() -> type[ChildProcess]:
    """The way of this system: the one place that chooses."""
    if sys.platform == "linux":
        from sim_action.runner.isolation.linux_child import LinuxChild

        return LinuxChild
    from sim_action.runner.isolation.portable_child import PortableChild

    return PortableChild
