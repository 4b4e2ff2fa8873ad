"""The data of a run from which its recordings are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.scenario.model import Scenario
from sim_action.sensors import MountedSensor
from sim_action.state.command import LinkWrench
from sim_action.state.trace import Trace
from sim_action.state.trace_records import CommandedTwists
from sim_action.world import Body, placed
from sim_action.world.scene import Scene


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A run with T moments."""

    scene: Scene
    trace: Trace  # T moments, with contacts, bodies that may move or appear, and stored sensor readings
    sensors: tuple[MountedSensor, ...] = ()  # all sensors of the robot, with and without stored readings
    twists: CommandedTwists = field(default_factory=CommandedTwists)  # the commanded twists of the base
    links: tuple[str, ...] = ()  # the links whose motion text formats have, see `trace.links` of a scenario
    # the times in s at which wrenches on links were commanded, and all wrenches from then on
    wrenches: Sequence[tuple[float, tuple[LinkWrench, ...]]] = ()
    # name of each other robot of the world -> its trace at the moments of a replay
    actors: Mapping[str, Trace] = field(default_factory=dict)

    @classmethod
    def of(cls, scene: Scene, film: Trace, trace: Trace, scenario: Scenario, twists: CommandedTwists) -> Self:
        """Combine the trace for the replay (`film`) and the stored trace; the poses come from the finer one."""
        finest = trace if len(trace) > len(film) else film
        combined = replace(finest, contacts=film.contacts, bodies=film.bodies, sensors=trace.sensors)
        return cls(scene, combined, scenario.sensors, twists, scenario.trace.links)

    @cached_property
    def bodies(self) -> Mapping[str, FloatArray]:
        """Name -> (T, 7) x, y, z in m and quaternion x, y, z, w, world frame, for bodies that may move or appear.

        The values are NaN until a body appears.
        """
        poses_by_body = {}
        for name, record in self.trace.bodies.items():
            # Between two records, a body keeps the last recorded pose.
            rows = np.searchsorted(record.time, self.trace.time + TIME_EPSILON_S, side="right") - 1
            poses_by_body[name] = np.column_stack((record.position_xyz, record.orientation_xyzw))[rows.clip(0)]
        for body in self.scene.world.objects:
            if body.appears is not None or body.disappears is not None:
                poses = poses_by_body[body.name] if body.name in poses_by_body else self._fixed(body)
                rate = self.scene.physics.rate
                first, gone = (step / rate - TIME_EPSILON_S for step in body.presence(rate))
                is_there: NDArray[np.bool_] = (self.trace.time >= first) & (self.trace.time < gone)
                poses_by_body[body.name] = np.where(is_there[:, None], poses, np.nan)
        return poses_by_body

    def _fixed(self, body: Body) -> FloatArray:
        pose = placed(body, self.scene.parts_of(body))
        return np.tile((*pose.position_xyz, *pose.orientation_xyzw), (len(self.trace), 1))
