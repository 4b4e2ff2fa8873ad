"""The classes of differences between readers of URDF: what differs, and who is right by the specification.

`CLASSES` is the only list. The page docs/engines/surprises.md names it, and `python -m tests.readers` counts by it; a
difference without a class is for somebody to look at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final
from xml.etree.ElementTree import Element

import numpy as np

from tests.readers.differences import Difference

_Check = Callable[[Difference], bool]
ALL: Final = ("mujoco", "pybullet", "drake", "pinocchio", "urchin")


@dataclass(frozen=True)
class Class:
    """Differences with one cause."""

    # "READER... or all: QUANTITY...: WHOSE". readers: those that differ from us. quantities: `Difference.quantity`.
    # theirs: we follow the specification and they do not. specification: it leaves this open, or we deviate from its
    # letter and say so.
    scope: str
    text: str  # what the readers do, and what sim-action does
    clause: str  # what the specification (wiki.ros.org/urdf/XML) says
    applies: _Check  # the rest of the condition

    def covers(self, difference: Difference) -> bool:
        """Return True if this is the cause of the difference."""
        readers, quantities, _ = (words.split() for words in self.scope.split(": "))
        is_named = (readers == ["all"] or difference.reader in readers) and difference.quantity in quantities
        return is_named and self.applies(difference)


def class_of(difference: Difference) -> Class | None:
    """Return the first class of `CLASSES` that covers a difference; None: it is not classified."""
    return next((row for row in CLASSES if row.covers(difference)), None)


def _limit(difference: Difference) -> Element | None:
    return None if difference.element is None else difference.element.find("limit")


def _states(difference: Difference, key: str) -> bool:
    limit = _limit(difference)
    return limit is not None and limit.get(key) is not None


def _is(*types: str) -> _Check:
    return lambda difference: difference.element is not None and difference.element.get("type") in types


def _mass(link: Element | None) -> float | None:
    mass = None if link is None else link.find("inertial/mass")
    return None if mass is None else float(mass.get("value", "0"))


def _is_welded(joint: Element) -> bool:
    return joint.get("type") == "fixed"


def _welded_to(difference: Difference) -> list[Element]:
    """The links that are one body with the link of the difference, itself among them."""
    joints = difference.root.findall("joint")
    names = {difference.name}
    while True:
        more = {
            _end(joint, "child") for joint in joints if _is_welded(joint) and _end(joint, "parent") in names
        } - names
        if not more:
            return [link for link in difference.root.findall("link") if link.get("name") in names]
        names |= more


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


def _lacks_inertial(difference: Difference) -> bool:
    """A link without <inertial>, or a body in which there is one, for readers that weld."""
    links = _welded_to(difference) if difference.reader == "pinocchio" else [difference.element]
    return any(link is not None and link.find("inertial") is None for link in links)


def _is_massless(difference: Difference) -> bool:
    links = _welded_to(difference) if difference.reader == "pinocchio" else [difference.element]
    return any(not _mass(link) for link in links if link is not None and link.find("inertial") is not None)


def _states_tensor(difference: Difference, kind: Callable[[list[float]], bool]) -> bool:
    """A link whose principal moments of inertia are of a kind, or a body in which there is one."""
    links = _welded_to(difference) if difference.reader == "pinocchio" else [difference.element]
    tensors = [link.find("inertial/inertia") for link in links if link is not None]
    return any(kind(_moments(tensor)) for tensor in tensors if tensor is not None)


def _moments(tensor: Element) -> list[float]:
    xx, xy, xz, yy, yz, zz = (float(tensor.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return [float(moment) for moment in np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])]


def _is_impossible(moments: list[float]) -> bool:
    least, middle, most = moments
    # Bullet compares without a tolerance: rounding alone can make a plate impossible.
    return least < 0 or most > (least + middle) * (1 - 1e-6)


def _has_zero(moments: list[float]) -> bool:
    return moments[0] <= 0


def _is_reversed(joint: Element | None) -> bool:
    limit = None if joint is None else joint.find("limit")
    return limit is not None and float(limit.get("lower", "0")) > float(limit.get("upper", "0"))


def _has_negative(joint: Element | None) -> bool:
    limit = None if joint is None else joint.find("limit")
    return limit is not None and any(float(limit.get(name, "0")) < 0 for name in ("effort", "velocity"))


def _any_joint(kind: Callable[[Element], bool]) -> _Check:
    return lambda difference: any(kind(joint) for joint in difference.root.findall("joint"))


def _says(*words: str) -> _Check:
    return lambda difference: any(word in str(difference.theirs) for word in words)


def _we_say(*rules: str) -> _Check:
    return lambda difference: any(f"[{rule}]" in str(difference.ours) for rule in rules)


def _above(difference: Difference) -> Iterable[Element]:
    """The joints between the link of the difference and the root, from the link on."""
    parents = {_end(joint, "child"): joint for joint in difference.root.findall("joint")}
    name = difference.name
    while name in parents:
        yield parents[name]
        name = _end(parents[name], "parent")


def _below(kind: Callable[[Difference, Element], bool]) -> _Check:
    return lambda difference: any(kind(difference, joint) for joint in _above(difference))


def _is_long_slide(_: Difference, joint: Element) -> bool:
    axis = joint.find("axis")
    length = 1.0 if axis is None else float(np.linalg.norm([float(part) for part in axis.get("xyz", "1 0 0").split()]))
    return joint.get("type") == "prismatic" and not math.isclose(length, 1.0, rel_tol=1e-4)


def _mimics_a_mimic(difference: Difference, joint: Element) -> bool:
    mimic = joint.find("mimic")
    leaders = {other.get("name"): other for other in difference.root.findall("joint")}
    leader = None if mimic is None else leaders.get(mimic.get("joint"))
    return leader is not None and leader.find("mimic") is not None


def _is_locked(difference: Difference) -> bool:
    limit = _limit(difference)
    return limit is not None and all(float(limit.get(name, "0")) == 0 for name in ("lower", "upper"))


def _is_free(joint: Mapping[str, Any] | None) -> bool:
    return joint is not None and joint["type"] == "quaternion_floating"


def _leaves_expressions(difference: Difference) -> bool:
    return any("$" in text for element in difference.root.iter() for text in element.attrib.values())


_MOTOR: Final = ("effort", "velocity")
_MAX_BULLET_JOINTS: Final = 127
_DEFAULT_LIMIT: Final = '"lower (optional, defaults to 0)", "upper (optional, defaults to 0)"'
_INERTIAL: Final = '"inertial (optional: defaults to a zero mass and zero inertia if not specified)"'
_EFFORT: Final = '"effort (required): An attribute for enforcing the maximum joint effort"'
_VELOCITY: Final = '"velocity (required): An attribute for enforcing the maximum joint velocity"'
_MIMIC: Final = '"mimic: value = multiplier * other_joint_value + offset"'
_CONTINUOUS: Final = '"continuous: rotates around the axis and has no upper and lower limits"'

CLASSES: Final = (
    Class(
        "all: mass centre inertia: specification",
        "A link without `<inertial>`: PyBullet and urchin give a root 1 kg, MuJoCo 1000 kg/m³ times its shapes, the "
        "others nothing. sim-action gives it a negligible mass, with the note `missing-inertia`.",
        _INERTIAL,
        _lacks_inertial,
    ),
    Class(
        "all: mass centre inertia: specification",
        "A mass of 0: sim-action gives a negligible mass if the link moves by itself and `zero-mass` is allowed.",
        "no clause: a mass of 0 is neither forbidden nor given a meaning",
        _is_massless,
    ),
    Class(
        "mujoco: refused: specification",
        "MuJoCo refuses a model with a moving body without mass. sim-action refuses it too (`zero-mass`), or gives it"
        " a negligible mass (`missing-inertia`).",
        _INERTIAL,
        lambda it: "mass and inertia of moving bodies" in str(it.theirs),
    ),
    Class(
        "drake urchin: lower upper: theirs",
        "A limit that is not stated is no limit to Drake and urchin. To sim-action it is 0.",
        _DEFAULT_LIMIT,
        lambda it: it.theirs is None and _limit(it) is not None and not _states(it, it.quantity),
    ),
    Class(
        "mujoco: lower upper: theirs",
        "To MuJoCo a joint has no limits if one of them is not stated, or both are 0. To sim-action the missing one "
        "is 0, on MuJoCo too.",
        _DEFAULT_LIMIT,
        lambda it: it.theirs is None and (not (_states(it, "lower") and _states(it, "upper")) or _is_locked(it)),
    ),
    Class(
        "pybullet drake urchin: lower upper: theirs",
        "PyBullet, Drake and urchin keep the limits of a continuous joint. sim-action, MuJoCo and Pinocchio do not.",
        _CONTINUOUS,
        lambda it: it.ours is None and _is("continuous")(it),
    ),
    Class(
        "pybullet pinocchio urchin: effort: specification",
        "An effort of 0 is kept as 0. sim-action and MuJoCo read it as no limit, as exporters write it; sim-action "
        "with the note `zero-limit`.",
        _EFFORT,
        lambda it: it.theirs == 0 and it.ours is None and _states(it, "effort"),
    ),
    Class(
        "drake pybullet pinocchio urchin: velocity: specification",
        "A velocity of 0 is kept as 0. sim-action reads it as no limit, as exporters write it, with the note `zero-"
        "limit`.",
        _VELOCITY,
        lambda it: it.theirs == 0 and it.ours is None and _states(it, "velocity"),
    ),
    Class(
        "pybullet: effort velocity: theirs",
        "PyBullet gives 0 for the effort and the velocity of a continuous joint without `<limit>`. To sim-action it "
        "has no limit.",
        '"limit (required only for revolute and prismatic joint)"',
        lambda it: it.theirs == 0 and it.ours is None and _limit(it) is None,
    ),
    Class(
        "pybullet: frame: theirs",
        "PyBullet moves a prismatic joint by its position times the length of its axis. To sim-action the position is"
        " in m.",
        '"axis: ... The vector should be normalized"',
        _below(_is_long_slide),
    ),
    Class(
        "urchin: frame: theirs",
        "To urchin, a joint that mimics a joint that mimics a third one stays where it is. sim-action follows the "
        "chain.",
        _MIMIC,
        _below(_mimics_a_mimic),
    ),
    Class(
        "drake: frame: theirs",
        "Drake starts the child of a floating joint at the parent's frame. sim-action starts it at the joint's "
        "`<origin>`.",
        '"origin: the transform from the parent link to the child link"',
        _below(lambda _, joint: joint.get("type") == "floating"),
    ),
    Class(
        "pybullet: type: theirs",
        "PyBullet welds a floating joint. To sim-action the child moves freely.",
        '"floating: this joint allows motion for all 6 degrees of freedom"',
        _is("floating"),
    ),
    Class(
        "pybullet: frame: theirs",
        "PyBullet puts the centre of mass of the child of a planar joint at the joint. To sim-action its frame is "
        "there.",
        '"origin: the transform from the parent link to the child link"',
        _below(lambda _, joint: joint.get("type") == "planar"),
    ),
    Class(
        "mujoco: refused: theirs",
        "MuJoCo refuses a floating joint below a link that moves. To sim-action the child moves freely.",
        '"floating: this joint allows motion for all 6 degrees of freedom"',
        lambda it: "free joint can only be used on top level" in str(it.theirs),
    ),
    Class(
        "drake: refused: theirs",
        "Drake refuses a planar joint with one damping: it reads three numbers.",
        '"dynamics: damping (optional, defaults to 0)": one number',
        lambda it: "3 values for attribute damping" in str(it.theirs),
    ),
    Class(
        "all: inertia: specification",
        "An inertia that no body has, if only by rounding: MuJoCo refuses it, PyBullet takes 0, Drake that of a ball,"
        " the others take it as it is. sim-action refuses it (`impossible-inertia`), or repairs it if that is allowed"
        " or it is only rounded or 0.",
        "no clause: the specification does not ask for a possible inertia",
        lambda it: _states_tensor(it, _is_impossible) or _states_tensor(it, _has_zero),
    ),
    Class(
        "mujoco: refused: specification",
        "The same, of MuJoCo: it refuses the model.",
        "no clause: the specification does not ask for a possible inertia",
        _says("inertia must satisfy", "fullinertia"),
    ),
    Class(
        "all: inertia: specification",
        "`<contact><inertia_scaling>`, an element of Bullet alone, multiplies the inertia in PyBullet and in sim-"
        "action.",
        "no clause: not an element of URDF",
        lambda it: it.element is not None and it.element.find("contact/inertia_scaling") is not None,
    ),
    Class(
        "all: effort velocity: specification",
        "An effort or velocity below 0 is kept. sim-action reads it as no limit, with the note `zero-limit`.",
        "no clause: the specification does not say that it is positive",
        lambda it: it.ours is None and _has_negative(it.element),
    ),
    Class(
        "drake pinocchio mujoco: refused: specification",
        "Reversed limits, and an effort or velocity below 0: Drake and Pinocchio refuse some of them. sim-action "
        "refuses reversed limits (`reversed-limits`), and reads the others as no limit.",
        "no clause: the specification does not say that the lower limit is the smaller one",
        _any_joint(lambda joint: _is_reversed(joint) or _has_negative(joint)),
    ),
    Class(
        "all: lower upper: specification",
        "Reversed limits: some readers keep them, to others they limit nothing. sim-action refuses them (`reversed-"
        "limits`); if that is allowed, they limit nothing.",
        "no clause: the specification does not say that the lower limit is the smaller one",
        lambda it: _is_reversed(it.element),
    ),
    Class(
        "all: lower upper: specification",
        "A revolute or prismatic joint without limits: to Pinocchio they are 0. sim-action refuses it "
        "(`missing-limits`); if that is allowed, it has none.",
        '"limit (required only for revolute and prismatic joint)"',
        lambda it: not (_states(it, "lower") or _states(it, "upper") or _is("continuous")(it)),
    ),
    Class(
        "pybullet urchin pinocchio: effort velocity: specification",
        "A `<limit>` without effort or velocity is not valid. To PyBullet it is 0. To sim-action it is no limit.",
        _EFFORT,
        lambda it: it.ours is None and it.theirs == 0 and not _states(it, it.quantity),
    ),
    Class(
        "urchin pinocchio: refused: specification",
        "The same: urchin and Pinocchio refuse the model.",
        _EFFORT,
        _any_joint(lambda joint: (limit := joint.find("limit")) is not None and None in map(limit.get, _MOTOR)),
    ),
    Class(
        "drake pybullet pinocchio: refused: specification",
        "A robot without a name: Drake, PyBullet and Pinocchio refuse it. To sim-action its name is that of the file.",
        '"robot: The root element ... must have a name"',
        lambda it: it.root.get("name") is None,
    ),
    Class(
        "mujoco urchin: refused: specification",
        "An `<axis>` or `<origin>` without `xyz`, and an expression of xacro that nobody evaluated: others refuse it. "
        "sim-action takes the default.",
        '"axis (optional: defaults to (1,0,0))"',
        lambda it: "'xyz'" in str(it.theirs) or _leaves_expressions(it),
    ),
    Class(
        "pybullet drake pinocchio: refused frame: specification",
        "Text of xacro that nobody evaluated, `$(optenv NAME x y z)`: PyBullet reads other numbers, the others refuse"
        " it. sim-action takes the default of the text, with the note `default-expression`.",
        "no clause: not URDF",
        _leaves_expressions,
    ),
    Class(
        "drake urchin: refused: theirs",
        "Transmissions: Drake and urchin refuse those of joints that are not there, and two actuators of a name. sim-"
        "action reads no motor from them, with the note `unknown-reference`.",
        "wiki.ros.org/urdf/XML/Transmission: no clause on either",
        _says("Transmission", "joint actuator", "'reduction'"),
    ),
    Class(
        "drake urchin: refused: specification",
        "A joint that mimics one that is not there, or that is fixed: Drake and urchin refuse it. sim-action refuses "
        "the first (`bad-mimic`), and notes the second (`still-mimic`).",
        _MIMIC,
        _says("mimic"),
    ),
    Class(
        "drake: refused: specification",
        "`<loop_joint>`, an element of other tools: Drake refuses it, the others pass over it; sim-action with a note.",
        "no clause: not an element of URDF",
        _says("loop joints"),
    ),
    Class(
        "pybullet: refused: theirs",
        "PyBullet cannot hold more than 127 joints. sim-action says so, and simulates the robot on MuJoCo.",
        "no clause: the specification has no limit",
        lambda it: len(it.root.findall("joint")) > _MAX_BULLET_JOINTS,
    ),
    Class(
        "all: refused: specification",
        "Numbers that are none, or too many or too few: some readers take what they can. sim-action refuses them.",
        '"xyz: Represents the x,y,z offset"; "rpy: Represents the fixed axis roll, pitch and yaw angles"',
        _we_say("bad-number"),
    ),
    Class(
        "mujoco: refused: specification",
        "A second `<axis>` of a joint: MuJoCo refuses it, the others take one. sim-action takes the first.",
        "no clause: the specification does not say how many there may be",
        _says("repeated element"),
    ),
    Class(
        "drake: refused: specification",
        "Joints of the type `spherical`, of Bullet and others: Drake refuses them. sim-action reads a ball joint.",
        "no clause: not a type of URDF",
        _says("has unrecognized type"),
    ),
    Class(
        "drake: joint: specification",
        "Drake names free motions after the link that moves: that of the base, and that of the child of a floating "
        "joint.",
        "no clause: the root of the tree has no joint",
        lambda it: _is_free(it.theirs) or (it.theirs is None and _is("floating")(it)),
    ),
    Class(
        "drake: link: specification",
        'Drake and MuJoCo have a body "world" of their own: to Drake, a root link of this name is that body.',
        "no clause: names of links have no meaning",
        lambda it: it.name == "world",
    ),
)
