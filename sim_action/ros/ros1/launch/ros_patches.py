"""What ROS's own processes do as soon as there is something to do, and not some time of the wall clock later.

Sim time goes on while all of them sleep, as far as the machine is quick: what a node sees then is not the same every
time. Three things are replaced, and nothing else of ROS:

- `rospy.wait_for_message` looks every 10 ms of wall time whether a message has come. Here it wakes with the message.
- The master tells those who listen to a topic of somebody new who publishes it, by threads that look every 100 ms of
  wall time whether there is somebody to be told. Here they wake with what is to be told.
- TCP may hold a small message back until the one before it was acknowledged, up to 40 ms of wall time (RFC 896, RFC
  1122 in 4.2.3.2), unless who listens wants no delay. Here everybody wants none.

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


def _awaiting(pool: type[Any]) -> type[Any]:
    """The master's pool of threads, which wait until there is a task that one of them may take."""

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
    # Asked of who publishes, in whatever language; and done by who publishes in ours, whatever is asked.
    listener.get_header_fields = lambda self: {**fields(self), "tcp_nodelay": "1"}
    connections["_configure_pub_socket"] = lambda socket, _: configure(socket, True)


def _replace_pool(threadpool: dict[str, Any]) -> None:
    threadpool["MarkedThreadPool"] = _awaiting(threadpool["MarkedThreadPool"])


# Module of ROS -> what puts into its names what is replaced.
_REPLACED = {
    "rospy.client": _replace_waiting,
    "rospy.impl.tcpros_pubsub": _replace_delays,
    "rosmaster.threadpool": _replace_pool,
}


class _Finder(importlib.abc.MetaPathFinder):
    """Finds ROS's modules where they are, and puts into them what is replaced once they are read."""

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
    """The `sitecustomize` that this one stands before, if there is one."""
    here = os.path.dirname(__file__)  # noqa: PTH120 - to import pathlib takes 10 ms of each start
    spec = PathFinder.find_spec("sitecustomize", [path for path in sys.path if path != here])
    if spec is not None and spec.loader is not None:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


if __name__ == "sitecustomize":
    sys.meta_path.insert(0, _Finder())
    _read_next()
