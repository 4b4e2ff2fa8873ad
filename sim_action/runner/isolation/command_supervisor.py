"""A program that runs a command line, and ends all of its descendants when it ends.

Usage: `python -m sim_action.runner.isolation.command_supervisor WORDS`.

SIGTERM, or the end of its parent process, ends everything at once. It exits with the exit code of the command.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

from sim_action.runner.isolation import process_control

assert sys.platform == "linux"

_NOT_STARTED = 127


def main() -> NoReturn:
    """Run the program in a fresh interpreter."""
    process_control.become_subreaper(os.getppid())
    supervisor = os.getpid()
    command = os.fork()
    if command == 0:
        # Become the command; never return.
        words = sys.argv[1:]
        try:
            os.setpgid(0, 0)
            process_control.end_with_parent(supervisor, signal.SIGKILL)
            # The supervisor ignores Ctrl-C; the command does not.
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, process_control.AWAITED_SIGNALS)
            os.execvp(words[0], words)  # noqa: S606 - the caller's own command
        except OSError as error:
            os.write(2, f"{words[0]}: {error.strerror}\n".encode())
        finally:
            os._exit(_NOT_STARTED)
    status = process_control.wait_for_child(command)
    process_control.end_descendants(command)
    process_control.exit_as(status)


if __name__ == "__main__":
    main()
