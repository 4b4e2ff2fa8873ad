"""The use case `inspect`: describe a robot model before anything is simulated."""

from __future__ import annotations

import json
import os
import pickle
import re
import signal
import subprocess
import sys
import textwrap
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Final

from sim_action.core import units
from sim_action.core.errors import Location, ModelError
from sim_action.core.field_types import FrozenModel, on_lines
from sim_action.core.geometry import Vector3
from sim_action.core.records import replace
from sim_action.core.wording import log_line
from sim_action.core.workspace import Workspace
from sim_action.drives import Drive, recognise, why_not_recognised
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.skid import SkidSteer, mecanum_names, sides_on_ground
from sim_action.drives.undercarriage import ignored_statements, unrolling_pair
from sim_action.drives.wheels import Wheel, opposed_note, wheels_on_ground
from sim_action.results.masking import Mask
from sim_action.robot.documents.xml_document import shown_file
from sim_action.robot.model.findings import ALLOWABLE, Finding, finding
from sim_action.robot.model.kinematics import link_poses, robot_box
from sim_action.robot.model.robot_model import WORLD, Joint, JointType, Link, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model, with_srdf
from sim_action.runner.isolation.child_process import environment
from sim_action.runner.process_output import redirect_output
from sim_action.scenario.model import MEMORY, WALL_SECONDS
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

_WIDTH: Final = 80
_MAX_NAME_CHARS: Final = 60
_AXES: Final = {sign * place: f"{'-' * (sign < 0)}{name}" for place, name in enumerate("xyz", 1) for sign in (1, -1)}


def inspection_json(inspection: Inspection, mask: Mask) -> str:
    """Return an inspection as JSON, without the values of variables that the caller passes."""
    if mask.pattern is None:
        return inspection.model_dump_json(indent=2)
    return json.dumps(mask.values(inspection.model_dump(mode="json")), indent=2, ensure_ascii=False)


def inspection_text(inspection: Inspection) -> str:
    """Return the description of a model as text: summary, tree of joints, findings of the audit, `robot:` block."""
    block = ["block for a scenario in this folder:", "", inspection.robot]
    inspection = on_lines(inspection)
    return _text(_summary(inspection), _tree(inspection), _findings(inspection), block)


def losses_text(inspection: Inspection) -> str:
    """Return the parts of a model that are not simulated as its files state them, as text, and the unread ones."""
    inspection = on_lines(inspection)
    lost = [note for note in inspection.findings if note.rule not in _UNKNOWN]
    unknown = [note for note in inspection.findings if note.rule in _UNKNOWN]
    return _text(
        _listed("not simulated as the file states it; every report of a run warns of what changes the motion", lost),
        _listed("unknown, so that it is not read; correct the name, or remove it if no program needs it", unknown),
        _listed("not read, and harmless, because the motion is the same without it", inspection.harmless),
    )


_UNKNOWN: Final = ("unknown-part", "unknown-tag")


def _listed(title: str, findings: Sequence[Finding]) -> Iterator[str]:
    yield f"{title}: {'' if findings else 'nothing'}".rstrip()
    for note in findings:
        yield from _wrapped(f"{note.location}: {note.message} [{note.rule}]", "  ")


def _text(*parts: Iterable[str]) -> str:
    return "\n\n".join("\n".join(map(log_line, "\n".join(part).split("\n"))) for part in parts)


