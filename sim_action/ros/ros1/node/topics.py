"""The topics on which Gazebo tells of the world, whatever plugins there are."""

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
"""Topic -> messages that were sent on it, or heard, since the clock started."""


class Publisher:
    """Messages of one kind on one topic; what nobody listens to is neither sent nor counted."""

    def __init__(self, topic: str, kind: type[Any], traffic: Traffic) -> None:
        self._topic, self._traffic = topic, traffic
        self._publisher = _publisher(topic, kind)

    @property
    def subscriber_count(self) -> int:
        """How many nodes listen; one that has hung up does not, though rospy finds out only by writing to it twice."""
        return sum(map(_is_there, tuple(self._publisher.impl.connections)))

    @property
    def has_subscribers(self) -> bool:
        """Whether a node listens: else a message need not be made."""
        return bool(self._publisher.get_num_connections())

    def send(self, message: Any) -> None:
        """Returns when all who listen have it."""
        if not self.has_subscribers:
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


class Subscription:
    """Listens to a topic.

    Attributes:
        topic: its name.
        heard: what was made of the last message; None: there was none.
        count: of messages so far.
    """

    def __init__(self, topic: str, kind: type[Any], read: Callable[[Any], Any], traffic: Traffic) -> None:
        self.topic = topic
        self.value: Any = None
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
        self.value = None

    def close(self) -> None:
        """Listens no more."""
        self._subscriber.unregister()

    def _hear(self, message: Any) -> None:
        self.value = self._read(message)
        self.count += 1
        self._is_latched = message._connection_header.get("latching") == "1"  # noqa: SLF001 - so say rospy's documents
        self._traffic[self.topic] += 1


GROUND: Final = "ground_plane"
"""What Gazebo calls the ground."""

_STILL: Final = Pose(), Twist()


class GazeboTopics:
    """Tells, if somebody listens."""

    def __init__(self, traffic: Traffic) -> None:
        self._clock = Publisher("/clock", Clock, traffic)
        self._models = Publisher("/gazebo/model_states", ModelStates, traffic)
        self._links = Publisher("/gazebo/link_states", LinkStates, traffic)

    @property
    def subscriber_count(self) -> int:
        """How many nodes are told the time."""
        return self._clock.subscriber_count

    @property
    def has_link_subscribers(self) -> bool:
        """Whether a node wants to know of links."""
        return self._links.has_subscribers

    def publish_time(self, seconds: float) -> None:
        """Publishes the clock."""
        self._clock.send(Clock(time_of(seconds)))

    def publish_models(self, models: States) -> bool:
        """Publishes where models are; returns whether somebody listens."""
        if not self._models.has_subscribers:
            return False
        self._models.send(ModelStates(*_columns({GROUND: _STILL, **models})))
        return True

    def publish_links(self, links: States) -> bool:
        """Publishes where links are, each called after its model and itself; returns whether somebody listens."""
        if not self._links.has_subscribers:
            return False
        self._links.send(LinkStates(*_columns({f"{GROUND}::link": _STILL, **links})))
        return True


def _columns(states: States) -> tuple[list[str], list[object], list[object]]:
    poses, twists = zip(*states.values(), strict=True)
    return list(states), list(map(pose_message, poses)), list(map(twist_message, twists))
