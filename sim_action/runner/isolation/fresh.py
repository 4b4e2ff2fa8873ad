"""The scenario's own process, where the way is the portable one: an interpreter that has done nothing else.

The job comes on standard input, which stays open as long as the caller is there; progress goes to standard output.
"""

from __future__ import annotations

import os
import threading
import traceback
from contextlib import suppress
from typing import NoReturn

from sim_action.runner.worker import leave, received_job, run_job, turn_to


def main() -> NoReturn:
    """The entry."""
    try:
        caller, progress = os.dup(0), os.dup(1)
        job = received_job()
        turn_to(job)
        # Not before standard input is another: on Windows, whoever asks anything of a pipe that is read has to wait.
        threading.Thread(target=_end_with, args=(caller,), daemon=True).start()
        run_job(job, progress)
        leave()
    except BaseException:  # noqa: BLE001 - threads that the user's code has left would hold up the end
        traceback.print_exc()
    finally:
        os._exit(1)


def _end_with(caller: int) -> None:
    """A caller that is killed outright cannot end its children."""
    with suppress(OSError):
        os.read(caller, 1)
        os._exit(1)


if __name__ == "__main__":
    main()
