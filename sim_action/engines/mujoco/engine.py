"""The MuJoCo engine: implements the Engine protocol and steps the simulation.

It corrects these properties of MuJoCo (its documentation, and measurements in the tests): quaternions are w, x, y, z,
the angular velocity of a free body is in its own frame, the greater of two friction coefficients counts, links touch
each other, constraints are soft, and an unstable simulation resets itself.
"""

from __future__ import annotations

import ctypes
import math
import sys
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.errors import EngineError
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import replace
from sim_action.engines import named_version
from sim_action.engines.body_control import HeldWrenches, WorldEvents
from sim_action.engines.clearances import ClearanceRecorder, RobotMotionBound
from sim_action.engines.engine import NO_CHANNELS, Engine, RobotQueries, link_of
from sim_action.engines.joint_stops import JointStops
from sim_action.engines.mujoco.bodies import BasePusher, Contacts, Distances, Links, MuJoCoBodyControl, Objects, Rays
from sim_action.engines.mujoco.geoms import with_user_names
from sim_action.engines.mujoco.motors import Motors
from sim_action.engines.mujoco.scene import CompiledScene
from sim_action.engines.mujoco.sliding import SlidingContacts
from sim_action.engines.observers import LazyContacts, PathContacts, Recorders, path_contacts
from sim_action.robot.model.kinematics import LinkStates
from sim_action.robot.model.robot_model import RobotModel, ball_angles
from sim_action.state.command import JointTargets
from sim_action.state.observation import ByName, Clash, Contact, JointState, Observation, Overlap
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ContactRecord
from sim_action.world import World
from sim_action.world.scene import EGO, Scene

if TYPE_CHECKING:
    from sim_action.engines.mujoco.colliding_geoms import SelfCollision

WARNING: Final = "mujoco warning: "  # prefix of the lines on stderr that hold warnings of the engine
_REFUSALS: Final = (ValueError, OSError, mujoco.FatalError, mujoco.UnexpectedError)
_BAD_VELOCITY: Final = int(mujoco.mjtWarning.mjWARN_BADQVEL)
_BAD_ACCELERATION: Final = int(mujoco.mjtWarning.mjWARN_BADQACC)


def _print_warning(message: str) -> None:
    sys.stderr.write(f"{WARNING}{message}\n")
    sys.stderr.flush()


# By default MuJoCo writes warnings to a file in the working directory.
mujoco.set_mju_user_warning(_print_warning)

# The clock of its profiler takes a sixth of a step, and its Python package always sets it. Windows does not find it so.
with suppress(OSError, ValueError):
    ctypes.c_void_p.in_dll(ctypes.CDLL(mujoco._functions.__file__), "mjcb_time").value = None  # noqa: SLF001 - no other way


