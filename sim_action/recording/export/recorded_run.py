"""What was kept of a run for its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.units import TIME_EPSILON_S, first_step
from sim_action.sensors import MountedSensor
from sim_action.state.trace import FloatArray, Trace
from sim_action.state.trace_records import CommandedTwists
from sim_action.world import Body, placed
from sim_action.world.scene import Scene


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A run over T moments.

    Attributes:
        trace: T moments, with contacts, bodies that may move or appear, and the readings of sensors that are kept.
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
        """Name -> (T, 7) x, y, z in m and quaternion x, y, z, w, world frame; of bodies that may move or appear.

        Not a number until they appear: before that, an engine has them anywhere.
        """
        found = {}
        for name, record in self.trace.bodies.items():
            # Where it was not looked at, it is as just before.
            rows = np.searchsorted(record.time, self.trace.time + TIME_EPSILON_S, side="right") - 1
            found[name] = np.column_stack((record.position_xyz, record.orientation_xyzw))[rows.clip(0)]
        for body in self.scene.world.objects:
            if body.appears is not None:
                poses = found[body.name] if body.name in found else self._fixed(body)
                found[body.name] = np.where(self._is_there(body.appears)[:, None], poses, np.nan)
        return found

    def _is_there(self, appears: float) -> NDArray[np.bool_]:
        rate = self.scene.physics.rate
        return self.trace.time >= first_step(appears, rate) / rate - TIME_EPSILON_S

    def _fixed(self, body: Body) -> FloatArray:
        pose = placed(body, self.scene.parts_of(body))
        return np.tile((*pose.position_xyz, *pose.orientation_xyzw), (len(self.trace), 1))
