"""The pictures of a film, one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.units import TIME_EPSILON
from sim_action.recording.export.film.digits import write
from sim_action.recording.export.film.follow_camera import FollowCamera
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.kinematics import link_poses
from sim_action.sensors.rendering.appearance import Part, robot_parts, world_parts
from sim_action.sensors.rendering.picture import Placed, draw
from sim_action.world import placed

MOST_PICTURES: Final = 1_200
"""A minute of 20 pictures a second. What lasts longer is shown faster."""


def pictures(run: RecordedRun, rate: int) -> Iterator[NDArray[np.uint8]]:
    """(H, W, 3) each, for so many in a second of the film. Raises OSError if a mesh of the robot is gone."""
    moments, speed = shown_moments(run.trace.time, rate)
    stage = _Stage(run)
    for moment in moments:
        picture = stage.picture(moment)
        write(picture, f"{run.trace.time[moment]:.1f} s" + (f" x{speed}" if speed > 1 else ""))
        yield picture


def shown_moments(time: NDArray[np.float64], rate: int) -> tuple[list[int], int]:
    """The moments that are shown, the last of them at the end, and how many times too fast the film runs."""
    duration = float(time[-1] - time[0])
    speed = max(1, int(np.ceil(duration * rate / MOST_PICTURES)))
    wanted = np.append(np.arange(time[0], time[-1] - TIME_EPSILON, speed / rate), time[-1])
    return (np.searchsorted(time, wanted + TIME_EPSILON, side="right") - 1).tolist(), speed


class _Stage:
    """The robot and its world, ready to be placed."""

    def __init__(self, run: RecordedRun) -> None:
        scene = run.scene
        self._run = run
        self._robot = list(robot_parts(scene.model))
        world = list(world_parts(scene))
        self._moving = [part for part in world if part.owner in run.bodies]
        fixed = {body.name: placed(body, scene.parts_of(body)) for body in scene.world.objects}
        self._fixed = _placed((part for part in world if part.owner not in run.bodies), fixed)
        self._camera = FollowCamera.of(scene.model, self._base(0))
        self._pinhole = self._camera.pinhole

    def picture(self, moment: int) -> NDArray[np.uint8]:
        base = self._base(moment)
        bodies = self._bodies(moment)
        moving = _placed((part for part in self._moving if part.owner in bodies), bodies)
        solids = [*self._fixed, *moving, *self._placed_robot(base, moment)]
        return draw(self._pinhole, self._camera.pose(base.position_xyz), solids).rgb.copy()

    def _base(self, moment: int) -> Pose:
        trace = self._run.trace
        return _pose([*trace.base_position_xyz[moment].tolist(), *trace.base_orientation_xyzw[moment].tolist()])

    def _bodies(self, moment: int) -> dict[str, Pose]:
        """Those that are there."""
        found = {name: track[moment] for name, track in self._run.bodies.items()}
        return {name: _pose(numbers.tolist()) for name, numbers in found.items() if np.isfinite(numbers).all()}

    def _placed_robot(self, base: Pose, moment: int) -> list[Placed]:
        model, trace = self._run.scene.model, self._run.trace
        told = dict(zip(trace.joint_names, trace.joint_position[moment].tolist(), strict=True))
        links = link_poses(model, {**model.positions({}), **told})
        frames = {name: geometry.compose(base, pose) for name, pose in links.items()}
        return _placed(self._robot, frames)


def _placed(parts: Iterable[Part], frames: dict[str, Pose]) -> list[Placed]:
    return [Placed(part.solid, geometry.compose(frames[part.owner], part.pose), part.colour) for part in parts]


def _pose(numbers: Sequence[float]) -> Pose:
    x, y, z, qx, qy, qz, qw = numbers
    return Pose((x, y, z), (qx, qy, qz, qw))
