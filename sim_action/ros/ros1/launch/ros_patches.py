"""Patches of ROS that replace polling by the wall clock: processes of a launch act as soon as they can.

Sim time goes on while all processes sleep. A process that polls by the wall clock then acts at another sim time in
every run. Three parts of ROS are replaced for that:

- `rospy.wait_for_message` polls every 10 ms of wall time for a message. The patch wakes up with the message.
- The master notifies subscribers of a new publisher by threads that poll every 100 ms of wall time. The patch wakes
  them up with each notification.
- TCP may hold a small message back until the one before it is acknowledged, up to 40 ms of wall time (RFC 896, RFC
  1122 in 4.2.3.2), unless the subscriber asks for no delay. The patch asks for no delay everywhere.

rosunit writes a skipped test method as one that passed. The patch writes it as skipped.

Python imports this file as `sitecustomize` at start, in every process of a launch. It imports nothing of this package.
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

_POLL_S = 0.1  # of wall time, for the check whether the node has to leave


def wait_for_message(topic: str, topic_type: Any, timeout: Any = None) -> Any:
    """Return the next message of a topic, as rospy does. Raises ROSException, ROSInterruptException."""
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
            left = _POLL_S if end is None else min(_POLL_S, end - time.time())
            if left <= 0:
                raise rospy.ROSException(f"timeout exceeded while waiting for message on topic {topic}")
            come.wait(left)
    finally:
        subscriber.unregister()
    if not messages:
        raise rospy.ROSInterruptException("rospy shutdown")
    return messages[0]


def _awaiting(pool: type[Any]) -> type[Any]:
    """Return the master's thread pool with threads that wait for a task they may take."""

    class Pool(pool):  # type: ignore[misc]  # ROS has no types
        def __init__(self, threads: int) -> None:
            self._changed = threading.Condition()
            super().__init__(threads)

        def queue_task(self, *task: Any) -> Any:
            with self._changed:
                self._changed.notify_all()
                return super().queue_task(*task)

        def remove_marker(self, marker: Any) -> None:
            with self._changed:
                self._changed.notify_all()
                super().remove_marker(marker)

        def get_next_task(self) -> Any:
            with self._changed:
                while (task := super().get_next_task())[1] is None:
                    self._changed.wait()
                return task

    return Pool


def _replace_waiting(client: dict[str, Any]) -> None:
    client["wait_for_message"] = wait_for_message


def _replace_delays(connections: dict[str, Any]) -> None:
    configure, listener = connections["_configure_pub_socket"], connections["TCPROSSub"]
    fields = listener.get_header_fields
    # Subscribers ask every publisher for it, in any language; our Python publishers always do it.
    listener.get_header_fields = lambda self: {**fields(self), "tcp_nodelay": "1"}
    connections["_configure_pub_socket"] = lambda socket, _: configure(socket, True)


def _replace_pool(threadpool: dict[str, Any]) -> None:
    threadpool["MarkedThreadPool"] = _awaiting(threadpool["MarkedThreadPool"])


def _replace_results(runner: dict[str, Any]) -> None:
    result, write = runner["_XMLTestResult"], runner["_TestInfo"].xml
    add, stop = result.addSkip, result.stopTest

    def add_skip(self: Any, test: Any, reason: str) -> None:
        add(self, test, reason)
        # A class that is skipped as a whole is no test.
        if hasattr(test, "_testMethodName"):
            self.reason_to_skip = reason

    def stop_test(self: Any, test: Any) -> None:
        stop(self, test)
        self._tests[-1].reason_to_skip = vars(self).pop("reason_to_skip", None)

    def xml(self: Any) -> Any:
        case, reason = write(self), vars(self).get("reason_to_skip")
        if reason is not None:
            runner["ET"].SubElement(case, "skipped").text = str(reason)
        return case

    result.addSkip, result.stopTest, runner["_TestInfo"].xml = add_skip, stop_test, xml


# Module of ROS -> function that patches its namespace.
_REPLACED = {
    "rospy.client": _replace_waiting,
    "rospy.impl.tcpros_pubsub": _replace_delays,
    "rosunit.xmlrunner": _replace_results,
    "rosmaster.threadpool": _replace_pool,
}


class _Finder(importlib.abc.MetaPathFinder):
    """Finds the modules of ROS, and patches them after they are loaded."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in _REPLACED:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            read = spec.loader.exec_module

            def read_and_replace(module: ModuleType) -> None:
                read(module)
                _REPLACED[fullname](vars(module))

            vars(spec.loader)["exec_module"] = read_and_replace
        return spec


def _read_next() -> None:
    """Run the `sitecustomize` that this one hides, if there is one."""
    here = os.path.dirname(__file__)  # noqa: PTH120 - to import pathlib takes 10 ms of each start
    spec = PathFinder.find_spec("sitecustomize", [path for path in sys.path if path != here])
    if spec is not None and spec.loader is not None:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


if __name__ == "sitecustomize":
    sys.meta_path.insert(0, _Finder())
    _read_next()
