"""`object: {name: cube, moved: {up: 10 cm}}`: a body of the world reaches a place, stays, stands, rests or moves."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Bounds, SignalMonitor, bounds_title, check_order
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.assertions.monitors.windows import Rest
from sim_action.assertions.reach import Reach
from sim_action.assertions.settled import Settled
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.upright import Upright
from sim_action.core import geometry, units
from sim_action.core.field_types import NonNegativeMetres, PositiveMetres, Without
from sim_action.core.geometry import Pose, Twist
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import LinkMotion, link_motion, link_of_frame, why_no_frame
from sim_action.robot.model.robot_model import WORLD
from sim_action.state.observation import Observation
from sim_action.state.timeline import waits
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Judged, Mark, Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, Setting
from sim_action.world.robot_reach import passed_by
from sim_action.world.scene import Scene

_OF_ROBOT: Final = Without(frozenset({"link"}))
_KINDS: Final = ("reach", "stay_within", "upright", "settled", "moved")


class Moved(MotionAssertion):
    """An object moves away from the place where it was at t = 0, or where it appeared.

    `at_least` is a goal and `at_most` an invariant on the distance in space. `up` is a goal on the height gained.
    """

    key: ClassVar[str] = "moved"

    at_least: Annotated[PositiveMetres | None, Field(description="a goal: distance from its start")] = None
    at_most: Annotated[NonNegativeMetres | None, Field(description="an invariant: distance from its start")] = None
    up: Annotated[PositiveMetres | None, Field(description="a goal: height gained along the z axis of 'frame'")] = None

    @model_validator(mode="after")
    def _has_a_bound(self) -> Self:
        check_order(self.at_least, self.at_most, "m")
        if (self.at_least, self.at_most, self.up) == (None, None, None):
            raise ValueError("give 'at_least', 'at_most' or 'up'")
        if self.up is not None and (self.at_least, self.at_most) != (None, None):
            raise ValueError("'up' stands alone; for a limit of the distance as well, add a second 'object'")
        return self

    @property
    @override
    def is_goal(self) -> bool:
        return self.at_least is not None or self.up is not None

    has_truth: ClassVar[bool] = True

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a limit that is longer than the way of anything that the robot pushes."""
        if self.at_most is not None and not self.is_goal and self.frame == WORLD:
            yield from run.beyond_drive(self.at_most, "give a smaller limit", ("at_most",))

    @override
    def title_of(self, watched: Watched) -> str:
        if self.up is not None:
            return f"{self.key_of(watched)} up by {units.display(self.up, 'm')}"
        return f"{self.key_of(watched)} {bounds_title(self.at_least, self.at_most, 'm')}"

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        place = start.pose.position_xyz
        if self.up is not None:
            rise = Bounds("rose", "m", self.up, None)
            return SignalMonitor("height gained", lambda trace: trace.base_position_xyz[:, 2] - place[2], rise)
        bounds = Bounds("moved", "m", self.at_least, self.at_most)
        return SignalMonitor("moved", lambda trace: trace.distance_to(place), bounds)


