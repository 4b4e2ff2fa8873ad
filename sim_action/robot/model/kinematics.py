"""Kinematics of a robot: poses of its links, its bounding box, limits of its joints, and mobility of its base.

The motion of links follows from the state of the base and the joints, at one moment or at many: from the columns of a
trace, or from an observation. Engines are not asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import product
from types import ModuleType
from typing import Any, Final
from weakref import WeakKeyDictionary

from sim_action.core import geometry, units
from sim_action.core.geometry import ZERO, Box, Pose, Quaternion, Twist, Vector3
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, WORLD, Joint, Reading, RobotModel, Shape
from sim_action.state.observation import ByName, JointState, LinkState
from sim_action.state.trace import Trace

# The largest part of a quaternion, beyond which a rotation moves no point by more than 1e-7 of its distance.
_UNTURNED: Final = 1 - 1e-15

_POSITION_ROUNDING: Final = 1e-6  # Models round: a limit may be 1.5707963 where the scenario says 90 deg. In rad, or m.
_SHARE_ROUNDING: Final = 1e-6  # the same as a share of a velocity or effort limit
BASE_FRAME: Final = "base"  # the name of the base link's frame, unless the model has a link with this name


def link_poses(model: RobotModel, positions: Mapping[str, float]) -> dict[str, Pose]:
    """Return the pose of each link in the base frame; `positions`: in rad (m), 0 for joints that are left out."""
    hanging: dict[str, list[Joint]] = {}
    for joint in model.joints:
        hanging.setdefault(joint.parent, []).append(joint)
    poses = {model.root: Pose()}
    waiting = [model.root]
    while waiting:
        parent = waiting.pop()
        for joint in hanging.get(parent, []):
            # A link of MJCF may have several joints in series.
            socket = poses.get(joint.child) or geometry.compose(poses[parent], joint.origin)
            poses[joint.child] = geometry.compose(socket, joint_motion(joint, positions.get(joint.name, 0.0)))
        waiting += dict.fromkeys(joint.child for joint in hanging.get(parent, []))
    return poses


def link_of_frame(model: RobotModel, frame: str) -> str:
    """Return the link whose frame "base" or a link's name means; any other name is returned as it is."""
    return model.root if frame == BASE_FRAME and frame not in model.links_by_name else frame


def why_no_link(model: RobotModel, name: str) -> str | None:
    """Return a message with the nearest names if the robot has no link with a name; else None."""
    links = model.links_by_name
    return None if name in links else f"the robot has no link '{name}'{did_you_mean(name, links)}"


def why_no_frame(model: RobotModel, name: str) -> str | None:
    """Return a message if a name is neither "world", "base" nor the name of a link; else None."""
    links = model.links_by_name
    if name in links or name in {WORLD, BASE_FRAME}:
        return None
    nearest = did_you_mean(name, [WORLD, BASE_FRAME, *links])
    return f"there is no frame '{name}': a frame is world, base, or a link of the robot{nearest}"


def robot_box(model: RobotModel, poses: Mapping[str, Pose]) -> Box | None:
    """Return the box around all collision shapes in the base frame, if any; tight unless points are unknown."""
    placed = [(poses[link.name], shape) for link in model.links for shape in link.collisions]
    boxes = [(shape_box(geometry.compose(frame, shape.pose), shape), frame, shape) for frame, shape in placed]
    tight_boxes = [box for box, frame, shape in boxes if not _is_loose(frame, shape)]
    # Reading the points of a mesh takes time. Meshes that reach furthest come first, because others may be inside them.
    for loose, frame, shape in sorted((box for box in boxes if _is_loose(*box[1:])), key=_least_corner):
        around = _around(tight_boxes) if tight_boxes else None
        if around is None or not _contains(around, loose):
            tight_boxes.append(_points_box(frame, shape))
    return _around(tight_boxes) if tight_boxes else None


