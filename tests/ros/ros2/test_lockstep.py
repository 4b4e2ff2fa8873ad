"""The wait for connections at the start, by what the bridge tells of them."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from itertools import chain, repeat
from typing import Final, cast

import pytest

from sim_action.ros.node_start import ORDERED
from sim_action.ros.processes import WatchedThread
from sim_action.ros.ros2.bridge_link import Endpoint
from sim_action.ros.ros2.graph import Graph, Qos, TopicEnd
from sim_action.ros.ros2.lockstep import Readiness, UnorderedNodes

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


class Thread:
    def __init__(self, pid: int, tid: int, name: str) -> None:
        self.pid, self.tid, self.name = pid, tid, name

    def current_name(self) -> str:
        return self.name


def thread(pid: int, name: str = "python3", *, tid: int = 99) -> WatchedThread:
    return cast("WatchedThread", Thread(pid, tid, name))


def nodes_of(labels: dict[int, str]) -> UnorderedNodes:
    nodes = UnorderedNodes()
    nodes.labels |= labels
    return nodes


@pytest.mark.parametrize(
    ("woken", "gap", "counts"),
    [
        ([thread(7, tid=7), thread(8, "dds.ev.0"), thread(9, tid=9)], 5.0, [0, 0, 1, 0, 0]),
        ([thread(7)], 2.0, [0, 0, 0, 1, 0]),
    ],
    ids=["the main thread", "another thread"],
)
def test_a_node_that_wakes_by_itself_is_named_once(woken: list[WatchedThread], gap: float, counts: list[int]) -> None:
    nodes = nodes_of({7: "talker", 8: "listener"})
    told = [list(nodes.notice_wakes(woken, gap * number)) for number in range(5)]
    assert [len(reasons) for reasons in told] == counts
    assert told[counts.index(1)][0].startswith("the node 'talker' ran although nothing was sent to it")


def test_the_thread_that_flushes_logs_is_not_the_node() -> None:
    nodes = nodes_of({7: "node"})
    main, flushing = thread(7, tid=7), thread(7)
    for number in range(100):
        now, count = 5.0 * number, str(number).encode()
        assert list(nodes.notice_wakes([flushing], now)) == []
        assert list(nodes.notice_work({main: b"", flushing: b""}, {main: count, flushing: count}, now)) == []


def test_a_node_with_several_threads_is_named_once() -> None:
    nodes = nodes_of({7: "pool", 8: "single"})
    # The last two: a thread that does not run, and a loop that ran when no other thread did.
    threads = [thread(7), thread(7), thread(7, "dds.udp.7411"), thread(8), thread(8, "dds.udp.7413"), thread(8)]
    threads.insert(5, thread(8, ORDERED))
    told = list[str]()
    for number in range(20):
        before = dict.fromkeys(threads, b"0")
        after = {each: b"0" if each is threads[-1] else str(number + 1).encode() for each in threads}
        told += nodes.notice_work(before, after, 0.01 * number)
    assert len(told) == 1
    assert told[0].startswith("the node 'pool' handles messages on several threads")


def test_a_new_thread_has_done_no_work_yet() -> None:
    nodes = nodes_of({7: "node"})
    for number in range(20):
        assert list(nodes.notice_work({}, {thread(7): b"1", thread(7): b"2"}, 0.01 * number)) == []
