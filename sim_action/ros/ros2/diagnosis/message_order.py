"""Messages whose order lock-step does not fix: several nodes hear one topic, and what they then send meets again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sim_action.ros.ros2.bridge_link import Graph, TopicEnd

# Each node may have both ends of these; they carry no data between nodes.
_INTERNAL: Final = frozenset({"/clock", "/parameter_events", "/rosout"})


def order_notes(graph: Graph) -> Iterator[str]:
    """Yield a note for each topic that several nodes hear at once, if what they then send meets in one node.

    :param graph: the nodes, with the ends of all topics.
    """
    hearers = {topic: _nodes(ends) for topic, ends in graph.subscriptions.items() if topic not in _INTERNAL}
    senders = {topic: _nodes(ends) for topic, ends in graph.publishers.items() if topic not in _INTERNAL}
    heard_from = _heard_from(senders, hearers)
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


def _heard_from(
    senders: Mapping[str, frozenset[str]], hearers: Mapping[str, frozenset[str]]
) -> dict[str, frozenset[str]]:
    """Return node -> the other nodes that send to it."""
    found: dict[str, frozenset[str]] = {}
    for topic, nodes in hearers.items():
        for node in nodes:
            found[node] = found.get(node, frozenset()) | (senders.get(topic, frozenset()) - {node})
    return found
