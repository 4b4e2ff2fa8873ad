"""Publishers and subscriptions, and the topics of Gazebo itself: clock, model states and link states.

Messages to nodes are delivered one by one, each to one node, because two nodes that work at the same time may send to
a third one in any order. A delivery returns once the message is sent, so that the node is awake by then. Nodes that act
by the wall clock are noticed: they send while sim time stands still, or call time.sleep again and again.
"""

from __future__ import annotations

import os
import select
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from io import BytesIO
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import rospy
from gazebo_msgs.msg import LinkStates, ModelStates
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from rospy.msg import serialize_message
from tf2_msgs.msg import TFMessage

from sim_action.core.geometry import Pose, Twist
from sim_action.robot.documents.xml_document import shown_file
from sim_action.ros.messages import clock_message, odometry_message, transforms_message
from sim_action.ros.ros1.launch.ros_patches import SLEEPERS
from sim_action.ros.ros1.lockstep import Lockstep
from sim_action.ros.ros1.master import LOG_NODE, Master
from sim_action.ros.ros1.node.message_classes import filled, pose_message, twist_message
from sim_action.ros.ros1.node.world_models import States
from sim_action.state.trace import Transcript

GROUND: Final = "ground_plane"  # Gazebo's name of the ground
_AT_REST: Final = Pose(), Twist()


class Traffic:
    """The messages between simulation and nodes; what nodes send between two `deliveries` may arrive in any order."""

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self.deliveries = 0
        self._posted: list[tuple[Any, Any]] = []
        self._heard: list[tuple[int, str, str, bytes]] = []
        self._stands_still = False

    def begin(self) -> None:
        """Forget all that was heard and counted before the clock started."""
        self.counts.clear()
        self._heard.clear()

    def post(self, topic: Any, message: Any) -> None:
        """Have a message delivered later; `topic`: implementation of a publisher of rospy."""
        self._posted.append((topic, message))

    def undelivered(self) -> Iterator[Callable[[], None]]:
        """Yield the deliveries of all posted messages, in the order of posting and then of the names of nodes."""
        posted, self._posted = self._posted, []
        ourselves = rospy.get_name()
        for topic, message in posted:
            buffer = BytesIO()
            topic.seq += 1
            serialize_message(buffer, topic.seq, message)
            data = buffer.getvalue()
            connections = sorted(topic.connections, key=attrgetter("endpoint_id"))
            for connection in connections:
                if connection.endpoint_id in (ourselves, LOG_NODE):
                    _write(connection, data)
            for connection in connections:
                if connection.endpoint_id not in (ourselves, LOG_NODE):
                    yield partial(self._deliver, connection, data)

    def hear(self, topic: str, node: str, message: Any) -> None:
        """Note a message from a node."""
        buffer = BytesIO()
        message.serialize(buffer)
        self.counts[topic] += 1
        self._heard.append((self.deliveries, topic, node, buffer.getvalue()))

    def move_to(self, transcript: Transcript, seconds: float) -> None:
        """Add the messages that were heard since the last call to a transcript, in an order that does not vary."""
        heard, self._heard = self._heard, []
        self._stands_still = True
        for _, topic, node, message in sorted(heard, key=lambda entry: entry[:3]):
            transcript.add(seconds, f"{topic} {node}", message)

    def unasked(self) -> frozenset[str]:
        """Return the nodes that sent a message after `move_to`, although nothing was delivered to any node."""
        nodes = frozenset(node for _, _, node, _ in self._heard) if self._stands_still else frozenset[str]()
        self._stands_still = False
        return nodes

    def _deliver(self, connection: Any, data: bytes) -> None:
        self.deliveries += 1
        _write(connection, data)


def _write(connection: Any, data: bytes) -> None:
    """Write to one subscriber, as rospy's `publish` does to all of them."""
    try:
        connection.write_data(data)
    except Exception:  # noqa: BLE001 - rospy raises exceptions of any type when the other side has left
        connection.close()


class Publisher:
    """Publishes one type of message on one topic; without a subscriber, nothing is sent or counted."""

    def __init__(self, topic: str, kind: type[Any], traffic: Traffic) -> None:
        self.topic, self._traffic, self._kind = topic, traffic, kind
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            self._publisher = rospy.Publisher(topic, kind, queue_size=None, tcp_nodelay=True)

    @property
    def connections(self) -> frozenset[object]:
        """The connections to subscribers. rospy notices a closed connection only after two writes."""
        return frozenset(filter(_is_there, tuple(self._publisher.impl.connections)))

    @property
    def has_subscribers(self) -> bool:
        """True if a node subscribes; otherwise the message need not be made."""
        return bool(self._publisher.get_num_connections())

    def send(self, message: Any) -> None:
        """Have a message delivered, which may be plain data."""
        if self.has_subscribers:
            self._traffic.counts[self.topic] += 1
            self._traffic.post(
                self._publisher.impl, filled(self._kind, message) if isinstance(message, dict) else message
            )


def _is_there(connection: Any) -> bool:
    looking = select.poll()
    try:
        looking.register(connection.socket.fileno(), select.POLLRDHUP)
    except (AttributeError, OSError, TypeError, ValueError):
        # The connection is closed, or about to be.
        return False
    return not looking.poll(0)