class SimulatedRobot(RobotQueries):
    """A robot in a MuJoCo model: its motors, state and contacts; the engine is the robot under test."""

    def __init__(self, scene: Scene, compiled: CompiledScene, objects: Objects, sliding: SlidingContacts) -> None:
        self._compiled, self._model, self._data = compiled, compiled.model, compiled.data
        self._rate = scene.physics.rate
        self.motors = Motors(scene, compiled, self._rate)
        self._pusher = BasePusher(compiled, self._rate)
        self._pushes = False
        self._states = StateRecorder(compiled, scene.model, self._rate, self.motors.efforts)
        self._stops = JointStops.of(scene.model, compiled.positions.tolist())
        self._links, self._objects, self._rays = Links(compiled), objects, Rays(compiled)
        self._contacts = Contacts(compiled)
        self._control = MuJoCoBodyControl(compiled, objects, sliding.forget)
        self._wrenches = HeldWrenches(self._control, self.link_pose, scene.model)
        self._path_contacts: PathContacts | None = None
        self._touches: list[Contact] = []
        self.others: Mapping[str, SimulatedRobot] = {}
        """The other robots of the world by name, as this one sees them."""
        self._lazy_contacts = LazyContacts()

    @override
    def collect(self) -> Trace:
        touches = tuple(self._touches)
        self._touches = []
        return replace(self._states.trace(), contacts=touches) if touches else self._states.trace()

    @override
    def observe(self, step: int, *, contacts: bool) -> Observation:
        if not contacts:
            return self._states.now(step, ())
        return self._states.now(step, self._lazy_contacts.present(lambda: self._present_contacts(step)))

    @override
    def link_pose(self, link: str) -> Pose:
        return self._links.pose(link)

    @override
    def link_twist(self, link: str) -> Twist:
        return self._links.twist(link)

    @override
    def body_pose(self, body: str) -> Pose:
        return link_of(body, self.others) or self._objects.pose(body)

    @override
    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._rays.cast(start_xyz, ends_xyz)

    def apply(self, targets: JointTargets) -> None:
        """Pass targets to the motors, which keep them until the next ones."""
        self.motors.apply(targets)
        if targets.base is not None:
            self._pushes = True
            self._pusher.apply(targets.base)
        if targets.wrenches is not None:
            self._wrenches.held = targets.wrenches

    @property
    def has_forces(self) -> bool:
        """True if pushes or wrenches act that MuJoCo does not compute."""
        return self._pushes or bool(self._wrenches.held)

    def apply_forces(self, step: int) -> None:
        """Apply the pushes and wrenches of a step to the state before it."""
        if self._pushes:
            state = self.observe(step - 1, contacts=False)
            self._pusher.step(state.pose, state.twist)
        if self._wrenches.held:
            self._wrenches.apply()

    def end_forces(self) -> None:
        """Remove the wrenches of a step after it."""
        if self._wrenches.held:
            self._control.clear_forces()

    def settle(self) -> None:
        """Read the contacts that somebody may still access, before the next step."""
        self._lazy_contacts.settle()

    def keep(self, step: int) -> None:
        """Keep the present state as the state of a step; joints that have passed their stops are moved back."""
        if self._stops is not None and (passed := self._stops.passed(memoryview(self._data.qpos))):
            self._stop(passed)
        self._states.keep(step)

    def keep_touches(self, step: int) -> None:
        """Keep the present contacts with all but the ground as contacts of a step."""
        self._touches += self._contacts.of_step(step / self._rate, ground=False)

    def keep_nan(self, steps: Sequence[int]) -> None:
        """Record NaN for steps after the simulation has diverged."""
        self._states.keep_nan(steps)

    def motion_bound(self, radii: Mapping[str, float]) -> Callable[[], float]:
        """Return a function that bounds how far any point has moved since the last call, in m."""
        bound = RobotMotionBound(self._states.robot, radii)
        return lambda: bound.advance(*self._states.place(self._states.last()))

    def _stop(self, passed: Iterable[tuple[int, float, bool]]) -> None:
        """Move joints back that have passed their stops."""
        for at, stop, rests in passed:
            self._data.qpos[at] = stop
            if rests:
                self._data.qvel[self._compiled.velocities[self._compiled.positions == at]] = 0.0

    def _present_contacts(self, step: int) -> Iterator[Contact]:
        yield from self._contacts.of_step(step / self._rate, ground=True)
        if self._path_contacts is not None:
            yield from self._path_contacts.at(step)


