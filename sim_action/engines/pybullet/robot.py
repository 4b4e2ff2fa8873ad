"""A robot in PyBullet: its links, joints, motors and state, and what it touches.

It corrects these properties of PyBullet: base poses refer to the centre of mass, joints start with a motor switched
on, and torques last for one step.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from struct import Struct
from typing import TYPE_CHECKING, Final

import numpy as np
import pybullet
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.records import replace
from sim_action.drives.wheels import held_joints
from sim_action.engines.body_control import HeldWrenches
from sim_action.engines.clearances import RobotMotionBound
from sim_action.engines.engine import NO_CHANNELS, UNLIMITED_EFFORT, RobotQueries, link_of
from sim_action.engines.joint_stops import JointStops
from sim_action.engines.observers import LazyContacts, PathContacts
from sim_action.engines.pybullet.bodies import (
    BasePusher,
    Contacts,
    Distances,
    PyBulletBodyControl,
    cast_rays,
    hide_from_rays,
    in_link_frame,
    link_pose,
    link_twist,
)
from sim_action.engines.pybullet.loaded_bodies import BASE, add_rotor, load_robot, place, set_surfaces
from sim_action.robot.model.kinematics import LinkStates
from sim_action.robot.model.robot_model import Mimic, RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.observation import ByName, Contact, JointState, Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.engines.pybullet.colliding_links import SelfCollision
    from sim_action.engines.pybullet.passive_joints import BallJoints, Springs
    from sim_action.engines.pybullet.sliding import SlidingWheels


class LoadedRobot(RobotQueries):
    """A robot in a connection; the engine is the robot under test."""

    def __init__(
        self, client: int, ground: int, scene: Scene, channels: Channels = NO_CHANNELS, *, number: int = 0
    ) -> None:
        """Load the robot of a scene; `number`: in the world, 0 for the tested one. Raises pybullet.error, OSError."""
        self._client, self._ground, self._rate, self._model = client, ground, scene.physics.rate, scene.model
        self._robot = load_robot(client, scene)
        self._lazy_contacts = LazyContacts()
        base = scene.model.links_by_name[scene.model.root]
        self._seen = hide_from_rays(client, self._robot, number, fixed=scene.bolted or base.mass == 0)
        self._read_joints(scene)
        self.notes = self._calm(scene)
        self._self_collision = self._collision_of_links(scene, channels)
        self._place_robot(scene)
        self._path_contacts: PathContacts | None = None
        self._touches: list[Contact] = []
        self.others: Mapping[str, LoadedRobot] = {}
        """The other robots of the world by name, as this one sees them."""

    @property
    def piece(self) -> tuple[int, Pose]:
        """The number of the robot, and the centre of mass of its base in the frame of the link: see `add_object`."""
        return self._robot, self._states.com_in_link

    def held_links(self, scene: Scene) -> Iterator[tuple[int, int]]:
        """Yield the number of the robot and the index of each link that cannot move."""
        return ((self._robot, self._links[link]) for link in scene.bolted_links)

    def meet(
        self, scene: Scene, objects: Mapping[str, Sequence[tuple[int, Pose]]], names: Mapping[int, str], *tiles: int
    ) -> None:
        """Take what the robot can touch, which gives it the control of all bodies.

        `objects`: body -> the number and pose of each of its pieces; `names`: number -> name of the body; `tiles`: of
        the ground.
        """
        self._objects, self._body_names = objects, names
        self._sliding = self._sliding_wheels(scene) if scene.scrubbing else None
        self._control = PyBulletBodyControl(
            self._client, self._robot, self._links, objects, tiles=tiles, sliding=self._sliding
        )
        self._wrenches = HeldWrenches(self._control, self.link_pose, scene.model)
        self._contacts = Contacts(self._client, self._robot, self._link_names, names)

    @override
    def observe(self, step: int, *, contacts: bool) -> Observation:
        present = self._lazy_contacts.present(lambda: self._present_contacts(step, ground=True)) if contacts else ()
        return self._states.observe(step, self._model, present)

    @override
    def link_pose(self, link: str) -> Pose:
        index = self._links[link]
        return self._base_now()[0] if index == BASE else link_pose(self._client, self._robot, index)

    @override
    def link_twist(self, link: str) -> Twist:
        index = self._links[link]
        return self._base_now()[1] if index == BASE else link_twist(self._client, self._robot, index)

    @override
    def body_pose(self, body: str) -> Pose:
        return link_of(body, self.others) or self._control.pose(body)

    @override
    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        return cast_rays(self._client, start_xyz, ends_xyz, self._seen)

    @override
    def collect(self) -> Trace:
        touches = tuple(self._touches)
        self._touches = []
        return replace(self._states.collect(), contacts=touches) if touches else self._states.collect()

    @property
    def keep(self) -> Callable[[int], None]:
        """The function that keeps the present state as the state of a step; it is called at every step."""
        return self._states.keep

    def keep_touches(self, step: int) -> None:
        """Keep the present contacts with all but the ground as contacts of a step."""
        self._touches += self._present_contacts(step, ground=False)

    def last_place(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the pose (7,) of the centre of mass of the base and the joint positions (J,) of the last step."""
        row = self._states.last()
        return row[1:8], row[14 : 14 + len(self._joint_names)]

    def motion_bound(self) -> Callable[[], float]:
        """Return a function that bounds how far any point has moved since the last call, in m."""
        bound = RobotMotionBound(self._model, Distances(self._client, self._robot, self._link_names, {}).radii())
        return lambda: bound.advance(*self.last_place())

    def settle(self) -> None:
        """Read the contacts that somebody may still access, before the next step."""
        self._lazy_contacts.settle()

    def _base_now(self) -> tuple[Pose, Twist]:
        position, orientation = pybullet.getBasePositionAndOrientation(self._robot, self._client)
        linear, angular = pybullet.getBaseVelocity(self._robot, self._client)
        return self._states.base_of((*position, *orientation, *linear, *angular))

    def has_forces(self) -> bool:
        """Return True if forces act that PyBullet forgets after each step."""
        is_pushed = self._pusher.push is not None or bool(self._wrenches.held)
        return is_pushed or bool(self._held_efforts) or self._springs is not None or self._sliding is not None

    def apply_forces(self, step: int) -> None:
        """Apply the forces that PyBullet forgets after each step."""
        if self._held_efforts or self._springs:
            efforts = self._springs.added_to(self._held_efforts) if self._springs else self._held_efforts
            self._motors(pybullet.TORQUE_CONTROL, efforts, forces=list(efforts.values()))
        if self._pusher.push is not None:
            state = self.observe(step, contacts=False)
            self._pusher.step(state.pose, state.twist)
        if self._wrenches.held:
            self._wrenches.apply()
        if self._sliding is not None:
            self._sliding.correct()

    def _read_joints(self, scene: Scene) -> None:
        count = pybullet.getNumJoints(self._robot, self._client)
        infos = [pybullet.getJointInfo(self._robot, index, self._client) for index in range(count)]
        self._link_names = {BASE: scene.model.root, **{info[0]: info[12].decode() for info in infos}}
        self._links = {name: index for index, name in self._link_names.items()}
        self._is_damped = any(info[2] != pybullet.JOINT_FIXED and info[6] > 0 for info in infos)
        by_name = {info[1].decode(): info for info in infos}
        self._joint_names = tuple(joint.name for joint in scene.model.moving_joints)
        self._motor_names = tuple(joint.name for joint in scene.model.motor_joints)
        self._index = {name: by_name[name][0] for name in self._motor_names}
        self._friction = {name: by_name[name][7] for name in self._motor_names}
        self._max_effort = {name: by_name[name][10] or UNLIMITED_EFFORT for name in self._motor_names}
        self._max_velocity = {name: by_name[name][11] for name in self._motor_names}
        # Per joint, the arguments of its servo that stay the same: few calls, because targets move at every step.
        self._servos: dict[str, dict[str, float]] = {}
        self._springs = self._springs_of(scene.model)
        self._balls = self._ball_joints({name: by_name[name][0] for name in scene.model.balls})
        links = scene.model.links_by_name
        surfaces = {index: links[name].surface for index, name in self._link_names.items()}
        set_surfaces(self._client, self._robot, surfaces)
        for name, inertia in scene.rotors.items():
            axis = scene.model.joints_by_name[name].axis_xyz
            add_rotor(self._client, self._robot, self._index[name], axis, inertia)
        self._held_efforts: dict[int, float] = {}
        motors, balls = self._index.values(), self._balls
        self._states = StateRecorder(
            self._client, self._robot, self._joint_names, motors, balls, rate=self._rate, efforts=self._held_efforts
        )
        self._states.stops = JointStops.of(scene.model, range(len(self._motor_names)))
        self._pusher = BasePusher(self._client, self._robot, self._rate)

    def _ball_joints(self, numbers: Mapping[str, int]) -> BallJoints | None:
        if not numbers:
            return None
        from sim_action.engines.pybullet.passive_joints import BallJoints  # a usual run does without it

        return BallJoints(self._client, self._robot, numbers)

    def _collision_of_links(self, scene: Scene, channels: Channels) -> SelfCollision | None:
        if not (scene.robot.self_collision or channels.self_contacts):
            return None
        from sim_action.engines.pybullet.colliding_links import SelfCollision  # a usual run does without it

        return SelfCollision.of(scene, self._client, self._robot, self._links, self._index)

    def _springs_of(self, model: RobotModel) -> Springs | None:
        sprung = {self._index[joint.name]: joint for joint in model.motor_joints if joint.stiffness}
        if not sprung:
            return None
        from sim_action.engines.pybullet.passive_joints import Springs  # a usual run does without it

        return Springs(self._client, self._robot, sprung)

    def _coupled(self, model: RobotModel) -> dict[str, Mimic]:
        """Couple the followers of joints; return each leader whose motor acts on another joint -> that joint."""
        if all(joint.mimic is None for joint in model.motor_joints):
            return {}
        from sim_action.engines.pybullet.passive_joints import couple  # a usual run does without it

        carriers = couple(self._client, self._robot, model, self._index)
        for leader, gear in carriers.items():
            ratio = abs(gear.multiplier)
            self._max_effort[gear.joint] = self._max_effort[leader] / ratio
            self._max_velocity[gear.joint] = self._max_velocity[leader] * ratio
        places = {name: place for place, name in enumerate(self._motor_names)}
        self._states.carriers = [
            (places[leader], places[gear.joint], gear.multiplier) for leader, gear in carriers.items()
        ]
        return carriers

    def _calm(self, scene: Scene) -> tuple[str, ...]:
        """Change damped joints so that no damping adds energy, and return the notes about them."""
        if not self._is_damped:
            return ()
        from sim_action.engines.pybullet.passive_joints import calm  # a usual run does without it

        return calm(self._client, self._robot, scene.physics.rate, bolted=scene.bolted)

    def _sliding_wheels(self, scene: Scene) -> SlidingWheels:
        from sim_action.engines.pybullet.sliding import SlidingWheels  # a usual run does without it

        scrubbing = [self._links[name] for name in scene.scrubbing]
        objects = scene.world.objects
        moving = [body.name for body in objects if body.mass is not None or body.path or body.surface_velocity]
        moving += (name for name in scene.actors if name in self._objects)
        movers = [number for name in moving for number, _ in self._objects[name]]
        return SlidingWheels(self._client, self._robot, scrubbing, movers)

    def _place_robot(self, scene: Scene) -> None:
        positions, held = scene.joint_positions, held_joints(scene.model)
        if self._balls is not None:
            self._balls.release([positions[joint.name] for joint in scene.model.moving_joints if joint.ball])
        for name, number in self._index.items():
            pybullet.resetJointState(self._robot, number, positions[name], physicsClientId=self._client)
            # Switches the default motor off; only the joint's own friction remains.
            self._motor(name, pybullet.VELOCITY_CONTROL, force=self._friction[name])
        self._carriers = self._coupled(scene.model)
        for name, fastest in self._max_velocity.items():
            self._servos[name] = {
                "bodyUniqueId": self._robot,
                "jointIndex": self._index[name],
                "controlMode": pybullet.POSITION_CONTROL,
                "physicsClientId": self._client,
                **({"maxVelocity": fastest} if fastest > 0 else {}),
            }
        self.apply(JointTargets({name: positions[name] for name in self._motor_names if name in held}))
        place(self._client, self._robot, self._ground, scene.placement, self._states.com_in_link)

    def apply(self, targets: JointTargets) -> None:
        """Pass targets to the motors, which keep them until the next ones."""
        self._pusher.push = targets.base or self._pusher.push
        if targets.wrenches is not None:
            self._wrenches.held = targets.wrenches
        if self._held_efforts:
            for name in targets.names():
                self._held_efforts.pop(self._index[name], None)
        if self._carriers:
            targets = self._carried(targets)
        turned, limits = targets.velocity, self._max_effort
        if targets.max_effort:
            limits = {**limits, **targets.max_effort}
        if targets.position:
            turned = {name: speed for name, speed in turned.items() if name not in targets.position}
        if turned:
            indices, forces = [self._index[name] for name in turned], [limits[name] for name in turned]
            self._motors(pybullet.VELOCITY_CONTROL, indices, targetVelocities=list(turned.values()), forces=forces)
        for name, position in targets.position.items():
            ahead = targets.velocity.get(name, 0.0)
            pybullet.setJointMotorControl2(
                targetPosition=position, targetVelocity=ahead, force=limits[name], **self._servos[name]
            )
        for name, effort in targets.effort.items():
            self._motor(name, pybullet.VELOCITY_CONTROL, force=self._friction[name])
            self._held_efforts[self._index[name]] = effort

    def _carried(self, targets: JointTargets) -> JointTargets:
        """Return the targets, with the targets of leaders converted for the joints on which their motors act."""
        position, velocity, limits = dict(targets.position), dict(targets.velocity), dict(targets.max_effort)
        for leader, gear in self._carriers.items():
            if leader in targets.effort:
                self._motor(gear.joint, pybullet.VELOCITY_CONTROL, force=self._friction[gear.joint])
            if leader in position:
                joint, target = self._model.joints_by_name[leader], position.pop(leader)
                lower, upper = joint.range
                position[gear.joint] = gear.multiplier * max(lower, min(upper, target)) + gear.offset
            if leader in velocity:
                velocity[gear.joint] = gear.multiplier * velocity.pop(leader)
            if leader in limits:
                limits[gear.joint] = limits.pop(leader) / abs(gear.multiplier)
        return replace(targets, position=position, velocity=velocity, max_effort=limits)

    def _motor(self, joint: str, mode: int, **target: float) -> None:
        pybullet.setJointMotorControl2(self._robot, self._index[joint], mode, physicsClientId=self._client, **target)

    def _motors(self, mode: int, indices: Iterable[int], **targets: Sequence[float]) -> None:
        pybullet.setJointMotorControlArray(self._robot, list(indices), mode, physicsClientId=self._client, **targets)

    def _present_contacts(self, step: int, *, ground: bool) -> Iterator[Contact]:
        yield from self._contacts.of_step(step / self._rate, ground=ground)
        if self._path_contacts is not None:
            yield from self._path_contacts.at(step)


