"""Commands that nodes send: subscriptions, and the twists and joint targets that follow from their messages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

from sim_action.commands.controller_answers import twist_problem
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, replace
from sim_action.ros.ros2.messages import Message, twist_of
from sim_action.ros.ros2.quality import USUAL, Qos, TopicEnd
from sim_action.state.command import Answer, JointTargets
from sim_action.state.observation import Observation

TWIST: Final = "geometry_msgs/msg/Twist"
STAMPED_TWIST: Final = "geometry_msgs/msg/TwistStamped"


class BadMessage(Exception):
    """A message that cannot be a command; the text is the end of a sentence "a node sent ...: "."""


class Receiver(Protocol):
    """Takes the messages of a topic, and returns the commands that follow from them."""

    def take(self, message: Mapping[str, Any], seen: Observation) -> None:
        """Take a message at a moment. Raises BadMessage."""

    def answer(self, seen: Observation) -> Twist | JointTargets | None:
        """Return the command of a moment; None: as before."""


@dataclass(frozen=True, slots=True)
class Subscription:
    """A subscription to commands.

    Attributes:
        key: its key in `topics:`.
        type: the type of its messages; see `matched`.
        alternatives: other types that it can have.
        open: returns a receiver for a run.
    """

    key: str
    topic: str
    type: str
    open: Callable[[], Receiver]
    alternatives: tuple[str, ...] = ()
    qos: Qos = USUAL

    @property
    def types(self) -> tuple[str, ...]:
        """All types that it can have."""
        return (self.type, *self.alternatives)

    def matched(self, publishers: Sequence[TopicEnd]) -> Subscription:
        """Return this subscription with the type and the reliability of its publishers, before any message arrives.

        Without a publisher it stays as it is. Raises ScriptError if several nodes publish the topic, or no type fits.
        """
        nodes = sorted({end.node for end in publishers})
        if len(nodes) > 1:
            raise ScriptError(
                f"{len(nodes)} nodes publish {self.topic}, which commands the robot: {', '.join(nodes)}; let one node "
                "choose between them, or give the others other topics"
            )
        types = sorted({end.type for end in publishers})
        if len(types) > 1:
            raise ScriptError(f"'{nodes[0]}' publishes {self.topic} with several types: {', '.join(types)}")
        if types and types[0] not in self.types:
            raise ScriptError(
                f"'{nodes[0]}' publishes {self.topic} as {types[0]}, but the robot takes {' or '.join(self.types)}; "
                f"to leave this topic to others, give the robot another one with topics: {{{self.key}: ...}}"
            )
        is_reliable = all(end.reliability == "reliable" for end in publishers)
        qos = self.qos if is_reliable else replace(self.qos, reliability="best_effort")
        return replace(self, qos=qos) if not types else self._with_type(types[0], qos)

    def _with_type(self, kind: str, qos: Qos) -> Subscription:
        others = tuple(other for other in self.types if other != kind)
        return replace(self, type=kind, alternatives=others, qos=qos)


class ReceivedCommands:
    """The commands of all subscriptions during a run."""

    def __init__(self, subscriptions: Iterable[Subscription]) -> None:
        """Open a receiver for each subscription."""
        self._receivers = {each.topic: each.open() for each in subscriptions}

    def take(self, topic: str, message: Message, node: str, seen: Observation) -> None:
        """Take a message that a node sent. Raises ScriptError."""
        try:
            self._receivers[topic].take(message, seen)
        except BadMessage as problem:
            raise ScriptError(f"'{node}' sent a bad command on {topic}: {problem}") from None

    def answer(self, seen: Observation) -> Answer:
        """Return the commands of a moment."""
        twist: Twist | None = None
        targets: JointTargets | None = None
        for receiver in self._receivers.values():
            command = receiver.answer(seen)
            if isinstance(command, Twist):
                twist = command
            elif command is not None:
                targets = targets.updated_by(command) if targets else command
        if twist is not None and targets is not None:
            return twist, targets
        return targets if twist is None else twist


class TwistReceiver:
    """Keeps the last twist."""

    def __init__(self) -> None:
        self._twist: Twist | None = None

    def take(self, message: Mapping[str, Any], seen: Observation) -> None:
        """See Receiver.take."""
        twist = twist_of(message)
        if problem := twist_problem(twist):
            raise BadMessage(problem)
        self._twist = twist

    def answer(self, seen: Observation) -> Twist | None:
        """See Receiver.answer."""
        return self._twist


def twist_subscription(key: str, topic: str) -> Subscription:
    """Return the subscription to twists of the base."""
    return Subscription(key, topic, TWIST, TwistReceiver, (STAMPED_TWIST,))
