"""Parts and attributes that elements must have, and numbers where they are due (wiki.ros.org/urdf/XML)."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.messages import FirstFew, did_you_mean
from sim_action.robot.robot_model import Finding
from sim_action.robot.urdf_elements import (
    CONTACT,
    MOMENTS,
    MOST,
    NUMBERS,
    SHAPES,
    is_expression,
    is_numbers,
    number_text,
)
from sim_action.robot.xml_document import ModelDocument

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

_LONGEST_SHOWN: Final = 100

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
    "joint/origin": {"xyz": 3, "rpy": 3},
    "joint/axis": {"xyz": 3},
    "joint/limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "joint/dynamics": {"damping": 1, "friction": 1},
    "joint/mimic": {"multiplier": 1, "offset": 1},
    "link/contact/inertia_scaling": {"value": 1},
    **{f"link/contact/{tag}": {"value": 1} for tag in CONTACT},
}
"""Path -> attribute -> how many numbers it holds."""

_NOT_NEGATIVE: Final = {
    "limit": ("effort", "velocity"),
    "dynamics": ("damping", "friction"),
    **dict.fromkeys(CONTACT, ("value",)),
}
"""Tag -> attributes that would push where they are to brake."""

# Bullet's contact/inertia_scaling by 0 leaves a body that no torque turns.
_ABOVE_ZERO: Final = ("inertia_scaling",)

_HINTS: Final = {
    "mujoco": "; it is MJCF, which MuJoCo alone reads: give its file a name that ends in .xml",
    "gazebo": "; it is older than SDF 1.4: 'gz sdf -p' writes a newer one",
}
"""What is to be done about other formats, by their root."""


def root(document: ModelDocument) -> Iterator[Finding]:
    """Whether it is a URDF at all."""
    root = document.root
    if root.tag != "robot":
        message = f"a URDF begins with <robot>, this file with <{root.tag}>"
        yield document.finding("not-a-robot", root, message + _HINTS.get(root.tag, ""))
    elif root.find("link") is None:
        yield document.finding("not-a-robot", root, "a model has at least one <link>, this one has none")


def required_attributes(document: ModelDocument) -> Iterator[Finding]:
    """Attributes that must be there."""
    for path, names in _REQUIRED.items():
        for element in document.elements(path):
            for name in names:
                if not element.get(name):
                    yield document.finding("missing-part", element, f"<{element.tag}> without '{name}'")


def required_children(document: ModelDocument) -> Iterator[Finding]:
    """Elements that must be in others."""
    for path, tags in _CHILDREN.items():
        for element in document.elements(path):
            for tag in tags:
                if element.find(tag) is None:
                    yield document.finding("missing-part", element, f"<{element.tag}> without <{tag}>")
    for collision in document.elements("link/collision"):
        geometry = collision.find("geometry")
        if geometry is not None and len(geometry) == 0:
            yield document.finding("missing-part", collision, "a <geometry> without a shape")


def numbers(document: ModelDocument) -> Iterator[Finding]:
    """Every attribute that holds numbers holds as many as it should, and they are finite."""
    for path, counts in _NUMBERS.items():
        for element in document.elements(path):
            for name, count in counts.items():
                yield from _not_numbers(document, element, name, count, required=name in _REQUIRED.get(path, ()))


def _not_numbers(
    document: ModelDocument, element: Element, name: str, count: int, *, required: bool
) -> Iterator[Finding]:
    text = element.get(name)
    if text is None:
        return
    shown = text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."
    message = f'<{element.tag} {name}="{shown}">: expected {_wanted(text, count)}'
    if is_expression(text):
        message += "; this is an expression of xacro: expand it, or name the .xacro file"
    if is_expression(text) and not required:
        yield document.finding("unexpanded-expression", element, message)
    elif not is_numbers(text, count):
        yield document.finding("bad-number", element, message)
    elif count == 1 and (due := _due(element.tag, name, float(text))) is not None:
        message = f'<{element.tag} {name}="{text}">: expected a number {due}'
        yield document.finding("bad-number", element, message)


def _due(tag: str, name: str, value: float) -> str | None:
    """What a number that is too low should be."""
    if tag in _ABOVE_ZERO and value <= 0:
        return "above 0"
    return "of 0 or more" if name in _NOT_NEGATIVE.get(tag, ()) and value < 0 else None


def _wanted(text: str, count: int) -> str:
    """What is due, and what is wrong with what there is."""
    if count == 1:
        return f"a finite number of {MOST:g} at most" if _is_large(text) else "a finite number"
    wanted, words = f"{count} finite numbers", text.split()
    if "," in text:
        return f"{wanted} with spaces between them, not commas"
    if len(words) != count:
        return f"{wanted}, found {len(words)}"
    return f"{wanted} of {MOST:g} at most" if any(map(_is_large, words)) else wanted


def _is_large(word: str) -> bool:
    try:
        return word[-1:].isdigit() and abs(float(word)) > MOST
    except ValueError:
        return False


# Above the elements of others that are known, there are those of URDF.
_KNOWN: Final = {
    ".": ("link", "joint", "material", "transmission", "gazebo", "group", "sensor", "plugin", "ros2_control"),
    "link": ("inertial", "collision", "visual", "contact", "material", "gravity", "sensor"),
    "link/inertial": ("origin", "mass", "inertia"),
    "link/collision": ("origin", "geometry", "material", "contact", "verbose"),
    "joint": (
        "parent",
        "child",
        "origin",
        "axis",
        "limit",
        "dynamics",
        "mimic",
        "safety_controller",
        "calibration",
        "joint_properties",
    ),
}
"""Path of what they are in -> names."""

_LIKENESS: Final = 0.75
_LONGEST: Final = 30
# Each compares a name with others.
_MOST_TOLD: Final = 100


def misspelled_tags(document: ModelDocument) -> Iterator[Finding]:
    """Names of elements that are nearly one that is read."""
    near: dict[tuple[str, str], str | None] = {}
    for path, known in _KNOWN.items():
        for element in document.elements(path):
            for child in element:
                if child.tag in known or len(child.tag) > _LONGEST or len(near) > _MOST_TOLD:
                    continue
                if (path, child.tag) not in near:
                    near[path, child.tag] = _nearest(child.tag, known)
                meant = near[path, child.tag]
                if meant is not None:
                    message = f"<{child.tag}> in <{element.tag}> is read by nobody; did you mean <{meant}>?"
                    yield document.finding("unknown-tag", child, message)


def _nearest(tag: str, known: tuple[str, ...]) -> str | None:
    found = difflib.get_close_matches(tag.lower(), known, n=1, cutoff=_LIKENESS)
    return found[0] if found else None


def repeated_inertials(document: ModelDocument) -> Iterator[Finding]:
    """A second <inertial>: parts that weigh something are links of their own."""
    for link in document.elements("link"):
        for inertial in link.findall("inertial")[1:]:
            message = (
                f"a second <inertial> in link '{link.attrib['name']}': the first counts; add them up, or remove it"
            )
            yield document.finding("second-inertial", inertial, message)


def gazebo_numbers(document: ModelDocument) -> Iterator[Finding]:
    """Coefficients are numbers, and not below zero."""
    for tag in document.elements("gazebo"):
        for name in NUMBERS:
            text = number_text(tag, name)
            if text is None:
                continue
            message = f"<{name}>{text}</{name}>: expected a finite number that is not negative"
            if is_expression(text):
                yield document.finding("unexpanded-expression", tag, f"{message}; expand this expression of xacro")
            elif not is_numbers(text, 1) or float(text) < 0:
                yield document.finding("bad-number", tag, message)


def gazebo_references(document: ModelDocument) -> Iterator[Finding]:
    """What is said of a link is said of one that is there."""
    names = {element.attrib["name"] for element in document.elements("link", "joint")}
    hinted = FirstFew()
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is not None and name not in names:
            hint = did_you_mean(name, names) if hinted.one_more() else ""
            message = f'<gazebo reference="{name}">: no link or joint has this name{hint}'
            yield document.finding("unknown-reference", tag, message)


def gazebo_frictions(document: ModelDocument) -> Iterator[Finding]:
    """Friction is the same in all directions: the engines have one coefficient."""
    for tag in document.elements("gazebo"):
        mu1, mu2 = (number_text(tag, name) for name in ("mu1", "mu2"))
        if mu1 and mu2 and not is_expression(mu1 + mu2) and float(mu1) != float(mu2):
            message = f"friction of {mu1} in one direction and {mu2} in the other: mu1 counts in both"
            yield document.finding("two-frictions", tag, message)
