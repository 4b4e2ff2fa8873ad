"""`feet_on_ground: {links: ['*_foot'], at_least: 3}` and `support_margin`: how a robot stands on its legs."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Invariant, check_order, joined
from sim_action.core import geometry, units
from sim_action.core.field_types import Metres
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import link_name_problems, links_named
from sim_action.robot.model.kinematics import centre_of_mass, link_motion, link_poses, shape_points
from sim_action.robot.model.robot_model import RobotModel, Shape
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Judged, Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.physics import GROUND, Disturbance
from sim_action.world.scene import Scene

_SETTLE: Final = "; without physics.settle the robot is still in the air at t = 0: set 'after'"


class Feet(Assertion):
    """The base class of assertions on feet."""

    links: Annotated[
        tuple[str, ...], Field(min_length=1, description="the feet: links of the robot, or patterns such as '*_foot'")
    ]
    on: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="what feet may stand on; default: the ground and every object without a mass"),
    ] = None

    has_truth: ClassVar[bool] = True

    @property
    @override
    def channels(self) -> Channels:
        return Channels(link_contacts=frozenset(self.links))

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown links and bodies, a fixed base, and a world without gravity."""
        yield from link_name_problems(scene.model, "links", self.links)
        bodies = [GROUND, *scene.world.names]
        hinted = FirstFew()
        for index, name in enumerate(self.on or ()):
            if name not in bodies:
                hint = did_you_mean(name, bodies) if hinted.one_more() else ""
                yield ("on", index), f"the world has no body '{name}'{hint}"
        if scene.bolted and not any(_rises(scene.model, foot) for foot in links_named(scene.model, self.links)):
            fixed, remedy = "the base of the robot is fixed", "remove 'base: fixed'"
            if scene.robot.base is None:
                fixed, remedy = (
                    "its root link is 'world', which is fixed",
                    "give its body a <freejoint>, or a joint that lets it rise"
                    if scene.model.mjcf
                    else "rename the link, or write robot: {base: free}",
                )
            yield (), f"{fixed}, so it does not stand on its feet; {remedy}"
        if not scene.world.weight:
            yield (), "the world has no gravity, so nothing stands on the ground; change world.gravity"

    def footing(self, scene: Scene) -> Footing:
        """Return the contacts that carry the robot."""
        solid = (GROUND, *(body.name for body in scene.world.objects if body.mass is None))
        x, y, z = scene.world.gravity_xyz
        weight = scene.world.weight or 1.0
        up = (-x / weight, -y / weight, -z / weight)
        return Footing(links_named(scene.model, self.links), frozenset(solid if self.on is None else self.on), up)


def _rises(model: RobotModel, link: str) -> bool:
    """Return True if a joint raises a link of a robot with a fixed base, as on a rail, in a plane or on a boom."""
    poses = link_poses(model, model.positions({}))
    name = link
    while joints := model.joints_to.get(name):
        for joint in (joint for joint in joints if joint.moves and name in poses):
            way = geometry.rotate(poses[name].orientation_xyzw, joint.axis_xyz)
            if joint.type != "prismatic":
                anchor = geometry.compose(poses[name], Pose(joint.anchor_xyz)).position_xyz
                way = geometry.cross(way, geometry.subtract(poses[link].position_xyz, anchor))
            if abs(way[2]) > math.cos(MAX_SLOPE_RAD) * math.hypot(*way):
                return True
        name = joints[0].parent
    return False