class OdometryPublisher:
    """Publishes odometry as a message, and as a frame if wanted; `frames`: of the pose, and of the twist."""

    def __init__(
        self,
        topic: str,
        frames: tuple[str, str],
        traffic: Traffic,
        *,
        covariances: Sequence[Sequence[float]] = (),
        publishes_tf: bool = True,
    ) -> None:
        self._frames, self._covariances = frames, covariances
        self._messages = Publisher(topic, Odometry, traffic)
        self._tf = Publisher("/tf", TFMessage, traffic) if publishes_tf else None
        self.publishers = (self._messages, self._tf) if self._tf else (self._messages,)

    def send(self, seconds: float, pose: Pose, twist: Twist) -> None:
        """Have a pose and a twist delivered, if a node subscribes."""
        if any(publisher.has_subscribers for publisher in self.publishers):
            self._messages.send(odometry_message(seconds, self._frames, pose, twist, self._covariances))
            if self._tf is not None:
                self._tf.send(transforms_message(seconds, [(*self._frames, pose)]))


class Subscription:
    """A subscription; of messages between two deliveries, the one of the node whose name sorts last is kept."""

    def __init__(self, topic: str, kind: type[Any], read: Callable[[Any], Any], traffic: Traffic) -> None:
        self.topic = topic
        self.value: Any = None
        self.count = 0
        self._is_latched = False
        self._newest = (0, "")
        self._lock = threading.Lock()
        self._read, self._traffic = read, traffic
        self._subscriber = rospy.Subscriber(topic, kind, self._hear, tcp_nodelay=True)

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
        header = message._connection_header  # noqa: SLF001 - documented by rospy
        value, node = self._read(message), header["callerid"]
        self._traffic.hear(self.topic, node, message)
        place = self._traffic.deliveries, node
        with self._lock:
            self.count += 1
            if place >= self._newest:
                self._newest, self.value = place, value
                self._is_latched = header.get("latching") == "1"


class GazeboTopics:
    """Publishes the topics of Gazebo, if a node subscribes."""

    def __init__(self, traffic: Traffic) -> None:
        self._clock = Publisher("/clock", Clock, traffic)
        self._models = Publisher(rospy.resolve_name("~model_states"), ModelStates, traffic)
        self._links = Publisher(rospy.resolve_name("~link_states"), LinkStates, traffic)

    @property
    def has_link_subscribers(self) -> bool:
        """True if a node subscribes to link states."""
        return self._links.has_subscribers

    def lockstep(self, launcher: int, **more: Any) -> Lockstep:
        """Return the lock-step of the nodes that hear the clock; see Lockstep."""
        master = Master(os.environ["ROS_MASTER_URI"], rospy.get_name(), Path(os.environ["ROS_LOG_DIR"]))
        return Lockstep(master, launcher, rospy.is_shutdown, lambda: self._clock.connections, **more)

    def publish_time(self, seconds: float) -> None:
        """Publish the clock."""
        self._clock.send(clock_message(seconds))

    def publish_models(self, models: States) -> None:
        """Publish the states of models, if a node subscribes."""
        if self._models.has_subscribers:
            self._models.send(ModelStates(*_columns({GROUND: _AT_REST, **models})))

    def publish_links(self, links: States) -> None:
        """Publish the states of links, by `model::link`, if a node subscribes."""
        if self._links.has_subscribers:
            self._links.send(LinkStates(*_columns({f"{GROUND}::link": _AT_REST, **links})))


def _columns(states: States) -> tuple[list[str], list[object], list[object]]:
    poses, twists = zip(*states.values(), strict=True)
    return list(states), list(map(pose_message, poses)), list(map(twist_message, twists))


class WallClockWatch:
    """Reports such nodes to the lock-step. The patches of ROS write a file for each process that sleeps."""

    def __init__(self, traffic: Traffic, lockstep: Lockstep) -> None:
        self._traffic, self._lockstep = traffic, lockstep
        self._folder = Path(os.environ["ROS_LOG_DIR"], SLEEPERS)
        # The files from earlier simulations of this launch.
        self._reported_names = self._noted()

    def look(self) -> None:
        """Report new ones. Call it at the begin of a tick, before anything is published."""
        for node in sorted(self._traffic.unasked()):
            self._lockstep.suspect(node, "it sent a command while the clock stood still")
        for name in sorted(self._noted() - self._reported_names):
            self._reported_names.add(name)
            self._report(self._folder / name)

    def _noted(self) -> set[str]:
        """Return the names of the files of processes."""
        try:
            names = os.listdir(self._folder)  # noqa: PTH208 - read at each tick
        except OSError:
            return set()
        # The simulation itself sleeps while it waits for nodes.
        return {name for name in names if name.isdigit() and name != str(os.getpid())}

    def _report(self, path: Path) -> None:
        node, file, line = path.read_text(encoding="utf-8").splitlines()
        place = shown_file(Path(file).resolve())
        self._lockstep.suspect(node, f"it calls time.sleep again and again at {place}:{line}, instead of rospy.sleep")
