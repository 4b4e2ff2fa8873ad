"""The undercarriage of a model: its wheels on the ground, driven and steered wheels, casters, and layouts.

<ros2_control>, <transmission> and gz-sim's controllers of single joints decide which wheels have motors, if they name
at least one wheel. Other statements of the model about its drive are ignored, each with a note.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Sequence
from typing import Final

from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.core.wording import first_of
from sim_action.drives.plugins import (
    NoDrive,
    joints_by_plugin,
    number_above_zero,
    plugins_of_kind,
    source_of,
    unread_parameters,
)
from sim_action.drives.wheels import (
    MIN_UPRIGHT_Z,
    Tyre,
    Wheel,
    axis_in_base,
    heading_of,
    is_level,
    is_on_ground,
    joints_above,
    lowest_shape,
    rolling,
    round_wheels,
    stands,
    steering_joint,
    tyre,
    wheel,
    wheels_on_ground,
)
from sim_action.robot.model.robot_model import Joint, Plugin, RobotModel

_MAX_NAMED: Final = 4
_PAIR: Final = 2
# Limit of the difference of radii, and of the distance between two axles as a share of the separation.
_MAX_DIFFERENCE: Final = 0.05
_MIN_ALONG_X: Final = 0.99  # a heading with a smaller cosine is not along the base's x axis
# Wheels of a robot that stands tilted end at most this share of their radius above the lowest point of the level robot.
_MAX_TILTED_LIFT_SHARE: Final = 0.5
# A sliding joint with a smaller z component of its axis does not lift a wheel.
_MIN_LIFTING_Z: Final = 0.5
_ROLLING: Final = frozenset({"velocity", "effort"})


@dataclass(frozen=True, slots=True)
class Undercarriage:
    """The wheels on the ground."""

    driven: tuple[Wheel, ...]  # wheels that cannot be steered, and may have motors
    steered: tuple[tuple[Wheel, Joint], ...]  # wheel -> its steering joint, which has limits or a motor
    casters: tuple[Wheel, ...]  # wheels below an upright joint without limits and without a motor
    idle: tuple[Wheel, ...]  # wheels without a motor, in a model that states the motors of other wheels
    # wheels that a joint above lets slide or tip over, with the name of that joint
    loose: tuple[tuple[Wheel, str], ...]
    source: str  # the statement that decides which wheels have motors; empty if there is none

    @property
    def is_stated(self) -> bool:
        """Return True if the model states which wheels have motors."""
        return bool(self.source)


def undercarriage(model: RobotModel) -> Undercarriage:
    """Return the undercarriage of a model. If a caster is too low, the robot tilts, and its wheels touch the ground."""
    wheels = wheels_on_ground(model)
    chassis = _undercarriage(model, wheels)
    tilted = () if chassis.steered or len(chassis.driven) >= _PAIR else wheels_on_ground(model, _MAX_TILTED_LIFT_SHARE)
    return _undercarriage(model, tilted) if len(tilted) > len(wheels) else chassis


def _undercarriage(model: RobotModel, wheels: Sequence[Wheel]) -> Undercarriage:
    # Joint -> its command interfaces and the place that states them.
    motors = {name: (frozenset({interface}), source) for name, (interface, source) in joints_by_plugin(model).items()}
    for joint in model.commanded:
        others = motors.get(joint.joint, (frozenset(), ""))[0]
        motors[joint.joint] = (others | joint.interfaces, f"<{joint.tag}> at {joint.location}")
    rolling = {
        ground_wheel.joint for ground_wheel in wheels if _ROLLING & motors.get(ground_wheel.joint, (frozenset(), ""))[0]
    }
    source = motors[min(rolling)][1] if rolling else ""
    driven, casters, idle = list[Wheel](), list[Wheel](), list[Wheel]()
    steered = list[tuple[Wheel, Joint]]()
    loose = list[tuple[Wheel, str]]()
    aboves = {ground_wheel.joint: steering_joint(model, ground_wheel.joint) for ground_wheel in wheels}
    has_car_joints = any(above is not None and _has_limits(above) for above in aboves.values())
    for ground_wheel in wheels:
        above, has_motor = aboves[ground_wheel.joint], not rolling or ground_wheel.joint in rolling
        if (slack := _loose_joint(model, ground_wheel, wheels)) is not None:
            loose.append((ground_wheel, slack))
        elif above is None:
            (driven if has_motor else idle).append(ground_wheel)
        # Exporters leave the limits of one of two steering joints out. Where motors are stated, casters have none.
        elif above.name in motors or (has_motor and (_has_limits(above) or (has_car_joints and not rolling))):
            steered.append((ground_wheel, above))
        else:
            casters.append(ground_wheel)
    return Undercarriage(tuple(driven), tuple(steered), tuple(casters), tuple(idle), tuple(loose), source)


def _loose_joint(model: RobotModel, ground_wheel: Wheel, wheels: Sequence[Wheel]) -> str | None:
    """Return the joint above a wheel that is no suspension, beam or steering: it lets the wheel slide or tip over."""
    for joint in joints_above(model, ground_wheel.joint):
        x, y, z = axis_in_base(model, joint)
        if abs(z) >= MIN_UPRIGHT_Z:
            continue
        along_axle = abs(x * ground_wheel.axis_xyz[0] + y * ground_wheel.axis_xyz[1] + z * ground_wheel.axis_xyz[2])
        if joint.type == "prismatic":
            is_suspension = abs(z) > _MIN_LIFTING_Z
        else:
            carried = sum(joint in joints_above(model, other.joint) for other in wheels)
            is_suspension = along_axle >= MIN_UPRIGHT_Z or carried > 1  # a beam carries wheels of both sides
        if not is_suspension:
            return joint.name
    return None


def _has_limits(joint: Joint) -> bool:
    return joint.lower is not None or joint.upper is not None


def refuse_other_than_fixed(chassis: Undercarriage) -> Undercarriage:
    """Return an undercarriage without steered and loose wheels. Raises NoDrive."""
    if chassis.steered:
        wheel_joint, joint = chassis.steered[0][0].joint, chassis.steered[0][1]
        raise NoDrive(f"joint '{joint.name}' steers the wheel at '{wheel_joint}'")
    if chassis.loose:
        raise NoDrive(
            f"joint '{chassis.loose[0][1]}' lets the wheel at '{chassis.loose[0][0].joint}' slide or tip over"
        )
    return chassis


def driven_pair(model: RobotModel) -> tuple[str, str]:
    """Return the joints of the wheels of a differential drive, left and right. Raises NoDrive."""
    chassis = refuse_other_than_fixed(undercarriage(model))
    if not (chassis.driven or chassis.casters or chassis.idle):
        raise NoDrive(why_no_wheels(model))
    if len(chassis.driven) != _PAIR:
        which = named(chassis.driven) if chassis.driven else "the others turn below upright joints, or have no motors"
        count = f"wheels on the ground that could be driven: {len(chassis.driven)} ({which})"
        raise NoDrive(f"{count}; a differential drive has {_PAIR}")
    if not chassis.is_stated and (others := unrolling_pair(model)) is not None:
        raise NoDrive(f"'{others[0]}' and '{others[1]}' stand on the ground as well, but no joint lets them roll")
    one, other = chassis.driven
    radii = [driven_wheel.radius or 0.0 for driven_wheel in chassis.driven]
    if abs(radii[0] - radii[1]) > _MAX_DIFFERENCE * radii[0]:
        raise NoDrive(f"{named(chassis.driven)} have different radii, {radii[0]:.4g} m and {radii[1]:.4g} m")
    heading = heading_of(chassis.driven)
    first, second = rolling(one, heading), rolling(other, heading)
    if abs(first.ahead - second.ahead) > _MAX_DIFFERENCE * abs(first.left - second.left):
        apart = abs(first.ahead - second.ahead)
        raise NoDrive(f"{named(chassis.driven)} are not on one axle: one is {apart:.3g} m ahead of the other")
    return _left_and_right(chassis, heading)


def _left_and_right(chassis: Undercarriage, heading: float) -> tuple[str, str]:
    """Return the joints of two wheels, left and right. Raises NoDrive if the sides are not known."""
    one, other = chassis.driven
    if (by_name := mirrored_names(one.joint, other.joint)) is not None:
        return by_name
    if not chassis.is_stated or math.cos(heading) < _MIN_ALONG_X:
        raise NoDrive(f"{named(chassis.driven)} stand on the ground, but their names do not show which is on the left")
    is_left = one.position_xyz[1] > other.position_xyz[1]
    return (one.joint, other.joint) if is_left else (other.joint, one.joint)


def car_joints(model: RobotModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the steering joints and the joints of the driven wheels of a car. Raises NoDrive.

    A tricycle steers with one joint. As its driven wheels are not known by their looks, the model must state them.
    """
    chassis = undercarriage(model)
    steering = tuple(dict.fromkeys(joint.name for _, joint in chassis.steered))
    if not steering:
        raise NoDrive("no wheel on the ground has a steering joint above it: an upright one with limits")
    is_tricycle = chassis.is_stated and len(chassis.steered) == 1
    if not is_tricycle and (len(steering) != _PAIR or len(chassis.steered) != _PAIR):
        raise NoDrive(
            f"steering joints: {len(steering)}, steered wheels: {len(chassis.steered)}; a car has {_PAIR} each"
        )
    if not any(_has_limits(joint) for _, joint in chassis.steered):
        raise NoDrive(f"joint '{steering[0]}' steers without limits, like a swivel drive")
    fixed = len(chassis.driven) + len(chassis.idle)
    if fixed != _PAIR or chassis.casters or chassis.loose:
        raise NoDrive(f"{fixed} wheels on the ground are not steered, and a car has {_PAIR}")
    if not chassis.driven:
        raise NoDrive(f"{named(chassis.idle)} have no motors")
    return steering, tuple(driven_wheel.joint for driven_wheel in chassis.driven)