def _summary(inspection: Inspection) -> Iterator[str]:
    moving = sum(joint.type != "fixed" for joint in inspection.joints)
    name = inspection.name if len(inspection.name) <= _MAX_NAME_CHARS else f"{inspection.name[:_MAX_NAME_CHARS]}..."
    joints = f"{len(inspection.joints)} joints ({moving} move)"
    yield f"{name}: {len(inspection.links)} links, {joints}, {inspection.mass:.4g} kg"
    if inspection.lower_xyz and inspection.upper_xyz and inspection.height is not None:
        sizes = (
            _length(upper - lower) for lower, upper in zip(inspection.lower_xyz, inspection.upper_xyz, strict=True)
        )
        yield f"its collision shapes fill {' x '.join(sizes)} m (x, y, z)"
        if inspection.root == WORLD:
            lowest = f"its lowest shape is {_above(inspection.lower_xyz[2])} the ground"
            yield from _wrapped(f"bolted to the world, its base link '{WORLD}' is at the origin; {lowest}")
        else:
            yield f"standing, its base link '{inspection.root}' is {_above(inspection.height)} the ground"
    for wheel in inspection.wheels:
        x, y, _ = map(_length, wheel.position_xyz)
        yield f"wheel: {wheel.joint}, radius {_length(wheel.radius)} m, at x = {x} m, y = {y} m"
    if inspection.drive:
        yield from _wrapped(f"recognised from {inspection.drive_source}: {inspection.drive}")
        if (
            note := opposed_note({wheel.joint: wheel.axis_xyz for wheel in inspection.wheels}, inspection.drive_plugin)
        ) is not None:
            yield from _wrapped(note)
    elif inspection.wheels or inspection.drive_reasons:
        example = "{diff: {left: [...], right: [...]}}"
        yield from _wrapped(
            f"no drive is recognised; if the robot has one, state it in robot.drive, such as {example}:"
        )
        for reason in inspection.drive_reasons:
            yield from _wrapped(reason, "  ")


def _above(height: float) -> str:
    return f"{_length(abs(height))} m {'below' if round(height, 4) < 0 else 'above'}"


def _length(metres: float) -> str:
    return f"{round(metres, 4) + 0.0:.4g}"


def _tree(inspection: Inspection) -> Iterator[str]:
    children: dict[str, list[JointEntry]] = {}
    for joint in inspection.joints:
        children.setdefault(joint.parent, []).append(joint)
    masses = {link.name: link.mass for link in inspection.links}
    yield _link(inspection.root, masses)
    yield from _below(inspection.root, children, masses, "")


def _below(
    link: str, children: dict[str, list[JointEntry]], masses: dict[str, float | None], stem: str
) -> Iterator[str]:
    branches: dict[str, list[JointEntry]] = {}
    for joint in children.get(link, []):
        branches.setdefault(joint.child, []).append(joint)
    for number, (child, joints) in enumerate(branches.items(), 1):
        is_last = number == len(branches)
        inner = f"{stem}{'   ' if is_last else '|  '}"
        starts = [f"{stem}{'`-' if is_last else '|-'} ", *(inner for _ in joints[1:])]
        # A link of MJCF may have several joints in series.
        ends = [*("" for _ in joints[1:]), f" -> {_link(child, masses)}"]
        for start, joint, end in zip(starts, joints, ends, strict=True):
            yield f"{start}{_joint(joint)}{end}"
        yield from _below(child, children, masses, inner)


def _link(name: str, masses: dict[str, float | None]) -> str:
    mass = masses[name]
    return name if mass is None else f"{name} ({units.display(mass, 'kg')})"


def _joint(joint: JointEntry) -> str:
    if joint.type == "fixed":
        return f"{joint.name} [fixed]"
    way = "along" if joint.type == "prismatic" else "about"
    return f"{joint.name} [{', '.join((f'{joint.type} {way} {_axis(joint.axis_xyz)}', *_details(joint)))}]"


def _axis(direction: Vector3) -> str:
    along = [place * round(part) for place, part in enumerate(direction, 1) if abs(part) > 1 - 1e-6]
    return _AXES[along[0]] if along else " ".join(f"{part:.3g}" for part in direction)


def _details(joint: JointEntry) -> Iterator[str]:
    unit = "m" if joint.type == "prismatic" else "rad"
    if (joint.lower, joint.upper) != (None, None):
        lower, upper = (None if end is None else units.display(end, unit) for end in (joint.lower, joint.upper))
        yield f"{lower.split()[0]} to {upper}" if lower and upper else f"from {lower}" if lower else f"up to {upper}"
    if joint.mimics is not None:
        yield f"follows {joint.mimics}"
    elif joint.start:
        yield f"begins at {units.display(joint.start, unit)}"
    if joint.motor is not None:
        yield joint.motor


def _findings(inspection: Inspection) -> Iterator[str]:
    if not inspection.findings:
        yield "the audit found no problems"
        return
    yield "the audit found:"
    for rule in dict.fromkeys(note.rule for note in inspection.findings):
        same = [note for note in inspection.findings if note.rule == rule]
        yield f"{same[0].level} {rule}{', can be allowed by robot.allow' if rule in inspection.needs else ''}"
        for kind in dict.fromkeys(map(_kind, same)):
            yield from _wrapped(_places([note for note in same if _kind(note) == kind]), "  ")