class MuJoCoEngine(SimulatedRobot, Engine):
    """A MuJoCo model and its state."""

    version = named_version("mujoco")
    solid_terrain = True
    actors: Mapping[str, SimulatedRobot]

    def __init__(self, scene: Scene, channels: Channels = NO_CHANNELS) -> None:
        try:
            compiled = CompiledScene.of(scene)
        except _REFUSALS as error:
            raise EngineError(f"the engine refused the world: {with_user_names(str(error), scene)}") from None
        self._scene, self._is_closed = scene, False
        self._self_collision = self._collision_of_links(compiled, channels)
        # Belts stand still while the robot settles, before t = 0.
        self._belts = compiled.model.geom_surfacevel.copy() if compiled.model.flg_surfacevel else None
        self._joint_names = tuple(joint.name for joint in scene.model.moving_joints)
        self._sliding = SlidingContacts(compiled)
        objects = Objects(compiled)
        super().__init__(scene, compiled, objects, self._sliding)
        self.actors = {
            name: SimulatedRobot(actor, compiled.actors[name], objects, self._sliding)
            for name, actor in scene.actors.items()
        }
        self._robots: tuple[SimulatedRobot, ...] = (self, *self.actors.values())
        for robot in self._robots:
            robot.motors.together = [other.motors for other in self._robots]
            robot.others = {EGO: self, **self.actors}
        self._events = WorldEvents.of(scene, self._control)
        self._is_disturbed = self._events is not None
        self._distances = distances = Distances(compiled)
        shaped = set(compiled.links.values())
        self._path_contacts = path_contacts(scene, shaped, distances.nearest)
        self._clearances = ClearanceRecorder(
            *(channels, scene, _radii(scene, distances)),
            near=distances.near,
            body_at=self._objects.at,
            actors={
                name: actor.motion_bound(_radii(scene.actors[name], Distances(compiled.actors[name])))
                for name, actor in (self.actors if channels.clearances else {}).items()
            },
        )
        self._recorders = Recorders(channels, scene, self._objects.pose_reader, self._contacts.of_links)
        # Clearances to static bodies are measured afterwards, from the recorded states.
        self._looks_back = not self._clearances.is_idle and self._clearances.bodies_are_static
        # A live view of the bodies' part, which comes last.
        moving = sum(body.mass is not None for body in scene.world.objects)
        self._objects_qpos = compiled.data.qpos[compiled.model.nq - 7 * moving :]
        self._body_poses: list[bytes] = []
        self._watchers = list(self._watching(channels))
        # A live view of the number of warnings by kind.
        self._warned = memoryview(compiled.data.warning.number)

    @override
    def advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:
        self._lazy_contacts.settle()
        if self.actors:
            self._settle_contacts()
        if self._belts is not None:
            self._model.geom_surfacevel[:] = self._belts if first_step >= 0 else 0.0
        try:
            self._advance(first_step, targets)
        except mujoco.FatalError as error:
            raise EngineError(f"the engine gave up: {with_user_names(str(error), self._scene)}") from None

    @override
    def follow(self, world: World, time: float) -> None:
        self._clearances.follow(world, time)
        if self._events is not None:
            self._events.follow(world)
            self._recorders.follow(world)

    @override
    def collect(self) -> Trace:
        rows, states = self._states.take(), self._states
        if self._looks_back:
            steps, qpos, recall = rows[:, 0].astype(int).tolist(), states.robot_qpos(rows), self._distances.recall
            self._clearances.record_past(steps, *states.places(rows), lambda row: recall(qpos[row]))
        touches = tuple(self._touches)
        self._touches = []
        clearances = self._clearances.collect()
        records = self._recorders.collect()
        trace = Trace(self._joint_names, states.trace_rows(rows), touches, clearances=clearances, **records)
        return trace if self._self_collision is None else self._self_collision.added_to(trace)

    @override
    def link_contacts(self, step: int) -> dict[str, ContactRecord]:
        return self._recorders.present_contacts(step)

    @override
    def collect_bodies(self) -> FloatArray:
        # Rows after a divergence are missing.
        kept, self._body_poses = self._body_poses, []
        poses = np.frombuffer(b"".join(kept)).reshape(len(kept), -1, 7) if kept else np.empty((0, 0, 7))
        # MuJoCo orders quaternions as w, x, y, z.
        return poses[:, :, [0, 1, 2, 4, 5, 6, 3]]

    @override
    def touching(self) -> tuple[Overlap | Clash, ...]:
        return tuple(self._contacts.touching())

    @override
    def overlaps(self) -> tuple[Overlap, ...]:
        return self._contacts.overlaps()

    @override
    def clashes(self) -> tuple[Clash, ...]:
        return self._contacts.clashes()

    @override
    def close(self) -> None:
        # MuJoCo's memory is freed with its Python objects, or used again.
        self._settle_contacts()
        if not self._is_closed:
            self._is_closed = True
            self._compiled.give_back(self._data)

    def _collision_of_links(self, compiled: CompiledScene, channels: Channels) -> SelfCollision | None:
        if not (self._scene.robot.self_collision or channels.self_contacts):
            return None
        from sim_action.engines.mujoco.colliding_geoms import SelfCollision  # a usual run does without it

        contacts = SelfCollision(self._scene, compiled.model, compiled.data, compiled.links, compiled.colliders)
        self.model_notes = contacts.notes
        return contacts

    def _watching(self, channels: Channels) -> Iterator[Callable[[int], None]]:
        """Yield the functions that observe the state after each step, given its number."""
        if self._objects_qpos.size:
            yield self._record_bodies
        yield from (actor.keep for actor in self.actors.values())
        if any(body.path for body in self._scene.world.objects):
            yield from (actor.keep_touches for actor in self.actors.values())
        if channels.contacts and (channels.ground or self._scene.world.names):
            yield partial(self._record_contacts, ground=channels.ground)
        if self._self_collision is not None and channels.self_contacts:
            states, names = self._states, self._joint_names
            yield self._self_collision.recorder(self._rate, names, lambda: states.place(states.last())[1])
        yield from self._recorders.watchers
        if not self._clearances.is_idle and not self._looks_back:
            yield self._record_clearances

    def _record_bodies(self, _: int) -> None:
        self._body_poses.append(self._objects_qpos.tobytes())

    def _record_contacts(self, step: int, *, ground: bool) -> None:
        if ground or self._contacts.may_matter(self._sliding.touching):
            self._touches += self._contacts.of_step(step / self._rate, ground=ground)
        if self._path_contacts is not None:
            self._touches += self._path_contacts.at(step)

    def _record_clearances(self, step: int) -> None:
        self._distances.look_at_present()
        self._clearances.record(step, *self._states.place(self._states.last()))

    def _advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:  # noqa: C901 - calls cost most
        # This loop is most of a run. Local names are cheaper than attributes, and each call would cost 1 % of a step.
        model, data, warned, carry = self._model, self._data, self._warned, self._control.carry
        engage, efforts, correct, watchers = (
            self._engage if self.actors else self.motors.engage,
            self.motors.efforts,
            self._sliding.correct,
            self._watchers,
        )
        first_half, second_half, disturbed = mujoco.mj_step1, mujoco.mj_step2, self._is_disturbed
        steps, kept, qpos, qvel = self._states.opened()
        stops, positions = self._stops, memoryview(data.qpos)
        is_engaged = False
        for step, new_targets in enumerate(targets, start=first_step + 1):
            if new_targets is not None:
                self.apply(new_targets)
                is_engaged = False
                # Targets of joints, which most steps of a ramp give, change nothing else.
                if new_targets.base is not None or new_targets.wrenches is not None or new_targets.actors:
                    self._apply_others(new_targets.actors or {})
                    disturbed = self._is_disturbed
            if warned[_BAD_ACCELERATION] or warned[_BAD_VELOCITY]:
                # The simulation has diverged: the rest of the trace is NaN.
                self._give_up(range(step, first_step + len(targets) + 1))
                return
            if disturbed:
                self._begin_disturbances(step)
            first_half(model, data)
            # They may be elsewhere at each step.
            references: memoryview[float] = memoryview(data.efc_aref)
            if not is_engaged:
                turning, hold = engage()
                is_engaged = True
            for row, bias in turning:
                references[row] += bias
            if hold is not None:
                hold(references)
            if disturbed:
                carry()
            correct(references)
            second_half(model, data)
            if stops is not None and (passed := stops.passed(positions)):
                self._stop(passed)
            if disturbed:
                self._end_disturbances(step)
            steps.append(step)
            kept += qpos
            kept += qvel
            kept += efforts().tobytes()
            for watch in watchers:
                watch(step)

    def _give_up(self, steps: Sequence[int]) -> None:
        for robot in self._robots:
            robot.keep_nan(steps)

    def _settle_contacts(self) -> None:
        for robot in self._robots:
            robot.settle()

    def _apply_others(self, targets: Mapping[str, JointTargets]) -> None:
        for name, own in targets.items():
            self.actors[name].apply(own)
        self._is_disturbed = self._events is not None or any(robot.has_forces for robot in self._robots)

    def _engage(self) -> tuple[Sequence[tuple[int, float]], Callable[[memoryview[float]], None] | None]:
        """Let the targets of all robots act, as `Motors.engage` does."""
        engaged = [robot.motors.engage() for robot in self._robots]
        holds = [hold for _, hold in engaged if hold is not None]

        def hold_all(references: memoryview[float]) -> None:
            for hold in holds:
                hold(references)

        return [pair for turning, _ in engaged for pair in turning], hold_all if holds else None

    def _begin_disturbances(self, step: int) -> None:
        """Apply the pushes, forces and events of the step to the state with this number."""
        for robot in self._robots:
            robot.apply_forces(step)
        if self._events is not None:
            self._events.before_step(step - 1)

    def _end_disturbances(self, step: int) -> None:
        if self._events is not None:
            self._events.after_step(step)
        for robot in self._robots:
            robot.end_forces()


