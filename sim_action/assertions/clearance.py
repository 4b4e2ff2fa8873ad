"""`clearance: {at_least: 20 cm, to: [wall]}`: the distance between the robot and bodies of the world."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Goal, Invariant, bounds_title, check_bounds, joined
from sim_action.assertions.monitors.contacts import clearance_signal, distances_known, least_so_far, recorded
from sim_action.core import units
from sim_action.core.field_types import PositiveMetres
from sim_action.core.lazy_numpy import np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import FirstFew, did_you_mean, quoted
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import links_with_shapes
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceRecord, ClearanceWatch, Nearness
from sim_action.state.verdict import Judged, Mark, Polyline, Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.distance_lines import distance_lines
from sim_action.world.physics import GROUND
from sim_action.world.robot_reach import out_of_reach
from sim_action.world.scene import Scene


class Clearance(Assertion):
    """The distance between the robot and bodies of the world is never less than `at_least`, or falls to `at_most` once.

    It is the least distance in space between collision shapes at every physics step; shapes that overlap have a
    negative distance. The ground counts only if `to` names it. PyBullet rounds the edges of boxes by 1 mm, so its
    distances to edges are up to 0.7 mm greater than in MuJoCo.
    """

    key: ClassVar[str] = "clearance"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "`at_least`: invariant; `at_most`: goal",
        "The distance was at least `at_least` at every step; or it was greater than `at_most` and then fell to it.",
        "The distance was less than `at_least` at a step; or it never fell to `at_most`, or only at t = 0.",
        "A link with a collision shape and a body of `to` were never there together, for example because "
        "the body appeared later. Or the run ended before `after`.",
    )
    measured_unit: ClassVar[str | None] = "m"
    sees_shapes: ClassVar[bool] = True

    at_least: Annotated[PositiveMetres | None, Field(description="an invariant: minimum distance")] = None
    at_most: Annotated[PositiveMetres | None, Field(description="a goal: the distance must fall to this value")] = None
    to: Annotated[
        tuple[str, ...] | None, Field(min_length=1, description="names of bodies; default: all but the ground")
    ] = None
    links: Annotated[tuple[str, ...] | None, Field(min_length=1, description="links of the robot; default: all")] = None
    link: Annotated[str | None, Field(min_length=1, description="one link, instead of 'links'")] = None

    @model_validator(mode="after")
    def _has_a_bound(self) -> Self:
        check_bounds(self.at_least, self.at_most, "m")
        if self.link is not None and self.links is not None:
            raise ValueError("give 'link' or 'links', not both")
        return self

    @property
    def chosen(self) -> tuple[str, ...] | None:
        """The names of the links whose distance counts; None for all."""
        return self.links if self.link is None else (self.link,)

    @property
    @override
    def names_links(self) -> bool:
        return self.chosen is not None

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        """Yield a distance between named links and bodies that cannot move."""
        objects = scene.world.objects
        moving = {body.name for body in objects if body.mass is not None or body.path}
        moving |= scene.actors.keys()
        bodies = set(scene.world.names if self.to is None else self.to)
        if self.chosen and scene.bolted_links.issuperset(self.chosen) and moving.isdisjoint(bodies):
            message = f"clearance checks nothing: neither {quoted(self.chosen)} nor the bodies can move"
            yield ClaimFinding("fixed-base", (), f"{message}; name a link or a body that moves")

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a distance from bodies that are all below the ground or above the robot."""
        bodies = [body for body in run.scene.world.objects if self.to is None or body.name in self.to]
        names = run.scene.world.names if self.to is None else self.to
        if not self.is_goal and GROUND not in names and run.scene.actors.keys().isdisjoint(names):
            yield from out_of_reach(run, bodies, self.at_least or 0.0)

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return False

    @override
    def meaning(self, scene: Scene) -> str:
        from sim_action.assertions.temporal_logic import quoted  # its name stands for another function here

        bodies = self.to or scene.world.names
        quantities = [f"{quoted(f'clearance of {self.chosen} to {bodies}')}.x"]
        if self.chosen is None:
            quantities = [clearance_signal(body) for body in bodies] or ["clearance"]
        above, below = (
            joint.join(f"{quantity} {relation} {limit!r}" for quantity in quantities)
            for joint, relation, limit in ((" and ", ">=", self.at_least), (" or ", "<=", self.at_most))
        )
        least = None if self.at_least is None else f"always ({above})"
        most = None if self.at_most is None else f"eventually ({below})"
        return " and ".join(part for part in (least, most) if part is not None)

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        whose = f" of {', '.join(self.chosen)}" if self.chosen else ""
        where = f" to {', '.join(self.to)}" if self.to else ""
        return f"clearance{whose}{where} {bounds_title(self.at_least, self.at_most, 'm')}"

    @property
    def watch(self) -> ClearanceWatch:
        """The distances that the monitor reads from a trace."""
        return ClearanceWatch(self.chosen, self.to)

    @property
    def close(self) -> ClearanceWatch:
        """The distances that are recorded at every step, up to the greatest limit: they say when the limits hold."""
        limit = self.at_least if self.at_most is None else self.at_most
        return ClearanceWatch(self.chosen, self.to, within=limit or 0.0, always=True)

    @property
    @override
    def channels(self) -> Channels:
        return self.truth_channels if self.is_goal else Channels(clearances=frozenset({self.watch}))

    @property
    @override
    def truth_channels(self) -> Channels:
        return Channels(clearances=frozenset({self.watch, self.close}))

    @property
    @override
    def is_goal(self) -> bool:
        return self.at_most is not None

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown bodies and links, and a world without objects."""
        bodies = scene.world.names
        if self.to is None and not bodies:
            yield (), "the world has no objects to keep clear of; add some to world.objects"
        hinted = FirstFew()
        for index, name in enumerate(self.to or ()):
            if name not in (*bodies, GROUND):
                hint = did_you_mean(name, (*bodies, GROUND)) if hinted.one_more() else ""
                yield ("to", index), f"the world has no body '{name}'{hint}"
        links = links_with_shapes(scene.model)
        for index, name in enumerate(self.chosen or ()):
            if name not in links:
                hint = did_you_mean(name, links) if hinted.one_more() else ""
                yield (
                    ("link",) if self.link else ("links", index),
                    f"the robot has no link '{name}' with a collision shape{hint}",
                )

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks. Returns a line at each limit around the bodies that do not move."""
        limits = (limit for limit in (self.at_least, self.at_most) if limit is not None)
        lines = (points for limit in limits for points in distance_lines(scene, self.to, limit))
        return tuple(Polyline(points, is_aside=True) for points in lines)

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        return ClearanceMonitor(self)