_NAME: Final = re.compile(r"""'[^']*'|"[^"]*\"""")
_HINT: Final = re.compile(r"(; did you mean '[^']*'\?)? \(allowed: .*\)")
_NUMBER: Final = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
_MAX_OTHERS: Final = 4


def _kind(finding: Finding) -> str:
    return _NUMBER.sub("0", _NAME.sub("''", _HINT.sub("", finding.message)))


def _places(findings: Sequence[Finding]) -> str:
    """Return the first of findings of one kind, and the count, first names and first lines of the others."""
    first, *others = findings
    if not others:
        return f"{first.location}: {first.message}"
    lines = list(dict.fromkeys(_line(finding, first.location.file) for finding in others))
    where = f"line{'s' * (len(lines) > 1)} {_first_few(lines)}"
    if all(finding.message == first.message for finding in others):
        return f"{first.location}: {first.message} (also on {where})"
    matches = (_NAME.search(finding.message) for finding in others)
    names = list(dict.fromkeys(name[0] for name in matches if name))
    named = f": {_first_few(names)}" if names else ""
    return f"{first.location}: {_HINT.sub('', first.message)} (and {len(others):,} more like this{named}; {where})"


def _line(finding: Finding, file: str) -> str:
    place = finding.location
    return str(place.line) if place.file == file else f"{PurePath(place.file).name}:{place.line}"


def _first_few(texts: list[str]) -> str:
    return ", ".join(texts[:_MAX_OTHERS]) + (", ..." if len(texts) > _MAX_OTHERS else "")


def _wrapped(text: str, indent: str = "") -> list[str]:
    # Paths stay whole, so that they can be clicked and copied.
    below = f"{indent}  "
    return textwrap.wrap(
        text, _WIDTH, initial_indent=indent, subsequent_indent=below, break_long_words=False, break_on_hyphens=False
    )


# Texts that every YAML reader reads as a string.
_PLAIN: Final = re.compile(r"(?:[A-Za-z_/]|\.\.?/)[A-Za-z0-9_./-]*")
_WORDS: Final = frozenset(["null", "true", "false", "yes", "no", "on", "off", "y", "n"])


def robot_block(robot: Robot, drive: Drive | None, *remarks: str) -> str:
    """Return a `robot:` block for a scenario; `remarks`: keys for the reader to decide, as comments."""
    stated = robot.model_dump(exclude_defaults=True)
    lines = [f"  {key}: {_flow(value)}" for key, value in stated.items()]
    lines += [f"  drive: {drive_text(drive)}"] if drive else []
    lines += [f"  # {remark}" for remark in remarks]
    return "\n".join(("robot:", *lines)) + "\n"


def drive_text(drive: Drive) -> str:
    """Return the value for `drive:`."""
    return _flow({drive.key: drive.model_dump(exclude_defaults=True)})