class FeetOnGround(Feet):
    """The number of feet on the ground is never less than `at_least`, and never more than `at_most`.

    Without both, all feet must be on the ground. A foot is on the ground while it touches the ground, or an object that
    `on` names, where the surface is not steeper than 60 deg: a foot that touches a wall is not on the ground. For a
    robot that must jump, see `not`: `not: {feet_on_ground: {links: ['*_foot'], at_least: 1}}`.
    """

    key: ClassVar[str] = "feet_on_ground"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "invariant",
        "At every step, at least `at_least` and at most `at_most` of the feet were on the ground. If no "
        "foot ever was, the [audit of claims](claims.md) adds a warning to an `at_most` above 0.",
        "At a step, fewer or more feet were on the ground.",
    )

    at_least: Annotated[int | None, Field(ge=1, description="an invariant: number of feet; default: all")] = None
    at_most: Annotated[
        int | None, Field(ge=0, description="an invariant: number of feet; 0: the robot is in the air")
    ] = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        check_order(self.at_least, self.at_most, "")
        return self

    @property
    @override
    def title(self) -> str:
        named = (("at least", self.at_least), ("at most", self.at_most))
        bounds = ", ".join(f"{name} {value}" for name, value in named if value is not None)
        return f"feet_on_ground {bounds or 'all'} of {', '.join(self.links)}"

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        if self.at_most and run.verdict.passed and run.verdict.measured == 0:
            message = "no foot was ever on the ground, so the limit was compared with 0 only"
            yield ClaimFinding("never-touched", (), f"{message}; use at_most: 0 if it must be so")

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield the problems of feet, and numbers that cannot be reached or exceeded."""
        yield from super().problems(scene)
        feet = len(links_named(scene.model, self.links))
        if feet and self.at_least is not None and self.at_least > feet:
            yield ("at_least",), f"'links' matches only {feet} of the robot's links; lower it, or add links"
        if feet and self.at_most is not None and self.at_most >= feet:
            yield ("at_most",), f"'links' matches only {feet} of the robot's links, so it cannot be exceeded; lower it"

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        footing = self.footing(scene)
        least = self.at_least or (len(footing.feet) if self.at_most is None else None)
        return FeetMonitor(footing, least, self.at_most, _SETTLE if not scene.physics.settle else "")


MAX_SLOPE_RAD: Final = math.radians(60)  # a surface that is steeper than this carries no foot: it is a wall

# Pairs of contact points are compared at once, for as many moments as this many numbers allow.
_MAX_NUMBERS: Final = 2_000_000
_ON_LINE_M: Final = 1e-9  # m: points nearer to a line than this are on it
_ON_GROUND_M: Final = 1e-4  # m: corners of a foot that are no higher are on the ground
_DIRECTIONS: Final = 16  # of a foot with more corners, the outermost one in each direction counts


@dataclass(frozen=True, slots=True)
class Footing:
    """The contacts that carry the robot."""

    feet: tuple[str, ...]  # names of links
    bodies: frozenset[str]  # names of the bodies that they may stand on
    up_xyz: Vector3  # the unit vector against gravity, world frame

    def is_known(self, trace: Trace) -> bool:
        """Return True if the trace has the contacts of all feet."""
        return all(foot in trace.link_contacts for foot in self.feet)

    def standing(self, trace: Trace) -> NDArray[np.bool_]:
        """Return (F, T) True where a foot is on the ground."""
        moments = (self._points(trace, foot)[0] for foot in self.feet)
        return np.array([np.bincount(moment, minlength=len(trace)) > 0 for moment in moments])

    def points(self, model: RobotModel, trace: Trace) -> tuple[NDArray[np.intp], FloatArray]:
        """Return where all feet rest: the index (N,) of the moment, rising, and the place (N, 3) in m."""
        per_foot = [self._points(trace, foot) for foot in self.feet]
        # PyBullet lists only as many contacts of a flat foot as keep it at rest.
        for foot in self.feet if GROUND in self.bodies else ():
            shapes = model.links_by_name[foot].collisions
            flat = (shape for shape in shapes if shape.kind == "box" or shape.hulls or shape.corners)
            per_foot += [_corners(model, trace, foot, shape) for shape in flat]
        moment = np.concatenate([moments for moments, _ in per_foot])
        order = np.argsort(moment, kind="stable")
        return moment[order], np.concatenate([points for _, points in per_foot])[order]

    def level(self, points_xyz: FloatArray) -> FloatArray:
        """Return points (N, 3) as seen along gravity, (N, 2) m."""
        x, y, z = self.up_xyz
        # The axis that is least vertical gives a direction that is level.
        axis = np.eye(3)[int(np.argmin(np.abs((x, y, z))))]
        first = axis - np.dot(axis, self.up_xyz) * np.array(self.up_xyz)
        first /= math.sqrt(float(np.dot(first, first)))
        second = np.cross(self.up_xyz, first)
        # Element by element: the result for one moment must not depend on the others.
        return np.column_stack([(points_xyz * direction).sum(axis=1) for direction in (first, second)])

    def _points(self, trace: Trace, foot: str) -> tuple[NDArray[np.intp], FloatArray]:
        record = trace.link_contacts[foot]
        allowed = np.array([body in self.bodies for body in record.bodies], dtype=np.bool_)[record.body]
        moment = record.moment(trace.time)
        steepness = (record.normal_xyz * np.array(self.up_xyz)).sum(axis=1)
        carries = allowed & (moment >= 0) & (steepness >= math.cos(MAX_SLOPE_RAD))
        return moment[carries], record.position_xyz[carries]


def _corners(model: RobotModel, trace: Trace, foot: str, shape: Shape) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the corners of a shape of a foot that are on the ground while the foot is, as `Footing.points`."""
    record, motion = trace.link_contacts[foot], link_motion(model, trace, foot)
    on_ground = np.array([body == GROUND for body in record.bodies], dtype=np.bool_)[record.body]
    rows = np.unique(record.moment(trace.time)[on_ground])
    turned: Any = motion.orientation_xyzw[rows].T[:, :, None]
    corners: Any = shape_points(shape).T
    places = np.stack(geometry.rotate(turned, corners), axis=2) + motion.position_xyz[rows][:, None]
    if places.shape[1] > _DIRECTIONS:
        angles = np.arange(_DIRECTIONS) * (math.tau / _DIRECTIONS)
        reach = places[..., :1] * np.cos(angles) + places[..., 1:2] * np.sin(angles)
        outer = np.where(places[..., 2:] <= _ON_GROUND_M, reach, -math.inf).argmax(axis=1)
        places = np.take_along_axis(places, outer[..., None], axis=1)
    row, corner = np.nonzero((places[..., 2] <= _ON_GROUND_M) & (rows >= 0)[:, None])
    return rows[row], places[row, corner]


