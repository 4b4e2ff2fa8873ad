"""The launcher: roslaunch in the distribution's Python, with events of its nodes as lines of JSON.

It imports nothing of this package, and runs on the Python of ROS, which may be an old one.
"""

from __future__ import annotations

import functools
import json
import os
import sys
from pathlib import Path
from typing import Any

import roslaunch
import roslaunch.config
import roslaunch.core
import roslaunch.parent
import roslaunch.pmon

# The times that a node may take to leave after SIGINT, and after SIGTERM.
_SIGINT_TIMEOUT_S, _SIGTERM_TIMEOUT_S = 2.0, 0.5


def _write(file: Any, event: str, **more: Any) -> None:
    """Write an event, from any thread: at the end of a file, each write is done as a whole."""
    file.write(json.dumps({"event": event, **more}).encode() + b"\n")


class _Listener(roslaunch.pmon.ProcessListener):  # type: ignore[misc]  # roslaunch has no types
    def __init__(self, monitor: Any, tell: Any) -> None:
        self._monitor, self._tell = monitor, tell

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Write the event of an ended process. A node that respawns is reported until it runs again."""
        process = self._monitor.get_process(process_name)
        self._tell(
            "died",
            node=process_name.rpartition("-")[0] or process_name,
            pid=process.pid,
            exit_code=exit_code,
            program=process.args[0],
            required=process.required,
        )


def _config(task: dict[str, Any], tell: Any) -> Any:
    """Return the launch configuration, without the nodes of Gazebo, and with sim time."""
    config = roslaunch.config.load_config_default([(task["file"], task["arguments"])], task["port"], verbose=False)
    left_out = [node for node in config.nodes if node.package in task["left_out"]]
    config.nodes = [node for node in config.nodes if node not in left_out]
    for node in config.nodes:
        node.output = "screen"
    for key, value in task["defaults"].items():
        if key not in config.params:
            config.add_param(roslaunch.core.Param(key, value), verbose=False)
    for key, value in task["params"].items():
        config.add_param(roslaunch.core.Param(key, value), verbose=False)
    for node in left_out:
        tell("left out", program=f"{node.package}/{node.type}", args=[node.args or ""])
    world = config.params.get("/gazebo/world_name")
    tell(
        "read",
        world=str(world.value) if world else "",
        # Controllers have a parameter NAME/type.
        types=[f"{key.split('/')[-2]}={param.value}" for key, param in config.params.items() if key.endswith("/type")],
    )
    return config


def _launched(task: dict[str, Any], tell: Any) -> Any:
    """Start all processes and return their launch parent."""
    run_id = roslaunch.core.generate_run_id()
    roslaunch.configure_logging(run_id)
    limits = {"sigint_timeout": _SIGINT_TIMEOUT_S, "sigterm_timeout": _SIGTERM_TIMEOUT_S}
    parent = roslaunch.parent.ROSLaunchParent(run_id, [], port=task["port"], show_summary=False, **limits)
    parent.config = _config(task, tell)
    parent._start_infrastructure()  # noqa: SLF001 - start() does the same, and does not report nodes that died early
    parent.pm.add_process_listener(_Listener(parent.pm, tell))
    parent._init_runner()  # noqa: SLF001 - likewise
    _, failed = parent.runner.launch()
    if failed:
        raise roslaunch.core.RLException(f"cannot launch {', '.join(failed)}")
    tell("started", pid=os.getpid(), core=[process.pid for process in parent.pm.core_procs])
    return parent


def main(path: str) -> int:
    """Launch, and return the exit code: 1 if nothing was launched."""
    task = json.loads(Path(path).read_text(encoding="utf-8"))
    tell = functools.partial(_write, Path(task["events"]).open("ab", buffering=0))  # noqa: SIM115 - as long as this process is there
    try:
        parent = _launched(task, tell)
    except Exception as error:  # noqa: BLE001 - the simulation reports any of them
        tell("refused", kind=type(error).__name__, message=str(error))
        roslaunch.pmon.pmon_shutdown()
        return 1
    parent.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
