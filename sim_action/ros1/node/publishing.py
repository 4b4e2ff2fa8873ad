"""Publishers that have sent a message once they return, so that who waits for it is awake."""

from __future__ import annotations

import warnings
from typing import Any

import rospy


def publisher(topic: str, kind: type[Any], *, latch: bool = False) -> rospy.Publisher:
    """Of messages of a kind.

    rospy warns of publishers that have no queue, since a node that hangs holds them up. In lock-step it does so anyway,
    and a queue is a thread that takes each message over: twice the time.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        return rospy.Publisher(topic, kind, queue_size=None, latch=latch, tcp_nodelay=True)
