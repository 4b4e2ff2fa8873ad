"""Inverse kinematics: the joint positions at which a link has a pose, by damped least squares within the joint limits.

All arithmetic is on plain floats, so that every machine finds the same positions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import mul
from typing import Final, Self

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.model.kinematics import joint_motion
from sim_action.robot.model.robot_model import Joint, RobotModel

Values = tuple[float, ...]  # the positions of the joints of a chain, in rad (m if prismatic)
REACHED_M: Final = 1e-6  # a pose is reached if the link is nearer to it than this, in m
REACHED_RAD: Final = 1e-6  # the same for its orientation, in rad

MAX_STARTS: Final = 40
"""The search for a pose begins at this many positions of the joints: the given one, and others from a fixed table."""

MAX_POSITION_STARTS: Final = 12  # the same for the search for a position with any orientation, which is easier
_EXACT: Final = 1e-11  # nearer than this, in m and rad, the positions are not improved any more
_MAX_STEPS: Final = 100
# A search ends after this many steps in a row that reduce the error by less than this share.
_MAX_IDLE_STEPS: Final = 3
_LEAST_PROGRESS: Final = 0.01

# The damping, as a share of the square of the length of the chain: at the start, and its bounds.
_FIRST_DAMPING: Final = 1e-3
_LEAST_DAMPING: Final = 1e-12
_MAX_DAMPING: Final = 1e3

# A radian counts as much as this share of the length of the chain; and in the search for the nearest orientation.
_RADIAN: Final = 0.25
_LIGHT_RADIAN: Final = 0.001

# The search for a target out of reach ends if so many starts lead to the same error, in m.
_ENOUGH_ALIKE: Final = 5
_ALIKE: Final = 1e-5
_FREE_RANGE_M: Final = 1.0  # m: the range of a sliding joint without limits, to both sides, in the table of starts


@dataclass(frozen=True, slots=True)
class _Section:
    """A joint on the way from the base to the link, which turns about the z axis of a frame, or slides along it."""

    joint: Joint
    mount: Pose  # that frame at position 0, seen from the frame of the section before it
    column: int  # index of the joint of the chain that moves it
    multiplier: float  # rad or m per unit of that joint
    offset: float  # the position at 0 of that joint


@dataclass(frozen=True, slots=True)
class Solution:
    """The joint positions that a search found."""

    values: Values
    pose: Pose  # the pose of the link there, in the base frame
    distance: float  # m, from the target
    angle: float  # rad, between its orientation and the target's; 0 if any orientation will do
    error: float  # m, of both together

    @property
    def is_reached(self) -> bool:
        """True if the link is at the target."""
        return self.distance <= REACHED_M and self.angle <= REACHED_RAD


@dataclass(frozen=True, slots=True)
class Chain:
    """The joints that move a link relative to the base."""

    link: str  # its name
    joints: tuple[Joint, ...]  # the joints that can be commanded, from the base to the link
    lower: Values  # lower, upper: their limits, in rad or m; infinite if there are none
    upper: Values
    fastest: Values  # their largest speeds, in rad/s or m/s; infinite if there is no limit
    end: Pose  # the pose of the link in the frame of the last section
    length: float  # m; no point of the link's frame is farther from the base, apart from sliding joints without limits
    _sections: tuple[_Section, ...]

    @classmethod
    def of(cls, model: RobotModel, link: str, positions: Mapping[str, float]) -> Self:
        """Return the chain of a link; `positions`: rad or m, of the joints that cannot be commanded."""
        joints: dict[str, Joint] = {}
        sections: list[_Section] = []
        mount = Pose()
        for socket, joint in _way(model, link):
            mount = geometry.compose(mount, socket)
            if not joint.moves:
                continue
            gear = model.gear(joint.name)
            leader = model.joints_by_name[gear.joint]
            if not _can_move(model, leader):
                mount = geometry.compose(mount, joint_motion(joint, positions.get(joint.name, joint.home)))
                continue
            joints.setdefault(leader.name, leader)
            axis = Pose(joint.anchor_xyz, _from_z(joint.axis_xyz))
            column = list(joints).index(leader.name)
            sections.append(_Section(joint, geometry.compose(mount, axis), column, gear.multiplier, gear.offset))
            mount = geometry.inverse(axis)
        limits = [_limits(sections, column) for column in range(len(joints))]
        sliding = [section.joint for section in sections if section.joint.type == "prismatic"]
        strokes = sum(max(abs(joint.lower or 0.0), abs(joint.upper or 0.0)) for joint in sliding)
        lengths = (math.hypot(*pose.position_xyz) for pose in (mount, *(section.mount for section in sections)))
        return cls(
            link=link,
            joints=tuple(joints.values()),
            lower=tuple(lower for lower, _, _ in limits),
            upper=tuple(upper for _, upper, _ in limits),
            fastest=tuple(fastest for _, _, fastest in limits),
            end=mount,
            length=sum(lengths) + strokes,
            _sections=tuple(sections),
        )

    def pose(self, values: Sequence[float]) -> Pose:
        """Return the pose of the link in the base frame at positions of the joints."""
        return self.motions(values)[0]

    def inside(self, values: Sequence[float]) -> Values:
        """Return the nearest positions within the limits."""
        bounds = zip(values, self.lower, self.upper, strict=True)
        return tuple(min(max(value, lower), upper) for value, lower, upper in bounds)

    def motions(self, values: Sequence[float]) -> tuple[Pose, list[list[float]]]:
        """Return the pose of the link, and for each joint its velocity (6,) per unit: linear, angular, base frame."""
        x, y, z, w = geometry.IDENTITY
        px, py, pz = geometry.ZERO
        axes = []
        # Written out: a path has thousands of such poses.
        for section in self._sections:
            (mx, my, mz), (rx, ry, rz, rw) = section.mount.position_xyz, section.mount.orientation_xyzw
            tx, ty, tz = 2 * (y * mz - z * my), 2 * (z * mx - x * mz), 2 * (x * my - y * mx)
            px += mx + w * tx + y * tz - z * ty
            py += my + w * ty + z * tx - x * tz
            pz += mz + w * tz + x * ty - y * tx
            x, y, z, w = (
                w * rx + x * rw + y * rz - z * ry,
                w * ry - x * rz + y * rw + z * rx,
                w * rz + x * ry - y * rx + z * rw,
                w * rw - x * rx - y * ry - z * rz,
            )
            ax, ay, az = 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
            axes.append((ax, ay, az, px, py, pz))
            position = section.multiplier * values[section.column] + section.offset
            if section.joint.type == "prismatic":
                px, py, pz = px + position * ax, py + position * ay, pz + position * az
            else:
                sine, cosine = math.sin(position / 2), math.cos(position / 2)
                x, y, z, w = x * cosine + y * sine, y * cosine - x * sine, z * cosine + w * sine, w * cosine - z * sine
        end = geometry.compose(Pose((px, py, pz), (x, y, z, w)), self.end)
        px, py, pz = end.position_xyz
        columns = [[0.0] * 6 for _ in self.joints]
        for section, (ax, ay, az, qx, qy, qz) in zip(self._sections, axes, strict=True):
            if section.joint.type == "prismatic":
                velocity = (ax, ay, az, 0.0, 0.0, 0.0)
            else:
                dx, dy, dz = px - qx, py - qy, pz - qz
                velocity = (ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx, ax, ay, az)
            column, factor = columns[section.column], section.multiplier
            columns[section.column] = [at + factor * part for at, part in zip(column, velocity, strict=True)]
        return end, columns


def _way(model: RobotModel, link: str) -> Iterator[tuple[Pose, Joint]]:
    """Yield the joints from the base to a link; each with its place relative to the joint before it."""
    groups = []
    while group := [joint for joint in model.joints if joint.child == link]:
        groups.append(group)
        link = group[0].parent
    for group in reversed(groups):
        # The joints of one link of MJCF have one place.
        for index, joint in enumerate(group):
            yield (Pose() if index else joint.origin), joint


def _can_move(model: RobotModel, joint: Joint) -> bool:
    if model.why_not_driven(joint.name) is not None or joint.series or joint.stiffness:
        return False
    return joint.motor is not None or all(other.motor is None for other in model.joints)


def _limits(sections: Sequence[_Section], column: int) -> tuple[float, float, float]:
    """Return the lower and upper limit and the largest speed of a joint; joints that follow it limit it too."""
    lower, upper, fastest = -math.inf, math.inf, math.inf
    for section in sections:
        joint, factor = section.joint, section.multiplier
        if section.column != column or not factor:
            continue
        ends = sorted((end - section.offset) / factor for end in joint.range)
        lower, upper = max(lower, ends[0]), min(upper, ends[1])
        if joint.max_velocity:
            fastest = min(fastest, joint.max_velocity / abs(factor))
    return lower, upper, fastest


def _from_z(axis: Vector3) -> Quaternion:
    """Return the rotation that turns the z axis to a unit vector, on the short way."""
    x, y, z = axis
    if z < 0:
        # Half a turn about x comes first: near -z, the short way from z is not well defined.
        length = math.hypot(-y, x, 1 - z)
        return geometry.multiply((y / length, -x / length, 0.0, (1 - z) / length), (1.0, 0.0, 0.0, 0.0))
    length = math.hypot(-y, x, 1 + z)
    return (-y / length, x / length, 0.0, (1 + z) / length)


def reach(chain: Chain, target: Pose, start: Sequence[float], *, turns: bool = True) -> Solution:
    """Return the joint positions nearest to a target that are found from `start`; not `turns`: any orientation."""
    return _Search(chain, target, turns=turns).from_start(chain.inside(start))


def search(chain: Chain, target: Pose, start: Sequence[float], *, turns: bool = True) -> Solution:
    """Return joint positions that reach a target, from `start` or a fixed table of starts; else the nearest ones.

    If the position of the target is out of reach, they are nearest in position; else in orientation, at that position.
    """
    at_once = reach(chain, target, start, turns=turns)
    if at_once.is_reached:
        return at_once
    near = _Search(chain, target, turns=False)
    starts = [chain.inside(start), *_starts(chain)]
    best = _best(near, starts[:MAX_POSITION_STARTS])
    if not turns or best.distance > REACHED_M:
        return best
    solution = _best(_Search(chain, target, turns=True), [best.values, *starts[1:]])
    return solution if solution.is_reached else _Search(chain, target, radian=_LIGHT_RADIAN).from_start(solution.values)


def _best(near: _Search, starts: Iterable[Values]) -> Solution:
    """Return the first solution that reaches the target, or the nearest one: it ends early if several are alike."""
    best: Solution | None = None
    alike = 0
    for values in starts:
        solution = near.from_start(values)
        if solution.is_reached:
            return solution
        gain = math.inf if best is None else best.error - solution.error
        alike = 1 if gain > _ALIKE else alike + (gain > -_ALIKE)
        best = solution if best is None or gain > 0 else best
        if alike == _ENOUGH_ALIKE:
            break
    assert best is not None
    return best


def _starts(chain: Chain) -> Iterator[Values]:
    """Yield the fixed table of starts: the middle, and points that fill the ranges of the joints evenly."""
    ranges = [_usual_range(*joint_limits) for joint_limits in zip(chain.joints, chain.lower, chain.upper, strict=True)]
    # The roots of x^(d + 1) = x + 1 fill d dimensions evenly (Roberts 2018).
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (len(ranges) + 1))
    for index in range(MAX_STARTS - 1):
        shares = ((0.5 + index / ratio ** (axis + 1)) % 1.0 for axis in range(len(ranges)))
        yield tuple(low + share * (high - low) for share, (low, high) in zip(shares, ranges, strict=True))


def _usual_range(joint: Joint, lower: float, upper: float) -> tuple[float, float]:
    """Return the range of a joint for starts: at most one turn."""
    half = _FREE_RANGE_M if joint.type == "prismatic" else math.pi
    if math.isfinite(lower) and math.isfinite(upper):
        middle = (lower + upper) / 2
        return (lower, upper) if joint.type == "prismatic" else (max(lower, middle - half), min(upper, middle + half))
    return max(lower, joint.home - half), min(upper, joint.home + half)


class _Search:
    """The search for one target."""

    def __init__(self, chain: Chain, target: Pose, *, turns: bool = True, radian: float = _RADIAN) -> None:
        self._chain = chain
        self._target = target
        self._rows = 6 if turns else 3
        self._length = max(chain.length, 1e-3)
        self._radian = radian * self._length

    def from_start(self, values: Values) -> Solution:
        """Return the nearest positions that are found from a start within the limits."""
        damping = _FIRST_DAMPING
        pose, columns = self._chain.motions(values)
        error = self._error(pose)
        cost = square_sum(error)
        idle = 0
        for _ in range(_MAX_STEPS):
            distance, angle = self._errors(error)
            if (distance < _EXACT and angle < _EXACT) or idle > _MAX_IDLE_STEPS or damping > _MAX_DAMPING:
                break
            tried = self._stepped(values, columns, error, damping * self._length**2)
            if tried == values:
                break
            tried_pose, tried_columns = self._chain.motions(tried)
            tried_error = self._error(tried_pose)
            tried_cost = square_sum(tried_error)
            if tried_cost < cost:
                idle = 0 if tried_cost < (1 - _LEAST_PROGRESS) * cost else idle + 1
                values, pose, columns, error, cost = tried, tried_pose, tried_columns, tried_error, tried_cost
                damping = max(damping / 10, _LEAST_DAMPING)
            else:
                damping *= 4
        distance, angle = self._errors(error)
        return Solution(values, pose, distance, angle, math.sqrt(cost))

    def _error(self, pose: Pose) -> list[float]:
        """Return the way to the target: m, and turns in m of the length of a radian."""
        error = [to - at for at, to in zip(pose.position_xyz, self._target.position_xyz, strict=True)]
        if self._rows == 3:
            return error
        turn = geometry.twist_between(pose, self._target, 1.0).angular_xyz
        return [*error, *(self._radian * part for part in turn)]

    def _errors(self, error: Sequence[float]) -> tuple[float, float]:
        return math.hypot(*error[:3]), math.hypot(*error[3:]) / self._radian

    def _stepped(
        self, values: Values, columns: Sequence[Sequence[float]], error: Sequence[float], damping: float
    ) -> Values:
        """Return the positions after a step of damped least squares; a joint does not leave its limits."""
        unit = self._radian
        turned = ((x, y, z, rx * unit, ry * unit, rz * unit) for x, y, z, rx, ry, rz in columns)
        jacobian = [column[: self._rows] for column in turned]
        held = set[int]()
        # A joint at a limit that would leave it is held, and the others move without it.
        while True:
            free = [column for column in range(len(values)) if column not in held]
            step = [0.0] * len(values)
            parts = damped_least_squares([jacobian[column] for column in free], error, damping)
            for column, part in zip(free, parts, strict=True):
                step[column] = part
            outside = {column for column in free if self._leaves(column, values[column], step[column])}
            if not outside:
                return self._chain.inside([value + part for value, part in zip(values, step, strict=True)])
            held |= outside

    def _leaves(self, column: int, value: float, step: float) -> bool:
        return value >= self._chain.upper[column] if step > 0 else step < 0 and value <= self._chain.lower[column]


# The least square of a diagonal element, as a share of the damping: rounding may make it negative.
_LEAST_SHARE: Final = 1e-12


def damped_least_squares(columns: Sequence[Sequence[float]], error: Sequence[float], damping: float) -> list[float]:
    """Return J' (J J' + damping)^-1 e, by the Cholesky decomposition; `columns`: of J; `error`: e."""
    rows = list(zip(*columns, strict=True)) if columns else [()] * len(error)
    factor: list[list[float]] = []
    solved: list[float] = []
    for index, row in enumerate(rows):
        parts: list[float] = []
        for above, other in zip(factor, rows, strict=False):
            total = math.fsum(map(mul, row, other)) - math.fsum(map(mul, parts, above))
            parts.append(total / above[-1])
        total = math.fsum(map(mul, row, row)) + damping - math.fsum(map(mul, parts, parts))
        parts.append(math.sqrt(max(total, _LEAST_SHARE * damping)))
        factor.append(parts)
        solved.append((error[index] - math.fsum(map(mul, parts, solved))) / parts[-1])
    for index in reversed(range(len(rows))):
        below = [factor[row][index] for row in range(index + 1, len(rows))]
        solved[index] = (solved[index] - math.fsum(map(mul, below, solved[index + 1 :]))) / factor[index][index]
    return [math.fsum(map(mul, column, solved)) for column in columns]


def square_sum(parts: Sequence[float]) -> float:
    """Return the sum of the squares."""
    return math.fsum(map(mul, parts, parts))
