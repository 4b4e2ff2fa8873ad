"""The programs of the overlay's packages. Each makes rospy importable in this interpreter and then runs code of `node`.

    python -m sim_action.ros.ros1.launch.programs gzserver|MODULE:FUNCTION [ARGUMENT ...]

Every program imports only what it needs: a launch waits for each of them.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def gzserver() -> int:
    """Run the simulation as the node `gazebo`. Does not return: the process ends when the launch is over."""
    import signal  # the rest of the module runs without it

    from sim_action.core.process import collect_garbage_rarely  # the rest of the module runs without it

    collect_garbage_rarely()
    # Before any thread starts, also of numpy and engines: a thread that does not block the signals may receive them.
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    # the rest of the module runs without it
    from sim_action.ros.ros1.launch_request import (
        FOLDER_VARIABLE,
        PROCESS_FILE,
        REQUEST_FILE,
        SimulationRequest,
        new_run_folder,
    )

    folder = Path(os.environ[FOLDER_VARIABLE])
    request = SimulationRequest.model_validate_json((folder / REQUEST_FILE).read_bytes())
    run = new_run_folder(folder)
    (run / PROCESS_FILE).write_text(str(os.getpid()))
    # At the end: the other packages of the distribution are for another Python.
    sys.path.append(request.modules)
    from sim_action.ros.ros1.node.gzserver import serve  # the rest of the module runs without it

    serve(run, request)
    sys.stdout.flush()
    sys.stderr.flush()
    # roslaunch waits. Taking the interpreter apart takes a while, and threads of rospy still run in it.
    os._exit(0)


def node_program(name: str) -> int:
    """Run a program of `node`, such as "stand_ins:relay", and return its exit code."""
    request = Path(os.environ["SIM_ACTION_ROS_RUN"]) / "request.json"
    sys.path.append(json.loads(request.read_bytes())["modules"])
    module, _, function = name.partition(":")
    program: Callable[[], int] = getattr(import_module(f"sim_action.ros.ros1.node.{module}"), function)
    return program()


if __name__ == "__main__":
    # The arguments of the program follow its name.
    called = sys.argv.pop(1)
    sys.exit(gzserver() if called == "gzserver" else node_program(called))