_BASE_COLUMNS: Final = 14


class StateRecorder:
    """Reads the state of the robot, and keeps the state of each step.

    A kept row holds the time, the 13 numbers of the base's centre of mass, and position, velocity and effort of each
    joint. All rows are kept in one array of bytes: numbers, or a string for each row, would be read again from memory
    that the steps in between have pushed out.
    """

    def __init__(
        self,
        client: int,
        robot: int,
        joints: Sequence[str],
        motors: Collection[int],
        balls: BallJoints | None,
        *,
        rate: float,
        efforts: Mapping[int, float],
    ) -> None:
        """Prepare the record.

        :param joints: the names of all joints; joints that motors can move come before the ball joints.
        :param motors: the numbers of the joints that motors can move.
        :param efforts: number of a joint -> the effort that a controller applies. PyBullet reports only its own motors,
            which are the friction that such an effort works against. The caller changes this mapping.
        """
        self._client, self._robot, self._motors, self._balls = client, robot, list(motors), balls
        self._joints, self._rate, self._efforts = tuple(joints), rate, efforts
        self._width = _BASE_COLUMNS + 3 * len(self._joints)
        self._rows = bytearray()
        self._packed = Struct(f"={self._width}d")
        _, _, _, com_position, com_orientation, *_ = pybullet.getDynamicsInfo(robot, BASE, client)
        self.com_in_link: Final = Pose(com_position, com_orientation)
        """The centre of mass of the base, in the frame of its link."""
        self.stops: JointStops | None = None
        """The stops of the joints; None if there are none."""
        self.carriers: Sequence[tuple[int, int, float]] = ()
        """Places of a leader and of the joint on which its motor acts, and the speed of the second over the first."""

    def keep(self, step: int) -> None:
        """Read the present state and keep it, at every step; move back joints that have passed their stops."""
        row = self._read(step)
        if self.stops is not None and (passed := self.stops.passed(row[_BASE_COLUMNS::3])):
            for place, stop, rests in passed:
                speed = 0.0 if rests else row[_BASE_COLUMNS + 3 * place + 1]
                pybullet.resetJointState(self._robot, self._motors[place], stop, speed, self._client)
            row = self._read(step)
        self._rows += self._packed.pack(*row)

    def last(self) -> list[float]:
        """Return the row that was kept last, in the order of `Trace.state`, but with the base's centre of mass."""
        row = self._last()
        positions, velocities, efforts = (row[_BASE_COLUMNS + group :: 3] for group in range(3))
        return [*row[:_BASE_COLUMNS], *positions, *velocities, *efforts]

    def collect(self) -> Trace:
        """Return the states that were kept since the last call."""
        kept = np.frombuffer(self._rows).reshape(-1, self._width)
        self._rows = bytearray()
        state = np.empty_like(kept)
        state[:, 0] = kept[:, 0]
        # Arithmetic on rows of memory is faster than on columns.
        com = np.ascontiguousarray(kept[:, 1:_BASE_COLUMNS].T)
        for column, values in enumerate(in_link_frame(tuple(com), self.com_in_link), start=1):
            state[:, column] = values
        joints = len(self._joints)
        for group in range(3 if joints else 0):
            first = _BASE_COLUMNS + group * joints
            state[:, first : first + joints] = kept[:, _BASE_COLUMNS + group :: 3]
        return Trace(self._joints, state)

    def observe(self, step: int, model: RobotModel, contacts: Sequence[Contact]) -> Observation:
        """Return the present state as the state of a step."""
        row: Sequence[float] = self._last() if self._rows else ()
        # The row of the last step is the present state.
        if not row or row[0] != step / self._rate:
            row = self._read(step)
        pose, twist = self.base_of(row[1:_BASE_COLUMNS])
        columns = (row[_BASE_COLUMNS + group :: 3] for group in range(3))
        joints = ByName(zip(self._joints, map(JointState, *columns), strict=True))
        links = LinkStates(model, pose, twist, joints)
        return Observation(row[0], pose, twist, joints, contacts, links=links)

    def base_of(self, com: Sequence[float]) -> tuple[Pose, Twist]:
        """Return pose and twist of the base link from the 13 numbers of its centre of mass."""
        px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = in_link_frame(com, self.com_in_link)
        return Pose((px, py, pz), (qx, qy, qz, qw)), Twist((vx, vy, vz), (wx, wy, wz))

    def _last(self) -> tuple[float, ...]:
        return self._packed.unpack_from(self._rows, len(self._rows) - self._packed.size)

    def _read(self, step: int) -> list[float]:
        """Return the row of the present state."""
        position, orientation = pybullet.getBasePositionAndOrientation(self._robot, self._client)
        linear, angular = pybullet.getBaseVelocity(self._robot, self._client)
        row: list[float] = [step / self._rate, *position, *orientation, *linear, *angular]
        if self._motors:
            if self._efforts:
                self._read_motors(row)
            else:
                for angle, velocity, _, effort in pybullet.getJointStates(self._robot, self._motors, self._client):
                    row += (angle, velocity, effort)
            for leader, carrier, ratio in self.carriers:
                own, carried = _BASE_COLUMNS + 3 * leader + 2, _BASE_COLUMNS + 3 * carrier + 2
                row[own] += ratio * row[carried]
                row[carried] = 0.0
        if self._balls is not None:
            for angle, speed in zip(*self._balls.state(), strict=True):
                row += (angle, speed, 0.0)
        return row

    def _read_motors(self, row: list[float]) -> None:
        states = pybullet.getJointStates(self._robot, self._motors, self._client)
        for number, (position, velocity, _, effort) in zip(self._motors, states, strict=True):
            row += (position, velocity, self._efforts.get(number, effort))
