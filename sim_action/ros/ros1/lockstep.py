"""Lock-step of sim time and nodes: the clock goes on only when every node has handled all that it received."""

from __future__ import annotations

import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from sim_action.core.errors import ControllersFinished
from sim_action.ros.processes import (
    MAX_SETTLE_S,
    ChildProcesses,
    WatchedProcesses,
    command_line,
    descendants,
    has_ended,
    is_result_written,
    process_name,
    rostest_result_path,
)
from sim_action.ros.ros1.master import LOG_NODE, Graph, Master

# Processes that wake up at least that often while the clock stands still poll the wall clock. Nodes that wait for sim
# time wake up twice per second with rospy, and ten times with roscpp; a timer of roscpp polls 1,000 times.
_MIN_POLLS: Final = 10
_MIN_POLLS_HZ: Final = 50.0
_POLL_S: Final = 0.01
# Wall time without a change in the graph, after which the clock starts although no node drives the robot.
_CALM_S: Final = 2.0
_MAX_LEAVING_S: Final = 10.0  # wall time in which a node that has left the graph ends


class TestFinished(ControllersFinished):
    """The test that rostest started has written its result."""


def _ignore_ended(_: frozenset[int]) -> None:
    """Ignore the end of processes; the default for launches."""


class Lockstep:
    """The lock-step: holds the clock until all nodes wait.

    `launcher`: the process that starts nodes. `listeners`: returns the current connections of nodes to our clock.
    `gone`: called with the ids of the launcher's processes that have ended.
    `newcomers_within`: s of wall time that processes may take to become nodes. `not_reproducible`: reasons why another
    run may differ, each with the name of a node.
    """

    def __init__(
        self,
        master: Master,
        launcher: int,
        is_shutdown: Callable[[], bool],
        listeners: Callable[[], frozenset[object]],
        *,
        gone: Callable[[frozenset[int]], None] = _ignore_ended,
        newcomers_within: float = MAX_SETTLE_S,
    ) -> None:
        self.master, self._is_shutdown = master, is_shutdown
        self._current_listeners, self._gone, self._newcomers_within = listeners, gone, newcomers_within
        self._listeners = frozenset[object]()
        self._watched = WatchedProcesses(spared=threading.get_native_id())
        self._launcher = ChildProcesses(launcher)
        self._siblings: frozenset[int] = frozenset()
        self._given_up: set[int] = set()
        self._joined: set[int] = set()
        self._tests: dict[int, Path] = {}
        self._pids: Mapping[str, int] = {}
        self._suspects: set[str] = set()
        self._awakenings = Counter[int]()
        self._quiet_since: float | None = None
        self._stood_s = 0.0
        self.notes: list[str] = []
        self.not_reproducible: list[str] = []

    @property
    def is_kept(self) -> bool:
        """True if the clock has waited for the nodes all the time."""
        return self._watched.is_kept

    def begin(self, commands: Callable[[], frozenset[str]], is_wanted: Callable[[], bool]) -> None:
        """Wait until all nodes are up and connected, or `is_wanted`; `commands`: topics that drive the robot."""
        self._wait_for_newcomers(is_wanted)
        calm_since = time.monotonic()
        before: Graph | None = None
        while not is_wanted():
            graph = self.master.graph()
            if graph != before:
                before, calm_since = graph, time.monotonic()
            calm = time.monotonic() - calm_since
            is_driven = any(graph.publishers.get(topic, frozenset()) - {self.master.caller} for topic in commands())
            unconnected = self.master.first_unconnected(graph)
            if calm > MAX_SETTLE_S or (unconnected is None and (is_driven or calm > _CALM_S)):
                self._note_unconnected(unconnected, MAX_SETTLE_S)
                break
            self._end_if_over()
            time.sleep(_POLL_S)
        self._note_misfits()
        self.settle(0.0)
        self._listeners = self._current_listeners()

    def deliver(self, seconds: float, deliveries: Iterable[Callable[[], None]]) -> None:
        """Deliver messages one by one, and wait after each until no node has work left at a sim time.

        Two nodes that work at the same time may send to a third one in any order. Raises ControllersFinished when no
        node is left.
        """
        self._look_for_polls()
        is_settled = False
        for deliver in deliveries:
            deliver()
            is_settled = self.is_kept
            if is_settled:
                self.settle(seconds)
        if not is_settled:
            self.settle(seconds)
        before, self._listeners = self._listeners, self._current_listeners()
        if before - self._listeners:
            # A node that leaves disconnects first, and then ends by the wall clock.
            self.await_leavers()
            self.settle(seconds)
        self._quiet_since = time.monotonic()

    def suspect(self, node: str, conduct: str) -> None:
        """Note that a node does not wait for sim time; the first reason for each node is kept."""
        name = node.removeprefix("/")
        if self.is_kept and name not in self._suspects:
            self._suspects.add(name)
            self.not_reproducible.append(f"the node '{name}' does not wait for sim time: {conduct}")

    def settle(self, seconds: float) -> None:
        """Wait until no node has work left at a sim time. Raises ControllersFinished when no node is left."""
        while True:
            if not self._watched.settle():
                self.not_reproducible += self._watched.loss(seconds, lambda pids: map(self._name, pids))
                self._end_if_over()
                return
            self._end_if_over()
            if self._launcher.look() == self._siblings:
                return
            self._note_unconnected(self._wait_for_newcomers(), self._newcomers_within)
            self._note_misfits()

    def may_start_nodes(self, program: bytes) -> bool:
        """Return True if a process is not a node yet, or runs a program with this text in its command line."""
        return bool(self._missing()) or any(program in command_line(pid) for pid in self._siblings)

    def await_leavers(self) -> None:
        """Wait a while until nodes that have left the graph or crashed are known to the launcher as ended."""
        deadline = time.monotonic() + _MAX_LEAVING_S
        while (leavers := self._leavers()) and not self._is_shutdown():
            if time.monotonic() > deadline:
                self._given_up |= leavers
            time.sleep(_POLL_S)

    def _leavers(self) -> set[int]:
        joined = self._launcher.look() & self._joined - self._given_up
        try:
            nodes = frozenset(self.master.graph().pids.values()) if joined else frozenset[int]()
        except OSError:  # the master has ended
            return set()
        return {pid for pid in joined if has_ended(pid) or not _is_among(pid, nodes)}

    def _wait_for_newcomers(self, is_wanted: Callable[[], bool] = lambda: False) -> tuple[str, str] | None:
        """Wait until all processes are nodes and connected; return a node and a topic that are not in time."""
        deadline = time.monotonic() + self._newcomers_within
        while (missing := self._missing()) and not is_wanted():
            self._end_if_over()
            if time.monotonic() > deadline:
                self._given_up.update(missing)
                late = f"did not become a ROS node within {self._newcomers_within:g} s of wall time"
                self.notes += (f"'{process_name(pid)}' {late}; the clock does not wait for it" for pid in missing)
            time.sleep(_POLL_S)
        while (unconnected := self.master.first_unconnected(self.master.graph())) and time.monotonic() < deadline:
            time.sleep(_POLL_S)
        return unconnected

    def _note_unconnected(self, unconnected: tuple[str, str] | None, waited_s: float) -> None:
        if unconnected is not None:
            node, topic = unconnected[0].removeprefix("/"), unconnected[1]
            reason = (
                f"the node '{node}' had no connection to all publishers of {topic} after {waited_s:g} s of wall time"
            )
            if reason not in self.not_reproducible:
                self.not_reproducible.append(reason)

    def _note_misfits(self) -> None:
        self.notes += (note for note in self.master.misfit_notes() if note not in self.notes)

    def _missing(self) -> list[int]:
        """Return the processes of the launcher that are no nodes, and have not started one."""
        siblings = self._launcher.look()
        if ended := self._siblings - siblings:
            self._gone(ended)
        self._siblings = siblings
        if self._tests and self._tests.keys().isdisjoint(siblings):
            raise TestFinished("the test has finished")
        self._tests = {pid: path for pid in siblings if (path := rostest_result_path(pid))}
        graph = self.master.graph()
        self._pids = graph.pids
        nodes = frozenset(graph.pids.values())
        joined = {pid for pid in siblings if _is_among(pid, nodes)}
        self._joined |= joined
        self._watched.watch({*nodes, graph.master, os.getpid()})
        return sorted(siblings - joined - self._given_up - {graph.master})

    def _name(self, pid: int) -> str:
        nodes = sorted(name for name, node_pid in self._pids.items() if node_pid == pid)
        return f"the node '{nodes[0].removeprefix('/')}'" if nodes else f"'{process_name(pid)}'"

    def _look_for_polls(self) -> None:
        """Suspect nodes that run by themselves between two ticks, when they have received nothing."""
        if self._quiet_since is None:
            return
        self._stood_s += time.monotonic() - self._quiet_since
        self._quiet_since = None
        for pid, runs in self._watched.awakenings().items():
            self._awakenings[pid] += runs
            rate = self._awakenings[pid] / self._stood_s
            if self._awakenings[pid] >= _MIN_POLLS and rate >= _MIN_POLLS_HZ:
                own = self.master.caller, LOG_NODE
                for node in (name for name, node_pid in self._pids.items() if node_pid == pid and name not in own):
                    self.suspect(
                        node, f"it wakes up {rate:.0f} times per second of wall time while the clock stands still"
                    )

    def _end_if_over(self) -> None:
        if self._is_shutdown():
            raise ControllersFinished("the nodes were asked to shut down")
        if self._tests and all(map(is_result_written, self._tests.values())):
            raise TestFinished("the test has finished")


def _is_among(pid: int, nodes: frozenset[int]) -> bool:
    """Return True if a process is one of the nodes, or has started one, as the shell of a `launch-prefix` does."""
    return pid in nodes or not nodes.isdisjoint(descendants(pid))
