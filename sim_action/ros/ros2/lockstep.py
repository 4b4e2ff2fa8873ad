"""The lock-step with nodes of ROS 2: each hears of the time after the one before it has handled all its messages."""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from typing import Final

from sim_action.core.records import dataclass
from sim_action.ros.processes import ChildProcesses, descendants
from sim_action.ros.quiescence import WatchedProcesses
from sim_action.ros.ros2.bridge_link import Bridge, Endpoint
from sim_action.ros.ros2.node_processes import NodeProcess
from sim_action.ros.ros2.topics import CLOCK_QOS, CLOCK_TYPE

CLOCK: Final = "/clock"
# Wall time that nodes may compute between two ticks, and the wait at each tick once lock-step is lost.
MAX_SETTLE_S: Final = 10.0
_SETTLE_AFTER_LOSS_S: Final = 0.05
# Wall time for which the work of busy processes is compared.
_BUSY_S: Final = 0.1
_NANOSECONDS: Final = 10**9


def clock_of(number: int) -> str:
    """Return the hidden topic on which a node hears of the time."""
    return f"/_clock_{number}"


@dataclass(frozen=True, slots=True)
class Node:
    """A process that the scenario lists; `number`: its place in the list."""

    number: int
    process: NodeProcess
    required: bool


class Lockstep:
    """The clocks of all nodes.

    Attributes:
        losses: reasons why another run may differ.
    """

    def __init__(self, bridge: Bridge, nodes: Sequence[Node]) -> None:
        self._bridge, self._nodes = bridge, nodes
        self._watched = WatchedProcesses(spared=threading.get_native_id())
        self._children = {node.process.pid: ChildProcesses(node.process.pid) for node in nodes}
        self._known: dict[int, frozenset[int]] = {}
        self._patience = MAX_SETTLE_S
        self.losses: list[str] = []

    @staticmethod
    def clocks(nodes: Sequence[Node]) -> list[Endpoint]:
        """Return the clocks to open: one of each node, and then the one of all tools."""
        topics = [*(clock_of(node.number) for node in nodes), CLOCK]
        return [Endpoint(topic, CLOCK_TYPE, CLOCK_QOS) for topic in topics]

    def settle(self, seconds: float) -> None:
        """Wait until no process has work left at a sim time in s."""
        while True:
            self._watch()
            if not self._watched.wait(self._patience):
                self._lose(seconds)
                return
            if not self._has_changed():
                return

    def advance(self, seconds: float) -> None:
        """Tell the time to one node after the other."""
        whole, rest = divmod(round(seconds * _NANOSECONDS), _NANOSECONDS)
        message = {"clock": {"sec": whole, "nanosec": rest}}
        for number in range(len(self._nodes) + 1):
            self._bridge.publish(number, message)
            self.settle(seconds)

    def tell_time(self, seconds: float) -> None:
        """Tell the time to all nodes at once."""
        whole, rest = divmod(round(seconds * _NANOSECONDS), _NANOSECONDS)
        for number in range(len(self._nodes) + 1):
            self._bridge.publish(number, {"clock": {"sec": whole, "nanosec": rest}})

    def _has_changed(self) -> bool:
        return any(children.look() != self._known.get(pid) for pid, children in self._children.items())

    def _watch(self) -> None:
        """Watch the bridge, this process, and the nodes with all that they have started."""
        if self._known and not self._has_changed():
            return
        self._known = {pid: children.look() for pid, children in self._children.items()}
        below = {each for pid, found in self._known.items() if found for each in descendants(pid)}
        self._watched.watch({*self._children, *below, self._bridge.process.pid, os.getpid()})

    def _lose(self, seconds: float) -> None:
        if self._patience == MAX_SETTLE_S:
            self._patience = _SETTLE_AFTER_LOSS_S
            busy = self._watched.busy(_BUSY_S)
            names = [
                node.process.label for node in self._nodes if {node.process.pid, *descendants(node.process.pid)} & busy
            ]
            who = f"the node {' and '.join(map(repr, names))} was" if names else "nodes were"
            self.losses.append(
                f"lock-step was lost at {seconds:g} s of sim time, because {who} still busy after {MAX_SETTLE_S:g} s "
                "of wall time"
            )
