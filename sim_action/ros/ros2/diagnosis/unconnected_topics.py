"""Topics that connect to nothing: commands that no node sends, and messages that nodes wait for in vain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from sim_action.ros.ros2.bridge_link import Bridge, Graph
from sim_action.ros.ros2.received_commands import Subscription

# Each node has these; tools listen to them.
_OF_ALL_NODES: Final = frozenset({"/clock", "/parameter_events", "/rosout"})


def unheard(graph: Graph, published: frozenset[str]) -> Iterator[str]:
    """Yield a sentence for each topic that nodes subscribe to and nothing publishes.

    :param published: the topics that the robot publishes.
    """
    for topic, ends in sorted(graph.subscriptions.items()):
        if ends and not graph.publishers[topic] and topic not in published:
            nodes = sorted({end.node for end in ends})
            who, verb = " and ".join(f"'{node}'" for node in nodes), "waits" if len(nodes) == 1 else "wait"
            yield f"{who} {verb} for {topic}, which nothing publishes"


def whole_graph(bridge: Bridge) -> Graph:
    """Return the nodes with the ends of all visible topics. Raises BridgeEnded."""
    topics = bridge.graph(()).types
    return bridge.graph(topic for topic in topics if topic not in _OF_ALL_NODES and not topic.startswith("/_"))


def unsent(graph: Graph, subscriptions: Sequence[Subscription]) -> Iterator[str]:
    """Yield that no command arrived, and the topics of nodes that may have been meant."""
    yield f"no node sent a message on {' or '.join(each.topic for each in subscriptions)}"
    own = {each.topic for each in subscriptions}
    for subscription in subscriptions:
        others = [
            (topic, kind)
            for topic, ends in sorted(graph.publishers.items())
            for kind in subscription.types
            if topic not in own and any(end.type == kind for end in ends)
        ]
        if others:
            found = ", ".join(f"{topic} ({kind})" for topic, kind in others)
            yield f"nodes publish {found}; to use it, set topics: {{{subscription.key}: {others[0][0]}}}"
