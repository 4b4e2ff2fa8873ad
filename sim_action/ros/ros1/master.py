"""The ROS 1 master: its nodes, their processes, and their publishers and subscribers.

It is asked in XML-RPC, by ROS's Master and Slave API (wiki.ros.org/ROS/Master_API, wiki.ros.org/ROS/Slave_API).
"""

from __future__ import annotations

import xmlrpc.client
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from sim_action.core.files import content_or_empty
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.ros.ros1.launch.ros_patches import MISFITS

_MAX_MISFIT_BYTES: Final = 10_000
_SUCCESS: Final = 1
# ROS's own node. It stamps and writes the log when others have something to say; no node gets anything from it because
# of the clock.
LOG_NODE: Final = "/rosout"
_INBOUND: Final = "i"
_TIMEOUT_S: Final = 10.0  # a busy machine delays answers; a process that has ended refuses the connection at once


@dataclass(frozen=True, slots=True)
class Graph:
    """The nodes that are up: topic -> nodes that publish and subscribe, node -> process, and the master's process."""

    publishers: Mapping[str, frozenset[str]]
    subscribers: Mapping[str, frozenset[str]]
    pids: Mapping[str, int]
    master: int


@dataclass(frozen=True, slots=True)
class Misfit:
    """A subscriber that a publisher refused, because their types of a topic differ."""

    subscriber: str
    topic: str
    type: str
    publisher: str
    published_type: str


class _Transport(xmlrpc.client.Transport):
    """A transport that gives up on a node that does not answer."""

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = _TIMEOUT_S
        return connection


def _server(uri: str) -> Any:
    return xmlrpc.client.ServerProxy(uri, transport=_Transport())


class Master:
    """A running master; `caller`: the name of the node that asks; `logs`: folder in which nodes leave files."""

    def __init__(self, uri: str, caller: str, logs: Path | None = None) -> None:
        self.caller, self._logs = caller, logs
        self._master = _server(uri)
        self._pids: dict[str, tuple[str, int]] = {}
        self._master_pid = 0

    def close(self) -> None:
        """Close the connection."""
        self._master("close")()

    def graph(self) -> Graph:
        """Return the current graph of nodes. Raises OSError if the master does not answer."""
        publishers, subscribers, services = self._ask("getSystemState")
        names = {name for group in (publishers, subscribers, services) for _, nodes in group for name in nodes}
        pids = {name: pid for name in sorted(names) if (pid := self._pid(name)) is not None}
        if not self._master_pid:
            self._master_pid = self._ask("getPid")
        return Graph(_by_topic(publishers, pids), _by_topic(subscribers, pids), pids, self._master_pid)

    def first_unconnected(self, graph: Graph) -> tuple[str, str] | None:
        """Return a node and a topic of which it is not connected to all publishers that fit; None if there is none."""
        refused = Counter((misfit.subscriber, misfit.topic) for misfit in self._misfits(graph))
        for node in graph.pids:
            heard = Counter(self._heard(node))
            for topic, nodes in graph.subscribers.items():
                if node in nodes and heard[topic] + refused[node, topic] < len(graph.publishers.get(topic, ())):
                    return node, topic
        return None

    def misfit_notes(self) -> list[str]:
        """Return a note on each subscriber that a publisher refused. Raises OSError if the master does not answer."""
        return sorted(map(self._misfit_note, self._misfits(self.graph())))

    def _misfit_note(self, misfit: Misfit) -> str:
        subscribes = f"{self._shown(misfit.subscriber)} subscribes to {misfit.topic} as {misfit.type}"
        other = misfit.published_type if misfit.published_type != misfit.type else "another definition of it"
        return escaped_line(f"{subscribes}, but {self._shown(misfit.publisher)} publishes {other}")

    def _shown(self, node: str) -> str:
        return "the robot" if node == self.caller else f"the node '{node.removeprefix('/')}'"

    def _misfits(self, graph: Graph) -> set[Misfit]:
        """Return the refused subscribers among the nodes that are up."""
        misfits = set[Misfit]()
        for path in (self._logs / MISFITS).glob("*-*[0-9]") if self._logs else ():
            # A file that cannot be read has no lines.
            text = content_or_empty(path, _MAX_MISFIT_BYTES).decode(errors="replace") + "\n" * 4
            misfit = Misfit(*text.split("\n")[:5])
            pid = graph.pids.get(misfit.publisher, 0)
            if path.name.startswith(f"{pid}-") and misfit.subscriber in graph.subscribers.get(misfit.topic, ()):
                misfits.add(misfit)
        return misfits

    def published(self, kind: str) -> dict[str, frozenset[str]]:
        """Return topic -> publishing nodes, for one message type. Raises OSError if the master does not answer."""
        types = dict(self._ask("getTopicTypes"))
        publishers = self.graph().publishers
        return {topic: nodes for topic, nodes in publishers.items() if nodes and types.get(topic) == kind}

    def _heard(self, node: str) -> Iterator[str]:
        """Yield the topic of each incoming connection of a node."""
        with suppress(OSError, xmlrpc.client.Error, LookupError):
            with _server(self._pids[node][0]) as server:
                _, _, connections = server.getBusInfo(self.caller)
            for _, _, direction, _, topic, connected, *_ in connections:
                if direction == _INBOUND and connected:
                    yield str(topic)

    def _pid(self, node: str) -> int | None:
        with suppress(OSError, xmlrpc.client.Error, LookupError):
            uri = self._ask("lookupNode", node)
            if self._pids.get(node, ("", 0))[0] != uri:
                with _server(uri) as server:
                    _, _, pid = server.getPid(self.caller)
                self._pids[node] = (uri, int(pid))
            return self._pids[node][1] if Path("/proc", str(self._pids[node][1])).exists() else None
        return None

    def _ask(self, method: str, *arguments: object) -> Any:
        try:
            code, message, value = getattr(self._master, method)(self.caller, *arguments)
        except (OSError, xmlrpc.client.Error) as error:
            raise OSError(f"the master does not answer: {error}") from None
        if code != _SUCCESS:
            raise LookupError(message)
        return value


def _by_topic(pairs: list[list[Any]], alive: Collection[str]) -> dict[str, frozenset[str]]:
    return {topic: frozenset(nodes).intersection(alive) for topic, nodes in pairs}
