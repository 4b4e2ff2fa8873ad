"""The frame whose motion an assertion judges: the base link, another link or a body of the world.

Monitors judge the base of a trace. To judge another frame, a monitor gets a trace whose base has the motion of that
frame, as it is seen from the world, from the base link or from a link.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import AdaptedMonitor, Monitor, State, Truth
from sim_action.assertions.monitors.windows import Rest
from sim_action.assertions.temporal_logic import quoted
from sim_action.core.geometry import Pose, Twist
from sim_action.core.lazy_numpy import np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import link_of_frame, motion_in, why_no_frame, why_no_link
from sim_action.robot.model.robot_model import WORLD, rigid_bodies
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Mark, Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, Setting
from sim_action.world.robot_reach import LinkRange, joints_between, range_of
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.robot.model.kinematics import LinkMotion


@dataclass(frozen=True, slots=True)
class Watched:
    """The frame whose motion is judged."""

    name: str = ""  # of the link or the body; empty for the base link
    frame: str = WORLD  # the frame from which it is seen: "world", "base" or the name of a link
    # the function that returns its motion in `frame` at the moments of a trace; None for the base link in the world
    # frame, whose motion a trace has
    motion: Callable[[Trace], LinkMotion] | None = None

    @property
    def inside(self) -> str:
        """The frame as the end of a text, such as " in base"; empty for the world frame."""
        return "" if self.frame == WORLD else f" in {self.frame}"

    @property
    def who(self) -> str:
        """The name in a sentence, such as "tool0"."""
        return self.name or "the base"

    @property
    def subject(self) -> str:
        """The subject of a sentence, such as "tool0 in base"; empty for the base link in the world frame."""
        return f"{self.who}{self.inside}" if self.name or self.inside else ""

    def seen(self, trace: Trace) -> Trace:
        """Return a trace whose base has the motion that is judged."""
        if self.motion is None:
            return trace
        at = self.motion(trace)
        columns = (at.position_xyz, at.orientation_xyzw, at.linear_xyz, at.angular_xyz)
        return replace(trace, state=np.column_stack((trace.time, *columns, trace.state[:, 14:])))

    def at_start(self, start: Observation) -> Observation:
        """Return the state at t = 0 with the frame's pose and twist in place of the base's."""
        if self.motion is None:
            return start
        row = self.seen(Trace.of_observation(start)).state[0].tolist()
        x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = row[1:14]
        return replace(start, pose=Pose((x, y, z), (qx, qy, qz, qw)), twist=Twist((vx, vy, vz), (wx, wy, wz)))


BASE: Final = Watched()  # the base link in the world frame


class MotionAssertion(Assertion):
    """The base class of assertions on the motion of a frame: of the base link, or of another link."""

    last_keys: ClassVar[tuple[str, ...]] = ("link", "frame")  # the keys that documents list last
    subject_ends: ClassVar[str] = " "  # the text between the subject of a message and the message of the monitor
    names_frame: ClassVar[bool] = False
    """True if the messages of the monitor name the frame, so that their subject need not."""

    link: Annotated[str | None, Field(min_length=1, description="link of the robot; default: the base link")] = None
    frame: Annotated[
        str, Field(min_length=1, description="frame of all values: world, base (the base link), or a link")
    ] = WORLD

    @abstractmethod
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        """Open the monitor of the base of a trace, which has the motion of `watched`; so has `start`."""

    @abstractmethod
    def title_of(self, watched: Watched) -> str:
        """Return the requirement in a few words."""

    def marks_in(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Return the marks in the frame of `watched`; `start` has its motion."""
        return ()

    @property
    def watches_base(self) -> bool:
        """True if the motion of the base link in the world frame is judged."""
        return self.link is None and self.frame == WORLD

    def quantity(self, name: str, signal: str = "") -> str:
        """Return a quantity of the frame as a formula writes it; `signal`: the base's signal in formulas, if any."""
        if self.watches_base and signal:
            return signal
        inside = self.frame == WORLD and self.link is not None and bool(signal)
        whose = f"{name} of {self.link} in {self.frame}"
        return f"{quoted(str(self.link))}.{signal}" if inside else f"{quoted(whose)}.x"

    @property
    def judges_motion_alone(self) -> bool:
        """True if it judges nothing but the motion of the frame."""
        return True

    @override
    def claims(self, setting: Setting) -> Findings:
        yield from self.limits_beyond(setting, of_base=self.watches_base)

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        if self.watches_base and scene.bolted:
            yield from self.fixed_base_claims()
            return
        if not self.watches_base:
            yield from self._rigid_link(scene)
        if (limits := range_of(scene, self.link, self.frame)) is not None:
            yield from self.range_claims(limits)

    def range_claims(self, limits: LinkRange) -> Findings:
        """Yield places and distances that a link with these limits cannot come to."""
        yield from ()

    def fixed_base_claims(self) -> Findings:
        """Yield the finding that the base of the robot, which is judged, is fixed."""
        use = "judge a link with 'link', or its joints with joint or joint_within, or free the base"
        message = f"{self.key} judges the base of the robot, but it is fixed and never moves; {use}"
        yield ClaimFinding("fixed-base", (), message)

    def _rigid_link(self, scene: Scene) -> Findings:
        """Yield the finding that no joint moves the link relative to its frame."""
        names = scene.model.links_by_name
        link, frame = self.link or scene.model.root, link_of_frame(scene.model, self.frame)
        if link not in names or (frame != WORLD and (link == frame or frame not in names)):
            return  # reported as a problem
        if self.judges_motion_alone and link in _held_with(frame, scene):
            message = f"link '{link}' never moves in the frame '{self.frame}': no joint is between them"
            use = "name a link or a frame that moves"
            yield ClaimFinding("fixed-base", (), f"{self.key} checks nothing: {message}; {use}")

    @override
    def standstill(self, run: JudgedRun) -> ClaimFinding | None:
        if self.watches_base or run.is_pushed(joints_between(run.scene, self.link, self.frame)):
            return None
        watched = self.watched(run.scene)
        seen = watched.seen(run.trace)
        if Rest.of_trace(seen).base_moved(seen).any():
            return None
        message = f"{watched.who} never moved by 1 mm or 0.1 deg in the frame '{watched.frame}'"
        use = "so only its start was checked; command its joints, or run for longer"
        return ClaimFinding("link-never-moved", (), f"{message}, {use}")

    def watched(self, scene: Scene) -> Watched:
        """Return the frame whose motion is judged."""
        if self.watches_base:
            return BASE
        link = self.link or scene.model.root

        def motion(trace: Trace) -> LinkMotion:
            return motion_in(scene.model, trace, link, self.frame)

        return Watched(self.link or "", self.frame, motion)

    def key_of(self, watched: Watched) -> str:
        """Return the key with the subject, such as "reach of tool0 in base"."""
        return f"{self.key} of {watched.subject}" if watched.subject else self.key

    @property
    @override
    def title(self) -> str:
        return self.title_of(Watched(self.link or "", self.frame))

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        return self.monitor_of(self.watched(scene), scene, start)

    def monitor_of(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        """Open the monitor of a frame, such as the frame of a body of the world. `start` is the state at t = 0."""
        monitor = AdaptedMonitor.of(self.opened_on(watched, scene, watched.at_start(start)))
        if watched.motion is None:
            return monitor
        subject = watched.who if self.names_frame else watched.subject
        return WatchedMonitor(watched, monitor, f"{subject}{self.subject_ends}")

    @override
    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        return self.marks_of(self.watched(scene), scene, start)

    def marks_of(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Return the marks for the 3-D view. Those in the frame of a link move with it."""
        marks = self.marks_in(watched, scene, watched.at_start(start))
        if watched.frame == WORLD:
            return marks
        link = link_of_frame(scene.model, watched.frame)
        return tuple(replace(mark, link=link) for mark in marks)

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield an unknown link or frame, and a link that is its own frame."""
        if self.watches_base:
            return
        if self.link is not None and (problem := why_no_link(scene.model, self.link)) is not None:
            yield ("link",), problem
        elif (problem := why_no_frame(scene.model, self.frame)) is not None:
            yield ("frame",), problem
        elif self.frame != WORLD and (self.link or scene.model.root) == link_of_frame(scene.model, self.frame):
            yield (
                ("frame",),
                f"'{self.link or scene.model.root}' never moves in its own frame; name another frame or link",
            )


def _held_with(frame: str, scene: Scene) -> Collection[str]:
    """Return the links that never move relative to the world, or to a link."""
    if frame == WORLD or frame in scene.bolted_links:
        return scene.bolted_links
    holders = rigid_bodies(scene.model)
    return [link for link, holder in holders.items() if holder == holders[frame]]


@dataclass(frozen=True, slots=True)
class WatchedMonitor(Monitor):
    """The monitor of a frame other than the base link in the world: it hands on the motion of that frame."""

    watched: Watched
    monitor: Monitor  # the monitor of the base of the traces that it gets
    subject: str  # the beginning of messages

    is_momentary: ClassVar[bool] = delegated("monitor.is_momentary")
    state: ClassVar[State] = delegated("monitor.state")
    is_decided: ClassVar[bool] = delegated("monitor.is_decided")
    needed_until: ClassVar[float] = delegated("monitor.needed_until")
    unmet_premises: ClassVar[tuple[str, ...]] = delegated("monitor.unmet_premises")

    @override
    def begin(self, trace: Trace) -> Self:
        return replace(self, monitor=self.monitor.begin(self.watched.seen(trace)))

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, monitor=self.monitor.observe(self.watched.seen(trace)))

    def verdict(self) -> Verdict:
        """Return the verdict of the monitor; the message names the frame."""
        verdict = self.monitor.verdict()
        return verdict if verdict.time is None else replace(verdict, message=f"{self.subject}{verdict.message}")

    @override
    def truth(self, trace: Trace) -> Truth:
        return self.monitor.truth(self.watched.seen(trace))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        curves = self.monitor.signals(self.watched.seen(trace))
        return tuple(replace(curve, name=f"{self.subject}{curve.name}") for curve in curves)
