"""The graph of nodes and topics: who publishes what, with which quality of service (QoS), and what does not connect.

ros_gz_bridge publishes and subscribes reliably, with a queue of 10. Reliable publishers connect to all subscribers,
best-effort ones included.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

from sim_action.core.records import dataclass

Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]

# Each node may have both ends of these, and tools listen to them; they carry no data between nodes.
OF_ALL_NODES: Final = frozenset({"/clock", "/parameter_events", "/rosout"})


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
LATCHED: Final = Qos(durability="transient_local", depth=1)  # nodes that subscribe later get the last message, too
TRANSFORMS: Final = Qos(depth=100)  # the quality that listeners of tf2 ask for
_RECEIVE_BUFFER: Final = Path("/proc/sys/net/core/rmem_max")
_ASKED_BYTES: Final = 4_194_304  # as in fast_dds.xml


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


@dataclass(frozen=True, slots=True)
class TopicEnd:
    """A node that publishes or subscribes to a topic, and how."""

    node: str
    type: str
    reliability: str
    durability: str
    demands: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Graph:
    """The nodes that are up, without the bridge, by full names; the ends only of topics that were asked for."""

    nodes: tuple[str, ...]
    types: Mapping[str, Sequence[str]]
    publishers: Mapping[str, Sequence[TopicEnd]]
    subscriptions: Mapping[str, Sequence[TopicEnd]]


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


def order_notes(graph: Graph) -> Iterator[str]:
    """Yield a note for each topic that several nodes hear at once, if what they then send meets in one node."""
    hearers = {topic: _nodes(ends) for topic, ends in graph.subscriptions.items() if topic not in OF_ALL_NODES}
    senders = {topic: _nodes(ends) for topic, ends in graph.publishers.items() if topic not in OF_ALL_NODES}
    # Node -> the other nodes that send to it.
    heard_from: dict[str, frozenset[str]] = {}
    for topic, nodes in hearers.items():
        for node in nodes:
            heard_from[node] = heard_from.get(node, frozenset()) | (senders.get(topic, frozenset()) - {node})
    for topic, nodes in sorted(hearers.items()):
        for node, sources in sorted(heard_from.items()):
            meeting = sorted((sources | {node}) & nodes)
            if len(meeting) > 1:
                who = " and ".join(map(repr, meeting))
                yield (
                    f"the order of messages in the node '{node}' is not fixed: {who} hear {topic} at the same time, "
                    "and what they send meets there; --repeat shows whether the order matters"
                )
                break


def _nodes(ends: Sequence[TopicEnd]) -> frozenset[str]:
    return frozenset(end.node for end in ends)


def unheard(graph: Graph, published: frozenset[str]) -> Iterator[str]:
    """Yield a sentence for each topic that nodes subscribe to and neither a node nor the robot publishes."""
    for topic, ends in sorted(graph.subscriptions.items()):
        if ends and not graph.publishers[topic] and topic not in published:
            nodes = sorted({end.node for end in ends})
            who, verb = " and ".join(f"'{node}'" for node in nodes), "waits" if len(nodes) == 1 else "wait"
            yield f"{who} {verb} for {topic}, which nothing publishes"