def _least_corner(placed: tuple[Box, Pose, Shape]) -> float:
    lower, upper = placed[0]
    return sum(lower) - sum(upper)


def _is_loose(frame: Pose, shape: Shape) -> bool:
    turned = geometry.multiply(frame.orientation_xyzw, shape.pose.orientation_xyzw)
    return bool(shape.hulls or shape.corners) and max(map(abs, turned)) < _UNTURNED


def _points_box(frame: Pose, shape: Shape) -> Box:
    """Return the box around the points of a mesh whose link is at a pose."""
    points = shape_points(shape)
    rows = list(zip(*(geometry.rotate(frame.orientation_xyzw, unit) for unit in geometry.AXES), strict=True))
    ends = []
    for at, (x, y, z) in zip(frame.position_xyz, rows, strict=True):
        along = x * points[:, 0] + y * points[:, 1] + z * points[:, 2]
        ends.append((at + float(along.min()), at + float(along.max())))
    (ax, bx), (ay, by), (az, bz) = ends
    return (ax, ay, az), (bx, by, bz)


def _around(boxes: Iterable[Box]) -> Box:
    xs, ys, zs = zip(*(corner for box in boxes for corner in box), strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def _contains(outer: Box, inner: Box) -> bool:
    return all(low <= at for low, at in zip(outer[0], inner[0], strict=True)) and all(
        at <= high for at, high in zip(inner[1], outer[1], strict=True)
    )


@cache
def shape_points(shape: Shape) -> NDArray[np.float64]:
    """Return the corners (P, 3) of a box, or of the hulls of a mesh, in m, in the frame of its link."""
    from sim_action.meshes.collision_hulls import read_unshrunk_points  # a usual run does without it

    if shape.kind == "box":
        points = np.array([*product(*zip(shape.lower_xyz, shape.upper_xyz, strict=True))])
    elif shape.corners:
        points = np.frombuffer(shape.corners, np.float32).reshape(-1, 3).astype(np.float64)
    else:
        points = np.concatenate(read_unshrunk_points(shape.hulls, ENGINE_MARGIN_M))
    rows = zip(*(geometry.rotate(shape.pose.orientation_xyzw, unit) for unit in geometry.AXES), strict=True)
    # Sums of products, written out: the same on every machine.
    along = [x * points[:, 0] + y * points[:, 1] + z * points[:, 2] for x, y, z in rows]
    placed: NDArray[np.float64] = np.stack(along, axis=1)
    return placed + np.array(shape.pose.position_xyz, dtype=np.float64)


def joint_motion(joint: Joint, position: Any, functions: ModuleType = math) -> Pose:
    """Return the motion of the child link's frame from position zero to `position` in rad (m if prismatic).

    `position` may be a column (T,), with numpy as `functions`: the module with `sin` and `cos`.
    """
    if joint.type == "prismatic":
        x, y, z = joint.axis_xyz
        return Pose((position * x, position * y, position * z))
    turn = Pose(orientation_xyzw=_turn_of(joint.axis_xyz, position, functions))
    if joint.anchor_xyz == ZERO:
        return turn
    (ax, ay, az), (bx, by, bz) = joint.anchor_xyz, geometry.rotate(turn.orientation_xyzw, joint.anchor_xyz)
    return Pose((ax - bx, ay - by, az - bz), turn.orientation_xyzw)


def shape_box(pose: Pose, shape: Shape) -> Box:
    """Return the box around a shape whose frame is at `pose`."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2))).position_xyz
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    # The rows of the rotation matrix: each axis of the base in the frame of the shape.
    rows = zip(*(geometry.rotate(pose.orientation_xyzw, unit) for unit in geometry.AXES), strict=True)
    x, y, z = (_half_along(row, shape.kind, half) for row in rows)
    return (middle[0] - x, middle[1] - y, middle[2] - z), (middle[0] + x, middle[1] + y, middle[2] + z)


def _half_along(direction: Vector3, kind: str, half: Vector3) -> float:
    """Return the extent in m of a shape from its centre along a direction in its own frame."""
    (x, y, z), (width, depth, height) = direction, half
    if kind == "sphere":
        return width
    if kind == "capsule":
        return width + abs(z) * (height - width)
    if kind == "cylinder":
        return math.hypot(x, y) * width + abs(z) * height
    return abs(x) * width + abs(y) * depth + abs(z) * height


def beyond_limits(joint: Joint, position: float, slack: float = _POSITION_ROUNDING) -> str | None:
    """Return a message if a position in rad (m if prismatic) is outside the limits of a joint, else None."""
    lower, upper = joint.range
    if lower - slack <= position <= upper + slack:
        return None
    unit = joint.dimension("position").si
    at, passed = units.display_apart(position, lower if position < lower else upper, unit)
    low, high = (passed, units.display(upper, unit)) if position < lower else (units.display(lower, unit), passed)
    bounds = f"{low} or more" if math.isinf(upper) else f"{high} or less" if math.isinf(lower) else f"{low} to {high}"
    return f"{at} is outside the limits of the joint, {bounds}"


def too_fast(joint: Joint, speed: float) -> str | None:
    """Return a message if a speed in rad/s (m/s), in either direction, exceeds the velocity limit, else None."""
    return _too_much(joint, "velocity", speed, joint.max_velocity)


def too_strong(joint: Joint, effort: float) -> str | None:
    """Return a message if an effort in N m (N), in either direction, exceeds the effort limit, else None."""
    return _too_much(joint, "effort", effort, joint.max_effort)


def _too_much(joint: Joint, reading: Reading, value: float, limit: float | None) -> str | None:
    if limit is None or abs(value) <= limit * (1 + _SHARE_ROUNDING):
        return None
    shown_value, most = units.display_apart(abs(value), limit, joint.dimension(reading).si)
    return f"{shown_value} is more than the joint's {reading} limit, {most}"


@dataclass(frozen=True, slots=True)
class Mobility:
    """The motions that a drive allows; by default, the robot turns in place about its base link's origin."""

    heading: float = 0.0  # rad, direction of forward motion, from the base's x axis to the left
    ahead: float = 0.0  # m, along the heading, from the axle about which the robot turns to the base link's origin
    tightest: float = math.inf  # 1/m, the largest curvature that it can drive; inf if it turns in place
    acceleration: float = 1.0  # m/s^2, limit of the forward acceleration
    turn_acceleration: float = 1.0  # rad/s^2, limit of the angular acceleration when it turns in place
    wheelbase: float = 0.0  # m, from the fixed axle to the steered one; 0 if no wheel is steered
    # m/s, the speed at the rim of the fastest wheel at the limit of its joint; inf without such limits
    fastest: float = math.inf

    @property
    def turns_in_place(self) -> bool:
        """Return True if the robot can turn in place."""
        return math.isinf(self.tightest)

    @property
    def turning_radius(self) -> float:
        """The smallest turning radius, in m."""
        return 1 / self.tightest


@dataclass(frozen=True, slots=True, eq=False)
class SameModel:
    """A model as a key of a cache: compared by identity, because comparing its contents would be slow."""

    model: RobotModel

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SameModel) and other.model is self.model

    def __hash__(self) -> int:
        return id(self.model)


