"""The link to the bridge, and the process at its other end.

The requests, by their key `op`:

- the first one: the name of its `node`; the answer has the RMW;
- `types`: the answer has the `names` whose packages are installed;
- `open`: creates more `publishers` and `subscriptions`, each with `topic`, `type`, `qos` and `least`: null, or a field
  and a number; messages with less are ignored;
- `matched`: the answer has the number of ends that each publisher and each subscription is connected to;
- `publish`: a `message` by the publisher with a `number`; it has no answer;
- `take`: the answer has all `messages` since the last one, each with the number of its subscription, and the number of
  ends of the first publishers, as many as it says in `clocks`;
- `graph`: nodes, types of topics, and the ends of `topics`;
- `parameters`: the value of a parameter `name` of `nodes`, as far as they answer `within` some s.
"""

from __future__ import annotations

import socket
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from sim_action.core.records import dataclass
from sim_action.ros.messages import Message
from sim_action.ros.ros2.bridge_frames import Frames
from sim_action.ros.ros2.graph import OF_ALL_NODES, USUAL, Graph, Qos, TopicEnd
from sim_action.ros.ros2.node_processes import NodeProcess, ProcessFolder

_BRIDGE: Final = Path(__file__).with_name("bridge.py")
_NAME: Final = "sim_action"
_MAX_ANSWER_S: Final = 60.0  # wall time for an answer: a loaded machine starts Python slowly


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A topic of the bridge; `least`: a field, and the least value of it in messages that are taken; None: all are."""

    topic: str
    type: str
    qos: Qos = USUAL
    least: tuple[str, int] | None = None


class BridgeEnded(Exception):
    """The bridge does not answer any more."""


class Bridge:
    """The bridge; `published`, `heard`: its publishers and subscriptions, in the order of their numbers."""

    def __init__(self, python: Path, folder: ProcessFolder) -> None:
        """Start the bridge, and return at once."""
        own, theirs = socket.socketpair()
        own.settimeout(_MAX_ANSWER_S)
        self._frames = Frames(own)
        with theirs:
            # With -O, the setters of messages do not check each element of a list.
            words = [str(python), "-O", str(_BRIDGE), str(theirs.fileno())]
            self.process: NodeProcess = folder.start("bridge", words, kept=(theirs.fileno(),), forwards=False)
        self._rmw = ""
        self.published: list[Endpoint] = []
        self.heard: list[Endpoint] = []
        self._send({"node": _NAME})

    def await_start(self) -> str:
        """Wait until it is up, and return the RMW. Raises BridgeEnded."""
        if not self._rmw:
            self._rmw = self._receive()["rmw"]
        return self._rmw

    def known_types(self, names: Iterable[str]) -> frozenset[str]:
        """Return the types whose packages are installed. Raises BridgeEnded."""
        return frozenset(self._ask(op="types", names=list(names))["types"])

    def matched(self) -> tuple[list[int], list[int]]:
        """Return the number of connected ends of each publisher, and of each subscription. Raises BridgeEnded."""
        answer = self._ask(op="matched")
        return answer["publishers"], answer["subscriptions"]

    def open(self, publishers: Sequence[Endpoint], subscriptions: Sequence[Endpoint]) -> int:
        """Create publishers and subscriptions, and return the number of the first publisher. Raises BridgeEnded."""
        self._ask(op="open", publishers=list(map(_plain, publishers)), subscriptions=list(map(_plain, subscriptions)))
        first = len(self.published)
        self.published += publishers
        self.heard += subscriptions
        return first

    def publish(self, number: int, message: Message) -> int:
        """Publish a message by the publisher with a number; return the bytes of its arrays. Raises BridgeEnded."""
        return self._send({"op": "publish", "number": number, "message": message})

    def take(self, clocks: Sequence[int]) -> tuple[list[tuple[int, Message]], list[int]]:
        """Return the messages since the last call, each with the number of its subscription. Raises BridgeEnded.

        The second list has the number of subscriptions of each of the publishers `clocks`.
        """
        answer = self._ask(op="take", clocks=list(clocks))
        return [(number, message) for number, message in answer["messages"]], answer["clocks"]

    def graph(self, topics: Iterable[str]) -> Graph:
        """Return the nodes that are up, with the ends of some topics. Raises BridgeEnded."""
        answer = self._ask(op="graph", topics=list(topics))
        own = f"/{_NAME}"
        ends = (
            {
                topic: [TopicEnd(**end) for end in topic_ends if end["node"] != own]
                for topic, topic_ends in answer[side].items()
            }
            for side in ("publishers", "subscriptions")
        )
        return Graph(tuple(name for name in answer["nodes"] if name != own), answer["types"], *ends)

    def whole_graph(self) -> Graph:
        """Return the nodes with the ends of all visible topics. Raises BridgeEnded."""
        topics = self.graph(()).types
        return self.graph(topic for topic in topics if topic not in OF_ALL_NODES and not topic.startswith("/_"))

    def parameters(self, nodes: Iterable[str], name: str, within: float) -> Mapping[str, bool | None]:
        """Return a parameter of each node that answers within some s of wall time. Raises BridgeEnded."""
        values: dict[str, bool | None] = self._ask(op="parameters", nodes=list(nodes), name=name, within=within)[
            "values"
        ]
        return values

    def close(self) -> None:
        """Close the socket, at which the bridge ends."""
        self._frames.socket.close()

    def _ask(self, **request: Any) -> Any:
        self._send(request)
        return self._receive()

    def _send(self, request: Mapping[str, Any]) -> int:
        try:
            return self._frames.send(request)
        except OSError as error:
            raise BridgeEnded(str(error)) from None

    def _receive(self) -> Any:
        try:
            return self._frames.receive()
        except TimeoutError:
            raise BridgeEnded(f"no answer within {_MAX_ANSWER_S:g} s of wall time") from None
        except EOFError:
            raise BridgeEnded("it ended") from None


def _plain(endpoint: Endpoint) -> dict[str, Any]:
    return {"topic": endpoint.topic, "type": endpoint.type, "qos": endpoint.qos.as_dict(), "least": endpoint.least}
