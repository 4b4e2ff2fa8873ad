"""Checks at the start and at each spawn: no body overlaps another one, and the robot settles without a fall.

At the start the model gets notes, too: on its drive, its links, and what it states otherwise.

An engine pushes overlapping bodies apart, the faster the deeper they overlap: 2 cm move a TurtleBot3 by 4 cm, 12 cm
throw it at 5 m/s. Measurements after that say nothing about the robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from typing import Final, Self

from sim_action.core import geometry, units
from sim_action.core.errors import BadStart, Problem, RunError
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_document import SpecProblem, SpecProblems
from sim_action.drives import Drive, DriveMotion, recognise
from sim_action.drives.undercarriage import ignored_statements
from sim_action.drives.wheels import axis_in_base, opposed_note
from sim_action.engines.engine import Engine
from sim_action.robot.model.kinematics import link_poses, robot_box
from sim_action.robot.model.robot_model import unwatched_note
from sim_action.scenario.model import Scenario
from sim_action.scenario.stage import DEPTH, Clashes, paths_of
from sim_action.state.observation import Clash, Overlap
from sim_action.world import GROUND, placed
from sim_action.world.parts import GridPart, height_at
from sim_action.world.scene import Scene

BOLTED: Final = "the base is fixed: twists turn the wheels, but the robot does not move"

# A base that moves by less has only come to rest.
_MAX_TILT_RAD: Final = math.radians(2)
_MAX_SINK_M: Final = 0.02
_MIN_FALL_M: Final = 0.1  # a robot whose stated height is less above its place of rest was put down
MAX_LIFT_M: Final = 0.1  # a robot that starts at most this deep in the ground or in fixed bodies starts on them
_LEAST_HEIGHT_M: Final = 0.01  # a sensor that is lower above the lowest point of its robot sees along the ground
_ON_TOP_M: Final = 0.0005  # a robot that is less deep in a body stands on it


def refuse_bad_start(
    scene: Scene, at: Pose, overlaps: Iterable[Overlap], clashes: Iterable[Clash], allowed: Collection[str] = ()
) -> tuple[str, ...]:
    """Raise BadStart if the robot or a moving body starts inside something.

    `at`: the pose of the base link, world frame; `allowed`: rules that the scenario allows. Returns the notes on bodies
    that begin inside others all the same.
    """
    inside = _problems(scene, overlaps)
    conflicts = Clashes.of(scene.world, clashes, scene.places.bodies, allowed)
    problems = [*inside, *_buried(scene, at), *conflicts.problems()]
    elsewhere = list(conflicts.problems_of_file())
    if (place := scene.places.robot) is not None:
        elsewhere = [*(Problem(place, message) for _, message in inside), *elsewhere]
        problems = problems[len(inside) :]
    if problems or elsewhere:
        raise BadStart(problems, elsewhere)
    return tuple(conflicts.notes())


def opened_on_top(scene: Scene, opened: Callable[[Scene], Engine]) -> tuple[Engine, tuple[str, ...]]:
    """Open the engine, with the robot lifted onto what it would start a little inside of, if its z is free."""
    backend = opened(scene)
    if scene.bolted or (scene.placement.z is not None and scene.places.robot is None):
        return backend, ()
    x, y, z = backend.observe(0, contacts=False).pose.position_xyz
    fixed = {GROUND, *(body.name for body in scene.world.objects if body.mass is None and not body.path)}
    lift = 0.0
    below = set[str]()
    while overlapping := [
        overlap for overlap in backend.overlaps() if overlap.body in fixed and overlap.depth > _ON_TOP_M
    ]:
        deepest = max(overlapping, key=lambda overlap: overlap.depth)
        if not lift and deepest.depth <= DEPTH:
            break
        backend.close()
        # No lift is larger than the robot needs, because depths are the shortest ways out.
        lift += deepest.depth
        below.add(deepest.body)
        if lift > MAX_LIFT_M:
            return opened(scene), ()
        pose = scene.robot.pose.model_copy(update={"x": x, "y": y, "z": z + lift})
        backend = opened(replace(scene, robot=scene.robot.model_copy(update={"pose": pose})))
    return backend, (_lift_note(scene, lift, below),) if lift else ()


def _lift_note(scene: Scene, lift: float, below: AbstractSet[str]) -> str:
    names = " and ".join("the ground" if name == GROUND else f"'{name}'" for name in sorted(below))
    if (place := scene.places.robot) is None:
        above = f"the robot starts on {names}, {units.display(lift, 'm')} above the ground"
        return f"{above}, and touches it all the time: no_collision needs allow; robot.pose.z states another z"
    start = f"the pose of the robot in the world file puts it {units.display(lift, 'm')} into {names}"
    return f"{start}: it starts on top of that; robot.pose states another pose ({place})"


def raised_to_stand(scene: Scene, at: Pose) -> str | None:
    """Return a note if the robot stands higher than its keyframe puts it, else None; `at` as above."""
    if not scene.is_at_keyframe_height:
        return None
    raised = at.position_xyz[2] - (scene.placement.z or 0.0)
    if raised <= DEPTH:
        return None
    inside = f"keyframe '{scene.robot.keyframe}' puts the robot {units.display(raised, 'm')} inside the ground"
    return f"{inside}: it is raised and stands on the ground; robot.pose.z sets another height"


def moved_while_settling(scene: Scene, before: Pose, after: Pose) -> str | None:
    """Return a note if the base tilted or sank while the robot settled, else None; poses in the world frame."""
    tilted = _tilt(after) - _tilt(before)
    sunk = before.position_xyz[2] - after.position_xyz[2]
    stood = scene.robot.pose.z is None  # else it was meant to fall
    if scene.bolted or (tilted < _MAX_TILT_RAD and (sunk < _MAX_SINK_M or not stood)):
        return None
    ways = [f"tilted by {units.display(tilted, 'rad')}"] if tilted >= _MAX_TILT_RAD else []
    ways += [f"came {units.display(sunk, 'm')} down"] if sunk >= _MAX_SINK_M else []
    return f"while the robot settled, before t = 0, its base link '{scene.model.root}' {' and '.join(ways)}"


def fell_while_settling(scene: Scene, before: Pose, after: Pose) -> str | None:
    """Return a note if a robot with a stated height fell before t = 0, else None; poses in the world frame."""
    fallen = before.position_xyz[2] - after.position_xyz[2]
    if scene.bolted or scene.robot.pose.z is None or fallen < _MIN_FALL_M:
        return None
    return (
        f"the robot fell {units.display(fallen, 'm')} before t = 0, while it settled; with physics: {{settle: 0}}, the "
        "run begins at its pose, such as for a robot that flies"
    )


def about_settling(scene: Scene, before: Pose, after: Pose) -> Iterator[str]:
    """Yield notes on what happened to the base while the robot settled; poses in the world frame."""
    for note in (check(scene, before, after) for check in (moved_while_settling, fell_while_settling)):
        yield from () if note is None else (note,)


def _tilt(pose: Pose) -> float:
    return math.acos(max(-1.0, min(1.0, geometry.rotate(pose.orientation_xyzw, (0.0, 0.0, 1.0))[2])))


def _problems(scene: Scene, overlaps: Iterable[Overlap]) -> list[SpecProblem]:
    """Return one problem for each body that the robot overlaps, about its deepest link."""
    problems = list[SpecProblem]()
    paths = paths_of(scene.world)
    fixed = {GROUND, *(body.name for body in scene.world.objects if body.mass is None)}
    # A fixed link in a fixed body does not move: the author may want a robot's foot inside a table.
    bolted = scene.bolted_links
    reported = set[str]()
    for link, body, depth in sorted(overlaps, key=lambda overlap: -overlap.depth):
        if depth <= DEPTH or body in reported or (link in bolted and body in fixed):
            continue
        reported.add(body)
        where = f"the robot's link '{link}' starts {units.display(depth, 'm')} inside "
        if body == GROUND:
            problems.append((("robot", "pose"), f"{where}the ground{_remedy(scene)}"))
        else:
            place = scene.places.bodies.get(body)
            _, key, index = paths[body]
            other = f"world.{key}[{index}].pose" if place is None else f"the model at {place}"
            problems.append((("robot", "pose"), f"{where}'{body}'; move it, or {other}"))
    return problems


def _remedy(scene: Scene) -> str:
    if scene.is_at_keyframe_height:
        return f" by keyframe '{scene.robot.keyframe}'; set robot.pose.z, or correct the keyframe"
    if scene.places.robot is not None:
        return "; raise its <pose>, or state robot.pose in the scenario"
    return "; raise its z" if scene.robot.pose.z is None else "; raise its z, or leave z out to place it on the ground"


def _buried(scene: Scene, at: Pose) -> SpecProblems:
    """Yield problems of a start below a heightfield: its surface has no inside for the engine."""
    x, y, z = at.position_xyz
    for body in scene.world.objects:
        for part in scene.parts_of(body) if body.heightfield is not None else ():
            assert isinstance(part, GridPart)
            frame = placed(body, scene.parts_of(body))
            ahead, left, up = geometry.compose(geometry.inverse(frame), Pose((x, y, z))).position_xyz
            height = height_at(part, ahead, left)
            if height is not None and up < height:
                deep = units.display(height - up, "m")
                yield ("robot", "pose"), f"the robot starts {deep} below the surface of '{body.name}'; raise its z"


@dataclass(frozen=True, slots=True)
class Spawns:
    """The bodies that appear during the run, by their step, and the index of each in the world's objects."""

    names: dict[int, tuple[str, ...]]
    indices: dict[str, int]

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Return the spawns of a scenario; most have none."""
        names: dict[int, tuple[str, ...]] = {}
        for body in scenario.world.objects:
            if body.appears is not None:
                step = scenario.steps(body.appears)
                names[step] = (*names.get(step, ()), body.name)
        return cls(names, {body.name: index for index, body in enumerate(scenario.world.objects)})

    def next(self, step: int, until: int) -> int:
        """Return the first step after `step` at which a body appears, or `until` if that is earlier."""
        # Called at every tick.
        if not self.names:
            return until
        return min((arrival for arrival in self.names if step < arrival < until), default=until)

    def add(self, step: int, names: Sequence[str]) -> None:
        """Take bodies that appear at a step because of an event; patches are none."""
        if bodies := tuple(name for name in names if name in self.indices):
            self.names[step] = (*self.names.get(step, ()), *bodies)

    def refuse_blocked(self, step: int, rate: float, backend: Engine) -> None:
        """Raise RunError if a body that has just appeared is inside the robot or another moving body."""
        arrived = self.names.get(step, ())
        if not arrived:
            return
        overlaps = [(body, f"the robot's link '{link}'", depth) for link, body, depth in backend.overlaps()]
        for one, other, depth in backend.clashes():
            overlaps += [(one, f"'{other}'", depth), (other, f"'{one}'", depth)]
        blocked = [overlap for overlap in overlaps if overlap[0] in arrived and overlap[2] > DEPTH]
        if blocked:
            body, inside, depth = max(blocked, key=lambda overlap: overlap[2])
            raise RunError(
                f"body '{body}' appears at {step / rate:.4g} s, {units.display(depth, 'm')} inside {inside}, and the "
                "engine would throw them apart; let it appear at another place or time",
                keys=("world", "objects", self.indices[body], "appears"),
            )


def drive_of(scenario: Scenario, scene: Scene) -> Drive | None:
    """Return the drive of the robot of a scenario; None if nothing commands it."""
    return (scenario.robot.drive or recognise(scene.model)) if scenario.commands else None


def noted_drive(scenario: Scenario, scene: Scene, drive: Drive | None) -> Drive | None:
    """Return the drive whose wheels commands turn or sensors read."""
    if drive is None and any(mounted.sensor.reads_wheels for mounted in scenario.sensors):
        return scenario.robot.drive or recognise(scene.model)
    return drive


def about_robot(scenario: Scenario, scene: Scene, drive: Drive | None) -> Iterator[str]:
    """Yield notes on a drive, and on sensors that see along the ground because nothing states their place."""
    if drive is not None:
        yield ("" if scenario.robot.drive else "recognised: ") + drive.describe(scene.model, scene.world.weight)
        if scene.bolted and any(source.gives_twists(scene) for source in scenario.commands):
            yield BOLTED
    unplaced = [mounted for mounted in scenario.sensors if mounted.sensor.range_keys and mounted.link is None]
    box = robot_box(scene.model, link_poses(scene.model, scene.joint_positions)) if unplaced else None
    for mounted in unplaced:
        if box is not None and mounted.pose.position_xyz[2] - box[0][2] < _LEAST_HEIGHT_M:
            at = f"the origin of '{scene.model.root}', as low as the robot's lowest point"
            yield f"sensor '{mounted.name}' has no link, so it is at {at}; state its link or pose"


def about_links(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """Yield a note if links of the robot pass through each other, and nothing watches them."""
    # The episodes of ROS nodes expect nothing.
    keys = {assertion.key for assertion in scenario.assertions}
    # Most robots that drive have fewer motors than an arm; the rest of the check is imported for others.
    if keys and "self_collision" not in keys and len(scene.model.motor_joints) > (1 if scene.bolted else 2):
        note = unwatched_note(scene.model, scene.robot, bolted=scene.bolted)
        yield from () if note is None else (note,)


def about_model_of_drive(
    scenario: Scenario, scene: Scene, drive: Drive | None, motion: DriveMotion | None
) -> Iterator[str]:
    """Yield notes on what the model states about a drive, and the drive does otherwise; `motion`: if it is open."""
    if drive is not None:
        joints = (motion or drive.open(scene.model, scenario.physics.rate, scene.world.weight)).joints
        axes = {name: axis_in_base(scene.model, scene.model.joints_by_name[name]) for name in sorted(joints)}
        turning = {name: axis for name, axis in axes.items() if scene.model.joints_by_name[name].type == "continuous"}
        if (note := opposed_note(turning, drive.plugin(scene.model))) is not None:
            yield note
        if scenario.robot.drive is None:
            yield from ignored_statements(scene.model, drive.source(scene.model), joints)