_POLE: Final = 1e-30  # keeps the rates of a ball joint finite where its angles about x and z are ambiguous
Frames = Pose  # a pose whose numbers are columns (T,): the poses of one frame at T moments


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """The motion of a link at T moments, in the world frame or in another one.

    Attributes:
        position_xyz: (T, 3) m, of the origin of the link's frame.
        orientation_xyzw: (T, 4) unit quaternions.
        linear_xyz: (T, 3) m/s, velocity of the origin.
        angular_xyz: (T, 3) rad/s.
    """

    position_xyz: FloatArray
    orientation_xyzw: FloatArray
    linear_xyz: FloatArray
    angular_xyz: FloatArray

    def __len__(self) -> int:
        return len(self.position_xyz)

    def seen_from(self, frame: LinkMotion) -> LinkMotion:
        """Return the motion as an observer in a frame that moves too sees it, in the axes of that frame."""
        back = geometry.conjugate(_columns(frame.orientation_xyzw))
        away = _columns(self.position_xyz - frame.position_xyz)
        carried = geometry.cross(_columns(frame.angular_xyz), away)
        linear = geometry.subtract(_columns(self.linear_xyz - frame.linear_xyz), carried)
        angular = _columns(self.angular_xyz - frame.angular_xyz)
        return LinkMotion(
            _rows(geometry.rotate(back, away)),
            _rows(geometry.multiply(back, _columns(self.orientation_xyzw))),
            _rows(geometry.rotate(back, linear)),
            _rows(geometry.rotate(back, angular)),
        )


