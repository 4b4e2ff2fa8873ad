"""Publishers and subscriptions, and the topics of Gazebo itself: clock, model states and link states.

A publisher returns once a message is sent, so that every subscriber is awake by then.
"""

from __future__ import annotations

import select
import warnings
from collections import Counter
from collections.abc import Callable
from typing import Any, Final

import rospy
from gazebo_msgs.msg import LinkStates, ModelStates
from rosgraph_msgs.msg import Clock

from sim_action.core.geometry import Pose, Twist
from sim_action.ros.ros1.node.current_state import States
from sim_action.ros.ros1.node.messages import pose_message, time_of, twist_message

Traffic = Counter[str]
"""Topic -> number of messages sent or received since the clock started."""

GROUND: Final = "ground_plane"
"""Gazebo's name of the ground."""

_AT_REST: Final = Pose(), Twist()


class Publisher:
    """Publishes one type of message on one topic; without a subscriber, nothing is sent or counted."""

    def __init__(self, topic: str, kind: type[Any], traffic: Traffic) -> None:
        self._topic, self._traffic = topic, traffic
        self._publisher = _publisher(topic, kind)

    @property
    def subscriber_count(self) -> int:
        """The number of connected subscribers. rospy notices a closed connection only after two writes."""
        return sum(map(_is_there, tuple(self._publisher.impl.connections)))

    @property
    def has_subscribers(self) -> bool:
        """True if a node subscribes; otherwise the message need not be made."""
        return bool(self._publisher.get_num_connections())

    def send(self, message: Any) -> None:
        """Publish a message, and return once all subscribers have it."""
        if not self.has_subscribers:
            return
        self._traffic[self._topic] += 1
        self._publisher.publish(message)


def _is_there(connection: Any) -> bool:
    looking = select.poll()
    try:
        looking.register(connection.socket.fileno(), select.POLLRDHUP)
    except (AttributeError, OSError, TypeError, ValueError):
        # The connection is closed, or about to be.
        return False
    return not looking.poll(0)


def _publisher(topic: str, kind: type[Any]) -> rospy.Publisher:
    """Return a publisher without a queue.

    rospy warns about publishers without a queue, because a node that hangs holds them up. Lock-step waits for it in any
    case, and a queue is one more thread that takes each message over: twice the time.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        return rospy.Publisher(topic, kind, queue_size=None, tcp_nodelay=True)


class Subscription:
    """A subscription to a topic, which keeps the last message.

    Attributes:
        topic: its name.
        value: value of the last message; None: there was none.
        count: number of messages so far.
    """

    def __init__(self, topic: str, kind: type[Any], read: Callable[[Any], Any], traffic: Traffic) -> None:
        self.topic = topic
        self.value: Any = None
        self.count = 0
        self._is_latched = False
        self._read, self._traffic = read, traffic
        self._subscriber = rospy.Subscriber(topic, kind, self._hear, queue_size=1, tcp_nodelay=True)

    def begin(self) -> None:
        """Drop a message from before the start, unless it is latched: a latched one arrives in any case."""
        if not self._is_latched:
            self.forget()

    def forget(self) -> None:
        """Drop the last message."""
        self.value = None

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()

    def _hear(self, message: Any) -> None:
        self.value = self._read(message)
        self.count += 1
        self._is_latched = message._connection_header.get("latching") == "1"  # noqa: SLF001 - documented by rospy
        self._traffic[self.topic] += 1


class GazeboTopics:
    """Publishes the topics of Gazebo, if a node subscribes."""

    def __init__(self, traffic: Traffic) -> None:
        self._clock = Publisher("/clock", Clock, traffic)
        self._models = Publisher("/gazebo/model_states", ModelStates, traffic)
        self._links = Publisher("/gazebo/link_states", LinkStates, traffic)

    @property
    def subscriber_count(self) -> int:
        """The number of nodes that subscribe to the clock."""
        return self._clock.subscriber_count

    @property
    def has_link_subscribers(self) -> bool:
        """True if a node subscribes to link states."""
        return self._links.has_subscribers

    def publish_time(self, seconds: float) -> None:
        """Publish the clock."""
        self._clock.send(Clock(time_of(seconds)))

    def publish_models(self, models: States) -> bool:
        """Publish the states of models; return True if a node subscribes."""
        if not self._models.has_subscribers:
            return False
        self._models.send(ModelStates(*_columns({GROUND: _AT_REST, **models})))
        return True

    def publish_links(self, links: States) -> bool:
        """Publish the states of links, by `model::link`; return True if a node subscribes."""
        if not self._links.has_subscribers:
            return False
        self._links.send(LinkStates(*_columns({f"{GROUND}::link": _AT_REST, **links})))
        return True


def _columns(states: States) -> tuple[list[str], list[object], list[object]]:
    poses, twists = zip(*states.values(), strict=True)
    return list(states), list(map(pose_message, poses)), list(map(twist_message, twists))
