"""The entry point of `sim-action` and of `python -m sim_action`."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

if __name__ == "__main__":
    try:
        folder = os.getcwd()  # noqa: PTH109 - quicker than pathlib
    except FileNotFoundError:
        folder = ""
    # `python -m` looks for modules in the current folder first, where a file of a stranger may be called `yaml.py`.
    if sys.path[0] in ("", folder):
        del sys.path[0]

from sim_action.core.process import collect_garbage_rarely, hold_signals


def main() -> NoReturn:
    """Run the command line of this process and exit; signals wait until the command can handle them."""
    hold_signals()
    collect_garbage_rarely()
    # It takes most of the time until the command begins.
    from sim_action.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