_STATES: Final[WeakKeyDictionary[Trace, LinkStates]] = WeakKeyDictionary()
"""The states that were computed for a trace: several assertions read the same links."""


def link_motion(model: RobotModel, trace: Trace, link: str) -> LinkMotion:
    """Return the motion of a link at the moments of a trace, world frame. Raise KeyError for an unknown link."""
    states = _STATES.get(trace)
    if states is None or states.model is not model:
        states = _STATES[trace] = _states_of(model, trace)
    (pose, twist), count = states[link], len(trace)
    groups = (pose.position_xyz, pose.orientation_xyzw, twist.linear_xyz, twist.angular_xyz)
    rows = [np.column_stack([np.broadcast_to(column, count) for column in group]) for group in groups]
    return LinkMotion(*rows)


def frames_of(positions_xyz: FloatArray, orientations_xyzw: FloatArray) -> Frames:
    """Return the poses of positions (T, 3) and unit quaternions (T, 4)."""
    position: Any = tuple(positions_xyz.T)
    orientation: Any = tuple(orientations_xyzw.T)
    return Pose(position, orientation)


def link_frames(model: RobotModel, base: Pose, positions: FloatArray) -> dict[str, Pose]:
    """Return the poses of all links as columns (T,); `base`: as columns; `positions`: (T, J) of moving joints."""
    columns = zip(model.moving_joints, positions.T, strict=True)
    joints: Any = {joint.name: JointState(column, 0.0, 0.0) for joint, column in columns}
    states = LinkStates(model, base, Twist(), joints, np)
    return {name: states[name].pose for name in states}


def motion_in(model: RobotModel, trace: Trace, link: str, frame: str = WORLD) -> LinkMotion:
    """Return the motion of a link in a frame: "world", a link, else "base". Raise KeyError for an unknown link."""
    motion = link_motion(model, trace, link)
    if frame == WORLD:
        return motion
    return motion.seen_from(link_motion(model, trace, link_of_frame(model, frame)))


class LinkMotions(Mapping[str, LinkMotion]):
    """Link name -> its motion at the moments of a trace, in the world frame. Each is computed when it is read."""

    __slots__ = ("_model", "_trace")

    def __init__(self, model: RobotModel, trace: Trace) -> None:
        self._model, self._trace = model, trace

    def __getitem__(self, name: str) -> LinkMotion:
        return link_motion(self._model, self._trace, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._model.links_by_name)

    def __len__(self) -> int:
        return len(self._model.links)