def _flow(value: object) -> str:
    """A value in YAML's flow style, on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value.lower() not in _WORDS:
        return value
    # JSON is YAML, except for surrogate pairs and YAML's additional line breaks.
    text = json.dumps(value, ensure_ascii=False)
    return "".join(char if char.isprintable() else f"\\U{ord(char):08x}" for char in text)


class JointEntry(FrozenModel):
    """A joint; positions in rad (m if prismatic), None without a limit.

    `mimics`: the joint that it follows. `motor`: its motor in MJCF as text, None without one.
    """

    name: str
    type: JointType
    parent: str
    child: str
    axis_xyz: Vector3
    lower: float | None
    upper: float | None
    start: float
    mimics: str | None
    motor: str | None


class LinkEntry(FrozenModel):
    """A link; mass in kg, None if the model does not state it."""

    name: str
    mass: float | None
    collision_shapes: int


class WheelEntry(FrozenModel):
    """A round link on the ground on a freely turning joint; radius and place in m, axis in the base frame."""

    joint: str
    radius: float
    position_xyz: Vector3
    axis_xyz: Vector3


class Inspection(FrozenModel):
    """The description of a robot model."""

    name: str
    model: str  # as a scenario names it
    mass: float  # kg, of all links with a stated mass
    root: str
    links: tuple[LinkEntry, ...]
    joints: tuple[JointEntry, ...]
    # m, corners of the box around all collision shapes, in the base frame, with the joints at their start; None without
    # shapes
    lower_xyz: Vector3 | None
    upper_xyz: Vector3 | None
    # m, of the base link above the ground when the lowest shape touches it; 0 if it is bolted to the world
    height: float | None
    wheels: tuple[WheelEntry, ...]  # links that look like wheels
    drive: str | None  # the recognised drive with its figures
    drive_source: str | None  # the plugin, controller or tag that it was recognised from, or "geometry"
    drive_plugin: str  # the plugin that turns its wheels as in Gazebo, or empty
    # why no drive is recognised, most likely first; empty for a robot that cannot roll
    drive_reasons: tuple[str, ...]
    findings: tuple[Finding, ...]  # of the audit
    harmless: tuple[Finding, ...]  # the parts that are not read and without which the motion is the same
    needs: tuple[str, ...]  # rules that `robot.allow` must name
    robot: str  # a `robot:` block to paste


def inspect_model(robot: Robot, workspace: Workspace) -> Inspection:
    """Inspect a model as if every rule were allowed. Raises ModelError if no engine accepts it."""
    model = load_model(robot.model_copy(update={"allow": ALLOWABLE}), workspace)
    if robot.srdf is None and model.source and (beside := Path(model.source).with_suffix(".srdf")).is_file():
        try:
            model = with_srdf(model, beside)
        except ModelError as error:
            message = f"the SRDF beside the model cannot be used: {str(error).splitlines()[0]}"
            note = finding("passed-over", message, Location(shown_file(beside)))
            model = replace(model, findings=(*model.findings, note))
    needs = tuple(sorted({finding.rule for finding in model.findings if finding.level == "error"}))
    robot = robot.model_copy(update={"allow": needs, "base": robot.base or _base(model)})
    start = Scene(robot, model, World(), Physics(), workspace).joint_positions
    box = robot_box(model, link_poses(model, start))
    drive = recognise(model)
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
        height=(0.0 if model.root == WORLD else -box[0][2]) if box else None,
        wheels=wheels,
        drive=_described(drive, model) if drive else None,
        drive_source=drive.source(model) if drive else None,
        drive_plugin=drive.plugin(model) if drive else "",
        drive_reasons=() if drive or not _may_roll(robot, model) else why_not_recognised(model),
        findings=model.findings,
        harmless=model.harmless,
        needs=needs,
        robot=robot_block(robot, drive, *_remarks(model, robot, wheels, drive)),
    )


def _described(drive: Drive, model: RobotModel) -> str:
    ignored = ignored_statements(model, drive.source(model), drive.open(model, 1.0).joints)
    return "; ".join((drive.describe(model), *ignored))


def _may_roll(robot: Robot, model: RobotModel) -> bool:
    is_bolted = robot.base == "fixed" or model.root == WORLD
    return not is_bolted and (bool(model.plugins) or any(joint.type == "continuous" for joint in model.joints))


def _remarks(model: RobotModel, robot: Robot, wheels: tuple[WheelEntry, ...], drive: Drive | None) -> Iterator[str]:
    """Yield keys that the robot's owner has to decide."""
    if robot.base is None and model.root != WORLD and not wheels and drive is None:
        yield "base: fixed  # if the robot is bolted to the world, like an arm"
    if robot.srdf is None and model.source and (beside := Path(model.source).with_suffix(".srdf")).is_file():
        yield f"srdf: {_flow(PurePath(robot.file).with_name(beside.name).as_posix())}  # for its groups and pairs"
    usable = [name for name, keyframe in model.keyframes.items() if not keyframe.flaw]
    if usable and robot.keyframe is None:
        first, *others = usable
        more = f"; there {'is 1 other' if len(others) == 1 else f'are {len(others)} others'}" if others else ""
        yield f"keyframe: {first if first.isdecimal() else _flow(first)}  # to begin there{more}"
    likely = None if drive or unrolling_pair(model) else likely_drive(model)
    if likely is not None:
        yield f"drive: {drive_text(likely)}"
    elif drive is None and not mecanum_names(model) and (placed := DiffDrive.by_place(model)) is not None:
        yield f"drive: {drive_text(placed)}  # by place; if the names are right, swap the sides and give 'heading'"


