"""Quality of service (QoS) of topics, and the ends of topics that cannot connect.

ros_gz_bridge publishes and subscribes reliably, with a queue of 10. Reliable publishers connect to all subscribers,
best-effort ones included.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, Literal, Protocol

from sim_action.core.records import dataclass

Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]


@dataclass(frozen=True, slots=True)
class Qos:
    """The quality of service of a publisher or a subscription; `depth`: messages in its queue."""

    reliability: Reliability = "reliable"
    durability: Durability = "volatile"
    depth: int = 10

    def as_dict(self) -> dict[str, str | int]:
        """Return the policies by name."""
        return {"reliability": self.reliability, "durability": self.durability, "depth": self.depth}


USUAL: Final = Qos()
LATCHED: Final = Qos(durability="transient_local", depth=1)
"""Nodes that subscribe later get the last message, too."""

TRANSFORMS: Final = Qos(depth=100)
"""The quality that listeners of tf2 ask for."""


_RECEIVE_BUFFER: Final = Path("/proc/sys/net/core/rmem_max")
# As in fast_dds.xml.
_ASKED_BYTES: Final = 4_194_304


def large_message_problem(topic: str, size: int, limit: Path = _RECEIVE_BUFFER) -> str | None:
    """Return why messages of a size in bytes may get lost: the system buffers less; `limit`: the file that says so."""
    try:
        most = min(int(limit.read_text(encoding="ascii")), _ASKED_BYTES)
    except (OSError, ValueError):
        return None
    if size <= most:
        return None
    fix = "make the messages smaller"
    if most < _ASKED_BYTES:
        fix += f", or run: sudo sysctl -w net.core.rmem_max={_ASKED_BYTES}"
    return f"messages on {topic} have {size:,} bytes, and may get lost, because Linux buffers {most:,}; {fix}"


class TopicEnd(Protocol):
    """A node that publishes a topic or subscribes to it, as the graph of ROS has it."""

    @property
    def node(self) -> str:
        """The full name of the node."""

    @property
    def type(self) -> str:
        """The type of the topic, such as "nav_msgs/msg/Odometry"."""

    @property
    def reliability(self) -> str:
        """The reliability policy; see Reliability."""

    @property
    def durability(self) -> str:
        """The durability policy; see Durability."""

    @property
    def demands(self) -> Sequence[str]:
        """Further policies that it asks for, such as "a deadline"; for a publisher, those that it offers."""


def subscriber_problems(topic: str, kind: str, offered: Qos, subscribers: Sequence[TopicEnd]) -> Iterator[str]:
    """Yield subscribers that get no message of a topic, because their type or their QoS differs."""
    for end in subscribers:
        if end.type != kind:
            yield f"'{end.node}' subscribes to {topic} as {end.type}, but the robot publishes {kind}"
        elif end.durability == "transient_local" and offered.durability == "volatile":
            yield (
                f"'{end.node}' subscribes to {topic} with the durability transient_local, but the robot publishes it "
                "with volatile, so that they do not connect; subscribe with volatile"
            )
        elif end.reliability == "reliable" and offered.reliability == "best_effort":
            yield (
                f"'{end.node}' subscribes to {topic} with the reliability reliable, but the robot publishes it with "
                "best_effort, so that they do not connect; subscribe with best_effort"
            )
        elif end.demands:
            yield (
                f"'{end.node}' subscribes to {topic} with {' and '.join(end.demands)}, which the robot does not offer, "
                "so that they do not connect; subscribe without"
            )