def support_margins(centre_xy: FloatArray, moment: NDArray[np.intp], points_xy: FloatArray) -> FloatArray:
    """Return the distances (T,) in m of a point to the edge of the support polygon, negative outside.

    The polygon of a moment is the convex hull of its points; without a point, the distance is minus infinity.
    `centre_xy`: the point, (T, 2) m; `moment`: the index (N,) of the moment of each point of the polygons, rising;
    `points_xy`: the points of the polygons, (N, 2) m.
    """
    margins = np.full(len(centre_xy), -math.inf)
    counts = np.bincount(moment, minlength=len(centre_xy))
    starts = np.cumsum(counts) - counts
    for count in np.unique(counts[counts > 0]).tolist():
        rows = np.flatnonzero(counts == count)
        several = max(1, _MAX_NUMBERS // count**2)
        for first in range(0, len(rows), several):
            some = rows[first : first + several]
            polygons = points_xy[starts[some][:, None] + np.arange(count)]
            margins[some] = _margins(centre_xy[some], polygons)
    return margins


def _margins(centre: FloatArray, points: FloatArray) -> FloatArray:
    """Return the same (T,) for polygons (T, K, 2) of as many points."""
    ways = points[:, None, :, :] - points[:, :, None, :]
    lengths = np.sqrt((ways * ways).sum(axis=3))
    # An edge leads to the point that is furthest to the right, as seen from its first point towards the middle.
    middle = (points.mean(axis=1, keepdims=True) - points)[:, :, None, :]
    ahead = np.sqrt((middle * middle).sum(axis=3)) * lengths + (middle * ways).sum(axis=3)
    is_ahead = (lengths > _ON_LINE_M) & (ahead > 0)
    turns = (middle[..., 0] * ways[..., 1] - middle[..., 1] * ways[..., 0]) / np.where(is_ahead, ahead, 1.0)
    # Of points on one line, the last one counts.
    ends = np.where(is_ahead, turns.round(10) - 1e-12 * lengths, math.inf).argmin(axis=2)[..., None]
    edges, lengths = np.take_along_axis(ways, ends[..., None], axis=2), np.take_along_axis(lengths, ends, axis=2)
    # The side of each point, and of the centre, as seen along the edge.
    sides = edges[..., 0] * ways[..., 1] - edges[..., 1] * ways[..., 0]
    is_edge = (lengths[..., 0] > _ON_LINE_M) & (sides >= -_ON_LINE_M * lengths).all(axis=2)
    safe, edges = np.where(lengths > _ON_LINE_M, lengths, 1.0)[..., 0], edges[:, :, 0]
    arms = centre[:, None, :] - points
    inside = (edges[..., 0] * arms[..., 1] - edges[..., 1] * arms[..., 0]) / safe
    along = ((edges * arms).sum(axis=2) / safe**2).clip(0.0, 1.0)
    away = arms - along[..., None] * edges
    distance = np.sqrt((away * away).sum(axis=2))
    least = np.where(is_edge, inside, math.inf).min(axis=1)
    to_edge = np.where(is_edge, distance, math.inf).min(axis=1)
    to_point = np.sqrt((arms * arms).sum(axis=2)).min(axis=1)
    outside = np.minimum(to_edge, to_point)
    # Without an edge, all points are at one place. If all are on one line, `least` is 0 on the whole line.
    return np.asarray(np.where(np.isfinite(least) & (least > 0), least, 0.0 - outside))


@dataclass(frozen=True, slots=True)
class FeetMonitor(Monitor):
    """The fold of the number of feet on the ground."""

    is_momentary = True

    footing: Footing
    at_least: int | None  # at_least, at_most: the limits; None: no limit
    at_most: int | None
    hint: str = ""  # added to the message of a failure at t = 0
    fewest: Invariant = Invariant()  # fewest, most: the folds of the margins
    most: Invariant = Invariant()
    aloft: tuple[str, ...] = ()  # the feet in the air at the step of `fewest`
    steps: Judged = Judged()  # the steps at which contacts are known

    @property
    @override
    def state(self) -> State:
        return joined(self.fewest.state, self.most.state)

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace) or not self.footing.is_known(trace):
            return self
        standing = self.footing.standing(trace)
        count = standing.sum(axis=0).astype(float)
        fewest, most, aloft = self.fewest, self.most, self.aloft
        if self.at_least is not None:
            fewest = fewest.observe(trace.time, count - self.at_least)
        if self.at_most is not None:
            most = most.observe(trace.time, self.at_most - count)
        if fewest is not self.fewest:
            on_ground = standing[:, int((trace.time == fewest.time).argmax())]
            aloft = tuple(foot for foot, on in zip(self.footing.feet, on_ground, strict=True) if not on)
        return replace(self, fewest=fewest, most=most, aloft=aloft, steps=self.steps.followed_by(trace.time))

    @override
    def truth(self, trace: Trace) -> Truth:
        count = self._count(trace)
        holds = count >= (self.at_least or 0)
        return Truth(trace.time, holds if self.at_most is None else holds & (count <= self.at_most))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the number of feet on the ground."""
        count = self._count(trace).astype(float)
        lower, upper = (None if limit is None else float(limit) for limit in (self.at_least, self.at_most))
        return (Signal("feet on the ground", "", trace.time, count, lower, upper),)

    def _count(self, trace: Trace) -> NDArray[np.intp]:
        if not self.footing.is_known(trace):
            return np.zeros(len(trace), dtype=np.intp)
        return np.asarray(self.footing.standing(trace).sum(axis=0))

    def verdict(self) -> Verdict:
        """Return the verdict on the limit that broke first, else on the limit with the smallest margin."""
        folds = [(self.fewest, self.at_least, 1, "at least"), (self.most, self.at_most, -1, "at most")]
        limits = [(fold, limit, sign, word) for fold, limit, sign, word in folds if limit is not None]
        broken = [one for one in limits if one[0].state is State.BROKEN]
        fold, limit, sign, word = (
            min(broken, key=lambda one: one[0].time or 0.0)
            if broken
            else min(limits, key=lambda one: one[0].margin or 0.0)
        )
        if fold.margin is None or fold.time is None:
            message = "no physics step to measure"
            return Verdict(not broken, None, float(limit), None, "", None, message, judged=self.steps)
        count = limit + sign * fold.margin
        message = (
            f"{count:g} of {len(self.footing.feet)} feet on the ground at {fold.time:.2f} s, {word} {limit} wanted"
        )
        if fold is self.fewest and self.aloft:
            message += f"; in the air: {', '.join(self.aloft)}"
        if broken and fold.time <= 0:
            message += self.hint
        return Verdict(not broken, float(count), float(limit), fold.margin, "", fold.time, message, judged=self.steps)


class SupportMargin(Feet):
    """The robot's centre of mass stays above the support polygon of its feet, by `at_least` or more from the edge.

    The support polygon is the convex hull of the contact points and soles of all feet on the ground (see
    `feet_on_ground`), as seen along gravity. The margin is the distance to its nearest edge, negative outside; on two
    point feet it is at most 0, and without a foot on the ground no limit holds. This is static stability, which says
    little about a robot that trots. Each `payload` counts, an object that the robot carries does not.
    """

    key: ClassVar[str] = "support_margin"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "invariant",
        "At every step, the centre of mass was at least `at_least` inside the support polygon.",
        "At a step, the centre of mass was nearer to the edge or outside, or no foot was on the ground.",
    )
    measured_unit: ClassVar[str | None] = "m"

    at_least: Annotated[Metres, Field(description="an invariant: distance of the centre of mass to the edge")] = 0.0

    @property
    @override
    def title(self) -> str:
        return f"support_margin at least {units.display(self.at_least, 'm')} on {', '.join(self.links)}"

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield the problems of feet, and a robot without a mass."""
        yield from super().problems(scene)
        if not scene.model.mass:
            yield (), "no link of the robot states a mass, so it has no centre of mass; add <inertial>"

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        hint = _SETTLE if not scene.physics.settle else ""
        payloads = tuple(load for load in scene.world.disturbances if load.payload is not None)
        return SupportMonitor(self.footing(scene), scene.model, self.at_least, hint, payloads)


