"""The entry point of `sim-action` and of `python -m sim_action`."""

from __future__ import annotations

from typing import NoReturn

from sim_action.core.process import hold_signals


def main() -> NoReturn:
    """Run the command line of this process and exit; signals wait until the command can handle them."""
    hold_signals()
    # It takes most of the time until the command begins.
    from sim_action.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
