"""`rospy.wait_for_message` in lock-step, for nodes: they wake as the message comes, and not at the next look.

rospy's own looks every 10 ms of wall time whether a message has come. Sim time goes on meanwhile, as far as the machine
is quick: what a node sees then is not the same every time. Nothing of rospy is changed but this one function.

Python reads this as `sitecustomize` when it starts, in every process of a launch: it knows nothing of this package.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import os
import sys
import threading
import time
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

_LOOK = 0.1  # s of wall time: how soon it is seen that the node has to leave


def wait_for_message(topic: str, topic_type: Any, timeout: Any = None) -> Any:
    """The next message of a topic, as rospy's own gives it. Raises ROSException, ROSInterruptException."""
    import rospy

    come, messages = threading.Event(), []

    def hear(message: Any) -> None:
        messages.append(message)
        come.set()

    seconds = timeout.to_sec() if isinstance(timeout, rospy.Duration) else timeout
    end = None if seconds is None else time.time() + seconds
    subscriber = rospy.Subscriber(topic, topic_type, hear)
    try:
        while not messages and not rospy.is_shutdown():
            left = _LOOK if end is None else min(_LOOK, end - time.time())
            if left <= 0:
                raise rospy.ROSException(f"timeout exceeded while waiting for message on topic {topic}")
            come.wait(left)
    finally:
        subscriber.unregister()
    if not messages:
        raise rospy.ROSInterruptException("rospy shutdown")
    return messages[0]


class _Finder(importlib.abc.MetaPathFinder):
    """Finds rospy's module where it is, and puts the function into it once it is read."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != "rospy.client":
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            read = spec.loader.exec_module

            def read_and_replace(module: ModuleType) -> None:
                read(module)
                vars(module)["wait_for_message"] = wait_for_message

            vars(spec.loader)["exec_module"] = read_and_replace
        return spec


def _read_next() -> None:
    """The `sitecustomize` that this one stands before, if there is one."""
    here = os.path.dirname(__file__)  # noqa: PTH120 - to import pathlib takes 10 ms of each start
    spec = PathFinder.find_spec("sitecustomize", [path for path in sys.path if path != here])
    if spec is not None and spec.loader is not None:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


if __name__ == "sitecustomize":
    sys.meta_path.insert(0, _Finder())
    _read_next()
