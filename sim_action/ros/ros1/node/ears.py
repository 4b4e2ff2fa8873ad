"""What nodes tell the robot: of each topic the last message, which stands until another one comes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy

from sim_action.ros.ros1.node.publishing import Traffic


class Ear:
    """Listens to a topic.

    Attributes:
        topic: its name.
        heard: what was made of the last message; None: there was none.
        count: of messages so far.
    """

    def __init__(self, topic: str, kind: type[Any], read: Callable[[Any], Any], traffic: Traffic) -> None:
        self.topic = topic
        self.heard: Any = None
        self.count = 0
        self._is_latched = False
        self._read, self._traffic = read, traffic
        self._subscriber = rospy.Subscriber(topic, kind, self._hear, queue_size=1, tcp_nodelay=True)

    def begin(self) -> None:
        """Forgets what was said; what is latched is heard in any case, whenever one begins to listen."""
        if not self._is_latched:
            self.forget()

    def forget(self) -> None:
        """As if nothing had been said."""
        self.heard = None

    def close(self) -> None:
        """Listens no more."""
        self._subscriber.unregister()

    def _hear(self, message: Any) -> None:
        self.heard = self._read(message)
        self.count += 1
        self._is_latched = message._connection_header.get("latching") == "1"  # noqa: SLF001 - so say rospy's documents
        self._traffic[self.topic] += 1
