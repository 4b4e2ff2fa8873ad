"""Elements that nobody reads: of a name that is nearly one of URDF's, or a second one where one counts.

Models hold elements of other tools and of dialects: a name that is like none of URDF's is let pass.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Final

from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import Finding

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


def tags(document: ModelDocument) -> Iterator[Finding]:
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


def repeated(document: ModelDocument) -> Iterator[Finding]:
    """A second <inertial>: parts that weigh something are links of their own."""
    for link in document.elements("link"):
        for inertial in link.findall("inertial")[1:]:
            message = (
                f"a second <inertial> in link '{link.attrib['name']}': the first counts; add them up, or remove it"
            )
            yield document.finding("second-inertial", inertial, message)