def _radii(scene: Scene, distances: Distances) -> dict[str, float]:
    # In MJCF, joint axes may lie away from the frames of their links, at an unknown distance.
    return dict.fromkeys(scene.model.links_by_name, math.inf) if scene.model.mjcf else distances.radii()


class StateRecorder:
    """Keeps MuJoCo's raw state after each step; the conversion to a trace happens at the end.

    A row is (1 + P + V + J,): step, qpos, qvel, efforts of the motors. All but the step is kept in one array of bytes:
    copying bytes takes a third of the time of copying arrays, and objects of their own would have to be read again from
    memory that the steps in between have pushed out.
    """

    def __init__(
        self, compiled: CompiledScene, robot: RobotModel, rate: float, efforts: Callable[[], FloatArray]
    ) -> None:
        """`efforts` returns the efforts (J,) of the last step."""
        self._compiled, self.robot, self._rate, self._efforts_now = compiled, robot, rate, efforts
        # Live views of the robot's part.
        first, speed = compiled.first_qpos, compiled.first_qvel
        self._qpos = compiled.data.qpos[first : first + compiled.robot_qpos]
        self._qvel = compiled.data.qvel[speed : speed + compiled.robot_qvel]
        self._qpos_bytes, self._qvel_bytes = memoryview(self._qpos), memoryview(self._qvel)
        self._speeds = 1 + len(self._qpos)
        self._efforts = self._speeds + len(self._qvel)
        self._width = self._efforts + len(compiled.positions)
        self._steps: list[int] = []
        self._kept = bytearray()
        # Per joint: its name, and the columns of its position, velocity and effort.
        self._positions = positions = 1 - first + compiled.positions
        self._velocities = velocities = self._speeds - speed + compiled.velocities
        efforts_at = range(self._efforts, self._width)
        names = [joint.name for joint in robot.moving_joints]
        self._places = list(zip(names, positions.tolist(), velocities.tolist(), efforts_at, strict=True))
        # The columns of the quaternion of each ball joint, whose parts are three of the places.
        balls = positions[len(positions) - 3 * len(robot.balls) :: 3].tolist()
        self._balls = [slice(first - 1, first + 3) for first in balls]
        self._fixed_pose = self._pose_of_fixed() if compiled.fixed else None

    def opened(self) -> tuple[list[int], bytearray, memoryview, memoryview]:
        """Return where to add each step and its bytes (of qpos, qvel, efforts), and live views of the first two."""
        return self._steps, self._kept, self._qpos_bytes, self._qvel_bytes

    def keep(self, step: int) -> None:
        """Keep the present state as the state of a step."""
        self._steps.append(step)
        self._kept += self._qpos_bytes
        self._kept += self._qvel_bytes
        self._kept += self._efforts_now().tobytes()

    def keep_nan(self, steps: Sequence[int]) -> None:
        """Record NaN for steps after the simulation has diverged."""
        nothing = np.full(self._width - 1, np.nan).tobytes()
        self._steps += steps
        self._kept += nothing * len(steps)

    def last(self) -> list[float]:
        """Return the last row (1 + P + V + J,)."""
        # For few numbers a list takes a fifth of the time of an array.
        return [self._steps[-1], *array("d", self._kept[-8 * (self._width - 1) :])]

    def place(self, row: Sequence[float]) -> tuple[Sequence[float], list[float]]:
        """Return the pose (7,) of the base, in MuJoCo's order, and the joint positions (J,) of a row."""
        base = [0.0] * 7 if self._fixed_pose is not None else row[1:8]
        row = self._with_angles(row) if self._balls else row
        return base, [row[position] for _, position, _, _ in self._places]

    def places(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the same for T rows: (T, 7) and (T, J)."""
        base = np.zeros((len(rows), 7)) if self._fixed_pose is not None else rows[:, 1:8]
        return base, self._with_all_angles(rows)[:, self._positions]

    def robot_qpos(self, rows: FloatArray) -> FloatArray:
        """Return the robot's part of qpos, (T, P)."""
        return rows[:, 1 : self._speeds]

    def take(self) -> FloatArray:
        """Return the rows (T, 1 + P + V + J) since the last call."""
        rows = np.empty((len(self._steps), self._width))
        rows[:, 0] = self._steps
        rows[:, 1:] = np.frombuffer(self._kept).reshape(len(rows), self._width - 1)
        self._steps = []
        self._kept = bytearray()
        return rows

    def trace(self) -> Trace:
        """Return the states since the last call."""
        return Trace(tuple(joint.name for joint in self.robot.moving_joints), self.trace_rows(self.take()))

    def now(self, step: int, contacts: Sequence[Contact]) -> Observation:
        """Return the present state, bit by bit as `trace_rows`, with single numbers: five times as fast."""
        row = self._row(step)
        if self._balls:
            row = self._with_angles(row)
        joints = ByName([(name, JointState(row[p], row[v], row[e])) for name, p, v, e in self._places])
        pose, twist = self._present_base(row)
        links = LinkStates(self.robot, pose, twist, joints)
        return Observation(step / self._rate, pose, twist, joints, contacts, links=links)

    def _row(self, step: int) -> list[float]:
        if self._steps and step == self._steps[-1]:
            return self.last()
        return [step, *self._qpos.tolist(), *self._qvel.tolist(), *self._efforts_now().tolist()]

    def _present_base(self, row: list[float]) -> tuple[Pose, Twist]:
        if self._fixed_pose is not None:
            return self._fixed_pose, Twist()
        _, x, y, z, qw, qx, qy, qz = row[:8]
        vx, vy, vz, wx, wy, wz = row[self._speeds : self._speeds + 6]
        orientation = (qx, qy, qz, qw)
        # MuJoCo has the angular velocity in the body frame and the linear one in the world frame.
        return Pose((x, y, z), orientation), Twist((vx, vy, vz), geometry.rotate(orientation, (wx, wy, wz)))

    def trace_rows(self, rows: FloatArray) -> FloatArray:
        """Return the rows as rows of `Trace.state`, (T, 14 + 3 J)."""
        count = len(self._positions)
        state = np.empty((len(rows), 14 + 3 * count))
        state[:, 0] = rows[:, 0] / self._rate
        self._write_base(rows, state[:, 1:14])
        state[:, 14 : 14 + count] = self._with_all_angles(rows)[:, self._positions]
        state[:, 14 + count : 14 + 2 * count] = rows[:, self._velocities]
        state[:, 14 + 2 * count :] = rows[:, self._efforts :]
        return state

    def _with_angles(self, row: Sequence[float]) -> list[float]:
        """Return a row in which the quaternion of each ball joint is replaced by 0 and its three angles."""
        changed = list(row)
        for at in self._balls:
            w, x, y, z = row[at]
            changed[at] = [0.0, *ball_angles((x, y, z, w))]
        return changed

    def _with_all_angles(self, rows: FloatArray) -> FloatArray:
        return np.array([self._with_angles(row) for row in rows.tolist()]) if self._balls and len(rows) else rows

    def _pose_of_fixed(self) -> Pose:
        base = np.empty((1, 13))
        self._write_base(base[:, :0], base)
        x, y, z, qx, qy, qz, qw = base[0, :7].tolist()
        return Pose((x, y, z), (qx, qy, qz, qw))

    def _write_base(self, rows: FloatArray, base: FloatArray) -> None:
        """Write pose (quaternion x, y, z, w) and twist of the base link into `base`, (T, 13), world frame."""
        if self._compiled.fixed:
            model, body = self._compiled.model, self._compiled.base
            base[:, :3], base[:, 3:7] = model.body_pos[body], model.body_quat[body][[1, 2, 3, 0]]
            base[:, 7:] = 0.0
            return
        base[:, :3], base[:, 3:6], base[:, 6] = rows[:, 1:4], rows[:, 5:8], rows[:, 4]
        base[:, 7:10] = rows[:, self._speeds : self._speeds + 3]
        # MuJoCo has the angular velocity in the body frame and the linear one in the world frame. Arithmetic on rows of
        # memory is faster than on columns.
        w, x, y, z = np.ascontiguousarray(rows[:, 4:8].T)
        turning: Any = tuple(np.ascontiguousarray(rows[:, self._speeds + 3 : self._speeds + 6].T))
        orientation: Any = (x, y, z, w)
        base[:, 10], base[:, 11], base[:, 12] = geometry.rotate(orientation, turning)