class ObjectAssertion(Assertion):
    """An object of the world does what one of the keys below `name` says.

    The keys have the fields of the assertions on the robot, without `link`. `moved` is the distance from where the
    object was at t = 0, or where it appeared: lifted by 10 cm is `moved: {up: 10 cm}`, still there is `moved: {at_most:
    1 cm}`. With `frame`, its pose is the one that a link sees: `moved: {at_most: 1 cm, frame: gripper}` says that a
    held object does not slip. The object must have a mass or a path.
    """

    key: ClassVar[str] = "object"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "`reach`, `settled`, `moved: at_least`, `moved: up`: goal; others: invariant",
        "`reach`, `settled`, `moved` with `at_least` or `up`: the object was elsewhere or in motion, and "
        "then it came true. `stay_within`, `upright`, `moved` with `at_most`: it held at every step.",
        "The goal never came true, or only from t = 0 on; or a limit was exceeded at a step.",
        "The object never appeared, or the run ended before `after`.",
    )

    name: Annotated[str, Field(min_length=1, description="name of the object")]
    reach: Annotated[Annotated[Reach, _OF_ROBOT] | None, Field(description="a goal: it comes to a place")] = None
    stay_within: Annotated[
        Annotated[StayWithin, _OF_ROBOT] | None, Field(description="an invariant: it stays inside a box")
    ] = None
    upright: Annotated[
        Annotated[Upright, _OF_ROBOT] | None, Field(description="an invariant: it does not tip over")
    ] = None
    settled: Annotated[
        Annotated[Settled, Without(frozenset({"link", "joints"}))] | None, Field(description="a goal: it comes to rest")
    ] = None
    moved: Annotated[
        Annotated[Moved, _OF_ROBOT] | None, Field(description="it moves away from its start, or does not")
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _takes_keys_alone(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {key: {} if value is None and key in _KINDS else value for key, value in data.items()}

    @model_validator(mode="after")
    def _has_one_kind(self) -> Self:
        kinds = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            problem = f"found {' and '.join(kinds)}: begin a second 'object'" if kinds else "none is given"
            raise ValueError(f"give one of {', '.join(_KINDS)}; {problem}")
        return self

    @property
    def part(self) -> MotionAssertion:
        """The assertion on its motion."""
        parts = (getattr(self, kind) for kind in _KINDS)
        part: MotionAssertion = next(part for part in parts if part is not None)
        return part

    @property
    @override
    def channels(self) -> Channels:
        return Channels(objects=frozenset({self.name}))

    is_goal: ClassVar[bool] = delegated("part.is_goal")
    has_truth: ClassVar[bool] = delegated("part.has_truth")
    hold_time: ClassVar[float | None] = delegated("part.hold_time")
    states_span: ClassVar[bool] = delegated("part.states_span")

    @override
    def lasting(self, span: float) -> Self:
        return self.model_copy(update={self.part.key: self.part.lasting(span)})

    horizon: ClassVar[float] = delegated("part.horizon")

    @property
    @override
    def title(self) -> str:
        return f"object {self.part.title_of(self.watched)}"

    @property
    def watched(self) -> Watched:
        """The name of the object and the frame, without its motion."""
        return Watched(self.name, self.part.frame)

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield an unknown object, one that cannot move, an unknown frame, and keys of the robot."""
        bodies = {body.name: body for body in scene.world.objects}
        body, part, frame = bodies.get(self.name), self.part, scene.frames.get(self.name)
        if frame is not None:
            robot, link = frame
            if link in scene.actors[robot].bolted_links:
                yield ("name",), f"'{self.name}' is fixed to the world, so it never moves; name a link that can move"
        elif body is None:
            names = (*scene.world.names, *scene.frames)
            yield ("name",), f"the world has no body '{self.name}'{did_you_mean(self.name, names)}"
        elif body.mass is None and not body.path:
            yield ("name",), f"'{self.name}' has no mass and no path, so it never moves; name an object that can move"
        if part.link is not None:
            yield (part.key, "link"), "an object is judged, not a link; remove 'link', or see 'frame'"
        if isinstance(part, Settled) and part.joints is not None:
            yield (part.key, "joints"), "an object has no joints; remove 'joints'"
        if part.frame != WORLD and (problem := why_no_frame(scene.model, part.frame)) is not None:
            yield (part.key, "frame"), problem

    @override
    def claims(self, setting: Setting) -> Findings:
        findings = self.part.limits_beyond(setting, of_base=False)
        yield from (finding.below((self.part.key,)) for finding in findings)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a limit, or a place, to which nothing comes that the robot pushes in the time limit."""
        seen = motion_of(self, run.scene, run.trace)
        if len(seen) and not self._is_pushed(run):
            yield from (one.below((self.part.key,)) for one in self.part.run_claims(replace(run, trace=seen)))

    def _is_pushed(self, run: JudgedRun) -> bool:
        mass = next((body.mass or 0.0 for body in run.scene.world.objects if body.name == self.name), 0.0)
        return any(push.is_felt(mass) for push in run.scene.world.disturbances if push.body == self.name)

    @override
    def standstill(self, run: JudgedRun) -> ClaimFinding | None:
        body = next((body for body in run.scene.world.objects if body.name == self.name), None)
        keeps_away = isinstance(self.part, Reach) and not run.verdict.goal
        may_rest = isinstance(self.part, Moved) and not run.verdict.goal
        if not (keeps_away or may_rest or isinstance(self.part, Upright | StayWithin)) or body is None:
            return None
        if self._is_pushed(run) or passed_by(run.scene, run.trace, body):
            return None
        seen = motion_of(self, run.scene, run.trace)
        if not len(seen) or Rest.of_trace(seen).base_moved(seen).any():
            return None
        if may_rest and float(run.trace.distance_to(seen.base_position_xyz[0]).min()) < run.far + run.scene.extent:
            return None
        message = f"{self.name} never moved by 1 mm or 0.1 deg{self.watched.inside}, so only its start was checked"
        use = f"let the robot move {self.name}, or use 'moved: {{at_most: 1 cm}}' if it must stay"
        return ClaimFinding("object-never-moved", (), f"{message}; {use}")

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        appears = next((body.appears or 0.0 for body in scene.world.objects if body.name == self.name), 0.0)
        return ObjectMonitor(self, scene, start, appears)

    is_explicit: ClassVar[bool] = False  # an object that comes to rest must have moved, not only the robot

    @override
    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        return self.part.marks_of(self.watched, scene, start)


@dataclass(frozen=True, slots=True)
class ObjectMonitor(Monitor):
    """The monitor of the motion of an object. It judges a trace whose base has the motion of the object."""

    spec: ObjectAssertion
    scene: Scene
    start: Observation
    appears: float
    monitor: Monitor | None = None  # the monitor of its motion; None until the object is there
    # time and pose (8,) at the last two steps at which it was there, as far as they are known
    recent: tuple[tuple[float, ...], ...] = ()
    steps: Judged = Judged()
    end: float | None = None

    @property
    def is_momentary(self) -> bool:
        """See Monitor.is_momentary. Speeds need the step before."""
        return not isinstance(self.spec.part, Settled)

    @property
    @override
    def state(self) -> State:
        if self.monitor is not None:
            return self.monitor.state
        return State.PENDING if self.spec.is_goal else State.HOLDS

    @property
    @override
    def is_decided(self) -> bool:
        return self.monitor is not None and self.monitor.is_decided

    @property
    def needed_until(self) -> float:
        """See Monitor.needed_until. The run goes on for a step after the object appears."""
        appeared = self.appears + 1 / self.scene.physics.rate if self.appears and not waits(self.appears) else 0.0
        return appeared if self.monitor is None else max(appeared, self.monitor.needed_until)

    @override
    def begin(self, trace: Trace) -> Self:
        seen = self._seen(trace)
        if not len(seen):
            return replace(self, recent=self._recent(trace))
        opened = self._opened(seen)
        return replace(self, monitor=opened.begin(seen), recent=self._recent(trace))

    @override
    def observe(self, trace: Trace) -> Self:
        end = float(trace.time[-1]) if len(trace) else self.end
        seen = self._seen(trace)
        if not len(seen):
            return replace(self, end=end, recent=self._recent(trace))
        monitor = self._opened(seen).observe(seen)
        steps = self.steps.followed_by(seen.time)
        return replace(self, end=end, monitor=monitor, steps=steps, recent=self._recent(trace))

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. The moments are the steps at which the object is there."""
        seen = self._seen(trace)
        if not len(seen):
            return Truth(seen.time, seen.time < 0)
        return self._opened(seen).truth(seen)

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        seen = self._seen(trace)
        curves = self._opened(seen).signals(seen) if len(seen) else ()
        return tuple(replace(curve, name=f"{self._subject}{curve.name}") for curve in curves)

    def verdict(self) -> Verdict:
        """Return the verdict of the monitor; the message names the object."""
        if self.monitor is None or not self.steps.moments:
            return Verdict(False, message=self._absent(), judged=Judged())
        verdict = replace(self.monitor.verdict(), judged=self.steps)
        return verdict if verdict.time is None else replace(verdict, message=f"{self._subject}{verdict.message}")

    @property
    def _subject(self) -> str:
        part, watched = self.spec.part, self.spec.watched
        return f"{watched.who if part.names_frame else watched.subject}{part.subject_ends}"

    def _absent(self) -> str:
        if self.end is None or self.end >= self.appears:
            return f"no pose of {self.spec.name} to measure"
        due = "it waits for an event" if waits(self.appears) else f"it is due at {self.appears:g} s"
        due = f"{due}, but the run ended at {self.end:.4g} s"
        return f"{self.spec.name} never appeared: {due}"

    def _opened(self, seen: Trace) -> Monitor:
        """Return the monitor of the motion; it begins at the first step of `seen` if there is none yet."""
        if self.monitor is not None:
            return self.monitor
        x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = seen.state[0, 1:14].tolist()
        start = replace(self.start, pose=Pose((x, y, z), (qx, qy, qz, qw)), twist=Twist((vx, vy, vz), (wx, wy, wz)))
        return self.spec.part.opened_on(self.spec.watched, self.scene, start)

    def _recent(self, trace: Trace) -> tuple[tuple[float, ...], ...]:
        present = _present(trace, self.spec.name)
        latest = _poses(present, self.spec.name)[-2:].tolist() if len(present) else []
        return (*self.recent, *map(tuple, latest))[-2:]

    def _seen(self, trace: Trace) -> Trace:
        return motion_of(self.spec, self.scene, trace, self.recent)


def motion_of(spec: ObjectAssertion, scene: Scene, trace: Trace, earlier: tuple[tuple[float, ...], ...] = ()) -> Trace:
    """Return the steps at which the object is there, with its motion, and a known speed if that counts."""
    present = _present(trace, spec.name)
    if not len(present):
        return present
    rows = _poses(present, spec.name)
    # The first step may be known already: the one at which a time window opens.
    before = [row for row in earlier if row[0] < rows[0, 0] - TIME_EPSILON_S]
    linear, angular = _rates(np.vstack((before[-1] if before else rows[0], rows)))
    motion = LinkMotion(rows[:, 1:4], rows[:, 4:8], linear, angular)
    if spec.part.frame != WORLD:
        frame = link_of_frame(scene.model, spec.part.frame)
        motion = motion.seen_from(link_motion(scene.model, present, frame))
    columns = (motion.position_xyz, motion.orientation_xyzw, motion.linear_xyz, motion.angular_xyz)
    seen = replace(present, state=np.column_stack((present.time, *columns, present.state[:, 14:])))
    needs_speed = isinstance(spec.part, Settled) and not before
    return seen.rows(slice(1, None)) if needs_speed else seen


def _present(trace: Trace, name: str) -> Trace:
    """Return the steps at which an object is there."""
    record = trace.objects.get(name)
    if record is None or not len(record):
        return trace.rows(slice(0))
    is_present = np.isfinite(record.position_xyz[:, 0])
    return trace if is_present.all() else trace.rows(np.flatnonzero(is_present))


def _poses(trace: Trace, name: str) -> FloatArray:
    """Return time and pose (T, 8) of an object."""
    record = trace.objects[name]
    return np.column_stack((record.time, record.position_xyz, record.orientation_xyzw))


def _rates(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean velocities (T, 3) m/s and rad/s between rows (T + 1, 8) of time and pose; 0 at equal times."""
    before, after = rows[:-1], rows[1:]
    elapsed = after[:, :1] - before[:, :1]
    factor = np.divide(1.0, elapsed, out=np.zeros_like(elapsed), where=elapsed > 0)
    orientation = tuple(after[:, 4:8].T)
    back = geometry.conjugate(tuple(before[:, 4:8].T))
    turn = np.column_stack(geometry.multiply(orientation, back))
    # A quaternion and its negative are the same orientation.
    turn = np.where(turn[:, 3:] < 0, -turn, turn)
    sine = np.sqrt((turn[:, :3] ** 2).sum(axis=1, keepdims=True))
    angle = 2 * np.arctan2(sine, turn[:, 3:])
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
    return (after[:, 1:4] - before[:, 1:4]) * factor, turn[:, :3] * scale * factor
