"""Move bodies and apply forces between two steps: the protocol of engines, commands of robots, and events of the world.

Timed events of the world are bodies on paths, bodies and patches that appear, disturbances, and payloads. Before t = 0,
while the robot settles, bodies wait at the start of their paths and nothing else happens.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, Protocol, Self

from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Twist, Vector3
from sim_action.core.records import dataclass
from sim_action.core.units import first_step
from sim_action.robot.model.kinematics import link_of_frame
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import WORLD_FRAME, BasePush, LinkWrench
from sim_action.state.timeline import waits
from sim_action.world import Body, Disturbance, Patch, World
from sim_action.world.body import PosePath
from sim_action.world.scene import Scene

MAX_ATTRACTION_M: Final = 0.001  # shapes that are farther apart do not attract each other


class Target(NamedTuple):
    """The name of a link of the robot or of a body of the world."""

    name: str
    is_link: bool


class BodyControl(Protocol):
    """Access to the bodies of a scene between two steps."""

    def pose(self, body: str) -> Pose:
        """Return the pose of a body's centre, world frame."""

    def set_pose(self, body: str, pose: Pose, twist: Twist) -> None:
        """Set pose and twist of a body; without a mass, the twist acts only on what touches it in the next step."""

    def apply_force(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        """Add a force in N and a torque in N m, world frame, for the next step.

        `point_xyz`: where the force acts, in m, in the frame of the target; None: its centre of mass.
        """

    def attract(self, target: Target, force: float) -> None:
        """Pull a target and each thing that touches it together for the next step, with a force in N per pair."""

    def clear_forces(self) -> None:
        """Remove all forces and torques; called after a step."""

    def add_mass(self, link: str, mass: float) -> None:
        """Add a mass in kg to a link at its centre of mass, for good; a negative one is taken from it."""

    def scale_friction(self, patch: int, factor: float) -> None:
        """Multiply the friction of the patch of the ground with this index."""

    def add_velocity(self, target: Target, velocity_xyz: Vector3) -> None:
        """Add a velocity in m/s, world frame, to a body; to the whole robot if the target is its base link."""


class HeldWrenches:
    """The wrenches of controllers on links, which act at every step until others replace them."""

    def __init__(self, control: BodyControl, link_pose: Callable[[str], Pose], model: RobotModel) -> None:
        """`link_pose`: returns the present pose of a link."""
        self._control, self._link_pose, self._model = control, link_pose, model
        self.held: tuple[LinkWrench, ...] = ()

    def apply(self) -> None:
        """Add all wrenches for the next step, turned into the world frame by the present poses."""
        turns: dict[str, Quaternion] = {WORLD_FRAME: geometry.IDENTITY}
        for wrench in self.held:
            if wrench.frame not in turns:
                turns[wrench.frame] = self._link_pose(link_of_frame(self._model, wrench.frame)).orientation_xyzw
            turn = turns[wrench.frame]
            force, torque = geometry.rotate(turn, wrench.force_xyz), geometry.rotate(turn, wrench.torque_xyz)
            self._control.apply_force(Target(wrench.link, is_link=True), force, torque, wrench.point_xyz)


@dataclass(frozen=True, slots=True)
class RobotInertia:
    """The mass and the yaw inertia of a whole robot."""

    mass: float  # kg
    # lower bound in kg m^2 about the vertical axis through the base. A servo with too small an inertia still reaches
    # its velocity and does not oscillate.
    inertia: float


@dataclass(frozen=True, slots=True)
class Wrench:
    """A force in N at a point in m, and a torque in N m; world frame."""

    force_xyz: Vector3
    point_xyz: Vector3
    torque_xyz: Vector3


def base_wrench(push: BasePush, robot: RobotInertia, pose: Pose, twist: Twist, time_step: float) -> Wrench:
    """Return the wrench that brings the base, at `pose` with `twist`, to its target velocity, within its limits."""
    yaw = pose.yaw
    (ahead, left), (has_x, has_y, _) = push.linear_xy, twist.linear_xyz
    x, y = math.cos(yaw) * ahead - math.sin(yaw) * left, math.sin(yaw) * ahead + math.cos(yaw) * left
    needed = robot.mass * (x - has_x) / time_step, robot.mass * (y - has_y) / time_step
    part = min(1.0, push.max_force / (math.hypot(*needed) or 1.0))
    torque = robot.inertia * (push.angular_z - twist.angular_xyz[2]) / time_step
    return Wrench(
        force_xyz=(part * needed[0], part * needed[1], 0.0),
        point_xyz=geometry.compose(pose, Pose(push.point_xyz)).position_xyz,
        torque_xyz=(0.0, 0.0, max(-push.max_torque, min(push.max_torque, torque))),
    )


_AT_REST: Final = Twist()
# Height at which absent bodies are parked, out of reach of contacts and sensors; each has a place of its own.
_PARKING_HEIGHT_M: Final = 1e6


class _Mover(Protocol):
    def reach(self, step: int) -> None:
        """Move the body to its place at a step."""

    def follow(self, world: World) -> None:
        """Take the times of a world, which differ from those before only after the present step."""


class WorldEvents:
    """All events of one scene. The engine calls it before and after each step, in order."""

    def __init__(self, scene: Scene, control: BodyControl, movers: Sequence[_Mover]) -> None:
        self._scene, self._control, self._movers = scene, control, movers
        self._disturbances = [_Acting(acts, scene) for acts in scene.world.disturbances if acts.payload is None]
        self._reached: int | None = None
        self.after_step(-1)

    @classmethod
    def of(cls, scene: Scene, control: BodyControl, *, drives_surfaces: bool = False) -> Self | None:
        """Return the events of a scene at its start, or None; `drives_surfaces`: the engine moves no belts itself."""
        rate, objects = scene.physics.rate, scene.world.objects
        travels = [_Travel(control, body, rate) for body in objects if body.path]
        absent = [body for body in objects if body.appears is not None or body.disappears is not None]
        movers: list[_Mover] = [
            *travels,
            *(_Absence(control, body, rate, number) for number, body in enumerate(absent, start=1)),
            *(
                _Payload(control, index, load, scene)
                for index, load in enumerate(scene.world.disturbances)
                if load.payload is not None
            ),
        ]
        belts = [body for body in objects if body.surface_velocity is not None and drives_surfaces]
        movers += [_Belt(control, body, rate) for body in belts]
        movers += [
            _Ice(control, index, patch, scene)
            for index, patch in enumerate(scene.world.patches)
            if patch.appears is not None
        ]
        return cls(scene, control, movers) if movers or scene.world.disturbances else None

    def follow(self, world: World) -> None:
        """Take the times of a world in which something has happened; its parts are the same as before."""
        self._disturbances = [_Acting(acts, self._scene) for acts in world.disturbances if acts.payload is None]
        for mover in self._movers:
            mover.follow(world)

    def before_step(self, step: int) -> None:
        """Apply the disturbances from this state to the next, with every body at its pose of this state."""
        if self._reached != step:
            self._reach(step)
        for disturbance in self._disturbances:
            if disturbance.first <= step < disturbance.last:
                disturbance.act(step, self._control)

    def after_step(self, step: int) -> None:
        """Remove the forces of the step that has ended and move the bodies to their poses of this state."""
        if self._disturbances:
            self._control.clear_forces()
        self._reach(step)

    def _reach(self, step: int) -> None:
        self._reached = step
        for mover in self._movers:
            mover.reach(step)


class _Travel(_Mover):
    """A body on its path."""

    def __init__(self, control: BodyControl, body: Body, rate: float) -> None:
        self._control, self._name, self._rate = control, body.name, rate
        # Only the engine knows the height of a body that was placed onto the ground.
        self._height = control.pose(body.name).position_xyz[2]
        self._path = self._path_of(body)
        self._ahead = -1, self._path.pose(0.0)
        self._rests = False

    def _path_of(self, body: Body) -> PosePath:
        start = body.pose.model_copy(update={"z": self._height})
        return PosePath.of(start, body.path, loops=body.loop, pace=body.pace)

    @override
    def follow(self, world: World) -> None:
        self._path = self._path_of(_body(world, self._name))

    @override
    def reach(self, step: int) -> None:
        pose_step, pose = self._ahead
        current = pose if pose_step == step else self._path.pose(step / self._rate)
        ahead = self._path.pose((step + 1) / self._rate)
        self._ahead = step + 1, ahead
        if current == ahead and self._rests:
            return
        self._rests = current == ahead
        self._control.set_pose(self._name, current, geometry.twist_between(current, ahead, 1 / self._rate))


def _body(world: World, name: str) -> Body:
    return next(body for body in world.objects if body.name == name)


class _Belt(_Mover):
    """A body that stands still and carries what touches it, from 0 s on.

    A round one turns indeed: PyBullet keeps contacts of cylinders over several steps, at their places on the body.
    """

    def __init__(self, control: BodyControl, body: Body, rate: float) -> None:
        assert body.surface_velocity is not None
        self._control, self._name, self._pose = control, body.name, control.pose(body.name)
        own, turn = body.surface_velocity.twist, self._pose.orientation_xyzw
        self._twist = Twist(geometry.rotate(turn, own.linear_xyz), geometry.rotate(turn, own.angular_xyz))
        self._turn = body.surface_velocity.angular / rate if body.shape in ("cylinder", "sphere") else 0.0

    @override
    def reach(self, step: int) -> None:
        turned = Pose(geometry.ZERO, geometry.quaternion_from_rpy(0.0, 0.0, self._turn * max(step, 0)))
        at = geometry.compose(self._pose, turned)
        self._control.set_pose(self._name, at, self._twist if step >= 0 else _AT_REST)

    @override
    def follow(self, world: World) -> None:
        """Do nothing: a belt has no times."""


class _Absence(_Mover):
    """A body that is absent before or after a time."""

    def __init__(self, control: BodyControl, body: Body, rate: float, number: int) -> None:
        self._control, self._name, self._rate = control, body.name, rate
        self._first, self._last = body.presence(rate)
        self._pose = control.pose(body.name)
        x, y, _ = self._pose.position_xyz
        self._away = Pose((x, y, number * _PARKING_HEIGHT_M), self._pose.orientation_xyzw)
        self._is_there = body.appears is None

    @override
    def reach(self, step: int) -> None:
        is_there = self._first <= step < self._last
        if not is_there or not self._is_there:
            self._control.set_pose(self._name, self._pose if is_there else self._away, _AT_REST)
        self._is_there = is_there

    @override
    def follow(self, world: World) -> None:
        self._first, self._last = _body(world, self._name).presence(self._rate)


class _Ice(_Mover):
    """A patch of the ground that gets its own friction at a step."""

    def __init__(self, control: BodyControl, index: int, patch: Patch, scene: Scene) -> None:
        self._rate, ground = scene.physics.rate, scene.world.ground
        self._control, self._index, self._factor = control, index, patch.friction / ground.friction
        self._first = first_step(patch.appears or 0.0, self._rate)
        self._is_there = False

    @override
    def reach(self, step: int) -> None:
        if not self._is_there and step >= self._first:
            self._is_there = True
            self._control.scale_friction(self._index, self._factor)

    @override
    def follow(self, world: World) -> None:
        self._first = first_step(world.patches[self._index].appears or 0.0, self._rate)


class _Payload(_Mover):
    """A load on a link from a step until another."""

    def __init__(self, control: BodyControl, index: int, load: Disturbance, scene: Scene) -> None:
        self._control, self._index, self._rate = control, index, scene.physics.rate
        self._link, self._mass = load.link or scene.load_link, load.payload or 0.0
        self._is_there = False
        self.follow(scene.world)

    @override
    def follow(self, world: World) -> None:
        load = world.disturbances[self._index]
        self._first = first_step(load.at, self._rate)
        self._last = math.inf if load.duration is None else first_step(load.end, self._rate)

    @override
    def reach(self, step: int) -> None:
        if self._is_there != (self._first <= step < self._last):
            self._control.add_mass(self._link, -self._mass if self._is_there else self._mass)
            self._is_there = not self._is_there


class _Acting:
    """A disturbance that acts in the steps from `first` up to, but not including, `last`."""

    def __init__(self, disturbance: Disturbance, scene: Scene) -> None:
        self._disturbance, self._rate = disturbance, scene.physics.rate
        name = disturbance.body or scene.model.link_of(disturbance.link or scene.model.root)
        self._target = Target(name, is_link=disturbance.body is None)
        pushes = disturbance.velocity is not None
        self.first: float = math.inf
        if not waits(disturbance.at):
            self.first = first_step(disturbance.at, self._rate) if pushes else int(disturbance.at * self._rate)
        self.last = self.first + 1 if pushes else math.inf
        if math.isfinite(disturbance.end) and not pushes:
            self.last = first_step(disturbance.end, self._rate)

    def act(self, step: int, control: BodyControl) -> None:
        """Apply the disturbance from this step to the next."""
        disturbance = self._disturbance
        if disturbance.velocity is not None:
            control.add_velocity(self._target, disturbance.velocity)
            return
        begins, ends = self._disturbance.at * self._rate, self._disturbance.end * self._rate
        share = max(0.0, min(ends, step + 1.0) - max(begins, float(step)))
        if disturbance.adhesion is not None:
            control.attract(self._target, disturbance.adhesion * share)
            return
        force, torque = (
            geometry.scale(vector or geometry.ZERO, share) for vector in (disturbance.force, disturbance.torque)
        )
        control.apply_force(self._target, force, torque, disturbance.point)
