"""The wait for connections at the start, by what the bridge tells of them."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from itertools import chain, repeat
from typing import Final

import pytest

from sim_action.ros.ros2.bridge_link import Endpoint, Graph, TopicEnd
from sim_action.ros.ros2.quality import Qos
from sim_action.ros.ros2.readiness import Readiness

TWIST: Final = "geometry_msgs/msg/Twist"
ODOMETRY: Final = "nav_msgs/msg/Odometry"


def end(node: str, kind: str, reliability: str = "reliable") -> TopicEnd:
    return TopicEnd(node, kind, reliability, "volatile")


class KnownEnds:
    """A bridge with one publisher and one subscription; `counts`: the connections of both at each look."""

    def __init__(self, publishers: list[TopicEnd], subscriptions: list[TopicEnd], counts: Iterable[tuple[int, int]]):
        self.published, self.heard = [Endpoint("/odom", ODOMETRY)], [Endpoint("/cmd_vel", TWIST)]
        self._graph = Graph((), {}, {"/cmd_vel": publishers}, {"/odom": subscriptions})
        self._counts: Iterator[tuple[int, int]] = iter(counts)
        self.looks = 0

    def graph(self, _: Iterable[str]) -> Graph:
        return self._graph

    def matched(self) -> tuple[list[int], list[int]]:
        self.looks += 1
        published, heard = next(self._counts)
        return [published], [heard]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The wall clock, which goes on only while the wait sleeps."""
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", sleep)
    return now


def waited(bridge: KnownEnds, within: float = 20.0) -> list[str]:
    """Return what the wait complains about."""
    wait = Readiness(bridge, [], lambda: None, within)  # type: ignore[arg-type]  # of a bridge, it has what is used
    wait.await_connections(())
    return wait.losses


def test_time_waits_for_connections_as_long_as_nodes_may_take(clock: list[float]) -> None:
    counts = chain(repeat((0, 1), 1500), repeat((1, 1)))
    assert waited(KnownEnds([end("/mover", TWIST)], [end("/mover", ODOMETRY)], counts)) == []
    assert 15 < clock[0] < 15.5


def test_connections_that_are_missing_at_the_end_are_named(clock: list[float]) -> None:
    bridge = KnownEnds([end("/mover", TWIST), end("/joy", TWIST)], [end("/mover", ODOMETRY)], repeat((0, 1)))
    assert waited(bridge, 5.0) == [
        "the node '/mover' was not connected to the robot on /odom within 5 s of wall time",
        "one of the nodes '/joy' and '/mover' was not connected to the robot on /cmd_vel within 5 s of wall time",
    ]
    assert 5 <= clock[0] < 5.5


def test_subscriptions_that_cannot_connect_delay_nothing(clock: list[float]) -> None:
    bridge = KnownEnds([], [end("/x", ODOMETRY)], repeat((0, 0)))
    bridge.published = [Endpoint("/odom", ODOMETRY, Qos(reliability="best_effort"))]
    assert waited(bridge) == []
    assert clock[0] < 0.2


def test_a_node_that_appears_after_the_questions_is_not_silent(clock: list[float]) -> None:
    bridge = KnownEnds([], [], repeat((0, 0)))
    graphs = chain([Graph((), {}, {}, {})], repeat(Graph(("/mover",), {}, {}, {})))
    bridge.graph = lambda _: next(graphs)  # type: ignore[method-assign]  # the nodes change from look to look
    wait = Readiness(bridge, [], lambda: None, 5.0)  # type: ignore[arg-type]  # of a bridge, it has what is used
    wait.await_answers()
    assert wait.losses == []
