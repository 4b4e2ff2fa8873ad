"""The wait for nodes at the start: sim time begins when all of them are up and know each other.

A node whose publishers are known may still not spin, so each must answer a question. At t = 0, no node has lost a
message because another one was not connected yet.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from typing import Final

from sim_action.ros.ros2.bridge_link import Bridge, Endpoint, Graph, TopicEnd
from sim_action.ros.ros2.lockstep import clock_of
from sim_action.ros.ros2.node_group import Node
from sim_action.ros.ros2.quality import subscriber_problems

_USE_SIM_TIME: Final = "use_sim_time"
_POLL_S: Final = 0.01
# The wall time of one question, during which ended processes go unnoticed.
_ASK_S: Final = 0.2
# The wall time without a change after which all participants know each other: some announcements of each.
_CALM_S: Final = 0.1


class Readiness:
    """The wait for all nodes.

    Attributes:
        losses: reasons why another run may differ.
    """

    def __init__(
        self, bridge: Bridge, nodes: Sequence[Node], refuse_ended: Callable[[], None], start_within: float
    ) -> None:
        """Prepare the wait.

        :param refuse_ended: raises the error of a node that has failed.
        :param start_within: s of wall time that nodes may take.
        """
        self._bridge, self._nodes, self._refuse_ended = bridge, nodes, refuse_ended
        self._start_within = start_within
        self._deadline = time.monotonic() + start_within
        self._clocks = {clock_of(node.number): node for node in nodes}
        self.losses: list[str] = []

    def await_clocks(self) -> None:
        """Wait until each process listens to its clock, or is late. Raise ScriptError, BridgeEnded."""
        while True:
            self._refuse_ended()
            graph = self._bridge.graph(self._clocks)
            deaf = [node for topic, node in self._clocks.items() if not graph.subscriptions[topic]]
            deaf = [node for node in deaf if node.process.exit_code() is None]
            if not deaf:
                return
            if time.monotonic() > self._deadline:
                within = f"within {self._start_within:g} s of wall time"
                self.losses += [
                    f"the node '{node.process.label}' did not subscribe to its clock {within}" for node in deaf
                ]
                return
            time.sleep(_POLL_S)

    def await_answers(self) -> None:
        """Wait until each node answers, or is late. Raise ScriptError, BridgeEnded."""
        values: dict[str, bool | None] = {}
        while left := [name for name in self._bridge.graph(()).nodes if name not in values]:
            self._refuse_ended()
            values |= self._bridge.parameters(left, _USE_SIM_TIME, _ASK_S)
            if time.monotonic() > self._deadline:
                silent = (name for name in left if name not in values)
                self.losses += [
                    f"the node '{name}' did not answer {name}/get_parameters; does it spin?" for name in silent
                ]
                break
        on_wall_time = (name for name, value in values.items() if value is False)
        self.losses += [f"the node '{name}' has set use_sim_time to false" for name in on_wall_time]

    def await_connections(self, watched: Collection[str]) -> None:
        """Wait until the bridge is connected to all nodes, and the graph has not changed for a while.

        `watched`: topics besides those of the bridge that may not change. Ends that cannot connect, because their type
        or their QoS differs, are not waited for. Raise ScriptError, BridgeEnded.
        """
        before: Graph | None = None
        calm_since = time.monotonic()
        while time.monotonic() < calm_since + _CALM_S:
            self._refuse_ended()
            ends = (*self._bridge.published, *self._bridge.heard)
            graph = self._bridge.graph({*watched, *(end.topic for end in ends)})
            missing = self._missing_connections(graph)
            if missing and time.monotonic() > self._deadline:
                within = f"within {self._start_within:g} s of wall time"
                self.losses += [f"{node} was not connected to the robot on {topic} {within}" for topic, node in missing]
                return
            if missing or graph != before:
                before, calm_since = graph, time.monotonic()
            time.sleep(_POLL_S)

    def _missing_connections(self, graph: Graph) -> list[tuple[str, str]]:
        """Return the topics on which not all ends that can connect have done so, each with the nodes in question."""
        publishers, subscriptions = self._bridge.matched()
        ours = zip(self._bridge.published, publishers, strict=True)
        theirs = zip(self._bridge.heard, subscriptions, strict=True)
        sides = [(own.topic, count, _fitting(own, graph.subscriptions[own.topic])) for own, count in ours]
        sides += [(own.topic, count, graph.publishers[own.topic]) for own, count in theirs]
        return [(topic, _one_of(ends)) for topic, count, ends in sides if count < len(ends)]


def _fitting(offered: Endpoint, ends: Sequence[TopicEnd]) -> Sequence[TopicEnd]:
    return [end for end in ends if not any(subscriber_problems(offered.topic, offered.type, offered.qos, [end]))]


def _one_of(ends: Sequence[TopicEnd]) -> str:
    names = sorted({repr(end.node) for end in ends})
    return f"the node {names[0]}" if len(names) == 1 else f"one of the nodes {' and '.join(names)}"
