"""Skid steer: four or six wheels that cannot be steered, so that some slip in turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import PurePath
from statistics import fmean
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.core import units
from sim_action.core.field_types import NonNegativeKilogramSquareMetres, PositiveRatio
from sim_action.core.geometry import Vector3
from sim_action.core.records import dataclass, replace
from sim_action.drives.diff import TwoSidedDrive
from sim_action.drives.plugins import SKID_PLUGINS, Kind, NoDrive, Stated
from sim_action.drives.undercarriage import named, refuse_other_than_fixed, undercarriage
from sim_action.drives.wheels import MAX_AXLE_DEVIATION, Wheel, centre_of_mass, rolling, wheel
from sim_action.robot.model.robot_model import RobotModel
from sim_action.world.scene import Scene

# Depth in m by which each wheel presses into the ground at rest. Rigid wheels would share the load of more than three
# wheels in an undetermined way; real ones have tyres.
_TYRE_DEPTH_M: Final = 0.25e-3
# Damping as a multiple of the critical one. MuJoCo's rigid contacts yield more slowly than tyres with less.
_TYRE_DAMPING: Final = 2.0
Sides = tuple[tuple[str, ...], tuple[str, ...]]
_MIN_LATERAL_M: Final = 1e-3  # a wheel closer to the centre line than this is on neither side
_MIN_WHEELS: Final = 4
_HALVINGS: Final = 60  # bisection steps, down to the last bits


class SkidSteer(TwoSidedDrive):
    """Two sides with several wheels each. In turns wheels slip, as if they were `slip` times as far apart.

    The computed factor is valid on level ground for friction that is the same in all directions. Wheels have the
    contact stiffness of a hard tyre, or less if the model states less. Velocity limits act as in `diff`.
    """

    key: ClassVar[str] = "skid"
    slips: ClassVar[bool] = True
    title: ClassVar[str] = "skid steer"
    plugins: ClassVar[tuple[Kind, ...]] = SKID_PLUGINS

    slip: Annotated[
        PositiveRatio | None,
        Field(description="factor on the separation; default: computed from the wheels and the centre of mass"),
    ] = None
    rotor_inertia: Annotated[
        NonNegativeKilogramSquareMetres | None,
        Field(description="inertia of a wheel's motor behind its gears; default: none"),
    ] = None

    @classmethod
    def by_wheels(cls, model: RobotModel) -> Self:
        """Each side has several wheels, and none of them is steered."""
        wheels = refuse_other_than_fixed(undercarriage(model)).driven
        if len(wheels) < _MIN_WHEELS:
            raise NoDrive(
                f"wheels on the ground that could be driven: {len(wheels)}; skid steer has {_MIN_WHEELS} or more"
            )
        if names := mecanum_names(model):
            raise NoDrive(f"'{names[0]}' names wheels with rollers, which do not skid")
        left, right = sides_on_ground(model) or ((), ())
        if not left:
            raise NoDrive(f"{named(wheels)} are not parallel, or their names and places show different sides")
        if len(left) != len(right):
            raise NoDrive(f"there are {len(left)} wheels on the left and {len(right)} on the right")
        return cls(left=left, right=right)

    @override
    def is_far(self, key: str, ratio: float) -> bool:
        # The separation of a plugin is the effective one, which is greater than the distance of the wheels.
        return super().is_far(key, ratio) and (key != "separation" or ratio < 1)

    @classmethod
    def as_stated(cls, model: RobotModel, stated: Stated) -> Self:
        """The separation of a plugin is the effective one."""
        drive = super().as_stated(model, stated)
        return drive.model_copy(update={"slip": 1.0}) if "separation" in stated.figures else drive

    @override
    def slip_factor(self, model: RobotModel) -> float:
        if self.slip is not None:
            return self.slip
        heading = self.forward(model)
        x, y, _ = centre_of_mass(model)
        wheels = [wheel(model, name) for name in (*self.left, *self.right)]
        aheads = [rolling(driven_wheel, heading).ahead for driven_wheel in wheels]
        stands = footings(
            aheads, math.cos(heading) * x + math.sin(heading) * y, [driven_wheel.width for driven_wheel in wheels]
        )
        return slip_factor(stands, self.separation_in(model))

    @override
    def slip_text(self, model: RobotModel) -> str:
        worked_out = "" if self.slip else " (computed from the wheels and the centre of mass)"
        rotors = "" if self.rotor_inertia is None else f", rotors {units.display(self.rotor_inertia, 'kg m^2')}"
        return f" x slip {self.slip_factor(model):.4g}{worked_out}{rotors}"

    def prepared(self, scene: Scene) -> Scene:
        """Adds the inertia of the motors, and the stiffness of tyres."""
        joints = (*self.left, *self.right)
        wheels = frozenset(scene.model.joints_by_name[name].child for name in joints)
        rotors = dict.fromkeys(joints, self.rotor_inertia) if self.rotor_inertia else {}
        model = scene.model if scene.model.mjcf else _with_tyres(scene.model, wheels, scene.world.gravity_xyz)
        return replace(super().prepared(scene), model=model, rotors=rotors, scrubbing=wheels)


def _with_tyres(model: RobotModel, wheels: frozenset[str], gravity_xyz: Vector3) -> RobotModel:
    """Return the model with wheels that are springs, damped for their share of the mass, and not stiffer than tyres."""
    mass = model.mass / len(wheels)
    stiffness = mass * math.hypot(*gravity_xyz) / _TYRE_DEPTH_M
    if not stiffness:
        return model
    damping = _TYRE_DAMPING * 2 * math.sqrt(stiffness * mass)
    links = tuple(
        replace(link, surface=replace(link.surface, stiffness=stiffness, damping=damping))
        if link.name in wheels and (link.surface.stiffness or math.inf) > stiffness
        else link
        for link in model.links
    )
    return replace(model, links=links)


def mecanum_names(model: RobotModel) -> list[str]:
    """Return the names of links, joints, drawn meshes and of the model itself that name wheels with rollers."""
    meshes = [PurePath(visual.file).name for link in model.links for visual in link.visuals if visual.file]
    names = [*model.links_by_name, *model.joints_by_name, *meshes, model.name]
    return [name for name in names if any(word in name.lower() for word in ("mecanum", "omni_wheel", "omniwheel"))]


def sides_on_ground(model: RobotModel) -> Sides | None:
    """Return the driven joints on the left and right; None unless all are parallel, on a side and not steered."""
    chassis = undercarriage(model)
    wheels = chassis.driven
    if not wheels or chassis.steered or chassis.loose:
        return None
    by_place = _by_place(wheels)
    by_name = _by_name(wheels)
    # A robot that rolls along x has its left at +y. For other directions only joint names show the front.
    if by_place is None:
        return by_name if _parallel(wheels) else None
    return by_place if by_name in (None, by_place) else None


def _by_place(wheels: Sequence[Wheel]) -> Sides | None:
    if any(
        abs(driven_wheel.axis_xyz[1]) < 1 - MAX_AXLE_DEVIATION or abs(driven_wheel.position_xyz[1]) < _MIN_LATERAL_M
        for driven_wheel in wheels
    ):
        return None
    return _split(wheels, [driven_wheel.position_xyz[1] > 0 for driven_wheel in wheels])


def _by_name(wheels: Sequence[Wheel]) -> Sides | None:
    names = [driven_wheel.joint.lower() for driven_wheel in wheels]
    if any(("left" in name) == ("right" in name) for name in names):
        return None
    return _split(wheels, ["left" in name for name in names])


def _split(wheels: Sequence[Wheel], is_left: Sequence[bool]) -> Sides | None:
    left, right = (
        tuple(driven_wheel.joint for driven_wheel, on_left in zip(wheels, is_left, strict=True) if on_left is side)
        for side in (True, False)
    )
    return (left, right) if left and right else None


def _parallel(wheels: Sequence[Wheel]) -> bool:
    ax, ay, _ = wheels[0].axis_xyz
    return all(
        abs(ax * driven_wheel.axis_xyz[0] + ay * driven_wheel.axis_xyz[1]) > 1 - MAX_AXLE_DEVIATION
        for driven_wheel in wheels
    )


@dataclass(frozen=True, slots=True)
class Footing:
    """The position of a wheel in m ahead of the centre of all wheels, its share of the load, and its width in m."""

    ahead: float
    load: float
    width: float = 0.0

    @property
    def points(self) -> tuple[float, ...]:
        """The points on which the wheel stands, in m from its middle towards the outside.

        Engines support a cylinder at the two ends of its line of contact.
        """
        return (-self.width / 2, self.width / 2) if self.width else (0.0,)


def footings(aheads: Sequence[float], mass_ahead: float, widths: Sequence[float] = ()) -> list[Footing]:
    """Return the wheels of both sides of a robot with its centre of mass at `mass_ahead`, in m as `aheads`.

    Loads change linearly from front to rear, as with two axles.
    """
    middle = fmean(aheads)
    spread = sum((ahead - middle) ** 2 for ahead in aheads)
    lean = (mass_ahead - middle) / spread if spread else 0.0
    loads = [max(0.0, 1 / len(aheads) + lean * (ahead - middle)) for ahead in aheads]
    wide = widths or [0.0] * len(aheads)
    return [Footing(ahead - middle, *rest) for ahead, *rest in zip(aheads, loads, wide, strict=True)]


def slip_factor(wheels: Sequence[Footing], separation: float) -> float:
    """Return the ratio of effective to geometric separation: the rim speed that a turn rate needs.

    A turning robot drags its front and rear wheels sideways. Isotropic Coulomb friction then also lets rims slip
    lengthwise, until forces and moments balance. For four wheels with equal load this happens at 1 + (wheelbase /
    separation)^2, for every coefficient and speed.
    """
    half = separation / 2
    furthest = max(abs(wheel.ahead) for wheel in wheels)
    widest = max(wheel.width for wheel in wheels) / 2

    def moment(slip: float) -> float:
        shift = _root(lambda shift: sum(_sideways(wheel, slip, shift) for wheel in wheels), -furthest, furthest)
        return sum(_moment(wheel, half, slip, shift) for wheel in wheels)

    return 1 + _root(moment, 0.0, widest + 2 * (furthest**2 + widest**2) / half) / half


def _sideways(wheel: Footing, slip: float, shift: float) -> float:
    across = wheel.ahead + shift
    return wheel.load * fmean(_over(across, math.hypot(slip - out, across)) for out in wheel.points)


def _moment(wheel: Footing, half: float, slip: float, shift: float) -> float:
    """Return the moment of its friction about the centre; `slip`: lengthwise rim slip at its middle in m/s."""
    across = wheel.ahead + shift
    arms = ((half + out) * (slip - out) - wheel.ahead * across for out in wheel.points)
    slips = (math.hypot(slip - out, across) for out in wheel.points)
    return wheel.load * fmean(map(_over, arms, slips))


def _over(part: float, whole: float) -> float:
    return part / whole if whole else 0.0


def _root(rising: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of an increasing function."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < 0 else (low, middle)
    return high