def why_no_wheels(model: RobotModel) -> str:
    """Return the reason why no wheel stands on the ground, most likely first."""
    ground = lowest_shape(model)
    if ground is None:
        return "the model has no collision shapes, so nothing stands on the ground"
    lowest = f"the lowest shape is the {ground.kind} of '{ground.link}'"
    near = [joint for joint in model.moving_joints if joint.type != "prismatic" and is_level(model, joint)]
    for joint in near:
        shape = tyre(model, joint)
        if isinstance(shape, Tyre) and joint.type != "continuous" and is_on_ground(wheel(model, joint.name), ground):
            return f"'{joint.child}' is round and stands on the ground, but joint '{joint.name}' has limits"
    if hanging := round_wheels(model):
        best = min(hanging, key=lambda round_wheel: round_wheel.position_xyz[2] - (round_wheel.radius or 0.0))
        height = best.position_xyz[2] - (best.radius or 0.0) - ground.z
        return f"the wheel at '{best.joint}' ends {units.display(height, 'm')} above the ground: {lowest}"
    tilted = next((joint for joint in model.moving_joints if joint.child == ground.link), None)
    if tilted is not None and tilted not in near:
        return f"{lowest}, whose joint '{tilted.name}' has no level axis: its wheel would not roll"
    for joint in near:
        if joint.type == "continuous" and not isinstance(shape := tyre(model, joint), Tyre):
            return f"the link of '{joint.name}' {shape.reason}; {lowest}"
    if "wheel" in ground.link.lower():
        above = next((joint for joint in model.joints if joint.child == ground.link), None)
        lowest += f", whose joint '{above.name}' is {above.type}" if above else ", which has no joint"
    return f"no round link on a 'continuous' joint stands on the ground: {lowest}"


