"""What a robot model is: a look at it before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from sim_action import geometry
from sim_action.drives import Drive, recognise
from sim_action.drives.wheels import link_pose
from sim_action.geometry import Pose, Vector3
from sim_action.models import load_model
from sim_action.models.findings import ALLOWABLE
from sim_action.quantities import FrozenModel
from sim_action.robot_model import Finding, Joint, JointType, Link, RobotModel, Shape
from sim_action.workspace import Workspace
from sim_action.world import Robot


class JointEntry(FrozenModel):
    """A joint; limits in rad (m if it slides), None without; `mimics`: the joint that it follows."""

    name: str
    type: JointType
    parent: str
    child: str
    axis_xyz: Vector3
    lower: float | None
    upper: float | None
    mimics: str | None


class LinkEntry(FrozenModel):
    """A link; mass in kg, None where the model does not say."""

    name: str
    mass: float | None
    collision_shapes: int


class Inspection(FrozenModel):
    """All of it.

    Attributes:
        model: as a scenario names it.
        mass: kg, of the links that say what they weigh.
        lower_xyz, upper_xyz: m, corners of the box around all collision shapes, in the base frame, joints at zero;
            None if there are meshes among them.
        height: m, of the base link above the ground when the lowest shape touches it.
        drive: the wheels that were recognised, with their figures.
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
    drive: str | None
    findings: tuple[Finding, ...]
    needs: tuple[str, ...]
    robot: str


def inspect_model(name: str, workspace: Workspace) -> Inspection:
    """Looks at what a scenario could name as its model. Raises ModelError for what no engine could take."""
    model = load_model(Robot(model=name, allow=ALLOWABLE), workspace)
    drive = recognise(model)
    needs = tuple(sorted({finding.rule for finding in model.findings if finding.level == "error"}))
    box = _box(model)
    lower, upper = box or (None, None)
    return Inspection(
        name=model.name,
        model=name,
        mass=model.mass,
        root=model.root,
        links=tuple(map(_link_entry, model.links)),
        joints=tuple(map(_joint_entry, model.joints)),
        lower_xyz=lower,
        upper_xyz=upper,
        height=-lower[2] if lower else None,
        drive=drive.describe(model) if drive else None,
        findings=model.findings,
        needs=needs,
        robot=_block(name, needs, drive),
    )


def _link_entry(link: Link) -> LinkEntry:
    return LinkEntry(name=link.name, mass=link.mass, collision_shapes=len(link.collisions))


def _joint_entry(joint: Joint) -> JointEntry:
    return JointEntry(
        name=joint.name,
        type=joint.type,
        parent=joint.parent,
        child=joint.child,
        axis_xyz=joint.axis_xyz,
        lower=joint.lower,
        upper=joint.upper,
        mimics=None if joint.mimic is None else joint.mimic.joint,
    )


def _box(model: RobotModel) -> tuple[Vector3, Vector3] | None:
    """None if there is no shape, or one whose size is not known: a box that leaves something out tells a lie."""
    if any(shape.lower_xyz is None for link in model.links for shape in link.collisions):
        return None
    corners = [corner for link in model.links for corner in _corners(model, link)]
    if not corners:
        return None
    xs, ys, zs = zip(*corners, strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def _corners(model: RobotModel, link: Link) -> Iterator[Vector3]:
    """Of the boxes around a link's shapes, in the base frame; where a shape is turned, its box is a little large."""
    frame = link_pose(model, link.name)
    for shape in link.collisions:
        yield from _shape_corners(geometry.compose(frame, shape.pose), shape)


def _shape_corners(pose: Pose, shape: Shape) -> Iterator[Vector3]:
    if shape.lower_xyz is None or shape.upper_xyz is None:
        return
    if shape.kind == "sphere":
        x, y, z = pose.position_xyz
        radius = shape.upper_xyz[0]
        yield from ((x - radius, y - radius, z - radius), (x + radius, y + radius, z + radius))
        return
    for x, y, z in product(*zip(shape.lower_xyz, shape.upper_xyz, strict=True)):
        yield geometry.compose(pose, Pose((x, y, z))).position_xyz


def _block(name: str, needs: tuple[str, ...], drive: Drive | None) -> str:
    lines = ["robot:", f"  model: {name}"]
    if needs:
        lines.append(f"  allow: [{', '.join(needs)}]")
    if drive:
        keys = drive.model_dump(exclude_defaults=True)
        written = ", ".join(f"{key}: {_written(value)}" for key, value in keys.items())
        lines.append(f"  drive: {{{drive.key}: {{{written}}}}}")
    return "\n".join(lines) + "\n"


def _written(value: float | tuple[str, ...]) -> str:
    return f"[{', '.join(value)}]" if isinstance(value, tuple) else f"{value:g}"
