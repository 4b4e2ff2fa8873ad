"""The lock-step with nodes of ROS 2: each hears of the time after the one before it has handled all its messages.

Sim time begins when all nodes are up and know each other. A node whose publishers are known may still not spin, so each
must answer a question. At t = 0, no node has lost a message because another one was not connected yet.

Lock-step cannot order nodes that wait by the wall clock, and those with callbacks on several threads. Both are seen by
which threads run. Threads of DDS, which are named so, run by the wall clock, and do not count. Nor does the thread by
which spdlog, the logger of ROS 2, writes its files every 5 s; it has no name.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final

from sim_action.ros.messages import clock_message
from sim_action.ros.node_start import ORDERED
from sim_action.ros.processes import ChildProcesses, WatchedProcesses, WatchedThread, descendants
from sim_action.ros.ros2.bridge_link import Bridge, Endpoint
from sim_action.ros.ros2.graph import Graph, TopicEnd, subscriber_problems
from sim_action.ros.ros2.node_processes import Node
from sim_action.ros.ros2.topics import CLOCK_QOS, CLOCK_TYPE

CLOCK: Final = "/clock"
# Wall time for which the clock stands still before it starts, in parts.
_HOLD_S: Final = 0.01
_HOLDS: Final = 10
_OF_DDS: Final = "dds."  # the beginning of the names of threads of Fast DDS
# Threads without a name also handle changes of the graph, which are rare during a run.
_MIN_WAKES: Final = 3
_MIN_SHARED: Final = 10
_MAX_GAP_S: Final = 4.0  # in s of wall time: less than the period of spdlog
_USE_SIM_TIME: Final = "use_sim_time"
_READY_POLL_S: Final = 0.01
_ASK_S: Final = 0.2  # the wall time of one question, during which ended processes go unnoticed
# The wall time without a change after which all participants know each other: some announcements of each.
_CALM_S: Final = 0.1


def clock_of(number: int | str) -> str:
    """Return the hidden topic on which a node hears of the time."""
    return f"/_clock_{number}"


class Lockstep:
    """The clocks of all nodes, in the order in which they hear of the time; `losses`: why another run may differ."""

    def __init__(self, bridge: Bridge, roots: Sequence[int]) -> None:
        """Open the clock of all tools; `roots`: processes from which all nodes descend. Raise BridgeEnded."""
        self._bridge, self._roots = bridge, tuple(roots)
        self._watched = WatchedProcesses(spared=threading.get_native_id())
        self._children: dict[int, ChildProcesses] = {}
        self._child_pids: dict[int, frozenset[int]] = {}
        self._unordered = UnorderedNodes()
        self.nodes: list[Node] = []
        self.clocks: list[int] = []
        self.losses: list[str] = []
        # True if nodes have no clock of their own, and listen to the clock of all tools.
        self._is_heard = True
        self._all = bridge.open([Endpoint(CLOCK, CLOCK_TYPE, CLOCK_QOS)], ())

    def watch_more(self, roots: Sequence[int]) -> None:
        """Also watch processes that descend from others."""
        self._roots, self._child_pids = (*self._roots, *roots), {}

    def add(self, nodes: Sequence[Node]) -> None:
        """Open the clocks of nodes. Raise BridgeEnded."""
        first = self._bridge.open([Endpoint(clock_of(node.number), CLOCK_TYPE, CLOCK_QOS) for node in nodes], ())
        self.nodes += nodes
        self._unordered.labels |= {node.process.pid: node.process.label for node in nodes}
        self.clocks += range(first, first + len(nodes))

    def listeners(self) -> list[int]:
        """Return the number of subscriptions of each clock, and notice nodes without one. Raise BridgeEnded."""
        publishers, _ = self._bridge.matched()
        self._is_heard = publishers[self._all] > 0
        return [publishers[number] for number in self.clocks]

    def settle(self, seconds: float) -> None:
        """Wait until no process has work left at a sim time in s."""
        before = self._watched.at_rest
        while True:
            self._watch()
            if not self._watched.settle():
                self.losses += self._watched.loss(seconds, self._names)
                return
            if not self._has_changed():
                self.losses += self._unordered.notice_work(before, self._watched.at_rest, time.monotonic())
                return

    def hold(self) -> None:
        """Hold the clock for a moment, to notice nodes that run by the wall clock."""
        for _ in range(_HOLDS):
            self.settle(0.0)
            time.sleep(_HOLD_S)
            self.notice_wakes()

    def notice_wakes(self) -> None:
        """Notice nodes that run at the beginning of a tick, before anything is sent to them."""
        if self._watched.is_kept:
            self.losses += self._unordered.notice_wakes(self._watched.stirred(), time.monotonic())

    def advance(self, seconds: float) -> None:
        """Send the time to one node after the other."""
        message = clock_message(seconds)
        for number in self.clocks:
            self._bridge.publish(number, message)
            self.settle(seconds)
        self._bridge.publish(self._all, message)
        if self._is_heard:
            self.settle(seconds)

    def tell_time(self, seconds: float) -> None:
        """Send the time to all nodes at once."""
        for number in (*self.clocks, self._all):
            self._bridge.publish(number, clock_message(seconds))

    def _has_changed(self) -> bool:
        return any(children.look() != self._child_pids.get(pid) for pid, children in self._children.items())

    def _watch(self) -> None:
        """Watch the bridge, this process, and the nodes with all that they have started."""
        if self._child_pids and not self._has_changed():
            return
        # A process between a root and a node, such as a shell, may start the node later.
        alive = {*self._roots, *(descendant for pid in self._roots for descendant in descendants(pid))}
        self._children = {pid: self._children.get(pid) or ChildProcesses(pid) for pid in alive}
        self._child_pids = {pid: children.look() for pid, children in self._children.items()}
        self._watched.watch({*alive, self._bridge.process.pid, os.getpid()})

    def _names(self, busy: frozenset[int]) -> Iterator[str]:
        for process in (node.process for node in self.nodes):
            if {process.pid, *descendants(process.pid)} & busy:
                yield f"the node '{process.label}'"


class UnorderedNodes:
    """Notices nodes of one run; `labels`: id of a process -> the name of its node."""

    def __init__(self) -> None:
        self.labels: dict[int, str] = {}
        self._wakes, self._shared = _Repetitions(), _Repetitions()

    def notice_wakes(self, threads: Iterable[WatchedThread], now: float) -> Iterator[str]:
        """Take the threads that ran although nothing was sent; yield reasons why another run may differ; `now` in s."""
        woken = [thread for thread in threads if self._is_of_node(thread)]
        with_main = {thread.pid for thread in woken if thread.tid == thread.pid}
        for pid in {thread.pid for thread in woken}:
            if self._wakes.count(pid, now, is_frequent=pid in with_main) == _MIN_WAKES:
                yield (
                    f"the node '{self.labels[pid]}' ran although nothing was sent to it; it waits by the wall clock, "
                    "for example with time.sleep(), a timeout, or a timer of another clock than that of the node"
                )

    def notice_work(
        self, before: Mapping[WatchedThread, bytes], after: Mapping[WatchedThread, bytes], now: float
    ) -> Iterator[str]:
        """Take how long threads had run before and after a wait; yield reasons why another run may differ."""
        ran = [thread for thread, spent in after.items() if before.get(thread, spent) != spent]
        ran = [thread for thread in ran if self._is_of_node(thread)]
        counts = Counter(thread.pid for thread in ran)
        counts.subtract(thread.pid for thread in ran if counts[thread.pid] > 1 and thread.current_name() == ORDERED)
        for pid in (pid for pid, count in counts.items() if count > 1):
            if self._shared.count(pid, now) == _MIN_SHARED:
                yield (
                    f"the node '{self.labels[pid]}' handles messages on several threads, in no certain order; use an "
                    "executor with one thread"
                )

    def _is_of_node(self, thread: WatchedThread) -> bool:
        return thread.pid in self.labels and not thread.name.startswith(_OF_DDS)


class _Repetitions:
    """Counts what happens to processes again soon after the last time."""

    def __init__(self) -> None:
        self._counts = Counter[int]()
        self._last: dict[int, float] = {}

    def count(self, pid: int, now: float, *, is_frequent: bool = False) -> int:
        """Count one more, and return the count; 0: it did not count. `is_frequent`: it counts in any case."""
        gap = now - self._last.get(pid, -math.inf)
        self._last[pid] = now
        if gap > _MAX_GAP_S and not is_frequent:
            return 0
        self._counts[pid] += 1
        return self._counts[pid]


class Readiness:
    """The wait for all nodes; `losses`: reasons why another run may differ."""

    def __init__(
        self, bridge: Bridge, nodes: Sequence[Node], refuse_ended: Callable[[], None], start_within: float
    ) -> None:
        """Prepare the wait of `start_within` s; `refuse_ended` raises the error of a node that has failed."""
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
            time.sleep(_READY_POLL_S)

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

        `watched`: more topics that may not change, besides the bridge's. Ends that cannot connect, because their type
        or their QoS differs, are not waited for. Raise ScriptError, BridgeEnded.
        """
        before: Graph | None = None
        calm_since = time.monotonic()
        while time.monotonic() < calm_since + _CALM_S:
            self._refuse_ended()
            ends = (*self._bridge.published, *self._bridge.heard)
            graph = self._bridge.graph({*watched, *(end.topic for end in ends)})
            # The topics on which not all ends that can connect have done so, each with the nodes in question.
            publishers, subscriptions = self._bridge.matched()
            ours = zip(self._bridge.published, publishers, strict=True)
            theirs = zip(self._bridge.heard, subscriptions, strict=True)
            sides = [(own.topic, count, _fitting(own, graph.subscriptions[own.topic])) for own, count in ours]
            sides += [(own.topic, count, graph.publishers[own.topic]) for own, count in theirs]
            missing = [(topic, _one_of(ends)) for topic, count, ends in sides if count < len(ends)]
            if missing and time.monotonic() > self._deadline:
                within = f"within {self._start_within:g} s of wall time"
                self.losses += [f"{node} was not connected to the robot on {topic} {within}" for topic, node in missing]
                return
            if missing or graph != before:
                before, calm_since = graph, time.monotonic()
            time.sleep(_READY_POLL_S)


def _fitting(offered: Endpoint, ends: Sequence[TopicEnd]) -> Sequence[TopicEnd]:
    return [end for end in ends if not any(subscriber_problems(offered.topic, offered.type, offered.qos, [end]))]


def _one_of(ends: Sequence[TopicEnd]) -> str:
    names = sorted({repr(end.node) for end in ends})
    return f"the node {names[0]}" if len(names) == 1 else f"one of the nodes {' and '.join(names)}"
