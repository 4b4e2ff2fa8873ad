"""Read values of SDF elements (sdformat.org/spec): numbers, flags, poses; and collect problems on the way."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final, TypeVar
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass, field
from sim_action.core.wording import shown
from sim_action.robot.documents.part_table import Unread
from sim_action.robot.documents.urdf_elements import is_numbers
from sim_action.robot.model.draft import UNLIMITED
from sim_action.robot.model.findings import Finding, Places, finding

Subject = TypeVar("Subject")
Result = TypeVar("Result")
MODEL_FRAME: Final = "__model__"  # the name of the frame of the model around an element
_TRUE: Final = frozenset({"true", "1"})
_FALSE: Final = frozenset({"false", "0"})

# Exporters write the largest number of a type for "no limit", such as -1.79769e+308.
_HUGE: Final = re.compile(r"[+-]?[0-9]+(\.[0-9]*)?e\+?[0-9]{2,3}")

_INFINITE: Final = frozenset({"inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"})


_IGNORED: Final = "is not simulated; it is ignored"
_CONSEQUENCES: Final = {"harmless-part": "does not change the motion", "unknown-part": "is unknown and is not read"}
"""Rule -> what a finding says about a part."""


class SdfProblem(Exception):
    """An element breaks a rule of the audit, so that it cannot be read."""

    def __init__(self, rule: str, element: Element, message: str) -> None:
        self.rule = rule
        self.element = element
        super().__init__(message)


@dataclass()
class Notes:
    """The findings of one file."""

    places: dict[Element, Location] = field(default_factory=dict)  # the file and line of each element, of all files
    findings: list[Finding] = field(default_factory=list)
    # place and name of an unknown element -> the known name that is close to it
    nearest: dict[tuple[str, str], str | None] = field(default_factory=dict)
    _parts: dict[str, tuple[Element, str, str, str, list[Element]]] = field(default_factory=dict)
    _reported: set[SdfProblem] = field(default_factory=set)

    def add(self, rule: str, element: Element, message: str) -> None:
        """Add a finding."""
        self.findings.append(finding(rule, message, self.places[element]))

    def leave_out(self, kind: str, part: Element, text: str, rule: str = "passed-over", meaning: str = "") -> None:
        """Note a part that is not simulated; `kind`: parts of one kind become one finding.

        `text`: the part and its owner, such as "<gravity> of link 'a'"; `meaning`: what follows from it.
        """
        *_, parts = self._parts.setdefault(kind, (part, text, rule, meaning, []))
        parts.append(part)

    def leave_unread(self, part: Unread, owner: str) -> None:
        """Note a part that is not read: one that is lost, harmless or unknown; `owner`: its name in messages."""
        row, kind, text = part.row, f"{part.place}/{part.name}", f"{part.stated} of {owner}"
        if row is None:
            self.leave_out(kind, part.element, text, "unknown-part")
        elif row.effect == "harmless":
            self.leave_out(kind, part.element, text, "harmless-part", row.text)
        elif row.is_lost(part.name, part.value):
            self.leave_out(kind, part.element, text, meaning=row.text)

    def report_parts(self) -> None:
        """Add a finding for each kind of parts that are not simulated."""
        for part, text, rule, meaning, parts in self._parts.values():
            places = Places(self.places[part])
            for other in parts:
                places.add(self.places[other])
            because = f": {meaning}" if meaning else ""
            self.add(rule, part, f"{text} {_CONSEQUENCES.get(rule, _IGNORED)}{because}{places}")
        self._parts.clear()

    def attempt(self, step: Callable[[Subject], Result], subject: Subject) -> Result | None:
        """Return the result of a step. If it raises SdfProblem, add that as a finding, once, and return None."""
        try:
            return step(subject)
        except SdfProblem as problem:
            if problem not in self._reported:
                self._reported.add(problem)
                self.add(problem.rule, problem.element, str(problem))
            return None


def text_of(parent: Element, path: str) -> str:
    """Return the text of an element below; empty if there is none."""
    element = parent.find(path)
    return "" if element is None else (element.text or "").strip()


def numbers_of(element: Element, count: int) -> tuple[float, ...]:
    """Return exactly `count` finite numbers. Raises SdfProblem."""
    text = (element.text or "").strip()
    if not is_numbers(text, count):
        form = "a finite number" if count == 1 else f"{count} finite numbers"
        raise SdfProblem("bad-number", element, f"<{element.tag}> is {shown(text)}: expected {form}")
    return tuple(map(float, text.split()))


def number_of(parent: Element, path: str, otherwise: float) -> float:
    """Return a finite number of an element below, or `otherwise` if there is none. Raises SdfProblem."""
    element = parent.find(path)
    return otherwise if element is None else numbers_of(element, 1)[0]


def needed(parent: Element, tag: str) -> Element:
    """Return a required child element. Raises SdfProblem."""
    element = parent.find(tag)
    if element is None:
        raise SdfProblem("missing-part", parent, f"<{parent.tag}> has no <{tag}>")
    return element


def amount_of(parent: Element, path: str) -> float:
    """Return a number of 0 or more of an element below, or 0 if there is none. Raises SdfProblem."""
    value = number_of(parent, path, 0.0)
    if value < 0:
        message = f"<{path.rpartition('/')[2]}> is '{value:g}': expected a finite number of 0 or more"
        raise SdfProblem("bad-number", needed(parent, path), message)
    return value


def limit_of(limit: Element | None, tag: str, otherwise: float) -> float:
    """Return a limit of a joint, which may be infinite, clipped to +-UNLIMITED. Raises SdfProblem."""
    element = None if limit is None else limit.find(tag)
    if element is None:
        return otherwise
    text = (element.text or "").strip().lower()
    value = float(text) if text in _INFINITE or _HUGE.fullmatch(text) else numbers_of(element, 1)[0]
    return max(-UNLIMITED, min(UNLIMITED, value))


def vector_of(element: Element | None, otherwise: Vector3 = geometry.ZERO) -> Vector3:
    """Return three finite numbers, or `otherwise` without an element. Raises SdfProblem."""
    x, y, z = otherwise if element is None else numbers_of(element, 3)
    return (x, y, z)


def flag_of(parent: Element, path: str) -> bool:
    """Return the flag in an element below; False if there is none. Raises SdfProblem."""
    element = parent.find(path)
    return element is not None and _is_true(element, element.text or "")


def flag_attribute(element: Element, attribute: str) -> bool:
    """Return the flag in an attribute; False if there is none. Raises SdfProblem."""
    return _is_true(element, element.get(attribute, "false"))


def pose_of(element: Element | None) -> Pose:
    """Return the pose in a <pose>, in its own frame; the identity if it is missing or empty. Raises SdfProblem."""
    if element is None or not (element.text or "").strip():
        return Pose()
    kind = element.get("rotation_format", "euler_rpy")
    if kind == "quat_xyzw":
        return _with_quaternion(element)
    if kind != "euler_rpy":
        message = f"rotation_format is {shown(kind)}; allowed are 'euler_rpy' and 'quat_xyzw'"
        raise SdfProblem("bad-number", element, message)
    x, y, z, *angles = numbers_of(element, 6)
    if flag_attribute(element, "degrees"):
        angles = [math.radians(angle) for angle in angles]
    roll, pitch, yaw = angles
    return Pose((x, y, z), geometry.quaternion_from_rpy(roll, pitch, yaw))


def _with_quaternion(element: Element) -> Pose:
    x, y, z, *rotation = numbers_of(element, 7)
    length = math.hypot(*rotation)
    if not 0 < length < math.inf:
        raise SdfProblem("bad-number", element, f"a quaternion of length {length:g} is not a rotation")
    qx, qy, qz, qw = (part / length for part in rotation)
    return Pose((x, y, z), (qx, qy, qz, qw))


def _is_true(element: Element, text: str) -> bool:
    word = text.strip().lower()
    if word not in _TRUE | _FALSE:
        raise SdfProblem("bad-number", element, f"<{element.tag}> is {shown(text)}: expected true or false")
    return word in _TRUE
