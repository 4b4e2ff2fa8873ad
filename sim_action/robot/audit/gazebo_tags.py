"""Check the <gazebo> tags of URDF (classic.gazebosim.org, "URDF in Gazebo"), and name their parts that do not count.

Gazebo copies unknown elements into its SDF. So the parts of SDF that are not simulated count here as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final

from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.robot.audit.elements import misspelled
from sim_action.robot.audit.unsupported_parts import PARTS, Default, note_part, note_plugin, note_sensors
from sim_action.robot.documents.sdf_elements import Notes
from sim_action.robot.documents.urdf_elements import NUMBERS, SPRING, flag, is_expression, is_numbers, number_text
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.robot_model import Finding

_UNSUPPORTED: Final[Mapping[str, Mapping[str, Default]]] = MappingProxyType(
    {
        "model": {**PARTS["model"], "link": None, "joint": None, "model": None, "include": None},
        "link": {
            **PARTS["link"],
            "turnGravityOff": False,
            "dampingFactor": 0.0,
            "maxVel": 0.01,
            "fdir1": (0.0, 0.0, 0.0),
            "selfCollide": False,
        },
        "joint": {},
    }
)
"""Owner of a <gazebo> tag -> path of a part -> the value that has no effect."""

_OTHERS: Final = (
    *("material", "visual", "collision", "surface", "laserRetro", "inertial", "pose", "light", "projector", "battery"),
    *(
        "sensor",
        "plugin",
        "static",
        "minDepth",
        "maxContacts",
        "stopCfm",
        "stopErp",
        "stopKp",
        "stopKd",
        "fudgeFactor",
        "provideFeedback",
    ),
    *("implicitSpringDamper", "cfmDamping", "disableFixedJointLumping", "preserveFixedJoint", "velocity_decay"),
    *("particle_emitter", "audio_source", "audio_sink", "physics", "axis", "frame", "fudgeFactor"),
    "provideFeedback",
)
"""Known parts with a meaning of their own, or none for the motion."""

_KNOWN: Final = {
    "gazebo": (
        *NUMBERS,
        *SPRING,
        *dict.fromkeys(path for parts in _UNSUPPORTED.values() for path in parts if "/" not in path),
        *_OTHERS,
    )
}


def coefficients(document: ModelDocument) -> Iterator[Finding]:
    """Yield contact coefficients in <gazebo> that are not numbers, or are negative."""
    for tag in document.elements("gazebo"):
        for name in (*NUMBERS, *SPRING):
            text = number_text(tag, name)
            if text is None:
                continue
            may_be_negative = name == "springReference"
            wanted = "a finite number" if may_be_negative else "a finite number of 0 or more"
            message = f"<{name}>{text}</{name}>: expected {wanted}"
            if is_expression(text):
                yield document.finding(
                    "unexpanded-expression", tag, f"{message}; this is a xacro expression: expand the file"
                )
            elif not is_numbers(text, 1) or (float(text) < 0 and not may_be_negative):
                yield document.finding("bad-number", tag, message)


def references(document: ModelDocument) -> Iterator[Finding]:
    """Yield <gazebo> tags that refer to an unknown link or joint."""
    names = {element.attrib["name"] for element in document.elements("link", "joint")}
    hinted = FirstFew()
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is not None and name not in names:
            hint = did_you_mean(name, names) if hinted.one_more() else ""
            message = f'<gazebo reference="{name}">: no link or joint has this name{hint}'
            yield document.finding("unknown-reference", tag, message)


def frictions(document: ModelDocument) -> Iterator[Finding]:
    """Yield links whose friction depends on the direction. The engines have one coefficient for all directions."""
    for tag in document.elements("gazebo"):
        mu1, mu2 = (number_text(tag, name) for name in ("mu1", "mu2"))
        if mu1 and mu2 and not is_expression(mu1 + mu2) and float(mu1) != float(mu2):
            message = (
                f"mu1 is {mu1} and mu2 is {mu2}, but friction cannot depend on the direction: mu1 is used for both"
            )
            yield document.finding("two-frictions", tag, message)


def misspelled_parts(document: ModelDocument) -> Iterator[Finding]:
    """Yield unknown elements in <gazebo> whose name is close to a known one."""
    yield from misspelled(document, _KNOWN)


def unsupported_parts(document: ModelDocument) -> Iterator[Finding]:
    """Yield a note for each kind of parts that would change the motion but are not simulated."""
    notes = Notes()
    joints = {joint.attrib["name"] for joint in document.elements("joint")}
    links = {link.attrib["name"] for link in document.elements("link")}
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is not None and name not in joints | links:
            continue
        kind = "model" if name is None else "link" if name in links else "joint"
        owner = "the model" if name is None else f"{kind} '{name}'"
        for path, default in _UNSUPPORTED[kind].items():
            part = tag.find(path)
            if part is not None and _has_effect(text := number_text(tag, path) or "", default):
                note_part(notes, f"{kind}/{path}", part, text, owner)
        note_sensors(notes, tag, owner)
        for plugin in tag.findall("plugin"):
            note_plugin(notes, plugin)
    notes.places = {part: document.places[part] for part in notes.left_out}
    notes.report_parts()
    yield from notes.findings


def _has_effect(text: str, default: Default) -> bool:
    if default is None:
        return True
    if isinstance(default, bool):
        return flag(text) != default
    expected = default if isinstance(default, tuple) else (default,)
    return not is_numbers(text, len(expected)) or tuple(map(float, text.split())) != expected