@dataclass(frozen=True, slots=True)
class ClearanceMonitor(Monitor):
    """The fold of the least distance against both bounds, with the links and bodies that decided."""

    spec: Clearance
    goal: Goal = Goal()
    invariant: Invariant = Invariant()
    at_goal: Nearness | None = None  # at_goal, at_worst: the least distances at the steps of the two folds
    at_worst: Nearness | None = None
    steps: Judged = Judged()
    is_known: bool = False  # True if a distance was recorded before them
    end: float = 0.0

    @property
    @override
    def state(self) -> State:
        return joined(self.invariant.state, State.HOLDS if self.spec.at_most is None else self.goal.state)

    @property
    def is_decided(self) -> bool:
        """See Monitor.is_decided. A distance below `at_most` decides if there is no `at_least`."""
        return self.state is State.BROKEN or (self.spec.at_least is None and self.state is State.HOLDS)

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. Distances before the window do not count, but show that there are distances."""
        return replace(self, is_known=self.is_known or len(self._recorded(trace)) > 0)

    @override
    def observe(self, trace: Trace) -> Self:
        record = self._recorded(trace)
        times = distances_known(trace, record, self.is_known or self.steps.moments > 0)
        end = float(trace.time[-1]) if len(trace) else self.end
        later = replace(self, end=end, steps=self.steps.followed_by(times))
        return later.measured(record) if len(record) else later

    def _recorded(self, trace: Trace) -> ClearanceRecord:
        return recorded(trace, *self._watches)

    @property
    def _watches(self) -> tuple[ClearanceWatch, ...]:
        return (self.spec.watch, self.spec.close) if self.spec.is_goal else (self.spec.watch,)

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. The moments are the steps at which a body is there, but for t = 0."""
        record = recorded(trace, self.spec.close)
        time = record.valid(trace.time[trace.time > TIME_EPSILON_S])
        distance = np.full(len(time), math.inf)
        if len(record) and len(time):
            # Two computations of the time of a step differ by rounding.
            index = np.searchsorted(time, record.time - TIME_EPSILON_S)
            inside = index < len(time)
            distance[index[inside]] = record.distance[inside]
        holds = np.ones(len(time), dtype=bool)
        if self.spec.at_most is not None:
            holds &= distance <= self.spec.at_most
        if self.spec.at_least is not None:
            holds &= distance >= self.spec.at_least
        return Truth(time, holds)

    def measured(self, record: ClearanceRecord) -> Self:
        """Return the fold after these distances."""
        spec, goal, invariant = self.spec, self.goal, self.invariant
        if spec.at_most is not None:
            goal = goal.observe(record.time, spec.at_most - record.distance)
        if spec.at_least is not None:
            invariant = invariant.observe(record.time, record.distance - spec.at_least)
        return replace(
            self,
            goal=goal,
            invariant=invariant,
            at_goal=self.at_goal if goal is self.goal else _moment(record, goal.time),
            at_worst=self.at_worst if invariant is self.invariant else _moment(record, invariant.time),
        )

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the least distance so far."""
        name = "least distance" + (f" to {', '.join(self.spec.to)}" if self.spec.to else "")
        time, distance = least_so_far(trace, *self._watches)
        return (Signal(name, "m", time, distance, self.spec.at_least, self.spec.at_most),) if len(time) else ()

    def verdict(self) -> Verdict:
        """Return the verdict on a broken lower bound, else on the goal, else on the lower bound."""
        if self.spec.at_most is None or self.invariant.state is State.BROKEN:
            return self._kept_clear()
        return self._came_near(self.spec.at_most)

    def _kept_clear(self) -> Verdict:
        limit, near, passed = self.spec.at_least, self.at_worst, self.invariant.state is State.HOLDS
        if limit is None or near is None:
            return self._unknown(limit)
        distance, least = units.display_apart(near.distance, limit, "m")
        message = f"{_nearness_text(near, distance)} at {near.time:.2f} s"
        message = f"closest approach: {message}" if passed else f"{message}, less than {least}"
        margin, body = self.invariant.margin, "" if passed else near.body
        return Verdict(passed, near.distance, limit, margin, "m", near.time, message, judged=self.steps, body=body)

    def _came_near(self, limit: float) -> Verdict:
        near, passed = self.at_goal, self.goal.state is State.HOLDS
        if near is None and self.steps.moments:
            # Only distances that are less than all before are recorded, or within the limit.
            message = f"never within {units.display(limit, 'm')} in {self.end:.1f} s"
            return Verdict(False, None, limit, None, "m", None, message, judged=self.steps)
        if near is None:
            return self._unknown(limit)
        distance, _ = units.display_apart(near.distance, limit, "m")
        message = (
            f"{_nearness_text(near, distance)} at {near.time:.2f} s"
            if passed
            else f"closest approach in {self.end:.1f} s: {_nearness_text(near, distance)} at {near.time:.2f} s"
        )
        margin, body = self.goal.margin, near.body if passed else ""
        return Verdict(passed, near.distance, limit, margin, "m", near.time, message, judged=self.steps, body=body)

    def _unknown(self, limit: float | None) -> Verdict:
        names = ", ".join(self.spec.to) if self.spec.to else "any body"
        message = (
            f"no distance to {names} was measured: it was not there, or no link of the robot has a collision shape"
        )
        return Verdict(False, None, limit, None, "m", None, message, judged=Judged())


def _nearness_text(near: Nearness, distance: str) -> str:
    if near.distance < 0:
        return f"{near.link} was inside {near.body} by {distance.removeprefix('-')}"
    return f"{near.link} was {distance} from {near.body}"


def _moment(record: ClearanceRecord, time: float | None) -> Nearness:
    return record.at(int((record.time == time).argmax()))
