"""Publishers that have sent a message once they return, so that who waits for it is awake."""

from __future__ import annotations

import select
import warnings
from collections import Counter
from typing import Any

import rospy

Traffic = Counter[str]
"""Topic -> messages that were sent on it, or heard, since the clock started."""


class Sender:
    """Messages of one kind on one topic; what nobody listens to is neither sent nor counted."""

    def __init__(self, topic: str, kind: type[Any], traffic: Traffic) -> None:
        self._topic, self._traffic = topic, traffic
        self._publisher = _publisher(topic, kind)

    @property
    def listeners(self) -> int:
        """How many nodes listen; one that has hung up does not, though rospy finds out only by writing to it twice."""
        return sum(map(_is_there, tuple(self._publisher.impl.connections)))

    @property
    def is_heard(self) -> bool:
        """Whether a node listens: else a message need not be made."""
        return bool(self._publisher.get_num_connections())

    def send(self, message: Any) -> None:
        """Returns when all who listen have it."""
        if not self.is_heard:
            return
        self._traffic[self._topic] += 1
        self._publisher.publish(message)


def _is_there(connection: Any) -> bool:
    looking = select.poll()
    try:
        looking.register(connection.socket.fileno(), select.POLLRDHUP)
    except (AttributeError, OSError, TypeError, ValueError):
        # It is closed, or about to be.
        return False
    return not looking.poll(0)


def _publisher(topic: str, kind: type[Any]) -> rospy.Publisher:
    """Of messages of a kind.

    rospy warns of publishers that have no queue, since a node that hangs holds them up. In lock-step it does so anyway,
    and a queue is a thread that takes each message over: twice the time.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        return rospy.Publisher(topic, kind, queue_size=None, tcp_nodelay=True)
