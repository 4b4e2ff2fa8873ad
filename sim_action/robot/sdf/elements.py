"""What is wrong or odd about an SDF, found while it is converted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, TypeVar
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.messages import shown
from sim_action.robot.audit.rules import finding
from sim_action.robot.robot_model import Finding
from sim_action.robot.urdf_elements import UNLIMITED, is_numbers

Subject = TypeVar("Subject")
Result = TypeVar("Result")


class SdfProblem(Exception):
    """A rule of the audit that an element breaks, and that leaves nothing to go on with."""

    def __init__(self, rule: str, element: Element, message: str) -> None:
        self.rule = rule
        self.element = element
        super().__init__(message)


@dataclass
class Notes:
    """What was found so far.

    Attributes:
        places: where each element of all files was written.
    """

    places: dict[Element, Location] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    _told: set[SdfProblem] = field(default_factory=set)

    @property
    def hopeless(self) -> bool:
        """Whether there can be no robot."""
        return any(finding.level == "fatal" for finding in self.findings)

    def tell(self, rule: str, element: Element, message: str) -> None:
        """Notes a finding."""
        self.findings.append(finding(rule, message, self.places[element]))

    def attempt(self, step: Callable[[Subject], Result], subject: Subject) -> Result | None:
        """What a step makes of something; what makes it impossible is noted once, and the next one may find more."""
        try:
            return step(subject)
        except SdfProblem as problem:
            if problem not in self._told:
                self._told.add(problem)
                self.tell(problem.rule, problem.element, str(problem))
            return None


_TRUE: Final = frozenset({"true", "1"})
_FALSE: Final = frozenset({"false", "0"})
_INFINITE: Final = frozenset({"inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"})


def text_of(parent: Element, path: str) -> str:
    """The text of an element below; empty if there is none."""
    element = parent.find(path)
    return "" if element is None else (element.text or "").strip()


def numbers_of(element: Element, count: int) -> tuple[float, ...]:
    """So many finite numbers. Raises SdfProblem."""
    text = (element.text or "").strip()
    if not is_numbers(text, count):
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise SdfProblem("bad-number", element, f"<{element.tag}> is {shown(text)}: expected {wanted}")
    return tuple(map(float, text.split()))


def number_of(parent: Element, path: str, otherwise: float) -> float:
    """One finite number below an element, or what the format has for one that is left out. Raises SdfProblem."""
    element = parent.find(path)
    return otherwise if element is None else numbers_of(element, 1)[0]


def needed(parent: Element, tag: str) -> Element:
    """An element that must be there. Raises SdfProblem."""
    element = parent.find(tag)
    if element is None:
        raise SdfProblem("missing-part", parent, f"<{parent.tag}> without <{tag}>")
    return element


def limit_of(limit: Element | None, tag: str, otherwise: float) -> float:
    """A limit of a joint, which may be infinite; at most UNLIMITED either way. Raises SdfProblem."""
    element = None if limit is None else limit.find(tag)
    if element is None:
        return otherwise
    text = (element.text or "").strip().lower()
    value = float(text) if text in _INFINITE else numbers_of(element, 1)[0]
    return max(-UNLIMITED, min(UNLIMITED, value))


def vector_of(element: Element) -> Vector3:
    """Three finite numbers. Raises SdfProblem."""
    x, y, z = numbers_of(element, 3)
    return (x, y, z)


def flag_of(parent: Element, path: str) -> bool:
    """Whether an element below says yes; left out, it says no. Raises SdfProblem."""
    element = parent.find(path)
    return element is not None and _is_true(element, element.text or "")


def says_yes(element: Element, attribute: str) -> bool:
    """Whether an attribute says so; left out, it says no. Raises SdfProblem."""
    return _is_true(element, element.get(attribute, "false"))


def pose_of(element: Element | None) -> Pose:
    """What a <pose> says, in whichever frame; none, or an empty one, is the frame itself. Raises SdfProblem."""
    if element is None or not (element.text or "").strip():
        return Pose()
    kind = element.get("rotation_format", "euler_rpy")
    if kind == "quat_xyzw":
        return _with_quaternion(element)
    if kind != "euler_rpy":
        message = f"rotation_format is {shown(kind)}: there are 'euler_rpy' and 'quat_xyzw'"
        raise SdfProblem("bad-number", element, message)
    x, y, z, *angles = numbers_of(element, 6)
    if says_yes(element, "degrees"):
        angles = [math.radians(angle) for angle in angles]
    roll, pitch, yaw = angles
    return Pose((x, y, z), geometry.quaternion_from_rpy(roll, pitch, yaw))


def _with_quaternion(element: Element) -> Pose:
    x, y, z, *rotation = numbers_of(element, 7)
    length = math.hypot(*rotation)
    if not 0 < length < math.inf:
        raise SdfProblem("bad-number", element, f"a quaternion of length {length:g} is no rotation")
    qx, qy, qz, qw = (part / length for part in rotation)
    return Pose((x, y, z), (qx, qy, qz, qw))


def _is_true(element: Element, text: str) -> bool:
    word = text.strip().lower()
    if word not in _TRUE | _FALSE:
        raise SdfProblem("bad-number", element, f"<{element.tag}> is {shown(text)}: expected true or false")
    return word in _TRUE
