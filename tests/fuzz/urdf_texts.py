"""URDFs made up by chance: trees of links that are right, and written as people, editors and exporters write."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Final
from xml.sax.saxutils import quoteattr

Chance = random.Random

ODD_NAMES: Final = (
    "a b", "gelenk_ä", "关节", "🤖", "..", "%s%n", "<", "&", "'", '"', " pad ", "x\ty", "a/b", "\u202eevil", "1", "-",
    "n" * 300, "ä" * 700, "w" * 3000, "base", "world", "None", "true", "${x}", "::error::", "e\u0301",
)  # fmt: skip
MESH: Final = "part.obj"
MESH_TEXT: Final = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
"""What the models expect to lie beside them."""

_KINDS: Final = ("revolute", "revolute", "continuous", "continuous", "prismatic", "fixed", "fixed", "floating")
_AXES: Final = (
    "1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 0 2", "1 1 1", "0.6 0 0.8", "0\t0\t1", "1e-3 0 0", "1e5 0 0", "3 4 0",
    "1e-9 0 0", "1e-200 0 0", "1e15 1e15 0",
)  # fmt: skip


def robot_text(chance: Chance) -> str:
    """A model that is right, in odd spelling."""
    names = _names(chance, chance.choice((1, 1, 2, 3, 4, 6, 12)))
    links = [_link(chance, name, heavy=index == 0) for index, name in enumerate(names)]
    joints = [
        _joint(chance, f"j{index}", _parent(chance, names, index), names[index]) for index in range(1, len(names))
    ]
    parts = [*links, *joints, *(_extra(chance, names) for _ in range(chance.choice((0, 0, 1, 3))))]
    if chance.random() < 0.5:
        chance.shuffle(parts)
    name = chance.choice(("robot", "robot", "", *ODD_NAMES))
    root = f"<robot name={quoteattr(name)}>" if chance.random() < 0.9 else "<robot>"
    return "\n".join([root, *parts, "</robot>"])


def _names(chance: Chance, count: int) -> list[str]:
    names = [f"l{index}" for index in range(count)]
    if chance.random() < 0.05:
        names[0] = "world"
    if chance.random() < 0.25:
        names[chance.randrange(count)] = chance.choice(ODD_NAMES)
    return names


def _parent(chance: Chance, names: list[str], index: int) -> str:
    return names[chance.randrange(index)] if chance.random() < 0.5 else names[index - 1]


def _link(chance: Chance, name: str, *, heavy: bool) -> str:
    parts = [_collision(chance) for _ in range(chance.choice((0, 1, 1, 2)))]
    parts += [_visual(chance)] if chance.random() < 0.3 else []
    parts += [_inertial(chance)] if heavy or chance.random() < 0.8 else []
    parts += [_contact(chance)] if chance.random() < 0.1 else []
    chance.shuffle(parts)
    return f"<link name={quoteattr(name)}>{_nl(chance)}{_nl(chance).join(parts)}</link>"


def _inertial(chance: Chance) -> str:
    mass = chance.choice((1.0, 0.5, 2.25, 10.0, 0.01, 1e-3, 100.0))
    x, y, z = (chance.uniform(0.05, 0.5) for _ in range(3))
    z = 0.0 if chance.random() < 0.2 else z  # a plate
    moments = {"ixx": mass * (y * y + z * z), "iyy": mass * (x * x + z * z), "izz": mass * (x * x + y * y)}
    off = chance.choice((0.0, 0.0, 0.05 * min(moments.values())))
    moments |= {"ixy": off, "ixz": -off, "iyz": off / 2} if z else {"ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
    written = " ".join(f'{name}="{spelled(chance, value)}"' for name, value in _shuffled(chance, moments))
    parts = [f'<mass value="{spelled(chance, mass)}"/>', f"<inertia {written}/>", *_origin(chance)]
    chance.shuffle(parts)
    return f"<inertial>{''.join(parts)}</inertial>"


def _shuffled(chance: Chance, moments: dict[str, float]) -> list[tuple[str, float]]:
    return chance.sample(list(moments.items()), len(moments))


def _collision(chance: Chance) -> str:
    parts = [f"<geometry>{_shape(chance)}</geometry>", *_origin(chance)]
    chance.shuffle(parts)
    attributes = chance.choice(("", "", ' name="c"', ' concave="yes"', ' group="1" mask="2"'))
    return f"<collision{attributes}>{''.join(parts)}</collision>"


def _visual(chance: Chance) -> str:
    colour = '<material name="m"><color rgba="1 0 0 1"/></material>'
    return f"<visual>{''.join(_origin(chance))}<geometry>{_shape(chance)}</geometry>{colour}</visual>"


def _shape(chance: Chance) -> str:
    a, b, c = (spelled(chance, chance.choice((0.05, 0.1, 0.25, 0.5, 1.0))) for _ in range(3))
    return chance.choice(
        (
            f'<box size="{a} {b} {c}"/>',
            f'<sphere radius="{a}"/>',
            f'<cylinder radius="{a}" length="{b}"/>',
            f'<capsule length="{a}" radius="{b}"/>',
            f'<mesh filename="{MESH}" scale="{a} {b} {c}"/>',
        )
    )


def _contact(chance: Chance) -> str:
    tags = {"lateral_friction": 0.9, "rolling_friction": 0.01, "spinning_friction": 0.01, "contact_cfm": 0.0}
    tags |= {"contact_erp": 1.0, "stiffness": 1e4, "damping": 10.0, "restitution": 0.0, "inertia_scaling": 3.0}
    tag = chance.choice(list(tags))
    return f'<contact><{tag} value="{spelled(chance, tags[tag])}"/></contact>'


def _origin(chance: Chance) -> list[str]:
    if chance.random() < 0.4:
        return []
    xyz, rpy = _triple(chance, 1.0), _triple(chance, math.pi)
    place, turn = f'xyz="{xyz}"', f'rpy="{rpy}"'
    return [f"<origin {' '.join(chance.choice(([place, turn], [turn], [place], [])))}/>"]


def _triple(chance: Chance, reach: float) -> str:
    values = [chance.choice((0.0, 0.0, reach / 2, chance.uniform(-reach, reach))) for _ in range(3)]
    space = chance.choice((" ", " ", "  ", "\t", "\n", "&#9;", "&#10;", "   \t "))
    return space.join(spelled(chance, value) for value in values)


def spelled(chance: Chance, value: float) -> str:
    """A number in one of the ways that people and exporters write it."""
    if chance.random() < 0.7:
        return repr(value)
    ways: tuple[Callable[[], str], ...] = (
        lambda: f"{value:e}",
        lambda: f"{value:+.17g}",
        lambda: f"{value:G}",
        lambda: f"{value:.60f}",
        lambda: f" {value!r} ",
        lambda: f"{value!r}".removeprefix("0") or "0",
        lambda: f"{value!r}".removesuffix("0"),
        lambda: f"{value:.3E}",
        lambda: "-0" if value == 0 else f"{value!r}e0" if "e" not in repr(value) else repr(value),
        lambda: "1e-320" if value == 0 else f"00{value!r}" if value > 0 else repr(value),
        lambda: f"\t{value!r}",
    )
    return chance.choice(ways)()


def _joint(chance: Chance, name: str, parent: str, child: str) -> str:
    kind = chance.choice(_KINDS)
    kind = "planar" if kind == "floating" and chance.random() < 0.5 else kind
    name = chance.choice(ODD_NAMES) + name if chance.random() < 0.1 else name
    parts = [f"<parent link={quoteattr(parent)}/>", f"<child link={quoteattr(child)}/>", *_origin(chance)]
    parts += [_axis(chance)] if chance.random() < 0.8 else []
    parts += [_limit(chance)] if kind in {"revolute", "prismatic"} or chance.random() < 0.2 else []
    dynamics = chance.choice((('damping="0.1"', 'friction="0.1"'), ('damping="0.2"',), ('friction="0.3"',), ()))
    parts += [f"<dynamics {' '.join(dynamics)}/>"] if chance.random() < 0.4 else []
    parts += [f'<mimic joint="j1" multiplier="{spelled(chance, 0.5)}"/>'] if chance.random() < 0.1 else []
    chance.shuffle(parts)
    return f"<joint name={quoteattr(name)} type={quoteattr(kind)}>{_nl(chance).join(parts)}</joint>"


def _axis(chance: Chance) -> str:
    return f'<axis xyz="{chance.choice(_AXES)}"/>' if chance.random() < 0.95 else "<axis/>"


def _limit(chance: Chance) -> str:
    values = {"lower": chance.uniform(-3, 0.5), "upper": chance.uniform(0.6, 3), "effort": 10.0, "velocity": 3.0}
    values = {name: value for name, value in values.items() if chance.random() < 0.9}
    return (
        f"<limit {' '.join(f'{name}={chr(34)}{spelled(chance, value)}{chr(34)}' for name, value in values.items())}/>"
    )


def _extra(chance: Chance, names: list[str]) -> str:
    reference, friction = quoteattr(chance.choice(names)), spelled(chance, 0.2)
    return chance.choice(
        (
            f"<gazebo reference={reference}><mu1>{friction}</mu1><kp>1e6</kp><material>x</material></gazebo>",
            '<gazebo><plugin name="p" filename="libgazebo_ros_diff_drive.so"><left>j1</left></plugin></gazebo>',
            '<material name="red"><color rgba="1 0 0 1"/></material>',
            '<transmission name="t"><joint name="j1"/></transmission>',
            "<!-- a comment -->",
            "<?pi?>",
        )
    )


def _nl(chance: Chance) -> str:
    return chance.choice(("\n", "\n", "", "\t", " " * 40))
