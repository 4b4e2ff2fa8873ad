"""Where what a launch sees is written: in a folder whose path roslaunch can take."""

from __future__ import annotations

import os
import re
import tempfile
from typing import Final

from sim_action.core.errors import UsageError

# Where to go if TMPDIR cannot be had.
_TEMPORARY: Final = ("/tmp", "/var/tmp")  # noqa: S108 - a folder with a random name is made in it
_SPLIT: Final = re.compile(r"[\s'\"\\$]")


def scratch_parent() -> str:
    """A folder for folders of calls. Raises UsageError.

    roslaunch splits `$(find xacro)/xacro ...` at blanks once it has put the paths in.
    """
    for folder in (tempfile.gettempdir(), *_TEMPORARY):
        if not _SPLIT.search(os.path.realpath(folder)) and os.access(folder, os.W_OK | os.X_OK):
            return folder
    raise UsageError(
        f"'{tempfile.gettempdir()}' has a blank or a quote in its name, at which roslaunch splits commands; "
        "set TMPDIR to a folder without"
    )
