"""Nodes that act by the wall clock: they send while sim time stands still, or call time.sleep again and again."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from sim_action.ros.program_failures import shown_path
from sim_action.ros.ros1.launch.ros_patches import SLEEPERS

if TYPE_CHECKING:
    from sim_action.ros.lockstep import Lockstep
    from sim_action.ros.ros1.node.topics import Traffic


class WallClockWatch:
    """Reports such nodes to the lock-step. The patches of ROS write a file for each process that sleeps."""

    def __init__(self, traffic: Traffic, lockstep: Lockstep) -> None:
        self._traffic, self._lockstep = traffic, lockstep
        self._folder = Path(os.environ["ROS_LOG_DIR"], SLEEPERS)
        # Those of earlier simulations of this launch.
        self._known = self._noted()

    def look(self) -> None:
        """Report new ones. Call it at the begin of a tick, before anything is published."""
        for node in sorted(self._traffic.unasked()):
            self._lockstep.suspect(node, "it sent a command while the clock stood still")
        for name in sorted(self._noted() - self._known):
            self._known.add(name)
            self._report(self._folder / name)

    def _noted(self) -> set[str]:
        """Return the names of the files of processes."""
        try:
            names = os.listdir(self._folder)  # noqa: PTH208 - read at each tick
        except OSError:
            return set()
        # The simulation itself sleeps while it waits for nodes.
        return {name for name in names if name.isdigit() and name != str(os.getpid())}

    def _report(self, path: Path) -> None:
        node, file, line = path.read_text(encoding="utf-8").splitlines()
        place = shown_path(Path(file).resolve())
        self._lockstep.suspect(node, f"it calls time.sleep again and again at {place}:{line}, instead of rospy.sleep")
