"""The lock-step with nodes of ROS 2: each hears of the time after the one before it has handled all its messages."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from typing import Final

from sim_action.ros.processes import ChildProcesses, descendants
from sim_action.ros.quiescence import WatchedProcesses
from sim_action.ros.ros2.bridge_link import Bridge, Endpoint
from sim_action.ros.ros2.diagnosis.unordered_nodes import UnorderedNodes
from sim_action.ros.ros2.messages import clock_message
from sim_action.ros.ros2.node_group import Node
from sim_action.ros.ros2.topics import CLOCK_QOS, CLOCK_TYPE

CLOCK: Final = "/clock"
# Wall time that nodes may compute between two ticks, and the wait at each tick once lock-step is lost.
MAX_SETTLE_S: Final = 10.0
_SETTLE_AFTER_LOSS_S: Final = 0.05
# Wall time for which the work of busy processes is compared.
_BUSY_S: Final = 0.1
# Wall time for which the clock stands still before it starts, in parts.
_HOLD_S: Final = 0.01
_HOLDS: Final = 10


def clock_of(number: int | str) -> str:
    """Return the hidden topic on which a node hears of the time."""
    return f"/_clock_{number}"


class Lockstep:
    """The clocks of all nodes.

    Attributes:
        nodes: the nodes with a clock, in the order in which they hear of the time.
        clocks: the numbers of their publishers.
        losses: reasons why another run may differ.
    """

    def __init__(self, bridge: Bridge, roots: Sequence[int]) -> None:
        """Open the clock of all tools. Raise BridgeEnded.

        :param roots: ids of the processes from which all nodes descend.
        """
        self._bridge, self._roots = bridge, roots
        self._watched = WatchedProcesses(spared=threading.get_native_id())
        self._children: dict[int, ChildProcesses] = {}
        self._known: dict[int, frozenset[int]] = {}
        self._unordered = UnorderedNodes()
        self._patience = MAX_SETTLE_S
        self.nodes: list[Node] = []
        self.clocks: list[int] = []
        self.losses: list[str] = []
        # True if nodes have no clock of their own, and listen to that of all tools.
        self._is_heard = True
        self._all = bridge.open([Endpoint(CLOCK, CLOCK_TYPE, CLOCK_QOS)], ())

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
            if not self._watched.wait(self._patience):
                self._lose(seconds)
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
        if self._patience == MAX_SETTLE_S:
            self.losses += self._unordered.notice_wakes(self._watched.stirred(), time.monotonic())

    def advance(self, seconds: float) -> None:
        """Tell the time to one node after the other."""
        message = clock_message(seconds)
        for number in self.clocks:
            self._bridge.publish(number, message)
            self.settle(seconds)
        self._bridge.publish(self._all, message)
        if self._is_heard:
            self.settle(seconds)

    def tell_time(self, seconds: float) -> None:
        """Tell the time to all nodes at once."""
        for number in (*self.clocks, self._all):
            self._bridge.publish(number, clock_message(seconds))

    def _has_changed(self) -> bool:
        return any(children.look() != self._known.get(pid) for pid, children in self._children.items())

    def _watch(self) -> None:
        """Watch the bridge, this process, and the nodes with all that they have started."""
        if self._known and not self._has_changed():
            return
        # A process between a root and a node, such as a shell, may start the node later.
        alive = {*self._roots, *(each for pid in self._roots for each in descendants(pid))}
        self._children = {pid: self._children.get(pid) or ChildProcesses(pid) for pid in alive}
        self._known = {pid: children.look() for pid, children in self._children.items()}
        self._watched.watch({*alive, self._bridge.process.pid, os.getpid()})

    def _lose(self, seconds: float) -> None:
        if self._patience == MAX_SETTLE_S:
            self._patience = _SETTLE_AFTER_LOSS_S
            busy = self._watched.busy(_BUSY_S)
            names = [
                node.process.label for node in self.nodes if {node.process.pid, *descendants(node.process.pid)} & busy
            ]
            who = f"the node {' and '.join(map(repr, names))} was" if names else "nodes were"
            self.losses.append(
                f"lock-step was lost at {seconds:g} s of sim time, because {who} still busy after {MAX_SETTLE_S:g} s "
                "of wall time"
            )