class LinkStates(Mapping[str, LinkState]):
    """Link name -> pose and twist, world frame, computed when it is read: floats, or columns of T moments."""

    __slots__ = ("_base", "_functions", "_joints", "_known", "model")

    def __init__(
        self,
        model: RobotModel,
        pose: Pose,
        twist: Twist,
        joints: Mapping[str, JointState],
        functions: ModuleType = math,
    ) -> None:
        """`pose` and `twist`: of the base link; `functions`: the module with `sin` and `cos`."""
        self.model, self._base, self._joints, self._functions = model, (pose, twist), joints, functions
        self._known: dict[str, LinkState] | None = None

    def __getitem__(self, name: str) -> LinkState:
        states = self._known
        if states is None:
            states = self._known = {self.model.root: LinkState(*self._base)}
        state = states.get(name)
        return self._computed(name, states) if state is None else state

    def __iter__(self) -> Iterator[str]:
        return iter(self.model.links_by_name)

    def __len__(self) -> int:
        return len(self.model.links)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[type[ByName[LinkState]], tuple[dict[str, LinkState]]]:
        # A copy has the poses, and does not carry the model.
        return ByName, (dict(self),)

    def _computed(self, name: str, states: dict[str, LinkState]) -> LinkState:
        chain = [name]
        while chain[-1] not in states:
            joints = self.model.joints_to.get(chain[-1])
            if joints is None:
                raise KeyError(why_no_link(self.model, name))
            chain.append(joints[0].parent)
        for parent, child in zip(chain[:0:-1], chain[-2::-1], strict=True):
            states[child] = self._child(states[parent], self.model.joints_to[child])
        return states[name]

    def _child(self, above: LinkState, joints: tuple[Joint, ...]) -> LinkState:
        """Return the state of the link to which joints in series lead from its parent link."""
        first = joints[0]
        if first.ball and first.name == f"{first.ball}_z":
            return self._swung(first.ball)
        state = _carried(above, first.origin)
        for joint in joints:
            if joint.ball:
                state = self._moved(state, joint, *self._ball_rate(joint))
            elif joint.moves:
                state = self._moved(state, joint, *self._reading(joint))
        return state

    def _reading(self, joint: Joint) -> tuple[Any, Any]:
        """Return position and velocity of a joint."""
        state = self._joints.get(joint.name)
        if state is not None:
            return state.position, state.velocity
        if joint.mimic is None:
            return joint.home, 0.0
        position, velocity = self._reading(self.model.joints_by_name[joint.mimic.joint])
        return joint.mimic.multiplier * position + joint.mimic.offset, joint.mimic.multiplier * velocity

    def _moved(self, above: LinkState, joint: Joint, position: Any, velocity: Any) -> LinkState:
        """Return the state after a joint with one degree of freedom."""
        axis = geometry.rotate(above.pose.orientation_xyzw, joint.axis_xyz)
        if joint.type == "prismatic":
            pose, twist = _carried(above, Pose(geometry.scale(joint.axis_xyz, position)))
            return LinkState(
                pose, Twist(geometry.add(twist.linear_xyz, geometry.scale(axis, velocity)), twist.angular_xyz)
            )
        turn = _turn_of(joint.axis_xyz, position, self._functions)
        return _turned(
            above, joint.anchor_xyz, turn, geometry.add(above.twist.angular_xyz, geometry.scale(axis, velocity))
        )

    def _swung(self, ball: str) -> LinkState:
        """Return the state of the link below a ball joint: its readings hold the angular velocity of this link."""
        first, *others = (self.model.joints_by_name[f"{ball}_{axis}"] for axis in "xyz")
        above = _carried(self[first.parent], first.origin)
        (about_x, wx), (about_y, wy), (about_z, wz) = (self._reading(joint) for joint in (first, *others))
        turn = _turn_of((1.0, 0.0, 0.0), about_x, self._functions)
        turn = geometry.multiply(turn, _turn_of((0.0, 1.0, 0.0), about_y, self._functions))
        turn = geometry.multiply(turn, _turn_of((0.0, 0.0, 1.0), about_z, self._functions))
        own = geometry.rotate(geometry.multiply(above.pose.orientation_xyzw, turn), (wx, wy, wz))
        return _turned(above, first.anchor_xyz, turn, geometry.add(above.twist.angular_xyz, own))

    def _ball_rate(self, joint: Joint) -> tuple[Any, Any]:
        """Return the angle of the first or second rotation of a ball joint, and its rate."""
        (about_x, wx), (about_y, wy), (about_z, _) = (
            self._reading(self.model.joints_by_name[f"{joint.ball}_{axis}"]) for axis in "xyz"
        )
        sine, cosine = self._functions.sin(about_z), self._functions.cos(about_z)
        if joint.name == f"{joint.ball}_y":
            return about_y, sine * wx + cosine * wy
        level = self._functions.cos(about_y)
        return about_x, (cosine * wx - sine * wy) * level / (level * level + _POLE)


