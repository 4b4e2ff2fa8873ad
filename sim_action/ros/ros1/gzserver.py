"""What the overlay's `gzserver` runs: makes rospy known to this interpreter, then serves."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import NoReturn

from sim_action.core.process import collect_garbage_rarely
from sim_action.ros.ros1.exchange import FOLDER_VARIABLE, PROCESS_FILE, REQUEST_FILE, Request, new_run


def main() -> NoReturn:
    """The entry of a fresh interpreter."""
    collect_garbage_rarely()
    # Before any thread is there, an engine's too: whichever does not block them may be given them (node.leaving).
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    folder = Path(os.environ[FOLDER_VARIABLE])
    request = Request.model_validate_json((folder / REQUEST_FILE).read_bytes())
    run = new_run(folder)
    (run / PROCESS_FILE).write_text(str(os.getpid()))
    # Behind what is ours: the distribution's other packages are for another Python.
    sys.path.append(request.modules)
    from sim_action.ros.ros1.node.gzserver import serve

    serve(run, request)
    sys.stdout.flush()
    sys.stderr.flush()
    # roslaunch waits. To take the interpreter apart takes a while, and threads of rospy's still run in it.
    os._exit(0)


if __name__ == "__main__":
    main()