@dataclass(frozen=True, slots=True)
class SupportMonitor(Monitor):
    """The fold of the distance of the centre of mass to the edge of the support polygon."""

    is_momentary = True

    footing: Footing
    model: RobotModel
    at_least: float
    hint: str = ""  # added to the message of a failure at t = 0
    payloads: tuple[Disturbance, ...] = ()  # on links
    fold: Invariant = Invariant()
    standing: tuple[str, ...] = ()  # the feet on the ground at the step of the fold
    steps: Judged = Judged()  # the steps at which contacts are known

    state: ClassVar[State] = delegated("fold.state")

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace) or not self.footing.is_known(trace):
            return self
        fold, standing = self.fold.observe(trace.time, self._margins(trace) - self.at_least), self.standing
        if fold is not self.fold:
            on_ground = self.footing.standing(trace)[:, int((trace.time == fold.time).argmax())]
            standing = tuple(foot for foot, on in zip(self.footing.feet, on_ground, strict=True) if on)
        return replace(self, fold=fold, standing=standing, steps=self.steps.followed_by(trace.time))

    @override
    def truth(self, trace: Trace) -> Truth:
        return Truth(trace.time, self._margins(trace) >= self.at_least)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the margin where a foot is on the ground."""
        margins = self._margins(trace)
        shown = np.where(np.isfinite(margins), margins, np.nan)
        return (Signal("support margin", "m", trace.time, shown, lower=self.at_least),)

    def _margins(self, trace: Trace) -> FloatArray:
        if not self.footing.is_known(trace):
            return np.full(len(trace), -np.inf)
        moment, points = self.footing.points(self.model, trace)
        loads: dict[str, FloatArray] = {}
        for load in self.payloads:
            link = load.link or self.model.root
            loads[link] = loads.get(link, np.zeros(len(trace))) + load.payload_at(trace.time)
        centre = self.footing.level(centre_of_mass(self.model, trace, loads))
        return support_margins(centre, moment, self.footing.level(points))

    def verdict(self) -> Verdict:
        """See Monitor.verdict. Without a foot on the ground there is no measured value."""
        fold, limit, passed = self.fold, self.at_least, self.fold.state is State.HOLDS
        if fold.margin is None or fold.time is None:
            return Verdict(passed, None, limit, None, "m", None, "no physics step to measure", judged=self.steps)
        hint = self.hint if not passed and fold.time <= 0 else ""
        if not self.standing:
            message = f"no foot was on the ground at {fold.time:.2f} s{hint}"
            return Verdict(False, None, limit, None, "m", fold.time, message, judged=self.steps)
        margin, least = units.display_apart(limit + fold.margin, limit, "m")
        feet = f"on {', '.join(self.standing)} at {fold.time:.2f} s"
        message = (
            f"margin at least {margin}, limit {least}, {feet}"
            if passed
            else f"margin {margin} {feet}, less than {least}{hint}"
        )
        return Verdict(passed, limit + fold.margin, limit, fold.margin, "m", fold.time, message, judged=self.steps)