def _carried(above: LinkState, offset: Pose) -> LinkState:
    """Return the state of a frame that is fixed in another one."""
    (pose, twist), placed = above, geometry.compose(above.pose, offset)
    arm = geometry.subtract(placed.position_xyz, pose.position_xyz)
    swept = geometry.cross(twist.angular_xyz, arm)
    return LinkState(placed, Twist(geometry.add(twist.linear_xyz, swept), twist.angular_xyz))


def _turned(above: LinkState, anchor_xyz: Vector3, turn: Quaternion, angular_xyz: Vector3) -> LinkState:
    """Return the state of a frame that is turned in another one about an anchor, with its angular velocity."""
    pose, twist = above
    orientation = geometry.multiply(pose.orientation_xyzw, turn)
    if anchor_xyz == ZERO:
        return LinkState(Pose(pose.position_xyz, orientation), Twist(twist.linear_xyz, angular_xyz))
    before = geometry.rotate(pose.orientation_xyzw, anchor_xyz)
    after = geometry.rotate(orientation, anchor_xyz)
    anchor_linear = geometry.add(twist.linear_xyz, geometry.cross(twist.angular_xyz, before))
    linear = geometry.subtract(anchor_linear, geometry.cross(angular_xyz, after))
    return LinkState(
        Pose(geometry.subtract(geometry.add(pose.position_xyz, before), after), orientation), Twist(linear, angular_xyz)
    )


def _turn_of(axis_xyz: Vector3, angle: Any, functions: ModuleType) -> Quaternion:
    (x, y, z), sine = axis_xyz, functions.sin(angle / 2)
    return (sine * x, sine * y, sine * z, functions.cos(angle / 2))


def _states_of(model: RobotModel, trace: Trace) -> LinkStates:
    """Return the states of the links at all moments of a trace, as columns."""
    pose = Pose(_columns(trace.base_position_xyz), _columns(trace.base_orientation_xyzw))
    twist = Twist(_columns(trace.base_linear_xyz), _columns(trace.base_angular_xyz))
    readings = zip(trace.joint_position.T, trace.joint_velocity.T, trace.joint_effort.T, strict=True)
    joints: Any = {name: JointState(*columns) for name, columns in zip(trace.joint_names, readings, strict=True)}
    return LinkStates(model, pose, twist, joints, np)


def _columns(rows: FloatArray) -> Any:
    return tuple(rows.T)


def _rows(columns: Any) -> FloatArray:
    return np.column_stack(columns)


def centre_of_mass(model: RobotModel, trace: Trace, loads: Mapping[str, FloatArray] | None = None) -> FloatArray:
    """Return the positions (T, 3) in m of the robot's centre of mass, world frame; some link must have a mass.

    `loads`: link -> masses (T,) in kg that are added at its own centre of mass.
    """
    moments, total = np.zeros((len(trace), 3)), np.zeros((len(trace), 1))
    for link in (link for link in model.links if link.mass):
        motion = link_motion(model, trace, link.name)
        offset = geometry.rotate(_columns(motion.orientation_xyzw), link.centre_of_mass_xyz)
        mass = np.reshape((loads or {}).get(link.name, 0.0) + np.full(len(trace), link.mass), (-1, 1))
        moments += mass * (motion.position_xyz + _rows(offset))
        total += mass
    return moments / total
