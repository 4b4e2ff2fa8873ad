"""Installs what rostest needs, as Debian and Ubuntu call it, unless it is there; for the action's input `ros1`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.process import program_on_path
from sim_action.ros.ros1.installation import PACKAGES, find_ros

_TITLE: Final = "::error title=sim-action::"
_NOT_HERE: Final = "ROS 1 cannot be installed here; ros1 needs a runner that is Ubuntu, or Debian 12"


def main() -> None:
    """Exits with 2 if it cannot be had."""
    if os.environ["INPUT_ROS1"] != "true":
        sys.exit(_complaint("the input ros1 must be true or false"))
    if _is_here():
        return
    for words in (("update",), ("install", "--no-install-recommends", *PACKAGES)):
        try:
            code = subprocess.run([*_apt(), *words], check=False).returncode
        except OSError:
            code = 1
        if code:
            sys.exit(_complaint(_NOT_HERE))


def _apt() -> list[str]:
    """Return the beginning of a command line of apt-get. Raise FileNotFoundError if a program is missing."""
    # In a container, the user may be root and have no sudo.
    rights = () if hasattr(os, "geteuid") and os.geteuid() == 0 else ("sudo",)
    programs = [program_on_path(name, Path.cwd()) for name in (*rights, "env", "apt-get")]
    if None in programs:
        raise FileNotFoundError("a program is missing")
    *before, apt = map(str, programs)
    return [*before, "DEBIAN_FRONTEND=noninteractive", apt, "--quiet", "--yes"]


def _is_here() -> bool:
    try:
        find_ros()
    except UsageError:
        return False
    return True


def _complaint(message: str) -> int:
    print(f"{_TITLE}{message}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    main()
