"""The description of the robot that the user's controllers get, and checks of their answers: types, numbers, joints.

Joint targets are clipped to the limits of the motors, as real motors, Gazebo and ros_control do. Physics engines do not
clip: there, an effort of ten times the limit accelerates ten times as much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sized
from typing import Final, Self, cast

from sim_action.core import units
from sim_action.core.field_types import MAX_COORDINATE_M
from sim_action.core.geometry import Twist
from sim_action.core.lazy_numpy import Generator, np
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import with_article
from sim_action.robot.model.kinematics import beyond_limits, why_no_frame
from sim_action.robot.model.robot_model import STOP_SLACK, Joint, JointType, Reading, RobotModel
from sim_action.state.command import Answer, Command, JointTargets, LinkWrench, is_finite
from sim_action.state.joint_motion import JointMotion
from sim_action.world.physics import MAX_FORCE
from sim_action.world.scene import Scene


@dataclass(frozen=True, slots=True)
class JointDescription:
    """A joint of the model.

    Attributes:
        type: "revolute", "continuous", "prismatic" or "fixed".
        moves: True if it has a position; only such joints are in `Observation.joints`.
        lower, upper: limits in rad (m if prismatic); None without a limit.
        max_effort: N m (N); None without a limit.
        max_velocity: rad/s (m/s); None without a limit.
        mimics: name of the joint that it mimics, which must be commanded instead; None: it moves independently.
    """

    type: JointType
    moves: bool
    lower: float | None = None
    upper: float | None = None
    max_effort: float | None = None
    max_velocity: float | None = None
    mimics: str | None = None

    @classmethod
    def of(cls, joint: Joint) -> Self:
        """Return the description of a joint."""
        limits = (joint.lower, joint.upper, joint.max_effort, joint.max_velocity)
        return cls(joint.type, joint.moves, *limits, joint.mimic.joint if joint.mimic else None)


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """The robot that a controller drives, and the rate of its steps.

    Attributes:
        name: the name in the model.
        base: the name of the base link.
        links: the names of all links.
        joints: joint name -> description, in the order of the model.
        rate: the rate of the controller's steps, in Hz of sim time.
        seed: the seed of the scenario.
        random: a random number generator that depends only on the seed, so that every run draws the same numbers.
    """

    name: str
    base: str
    links: tuple[str, ...]
    joints: Mapping[str, JointDescription]
    rate: float
    seed: int
    random: Generator

    @classmethod
    def of(cls, scene: Scene, rate: float, purpose: str) -> Self:
        """Return the robot of a scene; `purpose` selects the stream of random numbers."""
        model = scene.model
        joints = {joint.name: JointDescription.of(joint) for joint in model.joints}
        links = tuple(link.name for link in model.links)
        random = scene.generator(purpose)
        return cls(model.name, model.root, links, joints, rate, scene.seed, random)


MAX_PARTS: Final = 1000  # the greatest number of commands in one answer


def answer_problem(answer: object, scene: Scene) -> str | None:
    """Return the problem of an answer, as the end of a sentence "... returned ..."; None if the answer is valid."""
    if not isinstance(answer, (tuple, list)):
        return _problem_with_one(answer, scene)
    for kind in (Twist, JointTargets):
        if sum(isinstance(part, kind) for part in answer) > 1:
            return (
                f"more than one {kind.__name__} in a tuple; it may have one Twist, one JointTargets and any number of "
                "JointMotion and LinkWrench"
            )
    if len(answer) > MAX_PARTS:
        return f"{with_article(type(answer).__name__)} of {len(answer):,} commands; at most {MAX_PARTS:,} are allowed"
    problems = (_problem_with_one(part, scene) for part in answer)
    return next((f"{with_article(type(answer).__name__)} with {problem}" for problem in problems if problem), None)


def twist_problem(twist: Twist) -> str | None:
    """Return the problem of a twist, as the end of a sentence; None if it is valid."""
    if not _has_three_each(twist):
        return f"{twist!r}; a Twist needs two vectors of 3 numbers; Twist.planar(linear, angular) creates one"
    return _problem_with_numbers(twist)


def as_answer(answer: object) -> Answer:
    """Return a valid answer in the form that the simulation loop expects: motions are part of the joint targets."""
    parts = tuple(part for part in answer if part is not None) if isinstance(answer, (tuple, list)) else (answer,)
    motions = tuple(part for part in parts if isinstance(part, JointMotion))
    if motions:
        targets = next((part for part in parts if isinstance(part, JointTargets)), JointTargets())
        others = (part for part in parts if not isinstance(part, (JointMotion, JointTargets)))
        return cast("Answer", (*others, replace(targets, motions=motions)))
    return cast("Answer", parts if isinstance(answer, (tuple, list)) else answer)


def _problem_with_one(answer: object, scene: Scene) -> str | None:
    if answer is None:
        return None
    if isinstance(answer, JointMotion):
        return _problem_with_motion(answer, scene)
    if not isinstance(answer, (Twist, JointTargets, LinkWrench)):
        allowed = "a Twist, JointTargets, a JointMotion, a LinkWrench, a tuple of them, or None"
        return f"{with_article(type(answer).__name__)}; allowed are {allowed}"
    if isinstance(answer, Twist):
        return twist_problem(answer)
    if isinstance(answer, LinkWrench):
        return _problem_with_wrench(answer, scene)
    return _problem_with_numbers(answer) or _problem_with_targets(answer, scene)


def _problem_with_numbers(command: Command) -> str | None:
    try:
        finite = is_finite(command)
    except OverflowError:  # an int may be too large for a float
        return f"{_text(command)}, whose values are too large"
    except Exception:  # noqa: BLE001 - values may be objects of the user, which can raise anything
        return f"{_text(command)}, whose values are not numbers"
    return None if finite else f"{_text(command)}, which has a value that is not finite"


def _text(command: Command) -> str:
    try:
        return repr(command)
    except Exception:  # noqa: BLE001 - as above; and Python refuses to print very long integers
        return with_article(type(command).__name__)


def _problem_with_wrench(wrench: LinkWrench, scene: Scene) -> str | None:
    if not _has_three_each(wrench):
        return f"{_text(wrench)}; a LinkWrench needs vectors of 3 numbers: force_xyz, torque_xyz and point_xyz"
    if (problem := _problem_with_numbers(wrench)) is not None:
        return problem
    if (problem := scene.why_not_moved(str(wrench.link))) is not None:
        return f"a LinkWrench that cannot act: {problem}"
    if (problem := why_no_frame(scene.model, str(wrench.frame))) is not None:
        return f"a LinkWrench in an unknown frame: {problem}"
    strongest = max(map(abs, (*wrench.force_xyz, *wrench.torque_xyz)))
    if strongest > MAX_FORCE:
        return f"{_text(wrench)}; at most {MAX_FORCE:g} N or N m is allowed"
    is_far = max(map(abs, wrench.point_xyz)) > MAX_COORDINATE_M
    return f"{_text(wrench)}; its point_xyz may be at most {MAX_COORDINATE_M:g} m away" if is_far else None


def _problem_with_motion(motion: JointMotion, scene: Scene) -> str | None:
    try:
        tables = [table for curve in motion.curves for table in (curve.times, curve.coefficients)]
        if not all(np.isfinite(table).all() for table in tables):
            return "a JointMotion that has a value that is not finite"
        # It looks at all parts of the motion.
        _ = motion.end, motion.extremes
    except Exception:  # noqa: BLE001 - values may be objects of the user, which can raise anything
        return "a JointMotion that is not well-formed; JointMotion.through(names, times, positions) makes one"
    troubles = (scene.model.why_not_driven(str(name), "position") for name in motion.names)
    trouble = next((trouble for trouble in troubles if trouble is not None), None)
    return None if trouble is None else f"a JointMotion of a joint that cannot be driven: {trouble}"


def _problem_with_targets(targets: JointTargets, scene: Scene) -> str | None:
    if targets.base is not None:
        return "a push of the base, which only drives may command; use joint targets"
    if targets.wrenches is not None:
        return "JointTargets with wrenches; answer with a tuple (JointTargets, LinkWrench, ...) instead"
    if targets.motions:
        return "JointTargets with motions; answer with the JointMotion itself, alone or in a tuple"
    named: list[tuple[str, Reading | None]] = [
        *((name, "position") for name in targets.position),
        *((name, "velocity") for name in targets.velocity if name not in targets.position),
        *((name, None) for name in (*targets.effort, *targets.max_effort)),
    ]
    for name, reading in named:
        if (trouble := scene.model.why_not_driven(str(name), reading)) is not None:
            return f"a target for a joint that cannot be driven: {trouble}"
    negative = next((name for name, effort in targets.max_effort.items() if effort < 0), None)
    return (
        None
        if negative is None
        else f"a negative max_effort for joint '{negative}'; it is a magnitude, so it must be 0 or more"
    )


def _has_three_each(command: Twist | LinkWrench) -> bool:
    if isinstance(command, Twist):
        vectors: tuple[Sized, ...] = (command.linear_xyz, command.angular_xyz)
    else:
        vectors = (command.force_xyz, command.torque_xyz, command.point_xyz)
    try:
        return all(len(vector) == 3 for vector in vectors)
    except TypeError:
        return False


class Saturation:
    """Clips efforts and velocities to limits of a model, with one note in `notes` per joint and quantity."""

    def __init__(self, model: RobotModel, source: str) -> None:
        self.notes: list[str] = []
        self._source = source
        self._joints = model.joints_by_name
        # A joint is removed once it has a note.
        self._limited = {joint.name for joint in model.moving_joints if (joint.lower, joint.upper) != (None, None)}
        moving = model.moving_joints
        self._max_effort = {joint.name: joint.max_effort for joint in moving if joint.max_effort is not None}
        self._max_velocity = {joint.name: joint.max_velocity for joint in moving if joint.max_velocity is not None}
        self._noted: set[tuple[str, Reading]] = set()

    def clip_answer(self, answer: Answer) -> Answer:
        """Return an answer with all its joint targets clipped."""
        if isinstance(answer, tuple):
            return tuple(self.clip(command) if isinstance(command, JointTargets) else command for command in answer)
        return self.clip(answer) if isinstance(answer, JointTargets) else answer

    def clip(self, targets: JointTargets) -> JointTargets:
        """Return clipped targets. A position beyond the limits is kept: the joint stops at its limit."""
        self._note_positions(targets.position)
        for motion in targets.motions:
            for extreme in motion.extremes:
                self._note_positions(extreme)
        velocity = self._cut(targets.velocity, "velocity", self._max_velocity)
        effort = self._cut(targets.effort, "effort", self._max_effort)
        max_effort = self._cut(targets.max_effort, "effort", self._max_effort)
        if velocity is targets.velocity and effort is targets.effort and max_effort is targets.max_effort:
            return targets
        return replace(targets, velocity=velocity, effort=effort, max_effort=max_effort)

    def _note_positions(self, asked: Mapping[str, float]) -> None:
        for name, position in asked.items():
            # A controller may hold a joint that rests on its stop where it is measured.
            if beyond := beyond_limits(self._joints[name], position, STOP_SLACK):
                self.note_beyond(name, f"to a position that it cannot reach: {beyond}")

    def note_beyond(self, name: str, command: str) -> None:
        """Add a note on a command beyond the limits of a joint, unless it has one."""
        if name in self._limited:
            self._limited.remove(name)
            self.notes.append(f"{self._source} commanded joint '{name}' {command}")

    def _cut(self, asked: Mapping[str, float], reading: Reading, limits: Mapping[str, float]) -> Mapping[str, float]:
        beyond = {name for name, value in asked.items() if abs(value) > limits.get(name, abs(value))}
        if not beyond:
            return asked
        for name in sorted(beyond):
            self._note(name, reading, asked[name], limits[name])
        return {
            name: max(-limits[name], min(limits[name], value)) if name in beyond else value
            for name, value in asked.items()
        }

    def _note(self, name: str, reading: Reading, asked: float, limit: float) -> None:
        if (name, reading) in self._noted:
            return
        self._noted.add((name, reading))
        unit = self._joints[name].dimension(reading).si
        commanded, allowed = units.display_apart(abs(asked), limit, unit)
        self.notes.append(
            f"{self._source} commanded {commanded} for joint '{name}'; it was clipped to {allowed}, its {reading} limit"
        )
