"""Joint targets over time: `joints: [{at: 2 s, position: {elbow: 90 deg}}]`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Annotated

from pydantic import Field

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.commands.joint_path import BLENDS, Interpolation, JointPath
from sim_action.commands.joint_points import JointPoint, in_si, knots
from sim_action.commands.joint_problems import misfits, order_problems, two_kinds_problems
from sim_action.core.field_types import PositiveHertz
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import Reading
from sim_action.state.command import JointTargets
from sim_action.world.scene import Scene


class JointCommands(CommandSource):
    """Moves joints through points in time: by position, by velocity or by effort.

    Every joint goes its own way, through the points that name it; the others do not concern it. At 0 s it begins where
    the joint does (`robot.joints`), a velocity or an effort with 0, unless a point at 0 s says otherwise. So it is on
    its way to its first point from 0 s on; to let it wait, give it a point where it waits. After its last point it
    stays as it is there. A joint is given positions, or velocities, or efforts, not some of each.

    Between two points, `linear` is a straight line. `minimum_jerk` begins and ends at rest, in every point that names
    the joint, also in those that it only passes through; half way it is at its fastest, 1.875 times as fast as the
    straight line. `hold` is a step at each point.

    Positions are held by a servo, which may use the effort and the velocity that the model allows; it is told how fast
    its target moves on, so that the joint does not fall behind. Velocities are held by a motor with the same effort.
    An effort is applied as it is: nothing else holds such a joint, from 0 s on. While the robot comes to rest before
    0 s, joints with positions are held where they begin, and those with velocities are braked.

    Positions, speeds and efforts that are beyond the limits of the model are errors before anything is run. What a
    tick says holds until the next one: with a higher `rate`, curves are finer.
    """

    points: Annotated[tuple[JointPoint, ...], Field(alias="joints", min_length=1, description="in rising time")]
    interpolation: Annotated[Interpolation, Field(description="the way from one point to the next")] = "linear"
    # It divides what people have as rate of the physics, such as 200, 240 and 1000 Hz.
    rate: Annotated[PositiveHertz, Field(description="of the ticks at which a command is given")] = 40.0

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Points that are not in rising time, joints that are given two kinds of targets."""
        yield from order_problems(self.points)
        yield from two_kinds_problems(self.points)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems."""
        yield from misfits(self.points, BLENDS[self.interpolation], scene)

    def joints(self, scene: Scene) -> frozenset[str]:
        """See CommandSource.joints."""
        return frozenset(knot.joint for knot in knots(self.points))

    def _holding(self, scene: Scene) -> JointTargets:
        """Positions where the joints begin, and speeds at 0."""
        beginnings = scene.joint_positions
        return JointTargets(
            position={knot.joint: beginnings[knot.joint] for knot in knots(self.points) if knot.reading == "position"},
            velocity={knot.joint: 0.0 for knot in knots(self.points) if knot.reading == "velocity"},
        )

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open."""
        paths, jumps, last = self._paths(scene), BLENDS[self.interpolation].jumps, self.points[-1].at
        period = 1 / self.rate
        # A servo goes after its target step by step, and the first step of a tick begins at the tick.
        half_way, half_time = (0.0, 0.0) if jumps else ((period - 1 / scene.physics.rate) / 2, period / 2)

        positions_at = lru_cache(maxsize=2)(partial(_values, paths["position"]))  # a tick begins where another ended

        def command(time: float) -> JointTargets | None:
            if time > last + period:
                return None  # all stay as they are
            now = _tick(time)
            here = positions_at(now)
            speeds = {} if jumps else _mean_speeds(here, positions_at(_tick(time + period)), period)
            return JointTargets(
                position=_values(paths["position"], now + half_way) if half_way else here,
                velocity={**speeds, **_values(paths["velocity"], now + half_time)},
                effort=_values(paths["effort"], now + half_time),
            )

        return OpenLoop(command, self._holding(scene))

    def _paths(self, scene: Scene) -> dict[Reading, dict[str, JointPath]]:
        """What is wanted -> joint name -> its path."""
        beginnings = scene.joint_positions
        ways: dict[tuple[Reading, str], dict[float, float]] = {}
        for knot in knots(self.points):
            beginning = beginnings[knot.joint] if knot.reading == "position" else 0.0
            ways.setdefault((knot.reading, knot.joint), {0.0: beginning})[knot.time] = in_si(scene, knot)
        paths: dict[Reading, dict[str, JointPath]] = {"position": {}, "velocity": {}, "effort": {}}
        for (reading, joint), way in ways.items():
            paths[reading][joint] = JointPath(tuple(way), tuple(way.values()), BLENDS[self.interpolation])
        return paths


def _values(paths: Mapping[str, JointPath], time: float) -> dict[str, float]:
    return {name: path.value(time) for name, path in paths.items()}


def _mean_speeds(here: Mapping[str, float], there: Mapping[str, float], period: float) -> dict[str, float]:
    return {name: (there[name] - value) / period for name, value in here.items()}


def _tick(time: float) -> float:
    """A tick that falls on a point belongs to what follows it, whatever the rounding of either."""
    return round(time, 9) + 1e-9
