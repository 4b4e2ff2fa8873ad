"""The programs of the package controller_manager: `spawner`, `unspawner` and `controller_manager`."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

import rospy
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)

# Wall time that the services may take to appear.
_TIMEOUT_S: Final = 30.0
_STRICT: Final = SwitchControllerRequest.STRICT

_ACTIONS: Final[Mapping[str, _Action]] = {
    "load": lambda manager, names: len(manager.load(names)) == len(names),
    "unload": lambda manager, names: manager.unload(names),
    "start": lambda manager, names: manager.switch(names, []),
    "stop": lambda manager, names: manager.switch([], names),
    "spawn": lambda manager, names: manager.switch(manager.load(names), []),
    "kill": lambda manager, names: manager.switch([], names) and manager.unload(names),
}


class _Manager:
    """The services of one controller manager, in a namespace as rospy resolves it."""

    def __init__(self, space: str, timeout: float) -> None:
        self._space = f"{space.rstrip('/')}/controller_manager" if space else "controller_manager"
        self._timeout = timeout

    def ask(self, name: str, kind: type[Any], *arguments: Any) -> Any:
        """Call a service. Raises rospy.ROSException, rospy.ServiceException."""
        service = f"{self._space}/{name}"
        rospy.wait_for_service(service, self._timeout)
        return rospy.ServiceProxy(service, kind)(*arguments)

    def load(self, names: Sequence[str]) -> list[str]:
        """Load controllers, and return the names of the loaded ones."""
        return [name for name in names if _report(self.ask("load_controller", LoadController, name).ok, "loaded", name)]

    def unload(self, names: Sequence[str]) -> bool:
        """Unload controllers; return True if all were unloaded."""
        return all(self.ask("unload_controller", UnloadController, name).ok for name in names)

    def switch(self, started: Sequence[str], stopped: Sequence[str]) -> bool:
        """Start and stop controllers; return True on success."""
        return bool(self.ask("switch_controller", SwitchController, started, stopped, _STRICT, False, 0.0).ok)


def _report(done: bool, what: str, name: str) -> bool:
    sys.stderr.write(f"{name}: {what}\n" if done else f"ERROR: {name} could not be {what}\n")
    return done


def spawner() -> int:
    """Run controllers until asked to leave, as a node only then: the clock waits for others. Return the exit code."""
    parser = argparse.ArgumentParser("spawner", allow_abbrev=False)
    parser.add_argument("controllers", nargs="+")
    parser.add_argument("--stopped", action="store_true")
    parser.add_argument("--namespace", default="")
    parser.add_argument("--timeout", type=float)
    for ignored in ("--wait-for", "--shutdown-timeout"):
        parser.add_argument(ignored)
    parser.add_argument("--no-timeout", action="store_true")
    asked = parser.parse_args(rospy.myargv()[1:])
    manager = _Manager(asked.namespace, _TIMEOUT_S if asked.timeout is None else asked.timeout)
    try:
        loaded = manager.load(asked.controllers)
        if loaded and not asked.stopped:
            _report(manager.switch(loaded, []), "started", ", ".join(loaded))
    except (rospy.ROSException, rospy.ServiceException) as error:
        sys.stderr.write(f"ERROR: the controllers were not spawned: {error}\n")
        return 1
    rospy.init_node("spawner", anonymous=True)
    rospy.spin()
    # Stop and unload controllers, if the simulation still answers: it is asked to leave at the same time.
    started = [] if asked.stopped else loaded
    signal.alarm(2)
    with suppress(rospy.ROSException, rospy.ServiceException, OSError):
        manager.switch([], started)
        manager.unload(loaded)
    return 0 if len(loaded) == len(asked.controllers) else 1


def unspawner() -> int:
    """Stop controllers as long as the program runs. Return the exit code."""
    parser = argparse.ArgumentParser("unspawner", allow_abbrev=False)
    parser.add_argument("controllers", nargs="+")
    asked = parser.parse_args(rospy.myargv()[1:])
    manager = _Manager("", _TIMEOUT_S)
    try:
        done = _report(manager.switch([], asked.controllers), "stopped", ", ".join(asked.controllers))
    except (rospy.ROSException, rospy.ServiceException) as error:
        sys.stderr.write(f"ERROR: the controllers were not stopped: {error}\n")
        return 1
    rospy.init_node("unspawner", anonymous=True)
    rospy.spin()
    return 0 if done else 1


def controller_manager() -> int:
    """Do one action. Return the exit code."""
    parser = argparse.ArgumentParser("controller_manager", allow_abbrev=False)
    parser.add_argument("action", choices=("list", "list-types", *_ACTIONS))
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args(rospy.myargv()[1:])
    manager = _Manager("", _TIMEOUT_S)
    try:
        if asked.action.startswith("list"):
            _print_list(manager, asked.action)
            return 0
        return 0 if _report(_ACTIONS[asked.action](manager, asked.names), f"{asked.action}ed", str(asked.names)) else 1
    except (rospy.ROSException, rospy.ServiceException) as error:
        sys.stderr.write(f"ERROR: {error}\n")
        return 1


def _print_list(manager: _Manager, action: str) -> None:
    if action == "list-types":
        sys.stdout.write("\n".join(manager.ask("list_controller_types", ListControllerTypes).types) + "\n")
        return
    for controller in manager.ask("list_controllers", ListControllers).controller:
        claimed = ", ".join(resource.hardware_interface for resource in controller.claimed_resources)
        sys.stdout.write(f"{controller.name} - {claimed} ( {controller.state} )\n")


_Action = Callable[[_Manager, Sequence[str]], bool]
