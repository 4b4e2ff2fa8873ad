"""What was kept of a run for its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from sim_action.commanded_twists import CommandedTwists
from sim_action.scene import Scene
from sim_action.sensors.mounting import MountedSensor
from sim_action.time_rounding import TIME_EPSILON
from sim_action.trace import FloatArray, Trace


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A run over T moments.

    Attributes:
        trace: T moments, with contacts, bodies that may move, and the readings of sensors that are kept.
        sensors: of the robot, those that the trace keeps among them.
        twists: what the base was told.
    """

    scene: Scene
    trace: Trace
    sensors: tuple[MountedSensor, ...] = ()
    twists: CommandedTwists = field(default_factory=CommandedTwists)

    @classmethod
    def of(
        cls, scene: Scene, film: Trace, trace: Trace, sensors: tuple[MountedSensor, ...], twists: CommandedTwists
    ) -> Self:
        """From what is kept for a replay, or what is stored, whichever has more moments."""
        finest = trace if len(trace) > len(film) else film
        told = replace(finest, contacts=film.contacts, bodies=film.bodies, sensors=trace.sensors)
        return cls(scene, told, sensors, twists)

    @cached_property
    def bodies(self) -> Mapping[str, FloatArray]:
        """Name -> (T, 7) x, y, z in m and quaternion x, y, z, w, world frame; of bodies that may move."""
        found = {}
        for name, record in self.trace.bodies.items():
            # Where it was not looked at, it is as just before.
            rows = np.searchsorted(record.time, self.trace.time + TIME_EPSILON, side="right") - 1
            found[name] = np.column_stack((record.position_xyz, record.orientation_xyzw))[rows.clip(0)]
        return found
