"""Check elements and attributes: missing, repeated, and not numbers (wiki.ros.org/urdf/XML)."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.documents.urdf_elements import CONTACT, MAX_NUMBER, MOMENTS, SHAPES, is_expression, is_numbers
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding

_REQUIRED: Final = {
    "link": ("name",),
    "joint": ("name", "type"),
    "joint/parent": ("link",),
    "joint/child": ("link",),
    "joint/mimic": ("joint",),
    "link/inertial/mass": ("value",),
    "link/inertial/inertia": MOMENTS,
    **{f"link/collision/geometry/{tag}": names for tag, names in SHAPES.items()},
    "link/collision/geometry/mesh": ("filename",),
    "link/visual/geometry/mesh": ("filename",),
}
_CHILDREN: Final = {"joint": ("parent", "child"), "link/collision": ("geometry",), "link/inertial": ("mass", "inertia")}
_MAX_SHOWN_CHARS: Final = 100
_LIMIT: Final = {"lower": 1, "upper": 1, "effort": 1, "velocity": 1}
_DYNAMICS: Final = {"damping": 1, "friction": 1, "spring_stiffness": 1, "spring_reference": 1}

_NUMBERS: Final = {
    "link/inertial/origin": {"xyz": 3, "rpy": 3},
    "link/inertial/mass": {"value": 1},
    "link/inertial/inertia": dict.fromkeys(MOMENTS, 1),
    "link/collision/origin": {"xyz": 3, "rpy": 3},
    "link/visual/origin": {"xyz": 3, "rpy": 3},
    "link/collision/geometry/box": {"size": 3},
    "link/collision/geometry/sphere": {"radius": 1},
    "link/collision/geometry/cylinder": {"radius": 1, "length": 1},
    "link/collision/geometry/capsule": {"radius": 1, "length": 1},
    "link/collision/geometry/mesh": {"scale": 3},
    "link/visual/geometry/mesh": {"scale": 3},
    "joint/origin": {"xyz": 3, "rpy": 3},
    "joint/axis": {"xyz": 3},
    "joint/axis2": {"xyz": 3},
    "joint/limit": _LIMIT,
    "joint/limit2": _LIMIT,
    "joint/dynamics": _DYNAMICS,
    "joint/dynamics2": _DYNAMICS,
    "joint/mimic": {"multiplier": 1, "offset": 1},
    "link/contact/inertia_scaling": {"value": 1},
    **{f"link/contact/{tag}": {"value": 1} for tag in CONTACT},
}
"""Path -> attribute -> the count of numbers that it must hold."""

_NOT_NEGATIVE: Final = {
    **dict.fromkeys(("dynamics", "dynamics2"), ("damping", "friction", "spring_stiffness")),
    **dict.fromkeys(CONTACT, ("value",)),
}
"""Tag -> attributes that must not be negative, because a negative value would add energy."""

# With a contact/inertia_scaling of 0, Bullet makes a body that no torque can turn.
_ABOVE_ZERO: Final = ("inertia_scaling",)

_HINTS: Final = {
    "mujoco": "; it is MJCF, which only MuJoCo reads: rename the file to end in .xml",
    "gazebo": "; it is older than SDF 1.3: convert it with 'gz sdf -p'",
}
"""Root element of another format -> the next step."""

_OPTENV: Final = re.compile(r"\$\(optenv\s+\w+\s*([^()]*)\)")
_LIKENESS: Final = 0.75
_MAX_TAG_CHARS: Final = 30


def root(document: ModelDocument) -> Iterator[Finding]:
    """Yield a finding if the file is not a URDF, or has no link."""
    root = document.root
    if root.tag != "robot":
        message = f"the root element of a URDF is <robot>, but this file has <{root.tag}>"
        yield document.finding("not-a-robot", root, message + _HINTS.get(root.tag, ""))
    elif root.find("link") is None:
        yield document.finding("not-a-robot", root, "the model has no <link>; at least one is required")


def required_attributes(document: ModelDocument) -> Iterator[Finding]:
    """Yield elements without a required attribute."""
    for path, names in _REQUIRED.items():
        for element in document.elements(path):
            for name in names:
                if not element.get(name):
                    yield document.finding("missing-part", element, f"<{element.tag}> has no attribute '{name}'")


def required_children(document: ModelDocument) -> Iterator[Finding]:
    """Yield elements without a required child element."""
    for path, tags in _CHILDREN.items():
        for element in document.elements(path):
            for tag in tags:
                if element.find(tag) is None:
                    yield document.finding("missing-part", element, f"<{element.tag}> has no <{tag}>")
    for collision in document.elements("link/collision"):
        geometry = collision.find("geometry")
        if geometry is not None and len(geometry) == 0:
            yield document.finding("missing-part", collision, "<geometry> has no shape")


def numbers(document: ModelDocument) -> Iterator[Finding]:
    """Yield attributes that do not hold the required count of finite numbers, or a number out of range."""
    # Only the first shape of a <geometry> is read.
    unread = {shape for geometry in document.root.iter("geometry") for shape in geometry[1:]}
    for path, counts in _NUMBERS.items():
        for element in document.elements(path):
            if element in unread:
                continue
            for name, count in counts.items():
                yield from _not_numbers(document, element, path, name, count, required=name in _REQUIRED.get(path, ()))


def _not_numbers(
    document: ModelDocument, element: Element, path: str, name: str, count: int, *, required: bool
) -> Iterator[Finding]:
    text = element.get(name)
    if text is None:
        return
    shown = text if len(text) <= _MAX_SHOWN_CHARS else f"{text[:_MAX_SHOWN_CHARS]}..."
    message = f'<{element.tag} {name}="{shown}">: expected {_wanted(text, count)}'
    if is_expression(text):
        message += "; this is a xacro expression: expand the file, or use the .xacro file as the model"
    if is_expression(text) and not required:
        # A wrong place of what is only drawn does not change the motion.
        rule = "passed-over" if path.startswith("link/visual") else "unexpanded-expression"
        yield document.finding(rule, element, message)
    elif not is_numbers(text, count):
        yield document.finding("bad-number", element, message)
    elif count == 1 and (due := _due(element.tag, name, float(text))) is not None:
        message = f'<{element.tag} {name}="{text}">: expected a number {due}'
        yield document.finding("bad-number", element, message)


def _due(tag: str, name: str, value: float) -> str | None:
    if tag in _ABOVE_ZERO and value <= 0:
        return "above 0"
    return "of 0 or more" if name in _NOT_NEGATIVE.get(tag, ()) and value < 0 else None


def _wanted(text: str, count: int) -> str:
    """Return the required form of a value, and the first difference from it."""
    if count == 1:
        return f"a finite number of at most {MAX_NUMBER:g}" if _is_large(text) else "a finite number"
    wanted, words = f"{count} finite numbers", text.split()
    if "," in text:
        return f"{wanted}, separated by spaces, not commas"
    if len(words) != count:
        return f"{wanted}, found {len(words)}"
    return f"{wanted} of at most {MAX_NUMBER:g}" if any(map(_is_large, words)) else wanted


def _is_large(word: str) -> bool:
    try:
        return word[-1:].isdigit() and abs(float(word)) > MAX_NUMBER
    except ValueError:
        return False


def nearest_tag(tag: str, known: tuple[str, ...]) -> str | None:
    """Return the closest name, of several equally close ones the first; None if none is close."""
    if len(tag) > _MAX_TAG_CHARS or not known:
        return None
    by_letters = {name.lower(): name for name in known}
    found = difflib.get_close_matches(tag.lower(), by_letters, n=len(known), cutoff=_LIKENESS)
    # The order of equally close matches is reversed.
    best = [name for name in found if _likeness(name, tag) == _likeness(found[0], tag)]
    return by_letters[min(best, key=list(by_letters).index)] if best else None


def _likeness(name: str, tag: str) -> float:
    return difflib.SequenceMatcher(None, name, tag.lower()).ratio()


def repeated_inertials(document: ModelDocument) -> Iterator[Finding]:
    """Yield every <inertial> of a link after the first."""
    for link in document.elements("link"):
        for inertial in link.findall("inertial")[1:]:
            message = (
                f"link '{link.attrib['name']}' has a second <inertial>, which is ignored; combine both, or remove it"
            )
            yield document.finding("second-inertial", inertial, message)


def default_expressions(document: ModelDocument) -> Iterator[Finding]:
    """Replace each $(optenv NAME DEFAULT) by its default, as xacro does without such a variable, and yield a note."""
    for element in document.root.iter():
        for name, text in element.attrib.items():
            if "$(optenv " in text:
                element.set(name, _OPTENV.sub(r"\1", text))
                message = (
                    f'<{element.tag} {name}="{text[:_MAX_SHOWN_CHARS]}">: "{element.get(name)}" is used, the default'
                )
                yield document.finding("default-expression", element, message)


def restitutions(document: ModelDocument) -> Iterator[Finding]:
    """Yield restitutions above 0 in Bullet's <contact>, and anywhere in <gazebo>. Nothing bounces in the simulation."""
    for part in document.elements("link/contact/restitution", "link/collision/contact/restitution"):
        yield from _bounce(document, part, part.get("value", ""))
    for tag in document.elements("gazebo"):
        for part in tag.iter("restitution_coefficient"):
            yield from _bounce(document, part, part.get("value", part.text or "").strip())


def _bounce(document: ModelDocument, part: Element, text: str) -> Iterator[Finding]:
    if is_numbers(text, 1) and float(text) > MAX_IGNORED_RESTITUTION:
        yield document.finding("restitution", part, no_bounce(f"<{part.tag}> is {float(text):g}"))


MAX_IGNORED_RESTITUTION: Final = 0.1
"""A contact with at most this restitution loses 99 % of its energy: that nothing bounces is not reported."""


def no_bounce(found: str, remedy: str = "set it to 0") -> str:
    """Return the message of the rule `restitution`; `found`: the stated value and its place; `remedy`: the change."""
    return f"{found}, but nothing bounces in the simulation: {remedy}, or ignore it by robot.allow"
