"""URDFs drawn at random, in plain spelling: each is valid, and uses what the specification leaves open or optional."""

from __future__ import annotations

import math
import random
from typing import Final
from xml.etree.ElementTree import Element

Chance = random.Random
_TYPES: Final = ("revolute", "revolute", "continuous", "prismatic", "fixed", "fixed", "revolute", "floating", "planar")
_WEIGHTS: Final = (6, 6, 4, 4, 3, 3, 6, 0.3, 0.3)
_AXES: Final = ("1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 -1 0", "0 0 2", "1 1 1", "0.6 0 0.8", "0.001 0 0", "3 4 0")


def drawn_robot(chance: Chance) -> tuple[str, dict[str, float]]:
    """Return the text of a robot, and a position in rad (m) for each joint with one motion."""
    count = chance.choice((1, 2, 3, 4, 5, 6, 8))
    is_mounted = chance.random() < 0.15
    names = ["world" if is_mounted and index == 0 else f"link{index}" for index in range(count)]
    links = [_link(chance, name, is_root=index == 0) for index, name in enumerate(names)]
    joints, positions = [], dict[str, float]()
    for index in range(1, count):
        parent = names[chance.randrange(index)] if chance.random() < 0.4 else names[index - 1]
        joints.append(_joint(chance, f"joint{index}", parent, names[index], positions))
    parts = [*links, *joints]
    if chance.random() < 0.3:
        chance.shuffle(parts)
    return "\n".join(('<robot name="drawn">', *parts, "</robot>", "")), positions


def drawn_positions(robot: Element, chance: Chance) -> dict[str, float]:
    """Return a position in rad (m) within its limits for each joint of a robot with one motion."""
    joints = {joint.get("name", ""): joint for joint in robot.findall("joint")}
    single = [name for name, joint in joints.items() if joint.get("type") in {"revolute", "continuous", "prismatic"}]
    free = {name: chance.uniform(*_range(joints[name])) for name in single}
    return {name: _followed(name, joints, free) for name in single}


def _range(joint: Element) -> tuple[float, float]:
    limit = joint.find("limit")
    if joint.get("type") == "continuous" or limit is None:
        return -1.0, 1.0
    return max(-3.0, float(limit.get("lower", "0"))), min(3.0, float(limit.get("upper", "0")))


def _followed(name: str, joints: dict[str, Element], free: dict[str, float], depth: int = 0) -> float:
    mimic = joints[name].find("mimic")
    leader = None if mimic is None else mimic.get("joint")
    if mimic is None or leader not in free or depth > len(joints):
        return free[name]
    position = _followed(leader, joints, free, depth + 1)
    return float(mimic.get("multiplier", "1")) * position + float(mimic.get("offset", "0"))


def _link(chance: Chance, name: str, *, is_root: bool) -> str:
    if name == "world":
        return f'<link name="{name}"/>'
    parts = [_inertial(chance)] if chance.random() < (0.97 if is_root else 0.92) else []
    parts += [_collision(chance) for _ in range(chance.choice((0, 1, 1, 2)))]
    return f'<link name="{name}">{"".join(parts)}</link>'


def _inertial(chance: Chance) -> str:
    mass = (
        chance.choice((1.0, 0.5, 2.25, 10.0, 0.01, 40.0, 0.25, 3.0, 7.0, 0.0))
        if chance.random() < 0.5
        else chance.uniform(0.1, 5)
    )
    x, y, z = (chance.uniform(0.05, 0.5) for _ in range(3))
    moments = {"ixx": mass * (y * y + z * z), "iyy": mass * (x * x + z * z), "izz": mass * (x * x + y * y)}
    off = chance.choice((0.0, 0.0, 0.05)) * min(moments.values())
    moments |= {"ixy": off, "ixz": -off, "iyz": off / 2}
    tensor = " ".join(f'{name}="{value!r}"' for name, value in moments.items())
    return f'<inertial>{_origin(chance)}<mass value="{mass!r}"/><inertia {tensor}/></inertial>'


def _collision(chance: Chance) -> str:
    a, b, c = (chance.choice((0.05, 0.1, 0.25, 0.5)) for _ in range(3))
    shapes = (f'<box size="{a} {b} {c}"/>', f'<sphere radius="{a}"/>', f'<cylinder radius="{a}" length="{b}"/>')
    return f"<collision>{_origin(chance)}<geometry>{chance.choice(shapes)}</geometry></collision>"


def _origin(chance: Chance) -> str:
    if chance.random() < 0.3:
        return ""
    xyz, rpy = (f'{name}="{_triple(chance, reach)}"' for name, reach in (("xyz", 1.0), ("rpy", math.pi)))
    return f"<origin {' '.join(chance.choice(([xyz, rpy], [xyz, rpy], [rpy], [xyz])))}/>"


def _triple(chance: Chance, reach: float) -> str:
    return " ".join(repr(chance.choice((0.0, reach / 2, chance.uniform(-reach, reach)))) for _ in range(3))


def _joint(chance: Chance, name: str, parent: str, child: str, positions: dict[str, float]) -> str:
    (kind,) = chance.choices(_TYPES, _WEIGHTS)
    parts = [f'<parent link="{parent}"/>', f'<child link="{child}"/>', _origin(chance)]
    lower, upper = -chance.uniform(0, 3), chance.uniform(0, 3)
    if chance.random() < 0.8:
        parts.append(f'<axis xyz="{chance.choice(_AXES)}"/>')
    if kind in {"revolute", "prismatic"} or (kind == "continuous" and chance.random() < 0.5):
        parts.append(_limit(chance, lower, upper))
    if chance.random() < 0.3:
        parts.append('<dynamics damping="0.1" friction="0.2"/>')
    if chance.random() < 0.1 and kind in {"revolute", "prismatic"}:
        parts.append(
            f'<safety_controller soft_lower_limit="{lower / 2!r}" soft_upper_limit="{upper / 2!r}" '
            'k_position="10" k_velocity="1"/>'
        )
    if chance.random() < 0.1 and kind != "fixed":
        parts.append('<calibration rising="0.1"/>')
    if kind in {"revolute", "continuous", "prismatic"}:
        positions[name] = chance.uniform(lower / 2, upper / 2)
        if len(positions) > 1 and chance.random() < 0.15:
            parts.append(_mimic(chance, name, positions))
    return f'<joint name="{name}" type="{kind}">{"".join(parts)}</joint>'


def _limit(chance: Chance, lower: float, upper: float) -> str:
    case = chance.random()
    values = {"lower": lower, "upper": upper, "effort": chance.choice((10.0, 0.5, 100.0)), "velocity": 3.0}
    if case < 0.08:
        values.pop("lower")
    elif case < 0.12:
        values |= {"lower": 0.0, "upper": 0.0}
    elif case < 0.16:
        values["effort"] = 0.0
    elif case < 0.2:
        values["velocity"] = 0.0
    return f"<limit {' '.join(f'{name}={chr(34)}{value!r}{chr(34)}' for name, value in values.items())}/>"


def _mimic(chance: Chance, name: str, positions: dict[str, float]) -> str:
    leader = chance.choice([other for other in positions if other != name])
    multiplier, offset = chance.choice((1.0, -1.0, 0.5, 2.0)), chance.choice((0.0, 0.0, 0.1))
    positions[name] = multiplier * positions[leader] + offset
    stated = [f'joint="{leader}"']
    stated += [f'multiplier="{multiplier!r}"'] if multiplier != 1 or chance.random() < 0.5 else []
    stated += [f'offset="{offset!r}"'] if offset or chance.random() < 0.5 else []
    return f"<mimic {' '.join(stated)}/>"
