"""The bridge: one participant in ROS 2, which publishes and takes messages that its parent describes as plain data.

It runs on the Python of ROS, which may be an old one, and imports only `bridge_frames`. `bridge_link` has the other end
of its socket, and describes the requests.
"""

from __future__ import annotations

import os
import socket
import sys
import time
from array import array
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import get_rmw_implementation_identifier

if __name__ == "__main__":
    # Only one module is imported, not the whole package with its dependencies.
    sys.modules["sim_action"] = ModuleType("sim_action")
    sys.modules["sim_action"].__path__ = [str(Path(__file__).resolve().parents[2])]

from sim_action.ros.ros2.bridge_frames import Frames

Json = dict[str, Any]
_POLL_S = 0.002
_INFINITE_NS = 2**63 - 1
# Message packages write the types of their fields like this: sequence<double>, double[36], geometry_msgs/Point.
_NUMBERS = {
    "float": "f", "double": "d", "int8": "b", "uint8": "B", "octet": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
_INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")


def _message_class(name: str) -> Any:
    """Return the class of a type such as "nav_msgs/msg/Odometry". Raises ImportError, AttributeError."""
    package, _, kind = name.partition("/")
    return getattr(import_module(f"{package}.msg"), kind.rpartition("/")[2])


_fillers: dict[str, list[tuple[str, Callable[[Any], Any]]]] = {}


def _fields_of(kind: Any) -> dict[str, str]:
    fields: dict[str, str] = kind.get_fields_and_field_types()
    return fields


def _filled(kind: Any, name: str, data: Json) -> Any:
    """Return a message with the fields of a dict; fields that it lacks keep their defaults."""
    if name not in _fillers:
        _fillers[name] = [(field, _filler(spelled)) for field, spelled in _fields_of(kind).items()]
    message = kind()
    for field, made in _fillers[name]:
        if field in data:
            setattr(message, field, made(data[field]))
    return message


def _filler(spelled: str) -> Callable[[Any], Any]:
    """Return a function that makes the value of a field of a type from plain data."""
    element, is_sequence, length = _parsed(spelled)
    if element in _NUMBERS and (is_sequence or length):
        code = _NUMBERS[element]
        if length:
            return lambda value: _numpy(_numbers(code, value))
        return lambda value: _numbers(code, value)
    one = _single(element)
    if is_sequence or length:
        return lambda value: [one(entry) for entry in value]
    return one


def _parsed(spelled: str) -> tuple[str, bool, int]:
    """Return the type of an element, whether there is a sequence of them, and the length of a fixed array or 0."""
    if spelled.startswith("sequence<"):
        return spelled[len("sequence<") : -1].partition(",")[0].strip(), True, 0
    if spelled.endswith("]"):
        element, _, length = spelled[:-1].partition("[")
        return element, False, int(length)
    return spelled, False, 0


def _single(element: str) -> Callable[[Any], Any]:
    if element in ("float", "double"):
        return float
    if element in _INTEGERS:
        return int
    if element == "boolean":
        return bool
    if element == "octet":
        return lambda value: bytes([value])
    if element.startswith(("string", "wstring")):
        return str
    kind = _message_class(element)
    return lambda value: _filled(kind, element, value)


def _numbers(code: str, value: Any) -> Any:
    """Return an array of numbers; the setters of messages take one of the right type without a look at each."""
    return value if isinstance(value, array) and value.typecode == code else array(code, value)


def _numpy(numbers: Any) -> Any:
    import numpy as np

    return np.frombuffer(numbers, dtype=numbers.typecode)


def _plain(value: Any) -> Any:
    """Return a message, or a value in one, as plain data."""
    if hasattr(value, "get_fields_and_field_types"):
        return {field: getattr(value, field) for field in _fields_of(value)}
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else list(value)
    return array(value.dtype.char, value.tobytes()) if hasattr(value, "dtype") else list(value)


class _Bridge:
    """The participant, its publishers and its subscriptions."""

    def __init__(self, request: Json) -> None:
        rclpy.init(args=[])
        self._node = Node(request["node"], start_parameter_services=False, enable_rosout=False)
        self._publishers: list[tuple[Any, Any, str]] = []
        self._subscriptions: list[Any] = []
        self._least: list[Any] = []
        self._clients: dict[str, Any] = {}

    def types(self, request: Json) -> Json:
        """Return the types whose packages are installed."""
        types = []
        for name in request["names"]:
            with suppress(ImportError, AttributeError):
                _message_class(name)
                types.append(name)
        return {"types": types}

    def open(self, request: Json) -> Json:
        """Create publishers and subscriptions; their numbers are their places in all requests."""
        for endpoint in request["publishers"]:
            kind = _message_class(endpoint["type"])
            publisher = self._node.create_publisher(kind, endpoint["topic"], _profile(endpoint["qos"]))
            self._publishers.append((publisher, kind, endpoint["type"]))
        for endpoint in request["subscriptions"]:
            kind = _message_class(endpoint["type"])
            subscription = self._node.create_subscription(kind, endpoint["topic"], _ignore, _profile(endpoint["qos"]))
            self._subscriptions.append(subscription)
            self._least.append(endpoint["least"])
        return {}

    def matched(self, _: Json) -> Json:
        """Return the number of subscriptions that each publisher knows, and the reverse."""
        return {
            "publishers": [publisher.get_subscription_count() for publisher, _, _ in self._publishers],
            "subscriptions": [subscription.get_publisher_count() for subscription in self._subscriptions],
        }

    def publish(self, request: Json) -> None:
        """Publish a message."""
        publisher, kind, name = self._publishers[request["number"]]
        publisher.publish(_filled(kind, name, request["message"]))

    def take(self, request: Json) -> Json:
        """Return all messages since the last time, one topic after the other: no order of topics is fixed."""
        messages = []
        for number, subscription in enumerate(self._subscriptions):
            while (taken := _taken(subscription)) is not None:
                message = taken[0]
                least = self._least[number]
                if least is None or getattr(message, least[0]) >= least[1]:
                    messages.append((number, message))
        clocks = [self._publishers[number][0].get_subscription_count() for number in request["clocks"]]
        return {"messages": messages, "clocks": clocks}

    def graph(self, request: Json) -> Json:
        """Return the names of nodes, and who publishes and subscribes to topics."""
        node = self._node
        topic_types = dict(node.get_topic_names_and_types())
        topics = request["topics"]
        return {
            "nodes": sorted({_full(name, space) for name, space in node.get_node_names_and_namespaces()}),
            "types": {topic: list(types) for topic, types in topic_types.items()},
            "publishers": {topic: _ends(node.get_publishers_info_by_topic(topic)) for topic in topics},
            "subscriptions": {topic: _ends(node.get_subscriptions_info_by_topic(topic)) for topic in topics},
        }

    def parameters(self, request: Json) -> Json:
        """Return the value of a parameter of each node that answers within a time; null if the node lacks it."""
        from rcl_interfaces.srv import GetParameters

        deadline = time.monotonic() + request["within"]
        values: Json = {}
        asked: dict[str, int] = {}
        while len(values) < len(request["nodes"]) and time.monotonic() < deadline:
            for name in request["nodes"]:
                if name not in self._clients:
                    self._clients[name] = self._node.create_client(GetParameters, f"{name}/get_parameters")
                client = self._clients[name]
                if name not in asked and client.service_is_ready():
                    with client.handle:
                        asked[name] = client.handle.send_request(GetParameters.Request(names=[request["name"]]))
                if name in asked and name not in values:
                    with client.handle:
                        header, answer = client.handle.take_response(GetParameters.Response)
                    if header is not None and answer is not None:
                        parameters = answer.values
                        # Type 1 is bool.
                        values[name] = parameters[0].bool_value if parameters and parameters[0].type == 1 else None
            time.sleep(_POLL_S)
        return {"values": values}

    def close(self) -> None:
        with suppress(Exception):
            self._node.destroy_node()
            rclpy.shutdown()


def _ignore(_: Any) -> None:
    """Ignore a message; messages are taken without callbacks."""


def _taken(subscription: Any) -> Any:
    with subscription.handle:
        return subscription.handle.take_message(subscription.msg_type, False)


def _full(name: str, space: str) -> str:
    return f"{space.rstrip('/')}/{name}"


def _profile(qos: Json) -> QoSProfile:
    return QoSProfile(
        depth=qos.get("depth", 10),
        reliability=ReliabilityPolicy[qos.get("reliability", "reliable").upper()],
        durability=DurabilityPolicy[qos.get("durability", "volatile").upper()],
    )


def _ends(endpoints: Any) -> list[Json]:
    """Return the nodes at one side of a topic, with the types and the QoS that they chose."""
    return [
        {
            "node": _full(endpoint.node_name, endpoint.node_namespace),
            "type": endpoint.topic_type,
            "reliability": endpoint.qos_profile.reliability.name.lower(),
            "durability": endpoint.qos_profile.durability.name.lower(),
            "demands": _demands(endpoint.qos_profile),
        }
        for endpoint in endpoints
    ]


def _demands(qos: Any) -> list[str]:
    """Return what else an end asks for; the usual periods are infinite."""
    demands = ["a deadline"] if 0 < qos.deadline.nanoseconds < _INFINITE_NS else []
    is_usual = qos.liveliness in (LivelinessPolicy.AUTOMATIC, LivelinessPolicy.SYSTEM_DEFAULT)
    if not is_usual or 0 < qos.liveliness_lease_duration.nanoseconds < _INFINITE_NS:
        demands.append("a liveliness")
    return demands


def main(descriptor: int) -> None:
    """Answer requests until the parent closes its end."""
    frames = Frames(socket.socket(fileno=descriptor), _plain)
    bridge = _Bridge(frames.receive())
    about = {"rmw": get_rmw_implementation_identifier(), "distribution": os.environ.get("ROS_DISTRO", "")}
    frames.send(about)
    try:
        while True:
            request = frames.receive()
            if (answer := getattr(bridge, request["op"])(request)) is not None:
                frames.send(answer)
    except EOFError:
        bridge.close()


if __name__ == "__main__":
    main(int(sys.argv[1]))
