"""The robots and bodies of the zoo as URDF texts: homogeneous shapes, so that every mass and inertia is a formula."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final

from sim_action.core.geometry import Vector3

ORIGIN: Final = (0.0, 0.0, 0.0)
# About x by a quarter turn: the axis of a cylinder becomes the y axis of its link.
_SIDEWAYS: Final = (math.pi / 2, 0.0, 0.0)

CASTER_SIDE_KG: Final = 6.0
"""The mass of the caster robot whose wheels have a radius of 7.5 cm; others are scaled at constant density."""
WHEEL_LOAD: Final = 0.7
"""The share of a caster robot's weight on its two wheels. The rest is on the caster, 5/6 of the separation behind."""


def triple(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def diagonal(inertia: Vector3) -> str:
    xx, yy, zz = inertia
    return f'<inertia ixx="{xx:.9g}" iyy="{yy:.9g}" izz="{zz:.9g}" ixy="0" ixz="0" iyz="0"/>'


def inertial(mass: float, inertia: Vector3, at: Vector3 = ORIGIN) -> str:
    return f'<inertial><origin xyz="{triple(at)}"/><mass value="{mass:.9g}"/>{diagonal(inertia)}</inertial>'


def collision(shape: str, at: Vector3 = ORIGIN, rpy: Vector3 = ORIGIN) -> str:
    return f'<collision><origin xyz="{triple(at)}" rpy="{triple(rpy)}"/><geometry>{shape}</geometry></collision>'


def box_shape(size: Vector3) -> str:
    return f'<box size="{triple(size)}"/>'


def sphere_shape(radius: float) -> str:
    return f'<sphere radius="{radius:.9g}"/>'


def cylinder_shape(radius: float, length: float) -> str:
    return f'<cylinder radius="{radius:.9g}" length="{length:.9g}"/>'


def box_inertia(mass: float, size: Vector3) -> Vector3:
    x, y, z = (side**2 * mass / 12 for side in size)
    return y + z, x + z, x + y


def ball_inertia(mass: float, radius: float, shape: float = 0.4) -> Vector3:
    """`shape`: 2/5 for a solid sphere, 2/3 for a shell."""
    moment = shape * mass * radius**2
    return moment, moment, moment


def wheel_inertia(mass: float, radius: float, width: float) -> Vector3:
    """About the axis y."""
    across = mass * (3 * radius**2 + width**2) / 12
    return across, mass * radius**2 / 2, across


def link(name: str, inside: str, friction: float | None = None) -> str:
    rubs = "" if friction is None else f'<contact><lateral_friction value="{friction:.9g}"/></contact>'
    return f'<link name="{name}">{inside}{rubs}</link>\n'


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    at: Vector3 = ORIGIN,
    *,
    axis: Vector3 = (0.0, 1.0, 0.0),
    limit: str = "",
    mimic: str = "",
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{triple(at)}"/><axis xyz="{triple(axis)}"/>'
    others = "".join(f"<{tag} {stated}/>" for tag, stated in (("limit", limit), ("mimic", mimic)) if stated)
    return f'<joint name="{name}" type="{kind}">{ends}{others}</joint>\n'


def robot(*parts: str) -> str:
    return f'<?xml version="1.0"?>\n<robot name="zoo">\n{"".join(parts)}</robot>\n'


def wheel(
    name: str,
    at: Vector3,
    *,
    radius: float,
    width: float,
    mass: float,
    effort: float,
    friction: float = 1.0,
    parent: str = "base_link",
) -> str:
    """A wheel and its joint `{name}_joint`."""
    shape = collision(cylinder_shape(radius, width), rpy=_SIDEWAYS)
    body = inertial(mass, wheel_inertia(mass, radius, width)) + shape
    limit = f'effort="{effort:.9g}" velocity="100"'
    return link(name, body, friction) + joint(f"{name}_joint", "continuous", parent, name, at, limit=limit)


def caster_robot(mass: float, friction: float, *, wheels_width: float = 0.03) -> str:
    """Two driven wheels and a fixed sphere behind them that slides. The base link is on the ground, between the wheels.

    With a mass of `CASTER_SIDE_KG`, lengths are: wheels 7.5 cm, separation 30 cm, caster 25 cm behind.
    """
    scale = (mass / CASTER_SIDE_KG) ** (1 / 3)
    radius, half_separation, behind = 0.075 * scale, 0.15 * scale, 0.25 * scale
    ball, width, size = 0.025 * scale, wheels_width * scale, (0.34 * scale, 0.24 * scale, 0.10 * scale)
    wheel_mass, ball_mass = mass * 0.06, mass * 0.02
    chassis = mass - 2 * wheel_mass - ball_mass
    # The centre of mass of the whole puts WHEEL_LOAD of the weight on the wheels.
    centre = -((1 - WHEEL_LOAD) * behind * mass - ball_mass * behind) / chassis
    at = (centre, 0.0, 0.10 * scale)
    base = inertial(chassis, box_inertia(chassis, size), at) + collision(box_shape(size), at)
    effort = 3 * mass * radius * 9.81
    figures: dict[str, Any] = {"radius": radius, "width": width, "mass": wheel_mass, "effort": effort}
    foot = inertial(ball_mass, ball_inertia(ball_mass, ball)) + collision(sphere_shape(ball))
    return robot(
        link("base_link", base),
        wheel("left_wheel", (0.0, half_separation, radius), **figures),
        wheel("right_wheel", (0.0, -half_separation, radius), **figures),
        link("caster", foot, friction),
        joint("caster_mount", "fixed", "base_link", "caster", (-behind, 0.0, ball)),
    )


def delivery_robot() -> str:
    """5.9 kg, wheels of 15 cm ahead, a fixed sphere of 5 cm behind with the default friction of 0.5."""
    size, at = (0.36, 0.28, 0.1), (0.0, 0.0, 0.1)
    figures: dict[str, Any] = {"radius": 0.075, "width": 0.03, "mass": 0.4, "effort": 5.0}
    foot = inertial(0.1, ball_inertia(0.1, 0.025)) + collision(sphere_shape(0.025))
    return robot(
        link("base_link", inertial(5.0, box_inertia(5.0, size), at) + collision(box_shape(size), at)),
        wheel("left_wheel", (0.1, 0.17, 0.075), friction=0.5, **figures),
        wheel("right_wheel", (0.1, -0.17, 0.075), friction=0.5, **figures),
        link("caster", foot, 0.5),
        joint("caster_mount", "fixed", "base_link", "caster", (-0.15, 0.0, 0.025)),
    )


def rover(
    wheelbase: float,
    separation: float,
    mass: float = 8.0,
    *,
    width: float = 0.04,
    forward: float = 0.0,
    ends: Mapping[str, float] = MappingProxyType({"front": 1, "rear": -1}),
) -> str:
    """Wheels of 10 cm that cannot be steered; the centre of mass is `forward` m ahead of their middle.

    `ends`: axle -> its place, as a share of half the wheelbase.
    """
    size = (wheelbase + 0.1, separation - 0.05, 0.12)
    at = (forward, 0.0, 0.16)
    base = inertial(mass, box_inertia(mass, size), at) + collision(box_shape(size), at)
    figures: dict[str, Any] = {"radius": 0.1, "width": width, "mass": 0.5, "effort": 20.0}
    corners = [
        wheel(f"{end}_{side}_wheel", (ahead * wheelbase / 2, left * separation / 2, 0.1), **figures)
        for end, ahead in ends.items()
        for side, left in (("left", 1), ("right", -1))
    ]
    return robot(link("base_link", base), *corners)


SIX_WHEELS: Final = MappingProxyType({"front": 1, "middle": 0, "rear": -1})
ROVER_SIDES: Final = {side: [f"{end}_{side}_wheel_joint" for end in ("front", "rear")] for side in ("left", "right")}


def box(size: Vector3, mass: float = 1.0, friction: float = 1.0) -> str:
    """A loose box; its link frame is at its centre."""
    return robot(link("base", inertial(mass, box_inertia(mass, size)) + collision(box_shape(size)), friction))


def ball(radius: float, mass: float = 1.0, friction: float = 1.0, shape: float = 0.4) -> str:
    """A loose ball; `shape` as in `ball_inertia`."""
    inside = inertial(mass, ball_inertia(mass, radius, shape)) + collision(sphere_shape(radius))
    return robot(link("base", inside, friction))


def table(half_length: float, half_width: float, mass: float, friction: float) -> str:
    """A flat plate on four small spheres at its corners: four point contacts that carry the same load."""
    size, radius = (2 * half_length, 2 * half_width, 0.01), 0.01
    feet = "".join(
        collision(sphere_shape(radius), (x * half_length, y * half_width, 0.0)) for x in (1, -1) for y in (1, -1)
    )
    return robot(link("base", inertial(mass, box_inertia(mass, size)) + feet, friction))


def car(wheelbase: float, separation: float, mass: float = 5.0) -> str:
    """Two steered wheels ahead and two driven ones behind. The base link is on the ground, below the rear axle."""
    size, at = (wheelbase + 0.1, separation - 0.08, 0.06), (wheelbase / 2, 0.0, 0.1)
    figures: dict[str, Any] = {"radius": 0.05, "width": _CAR_TYRE_M, "mass": 0.2, "effort": 5.0}
    parts = [link("base_link", inertial(mass, box_inertia(mass, size), at) + collision(box_shape(size), at))]
    for side, left in (("left", 1), ("right", -1)):
        y = left * separation / 2
        parts.append(wheel(f"rear_{side}_wheel", (0.0, y, 0.05), **figures))
        knuckle = f"{side}_knuckle"
        parts.append(link(knuckle, inertial(0.1, (1e-4, 1e-4, 1e-4))))
        limit = 'lower="-1" upper="1" effort="20" velocity="5"'
        turns: dict[str, Any] = {"axis": (0.0, 0.0, 1.0), "limit": limit}
        parts.append(joint(f"{side}_steering_joint", "revolute", "base_link", knuckle, (wheelbase, y, 0.05), **turns))
        parts.append(wheel(f"front_{side}_wheel", ORIGIN, parent=knuckle, **figures))
    return robot(*parts)


def pendulum(arms: int = 1) -> str:
    """Rods of 1 kg and 1 m that hang at hinges without friction, one below the other; their base has to be fixed."""
    parts = [link("base", inertial(1.0, (1.0, 1.0, 1.0)))]
    for number in range(1, arms + 1):
        parts.append(link(f"arm{number}", inertial(1.0, ROD_INERTIA, (0.0, 0.0, -0.5))))
        parent, z = ("base", 0.0) if number == 1 else (f"arm{number - 1}", -1.0)
        parts.append(joint(f"j{number}", "continuous", parent, f"arm{number}", (0.0, 0.0, z)))
    return robot(*parts)


ROD_INERTIA: Final = (1 / 12, 1 / 12, 1e-4)  # of a thin rod of 1 kg and 1 m along z, about its centre of mass
_CAR_TYRE_M: Final = 0.004


def arm(*, effort: float = 100.0, payload: float = 1.0) -> str:
    """A shoulder and an elbow with rods of 0.5 m and 1 kg along x, and a payload at the end, with motors that hold."""
    limit = f'lower="-3" upper="3" effort="{effort:g}" velocity="5"'
    rod = inertial(1.0, (1e-4, 1 / 48, 1 / 48), (0.25, 0.0, 0.0))
    load = inertial(payload, ball_inertia(payload, 0.05))
    return robot(
        link("base", inertial(1.0, (1.0, 1.0, 1.0))),
        link("upper", rod),
        joint("shoulder", "revolute", "base", "upper", limit=limit),
        link("lower", rod),
        joint("elbow", "revolute", "upper", "lower", (0.5, 0.0, 0.0), limit=limit),
        link("payload", load),
        joint("grip", "fixed", "lower", "payload", (0.5, 0.0, 0.0)),
    )


def followers(loads: tuple[tuple[float, float], ...], *, in_series: bool = False) -> str:
    """A light leader, and for each (multiplier, kg) a follower that carries a load at 0.5 m; with motors that hold."""
    limit = 'lower="-3" upper="3" effort="10000" velocity="10"'
    parts = [link("base", inertial(1.0, (1.0, 1.0, 1.0))), link("lead", inertial(1.0, (0.01, 0.01, 0.01)))]
    parts.append(joint("leader", "revolute", "base", "lead", limit=limit))
    for number, (multiplier, mass) in enumerate(loads, start=1):
        name, mimic = f"load{number}", f'joint="leader" multiplier="{multiplier:g}"'
        parts.append(link(name, inertial(mass, (0.01, 0.01, 0.01), (0.5, 0.0, 0.0))))
        parent, at = ("lead", (0.2, 0.0, 0.0)) if in_series else ("base", (0.0, 1.0, 0.0))
        parts.append(joint(f"follower{number}", "revolute", parent, name, at, limit=limit, mimic=mimic))
    return robot(*parts)


def lift(payload: float) -> str:
    """A vertical slide that carries a payload."""
    limit = 'lower="-1" upper="1" effort="1000" velocity="2"'
    return robot(
        link("base", inertial(1.0, (1.0, 1.0, 1.0))),
        link("carriage", inertial(payload, ball_inertia(payload, 0.1))),
        joint("slide", "prismatic", "base", "carriage", axis=(0.0, 0.0, 1.0), limit=limit),
    )


LEG_M: Final = 0.2  # the length of both links of a leg of `quadruped`
FEET: Final = tuple(f"{end}_{side}_foot" for end in ("front", "rear") for side in ("left", "right"))


def quadruped(mass: float = 10.0) -> str:
    """A trunk on four legs with a hip and a knee each. In `STANCE` the feet are below the hips."""
    size, foot = (0.5, 0.25, 0.1), 0.02
    parts = [link("trunk", inertial(mass, box_inertia(mass, size)) + collision(box_shape(size)))]
    limit = 'lower="-2.5" upper="2.5" effort="60" velocity="20"'
    rod = inertial(0.3, (1e-3, 1e-3, 5e-5), (0.0, 0.0, -LEG_M / 2))
    for name in FEET:
        leg = name.removesuffix("_foot")
        at = (0.2 if leg.startswith("front") else -0.2, 0.15 if leg.endswith("left") else -0.15, 0.0)
        parts += [
            link(f"{leg}_thigh", rod),
            joint(f"{leg}_hip", "revolute", "trunk", f"{leg}_thigh", at, limit=limit),
            link(f"{leg}_shank", rod),
            joint(f"{leg}_knee", "revolute", f"{leg}_thigh", f"{leg}_shank", (0.0, 0.0, -LEG_M), limit=limit),
            link(name, inertial(0.05, ball_inertia(0.05, foot)) + collision(sphere_shape(foot)), 0.8),
            joint(f"{name}_mount", "fixed", f"{leg}_shank", name, (0.0, 0.0, -LEG_M)),
        ]
    return robot(*parts)


STANCE: Final = {
    f"{foot.removesuffix('_foot')}_{name}": angle
    for foot in FEET
    for name, angle in (("hip", math.pi / 4), ("knee", -math.pi / 2))
}