def _base(model: RobotModel) -> str | None:
    is_weightless = model.links_by_name[model.root].mass == 0 or not model.mass
    return "fixed" if is_weightless and model.root != WORLD else None


def _link_entry(link: Link) -> LinkEntry:
    return LinkEntry(name=link.name, mass=link.mass, collision_shapes=len(link.collisions))


def _wheel_entry(wheel: Wheel) -> WheelEntry:
    assert wheel.radius is not None, "wheels on the ground are round"
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
        motor=None if joint.motor is None else joint.motor.text,
    )


_PAIR: Final = 2


def likely_drive(model: RobotModel) -> Drive | None:
    """Return a drive with the wheels on the ground, which the owner has to confirm; None if there is none."""
    left, right = sides_on_ground(model) or ((), ())
    if not left:
        return None
    if mecanum_names(model):
        # The front wheel of each side comes first.
        orders = [(left, right), (left[::-1], right[::-1])] if len(left) == len(right) == _PAIR else []
        drives = (MecanumDrive(left=(a, b), right=(c, d)) for (a, b), (c, d) in orders)
        return next((drive for drive in drives if not any(drive.problems(model))), None)
    return (SkidSteer if len(left) + len(right) > _PAIR else DiffDrive)(left=left, right=right)


_CALL: Final = [sys.executable, "-P", "-m", "sim_action.app.inspect"]


class _Answer(FrozenModel):
    """The answer of the process: an inspection, the reason for a refusal, or a traceback."""

    inspection: Inspection | None = None
    refused: str = ""
    fault: str = ""


def inspect_apart(
    robot: Robot, workspace: Workspace, seconds: float = WALL_SECONDS, memory: int = MEMORY
) -> Inspection:
    """Inspect a model; xacro and MJCF are limited to `seconds` of wall time and `memory` bytes. Raises ModelError."""
    if not (robot.is_xacro or robot.is_mjcf):
        return inspect_model(robot, workspace)
    task, quiet = pickle.dumps((robot, workspace, memory)), subprocess.DEVNULL
    variables = environment(workspace.pass_env)
    try:
        ended = subprocess.run(  # noqa: S603 - this interpreter, and nothing from a model
            _CALL, input=task, stdout=subprocess.PIPE, stderr=quiet, timeout=seconds, env=variables, check=False
        )
    except subprocess.TimeoutExpired:
        activity, remedy = "reading it", "simplify the model, or reduce the counts of <replicate>"
        if robot.is_xacro:
            activity, remedy = "the evaluation", "check the file for an endless recursion"
        raise ModelError(f"{robot.model}: {activity} was stopped after {seconds:g} s; {remedy}") from None
    if ended.returncode or not ended.stdout:
        code = ended.returncode
        raise ModelError(f"{robot.model}: the process that read it ended with exit code {code} without a result")
    answer = _Answer.model_validate_json(ended.stdout)
    if answer.refused:
        raise ModelError(Mask.of(os.environ, workspace.pass_env).message(answer.refused))
    if answer.inspection is None:
        raise RuntimeError(answer.fault)
    return answer.inspection


def main() -> None:
    """Run the process: read the request from standard input, write the answer to standard output."""
    robot, workspace, memory = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent
    with os.fdopen(os.dup(1), "wb") as answer:
        redirect_output(Path(os.devnull))
        if sys.platform == "linux":
            # a usual run does without it
            from sim_action.runner.isolation.process_control import end_with_parent, impose_limits

            end_with_parent(os.getppid(), signal.SIGKILL)
            impose_limits(memory)
        answer.write(_looked(robot, workspace, memory).model_dump_json().encode())


def _looked(robot: Robot, workspace: Workspace, memory: int) -> _Answer:
    try:
        return _Answer(inspection=inspect_model(robot, workspace))
    except ModelError as error:
        return _Answer(refused=str(error))
    except MemoryError:
        return _Answer(
            refused=f"{robot.model}: reading it needs more than {memory / 2**30:.4g} GiB of memory; simplify it"
        )
    except Exception:  # noqa: BLE001 - the parent reports a fault of sim-action
        return _Answer(fault=traceback.format_exc())


if __name__ == "__main__":
    main()