def unrolling_pair(model: RobotModel) -> tuple[str, str] | None:
    """Return two links, left and right, that are called wheels and stand on the ground, but have no joint to roll."""
    ground = lowest_shape(model)
    if ground is None:
        return None
    rolling = {model.joints_by_name[ground_wheel.joint].child for ground_wheel in wheels_on_ground(model)}
    names = [link.name for link in model.links if "wheel" in link.name.lower() and link.name not in rolling]
    standing = [name for name in names if stands(model, name, ground)]
    pairs = (mirrored_names(one, other) for place, one in enumerate(standing) for other in standing[place + 1 :])
    return next((pair for pair in pairs if pair is not None), None)


def named(wheels: Sequence[Wheel]) -> str:
    """Return the names of the joints of wheels as text."""
    return first_of([f"'{ground_wheel.joint}'" for ground_wheel in wheels], _MAX_NAMED)


def mirrored_names(one: str, other: str) -> tuple[str, str] | None:
    """Return (left, right) if two names differ only in their side, such as "l_wheel" and "r_wheel"; else None."""
    for left, right in ((one, other), (other, one)):
        if any(guess == right.lower() for guess in _mirrored(left.lower())):
            return left, right
    return None


def _mirrored(name: str) -> Iterator[str]:
    """Yield the names that the other side may have, for a name with "left" or a part "l"."""
    if "left" in name:
        yield name.replace("left", "right")
    if "wheell" in name:
        yield name.replace("wheell", "wheelr")
    parts = name.split("_")
    for place, part in enumerate(parts):
        for left, right in (("l", "r"), ("lf", "rf"), ("lr", "rr"), ("fl", "fr"), ("rl", "rr"), ("bl", "br")):
            if part == left:
                yield "_".join((*parts[:place], right, *parts[place + 1 :]))


_SPEED_LIMIT: Final = re.compile(r"(?:(?P<axis>(?:linear|angular)\.[xyz])\.)?max_(?:linear_|angular_)?velocity")


def ignored_statements(model: RobotModel, source: str, joints: Collection[str]) -> Iterator[str]:
    """Yield a note for each kind of statement that a recognised drive does not use.

    :param source: of the drive. joints: the joints that it controls.
    """
    plugins = plugins_of_kind(model, "diff", "skid", "ackermann", "mecanum")
    used = next((plugin for plugin in plugins if source_of(plugin) == source), None)
    if used is not None and (limits := [*_speed_limits(used)]):
        yield f"{', '.join(limits)} of {source} is ignored: keep the twists of 'commands' below it"
    if used is not None and (others := [source_of(plugin) for plugin in plugins if plugin is not used]):
        yield f"{', '.join(others)} is ignored, because the robot has one drive, that of {source}"
    with_motors = {stated.joint for stated in model.commanded}
    idle = [wheel.joint for wheel in wheels_on_ground(model) if wheel.joint in with_motors.difference(joints)]
    if idle:
        names = ", ".join(f"'{name}'" for name in idle)
        yield f"the model states motors of {names}, but the drive does not turn them; state all wheels in robot.drive"
    if used is None or "/" not in used.name:
        yield from unread_parameters(model)


def _speed_limits(plugin: Plugin) -> Iterator[str]:
    for tag, text in plugin.parameters:
        match = _SPEED_LIMIT.fullmatch(tag)
        if match is None or number_above_zero(text) is None:
            continue
        switch = plugin.texts(f"{match['axis']}.has_velocity_limits") if match["axis"] else ()
        if not any(text.strip().lower() == "false" for text in switch):
            yield f"{tag} {text.strip()}"
