"""What was kept of a run for its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sim_action.commanded_twists import CommandedTwists
from sim_action.scene import Scene
from sim_action.sensors.mounting import MountedSensor
from sim_action.trace import FloatArray, Trace


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A run over T moments.

    Attributes:
        name: of the scenario.
        trace: T moments, with the contacts and the readings of sensors that are kept.
        sensors: of the robot, those that the trace keeps among them.
        bodies: name -> (T, 7) x, y, z in m and quaternion x, y, z, w, world frame; of bodies that may move.
        twists: what the base was told.
    """

    name: str
    scene: Scene
    trace: Trace
    sensors: tuple[MountedSensor, ...] = ()
    bodies: Mapping[str, FloatArray] = field(default_factory=dict)
    twists: CommandedTwists = field(default_factory=CommandedTwists)
