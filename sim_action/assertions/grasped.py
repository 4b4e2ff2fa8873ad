"""`grasped: {object: cube, by: "*_finger"}`: the robot holds an object between its links."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import FORCE_WINDOW_S, Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Goal
from sim_action.assertions.monitors.windows import HoldTime
from sim_action.core import geometry, units
from sim_action.core.field_types import PositiveMetresPerSecond, PositiveNewtons, PositiveSeconds
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import link_name_problems, links_named
from sim_action.robot.model.kinematics import link_motion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Judged, Signal, Verdict
from sim_action.world.scene import Scene

# Of the forces of all links, at least this share must cancel: two equal forces do so from 120 deg on.
_MIN_BALANCE: Final = 0.5
# The least squeeze of a grip by default.
_SHARE_OF_WEIGHT: Final = 0.1
_MIN_SQUEEZE_N: Final = 1e-6


class Grasped(Assertion):
    """Links of the robot hold an object between them: at least two press it from opposed sides, and it does not slide.

    It is a goal. The object is held while, for the mean of the last 50 ms, at least two of the links `by` press it, at
    least half of the sum of their normal forces cancels (two equal forces differ by 120 deg or more), and it slides
    along none of them faster than `slip`. The squeeze is half of the forces that cancel: the force of each of two
    fingers. An object that is pushed from one side or lies on a palm is not held. One that is squeezed on the table is:
    to demand that it is lifted, add `object: {name: cube, moved: {up: 10 cm}}`.
    """

    key: ClassVar[str] = "grasped"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "goal",
        "The object was not held, and then it was held for the time `for`, with at least `at_least`.",
        "The object was never held so long or so strongly, or only from t = 0 on.",
    )

    object: Annotated[str, Field(min_length=1, description="name of the object, which must have a mass")]
    by: Annotated[tuple[str, ...], Field(min_length=1, description="two or more links, or patterns such as '*_finger'")]
    at_least: Annotated[
        PositiveNewtons | None, Field(description="least squeeze; default: a tenth of the weight of the object")
    ] = None
    slip: Annotated[PositiveMetresPerSecond, Field(description="greatest speed of the object along a link")] = 0.05
    span: Annotated[
        PositiveSeconds | None, Field(alias="for", description="required duration; default: one physics step")
    ] = None

    @property
    @override
    def channels(self) -> Channels:
        return Channels(objects=frozenset({self.object}), link_contacts=frozenset(self.by))

    is_goal: ClassVar[bool] = True
    has_truth: ClassVar[bool] = True

    hold_time: ClassVar[float | None] = delegated("span")

    @property
    @override
    def title(self) -> str:
        force = "" if self.at_least is None else f" with at least {units.display(self.at_least, 'N')}"
        span = "" if self.span is None else f" for {units.display(self.span, 's')}"
        return f"grasped {self.object} by {', '.join(self.by)}{force}{span}"

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield an unknown object, one without a mass, unknown links, and a single link."""
        bodies = {body.name: body for body in scene.world.objects}
        body = bodies.get(self.object)
        if body is None:
            yield ("object",), f"the world has no body '{self.object}'{did_you_mean(self.object, bodies)}"
        elif body.mass is None:
            yield ("object",), f"'{self.object}' has no mass, so the robot cannot hold it; give it one"
        unknown = list(link_name_problems(scene.model, "by", self.by))
        yield from unknown
        links = links_named(scene.model, self.by)
        if not unknown and len(links) < 2:
            yield ("by",), f"only '{links[0]}' is named, and it takes two links to hold an object; add another one"

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        mass = next((body.mass for body in scene.world.objects if body.name == self.object), None) or 0.0
        least = self.at_least or max(_MIN_SQUEEZE_N, _SHARE_OF_WEIGHT * mass * scene.world.weight)
        return GraspMonitor(self, scene.model, links_named(scene.model, self.by), least, HoldTime(self.span or 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Sample:
    """The forces of the links on the object, and its place, at T moments."""

    time: FloatArray  # (T,) s
    force: FloatArray  # (T, L, 3) N, the sum of the normal forces of each link on the object, world frame
    place: FloatArray  # (T, L, 3) m, the object in the frame of each link; NaN while it is not there

    def rows(self, mask: NDArray[np.bool_]) -> _Sample:
        """Return some of the moments."""
        return _Sample(self.time[mask], self.force[mask], self.place[mask])

    def followed_by(self, later: _Sample) -> _Sample:
        """Return the moments before `later` starts, and then all moments of `later`."""
        before = self.rows(self.time < later.time[0] - TIME_EPSILON_S)
        pairs = ((before.time, later.time), (before.force, later.force), (before.place, later.place))
        return _Sample(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True, slots=True, eq=False)
class _Grip:
    """The grip at T moments, as the mean over the window before each."""

    touching: NDArray[np.bool_]  # (T, L) True where a link presses the object
    # total, resultant: (T,) N, the sum of the forces of the links, and the length of their vector sum
    total: FloatArray
    resultant: FloatArray
    slip: FloatArray  # (T, L) m/s, the speed of the object in the frame of each link

    @property
    def squeeze(self) -> FloatArray:
        """Half of the forces that cancel, (T,) N."""
        squeeze: FloatArray = (self.total - self.resultant) / 2
        return squeeze

    @property
    def fastest(self) -> FloatArray:
        """The greatest speed along a link that presses the object, (T,) m/s; NaN while it is not known."""
        return np.asarray(np.where(self.touching, self.slip, 0.0).max(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class GraspMonitor(Monitor):
    """The fold of the time for which the object is held, and of the squeeze."""

    is_goal = True

    spec: Grasped
    model: RobotModel
    links: tuple[str, ...]  # the links that may hold it
    least: float  # the least squeeze in N
    stretch: HoldTime
    best: Goal = Goal()  # the fold of the squeeze while the grip is sound, else 0
    before: _Sample | None = None  # the moments of the last window
    # links that pressed the object, and the squeeze in N, at the best moment so far, and the reason why that was no
    # grip
    nearest: tuple[int, float, str] = (0, 0.0, "no link touched it")
    steps: Judged = Judged()  # the steps at which contacts and poses are known
    end: float = 0.0  # sim time of the last step, in s

    state: ClassVar[State] = delegated("stretch.state")

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. The window reaches back to before the time window of the expectation."""
        return replace(self, before=self._window(trace)) if self._is_known(trace) else self

    @override
    def observe(self, trace: Trace) -> Self:
        if not self._is_known(trace):
            return self
        grip = self._grip(trace)
        squeeze = self._sound_squeeze(grip)
        return replace(
            self,
            stretch=self.stretch.observe(trace.time, squeeze >= self.least),
            best=self.best.observe(trace.time, squeeze - self.least),
            before=self._window(trace),
            nearest=self._nearest(grip),
            steps=self.steps.followed_by(trace.time),
            end=float(trace.time[-1]),
        )

    @override
    def truth(self, trace: Trace) -> Truth:
        if not self._is_known(trace):
            return Truth(trace.time, trace.time < -math.inf)
        return Truth(trace.time, self._sound_squeeze(self._grip(trace)) >= self.least)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the squeeze, which is 0 without a grip, and the time of the grip."""
        if not self._is_known(trace):
            return ()
        squeeze = self._sound_squeeze(self._grip(trace))
        name = f"squeeze of {self.spec.object}"
        curves = [Signal(name, "N", trace.time, squeeze, lower=self.least)]
        if self.spec.span is not None:
            lasting = self.stretch.lasting(trace.time, squeeze >= self.least)
            curves.insert(0, Signal(f"time holding {self.spec.object}", "s", trace.time, lasting, lower=self.spec.span))
        return tuple(curves)

    def verdict(self) -> Verdict:
        """Return the verdict on the squeeze, or on the time of the grip if `for` is given."""
        spec, passed, best = self.spec, self.state is State.HOLDS, self.best
        if best.margin is None or best.time is None:
            message = f"no contact or pose of {spec.object} to measure"
            return Verdict(False, None, self.least, None, "N", None, message, judged=self.steps)
        squeeze, least = units.display_apart(self.least + best.margin, self.least, "N")
        held = best.state is State.HOLDS
        if spec.span is not None and held:
            longest, required = units.display_apart(self.stretch.longest, spec.span, "s")
            lasted = longest if passed else f"at most {longest} of {required}"
            message = f"held {spec.object} for {lasted}, from {self.stretch.began:.2f} s on"
            margin = self.stretch.longest - spec.span
            return Verdict(
                passed, self.stretch.longest, spec.span, margin, "s", self.stretch.goal.time, message, judged=self.steps
            )
        if held:
            message = f"held {spec.object} at {best.time:.2f} s, squeezed with {squeeze}"
        elif self.least + best.margin > 0:
            message = f"held {spec.object} too weakly, with {squeeze} of {least} at {best.time:.2f} s"
        else:
            message = f"did not hold {spec.object} in {self.end:.1f} s: {self.nearest[2]}"
        return Verdict(
            held, self.least + best.margin, self.least, best.margin, "N", best.time, message, judged=self.steps
        )

    def _is_known(self, trace: Trace) -> bool:
        has_records = self.spec.object in trace.objects and all(link in trace.link_contacts for link in self.links)
        return has_records and len(trace) > 0

    def _sound_squeeze(self, grip: _Grip) -> FloatArray:
        opposed = (grip.touching.sum(axis=1) >= 2) & (grip.resultant <= (1 - _MIN_BALANCE) * grip.total)
        sound: NDArray[np.bool_] = opposed & (grip.fastest <= self.spec.slip)
        return np.where(sound, grip.squeeze, 0.0)

    def _nearest(self, grip: _Grip) -> tuple[int, float, str]:
        """Return the best moment so far: the one with most links, and then the greatest squeeze."""
        count, squeeze = grip.touching.sum(axis=1), grip.squeeze
        at = int(np.lexsort((squeeze, np.minimum(count, 2)))[-1])
        rank = min(2, int(count[at])), float(squeeze[at])
        if rank <= self.nearest[:2]:
            return self.nearest
        links = ", ".join(link for link, on in zip(self.links, grip.touching[at], strict=True) if on)
        total, resultant = (units.display(float(force[at]), "N") for force in (grip.total, grip.resultant))
        if rank[0] < 2:
            return (*rank, f"only {links} touched it")
        if grip.resultant[at] > (1 - _MIN_BALANCE) * grip.total[at]:
            return (*rank, f"{links} pressed it from one side, {resultant} of {total} did not cancel")
        if not grip.fastest[at] <= self.spec.slip:
            return (*rank, f"it slid along {links} at {units.display(float(grip.fastest[at]), 'm/s')}")
        return (*rank, f"{links} pressed it too weakly")

    def _window(self, trace: Trace) -> _Sample:
        sample = self._joined(trace)
        return sample.rows(sample.time > sample.time[-1] - FORCE_WINDOW_S - TIME_EPSILON_S)

    def _joined(self, trace: Trace) -> _Sample:
        sample = self._sample(trace)
        return sample if self.before is None else self.before.followed_by(sample)

    def _grip(self, trace: Trace) -> _Grip:
        """Return the grip at each moment. Sums run step by step, so that they do not depend on how a trace is cut."""
        sample = self._joined(trace)
        first = len(sample.time) - len(trace)
        rows = np.arange(first, len(sample.time))
        force, count = np.zeros((len(rows), *sample.force.shape[1:])), np.zeros(len(rows))
        oldest = rows.copy()
        for back in range(len(sample.time)):
            index = rows - back
            inside = (index >= 0) & (sample.time[rows] - sample.time[index] < FORCE_WINDOW_S - TIME_EPSILON_S)
            if not inside.any():
                break
            force[inside] += sample.force[index[inside]]
            count[inside] += 1
            oldest[inside] = index[inside]
        force /= count[:, None, None]
        elapsed = sample.time[rows] - sample.time[oldest]
        away = sample.place[rows] - sample.place[oldest]
        ways = np.sqrt((away * away).sum(axis=2))
        slip = ways / np.where(elapsed > 0, elapsed, 1.0)[:, None]
        strength = np.sqrt((force * force).sum(axis=2))
        vector = force.sum(axis=1)
        return _Grip(strength > 0, strength.sum(axis=1), np.sqrt((vector * vector).sum(axis=1)), slip)

    def _sample(self, trace: Trace) -> _Sample:
        at = trace.objects[self.spec.object].position_xyz
        forces, places = [], []
        for link in self.links:
            record, motion = trace.link_contacts[link], link_motion(self.model, trace, link)
            moment = record.moment(trace.time)
            meant = np.array([body == self.spec.object for body in record.bodies], dtype=np.bool_)[record.body]
            meant &= moment >= 0
            force = np.zeros((len(trace), 3))
            # The normal points to the link, and the link presses the other way.
            np.add.at(force, moment[meant], -record.normal_xyz[meant] * record.force[meant, None])
            forces.append(force)
            back = geometry.conjugate(tuple(motion.orientation_xyzw.T))
            away = at - motion.position_xyz
            places.append(np.column_stack(geometry.rotate(back, tuple(away.T))))
        return _Sample(trace.time, np.stack(forces, axis=1), np.stack(places, axis=1))
