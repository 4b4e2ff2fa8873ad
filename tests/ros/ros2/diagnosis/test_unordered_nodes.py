"""Nodes that wait by the wall clock, or have several threads, are told by which of their threads run."""

from __future__ import annotations

from typing import cast

from sim_action.ros.quiescence import WatchedThread
from sim_action.ros.ros2.diagnosis.unordered_nodes import UnorderedNodes


class Thread:
    def __init__(self, pid: int, tid: int, name: str) -> None:
        self.pid, self.tid, self.name = pid, tid, name


def thread(pid: int, name: str = "python3", *, tid: int = 99) -> WatchedThread:
    return cast("WatchedThread", Thread(pid, tid, name))


def nodes_of(labels: dict[int, str]) -> UnorderedNodes:
    nodes = UnorderedNodes()
    nodes.labels |= labels
    return nodes


def test_a_node_that_wakes_by_itself_is_named_once() -> None:
    nodes = nodes_of({7: "talker", 8: "listener"})
    woken = [thread(7, tid=7), thread(8, "dds.ev.0"), thread(9, tid=9)]
    told = [list(nodes.notice_wakes(woken, 5.0 * number)) for number in range(5)]
    assert [len(reasons) for reasons in told] == [0, 0, 1, 0, 0]
    assert told[2][0].startswith("the node 'talker' ran although nothing was sent to it")


def test_a_thread_of_a_node_that_wakes_by_itself_is_named() -> None:
    nodes = nodes_of({7: "talker"})
    told = [list(nodes.notice_wakes([thread(7)], 2.0 * number)) for number in range(5)]
    assert [len(reasons) for reasons in told] == [0, 0, 0, 1, 0]


def test_the_thread_that_flushes_logs_is_not_the_node() -> None:
    nodes = nodes_of({7: "node"})
    main, flushing = thread(7, tid=7), thread(7)
    for number in range(100):
        now, count = 5.0 * number, str(number).encode()
        assert list(nodes.notice_wakes([flushing], now)) == []
        assert list(nodes.notice_work({main: b"", flushing: b""}, {main: count, flushing: count}, now)) == []


def test_a_node_with_several_threads_is_named_once() -> None:
    nodes = nodes_of({7: "pool", 8: "single"})
    threads = [thread(7), thread(7), thread(7, "dds.udp.7411"), thread(8), thread(8, "dds.udp.7413"), thread(8)]
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
