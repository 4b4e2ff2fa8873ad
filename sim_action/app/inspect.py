"""What a robot model is: a look at it before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from sim_action.core.field_types import FrozenModel
from sim_action.core.geometry import Vector3
from sim_action.core.workspace import Workspace
from sim_action.drives import Drive, recognise
from sim_action.drives.diff import DiffDrive
from sim_action.drives.skid import SkidSteer, sides_on_ground
from sim_action.drives.wheels import Wheel, wheels_on_ground
from sim_action.robot.audit.rules import ALLOWABLE
from sim_action.robot.kinematics import link_poses, robot_box
from sim_action.robot.loading import load_model
from sim_action.robot.robot_model import WORLD, Finding, Joint, JointType, Link, RobotModel
from sim_action.robot.spec import Robot
from sim_action.scenario.robot_block import drive_text, robot_block
from sim_action.world import Physics, World
from sim_action.world.scene import Scene


class JointEntry(FrozenModel):
    """A joint; positions in rad (m if it slides), limits None without; `mimics`: the joint that it follows."""

    name: str
    type: JointType
    parent: str
    child: str
    axis_xyz: Vector3
    lower: float | None
    upper: float | None
    start: float
    mimics: str | None


class LinkEntry(FrozenModel):
    """A link; mass in kg, None where the model does not say."""

    name: str
    mass: float | None
    collision_shapes: int


class WheelEntry(FrozenModel):
    """A round link on the ground that a joint turns freely; radius and place in m, axis too in the base frame."""

    joint: str
    radius: float
    position_xyz: Vector3
    axis_xyz: Vector3


class Inspection(FrozenModel):
    """All of it.

    Attributes:
        model: as a scenario names it.
        mass: kg, of the links that say what they weigh.
        lower_xyz, upper_xyz: m, corners of the box around all collision shapes, in the base frame, joints where they
            begin; None if there are no shapes.
        height: m, of the base link above the ground when the lowest shape touches it; 0 if it is bolted to the world.
        wheels: what looks like wheels, whether or not it is plain how they drive.
        drive: how it drives, if that was recognised, with the figures.
        needs: rules that `robot.allow` has to name.
        robot: a `robot:` block to paste.
    """

    name: str
    model: str
    mass: float
    root: str
    links: tuple[LinkEntry, ...]
    joints: tuple[JointEntry, ...]
    lower_xyz: Vector3 | None
    upper_xyz: Vector3 | None
    height: float | None
    wheels: tuple[WheelEntry, ...]
    drive: str | None
    findings: tuple[Finding, ...]
    needs: tuple[str, ...]
    robot: str


def inspect_model(robot: Robot, workspace: Workspace) -> Inspection:
    """Looks at what a scenario could have as its robot, as if it allowed all that can be allowed.

    Raises ModelError for what no engine could take.
    """
    model = load_model(robot.model_copy(update={"allow": ALLOWABLE}), workspace)
    needs = tuple(sorted({finding.rule for finding in model.findings if finding.level == "error"}))
    robot = robot.model_copy(update={"allow": needs, "base": robot.base or _base(model)})
    start = Scene(robot, model, World(), Physics(), workspace).joint_positions
    return _inspection(robot, model, start, needs)


def _inspection(robot: Robot, model: RobotModel, start: Mapping[str, float], needs: tuple[str, ...]) -> Inspection:
    """`start`: where joints begin."""
    box, drive = robot_box(model, link_poses(model, start)), recognise(model)
    wheels = tuple(map(_wheel_entry, wheels_on_ground(model)))
    return Inspection(
        name=model.name,
        model=robot.model,
        mass=model.mass,
        root=model.root,
        links=tuple(map(_link_entry, model.links)),
        joints=tuple(_joint_entry(joint, start) for joint in model.joints),
        lower_xyz=box[0] if box else None,
        upper_xyz=box[1] if box else None,
        height=_height(model, box[0]) if box else None,
        wheels=wheels,
        drive=drive.describe(model) if drive else None,
        findings=model.findings,
        needs=needs,
        robot=robot_block(robot, drive, *_remarks(model, robot, wheels, drive)),
    )


def _remarks(model: RobotModel, robot: Robot, wheels: tuple[WheelEntry, ...], drive: Drive | None) -> Iterator[str]:
    """What may be so, and is for the robot's owner to say."""
    if robot.base is None and model.root != WORLD and not wheels and drive is None:
        yield "base: fixed  # if it is bolted to the world, as arms are"
    sides = None if drive else sides_on_ground(model)
    if sides:
        left, right = sides
        kind = SkidSteer if len(left) + len(right) > 2 else DiffDrive
        yield f"drive: {drive_text(kind(left=left, right=right))}"


def _height(model: RobotModel, lowest_corner: Vector3) -> float:
    """Of the base link above the ground, in m."""
    return 0.0 if model.root == WORLD else -lowest_corner[2]


def _base(model: RobotModel) -> str | None:
    """What has to be said of a base that weighs nothing: an engine holds it still."""
    return "fixed" if model.links_by_name[model.root].mass == 0 and model.root != WORLD else None


def _link_entry(link: Link) -> LinkEntry:
    return LinkEntry(name=link.name, mass=link.mass, collision_shapes=len(link.collisions))


def _wheel_entry(wheel: Wheel) -> WheelEntry:
    assert wheel.radius is not None, "what is on the ground is round"
    return WheelEntry(joint=wheel.joint, radius=wheel.radius, position_xyz=wheel.position_xyz, axis_xyz=wheel.axis_xyz)


def _joint_entry(joint: Joint, start: Mapping[str, float]) -> JointEntry:
    return JointEntry(
        name=joint.name,
        type=joint.type,
        parent=joint.parent,
        child=joint.child,
        axis_xyz=joint.axis_xyz,
        lower=joint.lower,
        upper=joint.upper,
        start=start.get(joint.name, 0.0),
        mimics=None if joint.mimic is None else joint.mimic.joint,
    )
